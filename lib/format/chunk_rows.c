#include "format/chunk_rows.h"

#include <string.h>

#include "core/wide.h"
#include "hdf5_read/chunk.h"

enum {
    FIRST_LEVELS = 5,    /* these lie together, whatever the subtrees */
    LEAVES_OF_DEEP = 64, /* a deep level has a leaf for each so many faces */
    CHUNK_FACES = 16384, /* that a chunk of a lower level goes with */
    CHUNK_LEAST = 256,   /* bytes */
    CHUNK_MOST = 32768,
    MAP_ROWS = 2048,
    FACES_INDEX_ROWS = 512,
    OUTER_ROWS = 4096,
    ATTRIBUTE_ROWS = 2048
};

int ebpo_last_whole_level(const ebpo_info *info)
{
    return info->subtree_level > FIRST_LEVELS ? info->subtree_level : FIRST_LEVELS;
}

int ebpo_first_deep_level(const ebpo_info *info)
{
    int level = ebpo_last_whole_level(info) + 1;
    while (level < info->level_count &&
           info->level[level].leaf_count < info->face_count / LEAVES_OF_DEEP)
        level++;
    return level;
}

/* The power of two that is nearest, by its ratio, to the rows that go with CHUNK_FACES faces: the
 * first one that is not less than these over the root of 2. In integers, as bytes depend on it: of
 * rows there are at most 2^40, and both sides of the comparison below 2^64 before they are squared.
 */
static uint64_t rows_for_faces(const ebpo_info *info, uint64_t rows)
{
    uint64_t wanted = rows * CHUNK_FACES, found = 1;
    for (;; found *= 2) {
        uint64_t has = found * info->face_count;
        if (!ebpo_wide_less(ebpo_wide_left(ebpo_wide_product(has, has), 1),
                            ebpo_wide_product(wanted, wanted)))
            return found;
    }
}

static uint64_t wanted_rows(const ebpo_info *info, ebpo_array_id id, int level, uint64_t rows,
                            uint32_t row_bytes)
{
    switch (id) {
    case EBPO_A_FACE_SOURCE:
    case EBPO_A_FACES: return EBPO_FACE_BLOCK;
    case EBPO_A_VERTICES: return EBPO_VERTEX_BLOCK;
    case EBPO_A_VERTEX_SOURCE: return MAP_ROWS;
    case EBPO_A_FACES_INDEX: return FACES_INDEX_ROWS;
    case EBPO_A_SUBTREE_COUNTS: return ebpo_subtree_rows(info);
    case EBPO_A_SUBTREE_OUTER: return OUTER_ROWS;
    case EBPO_A_ATTRIBUTE: return ATTRIBUTE_ROWS;
    default: break;
    }
    if (id >= EBPO_LEVEL_ARRAYS || level <= ebpo_last_whole_level(info) || ebpo_schema_is_index(id))
        return UINT64_MAX;
    uint64_t found = rows_for_faces(info, rows);
    while (found * row_bytes < CHUNK_LEAST)
        found *= 2;
    while (found * row_bytes > CHUNK_MOST)
        found /= 2;
    return found;
}

uint32_t ebpo_rows_of_chunk(const ebpo_info *info, ebpo_array_id id, int level, uint64_t rows,
                            uint32_t cols, uint32_t element_size)
{
    uint32_t most = ebpo_full_chunk_rows(rows, cols, element_size);
    if (!info->subtree_level)
        return most;
    uint64_t wanted = wanted_rows(info, id, level, rows, element_size * (cols ? cols : 1));
    return wanted < most ? (uint32_t)wanted : most;
}

uint32_t ebpo_rows_of_foreign_chunk(const char *path, const ebpo_shape *stored, bool subtrees,
                                    bool kept)
{
    static const struct {
        const char *path;
        uint32_t rows;
        bool fixed;
    } known[] = {
        { "/mesh/faces", EBPO_FACE_BLOCK, true },
        { "/mesh/vertices", EBPO_VERTEX_BLOCK, true },
        { "/subtrees/counts", EBPO_SUBTREE_ROWS, true },
        { "/maps/vertex_source", MAP_ROWS, false },
        { "/maps/face_source", EBPO_FACE_BLOCK, false },
        { "/attributes/", ATTRIBUTE_ROWS, false },
    };
    uint32_t full = ebpo_full_chunk_rows(stored->rows, stored->cols, stored->element_size),
             rows = stored->chunk_rows;
    if (!subtrees)
        return full;
    if (rows == 0 || rows & (rows - 1) || rows > full)
        rows = full;
    for (size_t i = 0; i < sizeof known / sizeof known[0]; i++)
        if ((known[i].fixed || !kept) && strncmp(path, known[i].path, strlen(known[i].path)) == 0 &&
            (path[strlen(known[i].path)] == 0 || path[strlen(known[i].path) - 1] == '/'))
            rows = known[i].rows < full ? known[i].rows : full;
    return rows;
}
