/* Keeping to a budget: pages of files can be released, what was written stays in the file. */
#ifndef EBPO_CORE_RELEASE_PAGES_H
#define EBPO_CORE_RELEASE_PAGES_H

#include <ebpo/workspace.h>

/* Between pieces of work, by each thread and for each few megabytes touched: releases pages of
 * files when the budget is nearly used up. Cheap; NULL is fine. Loops (core/array_loops.h) and runs
 * of pieces (core/parallel.h) call it: only what is neither, as a recursion, needs to itself. */
void ebpo_release_pages(ebpo_workspace *workspace);

/* After so many items: of arrays gone through in order, or where each may bring in 16 pages. */
enum { EBPO_ITEMS_IN_ORDER = 1 << 15, EBPO_ITEMS_SCATTERED = 1 << 7 };

#endif
