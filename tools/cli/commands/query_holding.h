/* Opens the model of a query command for all threads. Without --memory and similar options, the
 * command first loads the upper levels and the subtrees that queries need. It loads the whole model
 * when the extra cost of loading parts reaches the cost of loading the whole model. */
#ifndef EBPO_TOOLS_QUERY_HOLDING_H
#define EBPO_TOOLS_QUERY_HOLDING_H

#include <pthread.h>
#include <stdatomic.h>

#include "cli/json.h"
#include "cli/query_args.h"

enum { QUERY_THREADS_MAX = 256 };

typedef struct query_holding {
    query_session session;
    const char *command;
    ebpo_model_options options;
    /* The lock of the model: shared during queries, exclusive while the model is changed. */
    pthread_rwlock_t lock;
    ebpo_context **context[QUERY_THREADS_MAX]; /* [contexts] contexts of all threads */
    unsigned contexts;                         /* protected by counts_lock, as `context` */
    pthread_mutex_t counts_lock;
    bool external; /* the job queries a catalogue; `session` has no model */
    /* policy */
    bool automatic;           /* no memory limit was given */
    atomic_bool may_load_all; /* the model is loaded in parts, and may be loaded as a whole later */
    bool loaded_all; /* the whole model was loaded after parts; the next 4 members say why */
    uint64_t queries_before, loads_before; /* numbers of queries and of subtree loads until then */
    double extra_seconds;    /* seconds for loading parts again, and for slower queries */
    double whole_seconds;    /* estimated time to load the whole model */
    double subtree_overhead; /* extra share of the time of a query in parts, compared with the whole
                              * model */
    ebpo_model_plan plan;    /* plan for a budget of half of the free memory */
    uint64_t free_memory;    /* bytes, before the model was made */
    uint64_t subtrees;       /* number of subtrees; 0: the whole model was loaded at first */
    uint64_t queries;        /* number of queries so far; protected by counts_lock */
    double query_seconds;    /* time of these queries, including loads, summed over all threads;
                              * protected by counts_lock */
} query_holding;

/* Opens the model. Returns an exit code; errors have been reported. Call query_holding_close in any
 * case. subtree_overhead: as the member. */
int query_holding_open(query_holding *h, const char *command, const char *path,
                       const query_values *values, const ebpo_model_options *options,
                       double subtree_overhead);
/* Initializes `h` for a job that queries a catalogue instead of a model. */
void query_holding_external(query_holding *h, const char *command);
void query_holding_close(query_holding *h);

/* A thread calls this function before it queries. Sets *context, which is NULL at first, to a
 * context of the current model. `total` is the number of queries, or 0 if it is not known. After
 * success, evaluate queries, and then call query_holding_leave with the number and the time of
 * these queries. */
EBPO_MUST_USE ebpo_status query_holding_enter(query_holding *h, ebpo_context **context,
                                              double total, ebpo_error *error);
/* Does the same as query_holding_enter, but with exclusive access to the model, and never loads the
 * whole model. Returns false after a failure. */
bool query_holding_enter_alone(query_holding *h, ebpo_context **context);
void query_holding_leave(query_holding *h, uint64_t queries, double seconds);
/* Frees *context, and sets it to NULL. */
void query_holding_drop_context(query_holding *h, ebpo_context **context);

/* Print, for --stats, which parts of the model were in memory: a line of words on stderr, or a
 * member of JSON. They print nothing if a memory limit was given. */
void query_holding_report(const query_holding *h);
void query_holding_json(const query_holding *h, json *j);

#endif
