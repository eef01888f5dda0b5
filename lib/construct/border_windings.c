/* Finds the border of a surface, and the winding numbers of the surface with its caps.
 *
 * The caps are triangles that close the border (geometry/cap_triangles.h), so the winding number of
 * surface and caps is an integer. The winding number of a white node or a leaf is the winding
 * number at its lowest corner. All corners are shifted by the same infinitely small amount
 * (corner_windings.c). The nodes are visited depth first. Each visit returns the cell's corner
 * differences: the winding numbers at its corners minus the winding number at its lowest corner.
 * For a leaf, these differences are sums of the signed crossings of faces and caps with the edges
 * of the cell. The lowest corner of a child is also a corner of an earlier sibling, or the lowest
 * corner of the parent. So the winding number of this corner is known before the child is visited.
 * Source: format-spec/border.md. */
#include "core/strict_fp.h"

#include <float.h>
#include <inttypes.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include <ebpo/build.h>

#include "construct/capped.h"
#include "construct/construct_stages.h"
#include "construct/planes.h"
#include "core/alloc.h"
#include "core/error.h"
#include "core/fp_env.h"
#include "core/parallel.h"
#include "core/workspace.h"
#include "format/border_loops.h"
#include "format/write_file.h"
#include "geometry/cap_tree.h"
#include "geometry/level_nodes.h"
#include "geometry/vec3.h"
#include "mesh/border.h"
#include "mesh/mesh_parts.h"

enum {
    BUFFER_FACES = 256,   /* number of faces whose crossings are computed at a time */
    PROGRESS_NODES = 4096 /* number of white nodes and leaves between two reports of progress */
};

typedef struct winding_walk {
    ebpo_tree *tree;
    ebpo_box box;
    const ebpo_cap_tree *caps;
    /* [level] index of the next group, leaf, white node and reference to a face. A depth-first
     * visit reaches the items of a level in the order of the level's arrays */
    uint64_t group[EBPO_LEVELS_MAX], leaf[EBPO_LEVELS_MAX], white[EBPO_LEVELS_MAX],
        ref[EBPO_LEVELS_MAX];
    bool agree; /* so far, all paths to a corner gave the same winding number */
    const ebpo_progress *progress;
    uint64_t done, total; /* number of visited white nodes and leaves; of all */
    ebpo_status status;   /* of the last report of progress */
    ebpo_error *error;
    ebpo_triangle buffer[BUFFER_FACES];
} winding_walk;

/* Adds the crossings of faces along the edges of a cell to the differences of its corners. The
 * faces are faces[0 .. count - 1]; if `faces` is NULL, first .. first + count - 1. */
static void add_faces(winding_walk *w, ebpo_cell cell, const uint32_t *faces, uint64_t first,
                      uint64_t count, int32_t delta[8])
{
    const ebpo_mesh *mesh = &w->tree->mesh;
    int32_t part[8];
    for (uint64_t done = 0; done < count; done += BUFFER_FACES) {
        uint64_t buffered = count - done < BUFFER_FACES ? count - done : BUFFER_FACES;
        for (uint64_t i = 0; i < buffered; i++) {
            uint64_t face = faces ? faces[done + i] : first + done + i;
            for (int k = 0; k < 3; k++)
                ebpo_mesh_position(mesh, mesh->faces[3 * face + (uint64_t)k],
                                   w->buffer[i].corner[k]);
        }
        ebpo_corner_windings(&w->box, cell, w->buffer, buffered, part);
        for (int i = 0; i < 8; i++)
            delta[i] += part[i];
    }
}

/* Counts a white node or a leaf. Now and then, reports progress and releases pages. */
static void count_node(winding_walk *w)
{
    if (w->done++ % PROGRESS_NODES)
        return;
    ebpo_release_pages(w->tree->workspace);
    if (!ebpo_progress_step(w->progress, "border", w->done - 1, w->total, w->error))
        w->status = EBPO_E_CANCELLED;
}

/* Stores the winding number of a leaf, and adds its corner differences to `delta`. */
static void visit_leaf(winding_walk *w, ebpo_cell cell, int32_t winding, int32_t delta[8])
{
    ebpo_level *level = &w->tree->level[cell.level];
    uint64_t i = w->leaf[cell.level]++, refs = level->leaf_ref_count[i];
    level->leaf_winding[i] = winding;
    add_faces(w, cell, NULL, level->leaf_first[i], level->leaf_new[i], delta);
    if (refs)
        add_faces(w, cell, level->leaf_refs + w->ref[cell.level], 0, refs, delta);
    w->ref[cell.level] += refs;
    ebpo_cap_corners(w->caps, &w->box, cell, delta);
}

static void visit_node(winding_walk *w, ebpo_cell cell, ebpo_node_type type, int32_t winding,
                       int32_t delta[8]);

/* Visits the children of a gray node, and sets `delta` to the gray node's corner differences. */
static void visit_gray(winding_walk *w, ebpo_cell cell, int32_t winding, int32_t delta[8])
{
    const ebpo_level *below = &w->tree->level[cell.level + 1];
    uint16_t types = below->types[w->group[cell.level + 1]++];
    /* offset: winding number at each child's lowest corner, minus the winding number at the node's
     * lowest corner */
    int32_t offset[8] = { 0 }, child_delta[8][8];
    for (int o = 0; o < 8; o++) {
        bool known = o == 0;
        for (int axis = 0; axis < 3; axis++) {
            if (!(o >> axis & 1))
                continue;
            int before = o & ~(1 << axis);
            int32_t sum = offset[before] + child_delta[before][1 << axis];
            w->agree = w->agree && (!known || sum == offset[o]);
            offset[o] = sum;
            known = true;
        }
        visit_node(w, ebpo_cell_child(cell, (unsigned)o), ebpo_group_type(types, (unsigned)o),
                   winding + offset[o], child_delta[o]);
    }
    for (int o = 0; o < 8; o++)
        delta[o] = offset[o] + child_delta[o][o];
}

/* Stores the winding numbers of a node and of all nodes below, and sets `delta` to the node's
 * corner differences. `winding`: winding number at the node's lowest corner. Does nothing after a
 * cancellation. */
static void visit_node(winding_walk *w, ebpo_cell cell, ebpo_node_type type, int32_t winding,
                       int32_t delta[8])
{
    memset(delta, 0, 8 * sizeof *delta);
    if (type != EBPO_GRAY)
        count_node(w);
    if (w->status != EBPO_OK)
        return;
    if (type == EBPO_GRAY) {
        visit_gray(w, cell, winding, delta);
    } else if (type == EBPO_LEAF) {
        visit_leaf(w, cell, winding, delta);
    } else {
        w->tree->level[cell.level].white_winding[w->white[cell.level]++] = winding;
        ebpo_cap_corners(w->caps, &w->box, cell, delta);
    }
}

/* Computes the winding numbers of all white nodes and leaves. Returns EBPO_E_NOT_SOLID if the caps
 * do not close the mesh, EBPO_E_CANCELLED. */
static ebpo_status make_windings(ebpo_tree *tree, const ebpo_cap_tree *caps,
                                 const ebpo_progress *progress, ebpo_error *error)
{
    winding_walk *w = ebpo_alloc_zero(1, sizeof *w);
    if (!w)
        return ebpo_fail_memory(error, sizeof *w);
    *w = (winding_walk){ .tree = tree,
                         .box = ebpo_root_box(&tree->info),
                         .caps = caps,
                         .agree = true,
                         .progress = progress,
                         .error = error };
    ebpo_status status = EBPO_OK;
    for (int i = 0; i < tree->info.level_count && status == EBPO_OK; i++) {
        ebpo_level *l = &tree->level[i];
        ebpo_array_free(l->workspace, l->leaf_winding);
        ebpo_array_free(l->workspace, l->white_winding);
        l->leaf_winding = l->white_winding = NULL;
        if (l->leaf_count)
            l->leaf_winding = ebpo_array_alloc(l->workspace, l->leaf_count, sizeof(int32_t));
        if (l->white_count)
            l->white_winding = ebpo_array_alloc(l->workspace, l->white_count, sizeof(int32_t));
        if ((l->leaf_count && !l->leaf_winding) || (l->white_count && !l->white_winding))
            status = ebpo_workspace_fail(l->workspace,
                                         (l->leaf_count + l->white_count) * sizeof(int32_t), error);
        w->total += l->leaf_count + l->white_count;
    }
    int32_t delta[8];
    if (status == EBPO_OK) {
        visit_node(w, (ebpo_cell){ 0, { 0, 0, 0 } }, ebpo_group_type(tree->level[0].types[0], 0), 0,
                   delta);
        for (int i = 0; i < 8; i++)
            w->agree = w->agree && delta[i] == 0;
        status = w->status;
        if (status == EBPO_OK && !w->agree)
            status = ebpo_fail(error, EBPO_E_NOT_SOLID,
                               "winding numbers disagree: the caps do not close the mesh");
    }
    free(w);
    return status;
}

/* Multiplies two vectors by the same power of two, so that their greatest component is from 0.5 to
 * 1. Returns the exponent of the greatest component before. */
static int scale_vectors(double u[3], double v[3])
{
    double most = 0;
    int power;
    for (int k = 0; k < 3; k++)
        most = fmax(most, fmax(fabs(u[k]), fabs(v[k])));
    frexp(most, &power);
    for (int k = 0; k < 3; k++) {
        u[k] = ldexp(u[k], -power);
        v[k] = ldexp(v[k], -power);
    }
    return power;
}

/* Returns the area of a triangle, or INFINITY if the area is beyond the doubles. The edges and
 * their product are scaled by powers of two, so squares neither overflow nor underflow. */
static double area_of(const double *const corner[3])
{
    double u[3], v[3], cross[3], none[3] = { 0, 0, 0 };
    for (int k = 0; k < 3; k++) { /* quarters, because the difference of doubles may overflow */
        u[k] = corner[1][k] / 4 - corner[0][k] / 4;
        v[k] = corner[2][k] / 4 - corner[0][k] / 4;
    }
    int power = 2 * (2 + scale_vectors(u, v));
    ebpo_vec3_cross(u, v, cross);
    power += scale_vectors(cross, none);
    return ldexp(ebpo_vec3_length(cross) / 2, power);
}

/* Sets the counts of the border's loops and points, and the area of the caps. */
static void measure_border(ebpo_info *info, const ebpo_cap_tree *caps,
                           const ebpo_border_loops *loops)
{
    info->border_loops = loops->loop_count;
    info->border_points = loops->point_count;
    info->border_longest = 0;
    info->border_area = 0;
    for (uint64_t i = 0; i < loops->loop_count; i++)
        if (loops->loop[2 * i] > info->border_longest)
            info->border_longest = loops->loop[2 * i];
    for (uint64_t i = 0; i < caps->node_count; i++) {
        const ebpo_cap_node *n = &caps->node[i];
        const double *const corner[3] = { caps->position[n->from],
                                          caps->position[n->from + (n->to - n->from) / 2],
                                          caps->position[n->to] };
        if (n->weight)
            info->border_area = fmin(info->border_area + n->weight * area_of(corner), DBL_MAX);
    }
}

ebpo_status ebpo_build_find_border(ebpo_border_loops *out, const ebpo_mesh *mesh, unsigned threads,
                                   ebpo_error *error)
{
    ebpo_border border;
    ebpo_status status = ebpo_border_find(&border, mesh, threads, error);
    if (status != EBPO_OK)
        return status;
    *out = (ebpo_border_loops){ .loop_count = border.loop_count };
    out->point_count = border.loop_count ? border.first[border.loop_count] : 0;
    uint64_t edges = 0; /* sum of points times weight */
    out->loop = ebpo_alloc(out->loop_count + 1, 2 * sizeof *out->loop);
    out->point = ebpo_alloc(out->point_count + 1, 3 * sizeof *out->point);
    if (!out->loop || !out->point)
        status = ebpo_fail_memory(error, out->point_count * 3 * sizeof *out->point);
    for (uint64_t i = 0; i < out->loop_count && status == EBPO_OK; i++) {
        out->loop[2 * i] = (uint32_t)(border.first[i + 1] - border.first[i]);
        out->loop[2 * i + 1] = border.weight[i];
        edges += (uint64_t)out->loop[2 * i] * border.weight[i];
    }
    if (status == EBPO_OK && edges > EBPO_BORDER_WEIGHT_MAX)
        status = ebpo_fail(error, EBPO_E_LIMIT,
                           "the border has %" PRIu64
                           " edges, counted by their weights, but %d is the limit; build without "
                           "the border",
                           edges, EBPO_BORDER_WEIGHT_MAX);
    uint64_t bytes = out->point_count * EBPO_CAPS_BYTES,
             memory = mesh->workspace ? ebpo_workspace_memory(mesh->workspace) : 0;
    if (status == EBPO_OK && memory && bytes > memory / 2)
        status = ebpo_fail(error, EBPO_E_LIMIT,
                           "the border has %" PRIu64 " edges, whose caps take %" PRIu64
                           " bytes; give at least %" PRIu64
                           " bytes of memory, or build without the border",
                           out->point_count, bytes, 2 * bytes);
    for (uint64_t i = 0; i < out->point_count && status == EBPO_OK; i++)
        ebpo_mesh_position(mesh, border.vertex[i], out->point + 3 * i);
    ebpo_border_free(&border);
    return status;
}

ebpo_status ebpo_build_border(ebpo_tree *tree, unsigned threads, const ebpo_progress *progress,
                              ebpo_error *error)
{
    ebpo_cap_tree caps = { .node = NULL };
    ebpo_status status = ebpo_build_find_border(&tree->border, &tree->mesh, threads, error);
    if (status == EBPO_OK)
        status = ebpo_cap_tree_of_loops(&caps, &tree->border, error);
    if (status == EBPO_OK)
        status = make_windings(tree, &caps, progress, error);
    if (status == EBPO_OK) {
        measure_border(&tree->info, &caps, &tree->border);
        tree->info.parts |= EBPO_PART_BORDER;
    }
    ebpo_cap_tree_free(&caps);
    return status;
}

/* --- files --- */

/* Adds the border to a tree of a surface that has the mesh and no pruned nodes, unless the tree
 * already has its border. */
static ebpo_status add_border(ebpo_tree *tree, const ebpo_write_options *options, ebpo_error *error)
{
    const ebpo_info *info = &tree->info;
    bool possible = !info->solid && !info->pruned && info->parts & EBPO_PART_MESH;
    return possible && !(info->parts & EBPO_PART_BORDER)
               ? ebpo_build_border(tree, options->threads, &options->progress, error)
               : EBPO_OK;
}

ebpo_status ebpo_file_add_border(const ebpo_file *file, const char *path,
                                 const ebpo_read_options *read, const ebpo_write_options *write,
                                 ebpo_error *error)
{
    EBPO_DEFAULT_FP;
    return ebpo_repack_with(file, path, read, write, add_border, error);
}
