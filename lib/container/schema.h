/* The objects of a file, one table for writer and reader: format-spec/README.md, "Arrays". */
#ifndef EBPO_CONTAINER_SCHEMA_H
#define EBPO_CONTAINER_SCHEMA_H

#include <ebpo/file.h>

/* In the order in which they lie in the file. Up to EBPO_A_LEAF_PLANES once for each level. */
typedef enum ebpo_array_id {
    EBPO_A_TYPES,
    EBPO_A_PLANE_COUNTS,
    EBPO_A_PLANES,
    EBPO_A_LEAF_WINDING,
    EBPO_A_BLACK_WINDING,
    EBPO_A_WHITE_WINDING,
    EBPO_A_LEAF_SKIP,
    EBPO_A_LEAF_NEW,
    EBPO_A_LEAF_REF_COUNT,
    EBPO_A_LEAF_REFS,
    EBPO_A_TYPES_INDEX,
    EBPO_A_GRAY_INDEX,
    EBPO_A_LEAF_INDEX,
    EBPO_A_LEAF_PLANE_COUNTS,
    EBPO_A_LEAF_PLANES,
    EBPO_LEVEL_ARRAYS,
    EBPO_A_VERTICES = EBPO_LEVEL_ARRAYS,
    EBPO_A_FACES,
    EBPO_A_FACES_INDEX,
    EBPO_A_VERTEX_SOURCE,
    EBPO_A_FACE_SOURCE,
    EBPO_ARRAYS
} ebpo_array_id;

enum {
    EBPO_INDEX_ROWS = 4096, /* items between two rows of an index array */
    EBPO_PATH_BYTES = 48
};

typedef struct ebpo_array_spec {
    const char *name; /* within /levels/NN, or the whole path */
    uint8_t cols;     /* 0: one dimension */
    uint8_t sizes;    /* allowed element sizes, summed: 1 + 2 + 4 + 8 */
    bool is_signed;
    bool if_needed;     /* may be absent where its rows exist: then every value is the usual one */
    const char *coding; /* attribute */
    const char *about;  /* attribute */
} ebpo_array_spec;

extern const ebpo_array_spec ebpo_schema[EBPO_ARRAYS];

/* Absolute path of an array; `level` matters for level arrays only. */
void ebpo_schema_path(ebpo_array_id id, int level, char path[EBPO_PATH_BYTES]);

/* Rows that the head's counts and parts call for; 0: the array is not in the file. */
uint64_t ebpo_schema_rows(const ebpo_info *info, ebpo_array_id id, int level);

/* Rows of an index array over `count` items: one each EBPO_INDEX_ROWS, but none when one would do
 * (it is all zeros). */
uint64_t ebpo_schema_index_rows(uint64_t count);

/* Groups of eight of a level, from the head's counts. */
static inline uint64_t ebpo_schema_groups(const ebpo_info *info, int level)
{
    return level == 0 ? 1 : info->level[level - 1].gray_count;
}

#endif
