#include "cli/query_args.h"

#include <stdio.h>

#include "cli/command.h"
#include "cli/words.h"

const char *const inside_modes[] = { "fast",        "cache",       "nodes",         "subtree",
                                     "cache-plain", "nodes-plain", "subtree-plain", NULL };
const char *const distance_modes[] = { "exact", "recursive", "leaves", "envelope", NULL };
const char *const ray_sides[] = { "both", "front", "back", NULL };

/* The options of the library for each mode, in the order of inside_modes. */
static const struct {
    ebpo_loading loading;
    ebpo_envelopes envelopes;
} inside_meanings[] = {
    { EBPO_LOAD_CACHE, EBPO_ENVELOPES_AUTO },   { EBPO_LOAD_CACHE, EBPO_ENVELOPES_USE },
    { EBPO_LOAD_NODES, EBPO_ENVELOPES_USE },    { EBPO_LOAD_SUBTREE, EBPO_ENVELOPES_USE },
    { EBPO_LOAD_CACHE, EBPO_ENVELOPES_SKIP },   { EBPO_LOAD_NODES, EBPO_ENVELOPES_SKIP },
    { EBPO_LOAD_SUBTREE, EBPO_ENVELOPES_SKIP },
};

/* --- options that have no effect with other options --- */

bool query_check_effect(const char *name, const query_values *v, unsigned ineffective,
                        const char *with)
{
    const struct {
        unsigned bit;
        bool given;
        const char *option;
    } all[] = { { QUERY_LEVEL, v->level >= 0, "--max-level" },
                { QUERY_DEADLINE, v->deadline != NULL, "--deadline" },
                { QUERY_MAX_DISTANCE, isfinite(v->max_distance), "--max-distance" },
                { QUERY_UNSIGNED, v->unsigned_distance, "--unsigned" },
                { QUERY_NO_WARM, v->no_warm, "--no-warm" },
                { QUERY_PREFETCH, v->prefetch, "--prefetch" } };
    for (size_t i = 0; i < sizeof all / sizeof *all; i++)
        if (all[i].given && ineffective & all[i].bit) {
            command_usage(name, "%s has no effect with %s; omit one of them", all[i].option, with);
            return false;
        }
    return true;
}

bool query_inside_fits(const char *name, const query_values *v)
{
    char with[40];
    snprintf(with, sizeof with, "--mode %s", inside_modes[v->inside_mode]);
    return inside_meanings[v->inside_mode].loading == EBPO_LOAD_CACHE ||
           query_check_effect(name, v, QUERY_PREFETCH, with);
}

bool query_distance_fits(const char *name, const query_values *v)
{
    /* SEARCH_OPTIONS: options that only the default search (--mode exact) uses. FACE_OPTIONS:
     * options that have no effect on distances to envelopes. */
    enum {
        SEARCH_OPTIONS = QUERY_LEVEL | QUERY_DEADLINE | QUERY_NO_WARM | QUERY_PREFETCH,
        FACE_OPTIONS =
            QUERY_DEADLINE | QUERY_MAX_DISTANCE | QUERY_UNSIGNED | QUERY_NO_WARM | QUERY_PREFETCH
    };
    static const unsigned ineffective[] = { 0, SEARCH_OPTIONS, SEARCH_OPTIONS, FACE_OPTIONS };
    const char *lists = v->nearest ? "--nearest" : "--within";
    char with[40];
    snprintf(with, sizeof with, "--mode %s", distance_modes[v->distance_mode]);
    if (query_lists(v) && v->distance_mode != EBPO_DISTANCE_EXACT) {
        command_usage(name, "%s has no effect with %s; omit one of them", lists, with);
        return false;
    }
    if (query_lists(v))
        return query_check_effect(name, v, SEARCH_OPTIONS | QUERY_MAX_DISTANCE | QUERY_UNSIGNED,
                                  lists);
    if (!query_check_effect(name, v, ineffective[v->distance_mode], with))
        return false;
    return v->level < 0 ||
           query_check_effect(name, v, QUERY_UNSIGNED | QUERY_NO_WARM | QUERY_PREFETCH,
                              "--max-level");
}

/* --- values --- */

static bool read_size(const char *name, const char *text, uint64_t *out)
{
    if (words_read_size(text, out))
        return true;
    command_usage(name, "--memory: '%s' is not " WORDS_SIZE_EXPECTED, text);
    return false;
}

bool query_read_time(const char *name, const char *text, uint64_t *out)
{
    static const char *const units[] = { "", "us", "ns", "ms", "s", NULL };
    static const uint64_t factors[] = { 1000, 1000, 1, 1000000, 1000000000 };
    if (words_read_unit(text, units, factors, out) && *out > 0 && *out < UINT64_C(1000000000000000))
        return true;
    command_usage(name,
                  "--deadline: '%s' is not a time such as 50us, 500ns, 1ms or 20 (microseconds)",
                  text);
    return false;
}

bool query_options_from(const char *name, const query_values *v, ebpo_model_options *model,
                        ebpo_inside_options *inside, ebpo_distance_options *distance)
{
    *model = (ebpo_model_options)EBPO_MODEL_OPTIONS_INIT;
    *inside = (ebpo_inside_options)EBPO_INSIDE_OPTIONS_INIT;
    *distance = (ebpo_distance_options)EBPO_DISTANCE_OPTIONS_INIT;
    /* Nodes below the level are not visited, so they need not be in memory. */
    model->cut_level =
        v->cut_level < 0 && !v->memory && v->level >= 0 ? (int)v->level : (int)v->cut_level;
    model->loading = inside_meanings[v->inside_mode].loading;
    model->prefetch = v->prefetch;
    model->threads = (unsigned)v->threads;
    model->threshold = v->threshold;
    inside->level = distance->level = (int)v->level;
    inside->envelopes = inside_meanings[v->inside_mode].envelopes;
    distance->mode = (ebpo_distance_mode)v->distance_mode;
    distance->unsigned_distance = v->unsigned_distance;
    distance->warm = !v->no_warm;
    distance->max_distance = v->max_distance;
    if ((v->memory && !read_size(name, v->memory, &model->memory)) ||
        (v->deadline && !query_read_time(name, v->deadline, &inside->deadline_ns)))
        return false;
    distance->deadline_ns = inside->deadline_ns;
    return true;
}

/* --- sessions --- */

int query_open_file(query_session *s, const char *name, const char *path,
                    const ebpo_model_options *options, int level, const remote_values *remote)
{
    ebpo_error error = EBPO_ERROR_INIT;
    if (!command_requires_hdf5(name, path))
        return EXIT_FAILED;
    if (remote_open(&s->file, path, remote, &error) != EBPO_OK)
        return command_failed(name, &error);
    const ebpo_info *info = ebpo_file_info(s->file);
    return command_has_level(name, info, level) && command_has_level(name, info, options->cut_level)
               ? EXIT_OK
               : EXIT_USAGE;
}

int query_open_model(query_session *s, const char *name, const ebpo_model_options *options)
{
    ebpo_error error = EBPO_ERROR_INIT;
    return ebpo_model_new(s->file, options, &s->model, &error) == EBPO_OK
               ? EXIT_OK
               : command_failed(name, &error);
}

int query_open(query_session *s, const char *name, const char *path,
               const ebpo_model_options *options, int level, const remote_values *remote)
{
    ebpo_error error = EBPO_ERROR_INIT;
    int code = query_open_file(s, name, path, options, level, remote);
    if (code == EXIT_OK)
        code = query_open_model(s, name, options);
    return code != EXIT_OK || ebpo_context_new(s->model, &s->context, &error) == EBPO_OK
               ? code
               : command_failed(name, &error);
}

void query_close(query_session *s)
{
    ebpo_context_free(s->context);
    ebpo_model_free(s->model);
    ebpo_close(s->file);
    *s = (query_session)QUERY_SESSION_INIT;
}
