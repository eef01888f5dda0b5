/* Arrays in memory or in temporary files. */
#ifndef EBPO_BASE_WORKSPACE_H
#define EBPO_BASE_WORKSPACE_H

#include <ebpo/workspace.h>

/* ebpo_workspace_new without a least: for tests, which want small models in files. */
EBPO_MUST_USE ebpo_status ebpo_workspace_make_any(ebpo_workspace **out, uint64_t memory,
                                                  const char *temp_dir, ebpo_error *error);

/* count * size bytes, uninitialised; NULL when the product overflows, memory is short or the disk
 * full (ebpo_workspace_fail tells which). Without a workspace: malloc's. Freed by ebpo_array_free
 * alone, whose owner need not know. */
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
void ebpo_array_free(void *block); /* NULL is fine */

/* Why the last allocation of this size failed: EBPO_E_MEMORY, or EBPO_E_IO with the folder. */
ebpo_status ebpo_workspace_fail(const ebpo_workspace *workspace, uint64_t bytes, ebpo_error *error);
/* Likewise where the size is not known any more; `what` as in "while joining levels". */
ebpo_status ebpo_workspace_fail_while(const ebpo_workspace *workspace, const char *what,
                                      ebpo_error *error);

/* Between pieces of work, by each thread and for each few megabytes touched: lets go of pages when
 * the budget is nearly used up. Cheap; NULL is fine. */
void ebpo_workspace_settle(ebpo_workspace *workspace);

/* The same within a loop that goes through arrays in order. */
static inline void ebpo_workspace_settle_at(ebpo_workspace *workspace, uint64_t i)
{
    if (workspace && (i & 0x7fff) == 0)
        ebpo_workspace_settle(workspace);
}

/* And within one that jumps about: each jump may bring in 16 pages. */
static inline void ebpo_workspace_settle_often(ebpo_workspace *workspace, uint64_t i)
{
    if (workspace && (i & 0x7f) == 0)
        ebpo_workspace_settle(workspace);
}

/* For code that has arrays of a workspace in its hands without knowing: settles all there are. */
void ebpo_settle_all(void);
static inline void ebpo_settle_all_at(uint64_t i)
{
    if ((i & 0x7fff) == 0)
        ebpo_settle_all();
}

/* memcpy and memset for arrays. */
void ebpo_array_copy(ebpo_workspace *workspace, void *to, const void *from, uint64_t bytes);
void ebpo_array_fill(ebpo_workspace *workspace, void *array, int byte, uint64_t bytes);

/* Removes the file that is being made just now, if it has a name: for signal handlers, just before
 * the process ends. */
void ebpo_workspace_abandon(void);

/* A mapping of somebody else's whose pages may be let go of too (of a file that is only read). */
void ebpo_workspace_watch(ebpo_workspace *workspace, void *mapped, size_t bytes);
void ebpo_workspace_unwatch(ebpo_workspace *workspace, void *mapped);

#endif
