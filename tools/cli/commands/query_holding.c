#include "cli/commands/query_holding.h"

#include <ebpo/memory.h>
#include <inttypes.h>
#include <stdio.h>

#include "cli/command.h"
#include "cli/words.h"

/* A model of at most this size is always loaded completely, which takes some milliseconds. */
enum { SMALL = 16 << 20 };

/* Number of loads before their mean is used; and the factor by which the estimate must exceed all
 * subtrees. */
enum { LOADS_BELIEVED = 8, CERTAIN = 4 };

/* --- opening --- */

/* Cuts a model with subtrees at their roots, as if the whole model did not fit. Each subtree is one
 * read. */
static void cut_at_subtrees(query_holding *h)
{
    ebpo_model_options *o = &h->options;
    ebpo_model_plan parts = EBPO_MODEL_PLAN_INIT;
    uint64_t most = o->memory;
    o->cut_level = ebpo_file_info(h->session.file)->subtree_level;
    if (o->cut_level == 0) {
        o->cut_level = -1;
        o->memory = h->plan.resident ? h->plan.whole - 1 : most;
        o->cut_level =
            ebpo_model_memory(h->session.file, o, &parts, NULL) == EBPO_OK ? parts.cut_level : -1;
        o->memory = most;
    }
    if (ebpo_model_memory(h->session.file, o, &parts, NULL) == EBPO_OK)
        h->subtrees = parts.subtrees;
}

/* Uses at most half of the free memory, or the minimum. */
static void decide_memory(query_holding *h)
{
    uint64_t half = (h->free_memory = ebpo_free_memory()) / 2;
    h->plan = (ebpo_model_plan)EBPO_MODEL_PLAN_INIT;
    if (ebpo_model_memory(h->session.file, &h->options, &h->plan, NULL) != EBPO_OK)
        return; /* reported when the model is made */
    h->options.memory = half > h->plan.least ? half : h->plan.least;
    if (ebpo_model_memory(h->session.file, &h->options, &h->plan, NULL) != EBPO_OK ||
        (h->plan.resident && h->plan.whole <= SMALL))
        return;
    cut_at_subtrees(h);
    h->waiting = h->plan.resident && h->subtrees;
}

static bool nothing_wished(const query_values *v, const ebpo_model_options *o)
{
    return !v->memory && o->cut_level < 0 && o->loading == EBPO_LOAD_CACHE && !v->prefetch;
}

static void init_lock(query_holding *h)
{
    pthread_rwlockattr_t fair;
    pthread_rwlockattr_init(&fair);
#ifdef __GLIBC__
    pthread_rwlockattr_setkind_np(&fair, PTHREAD_RWLOCK_PREFER_WRITER_NONRECURSIVE_NP);
#endif
    pthread_rwlock_init(&h->lock, &fair);
    pthread_rwlockattr_destroy(&fair);
    pthread_mutex_init(&h->books, NULL);
}

int query_holding_open(query_holding *h, const char *command, const char *path,
                       const query_values *v, const ebpo_model_options *options, double parts_share)
{
    *h = (query_holding){ .command = command, .options = *options, .parts_share = parts_share };
    init_lock(h);
    int code = query_open_file(&h->session, command, path, options, (int)v->level, &v->remote);
    if (code != EXIT_FINE)
        return code;
    const ebpo_info *info = ebpo_file_info(h->session.file);
    h->automatic = nothing_wished(v, options) && !ebpo_is_url(path) && info->parts & EBPO_PART_MESH;
    if (h->automatic)
        decide_memory(h);
    return query_open_model(&h->session, command, &h->options);
}

void query_holding_elsewhere(query_holding *h, const char *command)
{
    *h = (query_holding){ .command = command, .elsewhere = true };
    init_lock(h);
}

void query_holding_close(query_holding *h)
{
    query_close(&h->session);
    pthread_rwlock_destroy(&h->lock);
    pthread_mutex_destroy(&h->books);
}

/* --- contexts --- */

static ebpo_status ready_context(query_holding *h, ebpo_context **context, ebpo_error *error)
{
    if (*context)
        return EBPO_OK;
    ebpo_status status = ebpo_context_new(h->session.model, context, error);
    pthread_mutex_lock(&h->books);
    if (status == EBPO_OK && h->contexts < QUERY_THREADS_MAX)
        h->context[h->contexts++] = context;
    pthread_mutex_unlock(&h->books);
    return status;
}

/* Needs exclusive access. */
static void drop_contexts(query_holding *h)
{
    for (unsigned i = 0; i < h->contexts; i++) {
        ebpo_context_free(*h->context[i]);
        *h->context[i] = NULL;
    }
    h->contexts = 0;
}

void query_holding_forget(query_holding *h, ebpo_context **context)
{
    pthread_mutex_lock(&h->books);
    for (unsigned i = 0; i < h->contexts; i++)
        if (h->context[i] == context) {
            h->context[i] = h->context[--h->contexts];
            break;
        }
    pthread_mutex_unlock(&h->books);
    ebpo_context_free(*context);
    *context = NULL;
}

/* --- all of the model --- */

/* Loading everything costs as much as loading each subtree once, and while all are kept, parts cost
 * no more. Parts cost more when subtrees are loaded again, and because queries that change between
 * subtrees are slower. Loading everything pays when this extra cost equals its own cost, so the
 * total is at most twice the optimum; or at the beginning, when the remaining queries will clearly
 * need everything. */
static bool loading_pays(query_holding *h, double total)
{
    ebpo_model_stats s = EBPO_MODEL_STATS_INIT;
    if (ebpo_model_get_stats(h->session.model, &s) != EBPO_OK || s.loads < LOADS_BELIEVED)
        return false;
    pthread_mutex_lock(&h->books);
    double each = s.load_seconds / (double)s.loads, queries = (double)h->queries,
           again = (double)(s.evicted < s.loads ? s.evicted : s.loads) * each,
           query_time = h->query_seconds > s.load_seconds ? h->query_seconds - s.load_seconds : 0,
           foretold = queries > 0 ? (double)s.loads / queries * (total - queries) : 0;
    h->whole_seconds = each * (double)h->subtrees;
    h->extra_seconds = again + h->parts_share * query_time;
    h->queries_before = h->queries;
    h->loads_before = s.loads;
    bool does = h->extra_seconds >= h->whole_seconds ||
                (s.loads < h->subtrees / CERTAIN && foretold >= CERTAIN * (double)h->subtrees);
    pthread_mutex_unlock(&h->books);
    return does;
}

/* Needs exclusive access. Frees the parts first, so that the budget is never exceeded. */
static ebpo_status bring_in_all(query_holding *h, ebpo_error *error)
{
    ebpo_model_options all = h->options;
    all.cut_level = -1;
    drop_contexts(h);
    ebpo_model_free(h->session.model);
    h->session.model = NULL;
    ebpo_status status = ebpo_model_new(h->session.file, &all, &h->session.model, error);
    h->whole_later = status == EBPO_OK;
    if (status == EBPO_E_LIMIT ||
        status == EBPO_E_MEMORY) /* the model needs more memory than its counts suggest */
        status = ebpo_model_new(h->session.file, &h->options, &h->session.model, error);
    return status;
}

/* Runs once, on the first thread that needs it; other threads wait. */
static ebpo_status change_holding(query_holding *h, ebpo_error *error)
{
    ebpo_status status = EBPO_OK;
    pthread_rwlock_wrlock(&h->lock);
    if (h->waiting)
        status = bring_in_all(h, error);
    h->waiting = false;
    pthread_rwlock_unlock(&h->lock);
    return status;
}

static ebpo_status enter_model(query_holding *h, ebpo_context **context, ebpo_error *error)
{
    pthread_rwlock_rdlock(&h->lock);
    if (h->elsewhere)
        return EBPO_OK;
    ebpo_status status = h->session.model ? ready_context(h, context, error)
                                          : EBPO_E_CANCELLED; /* another thread failed */
    if (status != EBPO_OK)
        pthread_rwlock_unlock(&h->lock);
    return status;
}

ebpo_status query_holding_enter(query_holding *h, ebpo_context **context, double total,
                                ebpo_error *error)
{
    ebpo_status status = enter_model(h, context, error);
    if (status != EBPO_OK || !h->waiting || !loading_pays(h, total))
        return status;
    pthread_rwlock_unlock(&h->lock);
    status = change_holding(h, error);
    return status == EBPO_OK ? enter_model(h, context, error) : status;
}

bool query_holding_enter_alone(query_holding *h, ebpo_context **context)
{
    pthread_rwlock_wrlock(&h->lock);
    drop_contexts(h);
    if (!h->elsewhere && h->session.model && ready_context(h, context, NULL) == EBPO_OK)
        return true;
    pthread_rwlock_unlock(&h->lock);
    return false;
}

void query_holding_leave(query_holding *h, uint64_t queries, double seconds)
{
    pthread_mutex_lock(&h->books);
    h->queries += queries;
    h->query_seconds += seconds;
    pthread_mutex_unlock(&h->books);
    pthread_rwlock_unlock(&h->lock);
}

/* --- report --- */

void query_holding_report(const query_holding *h)
{
    char half[32];
    if (!h->automatic)
        return;
    words_bytes(half, sizeof half, h->options.memory);
    fprintf(stderr, "memory: at most %s, %s; ", half,
            h->options.memory > h->free_memory / 2
                ? "the minimum, which is more than half of the free memory"
                : "half of the free memory");
    if (!h->subtrees)
        fprintf(stderr, "all of the model at once, as it is small\n");
    else if (h->whole_later)
        fprintf(stderr,
                "all of the model after %" PRIu64 " queries and %" PRIu64 " of %" PRIu64
                " subtrees; parts had cost %.3f s more than all of it at once, "
                "which was estimated at %.3f s\n",
                h->queries_before, h->loads_before, h->subtrees, h->extra_seconds,
                h->whole_seconds);
    else
        fprintf(stderr, "in parts%s\n",
                h->plan.resident ? "" : ", as all of the model would not fit");
}

void query_holding_json(const query_holding *h, json *j)
{
    if (!h->automatic)
        return;
    json_object(j, "automatic_memory");
    json_uint(j, "free", h->free_memory);
    json_uint(j, "max", h->options.memory);
    json_text(j, "held", !h->subtrees ? "whole" : h->whole_later ? "whole later" : "parts");
    json_bool(j, "fits", h->plan.resident);
    json_uint(j, "queries_before", h->whole_later ? h->queries_before : 0);
    json_uint(j, "loads_before", h->whole_later ? h->loads_before : 0);
    json_real(j, "extra_seconds_before", h->whole_later ? h->extra_seconds : 0);
    json_real(j, "whole_seconds_estimated", h->whole_later ? h->whole_seconds : 0);
    json_end(j);
}
