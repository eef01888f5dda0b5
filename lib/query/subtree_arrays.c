/* From a slice, which has an array for each type of node, to arrays with a row for each node. */
#include "core/strict_fp.h"

#include <stdlib.h>
#include <string.h>

#include "core/alloc.h"
#include "core/error.h"
#include "core/sized.h"
#include "geometry/node_types.h"
#include "geometry/octcode.h"
#include "query/subtree_parts.h"

/* --- room --- */

/* The group of a pruned node, which stands in subsets for eight nodes that are not there. */
static bool is_pruned_group(const ebpo_slice *slice, int level, uint64_t group)
{
    return level && slice->pruned && slice->level[level].types[group] == 0;
}

static ebpo_status too_many(const char *what, ebpo_error *error)
{
    return ebpo_fail(error, EBPO_E_LIMIT,
                     "the subtree has more than 2^32 - 2 %s; open the subtrees below it", what);
}

/* Nodes by level; planes in all. */
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

static ebpo_status make_room(ebpo_subtree *s, uint64_t planes, ebpo_error *error)
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
    bool fine = s->octcodes && s->types && s->children && (s->windings || !s->solid) &&
                ((s->plane_first && s->planes) || !s->has_planes);
    return fine ? EBPO_OK : ebpo_fail_memory(error, bytes);
}

/* --- one level --- */

/* Running counts through a level's arrays. */
typedef struct place {
    uint64_t rank[4], plane, leaf_plane;
} place;

static int32_t winding_of(const ebpo_level *level, ebpo_node_type type, uint64_t rank)
{
    switch (type) {
    case EBPO_WHITE: return level->white_winding ? level->white_winding[rank] : 0;
    case EBPO_BLACK: return level->black_winding ? level->black_winding[rank] : 1;
    case EBPO_LEAF: return level->leaf_winding ? level->leaf_winding[rank] : 0;
    default: return 0;
    }
}

static void take_planes(ebpo_subtree *s, const ebpo_level *level, ebpo_node_type type, place *at,
                        uint64_t node)
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

static void take_node(ebpo_subtree *s, const ebpo_level *level, ebpo_node_type type,
                      uint64_t octcode, place *at, uint64_t node)
{
    s->octcodes[node] = octcode;
    s->types[node] = (uint8_t)type;
    s->children[node] = EBPO_NO_CHILDREN;
    if (s->windings)
        s->windings[node] = winding_of(level, type, at->rank[type]);
    if (s->has_planes)
        take_planes(s, level, type, at, node);
    at->rank[type]++;
}

/* The nodes of a level below the root: the children of the gray nodes of the level before, which
 * are linked to them. */
static void take_level(ebpo_subtree *s, const ebpo_slice *slice, int i)
{
    const ebpo_level *level = &slice->level[i];
    place at = { .plane = 0 };
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
            take_node(s, level, ebpo_group_type(level->types[group - 1], octant),
                      ebpo_octcode_child(s->octcodes[parent], octant), &at, node++);
    }
}

ebpo_status ebpo_subtree_take_nodes(ebpo_subtree *s, const ebpo_slice *slice, ebpo_error *error)
{
    uint64_t planes;
    place at = { .plane = 0 };
    ebpo_status status = count_nodes(s, slice, &planes, error);
    if (status == EBPO_OK)
        status = make_room(s, planes, error);
    if (status != EBPO_OK)
        return status;
    if (s->has_planes)
        s->plane_first[0] = 0;
    take_node(s, &slice->level[0], slice->root.type, ebpo_octcode_of_cell(slice->root.cell), &at,
              0);
    for (int i = 1; i < slice->level_count; i++)
        take_level(s, slice, i);
    return EBPO_OK;
}

/* --- faces --- */

/* A leaf's list: what it refers to, then its new ones, which have higher numbers. */
static void take_list(ebpo_subtree *s, const ebpo_level *level, uint64_t leaf, uint64_t *ref,
                      uint64_t *next)
{
    for (uint32_t k = 0; k < level->leaf_ref_count[leaf]; k++)
        s->list[(*next)++] = level->leaf_refs[(*ref)++];
    for (uint32_t k = 0; k < level->leaf_new[leaf]; k++)
        s->list[(*next)++] = (uint32_t)level->leaf_first[leaf] + k;
}

static ebpo_status take_lists(ebpo_subtree *s, const ebpo_slice *slice, ebpo_error *error)
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
                take_list(s, &slice->level[i], leaf++, &ref, &next);
        }
    }
    s->list_first[s->node_count] = (uint32_t)next;
    return EBPO_OK;
}

static ebpo_status take_numbers(ebpo_subtree *s, const ebpo_slice *slice, ebpo_error *error)
{
    uint64_t count = s->mesh.face_count;
    s->numbers = ebpo_alloc(count, sizeof *s->numbers);
    s->memory += count * sizeof *s->numbers * (s->source ? 2 : 1);
    if (!s->numbers)
        return ebpo_fail_memory(error, count * sizeof *s->numbers);
    for (uint32_t i = 0; i < count; i++)
        s->numbers[i] = (uint32_t)ebpo_slice_file_face(slice, i);
    return EBPO_OK;
}

static ebpo_status take_corners(ebpo_subtree *s, ebpo_error *error)
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

ebpo_status ebpo_subtree_take_faces(ebpo_subtree *s, ebpo_slice *slice,
                                    const ebpo_subtree_options *options, ebpo_error *error)
{
    s->mesh = slice->mesh;
    memset(&slice->mesh, 0, sizeof slice->mesh);
    s->outer_count = slice->outer_count;
    s->source = slice->face_source;
    slice->face_source = NULL;
    s->memory += s->mesh.face_count * 3 * sizeof(uint32_t) +
                 s->mesh.vertex_count * 3 * (s->mesh.xyz32 ? sizeof(float) : sizeof(double));
    ebpo_status status = take_lists(s, slice, error);
    if (status == EBPO_OK)
        status = take_numbers(s, slice, error);
    return status == EBPO_OK && options->corners ? take_corners(s, error) : status;
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
    faces.outer_count = s->outer_count;
    faces.vertex_count = s->mesh.vertex_count;
    faces.xyz32 = s->mesh.xyz32;
    faces.xyz64 = s->mesh.xyz64;
    faces.faces = s->mesh.faces;
    faces.corners32 = s->corners32;
    faces.corners64 = s->corners64;
    faces.numbers = s->numbers;
    faces.source = s->source;
    faces.list_first = s->list_first;
    faces.list = s->list;
    return EBPO_GIVE(ebpo_subtree_faces, out, &faces);
}
