/* Checks the faces of a subtree against the file's table of subtrees (/subtrees/counts). A new face
 * of a leaf is in the list of no earlier leaf, depth first. The leaves' new faces are stored as
 * differences, and the column EBPO_S_ENDS of the table has the start value for each level. A wrong
 * start value shifts the new faces of the leaves of one level, and no sum of counts detects this
 * error. So this check visits all leaves of the subtree in depth-first order. Readers of a whole
 * subtree check its leaves themselves (slice.c); this check is for readers of a part of a subtree.
 * It pins at most one chunk of each array and level at a time, and allocates no memory. Source:
 * format-spec/subtrees.md, rule RC.4. */
#include <string.h>

#include "core/endian.h"
#include "format/subtree_faces.h"
#include "format/subtree_index.h"
#include "geometry/level_nodes.h"

/* The three arrays of a level that are read. SKIP: number of faces between the new faces of a
 * leaf and those of the previous leaf of the level. NEW: number of new faces of a leaf. */
enum { TYPES, SKIP, NEW, LISTS };

/* State of a visit of all leaves of a subtree. */
typedef struct visit {
    ebpo_chunks *chunks;
    const ebpo_subtree_row *row;
    ebpo_held_chunk view[EBPO_LEVELS_MAX][LISTS];
    /* for each level: next group, next leaf, and one past the last new face of the previous leaf */
    uint64_t group[EBPO_LEVELS_MAX], leaf[EBPO_LEVELS_MAX], end[EBPO_LEVELS_MAX];
    uint64_t face; /* next new face */
} visit;

static ebpo_status faces_differ(const visit *v, ebpo_error *error)
{
    return ebpo_chunks_fail(v->chunks, -1, EBPO_A_SUBTREE_COUNTS,
                            "a row contradicts the faces of its subtree", error);
}

/* Reads element `at` of a level's array `list`: TYPES, SKIP or NEW. */
static ebpo_status load_item(visit *v, int level, int list, uint64_t at, uint64_t *value,
                             ebpo_error *error)
{
    ebpo_held_chunk *view = &v->view[level][list];
    if (at >= view->array->shape.rows || !view->array->present)
        return faces_differ(v, error);
    ebpo_status status = ebpo_held_chunk_move(v->chunks, view, at, error);
    if (status != EBPO_OK)
        return status;
    unsigned size = view->array->shape.element_size;
    const uint8_t *bytes = view->rows + (at - view->begin) * size;
    *value = size == 1 ? *bytes : size == 2 ? ebpo_load16(bytes) : ebpo_load32(bytes);
    return EBPO_OK;
}

/* Checks that the level's next leaf begins with the next new face. */
static ebpo_status visit_leaf(visit *v, int level, ebpo_error *error)
{
    uint64_t at = v->leaf[level]++, skip = 0, new_faces = 0;
    ebpo_status status = load_item(v, level, SKIP, at, &skip, error);
    if (status == EBPO_OK)
        status = load_item(v, level, NEW, at, &new_faces, error);
    if (status == EBPO_OK && v->end[level] + skip != v->face)
        status = faces_differ(v, error);
    v->face += new_faces;
    v->end[level] = v->face;
    return status;
}

/* Visits the leaves in and below the level's next group. */
static ebpo_status visit_group(visit *v, int level, ebpo_error *error)
{
    const ebpo_info *info = &v->chunks->file->info;
    uint64_t types = 0;
    ebpo_status status = v->group[level] < ebpo_subtree_groups(info, v->row, level, true)
                             ? load_item(v, level, TYPES, v->group[level]++, &types, error)
                             : faces_differ(v, error);
    for (unsigned octant = 0; octant < 8 && status == EBPO_OK; octant++) {
        ebpo_node_type type = ebpo_group_type((uint16_t)types, octant);
        if (type == EBPO_GRAY && level + 1 < info->level_count)
            status = visit_group(v, level + 1, error);
        else if (type == EBPO_LEAF)
            status = visit_leaf(v, level, error);
    }
    return status;
}

/* Visits all leaves of a subtree. */
static ebpo_status visit_subtree(ebpo_chunks *chunks, const ebpo_subtree_row *row,
                                 ebpo_error *error)
{
    static const ebpo_array_id arrays[LISTS] = { EBPO_A_TYPES, EBPO_A_LEAF_SKIP, EBPO_A_LEAF_NEW };
    const ebpo_info *info = &chunks->file->info;
    visit v = { .chunks = chunks, .row = row, .face = row->face };
    for (int level = info->subtree_level + 1; level < info->level_count; level++) {
        v.group[level] = ebpo_subtree_groups(info, row, level, false);
        v.leaf[level] = row->before[ebpo_subtree_column(info, level, EBPO_S_LEAF)];
        v.end[level] = row->before[ebpo_subtree_column(info, level, EBPO_S_ENDS)];
        for (int list = 0; list < LISTS; list++)
            v.view[level][list].array = ebpo_reader_array(chunks->file, arrays[list], level);
    }
    ebpo_status status = visit_group(&v, info->subtree_level + 1, error);
    for (int level = info->subtree_level + 1; level < info->level_count; level++)
        for (int list = 0; list < LISTS; list++)
            ebpo_held_chunk_release(chunks, &v.view[level][list]);
    uint64_t owned = row->after[EBPO_S_FACES] - row->before[EBPO_S_FACES];
    return status == EBPO_OK && v.face != row->face + owned ? faces_differ(&v, error) : status;
}

ebpo_status ebpo_subtree_faces_check(ebpo_chunks *chunks, const ebpo_node *node, ebpo_error *error)
{
    const ebpo_info *info = &chunks->file->info;
    ebpo_subtree_row row;
    if (chunks->counted)
        return EBPO_OK;
    unsigned column = node->type == EBPO_GRAY ? EBPO_S_GRAY : EBPO_S_LEAF;
    ebpo_status status =
        ebpo_subtree_table_find(chunks, ebpo_subtree_column(info, node->cell.level, column),
                                node->rank, &row, error);
    if (status != EBPO_OK || ebpo_subtree_faces_known(chunks, row.subtree))
        return status;
    status = visit_subtree(chunks, &row, error);
    if (status == EBPO_OK)
        ebpo_subtree_faces_note(chunks, row.subtree);
    return status;
}
