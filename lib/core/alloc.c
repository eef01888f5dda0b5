#include "core/alloc.h"

#include <stdlib.h>
#include <string.h>

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
