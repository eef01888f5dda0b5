/* Runs independent pieces of work on several threads, and reports progress. */
#ifndef EBPO_CORE_PARALLEL_H
#define EBPO_CORE_PARALLEL_H

#include <ebpo/base.h>
#include <ebpo/workspace.h>
#include <pthread.h>

/* Starts a thread as pthread_create does, with a fixed stack size that does not depend on
 * RLIMIT_STACK or the C library. All threads of the library start here. Returns 0, or an error
 * number. */
int ebpo_thread_start(pthread_t *thread, void *(*body)(void *), void *argument);

/* Callback that works on one piece: items [begin, end). `worker`: number of the thread, 0 to
 * threads - 1, so that each thread can use separate memory. If a call does not return EBPO_OK, no
 * further pieces are begun. */
typedef ebpo_status (*ebpo_task_fn)(void *context, uint64_t begin, uint64_t end, unsigned worker,
                                    ebpo_error *error);

/* Returns the number of threads, 1 to 256, for a requested number. If 0 is requested, returns the
 * number of cores that this process may use. */
unsigned ebpo_thread_count(unsigned requested);

/* Divides the items [0, count) into pieces of `grain` items (at least 1), and calls `task` for each
 * piece on `threads` threads (ebpo_thread_count). Pieces are begun in ascending order. The calling
 * thread also works, and reports progress: the name `stage`, and the number of finished items,
 * beginning with 0. Any thread may run any piece, so results must not depend on the thread. After
 * each piece, pages of `workspace` (may be NULL) are released if the workspace's budget requires
 * this, so tasks need not release pages. If several pieces fail, the failure of the piece with the
 * lowest items is returned. */
ebpo_status ebpo_parallel_for(unsigned threads, ebpo_workspace *workspace, uint64_t count,
                              uint64_t grain, ebpo_task_fn task, void *context,
                              const ebpo_progress *progress, const char *stage, ebpo_error *error);

/* Reports the beginning of a stage that does not run in pieces. Returns false, with
 * EBPO_E_CANCELLED in `error`, if the caller must stop. */
bool ebpo_progress_stage(const ebpo_progress *progress, const char *stage, ebpo_error *error);

/* Reports progress of a stage that does not run in pieces. Returns false as ebpo_progress_stage
 * does. Call this function at most once for every few thousand steps. */
bool ebpo_progress_step(const ebpo_progress *progress, const char *stage, uint64_t done,
                        uint64_t total, ebpo_error *error);

/* One of several passes of a stage. The progress of the pass is reported as a part of the progress
 * of the stage, so that the reported progress never goes back. */
typedef struct ebpo_pass {
    const ebpo_progress *to; /* progress of the stage; may be NULL */
    uint64_t begin, end,
        of; /* the stage has `of` equal shares; this pass has the shares [begin, end) */
} ebpo_pass;

/* Returns the progress of a pass; `pass` must outlive the result. */
ebpo_progress ebpo_pass_progress(ebpo_pass *pass);

#endif
