/* Verifies the face lists of leaves against the faces that touch the leaves.
 *
 * A leaf must list every face that touches its closed cell. No face may touch a white or black
 * cell. The builder also lists faces for which its test is not certain. So a listed face that does
 * not touch the leaf's cell is no violation if it touches the cell enlarged by 1/256 of its size on
 * each side; such faces are only counted.
 *
 * The format allows a gray node only if a leaf in its place would list more faces than the limit of
 * the file (`leaf_faces`). To check this, the different faces in the lists below the node are
 * counted up to the limit. If there is not enough memory to count them, the check passes. */
#include "core/strict_fp.h"

#include <stdlib.h>

#include "core/alloc.h"
#include "core/workspace.h"
#include "verify/verify_geometry.h"
#include "verify/verify_parts.h"

static void report_face(ebpo_tally *tally, const ebpo_reference_node *node, uint32_t face,
                        const char *text)
{
    ebpo_tally_violation(tally, EBPO_VERIFY_LISTS,
                         &(ebpo_verify_place){ node->code, face, EBPO_NO_PLANE }, "%s", text);
}

/* The face list of a leaf, in ascending order: first the references (faces that an earlier leaf
 * lists), then the range of new faces. The tree has passed ebpo_check_shape. */
typedef struct face_list {
    const uint32_t *refs;
    uint32_t ref_count, new_count;
    uint64_t first; /* index of the first new face */
} face_list;

/* Returns the face list of a leaf. */
static face_list list_of(const ebpo_reference_tree *view, const ebpo_reference_node *leaf)
{
    const ebpo_level *level = &view->tree->level[leaf->cell.level];
    face_list list = { .first = level->leaf_first[leaf->rank],
                       .new_count = level->leaf_new[leaf->rank] };
    list.refs = ebpo_reference_refs(view, leaf, &list.ref_count);
    return list;
}

/* Returns true if `faces` contains the face. `faces` is in ascending order. */
static bool is_among(const uint32_t *faces, uint64_t count, uint32_t face)
{
    uint64_t low = 0, high = count;
    while (low < high) {
        uint64_t middle = low + (high - low) / 2;
        if (faces[middle] < face)
            low = middle + 1;
        else
            high = middle;
    }
    return low < count && faces[low] == face;
}

/* Checks that a listed face touches the leaf's cell enlarged by 1/256 of its size on each side.
 * Distance queries with a limited level rely on this condition. */
static void check_near(ebpo_tally *tally, const ebpo_reference_tree *view,
                       const ebpo_reference_node *leaf, uint32_t face)
{
    ebpo_frame frame = ebpo_frame_make(&view->box, leaf->cell);
    ebpo_corners corners;
    for (int k = 0; k < 3; k++) {
        double margin = (frame.high[k] - frame.low[k]) * 0x1p-8;
        frame.low[k] -= margin;
        frame.high[k] += margin;
        frame.inverse[k] = 1 / (frame.high[k] - frame.low[k]);
    }
    ebpo_face_corners(&view->tree->mesh, face, &corners);
    if (!ebpo_face_touches(&frame, &corners, tally))
        report_face(tally, leaf, face, "the leaf lists a face that is not near it");
}

/* Checks the listed faces that do not touch the leaf. `faces`: [count] all faces that touch the
 * leaf, ascending. */
static void check_extra(ebpo_tally *tally, const ebpo_reference_tree *view,
                        const ebpo_reference_node *leaf, const face_list *list,
                        const uint32_t *faces, uint64_t count)
{
    EBPO_FOR_ITEMS_SCATTERED(view->workspace, i, 0, list->ref_count)
        if (!is_among(faces, count, list->refs[i]))
            check_near(tally, view, leaf, list->refs[i]);
    EBPO_FOR_ITEMS_SCATTERED(view->workspace, i, 0, list->new_count)
        if (!is_among(faces, count, (uint32_t)(list->first + i)))
            check_near(tally, view, leaf, (uint32_t)(list->first + i));
}

/* Checks the list of a leaf. `faces`: all faces that touch the leaf, ascending. */
static void check_leaf(ebpo_tally *tally, const ebpo_reference_tree *view,
                       const ebpo_reference_node *leaf, const uint32_t *faces, uint64_t count)
{
    face_list list = list_of(view, leaf);
    uint64_t found = 0;
    uint32_t at = 0;
    EBPO_FOR_ITEMS(view->workspace, i, 0, count) {
        uint32_t face = faces[i];
        while (at < list.ref_count && list.refs[at] < face)
            at++;
        bool listed = (at < list.ref_count && list.refs[at] == face) ||
                      (face >= list.first && face - list.first < list.new_count);
        found += listed;
        if (!listed)
            report_face(tally, leaf, face, "the face touches the leaf, which does not list it");
    }
    EBPO_FOR_ITEMS(view->workspace, i, 1, list.ref_count)
        if (list.refs[i] <= list.refs[i - 1])
            report_face(tally, leaf, list.refs[i], "the list names the face twice or not in order");
    if (list.ref_count && list.refs[list.ref_count - 1] >= list.first)
        report_face(tally, leaf, list.refs[list.ref_count - 1],
                    "the list refers to a face whose index is not less than the index of the "
                    "list's first new face");
    tally->checks[EBPO_VERIFY_LISTS] += count + list.ref_count + list.new_count;
    /* listed faces that do not touch the leaf */
    uint64_t extra = (uint64_t)list.ref_count + list.new_count - found;
    tally->spare_entries += extra;
    if (extra)
        check_extra(tally, view, leaf, &list, faces, count);
}

void ebpo_check_terminal_lists(ebpo_tally *tally, const ebpo_reference_tree *view,
                               const ebpo_reference_node *node, const uint32_t *faces,
                               uint64_t count)
{
    if (node->type == EBPO_LEAF) {
        check_leaf(tally, view, node, faces, count);
        return;
    }
    tally->checks[EBPO_VERIFY_LISTS] += count ? count : 1;
    EBPO_FOR_ITEMS(view->workspace, i, 0, count)
        report_face(tally, node, faces[i],
                    node->type == EBPO_WHITE ? "the face touches a white cell"
                                             : "the face touches a black cell");
}

/* The different faces that the leaves below a node list. Faces are gathered only until there are
 * more than `limit` different faces. The faces are kept in a list of at most about twice `limit`
 * entries, which may contain repetitions. If `limit` exceeds LIST_LIMIT_MAX, they are marked in an
 * array with one bit for each face of the mesh instead. */
typedef struct gathering {
    uint32_t *faces; /* [count] the list */
    uint8_t *listed; /* bit f: face f was gathered; NULL: the list is used */
    uint64_t count, capacity, limit;
    bool more; /* there are more different faces than `limit` */
    bool short_of_memory;
} gathering;

enum { LIST_LIMIT_MAX = 1 << 16 };

static int compare_numbers(const void *a, const void *b)
{
    uint32_t x = *(const uint32_t *)a, y = *(const uint32_t *)b;
    return (x > y) - (x < y);
}

/* Sorts the list of faces and removes repetitions. */
static void keep_different(gathering *g)
{
    uint64_t kept = g->count > 0;
    if (g->count)
        qsort(g->faces, g->count, sizeof *g->faces, compare_numbers);
    for (uint64_t i = 1; i < g->count; i++)
        if (g->faces[i] != g->faces[kept - 1])
            g->faces[kept++] = g->faces[i];
    g->count = kept;
    g->more |= kept > g->limit;
}

static void mark_face(gathering *g, uint64_t face)
{
    uint8_t bit = (uint8_t)(1u << (face & 7));
    g->count += !(g->listed[face >> 3] & bit);
    g->listed[face >> 3] |= bit;
    g->more |= g->count > g->limit;
}

static void mark_list(gathering *g, const face_list *list)
{
    for (uint32_t i = 0; i < list->ref_count; i++)
        mark_face(g, list->refs[i]);
    for (uint32_t i = 0; i < list->new_count; i++)
        mark_face(g, list->first + i);
}

/* Adds the faces of a leaf's list. A list contains no face twice, so if the list is longer than the
 * limit, `more` is set at once. */
static void gather_list(gathering *g, const face_list *list)
{
    uint64_t length = (uint64_t)list->ref_count + list->new_count;
    if (length > g->limit) {
        g->more = true;
        return;
    }
    if (g->listed) {
        mark_list(g, list);
        return;
    }
    if (g->count + length > 2 * g->limit + 64)
        keep_different(g);
    if (!ebpo_grow(&g->faces, &g->capacity, g->count + length, sizeof *g->faces)) {
        g->short_of_memory = true;
        return;
    }
    for (uint32_t i = 0; i < list->ref_count; i++)
        g->faces[g->count++] = list->refs[i];
    for (uint32_t i = 0; i < list->new_count; i++)
        g->faces[g->count++] = (uint32_t)(list->first + i);
}

/* Adds the lists of all leaves below a node, until there are more faces than the limit. */
static void gather_below(gathering *g, const ebpo_reference_tree *view,
                         const ebpo_reference_node *node)
{
    if (g->more || g->short_of_memory)
        return;
    if (node->type == EBPO_LEAF) {
        face_list list = list_of(view, node);
        gather_list(g, &list);
    }
    for (unsigned octant = 0; node->type == EBPO_GRAY && octant < 8; octant++) {
        ebpo_reference_node child = ebpo_reference_child(view, node, octant);
        gather_below(g, view, &child);
    }
}

bool ebpo_lists_more_faces(const ebpo_reference_tree *view, const ebpo_reference_node *node,
                           uint64_t limit)
{
    gathering g = { .limit = limit };
    uint64_t faces = view->tree->mesh.face_count;
    if (limit >= faces)
        return false;
    if (limit > LIST_LIMIT_MAX) {
        g.listed = ebpo_array_zero(view->workspace, faces / 8 + 1, 1);
        g.short_of_memory = !g.listed;
    }
    gather_below(&g, view, node);
    if (!g.listed)
        keep_different(&g);
    free(g.faces);
    ebpo_array_free(view->workspace, g.listed);
    /* A lack of memory does not make the file invalid. */
    return g.more || g.short_of_memory;
}
