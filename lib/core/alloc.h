/* Allocates memory with checked sizes. Every array whose size comes from a file or a mesh is
 * allocated here, or by a workspace (core/workspace.h) if it may be larger than memory. */
#ifndef EBPO_CORE_ALLOC_H
#define EBPO_CORE_ALLOC_H

#include <ebpo/base.h>

/* Writes a * b to *out; returns false when the product does not fit 64 bits. */
static inline bool ebpo_mul_ok(uint64_t a, uint64_t b, uint64_t *out)
{
    return !__builtin_mul_overflow(a, b, out);
}

/* Allocates count * size uninitialised bytes. Returns NULL if the product is too large or malloc
 * fails. If `count` is 0, returns a pointer that is not NULL. */
void *ebpo_alloc(uint64_t count, size_t size);
/* Same as ebpo_alloc, but zeroed. */
void *ebpo_alloc_zero(uint64_t count, size_t size);
/* Same as ebpo_alloc_zero, but the block is aligned to a cache line (64 bytes), for data that
 * vector instructions read and write. */
void *ebpo_alloc_lines(uint64_t count, size_t size);
/* Resizes a block to count * size bytes. On failure, returns NULL, and the old block stays valid.
 */
void *ebpo_realloc(void *block, uint64_t count, size_t size);

/* Ensures that a growing array has capacity for `need` items. `array`: address of the pointer to
 * the items. *capacity: number of items of `size` bytes for which memory is allocated. If this
 * number is less than `need`, it grows by at least half. Returns false when out of memory; the
 * array stays valid. */
bool ebpo_grow(void *array, uint64_t *capacity, uint64_t need, size_t size);

/* The memory limit of an object that is being built, for one thread. All members are in bytes. */
typedef struct ebpo_quota {
    uint64_t most;   /* the limit */
    uint64_t taken;  /* reserved bytes, at most `most` */
    uint64_t needed; /* after a refused request: a higher limit that might be sufficient */
} ebpo_quota;

/* Returns EBPO_E_LIMIT if `bytes` more bytes would exceed the limit. If `space` is NULL, there is
 * no limit. */
EBPO_MUST_USE ebpo_status ebpo_quota_check(ebpo_quota *space, uint64_t bytes, ebpo_error *error);
/* Same as ebpo_quota_check, and counts the bytes as taken. */
EBPO_MUST_USE ebpo_status ebpo_quota_take(ebpo_quota *space, uint64_t bytes, ebpo_error *error);
/* Reverses ebpo_quota_take: counts these bytes as free again. */
void ebpo_quota_give(ebpo_quota *space, uint64_t bytes);

#endif
