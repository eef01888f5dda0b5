/* Runs independent pieces of work on all cores. */
#ifndef EBPO_CORE_PARALLEL_H
#define EBPO_CORE_PARALLEL_H

#include <ebpo/base.h>
#include <ebpo/workspace.h>
#include <pthread.h>

/* Starts a thread as pthread_create does, with a fixed stack size instead of that of RLIMIT_STACK
 * or the C library. All threads of the library start here. Returns 0, or an error number. */
int ebpo_thread_start(pthread_t *thread, void *(*body)(void *), void *argument);

/* Runs one piece: items [begin, end). `worker` is 0 .. threads - 1, for per-thread scratch. Any
 * status but EBPO_OK stops the run after the pieces under way; `error` belongs to this worker. */
typedef ebpo_status (*ebpo_task_fn)(void *context, uint64_t begin, uint64_t end, unsigned worker,
                                    ebpo_error *error);

/* Returns the number of threads for a request; 0 means the cores that this process may use. Never
 * 0, at most 256. */
unsigned ebpo_thread_count(unsigned requested);

/* Calls `task` over [0, count) in pieces of `grain` items (at least 1), in ascending order, on
 * `threads` threads (from ebpo_thread_count). The calling thread works too and reports progress
 * (`stage`, items done; 0 at the beginning). Which thread runs a piece is not determined, so
 * results must not depend on the thread. After each piece, pages of `workspace` (may be NULL) are
 * released if its budget requires this, so tasks need not release pages. Of several failures, the
 * failure of the lowest piece is returned. */
ebpo_status ebpo_parallel_for(unsigned threads, ebpo_workspace *workspace, uint64_t count,
                              uint64_t grain, ebpo_task_fn task, void *context,
                              const ebpo_progress *progress, const char *stage, ebpo_error *error);

/* Begins a stage without pieces. Returns false when the caller must stop, with EBPO_E_CANCELLED in
 * `error`. */
bool ebpo_progress_stage(const ebpo_progress *progress, const char *stage, ebpo_error *error);

/* Reports progress of a stage without pieces. Returns false as ebpo_progress_stage does. Call it at
 * most once for every few thousand steps. */
bool ebpo_progress_step(const ebpo_progress *progress, const char *stage, uint64_t done,
                        uint64_t total, ebpo_error *error);

/* One of several passes of a stage: the progress of the pass is reported as the range from `begin`
 * to `end` of a stage with `of` passes, so that the reported progress of the stage never goes back.
 */
typedef struct ebpo_pass {
    const ebpo_progress *to; /* progress of the stage; NULL is allowed */
    uint64_t begin, end, of;
} ebpo_pass;

/* Returns the progress of a pass; `pass` must outlive the result. */
ebpo_progress ebpo_pass_progress(ebpo_pass *pass);

#endif
