/* Holds the model of a query command for all threads. The model is loaded as a whole, or in parts:
 * its upper levels, and below them single subtrees when queries need them. Each thread queries the
 * model through a separate context. */
#include "cli/commands/query_holding.h"

#include <ebpo/memory.h>
#include <inttypes.h>
#include <stdio.h>

#include "cli/command.h"
#include "cli/words.h"

/* A model of at most this size in bytes is always loaded as a whole, which takes some milliseconds.
 */
enum { SMALL_MODEL = 16 << 20 };

/* LOADS_MIN: number of loads that gives a reliable mean time of a load. SAFETY_FACTOR: the whole
 * model is loaded early only if the estimated number of loads is at least this factor times the
 * number of subtrees. */
enum { LOADS_MIN = 8, SAFETY_FACTOR = 4 };

/* --- opening --- */

/* Sets the options for loading in parts. A file that is stored subtree by subtree is cut at its
 * subtree level, so that each part is one read. Any other file is cut at the level that the library
 * would choose if the whole model did not fit in memory. */
static void cut_at_subtrees(query_holding *h)
{
    ebpo_model_options *o = &h->options;
    ebpo_model_plan parts = EBPO_MODEL_PLAN_INIT;
    uint64_t memory = o->memory;
    o->cut_level = ebpo_file_info(h->session.file)->subtree_level;
    if (o->cut_level == 0) {
        o->cut_level = -1;
        o->memory = h->plan.resident ? h->plan.whole - 1 : memory;
        o->cut_level =
            ebpo_model_memory(h->session.file, o, &parts, NULL) == EBPO_OK ? parts.cut_level : -1;
        o->memory = memory;
    }
    if (ebpo_model_memory(h->session.file, o, &parts, NULL) == EBPO_OK)
        h->subtrees = parts.subtrees;
}

/* Sets the memory limit to half of the free memory. If the least memory that the model needs is
 * greater, the limit is this memory. Decides whether to load the model in parts at first. */
static void decide_memory(query_holding *h)
{
    uint64_t half = (h->free_memory = ebpo_free_memory()) / 2;
    h->plan = (ebpo_model_plan)EBPO_MODEL_PLAN_INIT;
    if (ebpo_model_memory(h->session.file, &h->options, &h->plan, NULL) != EBPO_OK)
        return; /* the error is reported when the model is made */
    h->options.memory = half > h->plan.least ? half : h->plan.least;
    if (ebpo_model_memory(h->session.file, &h->options, &h->plan, NULL) != EBPO_OK ||
        (h->plan.resident && h->plan.whole <= SMALL_MODEL))
        return;
    cut_at_subtrees(h);
    h->may_load_all = h->plan.resident && h->subtrees;
}

/* Returns true if no option limits or determines which parts of the model are loaded. */
static bool is_unlimited(const query_values *v, const ebpo_model_options *o)
{
    return !v->memory && o->cut_level < 0 && o->loading == EBPO_LOAD_CACHE && !v->prefetch;
}

static void init_lock(query_holding *h)
{
    pthread_rwlockattr_t attributes;
    pthread_rwlockattr_init(&attributes);
#ifdef __GLIBC__
    pthread_rwlockattr_setkind_np(&attributes, PTHREAD_RWLOCK_PREFER_WRITER_NONRECURSIVE_NP);
#endif
    pthread_rwlock_init(&h->lock, &attributes);
    pthread_rwlockattr_destroy(&attributes);
    pthread_mutex_init(&h->counts_lock, NULL);
}

int query_holding_open(query_holding *h, const char *command, const char *path,
                       const query_values *v, const ebpo_model_options *options,
                       double subtree_overhead)
{
    *h = (query_holding){ .command = command,
                          .options = *options,
                          .subtree_overhead = subtree_overhead };
    init_lock(h);
    int code = query_open_file(&h->session, command, path, options, (int)v->level, &v->remote);
    if (code != EXIT_OK)
        return code;
    const ebpo_info *info = ebpo_file_info(h->session.file);
    h->automatic = is_unlimited(v, options) && !ebpo_is_url(path) && info->parts & EBPO_PART_MESH;
    if (h->automatic)
        decide_memory(h);
    return query_open_model(&h->session, command, &h->options);
}

void query_holding_external(query_holding *h, const char *command)
{
    *h = (query_holding){ .command = command, .external = true };
    init_lock(h);
}

void query_holding_close(query_holding *h)
{
    query_close(&h->session);
    pthread_rwlock_destroy(&h->lock);
    pthread_mutex_destroy(&h->counts_lock);
}

/* --- contexts --- */

static ebpo_status make_context(query_holding *h, ebpo_context **context, ebpo_error *error)
{
    if (*context)
        return EBPO_OK;
    ebpo_status status = ebpo_context_new(h->session.model, context, error);
    pthread_mutex_lock(&h->counts_lock);
    if (status == EBPO_OK && h->contexts < QUERY_THREADS_MAX)
        h->context[h->contexts++] = context;
    pthread_mutex_unlock(&h->counts_lock);
    return status;
}

/* Frees the contexts of all threads. The caller must have exclusive access. */
static void free_contexts(query_holding *h)
{
    for (unsigned i = 0; i < h->contexts; i++) {
        ebpo_context_free(*h->context[i]);
        *h->context[i] = NULL;
    }
    h->contexts = 0;
}

void query_holding_drop_context(query_holding *h, ebpo_context **context)
{
    pthread_mutex_lock(&h->counts_lock);
    for (unsigned i = 0; i < h->contexts; i++)
        if (h->context[i] == context) {
            h->context[i] = h->context[--h->contexts];
            break;
        }
    pthread_mutex_unlock(&h->counts_lock);
    ebpo_context_free(*context);
    *context = NULL;
}

/* --- the whole model --- */

/* Returns true if the whole model should be loaded now. Loading the whole model costs as much as
 * loading each subtree once. Loading parts costs more, because subtrees are loaded again, and
 * because queries that change between subtrees are slower. The function returns true when this
 * extra cost reaches the cost of loading the whole model. So the total cost is at most about twice
 * the least possible cost. The function returns true earlier if the remaining queries will clearly
 * need all subtrees. `total` is the number of queries, or 0 if it is not known. */
static bool loading_pays(query_holding *h, double total)
{
    ebpo_model_stats s = EBPO_MODEL_STATS_INIT;
    if (ebpo_model_get_stats(h->session.model, &s) != EBPO_OK || s.loads < LOADS_MIN)
        return false;
    pthread_mutex_lock(&h->counts_lock);
    double seconds_per_load = s.load_seconds / (double)s.loads, queries = (double)h->queries,
           reload_seconds = (double)(s.evicted < s.loads ? s.evicted : s.loads) * seconds_per_load,
           query_time = h->query_seconds > s.load_seconds ? h->query_seconds - s.load_seconds : 0,
           expected_loads = queries > 0 ? (double)s.loads / queries * (total - queries) : 0;
    h->whole_seconds = seconds_per_load * (double)h->subtrees;
    h->extra_seconds = reload_seconds + h->subtree_overhead * query_time;
    h->queries_before = h->queries;
    h->loads_before = s.loads;
    bool pays = h->extra_seconds >= h->whole_seconds ||
                (s.loads < h->subtrees / SAFETY_FACTOR &&
                 expected_loads >= SAFETY_FACTOR * (double)h->subtrees);
    pthread_mutex_unlock(&h->counts_lock);
    return pays;
}

/* Loads the whole model. The caller must have exclusive access. Frees the loaded parts first, so
 * that the memory limit is never exceeded. */
static ebpo_status load_all(query_holding *h, ebpo_error *error)
{
    ebpo_model_options all = h->options;
    all.cut_level = -1;
    free_contexts(h);
    ebpo_model_free(h->session.model);
    h->session.model = NULL;
    ebpo_status status = ebpo_model_new(h->session.file, &all, &h->session.model, error);
    h->loaded_all = status == EBPO_OK;
    /* the model needs more memory than its counts suggest, and is loaded in parts again */
    if (status == EBPO_E_LIMIT || status == EBPO_E_MEMORY)
        status = ebpo_model_new(h->session.file, &h->options, &h->session.model, error);
    return status;
}

/* Loads the whole model, unless another thread has done so meanwhile. */
static ebpo_status load_all_once(query_holding *h, ebpo_error *error)
{
    ebpo_status status = EBPO_OK;
    pthread_rwlock_wrlock(&h->lock);
    if (h->may_load_all)
        status = load_all(h, error);
    h->may_load_all = false;
    pthread_rwlock_unlock(&h->lock);
    return status;
}

static ebpo_status enter_model(query_holding *h, ebpo_context **context, ebpo_error *error)
{
    pthread_rwlock_rdlock(&h->lock);
    if (h->external)
        return EBPO_OK;
    ebpo_status status = h->session.model ? make_context(h, context, error)
                                          : EBPO_E_CANCELLED; /* another thread failed */
    if (status != EBPO_OK)
        pthread_rwlock_unlock(&h->lock);
    return status;
}

ebpo_status query_holding_enter(query_holding *h, ebpo_context **context, double total,
                                ebpo_error *error)
{
    ebpo_status status = enter_model(h, context, error);
    if (status != EBPO_OK || !h->may_load_all || !loading_pays(h, total))
        return status;
    pthread_rwlock_unlock(&h->lock);
    status = load_all_once(h, error);
    return status == EBPO_OK ? enter_model(h, context, error) : status;
}

bool query_holding_enter_alone(query_holding *h, ebpo_context **context)
{
    pthread_rwlock_wrlock(&h->lock);
    free_contexts(h);
    if (!h->external && h->session.model && make_context(h, context, NULL) == EBPO_OK)
        return true;
    pthread_rwlock_unlock(&h->lock);
    return false;
}

void query_holding_leave(query_holding *h, uint64_t queries, double seconds)
{
    pthread_mutex_lock(&h->counts_lock);
    h->queries += queries;
    h->query_seconds += seconds;
    pthread_mutex_unlock(&h->counts_lock);
    pthread_rwlock_unlock(&h->lock);
}

/* --- report --- */

void query_holding_report(const query_holding *h)
{
    char limit[32];
    if (!h->automatic)
        return;
    words_bytes(limit, sizeof limit, h->options.memory);
    fprintf(stderr, "memory: at most %s, %s; ", limit,
            h->options.memory > h->free_memory / 2
                ? "the minimum, which is more than half of the free memory"
                : "half of the free memory");
    if (!h->subtrees)
        fprintf(stderr, "the whole model at once, as it is small\n");
    else if (h->loaded_all)
        fprintf(stderr,
                "the whole model after %" PRIu64 " queries and %" PRIu64 " of %" PRIu64
                " subtrees; parts had cost %.3f s more than the whole model at once, "
                "which was estimated at %.3f s\n",
                h->queries_before, h->loads_before, h->subtrees, h->extra_seconds,
                h->whole_seconds);
    else
        fprintf(stderr, "in parts%s\n",
                h->plan.resident ? "" : ", as the whole model would not fit");
}

void query_holding_json(const query_holding *h, json *j)
{
    if (!h->automatic)
        return;
    json_object(j, "automatic_memory");
    json_uint(j, "free", h->free_memory);
    json_uint(j, "max", h->options.memory);
    json_text(j, "held", !h->subtrees ? "whole" : h->loaded_all ? "whole later" : "parts");
    json_bool(j, "fits", h->plan.resident);
    json_uint(j, "queries_before", h->loaded_all ? h->queries_before : 0);
    json_uint(j, "loads_before", h->loaded_all ? h->loads_before : 0);
    json_real(j, "extra_seconds_before", h->loaded_all ? h->extra_seconds : 0);
    json_real(j, "whole_seconds_estimated", h->loaded_all ? h->whole_seconds : 0);
    json_end(j);
}
