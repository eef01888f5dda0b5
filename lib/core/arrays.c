#include "core/arrays.h"

#include <stdlib.h>
#include <string.h>

#include "core/alloc.h"
#include "core/workspace_extents.h"

/* Small ones and those without a workspace are not in the table: malloc never gives whole pages. */
static void *alloc(ebpo_workspace *w, uint64_t count, size_t size, bool zero)
{
    uint64_t bytes;
    if (w && ebpo_mul_ok(count, size, &bytes) && bytes >= EBPO_LEAST_EXTENT &&
        bytes < PTRDIFF_MAX) {
        ebpo_extent *b = ebpo_extent_make(w, (size_t)bytes, EBPO_EXTENT_OWN);
        return b ? b->at : NULL;
    }
    if (w && ebpo_mul_ok(count, size, &bytes) && bytes >= EBPO_PAGE && bytes < EBPO_LEAST_EXTENT) {
        ebpo_extent *part = ebpo_part_make(w, (size_t)bytes);
        return part ? part->at : NULL;
    }
    void *at = zero ? ebpo_alloc_zero(count, size) : ebpo_alloc(count, size);
    if (!at && w)
        w->failed = 0;
    return at;
}

void *ebpo_array_alloc(ebpo_workspace *workspace, uint64_t count, size_t size)
{
    return alloc(workspace, count, size, false);
}

void *ebpo_array_zero(ebpo_workspace *workspace, uint64_t count, size_t size)
{
    return alloc(workspace, count, size, true);
}

void ebpo_array_free(ebpo_workspace *workspace, void *array)
{
    /* malloc never gives whole pages but by chance: the table knows */
    ebpo_extent *b = workspace && array && (uintptr_t)array % EBPO_PAGE == 0
                         ? ebpo_extent_take(workspace, array)
                         : NULL;
    if (b)
        ebpo_extent_free(workspace, b);
    else
        free(array);
}

enum { STEP = 4 << 20 };

void ebpo_array_fill(ebpo_workspace *workspace, void *array, int byte, uint64_t bytes)
{
    EBPO_FOR_PIECES(workspace, at, bytes, STEP)
        memset((char *)array + at, byte, bytes - at < STEP ? (size_t)(bytes - at) : STEP);
}

void ebpo_array_copy(ebpo_workspace *workspace, void *to, const void *from, uint64_t bytes)
{
    EBPO_FOR_PIECES(bytes > STEP ? workspace : NULL, at, bytes, STEP)
        memcpy((char *)to + at, (const char *)from + at,
               bytes - at < STEP ? (size_t)(bytes - at) : STEP);
}

bool ebpo_array_grow(ebpo_workspace *workspace, void *array, uint64_t *capacity, uint64_t need,
                     size_t size)
{
    if (need <= *capacity)
        return true;
    uint64_t wanted = *capacity + *capacity / 2 + 16;
    if (wanted < need)
        wanted = need;
    void *old, *bigger = ebpo_array_alloc(workspace, wanted, size);
    if (!bigger)
        return false;
    memcpy(&old, array, sizeof old);
    if (old)
        ebpo_array_copy(workspace, bigger, old, *capacity * size);
    ebpo_array_free(workspace, old);
    memcpy(array, &bigger, sizeof bigger);
    *capacity = wanted;
    return true;
}

bool ebpo_array_grow_late(ebpo_workspace *workspace, void *array, uint64_t *capacity, uint64_t need,
                          size_t size)
{
    enum { LATE = 1 << 20 };
    if (need <= *capacity)
        return true;
    return workspace && need > LATE / size ? ebpo_array_grow(workspace, array, capacity, need, size)
                                           : ebpo_grow(array, capacity, need, size);
}
