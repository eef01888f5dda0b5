/* The arrays of a level, one by one. */
#ifndef EBPO_BUILD_SLICES_H
#define EBPO_BUILD_SLICES_H

#include <string.h>

#include "build/builder.h"

typedef struct ebpo_slice {
    size_t array, count; /* offsets in ebpo_level of the pointer and of its length */
    size_t size;
} ebpo_slice;

#define SLICE(array, count, type) { offsetof(ebpo_level, array), offsetof(ebpo_level, count), sizeof(type) }
static const ebpo_slice ebpo_slices[] = {
    SLICE(types, group_count, uint16_t), SLICE(plane_counts, gray_count, uint8_t), SLICE(planes, plane_count, uint32_t),
    SLICE(leaf_winding, leaf_count, int32_t), SLICE(black_winding, black_count, int32_t),
    SLICE(white_winding, white_count, int32_t), SLICE(leaf_first, leaf_count, uint64_t),
    SLICE(leaf_new, leaf_count, uint32_t), SLICE(leaf_ref_count, leaf_count, uint32_t),
    SLICE(leaf_refs, ref_count, uint32_t), SLICE(leaf_plane_counts, leaf_count, uint8_t),
    SLICE(leaf_planes, leaf_plane_count, uint32_t)
};
#undef SLICE
enum { EBPO_SLICES = sizeof ebpo_slices / sizeof *ebpo_slices };

static inline void *ebpo_slice_array(const ebpo_level *level, const ebpo_slice *s)
{
    void *array;
    memcpy(&array, (const char *)level + s->array, sizeof array);
    return array;
}

static inline uint64_t ebpo_slice_count(const ebpo_level *level, const ebpo_slice *s)
{
    uint64_t count;
    memcpy(&count, (const char *)level + s->count, sizeof count);
    return count;
}

#endif
