/* Computes the order of /subtrees/checksums, which is sorted by blocks of subtrees: those whose
 * rows are in one chunk of /subtrees/counts. /subtrees/index has the number of rows before each
 * block in every array, and a chunk belongs to the block of its first row. So the row of each chunk
 * follows from /subtrees/index. Source: format-spec/checksums.md, section 4. */
#include "format/checksum_pages.h"

/* Returns the number of blocks of subtrees. */
static uint64_t block_count(const ebpo_info *info)
{
    return ebpo_schema_rows(info, EBPO_A_SUBTREE_INDEX, 0);
}

bool ebpo_is_paged(const ebpo_info *info, ebpo_array_id id, int level, const ebpo_shape *shape)
{
    bool of_level =
             id < EBPO_LEVEL_ARRAYS && level > info->subtree_level && !ebpo_schema_is_index(id),
         of_mesh = id == EBPO_A_VERTICES || id == EBPO_A_FACES || id == EBPO_A_VERTEX_SOURCE ||
                   id == EBPO_A_FACE_SOURCE;
    return info->subtree_level && (of_level || of_mesh) &&
           ebpo_shape_chunks(shape) > block_count(info);
}

/* Returns the number of rows of a paged array before a block. `sums`: the block's row of
 * /subtrees/index. Wrong sums may give any number. */
static uint64_t rows_before(const ebpo_info *info, const uint64_t *sums, uint64_t block,
                            const ebpo_paged_array *a)
{
    ebpo_per per = ebpo_schema[a->id].per;
    if (a->id >= EBPO_LEVEL_ARRAYS)
        return per == EBPO_PER_FACE ? sums[EBPO_S_FACES_BEFORE] + sums[EBPO_S_FACES]
                                    : sums[EBPO_S_VERTICES_BEFORE] + sums[EBPO_S_VERTICES];
    uint64_t groups = a->level == info->subtree_level + 1
                          ? block * ebpo_subtree_rows(info)
                          : sums[ebpo_subtree_column(info, a->level - 1, EBPO_S_GRAY)];
    const uint64_t *s = sums + ebpo_subtree_column(info, a->level, 0);
    switch (per) {
    case EBPO_PER_GROUP: return groups;
    case EBPO_PER_GRAY: return s[EBPO_S_GRAY];
    case EBPO_PER_LEAF: return s[EBPO_S_LEAF];
    case EBPO_PER_BLACK: return s[EBPO_S_BLACK];
    case EBPO_PER_WHITE: return 8 * groups - s[EBPO_S_GRAY] - s[EBPO_S_LEAF] - s[EBPO_S_BLACK];
    case EBPO_PER_PLANE: return s[EBPO_S_PLANES];
    case EBPO_PER_LEAF_PLANE: return s[EBPO_S_LEAF_PLANES];
    default: return s[EBPO_S_REFS];
    }
}

void ebpo_number_checksums(const ebpo_info *info, const uint64_t *index, ebpo_paged_array *array,
                           unsigned count)
{
    uint64_t blocks = block_count(info), cols = ebpo_schema_cols(info, EBPO_A_SUBTREE_INDEX);
    uint32_t row = 0;
    for (uint64_t b = 1; b <= blocks; b++)
        for (ebpo_paged_array *a = array; a < array + count; a++) {
            uint64_t chunks = ebpo_shape_chunks(a->shape),
                     end = b < blocks ? rows_before(info, index + b * cols, b, a) : UINT64_MAX;
            for (; a->done < chunks && a->done * a->shape->chunk_rows < end; a->done++)
                *(uint32_t *)(void *)((char *)a->row + a->done * a->step) = row++;
        }
}
