/* The arrays of a level, one by one. */
#ifndef EBPO_BUILD_LEVEL_ARRAYS_H
#define EBPO_BUILD_LEVEL_ARRAYS_H

#include <string.h>

#include "construct/builder.h"

typedef struct ebpo_level_array {
    size_t array, count; /* offsets in ebpo_level of the pointer and of its length */
    size_t size;
} ebpo_level_array;

#define ARRAY(array, count, type)                                              \
    {                                                                          \
        offsetof(ebpo_level, array), offsetof(ebpo_level, count), sizeof(type) \
    }
static const ebpo_level_array ebpo_level_arrays[] = {
    ARRAY(types, group_count, uint16_t),           ARRAY(plane_counts, gray_count, uint8_t),
    ARRAY(planes, plane_count, uint32_t),          ARRAY(leaf_winding, leaf_count, int32_t),
    ARRAY(black_winding, black_count, int32_t),    ARRAY(white_winding, white_count, int32_t),
    ARRAY(leaf_first, leaf_count, uint64_t),       ARRAY(leaf_new, leaf_count, uint32_t),
    ARRAY(leaf_ref_count, leaf_count, uint32_t),   ARRAY(leaf_refs, ref_count, uint32_t),
    ARRAY(leaf_plane_counts, leaf_count, uint8_t), ARRAY(leaf_planes, leaf_plane_count, uint32_t)
};
#undef ARRAY
enum { EBPO_LEVEL_ARRAYS = sizeof ebpo_level_arrays / sizeof *ebpo_level_arrays };

static inline void *ebpo_array_of_level(const ebpo_level *level, const ebpo_level_array *s)
{
    void *array;
    memcpy(&array, (const char *)level + s->array, sizeof array);
    return array;
}

static inline uint64_t ebpo_count_of_level(const ebpo_level *level, const ebpo_level_array *s)
{
    uint64_t count;
    memcpy(&count, (const char *)level + s->count, sizeof count);
    return count;
}

#endif
