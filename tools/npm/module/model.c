/* Makes models and query objects of the WebAssembly module, and measures whole files. */
#include <stdlib.h>
#include <string.h>

#include "format/chunks.h"
#include "module.h"

/* Makes the model of an opened file. `memory` and `cut_level`: as in ebpo_model_options. */
int EBPO_JS(ebpo_js_load)(ebpo_js_object *object, double memory, int cut_level)
{
    ebpo_model_options options = EBPO_MODEL_OPTIONS_INIT;
    options.memory = (uint64_t)memory;
    options.cut_level = cut_level;
    options.threads = 1;
    return ebpo_model_new(object->file, &options, &object->model, &object->error);
}

void EBPO_JS(ebpo_js_unload)(ebpo_js_object *object)
{
    ebpo_model_free(object->model);
    object->model = NULL;
}

/* ---- queries ---- */

/* Returns an object that runs one query of a model at a time; NULL: out of memory. `model->model`
 * may be NULL, because streams and information of the file need no model. */
ebpo_js_object *EBPO_JS(ebpo_js_query)(const ebpo_js_object *model)
{
    ebpo_js_object *object = calloc(1, sizeof *object);
    if (!object)
        return NULL;
    object->error = (ebpo_error)EBPO_ERROR_INIT;
    object->file = model->file;
    object->model = model->model;
    object->async = model->async;
    if (!model->model ||
        ebpo_context_new(model->model, &object->context, &object->error) == EBPO_OK)
        return object;
    free(object);
    return NULL;
}

/* Discards the results and the decoded chunks of the last query, before another query. */
void EBPO_JS(ebpo_js_start)(ebpo_js_object *object)
{
    ebpo_js_clear(object);
    ebpo_chunks_free(object->chunks);
    object->chunks = NULL;
}

void EBPO_JS(ebpo_js_query_free)(ebpo_js_object *object)
{
    ebpo_stream_free(object->stream);
    ebpo_view_stream_free(object->view);
    ebpo_sampler_free(object->sampler);
    ebpo_chunks_free(object->chunks);
    ebpo_context_free(object->context);
    ebpo_js_free_arrays(object);
    free(object);
}

/* ---- results of the whole file ---- */

/* Gets statistics. Result array 0: double [11]: memory, peak of the memory, budget, 1 if the whole
 * model is in memory (else 0), cut level, hits, loads, evicted subtrees, bytes read, reads, and
 * supplied bytes that are in memory. */
int EBPO_JS(ebpo_js_stats)(ebpo_js_object *object)
{
    ebpo_model_stats s = EBPO_MODEL_STATS_INIT;
    ebpo_js_clear(object);
    if (object->model)
        ebpo_model_get_stats(object->model, &s);
    double values[] = { (double)s.memory,
                        (double)s.memory_peak,
                        (double)s.budget,
                        s.resident,
                        s.cut_level,
                        (double)s.hits,
                        (double)s.loads,
                        (double)s.evicted,
                        (double)s.bytes_read,
                        (double)s.reads,
                        (double)ebpo_async_bytes(object->async) };
    return ebpo_js_put(object, 0, values, sizeof values);
}

/* Measures the model (ebpo_mass). Result array 0: double [17]: area, volume, centroid (3), inertia
 * (9), lower and upper bound of the volume, integral of the winding number. */
int EBPO_JS(ebpo_js_measure)(ebpo_js_object *object)
{
    ebpo_mass m = EBPO_MASS_INIT;
    ebpo_js_clear(object);
    ebpo_status status = ebpo_measure(object->file, 1, &m, &object->error);
    if (status != EBPO_OK)
        return status;
    double values[17] = { m.area, m.volume };
    memcpy(values + 2, m.centroid, sizeof m.centroid);
    memcpy(values + 5, m.inertia, sizeof m.inertia);
    values[14] = m.volume_lo;
    values[15] = m.volume_hi;
    values[16] = m.integral;
    return ebpo_js_put(object, 0, values, sizeof values);
}
