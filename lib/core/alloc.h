/* Allocation with checked sizes: every array sized from a file or a mesh goes through here. */
#ifndef EBPO_CORE_ALLOC_H
#define EBPO_CORE_ALLOC_H

#include <ebpo/base.h>

/* a * b into *out; false when it does not fit 64 bits. */
static inline bool ebpo_mul_ok(uint64_t a, uint64_t b, uint64_t *out)
{
    return !__builtin_mul_overflow(a, b, out);
}

/* count * size bytes, uninitialised; NULL when the product overflows or memory is short. A count of
 * 0 gives a valid pointer. */
void *ebpo_alloc(uint64_t count, size_t size);
/* The same, zeroed. */
void *ebpo_alloc_zero(uint64_t count, size_t size);
/* The same, at the beginning of a cache line: for what is read and written by vectors. */
void *ebpo_alloc_lines(uint64_t count, size_t size);
/* Resizes to count * size bytes; on NULL the old block stays valid. */
void *ebpo_realloc(void *block, uint64_t count, size_t size);

/* Makes room for `need` items in a growing array (*capacity items of `size` bytes at *array),
 * growing it by half. False when memory is short; the array stays valid. */
bool ebpo_grow(void *array, uint64_t *capacity, uint64_t need, size_t size);

#endif
