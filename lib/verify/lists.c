#include "verify/lists.h"

#include <stdlib.h>

static void unlisted(ebpo_tally *tally, const ebpo_view_node *node, uint32_t face, const char *text)
{
    ebpo_tally_violation(tally, EBPO_VERIFY_LISTS, &(ebpo_verify_place){node->code, face, EBPO_NO_PLANE}, "%s", text);
}

/* The list in ascending order: references, then the new range (the file's shape was checked). */
typedef struct face_list {
    const uint32_t *refs;
    uint32_t ref_count, new_count;
    uint64_t first;
} face_list;

static face_list list_of(const ebpo_view *view, const ebpo_view_node *leaf)
{
    const ebpo_level *level = &view->tree->level[leaf->cell.level];
    face_list list = {.first = level->leaf_first[leaf->rank], .new_count = level->leaf_new[leaf->rank]};
    list.refs = ebpo_view_refs(view, leaf, &list.ref_count);
    return list;
}

static void check_leaf(ebpo_tally *tally, const ebpo_view *view, const ebpo_view_node *leaf, const uint32_t *faces, uint64_t count)
{
    face_list list = list_of(view, leaf);
    uint64_t found = 0;
    uint32_t at = 0;
    for (uint64_t i = 0; i < count; i++) {
        uint32_t face = faces[i];
        while (at < list.ref_count && list.refs[at] < face)
            at++;
        bool listed = (at < list.ref_count && list.refs[at] == face) || (face >= list.first && face - list.first < list.new_count);
        found += listed;
        if (!listed)
            unlisted(tally, leaf, face, "the face touches the leaf, which does not list it");
    }
    for (uint32_t i = 1; i < list.ref_count; i++)
        if (list.refs[i] <= list.refs[i - 1])
            unlisted(tally, leaf, list.refs[i], "the list names the face twice or not in order");
    if (list.ref_count && list.refs[list.ref_count - 1] >= list.first)
        unlisted(tally, leaf, list.refs[list.ref_count - 1], "the list refers to a face that is not below its first new face");
    tally->checks[EBPO_VERIFY_LISTS] += count + list.ref_count + list.new_count;
    tally->spare_entries += (uint64_t)list.ref_count + list.new_count - found;
}

void ebpo_check_terminal_lists(ebpo_tally *tally, const ebpo_view *view, const ebpo_view_node *node,
                               const uint32_t *faces, uint64_t count)
{
    if (node->type == EBPO_LEAF) {
        check_leaf(tally, view, node, faces, count);
        return;
    }
    tally->checks[EBPO_VERIFY_LISTS] += count ? count : 1;
    for (uint64_t i = 0; i < count; i++)
        unlisted(tally, node, faces[i], node->type == EBPO_WHITE ? "the face touches a white cell" : "the face touches a black cell");
}

/* Different faces met so far, up to a limit that is small where this is used. */
typedef struct face_set {
    uint64_t limit, count;
    uint32_t *faces; /* [limit + 1] */
} face_set;

static void add_face(face_set *set, uint32_t face)
{
    for (uint64_t i = 0; i < set->count; i++)
        if (set->faces[i] == face)
            return;
    set->faces[set->count++] = face;
}

static void gather(face_set *set, const ebpo_view *view, const ebpo_view_node *node)
{
    if (node->type == EBPO_LEAF) {
        face_list list = list_of(view, node);
        for (uint32_t i = 0; i < list.ref_count && set->count <= set->limit; i++)
            add_face(set, list.refs[i]);
        for (uint32_t i = 0; i < list.new_count && set->count <= set->limit; i++)
            add_face(set, (uint32_t)(list.first + i));
    }
    for (unsigned octant = 0; node->type == EBPO_GRAY && octant < 8 && set->count <= set->limit; octant++) {
        ebpo_view_node child = ebpo_view_child(view, node, octant);
        gather(set, view, &child);
    }
}

bool ebpo_lists_more_faces(const ebpo_view *view, const ebpo_view_node *node, uint64_t limit)
{
    /* A set as large as the mesh cannot be exceeded; and memory that is short proves nothing against the file. */
    if (limit >= view->tree->mesh.face_count)
        return false;
    face_set set = {limit, 0, malloc((limit + 1) * sizeof *set.faces)};
    if (!set.faces)
        return true;
    gather(&set, view, node);
    free(set.faces);
    return set.count > limit;
}
