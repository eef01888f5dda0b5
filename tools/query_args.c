#include "query_args.h"

#include <stdio.h>

#include "command.h"
#include "words.h"

const char *const inside_modes[] = { "fast", "cache", "nodes", "subtree", "cache-plain", "nodes-plain", "subtree-plain", NULL };
const char *const distance_modes[] = { "exact", "recursive", "leaves", "envelope", NULL };

static const struct {
    ebpo_loading loading;
    ebpo_envelopes envelopes;
} inside_meanings[] = {
    { EBPO_LOAD_CACHE, EBPO_ENVELOPES_AUTO },   { EBPO_LOAD_CACHE, EBPO_ENVELOPES_USE },  { EBPO_LOAD_NODES, EBPO_ENVELOPES_USE },
    { EBPO_LOAD_SUBTREE, EBPO_ENVELOPES_USE },  { EBPO_LOAD_CACHE, EBPO_ENVELOPES_SKIP }, { EBPO_LOAD_NODES, EBPO_ENVELOPES_SKIP },
    { EBPO_LOAD_SUBTREE, EBPO_ENVELOPES_SKIP },
};

static bool read_size(const char *name, const char *text, uint64_t *out)
{
    if (words_read_size(text, out))
        return true;
    fprintf(stderr, "ebpo %s: --memory: '%s' is not a size such as 64M, 1G, 512K or 1000000; try 'ebpo %s --help'\n", name, text, name);
    return false;
}

static bool read_time(const char *name, const char *text, uint64_t *out)
{
    static const char *const units[] = { "", "us", "ns", "ms", "s", NULL };
    static const uint64_t factors[] = { 1000, 1000, 1, 1000000, 1000000000 };
    if (words_read_unit(text, units, factors, out) && *out > 0 && *out < UINT64_C(1000000000000000))
        return true;
    fprintf(stderr, "ebpo %s: --deadline: '%s' is not a time such as 50us, 500ns, 1ms or 20 (microseconds); try 'ebpo %s --help'\n", name, text, name);
    return false;
}

bool query_options_from(const char *name, const query_values *v, ebpo_model_options *model, ebpo_query_options *query)
{
    *model = (ebpo_model_options)EBPO_MODEL_OPTIONS_INIT;
    *query = (ebpo_query_options)EBPO_QUERY_OPTIONS_INIT;
    model->cut_level = (int)v->cut_level;
    model->loading = inside_meanings[v->inside_mode].loading;
    model->prefetch = v->prefetch;
    model->threads = (unsigned)v->threads;
    query->level = (int)v->level;
    query->envelopes = inside_meanings[v->inside_mode].envelopes;
    query->mode = (ebpo_distance_mode)v->distance_mode;
    query->unsigned_distance = v->unsigned_distance;
    query->warm = !v->no_warm;
    query->max_distance = v->max_distance;
    return (!v->memory || read_size(name, v->memory, &model->memory)) && (!v->deadline || read_time(name, v->deadline, &query->deadline_ns));
}

int query_open(query_session *s, const char *name, const char *path, const ebpo_model_options *options, const remote_values *remote)
{
    ebpo_error error = EBPO_ERROR_INIT;
    int is_hdf5 = command_is_hdf5(name, path);
    if (is_hdf5 <= 0) {
        if (is_hdf5 == 0)
            fprintf(stderr, "ebpo %s: %s: is not an .ebpo.h5 file; make one of a mesh with 'ebpo convert'\n", name, path);
        return EXIT_FAILED;
    }
    ebpo_status status = remote_open(&s->file, path, remote, &error);
    if (status == EBPO_OK)
        status = ebpo_model_open(&s->model, s->file, options, &error);
    if (status == EBPO_OK)
        status = ebpo_context_new(&s->context, s->model, &error);
    return status == EBPO_OK ? EXIT_FINE : command_failed(name, &error);
}

void query_close(query_session *s)
{
    ebpo_context_free(s->context);
    ebpo_model_close(s->model);
    ebpo_close(s->file);
    *s = (query_session)QUERY_SESSION_INIT;
}
