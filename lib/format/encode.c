/* Rows to bytes, see plan.h. */
#include "core/endian.h"
#include "hdf5_read/coding.h"
#include "format/attribute_plan.h"
#include "format/plan.h"

static void encode_skips(const ebpo_level *level, const ebpo_shape *shape, uint64_t row,
                         uint64_t rows, uint8_t *file)
{
    for (uint64_t i = row; i < row + rows; i++) {
        uint64_t skip =
            level->leaf_first[i] - (i ? level->leaf_first[i - 1] + level->leaf_new[i - 1] : 0);
        ebpo_integers_encode(&skip, sizeof skip, 1, shape->element_size, file);
        file += shape->element_size;
    }
}

/* Last index row whose references begin at or before `ref`. */
static uint64_t block_of(const uint64_t *leaf_index, uint64_t leaves, uint64_t ref)
{
    uint64_t low = 0, high = (leaves - 1) / EBPO_INDEX_ROWS;
    while (low < high) {
        uint64_t middle = (low + high + 1) / 2;
        if (leaf_index[middle * 3 + 1] <= ref)
            low = middle;
        else
            high = middle - 1;
    }
    return low;
}

static void encode_refs(const ebpo_level *level, const uint64_t *leaf_index, uint64_t row,
                        uint64_t rows, uint8_t *file)
{
    uint64_t block = block_of(leaf_index, level->leaf_count, row);
    uint64_t leaf = block * EBPO_INDEX_ROWS, before = leaf_index[block * 3 + 1], end = row + rows;
    for (; before < end; before += level->leaf_ref_count[leaf++]) {
        uint64_t count = level->leaf_ref_count[leaf];
        /* ascending; stored from the last to the first */
        const uint32_t *refs = level->leaf_refs + before;
        for (uint64_t k = row > before ? row - before : 0; k < count && before + k < end; k++) {
            uint64_t above = k ? refs[count - k] : level->leaf_first[leaf];
            ebpo_store32(file + 4 * (before + k - row),
                         (uint32_t)(above - 1 - refs[count - 1 - k]));
        }
    }
}

void ebpo_plan_encode(const ebpo_plan *plan, const ebpo_array_out *array, uint64_t row,
                      uint64_t rows, uint8_t *file)
{
    const ebpo_tree *tree = plan->tree;
    const ebpo_level *level = &tree->level[array->level];
    uint64_t seen;
    switch (array->id) {
    case EBPO_A_LEAF_SKIP: encode_skips(level, &array->shape, row, rows, file); break;
    case EBPO_A_LEAF_REFS:
        encode_refs(level, plan->index[array->level][EBPO_INDEX_LEAVES], row, rows, file);
        break;
    case EBPO_A_VERTICES:
        if (tree->mesh.xyz32)
            ebpo_points32_encode(tree->mesh.xyz32 + 3 * row, rows, file);
        else
            ebpo_points64_encode(tree->mesh.xyz64 + 3 * row, rows, file);
        break;
    case EBPO_A_FACES:
        seen = plan->faces_index[row / array->shape.chunk_rows];
        /* index_faces has checked them */
        (void)ebpo_corners_encode(tree->mesh.faces + 3 * row, rows, &seen, file);
        break;
    case EBPO_A_VERTEX_SOURCE: ebpo_numbers_encode(tree->vertex_source + row, rows, file); break;
    case EBPO_A_ATTRIBUTE: ebpo_attributes_encode(plan, array, row, rows, file); break;
    case EBPO_A_FACE_SOURCE: ebpo_numbers_encode(tree->face_source + row, rows, file); break;
    default: {
        uint64_t cols = array->shape.cols ? array->shape.cols : 1;
        const uint8_t *values = array->values;
        ebpo_integers_encode(values + row * cols * array->value_size, array->value_size,
                             rows * cols, array->shape.element_size, file);
    }
    }
}
