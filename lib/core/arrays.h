/* Arrays in memory or in temporary files. */
#ifndef EBPO_CORE_ARRAYS_H
#define EBPO_CORE_ARRAYS_H

#include "core/array_loops.h"
#include "core/workspace.h"

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
