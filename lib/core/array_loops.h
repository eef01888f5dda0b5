/* Loops over the items of large arrays. A workspace with a budget keeps arrays in files, and what a
 * loop has touched stays in memory until it is let go of: these loops do that on the way, so that
 * bodies need not think of it. Bodies may `continue`, `break` and return; `end` is evaluated once,
 * and where `workspace` is NULL all this costs a test. */
#ifndef EBPO_CORE_ARRAY_LOOPS_H
#define EBPO_CORE_ARRAY_LOOPS_H

#include "core/release_pages.h"

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

#endif
