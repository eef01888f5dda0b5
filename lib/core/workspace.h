/* Workspaces: arrays in memory or, beyond half of the budget, in temporary files; and loops over
 * such arrays, which release pages on the way. */
#ifndef EBPO_CORE_WORKSPACE_H
#define EBPO_CORE_WORKSPACE_H

#include <ebpo/workspace.h>

/* ebpo_workspace_new without a least: for tests, which want small models in files. */
EBPO_MUST_USE ebpo_status ebpo_workspace_make_any(ebpo_workspace **out, uint64_t memory,
                                                  const char *temp_dir, ebpo_error *error);

/* Why the last allocation of this size failed: EBPO_E_MEMORY, or EBPO_E_IO with the folder. */
ebpo_status ebpo_workspace_fail(const ebpo_workspace *workspace, uint64_t bytes, ebpo_error *error);
/* Likewise where the size is not known any more; `what` as in "while joining levels". */
ebpo_status ebpo_workspace_fail_while(const ebpo_workspace *workspace, const char *what,
                                      ebpo_error *error);

/* The folder of its temporary files: a name of less than EBPO_FOLDER_BYTES bytes, the workspace's.
 */
enum { EBPO_FOLDER_BYTES = 4096 };
const char *ebpo_workspace_folder(const ebpo_workspace *workspace);
/* Its budget in bytes. */
uint64_t ebpo_workspace_memory(const ebpo_workspace *workspace);

/* Keeping to a budget: pages of files can be released, what was written stays in the file. */

/* Between pieces of work, by each thread and for each few megabytes touched: releases pages of
 * files when the budget is nearly used up. Cheap; NULL is fine. Loops (below) and runs
 * of pieces (core/parallel.h) call it: only what is neither, as a recursion, needs to itself. */
void ebpo_release_pages(ebpo_workspace *workspace);

/* After so many items: of arrays gone through in order, or where each may bring in 16 pages. */
enum { EBPO_ITEMS_IN_ORDER = 1 << 15, EBPO_ITEMS_SCATTERED = 1 << 7 };

/* Loops over the items of large arrays. A workspace with a budget keeps arrays in files, and what a
 * loop has touched stays in memory until it is let go of: these loops do that on the way, so that
 * bodies need not think of it. Bodies may `continue`, `break` and return; `end` is evaluated once,
 * and where `workspace` is NULL all this costs a test. */

/* Pages are released whenever `i`, a uint64_t, becomes a multiple of `every`, a power of two: what
 * so many bodies touch should not exceed a few megabytes. */
#define EBPO_FOR_ITEMS_EVERY(workspace, every, i, begin, end) \
    for (uint64_t i = (begin), i##_end = (end); i < i##_end; ebpo_items_step(workspace, every, ++i))

/* Of a loop that goes through arrays in order. */
#define EBPO_FOR_ITEMS(workspace, i, begin, end) \
    EBPO_FOR_ITEMS_EVERY(workspace, EBPO_ITEMS_IN_ORDER, i, begin, end)

/* Of one that jumps about: each jump may bring in 16 pages. */
#define EBPO_FOR_ITEMS_SCATTERED(workspace, i, begin, end) \
    EBPO_FOR_ITEMS_EVERY(workspace, EBPO_ITEMS_SCATTERED, i, begin, end)

/* Pieces of a few megabytes, or of fewer bytes that take long: `at` is where each begins. */
#define EBPO_FOR_PIECES(workspace, at, end, piece)         \
    for (uint64_t at = 0, at##_end = (end); at < at##_end; \
         at += (piece), ebpo_release_pages(workspace))

static inline void ebpo_items_step(ebpo_workspace *workspace, uint64_t every, uint64_t i)
{
    if (workspace && (i & (every - 1)) == 0)
        ebpo_release_pages(workspace);
}

/* Arrays in memory or in temporary files. */

/* count * size bytes, uninitialised; NULL when the product overflows, memory is short or the disk
 * full (ebpo_workspace_fail tells which). Without a workspace: malloc's. The workspace is the
 * owner: whoever holds the array holds it too, and frees the one with the other. */
void *ebpo_array_alloc(ebpo_workspace *workspace, uint64_t count, size_t size);
/* The same, zeroed. */
void *ebpo_array_zero(ebpo_workspace *workspace, uint64_t count, size_t size);
/* Like ebpo_grow, for arrays of this kind. */
bool ebpo_array_grow(ebpo_workspace *workspace, void *array, uint64_t *capacity, uint64_t need,
                     size_t size);
/* ebpo_grow while the array is small, as nearly all of a kind are, and the above once it is large.
 */
bool ebpo_array_grow_late(ebpo_workspace *workspace, void *array, uint64_t *capacity, uint64_t need,
                          size_t size);
/* An array of `workspace`; without one, malloc's. NULL is fine. */
void ebpo_array_free(ebpo_workspace *workspace, void *array);

/* memcpy and memset for arrays. */
void ebpo_array_copy(ebpo_workspace *workspace, void *to, const void *from, uint64_t bytes);
void ebpo_array_fill(ebpo_workspace *workspace, void *array, int byte, uint64_t bytes);

#endif
