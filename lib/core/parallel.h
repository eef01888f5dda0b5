/* Running independent pieces of work on all cores. */
#ifndef EBPO_CORE_PARALLEL_H
#define EBPO_CORE_PARALLEL_H

#include <ebpo/base.h>
#include <ebpo/workspace.h>
#include <pthread.h>

/* Starts a thread as pthread_create does, with a stack of a fixed size instead of what RLIMIT_STACK
 * or the C library gives. All threads of the library start here. 0: it runs; else an error number.
 */
int ebpo_thread_start(pthread_t *thread, void *(*body)(void *), void *argument);

/* One piece: items [begin, end). `worker` is 0 .. threads - 1, for per-thread scratch. Anything but
 * EBPO_OK stops the whole run after the pieces that are under way; `error` belongs to this worker.
 */
typedef ebpo_status (*ebpo_task_fn)(void *context, uint64_t begin, uint64_t end, unsigned worker,
                                    ebpo_error *error);

/* Number of threads for a request; 0 means the cores this process may use. Never 0, at most 256. */
unsigned ebpo_thread_count(unsigned requested);

/* Calls `task` over [0, count) in pieces of `grain` items (at least 1), handed out in ascending
 * order to `threads` threads (as ebpo_thread_count gives them); the calling thread works too and
 * reports progress (`stage`, items done; at the beginning 0). Which thread runs which piece is not
 * determined: results must not depend on it. After each piece, pages of `workspace` (NULL: of none)
 * are released where its budget asks for it, so that tasks need not. Of several failures the one of
 * the lowest piece is returned. */
ebpo_status ebpo_parallel_for(unsigned threads, ebpo_workspace *workspace, uint64_t count,
                              uint64_t grain, ebpo_task_fn task, void *context,
                              const ebpo_progress *progress, const char *stage, ebpo_error *error);

/* A stage without pieces begins. False when it is to stop; `error` then says so. */
bool ebpo_progress_stage(const ebpo_progress *progress, const char *stage, ebpo_error *error);

/* How far a stage without pieces is; false as above. Not more often than for each few thousand
 * steps. */
bool ebpo_progress_step(const ebpo_progress *progress, const char *stage, uint64_t done,
                        uint64_t total, ebpo_error *error);

/* One of several passes of a stage: its own progress is reported as the part from `begin` to `end`
 * of `of`, so that the total only grows. */
typedef struct ebpo_pass {
    const ebpo_progress *to; /* NULL is fine */
    uint64_t begin, end, of;
} ebpo_pass;

/* `pass` must live as long as what is returned. */
ebpo_progress ebpo_pass_progress(ebpo_pass *pass);

#endif
