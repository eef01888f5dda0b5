/* Allocation with checked sizes: every array whose size comes from a file or a mesh is allocated
 * here, or by a workspace (core/workspace.h) if it may be larger than memory. */
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

/* Memory that making something may take, counted while it is made. */

/* One thread. `needed` is set by what is refused: so much might do, always more than `most`. */
typedef struct ebpo_room {
    uint64_t most, taken, needed;
} ebpo_room;

/* EBPO_E_LIMIT if there is no room for so much beside what is taken. NULL: no limit. */
EBPO_MUST_USE ebpo_status ebpo_room_check(ebpo_room *room, uint64_t bytes, ebpo_error *error);
/* The same, and takes it. */
EBPO_MUST_USE ebpo_status ebpo_room_take(ebpo_room *room, uint64_t bytes, ebpo_error *error);
void ebpo_room_give(ebpo_room *room, uint64_t bytes);

#endif
