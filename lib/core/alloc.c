/* Allocates memory with checked sizes. The number of items comes from a file or a mesh, so the
 * product of this number and the item size may overflow. Arrays that may be larger than memory come
 * from a workspace instead (workspace.c). A quota limits the memory of an object that is being
 * built. */
#include "core/alloc.h"

#include <inttypes.h>
#include <stdlib.h>
#include <string.h>

#include "core/error.h"

/* Sets *bytes to count * size, but at least 1. Returns false if the product is too large. */
static bool size_ok(uint64_t count, size_t size, size_t *bytes)
{
    uint64_t product;
    if (!ebpo_mul_ok(count, size, &product) || product > (uint64_t)PTRDIFF_MAX)
        return false;
    *bytes = product ? (size_t)product : 1;
    return true;
}

void *ebpo_alloc(uint64_t count, size_t size)
{
    size_t bytes;
    return size_ok(count, size, &bytes) ? malloc(bytes) : NULL;
}

void *ebpo_alloc_zero(uint64_t count, size_t size)
{
    size_t bytes;
    return size_ok(count, size, &bytes) ? calloc(1, bytes) : NULL;
}

void *ebpo_alloc_lines(uint64_t count, size_t size)
{
    enum { LINE = 64 };
    size_t bytes;
    if (!size_ok(count, size, &bytes) || bytes > PTRDIFF_MAX - LINE)
        return NULL;
    bytes = (bytes + LINE - 1) / LINE * LINE;
    void *block = aligned_alloc(LINE, bytes);
    return block ? memset(block, 0, bytes) : NULL;
}

void *ebpo_realloc(void *block, uint64_t count, size_t size)
{
    size_t bytes;
    return size_ok(count, size, &bytes) ? realloc(block, bytes) : NULL;
}

bool ebpo_grow(void *array, uint64_t *capacity, uint64_t need, size_t size)
{
    if (need <= *capacity)
        return true;
    uint64_t wanted = *capacity + *capacity / 2 + 16;
    if (wanted < need)
        wanted = need;
    void *block;
    memcpy(&block, array, sizeof block);
    block = ebpo_realloc(block, wanted, size);
    if (!block)
        return false;
    memcpy(array, &block, sizeof block);
    *capacity = wanted;
    return true;
}

/* --- memory limit of an object that is being built --- */

ebpo_status ebpo_quota_check(ebpo_quota *space, uint64_t bytes, ebpo_error *error)
{
    if (!space || (space->taken <= space->most && bytes <= space->most - space->taken))
        return EBPO_OK;
    uint64_t all = bytes > UINT64_MAX - space->taken ? UINT64_MAX : space->taken + bytes,
             larger = space->most + space->most / 4 + 1;
    space->needed = all > larger ? all : larger;
    return ebpo_fail(error, EBPO_E_LIMIT,
                     "the memory budget allows %" PRIu64
                     " bytes for an object that needs up to %" PRIu64,
                     space->most, all);
}

ebpo_status ebpo_quota_take(ebpo_quota *space, uint64_t bytes, ebpo_error *error)
{
    ebpo_status status = ebpo_quota_check(space, bytes, error);
    if (space && status == EBPO_OK)
        space->taken += bytes;
    return status;
}

void ebpo_quota_give(ebpo_quota *space, uint64_t bytes)
{
    if (space)
        space->taken -= bytes;
}
