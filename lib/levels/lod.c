/* Computes the polygons of a level: the envelopes of its nodes, as triangles.
 *
 * The nodes are visited from the root down. Each node's envelope is cut from the parent's envelope
 * by the node's planes. A leaf's planes come from the file, or are derived from its faces
 * (construct/leaf_planes.c). If the file has neither planes of leaves nor a mesh, the leaf's
 * envelope is the intersection of the parent's envelope with the leaf's cell. First, one thread
 * visits the nodes down to the split level. Then all threads visit the independent subtrees below
 * this level. The visit of such a part of the tree is called a walk. The split level depends only
 * on the tree, and the results of the walks are joined in a fixed order (by level, then by octcode,
 * the locational code). So the number of threads does not change the result.
 *
 * Sections: polyhedra as triangles; the model, which a walk reads; leaves; colours of nodes; the
 * walk. */
#include "core/strict_fp.h"

#include <stdlib.h>
#include <string.h>

#include <ebpo/lod.h>

#include "core/alloc.h"
#include "core/error.h"
#include "core/fp_env.h"
#include "core/parallel.h"
#include "format/border_loops.h"
#include "format/pick_rows.h"
#include "format/schema.h"
#include "geometry/cap_cells.h"
#include "geometry/cells.h"
#include "geometry/level_nodes.h"
#include "geometry/polytope.h"
#include "levels/lod.h"

/* greatest number of vertices or faces of a mesh */
static const uint64_t count_limit = UINT32_MAX - 1;

/* --- polyhedra as triangles --- */

static void polyhedra_free(ebpo_polyhedra *piece)
{
    free(piece->xyz);
    free(piece->faces);
    piece->xyz = NULL;
    piece->faces = NULL;
    piece->vertex_count = piece->vertex_capacity = piece->face_count = piece->face_capacity = 0;
    free(piece->nodes);
    free(piece->corners);
    piece->nodes = NULL;
    piece->corners = NULL;
    piece->node_count = piece->node_capacity = piece->polygon_count = piece->polygon_capacity = 0;
}

/* Appends a polygon as a fan of triangles. `loop`: [corners] the polygon's vertices as indices in
 * the polytope. `new_index`: [vertex of the polytope] index in the piece. */
static void add_fan(ebpo_polyhedra *piece, const uint32_t *new_index, const uint16_t *loop,
                    int corners)
{
    for (int i = 1; i + 1 < corners; i++) {
        uint32_t *face = piece->faces + 3 * piece->face_count++;
        face[0] = new_index[loop[0]];
        face[1] = new_index[loop[i]];
        face[2] = new_index[loop[i + 1]];
    }
}

/* Appends a node, still without polygons, and reserves space for the polygons of its polytope. */
static bool begin_node(ebpo_polyhedra *piece, const ebpo_polytope *p, const ebpo_box *box,
                       ebpo_cell cell, ebpo_node_type type)
{
    if (!ebpo_grow(&piece->nodes, &piece->node_capacity, piece->node_count + 1,
                   sizeof *piece->nodes) ||
        !ebpo_grow(&piece->corners, &piece->polygon_capacity,
                   piece->polygon_count + (uint64_t)p->face_count, 1))
        return false;
    piece->nodes[piece->node_count++] =
        (ebpo_lod_node){ .octcode = ebpo_octcode_of_cell(cell),
                         .volume = ebpo_polytope_volume(p) * ebpo_cell_volume(box, cell.level),
                         .type = type };
    return true;
}

/* Records a polygon with this number of corners for the last node. */
static void end_polygon(ebpo_polyhedra *piece, unsigned corners)
{
    piece->corners[piece->polygon_count++] = (uint8_t)corners;
    piece->nodes[piece->node_count - 1].polygon_count++;
}

ebpo_status ebpo_polyhedra_add(ebpo_polyhedra *piece, const ebpo_polytope *p, const ebpo_box *box,
                               ebpo_cell cell, ebpo_node_type type, bool cell_faces,
                               ebpo_error *error)
{
    if (piece->vertex_count + EBPO_POLYTOPE_VERTICES > count_limit)
        return ebpo_fail(error, EBPO_E_LIMIT,
                         "the level has more than 4294967294 vertices; choose a coarser level");
    if (!ebpo_grow(&piece->xyz, &piece->vertex_capacity,
                   piece->vertex_count + (uint64_t)p->vertex_count, 3 * sizeof(double)) ||
        !ebpo_grow(&piece->faces, &piece->face_capacity,
                   piece->face_count + (uint64_t)p->corner_count, 3 * sizeof(uint32_t)) ||
        (piece->wants_nodes && !begin_node(piece, p, box, cell, type)))
        return ebpo_fail_memory(error,
                                (piece->vertex_count + piece->face_count) * 3 * sizeof(double));
    uint32_t new_index[EBPO_POLYTOPE_VERTICES];
    uint8_t sides[EBPO_POLYTOPE_VERTICES];
    ebpo_polytope_sides(p, sides);
    memset(new_index, 0xff, sizeof new_index);
    uint64_t first_vertex = piece->vertex_count;
    for (int f = 0; f < p->face_count; f++) {
        if (p->tag[f] < 0 && !cell_faces)
            continue;
        for (int i = p->first[f]; i < p->first[f + 1]; i++) {
            uint16_t v = p->corner[i];
            if (new_index[v] != UINT32_MAX)
                continue;
            for (int k = 0; k < 3; k++)
                piece->xyz[3 * piece->vertex_count + (uint64_t)k] =
                    ebpo_cell_face_point(box, cell, k, p->vertex[v][k], sides[v]);
            new_index[v] = (uint32_t)piece->vertex_count++;
        }
        add_fan(piece, new_index, p->corner + p->first[f], p->first[f + 1] - p->first[f]);
        if (piece->wants_nodes)
            end_polygon(piece, p->first[f + 1] - p->first[f]);
    }
    if (piece->wants_nodes)
        piece->nodes[piece->node_count - 1].vertex_count =
            (uint32_t)(piece->vertex_count - first_vertex);
    return EBPO_OK;
}

static void append_mesh(ebpo_mesh *out, const ebpo_polyhedra *piece)
{
    if (piece->vertex_count)
        memcpy(out->xyz64 + 3 * out->vertex_count, piece->xyz,
               piece->vertex_count * 3 * sizeof(double));
    uint32_t *faces = out->faces + 3 * out->face_count, base = (uint32_t)out->vertex_count;
    for (uint64_t i = 0; i < 3 * piece->face_count; i++)
        faces[i] = piece->faces[i] + base;
    out->vertex_count += piece->vertex_count;
    out->face_count += piece->face_count;
}

static void append_nodes(ebpo_lod_nodes *out, const ebpo_polyhedra *piece)
{
    if (piece->node_count)
        memcpy(out->nodes + out->node_count, piece->nodes, piece->node_count * sizeof *out->nodes);
    if (piece->polygon_count)
        memcpy(out->corners + out->polygon_count, piece->corners, piece->polygon_count);
    out->node_count += piece->node_count;
    out->polygon_count += piece->polygon_count;
}

static ebpo_status make_nodes(ebpo_lod_nodes *out, ebpo_polyhedra *const *pieces, uint64_t count,
                              ebpo_error *error)
{
    uint64_t nodes = 0, polygons = 0;
    for (uint64_t i = 0; i < count; i++) {
        nodes += pieces[i]->node_count;
        polygons += pieces[i]->polygon_count;
    }
    out->nodes = ebpo_alloc(nodes, sizeof *out->nodes);
    out->corners = ebpo_alloc(polygons, 1);
    return out->nodes && out->corners
               ? EBPO_OK
               : ebpo_fail_memory(error, nodes * sizeof *out->nodes + polygons);
}

ebpo_status ebpo_polyhedra_join(ebpo_mesh *out, ebpo_lod_nodes *out_nodes,
                                ebpo_polyhedra *const *pieces, uint64_t count, ebpo_error *error)
{
    uint64_t vertices = 0, faces = 0;
    for (uint64_t i = 0; i < count; i++) {
        vertices += pieces[i]->vertex_count;
        faces += pieces[i]->face_count;
    }
    if (vertices > count_limit || faces > count_limit)
        return ebpo_fail(
            error, EBPO_E_LIMIT,
            "the level has more than 4294967294 vertices or faces; choose a coarser level");
    memset(out, 0, sizeof *out);
    out->xyz64 = ebpo_alloc(vertices, 3 * sizeof(double));
    out->faces = ebpo_alloc(faces, 3 * sizeof(uint32_t));
    if (!out->xyz64 || !out->faces ||
        (out_nodes && make_nodes(out_nodes, pieces, count, error) != EBPO_OK)) {
        ebpo_mesh_free(out);
        return ebpo_fail_memory(error,
                                vertices * 3 * sizeof(double) + faces * 3 * sizeof(uint32_t));
    }
    for (uint64_t i = 0; i < count; i++) {
        append_mesh(out, pieces[i]);
        if (out_nodes)
            append_nodes(out_nodes, pieces[i]);
        polyhedra_free(pieces[i]);
    }
    return EBPO_OK;
}

/* --- the model --- */

void ebpo_lod_model_free(ebpo_lod_model *model)
{
    for (int i = 0; i < EBPO_LEVELS_MAX; i++) {
        ebpo_level_free(&model->level[i]);
        ebpo_level_ranks_free(&model->ranks[i]);
    }
    ebpo_mesh_free(&model->mesh);
    free(model->picked);
    ebpo_cap_tree_free(&model->caps);
}

static ebpo_status read_levels(ebpo_lod_model *out, const ebpo_file *file,
                               const ebpo_read_options *read, ebpo_error *error)
{
    ebpo_file_prefetch_levels(file, 0, out->target);
    for (int i = 0; i <= out->target; i++) {
        ebpo_status status = ebpo_file_read_level(file, i, read, &out->level[i], error);
        if (status == EBPO_OK)
            status = ebpo_level_ranks_make(&out->ranks[i], &out->level[i], i, error);
        if (status != EBPO_OK)
            return status;
        uint64_t expected = i == 0 ? 1 : out->level[i - 1].gray_count;
        if (out->level[i].group_count != expected)
            return ebpo_fail(error, EBPO_E_FORMAT,
                             "level %d: %llu groups of siblings, but %llu parents; run ebpo verify",
                             i, (unsigned long long)out->level[i].group_count,
                             (unsigned long long)expected);
    }
    return EBPO_OK;
}

/* --- faces of leaves --- */

/* Returns the sum of the lengths of all leaves' face lists. A face in several lists counts several
 * times. */
static uint64_t count_listed(const ebpo_lod_model *model)
{
    uint64_t count = 0;
    for (int i = 0; i <= model->target; i++)
        for (uint64_t k = 0; k < model->level[i].leaf_count; k++)
            count += (uint64_t)model->level[i].leaf_new[k] + model->level[i].leaf_ref_count[k];
    return count;
}

/* Writes the faces in the lists of all leaves to `out`, as indices in the file. */
static void list_faces(const ebpo_lod_model *model, uint32_t *out)
{
    for (int i = 0; i <= model->target; i++) {
        const ebpo_level *level = &model->level[i];
        const uint32_t *ref = level->leaf_refs;
        for (uint64_t k = 0; k < level->leaf_count; k++) {
            for (uint32_t n = 0; n < level->leaf_ref_count[k]; n++)
                *out++ = *ref++;
            for (uint32_t n = 0; n < level->leaf_new[k]; n++)
                *out++ = (uint32_t)(level->leaf_first[k] + n);
        }
    }
}

static int compare_indices(const void *a, const void *b)
{
    uint32_t x = *(const uint32_t *)a, y = *(const uint32_t *)b;
    return (x > y) - (x < y);
}

/* Sorts indices, and removes repeated ones. Returns the number of different indices. */
static uint64_t sort_unique(uint32_t *indices, uint64_t count)
{
    uint64_t kept = 0;
    qsort(indices, count, sizeof *indices, compare_indices);
    for (uint64_t i = 0; i < count; i++)
        if (i == 0 || indices[i] != indices[i - 1])
            indices[kept++] = indices[i];
    return kept;
}

/* Returns the position of `index` in a sorted array, or UINT32_MAX if the array does not contain
 * it. */
static uint32_t position_of(uint32_t index, const uint32_t *sorted, uint64_t count)
{
    const uint32_t *at = bsearch(&index, sorted, count, sizeof *sorted, compare_indices);
    return at ? (uint32_t)(at - sorted) : UINT32_MAX;
}

/* Sets out->mesh to the faces that out->picked lists, with only their vertices. */
static ebpo_status pick_mesh(ebpo_lod_model *out, ebpo_chunks *chunks, unsigned threads,
                             ebpo_error *error)
{
    ebpo_mesh *mesh = &out->mesh;
    uint64_t corners = 3 * mesh->face_count;
    bool doubles = out->info->double_coordinates;
    ebpo_hints hints = EBPO_HINTS_INIT(chunks->file);
    ebpo_faces_hint(chunks, &hints, out->picked, mesh->face_count, 0);
    ebpo_hint_all(&hints);
    mesh->faces = ebpo_alloc(corners, sizeof *mesh->faces);
    uint32_t *vertex = ebpo_alloc(corners, sizeof *vertex);
    ebpo_status status = mesh->faces && vertex
                             ? ebpo_pick_rows(chunks, EBPO_A_FACES, out->picked, mesh->face_count,
                                              threads, mesh->faces, error)
                             : ebpo_fail_memory(error, 2 * corners * sizeof *vertex);
    if (status == EBPO_OK) {
        memcpy(vertex, mesh->faces, corners * sizeof *vertex);
        mesh->vertex_count = sort_unique(vertex, corners);
        for (uint64_t i = 0; i < corners; i++)
            mesh->faces[i] = position_of(mesh->faces[i], vertex, mesh->vertex_count);
        void *rows = ebpo_alloc(mesh->vertex_count, doubles ? 24 : 12);
        mesh->xyz64 = doubles ? rows : NULL;
        mesh->xyz32 = doubles ? NULL : rows;
        status = rows ? ebpo_pick_rows(chunks, EBPO_A_VERTICES, vertex, mesh->vertex_count, threads,
                                       rows, error)
                      : ebpo_fail_memory(error, mesh->vertex_count * 24);
    }
    free(vertex);
    return status;
}

/* Reads the faces that leaves list. If they are many, the whole mesh is read. */
static ebpo_status read_faces(ebpo_lod_model *out, const ebpo_file *file,
                              const ebpo_read_options *read, ebpo_error *error)
{
    /* If the lists have more entries than 1 / SHARE of all faces, the whole mesh is read. */
    enum { SHARE = 8, CHUNK_BUDGET = 64 << 20 /* bytes */ };
    uint64_t count = count_listed(out);
    ebpo_chunks *chunks = NULL;
    if (count == 0)
        return EBPO_OK;
    if (count > out->info->face_count / SHARE)
        return ebpo_file_read_mesh(file, read, &out->mesh, error);
    out->picked = ebpo_alloc(count, sizeof *out->picked);
    if (!out->picked)
        return ebpo_fail_memory(error, count * sizeof *out->picked);
    list_faces(out, out->picked);
    out->mesh.face_count = sort_unique(out->picked, count);
    ebpo_status status = ebpo_chunks_make(&chunks, file, CHUNK_BUDGET, error);
    if (status == EBPO_OK)
        status = pick_mesh(out, chunks, read->threads, error);
    ebpo_chunks_free(chunks);
    return status;
}

/* Reads the border of a surface whose envelopes contain its inside, and makes its caps. */
static ebpo_status read_caps(ebpo_lod_model *out, const ebpo_file *file, ebpo_error *error)
{
    ebpo_border_loops loops = { 0 };
    if (!out->info->border_inside || !(out->info->parts & EBPO_PART_BORDER))
        return EBPO_OK;
    ebpo_status status = ebpo_border_read(file, &loops, error);
    if (status == EBPO_OK)
        status = ebpo_cap_tree_of_loops(&out->caps, &loops, error);
    ebpo_border_loops_free(&loops);
    out->has_caps = status == EBPO_OK;
    return status;
}

ebpo_status ebpo_lod_model_read(ebpo_lod_model *out, const ebpo_file *file, int target,
                                const ebpo_read_options *read, ebpo_error *error)
{
    memset(out, 0, sizeof *out);
    out->info = ebpo_file_info(file);
    out->target = target;
    out->box = ebpo_root_box(out->info);
    uint32_t parts = out->info->parts;
    out->leaf_source = parts & EBPO_PART_LEAF_PLANES ? EBPO_LEAF_STORED
                       : parts & EBPO_PART_MESH      ? EBPO_LEAF_DERIVED
                                                     : EBPO_LEAF_INHERITED;
    ebpo_status status = read_levels(out, file, read, error);
    if (status == EBPO_OK && out->leaf_source == EBPO_LEAF_DERIVED)
        status = read_faces(out, file, read, error);
    if (status == EBPO_OK && out->leaf_source == EBPO_LEAF_DERIVED)
        status = read_caps(out, file, error);
    if (status != EBPO_OK)
        ebpo_lod_model_free(out);
    return status;
}

/* --- envelopes of leaves --- */

/* Copies the triangle of a face, given by its index in the file. Returns false if the mesh does not
 * have the face or one of its vertices. */
static bool copy_face(const ebpo_lod_model *model, uint64_t face, ebpo_triangle *out)
{
    const ebpo_mesh *mesh = &model->mesh;
    if (model->picked)
        face = face < UINT32_MAX ? position_of((uint32_t)face, model->picked, mesh->face_count)
                                 : UINT32_MAX;
    if (face >= mesh->face_count)
        return false;
    for (int i = 0; i < 3; i++) {
        uint64_t v = mesh->faces[3 * face + (uint64_t)i];
        if (v >= mesh->vertex_count)
            return false;
        for (uint64_t k = 0; k < 3; k++)
            out->corner[i][k] =
                mesh->xyz32 ? (double)mesh->xyz32[3 * v + k] : mesh->xyz64[3 * v + k];
    }
    return true;
}

/* Collects the leaf's faces in the order of ascending indices in the file, as the construction did.
 * Referenced faces (faces that an earlier leaf of the file also lists) have lower indices than new
 * faces, so they come first. */
ebpo_status ebpo_lod_leaf_faces(const ebpo_lod_model *model, ebpo_cell cell, uint64_t leaf,
                                ebpo_leaf_scratch *scratch, uint64_t *count, ebpo_error *error)
{
    const ebpo_level *level = &model->level[cell.level];
    if (!level->leaf_first || !level->leaf_new || !model->ranks[cell.level].ref_first)
        return ebpo_fail(error, EBPO_E_FORMAT,
                         "level %d: its leaves have no face lists; run ebpo verify", cell.level);
    uint64_t refs = level->leaf_ref_count[leaf], new_count = level->leaf_new[leaf];
    if (!ebpo_grow(&scratch->faces, &scratch->capacity, refs + new_count, sizeof *scratch->faces))
        return ebpo_fail_memory(error, (refs + new_count) * sizeof *scratch->faces);
    const uint32_t *ref =
        level->leaf_refs ? level->leaf_refs + model->ranks[cell.level].ref_first[leaf] : NULL;
    bool valid = true;
    for (uint64_t i = 0; i < refs && valid; i++)
        valid = copy_face(model, ref[i], &scratch->faces[i]);
    for (uint64_t i = 0; i < new_count && valid; i++)
        valid = copy_face(model, level->leaf_first[leaf] + i, &scratch->faces[refs + i]);
    if (!valid)
        return ebpo_fail(error, EBPO_E_FORMAT,
                         "level %d: leaf %llu names a face or vertex that the mesh does not have; "
                         "run ebpo verify",
                         cell.level, (unsigned long long)leaf);
    *count = refs + new_count;
    return EBPO_OK;
}

unsigned ebpo_lod_inside_corners(const ebpo_box *box, ebpo_cell cell, ebpo_rule rule,
                                 int32_t winding, const ebpo_triangle *faces, uint64_t count)
{
    int32_t delta[8];
    ebpo_corner_windings(box, cell, faces, count, delta);
    unsigned inside = 0;
    for (unsigned i = 0; i < 8; i++)
        inside |= (unsigned)ebpo_rule_inside(rule, winding + delta[i]) << i;
    return inside;
}

/* Returns true if the part of the inside in a leaf is bounded by the leaf's faces: in a solid and
 * in a surface of faces alone, and in a surface with holes if |w_D| < 1/2 in the leaf and no cap
 * touches it. Then the rule for the winding number of faces and caps decides, as in a solid. */
static bool faces_decide(const ebpo_lod_model *model, ebpo_cell cell)
{
    const uint32_t root = 0;
    const double threshold = 0.5;
    double low[3], high[3];
    ebpo_cap_front front;
    if (!model->info->border_inside)
        return true;
    ebpo_cell_bounds(&model->box, cell, low, high);
    return model->has_caps &&
           ebpo_cap_small_in(&front, &model->caps, low, high, &root, model->caps.node_count > 0,
                             &(ebpo_cap_field){ .at_centre = { 0, 0 } }, threshold) == 1;
}

ebpo_status ebpo_lod_leaf_planes(const ebpo_lod_model *model, ebpo_cell cell, uint64_t leaf,
                                 ebpo_leaf_scratch *scratch, ebpo_polytope *envelope,
                                 uint32_t codes[EBPO_PLANES_MAX], int *plane_count,
                                 ebpo_error *error)
{
    uint64_t count = 0;
    *plane_count = 0;
    if (!faces_decide(model, cell))
        return EBPO_OK;
    ebpo_status status = ebpo_lod_leaf_faces(model, cell, leaf, scratch, &count, error);
    if (status != EBPO_OK)
        return status;
    const int32_t *winding = model->level[cell.level].leaf_winding;
    unsigned inside = (model->info->solid || model->has_caps) && winding
                          ? ebpo_lod_inside_corners(&model->box, cell, model->info->rule,
                                                    winding[leaf], scratch->faces, count)
                          : 0;
    if (count == 0) /* with border_inside; no faces bound the inside */
        return EBPO_OK;
    /* The 0 is epsilon, the smallest effect of a plane that is kept. Derived planes need no
     * storage, so no plane is omitted. The volumes in the file's header are computed in this way.
     */
    *plane_count =
        ebpo_leaf_planes(&model->box, cell, scratch->faces, count, inside, 0, envelope, codes);
    return EBPO_OK;
}

/* Cuts `envelope` to the envelope of the leaf with rank `leaf` among the leaves of the cell's
 * level. On entry, `envelope` is the part of the parent's envelope in this cell. */
static ebpo_status cut_to_leaf(const ebpo_lod_model *model, ebpo_cell cell, uint64_t leaf,
                               ebpo_leaf_scratch *scratch, ebpo_polytope *envelope,
                               ebpo_error *error)
{
    const ebpo_level *level = &model->level[cell.level];
    const ebpo_level_ranks *ranks = &model->ranks[cell.level];
    if (model->leaf_source == EBPO_LEAF_STORED && ranks->leaf_plane_first &&
        level->leaf_plane_counts[leaf])
        ebpo_planes_cut(envelope, level->leaf_planes + ranks->leaf_plane_first[leaf],
                        level->leaf_plane_counts[leaf]);
    uint32_t codes[EBPO_PLANES_MAX];
    int count;
    if (model->leaf_source != EBPO_LEAF_DERIVED)
        return EBPO_OK;
    return ebpo_lod_leaf_planes(model, cell, leaf, scratch, envelope, codes, &count, error);
}

/* --- colours of nodes --- */

/* Finds the colour of a node: its own colour if the node is gray, and otherwise the colour of its
 * parent. Returns false if the file has no such colour. */
static bool find_colour(const ebpo_lod_model *model, uint64_t octcode, uint32_t *colour)
{
    int depth = ebpo_cell_of_octcode(octcode).level;
    uint64_t group = 0;
    bool found = false;
    for (int level = 0; level <= depth; level++) {
        const ebpo_level *l = &model->level[level];
        unsigned octant = level ? octcode >> 3 * (depth - level) & 7 : 0;
        uint16_t types = l->types[group];
        if (ebpo_group_type(types, octant) != EBPO_GRAY || !l->gray_colours)
            break;
        group = model->ranks[level].before[EBPO_GRAY][group] +
                ebpo_group_count(types, EBPO_GRAY, octant);
        *colour = l->gray_colours[group];
        found = true;
    }
    return found;
}

static void add_colours(ebpo_lod_nodes *nodes, const ebpo_lod_model *model)
{
    for (uint64_t i = 0; i < nodes->node_count; i++) {
        ebpo_lod_node *node = &nodes->nodes[i];
        node->colour = EBPO_COLOUR_OF_NOTHING;
        node->coloured = find_colour(model, node->octcode, &node->colour);
    }
}

static bool are_coloured(const ebpo_lod_nodes *nodes)
{
    for (uint64_t i = 0; i < nodes->node_count; i++)
        if (nodes->nodes[i].coloured)
            return true;
    return false;
}

ebpo_status ebpo_lod_colours(const ebpo_lod_nodes *nodes, uint64_t vertex_count, ebpo_colours *out,
                             ebpo_error *error)
{
    uint64_t sum = 0;
    memset(out, 0, sizeof *out);
    for (uint64_t i = 0; i < nodes->node_count; i++)
        sum += nodes->nodes[i].vertex_count;
    if (sum != vertex_count)
        return ebpo_fail(error, EBPO_E_ARGUMENT,
                         "the nodes have %llu vertices, but the mesh has %llu; pass nodes "
                         "and mesh of one level",
                         (unsigned long long)sum, (unsigned long long)vertex_count);
    if (!are_coloured(nodes))
        return EBPO_OK;
    uint8_t *rgba = out->vertex = ebpo_alloc(vertex_count, 4);
    if (!rgba)
        return ebpo_fail_memory(error, vertex_count * 4);
    for (uint64_t i = 0; i < nodes->node_count; i++)
        for (uint32_t v = 0; v < nodes->nodes[i].vertex_count; v++, rgba += 4) {
            uint32_t colour = nodes->nodes[i].colour;
            rgba[0] = (uint8_t)colour;
            rgba[1] = (uint8_t)(colour >> 8);
            rgba[2] = (uint8_t)(colour >> 16);
            rgba[3] = 255;
        }
    return EBPO_OK;
}

/* --- the walk --- */

/* The split level is the first level with at least this number of gray nodes, so that there are
 * enough subtrees for all threads. */
enum { SEEDS_WANTED = 128 };

/* For each level of the path to the current node, three parts of the envelope of the path's node: a
 * half (cut at the middle of the cell along z), a quarter (also cut along y), and an eighth (also
 * cut along x). These polytopes are too large for the stack. */
typedef ebpo_polytope path_halves[EBPO_LEVELS_MAX][3];

/* A gray node at the split level, where the walk of a subtree begins. */
typedef struct seed {
    ebpo_cell cell;
    ebpo_polytope envelope;
} seed;

typedef struct job {
    const ebpo_lod_model *model;
    bool cell_faces; /* true: keep polygons on cell faces */
    bool polygons;   /* true: compute polygons; false: only the volume */
    bool nodes;      /* true: record the node of each polygon */
    int split;       /* level at which the first walk creates seeds */
    seed *seeds;
    uint64_t seed_count;
    /* [1 + seed_count] results of the walk from the root, then of the walk from each seed; one
     * piece (levels/lod.h) for each level */
    ebpo_polyhedra (*pieces)[EBPO_LEVELS_MAX];
    ebpo_leaf_scratch *scratch; /* [threads] */
    path_halves *halves;        /* [threads] */
} job;

/* State of one walk. */

typedef struct walker {
    job *j;
    ebpo_polyhedra *out; /* [EBPO_LEVELS_MAX] result of the walk, one piece for each level */
    ebpo_leaf_scratch *scratch;
    ebpo_polytope (*half)[3]; /* [EBPO_LEVELS_MAX] see path_halves */
    int seed_level; /* gray nodes of this level become seeds; -1: the walk makes no seeds */
    ebpo_error *error;
} walker;

/* Adds a node's polytope to the piece of the node's level. */
static ebpo_status add_polytope(walker *w, const ebpo_polytope *p, ebpo_cell cell,
                                ebpo_node_type type)
{
    ebpo_polyhedra *piece = &w->out[cell.level];
    piece->volume += ebpo_polytope_volume(p) * ebpo_cell_volume(&w->j->model->box, cell.level);
    if (!w->j->polygons)
        return EBPO_OK;
    piece->wants_nodes = w->j->nodes;
    return ebpo_polyhedra_add(piece, p, &w->j->model->box, cell, type, w->j->cell_faces, w->error);
}

static ebpo_status visit_group(walker *w, uint64_t group, ebpo_cell parent_cell,
                               const ebpo_polytope *parent);

/* Returns true if a node above the target level is pruned (its children are not in the file). At
 * all deeper levels, the envelope of a pruned node takes the place of its children's envelopes.
 * `gray` is the node's rank among the gray nodes of `level`. */
static bool is_pruned(const ebpo_lod_model *model, int level, uint64_t gray)
{
    return model->info->pruned && level < model->target && model->level[level + 1].types[gray] == 0;
}

/* Visits a gray node. On entry, `envelope` is the part of the parent's envelope in the node's cell;
 * the function cuts this polytope. */
static ebpo_status visit_gray(walker *w, uint64_t gray, ebpo_cell cell, ebpo_polytope *envelope)
{
    const ebpo_level *level = &w->j->model->level[cell.level];
    if (level->plane_counts && level->plane_counts[gray])
        ebpo_planes_cut(envelope, level->planes + w->j->model->ranks[cell.level].plane_first[gray],
                        level->plane_counts[gray]);
    if (cell.level == w->j->model->target)
        return add_polytope(w, envelope, cell, EBPO_GRAY);
    if (cell.level == w->seed_level) {
        seed *s = &w->j->seeds[w->j->seed_count++];
        s->cell = cell;
        ebpo_polytope_copy(&s->envelope, envelope);
        return EBPO_OK;
    }
    if (is_pruned(w->j->model, cell.level, gray))
        return add_polytope(w, envelope, cell, EBPO_GRAY);
    return visit_group(w, gray, cell, envelope);
}

/* Visits a gray node or leaf, given by its group and octant. On entry, `envelope` is the part of
 * the parent's envelope in the node's cell; the function cuts this polytope. */
static ebpo_status visit_node(walker *w, uint64_t group, unsigned octant, ebpo_cell cell,
                              ebpo_polytope *envelope)
{
    const ebpo_lod_model *model = w->j->model;
    const ebpo_level_ranks *ranks = &model->ranks[cell.level];
    uint16_t types = model->level[cell.level].types[group];
    ebpo_node_type type = ebpo_group_type(types, octant);
    uint64_t rank = ranks->before[type][group] + ebpo_group_count(types, type, octant);
    if (type == EBPO_GRAY)
        return visit_gray(w, rank, cell, envelope);
    ebpo_status status = cut_to_leaf(model, cell, rank, w->scratch, envelope, w->error);
    return status == EBPO_OK ? add_polytope(w, envelope, cell, EBPO_LEAF) : status;
}

/* Adds a black node, which fills its cell. */
static ebpo_status visit_black(walker *w, ebpo_cell cell)
{
    ebpo_polytope cube;
    ebpo_polytope_cube(&cube);
    return add_polytope(w, &cube, cell, EBPO_BLACK);
}

static ebpo_status visit_root(walker *w)
{
    ebpo_cell root = { 0, { 0, 0, 0 } };
    ebpo_polytope cube;
    ebpo_polytope_cube(&cube);
    switch (ebpo_group_type(w->j->model->level[0].types[0], 0)) {
    case EBPO_WHITE: return EBPO_OK;
    case EBPO_BLACK: return visit_black(w, root);
    default: return visit_node(w, 0, 0, root, &cube);
    }
}

/* Visits the eight children of a node in octant order. `group`: index of their group in its level.
 * The children's envelopes are cut from the parent's envelope along z, y and x. Siblings share the
 * halves and quarters, as in the construction. */
static ebpo_status visit_group(walker *w, uint64_t group, ebpo_cell parent_cell,
                               const ebpo_polytope *parent)
{
    uint16_t types = w->j->model->level[parent_cell.level + 1].types[group];
    unsigned filled = ebpo_group_filled(types);
    ebpo_polytope *z = w->half[parent_cell.level], *y = z + 1, *x = z + 2;
    ebpo_status status = EBPO_OK;
    for (unsigned octant = 0; octant < 8 && status == EBPO_OK; octant++) {
        ebpo_cell cell = ebpo_cell_child(parent_cell, octant);
        if (octant % 4 == 0 && filled >> 2 * octant & 0xff)
            (void)ebpo_polytope_half(parent, 2, octant >> 2 & 1, z);
        if (octant % 2 == 0 && filled >> 2 * octant & 0xf)
            (void)ebpo_polytope_half(z, 1, octant >> 1 & 1, y);
        if (filled >> 2 * octant & 1) {
            (void)ebpo_polytope_half(y, 0, octant & 1, x);
            status = visit_node(w, group, octant, cell, x);
        } else if (ebpo_group_type(types, octant) == EBPO_BLACK) {
            status = visit_black(w, cell);
        }
    }
    return status;
}

/* Walks the subtrees of the seeds from `begin` to `end` - 1. */
static ebpo_status walk_seeds(void *context, uint64_t begin, uint64_t end, unsigned worker,
                              ebpo_error *error)
{
    job *j = context;
    for (uint64_t i = begin; i < end; i++) {
        walker w = { j, j->pieces[1 + i], &j->scratch[worker], j->halves[worker], -1, error };
        seed *s = &j->seeds[i];
        /* The seeds are all gray nodes of the split level in the order of octcodes, so the children
         * of seed i are group i of the next level. */
        ebpo_status status = is_pruned(j->model, s->cell.level, i)
                                 ? add_polytope(&w, &s->envelope, s->cell, EBPO_GRAY)
                                 : visit_group(&w, i, s->cell, &s->envelope);
        if (status != EBPO_OK)
            return status;
    }
    return EBPO_OK;
}

/* Returns the first level with enough gray nodes to distribute to threads, or the target. */
static int choose_split(const ebpo_lod_model *model)
{
    int level = 0;
    while (level < model->target && model->level[level].gray_count < SEEDS_WANTED)
        level++;
    return level;
}

static ebpo_status job_prepare(job *j, unsigned threads, ebpo_error *error)
{
    j->split = choose_split(j->model);
    uint64_t seeds = j->split < j->model->target ? j->model->level[j->split].gray_count : 0;
    j->seeds = ebpo_alloc(seeds, sizeof *j->seeds);
    j->pieces = ebpo_alloc_zero(seeds + 1, sizeof *j->pieces);
    j->scratch = ebpo_alloc_zero(threads, sizeof *j->scratch);
    j->halves = ebpo_alloc(threads, sizeof *j->halves);
    if (!j->seeds || !j->pieces || !j->scratch || !j->halves)
        return ebpo_fail_memory(error, seeds * (sizeof *j->seeds + sizeof *j->pieces) +
                                           threads * sizeof *j->halves);
    return EBPO_OK;
}

static ebpo_status job_walk(job *j, unsigned threads, const ebpo_progress *progress,
                            ebpo_error *error)
{
    walker top = { j, j->pieces[0], &j->scratch[0], j->halves[0], j->split, error };
    ebpo_status status = visit_root(&top);
    if (status != EBPO_OK)
        return status;
    return ebpo_parallel_for(threads, NULL, j->seed_count, 1, walk_seeds, j, progress,
                             "clipping envelopes", error);
}

/* Joins the pieces, level by level. Within a level, the piece of the walk from the root comes
 * first. The pieces of the walks from the seeds follow, in the order of the seeds. */
static ebpo_status job_join(job *j, ebpo_mesh *out, ebpo_lod_nodes *nodes, double *volume,
                            ebpo_error *error)
{
    uint64_t count = j->seed_count + 1, listed = 0;
    ebpo_polyhedra **list = ebpo_alloc(count * EBPO_LEVELS_MAX, sizeof *list);
    if (!list)
        return ebpo_fail_memory(error, count * EBPO_LEVELS_MAX * sizeof *list);
    double sum = 0;
    for (int level = 0; level <= j->model->target; level++)
        for (uint64_t i = 0; i < count; i++) {
            sum += j->pieces[i][level].volume;
            list[listed++] = &j->pieces[i][level];
        }
    if (volume)
        *volume = sum;
    ebpo_status status = out ? ebpo_polyhedra_join(out, nodes, list, listed, error) : EBPO_OK;
    free(list);
    return status;
}

static void job_free(job *j, unsigned threads)
{
    for (uint64_t i = 0; j->pieces && i <= j->seed_count; i++)
        for (int level = 0; level < EBPO_LEVELS_MAX; level++)
            polyhedra_free(&j->pieces[i][level]);
    for (unsigned i = 0; j->scratch && i < threads; i++)
        free(j->scratch[i].faces);
    free(j->pieces);
    free(j->scratch);
    free(j->halves);
    free(j->seeds);
}

void ebpo_lod_nodes_free(ebpo_lod_nodes *nodes)
{
    if (!nodes)
        return;
    free(nodes->nodes);
    free(nodes->corners);
    memset(nodes, 0, sizeof *nodes);
}

/* Sets the winding numbers of leaves and black nodes. `nodes` is sorted by level, then by octcode,
 * and has every leaf and every black node of these levels. So the rank of a leaf is the number of
 * leaves before it in its level. The rank of a black node is the number of black nodes before it.
 */
static void add_windings(ebpo_lod_nodes *nodes, const ebpo_lod_model *model)
{
    uint64_t leaf = 0, black = 0;
    int previous_level = 0;
    for (uint64_t i = 0; i < nodes->node_count; i++) {
        ebpo_lod_node *n = &nodes->nodes[i];
        int level = ebpo_cell_of_octcode(n->octcode).level;
        if (level != previous_level)
            leaf = black = 0;
        previous_level = level;
        const ebpo_level *l = &model->level[level];
        if (n->type == EBPO_LEAF)
            n->winding = l->leaf_winding ? l->leaf_winding[leaf++] : 0;
        else if (n->type == EBPO_BLACK)
            n->winding = l->black_winding ? l->black_winding[black++] : 1;
    }
}

ebpo_status ebpo_lod_level(const ebpo_file *file, int level, const ebpo_lod_options *options,
                           ebpo_mesh *out, double *volume, ebpo_error *error)
{
    return ebpo_lod_level_nodes(file, level, options, out, NULL, volume, error);
}

ebpo_status ebpo_lod_level_nodes(const ebpo_file *file, int level, const ebpo_lod_options *options,
                                 ebpo_mesh *out, ebpo_lod_nodes *nodes, double *volume,
                                 ebpo_error *error)
{
    EBPO_DEFAULT_FP;
    ebpo_lod_options wanted = EBPO_LOD_OPTIONS_INIT;
    ebpo_status status = EBPO_TAKE(ebpo_lod_options, &wanted, options, error);
    if (out)
        memset(out, 0, sizeof *out);
    if (nodes)
        memset(nodes, 0, sizeof *nodes);
    if (status != EBPO_OK)
        return status;
    if (nodes && !out)
        return ebpo_fail(error, EBPO_E_ARGUMENT,
                         "nodes of a level are returned only together with its polygons; pass a "
                         "mesh for the polygons");
    const ebpo_info *info = ebpo_file_info(file);
    if (level < 0 || level >= info->level_count)
        return ebpo_fail(error, EBPO_E_ARGUMENT,
                         "there is no level %d; this file has levels 0 to %d", level,
                         info->level_count - 1);
    unsigned threads = ebpo_thread_count(wanted.threads);
    ebpo_lod_model model;
    ebpo_read_options read = EBPO_READ_OPTIONS_INIT;
    read.threads = threads;
    read.workspace = wanted.workspace;
    status = ebpo_lod_model_read(&model, file, level, &read, error);
    if (status != EBPO_OK)
        return status;
    job j = { .model = &model,
              .cell_faces = wanted.cell_faces,
              .polygons = out != NULL,
              .nodes = nodes != NULL };
    status = job_prepare(&j, threads, error);
    if (status == EBPO_OK)
        status = job_walk(&j, threads, &wanted.progress, error);
    if (status == EBPO_OK)
        status = job_join(&j, out, nodes, volume, error);
    if (status == EBPO_OK && nodes) {
        add_windings(nodes, &model);
        add_colours(nodes, &model);
    }
    if (status != EBPO_OK)
        ebpo_lod_nodes_free(nodes);
    job_free(&j, threads);
    ebpo_lod_model_free(&model);
    return status;
}
