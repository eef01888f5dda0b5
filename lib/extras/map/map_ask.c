#include "core/strict_fp.h"

#include "extras/map/map_ask.h"

#include <math.h>

#include "core/error.h"
#include "core/parallel.h"

ebpo_status ebpo_map_take_options(ebpo_map_options *out, const ebpo_map_options *given,
                                  ebpo_error *error)
{
    *out = (ebpo_map_options)EBPO_MAP_OPTIONS_INIT;
    ebpo_status status = EBPO_TAKE(ebpo_map_options, out, given, error);
    if (status == EBPO_OK && !(out->max_distance >= 0))
        return ebpo_fail(error, EBPO_E_ARGUMENT,
                         "max_distance must be 0 or more; INFINITY: everything matters");
    return status;
}

ebpo_status ebpo_map_askers_make(ebpo_map_askers *out, ebpo_model *model,
                                 const ebpo_map_options *options, ebpo_error *error)
{
    ebpo_distance_options distance = EBPO_DISTANCE_OPTIONS_INIT;
    distance.max_distance = options->max_distance;
    distance.unsigned_distance = options->unsigned_distance;
    *out = (ebpo_map_askers){ .model = model, .distance = distance };
    out->threads = ebpo_thread_count(options->threads);
    /* so that what cannot be asked at all is told before anything is made */
    ebpo_status status = ebpo_context_new(model, &out->context[0], error);
    return status == EBPO_OK ? ebpo_distance_many(out->context[0], NULL, 0, &distance, NULL, error)
                             : status;
}

void ebpo_map_askers_free(ebpo_map_askers *askers)
{
    for (int i = 0; i < EBPO_MAP_THREADS; i++)
        ebpo_context_free(askers->context[i]);
}

ebpo_status ebpo_map_ask(ebpo_map_askers *askers, unsigned worker, const double *points,
                         uint64_t count, ebpo_distance_result *results, ebpo_error *error)
{
    ebpo_context **own = &askers->context[worker];
    ebpo_status status = *own ? EBPO_OK : ebpo_context_new(askers->model, own, error);
    return status == EBPO_OK
               ? ebpo_distance_many(*own, points, count, &askers->distance, results, error)
               : status;
}
