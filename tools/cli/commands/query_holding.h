/* How a command for questions holds its model, on all of its threads. Without --memory and other
 * wishes it decides as it goes: it begins with the upper levels and what questions need, and brings
 * all of the model into memory as soon as parts have cost as much as that would. */
#ifndef EBPO_TOOLS_QUERY_HOLDING_H
#define EBPO_TOOLS_QUERY_HOLDING_H

#include <pthread.h>
#include <stdatomic.h>

#include "cli/json.h"
#include "cli/query_args.h"

enum { QUERY_THREADS_MOST = 256 };

typedef struct query_holding {
    query_session session;
    const char *command;
    ebpo_model_options options;
    pthread_rwlock_t lock;                      /* held while asking; alone: to change the model */
    ebpo_context **context[QUERY_THREADS_MOST]; /* those that there are; under `books` */
    unsigned contexts;
    pthread_mutex_t books;
    bool elsewhere; /* the job holds what it asks: nothing is done here */
    /* what is decided */
    bool automatic;      /* nobody said how much memory there may be */
    atomic_bool waiting; /* it may still bring in all of the model */
    bool whole_later;    /* it did, after: */
    uint64_t questions_before, loads_before;
    /* that parts had cost beyond loading each once; that loading all was estimated to take */
    double extra_seconds, whole_seconds;
    double parts_share; /* of the time of a question in parts: what it takes more than in the whole
                         */
    ebpo_model_plan plan;  /* for half of the memory that was free */
    uint64_t free_memory;  /* bytes, before the model was made */
    uint64_t subtrees;     /* that it is held in at first; 0: in one piece */
    uint64_t questions;    /* asked, and what they took, loading included; under `books` */
    double asking_seconds; /* of all threads together */
} query_holding;

/* Opens the model; `parts_share`: as the member. Returns an exit code; what is wrong has been said.
 * query_holding_close in any case. */
int query_holding_open(query_holding *h, const char *command, const char *path,
                       const query_values *values, const ebpo_model_options *options,
                       double parts_share);
/* For a job that holds what it asks itself. */
void query_holding_elsewhere(query_holding *h, const char *command);
void query_holding_close(query_holding *h);

/* Before a thread asks: *context (NULL at first) is then one of the model as it is held now.
 * `total`: so many questions there are, 0: not known. Then query_holding_leave, with how many were
 * asked and how long that took, unless it failed. */
EBPO_MUST_USE ebpo_status query_holding_enter(query_holding *h, ebpo_context **context,
                                              double total, ebpo_error *error);
/* The same when nobody else asks, or holds anything of the model. False: not entered. */
bool query_holding_enter_alone(query_holding *h, ebpo_context **context);
void query_holding_leave(query_holding *h, uint64_t questions, double seconds);
void query_holding_forget(query_holding *h, ebpo_context **context);

/* With --stats: what was decided, a line of words on stderr or a member of JSON. Nothing where a
 * wish was given. */
void query_holding_tell(const query_holding *h);
void query_holding_json(const query_holding *h, json *j);

#endif
