#include "cli/commands/query_holding.h"

#include <ebpo/memory.h>
#include <inttypes.h>
#include <stdio.h>

#include "cli/command.h"
#include "cli/words.h"

/* What is loaded at once without further thought: some milliseconds. */
enum { SMALL = 16 << 20 };

/* Loads after which their mean is believed; and what is foretold must exceed all subtrees so many
 * times. */
enum { LOADS_BELIEVED = 8, CERTAIN = 4 };

/* --- opening --- */

/* As if not all of it fitted: a model with subtrees is cut at their roots, each of which is one
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

/* Half of what is free is the most, or the least that will do. */
static void decide_memory(query_holding *h)
{
    uint64_t half = (h->free_memory = ebpo_free_memory()) / 2;
    h->plan = (ebpo_model_plan)EBPO_MODEL_PLAN_INIT;
    if (ebpo_model_memory(h->session.file, &h->options, &h->plan, NULL) != EBPO_OK)
        return; /* it is said when the model is made */
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
    if (status == EBPO_OK && h->contexts < QUERY_THREADS_MOST)
        h->context[h->contexts++] = context;
    pthread_mutex_unlock(&h->books);
    return status;
}

/* Alone. */
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

/* Loading everything costs what loading each subtree once costs, and no more is spent on that as
 * long as all are kept. What parts cost beyond it: subtrees that are loaded again, and a share of
 * the time that questions take, which go from subtree to subtree. All at once pays when so much has
 * been spent, which is at most twice of what would have been best; or at the beginning, when the
 * questions that are still to come will need all of it by far. */
static bool loading_pays(query_holding *h, double total)
{
    ebpo_model_stats s = EBPO_MODEL_STATS_INIT;
    if (ebpo_model_get_stats(h->session.model, &s) != EBPO_OK || s.loads < LOADS_BELIEVED)
        return false;
    pthread_mutex_lock(&h->books);
    double each = s.load_seconds / (double)s.loads, asked = (double)h->questions,
           again = (double)(s.evicted < s.loads ? s.evicted : s.loads) * each,
           asking = h->asking_seconds > s.load_seconds ? h->asking_seconds - s.load_seconds : 0,
           foretold = asked > 0 ? (double)s.loads / asked * (total - asked) : 0;
    h->whole_seconds = each * (double)h->subtrees;
    h->extra_seconds = again + h->parts_share * asking;
    h->questions_before = h->questions;
    h->loads_before = s.loads;
    bool does = h->extra_seconds >= h->whole_seconds ||
                (s.loads < h->subtrees / CERTAIN && foretold >= CERTAIN * (double)h->subtrees);
    pthread_mutex_unlock(&h->books);
    return does;
}

/* Alone. What was held in parts goes first, so that there is never more than the budget. */
static ebpo_status bring_in_all(query_holding *h, ebpo_error *error)
{
    ebpo_model_options all = h->options;
    all.cut_level = -1;
    drop_contexts(h);
    ebpo_model_free(h->session.model);
    h->session.model = NULL;
    ebpo_status status = ebpo_model_new(h->session.file, &all, &h->session.model, error);
    h->whole_later = status == EBPO_OK;
    if (status == EBPO_E_LIMIT || status == EBPO_E_MEMORY) /* more than its counts told */
        status = ebpo_model_new(h->session.file, &h->options, &h->session.model, error);
    return status;
}

/* Once, by whom it occurs to first; others wait. */
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
                                          : EBPO_E_CANCELLED; /* another one failed */
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

void query_holding_leave(query_holding *h, uint64_t questions, double seconds)
{
    pthread_mutex_lock(&h->books);
    h->questions += questions;
    h->asking_seconds += seconds;
    pthread_mutex_unlock(&h->books);
    pthread_rwlock_unlock(&h->lock);
}

/* --- what was decided --- */

void query_holding_tell(const query_holding *h)
{
    char half[32];
    if (!h->automatic)
        return;
    words_bytes(half, sizeof half, h->options.memory);
    fprintf(stderr, "memory: at most %s, %s; ", half,
            h->options.memory > h->free_memory / 2
                ? "the least that will do, which is more than half of what was free"
                : "half of what was free");
    if (!h->subtrees)
        fprintf(stderr, "all of the model at once, as it is small\n");
    else if (h->whole_later)
        fprintf(stderr,
                "all of the model after %" PRIu64 " questions and %" PRIu64 " of %" PRIu64
                " subtrees; parts had cost %.3f s more than all of it at once, "
                "which was estimated at %.3f s\n",
                h->questions_before, h->loads_before, h->subtrees, h->extra_seconds,
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
    json_uint(j, "most", h->options.memory);
    json_text(j, "held", !h->subtrees ? "whole" : h->whole_later ? "whole later" : "parts");
    json_bool(j, "fits", h->plan.resident);
    json_uint(j, "questions_before", h->whole_later ? h->questions_before : 0);
    json_uint(j, "loads_before", h->whole_later ? h->loads_before : 0);
    json_real(j, "extra_seconds_before", h->whole_later ? h->extra_seconds : 0);
    json_real(j, "whole_seconds_estimated", h->whole_later ? h->whole_seconds : 0);
    json_end(j);
}
