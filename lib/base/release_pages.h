/* Keeping to a budget: pages of files can be released, what was written stays in the file. */
#ifndef EBPO_BASE_RELEASE_PAGES_H
#define EBPO_BASE_RELEASE_PAGES_H

#include <ebpo/workspace.h>

/* Between pieces of work, by each thread and for each few megabytes touched: releases pages of
 * files when the budget is nearly used up. Cheap; NULL is fine. */
void ebpo_release_pages(ebpo_workspace *workspace);

/* The same within a loop that goes through arrays in order. */
static inline void ebpo_release_pages_at(ebpo_workspace *workspace, uint64_t i)
{
    if (workspace && (i & 0x7fff) == 0)
        ebpo_release_pages(workspace);
}

/* And within one that jumps about: each jump may bring in 16 pages. */
static inline void ebpo_release_pages_often(ebpo_workspace *workspace, uint64_t i)
{
    if (workspace && (i & 0x7f) == 0)
        ebpo_release_pages(workspace);
}

static inline void ebpo_workspace_settle(ebpo_workspace *workspace)
{
    ebpo_release_pages(workspace);
}
static inline void ebpo_workspace_settle_at(ebpo_workspace *workspace, uint64_t i)
{
    ebpo_release_pages_at(workspace, i);
}
static inline void ebpo_workspace_settle_often(ebpo_workspace *workspace, uint64_t i)
{
    ebpo_release_pages_often(workspace, i);
}

#endif
