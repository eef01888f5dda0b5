/* Running independent pieces of work on all cores. */
#ifndef EBPO_BASE_PARALLEL_H
#define EBPO_BASE_PARALLEL_H

#include <ebpo/base.h>

/* One piece: items [begin, end). `worker` is 0 .. threads - 1, for per-thread scratch. Anything but EBPO_OK stops the whole run
 * after the pieces that are under way; `error` belongs to this worker. */
typedef ebpo_status (*ebpo_task_fn)(void *context, uint64_t begin, uint64_t end, unsigned worker, ebpo_error *error);

/* Number of threads for a request; 0 means the cores this process may use. Never 0, at most 256. */
unsigned ebpo_thread_count(unsigned requested);

/* Calls `task` over [0, count) in pieces of `grain` items (at least 1), handed out in ascending order to `threads` threads (as ebpo_thread_count
 * gives them); the calling thread works too and reports progress (`stage`, items done). Which thread runs which piece is not determined: results
 * must not depend on it. Of several failures the one of the lowest piece is returned. */
ebpo_status ebpo_parallel_for(unsigned threads, uint64_t count, uint64_t grain, ebpo_task_fn task, void *context,
                              const ebpo_progress *progress, const char *stage, ebpo_error *error);

#endif
