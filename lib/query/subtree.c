/* Reads a subtree as plain arrays, for ebpo/subtree.h.
 *
 * A node is found by its octcode (locational code). If an upper bound of the memory, computed from
 * counts, is within the caller's limit, the subtree at and below the node is read as a slice
 * (format/slice.h). A slice has separate arrays for each type of node. From a slice, this file
 * makes arrays with a row for each node, arrays of faces, and the leaves' lists of faces. A single
 * node can then be described in the model's coordinates: its planes, the half-spaces that it
 * inherits from all nodes above it, and the polygons of its envelope. */
#include "core/strict_fp.h"

#include <inttypes.h>
#include <stdlib.h>
#include <string.h>

#include <ebpo/subtree.h>

#include "core/alloc.h"
#include "core/error.h"
#include "core/fp_env.h"
#include "format/file_nodes.h"
#include "format/slice.h"
#include "geometry/cells.h"
#include "geometry/cursor.h"
#include "geometry/polytope.h"
#include "geometry/level_nodes.h"
#include "levels/stream.h"
#include "levels/lod.h"

typedef struct subtree_scratch subtree_scratch; /* memory for describing a node */

struct ebpo_subtree {
    ebpo_box box; /* the model's root cell */
    bool solid;
    bool border_inside; /* as in ebpo_info */
    ebpo_rule rule;
    ebpo_node root; /* root of the subtree */
    /* The arrays have the same names as in ebpo_subtree_nodes and ebpo_subtree_faces. */
    int level_count;
    uint64_t level_first[EBPO_LEVELS_MAX + 1];
    uint64_t node_count;
    uint64_t *octcodes;
    uint8_t *types;
    int32_t *windings;
    uint32_t *children;
    bool has_planes;       /* planes were read: the next three arrays exist */
    bool has_leaf_planes;  /* leaves have stored planes */
    uint32_t *plane_first; /* [node_count + 1] */
    uint32_t *planes;
    uint32_t above_first[EBPO_LEVELS_MAX + 1]; /* as in ebpo_subtree_nodes */
    uint32_t *above_planes;
    const char *no_faces; /* reason why no faces were read; NULL: faces were read */
    uint32_t shared_count;
    ebpo_mesh mesh;
    float *corners32;
    double *corners64;
    uint32_t *file_faces, *source, *list_first, *list;
    uint64_t memory;          /* bytes of the subtree */
    subtree_scratch *scratch; /* NULL until the first node is described */
};

/* --- capacity --- */

/* Returns true if the group belongs to a pruned node. In subsets, such a group replaces eight nodes
 * that are not in the file. */
static bool is_pruned_group(const ebpo_slice *slice, int level, uint64_t group)
{
    return level && slice->pruned && slice->level[level].types[group] == 0;
}

static ebpo_status too_many(const char *what, ebpo_error *error)
{
    return ebpo_fail(error, EBPO_E_LIMIT,
                     "the subtree has more than 2^32 - 2 %s; open the subtrees below it", what);
}

/* Counts the nodes of each level, and all planes. */
static ebpo_status count_nodes(ebpo_subtree *s, const ebpo_slice *slice, uint64_t *planes,
                               ebpo_error *error)
{
    *planes = 0;
    s->level_count = slice->level_count;
    for (int i = 0; i < slice->level_count; i++) {
        const ebpo_level *level = &slice->level[i];
        uint64_t groups = level->group_count;
        for (uint64_t g = 0; slice->pruned && g < level->group_count; g++)
            groups -= is_pruned_group(slice, i, g);
        if (groups > UINT32_MAX / 8)
            return too_many("nodes", error);
        s->level_first[i] = s->node_count;
        s->node_count += groups * ebpo_group_octants(i);
        *planes += level->plane_count + level->leaf_plane_count;
    }
    s->level_first[s->level_count] = s->node_count;
    return s->node_count >= UINT32_MAX ? too_many("nodes", error)
           : *planes >= UINT32_MAX     ? too_many("planes", error)
                                       : EBPO_OK;
}

static ebpo_status reserve_space(ebpo_subtree *s, uint64_t planes, ebpo_error *error)
{
    uint64_t nodes = s->node_count, bytes;
    s->octcodes = ebpo_alloc(nodes, sizeof *s->octcodes);
    s->types = ebpo_alloc(nodes, sizeof *s->types);
    s->children = ebpo_alloc(nodes, sizeof *s->children);
    bytes = nodes * (sizeof *s->octcodes + sizeof *s->types + sizeof *s->children);
    if (s->solid)
        s->windings = ebpo_alloc_zero(nodes, sizeof *s->windings);
    if (s->has_planes) {
        s->plane_first = ebpo_alloc(nodes + 1, sizeof *s->plane_first);
        s->planes = ebpo_alloc(planes, sizeof *s->planes);
    }
    bytes += (s->solid ? nodes * sizeof *s->windings : 0) +
             (s->has_planes ? (nodes + 1 + planes) * sizeof *s->planes : 0);
    s->memory += sizeof *s + bytes + s->above_first[s->root.cell.level] * sizeof *s->planes;
    bool allocated = s->octcodes && s->types && s->children && (s->windings || !s->solid) &&
                     ((s->plane_first && s->planes) || !s->has_planes);
    return allocated ? EBPO_OK : ebpo_fail_memory(error, bytes);
}

/* --- one level --- */

/* How many items of a level were copied: nodes of each type, planes, and leaf planes. */
typedef struct level_position {
    uint64_t rank[4], plane, leaf_plane;
} level_position;

/* Returns the stored winding number of a node. If the file stores no winding numbers, the result is
 * 1 for black nodes and 0 for other nodes. */
static int32_t winding_of(const ebpo_level *level, ebpo_node_type type, uint64_t rank)
{
    switch (type) {
    case EBPO_WHITE: return level->white_winding ? level->white_winding[rank] : 0;
    case EBPO_BLACK: return level->black_winding ? level->black_winding[rank] : 1;
    case EBPO_LEAF: return level->leaf_winding ? level->leaf_winding[rank] : 0;
    default: return 0;
    }
}

/* Copies the planes of the next node of this type. `node`: the node's index in the subtree. */
static void copy_planes(ebpo_subtree *s, const ebpo_level *level, ebpo_node_type type,
                        level_position *at, uint64_t node)
{
    uint32_t next = s->plane_first[node], count = 0;
    uint64_t rank = at->rank[type];
    if (type == EBPO_GRAY && level->plane_counts) {
        count = level->plane_counts[rank];
        if (count)
            memcpy(s->planes + next, level->planes + at->plane, count * sizeof *s->planes);
        at->plane += count;
    } else if (type == EBPO_LEAF && level->leaf_plane_counts) {
        count = level->leaf_plane_counts[rank];
        if (count)
            memcpy(s->planes + next, level->leaf_planes + at->leaf_plane,
                   count * sizeof *s->planes);
        at->leaf_plane += count;
    }
    s->plane_first[node + 1] = next + count;
}

/* Copies the next node of this type as node number `node` of the subtree, without its children. */
static void add_node(ebpo_subtree *s, const ebpo_level *level, ebpo_node_type type,
                     uint64_t octcode, level_position *at, uint64_t node)
{
    s->octcodes[node] = octcode;
    s->types[node] = (uint8_t)type;
    s->children[node] = EBPO_NO_CHILDREN;
    if (s->windings)
        s->windings[node] = winding_of(level, type, at->rank[type]);
    if (s->has_planes)
        copy_planes(s, level, type, at, node);
    at->rank[type]++;
}

/* Copies the nodes of a level below the root: the children of the previous level's gray nodes.
 * Links these nodes to their parents. */
static void copy_level(ebpo_subtree *s, const ebpo_slice *slice, int i)
{
    const ebpo_level *level = &slice->level[i];
    level_position at = { .plane = 0 };
    uint64_t node = s->level_first[i], group = 0;
    for (uint64_t parent = s->level_first[i - 1]; parent < s->level_first[i]; parent++) {
        if (s->types[parent] != EBPO_GRAY)
            continue;
        if (is_pruned_group(slice, i, group++)) {
            at.rank[EBPO_WHITE] += 8;
            continue;
        }
        s->children[parent] = (uint32_t)node;
        for (unsigned octant = 0; octant < 8; octant++)
            add_node(s, level, ebpo_group_type(level->types[group - 1], octant),
                     ebpo_octcode_child(s->octcodes[parent], octant), &at, node++);
    }
}

/* Copies nodes, winding numbers and planes from the slice. */
static ebpo_status copy_nodes(ebpo_subtree *s, const ebpo_slice *slice, ebpo_error *error)
{
    uint64_t planes;
    level_position at = { .plane = 0 };
    ebpo_status status = count_nodes(s, slice, &planes, error);
    if (status == EBPO_OK)
        status = reserve_space(s, planes, error);
    if (status != EBPO_OK)
        return status;
    if (s->has_planes)
        s->plane_first[0] = 0;
    add_node(s, &slice->level[0], slice->root.type, ebpo_octcode_of_cell(slice->root.cell), &at, 0);
    for (int i = 1; i < slice->level_count; i++)
        copy_level(s, slice, i);
    return EBPO_OK;
}

/* --- faces --- */

/* Copies a leaf's list: first its references (faces that an earlier leaf lists, too), then its new
 * faces, which have greater indices. *ref: position in the level's references; *next: position in
 * s->list. */
static void copy_list(ebpo_subtree *s, const ebpo_level *level, uint64_t leaf, uint64_t *ref,
                      uint64_t *next)
{
    for (uint32_t k = 0; k < level->leaf_ref_count[leaf]; k++)
        s->list[(*next)++] = level->leaf_refs[(*ref)++];
    for (uint32_t k = 0; k < level->leaf_new[leaf]; k++)
        s->list[(*next)++] = (uint32_t)level->leaf_first[leaf] + k;
}

static ebpo_status copy_lists(ebpo_subtree *s, const ebpo_slice *slice, ebpo_error *error)
{
    uint64_t listed = 0, next = 0;
    for (int i = 0; i < slice->level_count; i++)
        listed += slice->level[i].ref_count + slice->level[i].new_count;
    if (listed >= UINT32_MAX)
        return too_many("listed faces", error);
    uint64_t bytes = (s->node_count + 1 + listed) * sizeof *s->list;
    s->list_first = ebpo_alloc(s->node_count + 1, sizeof *s->list_first);
    s->list = ebpo_alloc(listed, sizeof *s->list);
    s->memory += bytes;
    if (!s->list_first || !s->list)
        return ebpo_fail_memory(error, bytes);
    for (int i = 0; i < slice->level_count; i++) {
        uint64_t leaf = 0, ref = 0;
        for (uint64_t node = s->level_first[i]; node < s->level_first[i + 1]; node++) {
            s->list_first[node] = (uint32_t)next;
            if (s->types[node] == EBPO_LEAF)
                copy_list(s, &slice->level[i], leaf++, &ref, &next);
        }
    }
    s->list_first[s->node_count] = (uint32_t)next;
    return EBPO_OK;
}

/* Makes the file indices of the faces. */
static ebpo_status copy_indices(ebpo_subtree *s, const ebpo_slice *slice, ebpo_error *error)
{
    uint64_t count = s->mesh.face_count;
    s->file_faces = ebpo_alloc(count, sizeof *s->file_faces);
    s->memory += count * sizeof *s->file_faces * (s->source ? 2 : 1);
    if (!s->file_faces)
        return ebpo_fail_memory(error, count * sizeof *s->file_faces);
    for (uint32_t i = 0; i < count; i++)
        s->file_faces[i] = (uint32_t)ebpo_slice_file_face(slice, i);
    return EBPO_OK;
}

/* Makes the array of corners: the coordinates of each face. */
static ebpo_status gather_corners(ebpo_subtree *s, ebpo_error *error)
{
    const ebpo_mesh *mesh = &s->mesh;
    size_t row = 3 * (mesh->xyz32 ? sizeof(float) : sizeof(double));
    const uint8_t *from = mesh->xyz32 ? (const void *)mesh->xyz32 : (const void *)mesh->xyz64;
    uint8_t *to = ebpo_alloc(mesh->face_count, 3 * row);
    s->memory += mesh->face_count * 3 * row;
    if (!to)
        return ebpo_fail_memory(error, mesh->face_count * 3 * row);
    s->corners32 = mesh->xyz32 ? (void *)to : NULL;
    s->corners64 = mesh->xyz32 ? NULL : (void *)to;
    for (uint64_t i = 0; i < 3 * mesh->face_count; i++)
        memcpy(to + i * row, from + mesh->faces[i] * row, row);
    return EBPO_OK;
}

/* Takes the faces from the slice, and copies the lists of leaves. */
static ebpo_status copy_faces(ebpo_subtree *s, ebpo_slice *slice,
                              const ebpo_subtree_options *options, ebpo_error *error)
{
    s->mesh = slice->mesh;
    memset(&slice->mesh, 0, sizeof slice->mesh);
    s->shared_count = slice->shared_count;
    s->source = slice->face_source;
    slice->face_source = NULL;
    s->memory += s->mesh.face_count * 3 * sizeof(uint32_t) +
                 s->mesh.vertex_count * 3 * (s->mesh.xyz32 ? sizeof(float) : sizeof(double));
    ebpo_status status = copy_lists(s, slice, error);
    if (status == EBPO_OK)
        status = copy_indices(s, slice, error);
    return status == EBPO_OK && options->corners ? gather_corners(s, error) : status;
}

/* --- for callers --- */

ebpo_status ebpo_subtree_get_nodes(const ebpo_subtree *s, ebpo_subtree_nodes *out)
{
    ebpo_subtree_nodes nodes = EBPO_SUBTREE_NODES_INIT;
    nodes.level = s->root.cell.level;
    nodes.level_count = s->level_count;
    nodes.node_count = s->node_count;
    nodes.level_first = s->level_first;
    nodes.octcodes = s->octcodes;
    nodes.types = s->types;
    nodes.windings = s->windings;
    nodes.children = s->children;
    nodes.plane_first = s->plane_first;
    nodes.planes = s->planes;
    nodes.above_first = s->has_planes ? s->above_first : NULL;
    nodes.above_planes = s->above_planes;
    nodes.memory = s->memory;
    return EBPO_GIVE(ebpo_subtree_nodes, out, &nodes);
}

ebpo_status ebpo_subtree_get_faces(const ebpo_subtree *s, ebpo_subtree_faces *out,
                                   ebpo_error *error)
{
    ebpo_subtree_faces faces = EBPO_SUBTREE_FACES_INIT;
    ebpo_status status = EBPO_CHECK_SIZED(ebpo_subtree_faces, out, error);
    if (status != EBPO_OK)
        return status;
    if (s->no_faces)
        return ebpo_fail(error, EBPO_E_ABSENT, "%s", s->no_faces);
    faces.face_count = s->mesh.face_count;
    faces.shared_count = s->shared_count;
    faces.vertex_count = s->mesh.vertex_count;
    faces.xyz32 = s->mesh.xyz32;
    faces.xyz64 = s->mesh.xyz64;
    faces.faces = s->mesh.faces;
    faces.corners32 = s->corners32;
    faces.corners64 = s->corners64;
    faces.file_faces = s->file_faces;
    faces.source = s->source;
    faces.list_first = s->list_first;
    faces.list = s->list;
    return EBPO_GIVE(ebpo_subtree_faces, out, &faces);
}

/* --- a node in the model's coordinates --- */

struct subtree_scratch {
    ebpo_envelope_stack envelopes;
    ebpo_polytope leaf; /* envelope of a leaf, cut by derived planes */
    ebpo_node_buffers
        buffers; /* arrays of the described node, to which the caller's result refers */
    double inherited[EBPO_HALF_SPACES_MAX][4];
    ebpo_triangle *faces; /* faces of the leaf that is described */
    uint64_t face_capacity;
};

static void subtree_free_scratch(subtree_scratch *scratch)
{
    if (scratch)
        free(scratch->faces);
    free(scratch);
}

/* --- the path from the tree's root to a node --- */

/* Returns the planes of the node at this level on the path from the tree's root to `octcode`. If
 * the node is in the subtree, *node must be its index, and becomes the index of the path's next
 * node. */
static const uint32_t *planes_on_path(const ebpo_subtree *s, uint64_t octcode, int level,
                                      uint64_t *node, uint32_t *count)
{
    int last = ebpo_octcode_level(octcode), root = s->root.cell.level;
    *count = 0;
    if (level < root && s->has_planes) {
        *count = s->above_first[level + 1] - s->above_first[level];
        return s->above_planes + s->above_first[level];
    }
    if (level < root)
        return NULL;
    uint64_t at = *node;
    if (level < last)
        *node = s->children[at] + (octcode >> 3 * (last - level - 1) & 7);
    if (!s->has_planes)
        return NULL;
    *count = s->plane_first[at + 1] - s->plane_first[at];
    return s->planes + s->plane_first[at];
}

/* Sets out->inherited: the half-spaces of all nodes above the node, in the model's coordinates. */
static void add_inherited(ebpo_subtree *s, uint64_t octcode, ebpo_subtree_node *out)
{
    ebpo_cell cell = ebpo_cell_of_octcode(octcode);
    uint64_t node = 0;
    for (int level = 0; level < cell.level; level++) {
        uint32_t count;
        const uint32_t *codes = planes_on_path(s, octcode, level, &node, &count);
        for (uint32_t i = 0; i < count; i++) {
            int32_t n[3], d;
            if (ebpo_plane_code_decode(codes[i], n, &d))
                ebpo_plane_to_world(&s->box, ebpo_cell_ancestor(cell, level), n, d,
                                    s->scratch->inherited[out->inherited_count++]);
        }
    }
    out->inherited = (const double(*)[4])s->scratch->inherited;
}

/* Returns the node's envelope, cut only by planes that the file stores. (derive_planes cuts by
 * planes that are derived from a leaf's faces.) */
static const ebpo_polytope *stored_envelope(ebpo_subtree *s, uint64_t octcode, ebpo_node_type type)
{
    ebpo_envelope_stack *stack = &s->scratch->envelopes;
    const ebpo_polytope *envelope = NULL;
    int last = ebpo_octcode_level(octcode);
    uint64_t node = 0;
    if (type == EBPO_BLACK)
        return ebpo_envelope_put_cube(stack, octcode);
    for (int level = 0; level <= last; level++) {
        ebpo_octcode ancestor = octcode >> 3 * (last - level);
        uint32_t count;
        const uint32_t *codes = planes_on_path(s, octcode, level, &node, &count);
        envelope = ebpo_envelope_held(stack, ancestor);
        if (!envelope)
            envelope = ebpo_envelope_put(stack, ancestor, codes, count);
    }
    return envelope;
}

/* --- leaves --- */

/* Gathers the faces of a leaf in the scratch memory. */
static ebpo_status gather_faces(ebpo_subtree *s, uint64_t leaf, uint64_t *count, ebpo_error *error)
{
    subtree_scratch *scratch = s->scratch;
    uint32_t first = s->list_first[leaf];
    *count = s->list_first[leaf + 1] - first;
    if (!ebpo_grow(&scratch->faces, &scratch->face_capacity, *count, sizeof *scratch->faces))
        return ebpo_fail_memory(error, *count * sizeof *scratch->faces);
    for (uint64_t i = 0; i < 3 * *count; i++) {
        uint64_t vertex = s->mesh.faces[3 * (uint64_t)s->list[first + i / 3] + i % 3];
        for (uint64_t k = 0; k < 3; k++)
            scratch->faces[i / 3].corner[i % 3][k] = s->mesh.xyz32
                                                         ? (double)s->mesh.xyz32[3 * vertex + k]
                                                         : s->mesh.xyz64[3 * vertex + k];
    }
    return EBPO_OK;
}

/* Cuts a leaf's envelope in the scratch memory by planes that are derived from the leaf's faces. */
static ebpo_status derive_planes(ebpo_subtree *s, uint64_t leaf, uint32_t codes[EBPO_PLANES_MAX],
                                 unsigned *code_count, ebpo_error *error)
{
    ebpo_cell cell = ebpo_cell_of_octcode(s->octcodes[leaf]);
    uint64_t count;
    ebpo_status status = gather_faces(s, leaf, &count, error);
    if (status != EBPO_OK)
        return status;
    const ebpo_triangle *faces = s->scratch->faces;
    unsigned inside = s->windings ? ebpo_lod_inside_corners(&s->box, cell, s->rule,
                                                            s->windings[leaf], faces, count)
                                  : 0;
    *code_count = (unsigned)ebpo_leaf_planes(&s->box, cell, faces, count, inside, 0,
                                             &s->scratch->leaf, codes);
    return EBPO_OK;
}

/* --- description of a node --- */

/* Describes node `number`; with `polygons`, also the polygons of its envelope. */
static ebpo_status describe_node(ebpo_subtree *s, uint64_t number, bool polygons,
                                 ebpo_subtree_node *out, ebpo_error *error)
{
    uint64_t octcode = s->octcodes[number];
    ebpo_node_type type = (ebpo_node_type)s->types[number];
    uint32_t derived[EBPO_PLANES_MAX], *codes = s->planes;
    unsigned count = 0;
    /* derives: the leaf's planes are derived from its faces, because the file does not store them;
     * the inside of a surface with holes may extend beyond such planes */
    bool derives = type == EBPO_LEAF && !s->has_leaf_planes && !s->no_faces && !s->border_inside;
    ebpo_node_begin(&out->node, &s->box, octcode, type);
    out->node.winding = s->windings ? s->windings[number] : 0;
    add_inherited(s, octcode, out);
    const ebpo_polytope *envelope =
        (polygons && type != EBPO_WHITE) || derives ? stored_envelope(s, octcode, type) : NULL;
    if (s->has_planes) {
        codes += s->plane_first[number];
        count = s->plane_first[number + 1] - s->plane_first[number];
    }
    if (derives) {
        ebpo_polytope_copy(&s->scratch->leaf, envelope);
        ebpo_status status = derive_planes(s, number, codes = derived, &count, error);
        if (status != EBPO_OK)
            return status;
        envelope = &s->scratch->leaf;
    }
    ebpo_node_add_planes(&out->node, &s->box, codes, count, &s->scratch->buffers);
    if (polygons && envelope)
        ebpo_node_add_polygons(&out->node, &s->box, envelope, &s->scratch->buffers);
    return EBPO_OK;
}

ebpo_status ebpo_subtree_get_node(ebpo_subtree *s, uint64_t number, bool polygons,
                                  ebpo_subtree_node *out, ebpo_error *error)
{
    EBPO_DEFAULT_FP;
    ebpo_subtree_node node = EBPO_SUBTREE_NODE_INIT;
    ebpo_status status = EBPO_CHECK_SIZED(ebpo_subtree_node, out, error);
    if (status != EBPO_OK)
        return status;
    if (number >= s->node_count)
        return ebpo_fail(error, EBPO_E_ARGUMENT,
                         "there is no node %" PRIu64 "; the subtree has %" PRIu64
                         " nodes, counted from 0",
                         number, s->node_count);
    if (!s->scratch && !(s->scratch = ebpo_alloc_zero(1, sizeof *s->scratch)))
        return ebpo_fail_memory(error, sizeof *s->scratch);
    status = describe_node(s, number, polygons, &node, error);
    return status == EBPO_OK ? EBPO_GIVE(ebpo_subtree_node, out, &node) : status;
}

/* --- the node of an octcode --- */

/* Returns the error for an octcode at or below a white or black node, which is the cursor's node.
 */
static ebpo_status fail_uniform(const ebpo_chunks *chunks, uint64_t octcode, ebpo_cursor *c,
                                ebpo_error *error)
{
    const char *shown = chunks->file->in.shown,
               *type = ebpo_cursor_node(c)->type == EBPO_BLACK ? "black" : "white";
    ebpo_octcode found = ebpo_cursor_octcode(c);
    if (found == octcode)
        return ebpo_fail_file(error, EBPO_E_ARGUMENT, shown,
                              "node %" PRIu64 " is %s: no face touches it, so nothing is below "
                              "it; give a gray node or a leaf",
                              octcode, type);
    return ebpo_fail_file(error, EBPO_E_ARGUMENT, shown,
                          "there is no node %" PRIu64 ": it would be in node %" PRIu64
                          ", which is %s, and no face touches it",
                          octcode, found, type);
}

/* Returns an error if the cursor's node cannot be opened. */
static ebpo_status check_found(const ebpo_chunks *chunks, uint64_t octcode, bool or_leaf_above,
                               ebpo_cursor *c, ebpo_error *error)
{
    const ebpo_node *child = NULL, *node = ebpo_cursor_node(c);
    ebpo_octcode found = ebpo_cursor_octcode(c);
    /* A request for the node's children shows if the node is pruned. */
    ebpo_status status = ebpo_cursor_children(c, &child, error);
    if (status != EBPO_OK)
        return status;
    if (ebpo_node_is_uniform(node))
        return fail_uniform(chunks, octcode, c, error);
    if (node->pruned)
        return ebpo_fail_file(error, EBPO_E_ABSENT, chunks->file->in.shown,
                              "the part below node %" PRIu64
                              " is omitted from this file, which is a subset; open the original "
                              "file",
                              found);
    if (found == octcode || or_leaf_above)
        return EBPO_OK;
    return ebpo_fail_file(error, EBPO_E_ARGUMENT, chunks->file->in.shown,
                          "there is no node %" PRIu64 ": the tree ends above it, with leaf %" PRIu64
                          "; open this leaf (the option or_leaf_above does this)",
                          octcode, found);
}

/* Moves the cursor to the node with an octcode or, with or_leaf_above, to the leaf that contains
 * the octcode's cell. */
static ebpo_status find_node(ebpo_chunks *chunks, uint64_t octcode, bool or_leaf_above,
                             ebpo_cursor *c, ebpo_error *error)
{
    ebpo_node root;
    if (!ebpo_octcode_valid(octcode))
        return ebpo_fail(error, EBPO_E_ARGUMENT,
                         "%" PRIu64 " is not an octcode, which is a leading 1 and three bits for "
                         "each of at most %d levels; the root is 1",
                         octcode, EBPO_LEVELS_MAX - 1);
    ebpo_status status = ebpo_chunks_root(chunks, &root, error);
    if (status != EBPO_OK)
        return status;
    ebpo_cursor_begin(c, &ebpo_chunks_source, chunks, root);
    status = ebpo_cursor_to_cell(c, ebpo_cell_of_octcode(octcode), error);
    return status == EBPO_OK ? check_found(chunks, octcode, or_leaf_above, c, error) : status;
}

/* Reads the planes of the nodes above the subtree's root. */
static ebpo_status read_planes_above(ebpo_subtree *s, ebpo_cursor *c, ebpo_error *error)
{
    uint32_t codes[EBPO_NODE_PLANES];
    uint64_t capacity = 0;
    s->has_planes = true;
    for (int depth = 0; depth < c->depth; depth++) {
        unsigned count = 0;
        uint32_t first = s->above_first[depth];
        ebpo_status status = c->source->planes(c->holder, &c->at[depth].node, codes, &count, error);
        if (status != EBPO_OK)
            return status;
        if (!ebpo_grow(&s->above_planes, &capacity, first + count + 1, sizeof *codes))
            return ebpo_fail_memory(error, (first + count) * sizeof *codes);
        memcpy(s->above_planes + first, codes, count * sizeof *codes);
        s->above_first[depth + 1] = first + count;
    }
    return EBPO_OK;
}

/* --- memory --- */

/* While the subtree is read, a quarter of the caller's memory is for decoded chunks, but at least
 * CHUNKS_LEAST and at most CHUNKS_MAX bytes. */
enum { CHUNKS_LEAST = 2 << 20, CHUNKS_MAX = 32 << 20 };

static uint64_t chunk_budget(uint64_t memory)
{
    return memory == 0 || memory / 4 > CHUNKS_MAX ? CHUNKS_MAX
           : memory / 4 < CHUNKS_LEAST            ? CHUNKS_LEAST
                                                  : memory / 4;
}

/* Returns the least memory that the caller must allow for `bytes` bytes and the decoded chunks. */
static uint64_t least_memory(uint64_t bytes)
{
    if (bytes <= 3 * (uint64_t)CHUNKS_LEAST)
        return bytes + CHUNKS_LEAST;
    return bytes <= 3 * (uint64_t)CHUNKS_MAX ? bytes + bytes / 3 + 4 : bytes + CHUNKS_MAX;
}

/* Returns an upper bound, from counts, of the bytes of a slice, of the arrays made from it, and of
 * temporary memory. */
static uint64_t bound_bytes(const ebpo_slice_size *size, const ebpo_info *info, bool whole,
                            bool corners)
{
    enum {
        /* bytes for each item */
        NODE = 32,       /* node: octcode, type, winding, children, planes, list; and its winding in
                          * the slice */
        GROUP = 4,       /* group of siblings: types, plane counts */
        LEAF = 24,       /* leaf: data of a level */
        PLANE = 8,       /* plane: in the slice and in the subtree */
        REFERENCE = 52,  /* reference: in the slice, in the list, and in the table that gives shared
                          * faces local indices */
        FACE = 24,       /* face: corners, index in the file, index in the source, list */
        OLDER = 36,      /* corner: the table that gives vertices of earlier faces local indices */
        ALWAYS = 1 << 20 /* bytes for all other memory */
    };
    uint64_t coordinate = info->double_coordinates ? sizeof(double) : sizeof(float),
             faces = size->new_faces + size->shared,
             vertices = 3 * faces < info->vertex_count ? 3 * faces : info->vertex_count;
    return ALWAYS + size->groups * (8 * NODE + GROUP) + size->leaves * LEAF + size->planes * PLANE +
           size->refs * REFERENCE + faces * (FACE + (corners ? 9 * coordinate : 0)) +
           (whole ? 0 : 3 * faces * OLDER) + vertices * 3 * coordinate;
}

/* Counts the references to faces before the first face that the subtree owns, which is an upper
 * bound of the number of shared faces. (Most references are to owned faces, so the number of all
 * references would be a much greater bound.) Reads the leaves' lists. */
static ebpo_status count_shared(const ebpo_subtree *s, ebpo_chunks *chunks, uint64_t *shared,
                                ebpo_error *error)
{
    ebpo_slice lists;
    uint64_t first = UINT64_MAX;
    *shared = 0;
    ebpo_status status =
        ebpo_slice_read_nodes(&lists, chunks, &s->root, EBPO_NEEDS_ALWAYS | EBPO_NEEDS_MESH,
                              EBPO_SLICE_ALL, error);
    if (status != EBPO_OK)
        return status;
    for (int i = 0; i < lists.level_count; i++) /* leaf_first is ascending within a level */
        if (lists.level[i].leaf_count && lists.level[i].leaf_first[0] < first)
            first = lists.level[i].leaf_first[0];
    for (int i = 0; i < lists.level_count; i++)
        for (uint64_t k = 0; k < lists.level[i].ref_count; k++)
            *shared += lists.level[i].leaf_refs[k] < first;
    ebpo_slice_free(&lists);
    return EBPO_OK;
}

/* Fails if the subtree may take more memory than the options allow. */
static ebpo_status check_memory(const ebpo_subtree *s, ebpo_chunks *chunks, uint32_t needs,
                                const ebpo_subtree_options *o, ebpo_error *error)
{
    ebpo_slice_size size;
    const ebpo_info *info = &chunks->file->info;
    bool whole = s->root.cell.level == 0, corners = o->corners && !s->no_faces;
    if (o->memory == 0)
        return EBPO_OK;
    ebpo_status status = ebpo_slice_measure_nodes(chunks, &s->root, needs, o->levels, &size, error);
    if (status != EBPO_OK)
        return status;
    ebpo_slice_size lists = size;
    lists.shared = lists.new_faces = 0;
    uint64_t least = least_memory(bound_bytes(&size, info, whole, corners));
    if (least > o->memory && size.shared &&
        least_memory(bound_bytes(&lists, info, whole, corners)) <= o->memory) {
        status = count_shared(s, chunks, &size.shared, error);
        least = least_memory(bound_bytes(&size, info, whole, corners));
    }
    if (status != EBPO_OK || least <= o->memory)
        return status;
    return ebpo_fail_file(error, EBPO_E_LIMIT, chunks->file->in.shown,
                          "the subtree of node %" PRIu64 " may take more than the %" PRIu64
                          " bytes allowed; give %" PRIu64 ", or open the subtrees below it",
                          ebpo_octcode_of_cell(s->root.cell), o->memory, least);
}

/* --- reading --- */

/* Returns the data of the file that must be read (EBPO_NEEDS_...); sets s->no_faces. */
static uint32_t choose_needs(ebpo_subtree *s, const ebpo_subtree_options *o, uint32_t parts)
{
    uint32_t most = EBPO_PART_PLANES | EBPO_PART_MESH | EBPO_PART_MAPS | EBPO_PART_LEAF_PLANES,
             has = parts & o->parts & most;
    s->no_faces = !(parts & EBPO_PART_MESH)
                      ? "the file was written without its mesh; build it again with the mesh"
                  : !(has & EBPO_PART_MESH)
                      ? "the subtree was opened without its faces; open it with EBPO_PART_MESH"
                  : o->levels >= 0 ? "the subtree was opened for some levels only, without "
                                     "faces; open all levels with levels = -1"
                                   : NULL;
    has &= s->no_faces ? ~(uint32_t)(EBPO_PART_MESH | EBPO_PART_MAPS) : ~0u;
    s->has_leaf_planes = has & EBPO_PART_LEAF_PLANES;
    return has | EBPO_NEEDS_ALWAYS | EBPO_NEEDS_SOLID;
}

static ebpo_status fill_arrays(ebpo_subtree *s, ebpo_chunks *chunks, ebpo_cursor *c,
                               const ebpo_subtree_options *o, ebpo_error *error)
{
    ebpo_slice slice;
    uint32_t needs = choose_needs(s, o, chunks->file->info.parts);
    ebpo_status status = check_memory(s, chunks, needs, o, error);
    if (status == EBPO_OK && needs & (EBPO_NEEDS_PLANES | EBPO_NEEDS_LEAF_PLANES))
        status = read_planes_above(s, c, error);
    if (status == EBPO_OK)
        status = s->no_faces
                     ? ebpo_slice_read_nodes(&slice, chunks, &s->root, needs, o->levels, error)
                     : ebpo_slice_read_parts(&slice, chunks, &s->root, needs, error);
    if (status != EBPO_OK)
        return status;
    status = copy_nodes(s, &slice, error);
    if (status == EBPO_OK && !s->no_faces)
        status = copy_faces(s, &slice, o, error);
    ebpo_slice_free(&slice);
    return status;
}

static ebpo_status open_below(ebpo_subtree *s, ebpo_chunks *chunks, uint64_t octcode,
                              const ebpo_subtree_options *o, ebpo_error *error)
{
    ebpo_cursor *c = ebpo_alloc(1, sizeof *c);
    if (!c)
        return ebpo_fail_memory(error, sizeof *c);
    ebpo_status status = find_node(chunks, octcode, o->or_leaf_above, c, error);
    if (status == EBPO_OK) {
        s->root = *ebpo_cursor_node(c);
        status = fill_arrays(s, chunks, c, o, error);
    }
    free(c);
    return status;
}

static ebpo_status check_options(const ebpo_subtree_options *o, ebpo_error *error)
{
    return o->levels < -1 ? ebpo_fail(error, EBPO_E_ARGUMENT,
                                      "subtree options: level number %d is invalid; give 0 or "
                                      "more, or -1 for all",
                                      o->levels)
                          : EBPO_OK;
}

ebpo_status ebpo_subtree_open(const ebpo_file *file, uint64_t octcode,
                              const ebpo_subtree_options *options, ebpo_subtree **out,
                              ebpo_error *error)
{
    EBPO_DEFAULT_FP;
    ebpo_subtree_options wanted = EBPO_SUBTREE_OPTIONS_INIT;
    ebpo_chunks *chunks = NULL;
    *out = NULL;
    ebpo_status status = EBPO_TAKE(ebpo_subtree_options, &wanted, options, error);
    if (status == EBPO_OK)
        status = check_options(&wanted, error);
    if (status != EBPO_OK)
        return status;
    ebpo_subtree *s = ebpo_alloc_zero(1, sizeof *s);
    if (!s)
        return ebpo_fail_memory(error, sizeof *s);
    const ebpo_info *info = ebpo_file_info(file);
    s->box = ebpo_root_box(info);
    s->solid = info->solid;
    s->border_inside = info->border_inside;
    s->rule = info->rule;
    status = ebpo_chunks_make(&chunks, file, chunk_budget(wanted.memory), error);
    if (status == EBPO_OK)
        status = open_below(s, chunks, octcode, &wanted, error);
    ebpo_chunks_free(chunks);
    if (status == EBPO_OK)
        *out = s;
    else
        ebpo_subtree_close(s);
    return status;
}

void ebpo_subtree_close(ebpo_subtree *s)
{
    if (!s)
        return;
    subtree_free_scratch(s->scratch);
    free(s->octcodes);
    free(s->types);
    free(s->windings);
    free(s->children);
    free(s->plane_first);
    free(s->planes);
    free(s->above_planes);
    ebpo_mesh_free(&s->mesh);
    free(s->corners32);
    free(s->corners64);
    free(s->file_faces);
    free(s->source);
    free(s->list_first);
    free(s->list);
    free(s);
}

uint64_t ebpo_octcode_at(const ebpo_info *info, const double point[3], int level)
{
    EBPO_DEFAULT_FP;
    ebpo_box box = ebpo_root_box(info);
    ebpo_cell cell = { level, { 0, 0, 0 } };
    if (level < 0 || level > box.grid_level || level >= EBPO_LEVELS_MAX ||
        !ebpo_locate(&box, level, point, cell.at))
        return 0;
    return ebpo_octcode_of_cell(cell);
}
