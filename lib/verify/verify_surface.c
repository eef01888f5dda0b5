/* Verifies the simplified surface (format-spec/surface.md). A patch is a set of triangles that
 * replaces the faces of one node, with an error: the greatest distance between the patch and these
 * faces.
 *
 * - Each patch belongs to a gray node or a leaf. If a child of a node has a patch, the node must
 *   have a patch, and all its children with faces must have patches.
 * - The error is tested at points: at the vertices and centres of all triangles of a patch, and of
 *   some of the faces that the patch replaces, evenly spaced in the file. A uniform grid finds the
 *   triangles near a point. Exact bounds of the distance from these triangles are compared with the
 *   error. The number of visited cells and triangles is limited, in proportion to the number of
 *   triangles; the points that are left at the limit are not tested. If a patch does not have the
 *   faces of its node, no errors are tested, because each patch could name all faces. */
#include "core/strict_fp.h"

#include <inttypes.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "core/alloc.h"
#include "core/error.h"
#include "core/workspace.h"
#include "geometry/cells.h"
#include "geometry/distance.h"
#include "geometry/level_nodes.h"
#include "mesh/mesh_parts.h"
#include "verify/verify_parts.h"

enum {
    SIDE_MAX = 128, /* greatest number of grid cells along an axis */
    /* greatest number of entries of a grid, divided by the number of triangles; a triangle has an
     * entry in each cell that its box intersects */
    ENTRIES_MAX = 32,
    SAMPLED_FACES = 4096, /* approximate number of faces that are tested for a patch */
    /* greatest number of cells and triangles that are visited, for each triangle of a grid and of
     * the list with the points */
    VISITS_MAX = 1024
};

#define CHECK(...) ebpo_tally_check(tally, EBPO_VERIFY_STRUCTURE, __VA_ARGS__)

/* --- nodes --- */

typedef struct node_walk {
    ebpo_tally *tally;
    const ebpo_tree *tree;
    /* [level] number of groups and number of leaves visited so far */
    uint64_t group[EBPO_LEVELS_MAX], leaf[EBPO_LEVELS_MAX];
    uint64_t face;  /* number of new faces of the leaves visited so far */
    uint64_t found; /* number of visited nodes with a patch */
    uint64_t wrong; /* number of these nodes whose patch does not have the faces of the node */
} node_walk;

/* Returns the row of the patch of the node with this octcode, or NULL if the node has no patch. */
static const uint64_t *find_patch(const ebpo_surface *s, ebpo_octcode code)
{
    uint64_t low = 0, high = s->patch_count;
    while (low < high) {
        uint64_t middle = low + (high - low) / 2;
        if (s->patch[EBPO_PATCH_COLUMNS * middle + EBPO_PATCH_OCTCODE] < code)
            low = middle + 1;
        else
            high = middle;
    }
    const uint64_t *row = s->patch + EBPO_PATCH_COLUMNS * low;
    return low < s->patch_count && row[EBPO_PATCH_OCTCODE] == code ? row : NULL;
}

/* Visits a node and the nodes below it. Returns true if the node has a patch. */
static bool visit_node(node_walk *w, ebpo_octcode code, ebpo_node_type type)
{
    ebpo_tally *tally = w->tally;
    int level = ebpo_octcode_level(code);
    uint64_t first = w->face;
    unsigned with_faces = 0, with_patch = 0;
    if (type == EBPO_LEAF) {
        w->face += w->tree->level[level].leaf_new[w->leaf[level]++];
    } else if (type == EBPO_GRAY) {
        uint16_t types = w->tree->level[level + 1].types[w->group[level + 1]++];
        for (unsigned octant = 0; octant < 8; octant++) {
            uint64_t before = w->face;
            with_patch +=
                visit_node(w, ebpo_octcode_child(code, octant), ebpo_group_type(types, octant));
            with_faces += w->face > before;
        }
    }
    const uint64_t *row = find_patch(&w->tree->surface, code);
    CHECK(with_patch == 0 || (row && with_patch == with_faces),
          "surface: octcode %" PRIu64 ": %u of %u children with faces have patches%s", code,
          with_patch, with_faces, row ? "" : ", and the node has none");
    if (!row)
        return false;
    bool right = row[EBPO_PATCH_FIRST_FACE] == first && row[EBPO_PATCH_FACES] == w->face - first;
    w->found++;
    w->wrong += !right;
    CHECK(right, "surface: octcode %" PRIu64 ": the patch does not have the faces of the node",
          code);
    return true;
}

/* --- distances --- */

/* Triangles in a uniform grid. */
typedef struct triangle_grid {
    ebpo_workspace *workspace;
    double low[3], high[3]; /* box of the triangles */
    double step[3];         /* sides of a cell */
    int side;               /* number of cells along each axis */
    uint64_t *begin;        /* [side^3 + 1] index in `triangle` of each cell's first triangle */
    uint32_t *triangle;     /* indices of triangles, cell by cell */
    uint64_t near;          /* index in `triangle` of the last entry that was near a point */
    uint64_t visits;        /* number of cells and triangles that may still be visited */
} triangle_grid;

/* A list of triangles: the triangles of a patch, or faces of the model. */
typedef struct triangle_list {
    uint64_t count;
    const ebpo_patch *patch; /* NULL: the list has the faces first .. first + count - 1 of `mesh` */
    const ebpo_mesh *mesh;
    uint64_t first;
} triangle_list;

static void get_triangle(const triangle_list *list, uint64_t i, double out[3][3])
{
    for (uint64_t k = 0; k < 3; k++)
        if (list->patch)
            memcpy(out[k], list->patch->xyz + 3 * (uint64_t)list->patch->triangles[3 * i + k],
                   sizeof out[k]);
        else
            ebpo_mesh_position(list->mesh, list->mesh->faces[3 * (list->first + i) + k], out[k]);
}

/* Computes the range of cells from[k] .. to[k] that the box [low, high] intersects. */
static void cell_range(const triangle_grid *g, const double low[3], const double high[3],
                       int from[3], int to[3])
{
    for (int k = 0; k < 3; k++) {
        double a = g->step[k] > 0 ? (low[k] - g->low[k]) / g->step[k] : 0,
               b = g->step[k] > 0 ? (high[k] - g->low[k]) / g->step[k] : 0;
        from[k] = (int)fmin(fmax(floor(a), 0), g->side - 1);
        to[k] = (int)fmin(fmax(floor(b), 0), g->side - 1);
    }
}

static void triangle_range(const triangle_grid *g, const triangle_list *list, uint64_t i,
                           int from[3], int to[3])
{
    double t[3][3], low[3], high[3];
    get_triangle(list, i, t);
    for (int k = 0; k < 3; k++) {
        low[k] = fmin(t[0][k], fmin(t[1][k], t[2][k]));
        high[k] = fmax(t[0][k], fmax(t[1][k], t[2][k]));
    }
    cell_range(g, low, high, from, to);
}

/* Executes a statement for the index `cell` of each cell in a range. */
#define FOR_CELLS(grid, from, to, cell)                                                          \
    for (int z_ = (from)[2]; z_ <= (to)[2]; z_++)                                                \
        for (int y_ = (from)[1]; y_ <= (to)[1]; y_++)                                            \
            for (int cell = (z_ * (grid)->side + y_) * (grid)->side + (from)[0], x_ = (from)[0]; \
                 x_ <= (to)[0]; x_++, cell++)

/* Computes the box of the triangles. */
static void measure_grid(triangle_grid *g, const triangle_list *list)
{
    for (int k = 0; k < 3; k++)
        g->low[k] = INFINITY, g->high[k] = -INFINITY;
    EBPO_FOR_ITEMS(g->workspace, i, 0, list->count) {
        double t[3][3];
        get_triangle(list, i, t);
        for (int c = 0; c < 3; c++)
            for (int k = 0; k < 3; k++) {
                g->low[k] = fmin(g->low[k], t[c][k]);
                g->high[k] = fmax(g->high[k], t[c][k]);
            }
    }
}

/* Divides the box of the triangles into side^3 cells. Returns how many entries the grid has. */
static uint64_t divide_grid(triangle_grid *g, const triangle_list *list, int side)
{
    int from[3], to[3];
    uint64_t entries = 0;
    g->side = side;
    for (int k = 0; k < 3; k++)
        g->step[k] = (g->high[k] - g->low[k]) / side;
    EBPO_FOR_ITEMS(g->workspace, i, 0, list->count) {
        triangle_range(g, list, i, from, to);
        entries += (uint64_t)(to[0] - from[0] + 1) * (uint64_t)(to[1] - from[1] + 1) *
                   (uint64_t)(to[2] - from[2] + 1);
    }
    return entries;
}

static void free_grid(triangle_grid *g)
{
    free(g->begin);
    ebpo_array_free(g->workspace, g->triangle);
}

/* Sorts the triangles into a grid. The grid has fewer cells if many triangles are long, so that its
 * size does not grow faster than the number of triangles. Returns false when out of memory. */
static bool make_grid(triangle_grid *g, const triangle_list *list, ebpo_workspace *workspace)
{
    int from[3], to[3];
    *g = (triangle_grid){ .workspace = workspace };
    measure_grid(g, list);
    int side = (int)fmin(SIDE_MAX, 1 + sqrt((double)list->count) / 2);
    while (divide_grid(g, list, side) > ENTRIES_MAX * list->count)
        side /= 2; /* with one cell, each triangle has one entry */
    uint64_t cells = (uint64_t)g->side * (uint64_t)g->side * (uint64_t)g->side;
    g->begin = ebpo_alloc_zero(cells + 2, sizeof *g->begin);
    if (!g->begin)
        return false;
    EBPO_FOR_ITEMS(workspace, i, 0, list->count) {
        triangle_range(g, list, i, from, to);
        FOR_CELLS(g, from, to, cell)
        g->begin[cell + 2]++;
    }
    for (uint64_t i = 2; i < cells + 2; i++)
        g->begin[i] += g->begin[i - 1];
    g->triangle = ebpo_array_alloc(workspace, g->begin[cells + 1], sizeof *g->triangle);
    if (!g->triangle)
        return false;
    EBPO_FOR_ITEMS(workspace, i, 0, list->count) {
        triangle_range(g, list, i, from, to);
        FOR_CELLS(g, from, to, cell)
        g->triangle[g->begin[cell + 1]++] = (uint32_t)i;
    }
    return true;
}

/* Decrements the number of visits. Returns false if it is 0. */
static bool take_visit(triangle_grid *g)
{
    g->visits -= g->visits > 0;
    return g->visits > 0;
}

/* Returns false if the point is certainly farther than `limit` from all triangles in a range of
 * cells; otherwise, or if no visits are left, returns true. Begins with the triangle that was near
 * the last point, because most points follow near ones. */
static bool is_near_cells(triangle_grid *g, const triangle_list *list, const double p[3],
                          double limit, const int from[3], const int to[3])
{
    FOR_CELLS(g, from, to, cell)
    {
        if (!take_visit(g))
            return true;
        uint64_t begin = g->begin[cell], end = g->begin[cell + 1],
                 i = g->near >= begin && g->near < end ? g->near : begin;
        for (uint64_t left = end - begin; left > 0; left--, i = i + 1 < end ? i + 1 : begin) {
            double t[3][3];
            ebpo_distance_bounds bounds;
            if (!take_visit(g))
                return true;
            get_triangle(list, g->triangle[i], t);
            ebpo_triangle_distance_bounds(p, (const double(*)[3])t, &bounds);
            if (bounds.lo <= limit) {
                g->near = i;
                return true;
            }
        }
    }
    return false;
}

/* Returns false if the point is certainly farther than `limit` from all triangles; otherwise, or if
 * no visits are left, returns true. */
static bool is_near(triangle_grid *g, const triangle_list *list, const double p[3], double limit)
{
    double low[3], high[3];
    int from[3], to[3];
    cell_range(g, p, p, from, to); /* most points have a triangle in their cell */
    if (is_near_cells(g, list, p, limit, from, to))
        return true;
    for (int k = 0; k < 3; k++) {
        low[k] = p[k] - limit;
        high[k] = p[k] + limit;
    }
    cell_range(g, low, high, from, to);
    return is_near_cells(g, list, p, limit, from, to);
}

/* Tests the corners and the centre of every `every`-th triangle of the list `of`. Returns how many
 * of these points are certainly farther than `limit` from all triangles of the list `from`. `g`:
 * grid of `from`. */
static uint64_t count_far(const triangle_list *of, uint64_t every, triangle_grid *g,
                          const triangle_list *from, double limit)
{
    uint64_t far = 0;
    g->visits = VISITS_MAX * (of->count + from->count);
    for (uint64_t i = 0; i < of->count && g->visits; i += every) {
        double t[3][3], centre[3];
        get_triangle(of, i, t);
        for (int k = 0; k < 3; k++)
            centre[k] = t[0][k] / 3 + t[1][k] / 3 + t[2][k] / 3;
        for (int k = 0; k < 3; k++)
            far += !is_near(g, from, t[k], limit);
        far += !is_near(g, from, centre, limit);
    }
    return far;
}

/* Checks the error of a patch. */
static ebpo_status check_error(ebpo_tally *tally, const ebpo_tree *tree, uint64_t index,
                               ebpo_workspace *workspace, ebpo_error *error)
{
    ebpo_patch patch;
    ebpo_status status = ebpo_surface_decode(&tree->surface, &tree->info, index, &patch, error);
    if (status != EBPO_OK)
        return status;
    triangle_list replacement = { .count = patch.triangle_count, .patch = &patch }, faces = {
        .count = patch.face_count, .mesh = &tree->mesh, .first = patch.first_face
    };
    triangle_grid of_replacement = { 0 }, of_faces = { 0 };
    if (make_grid(&of_replacement, &replacement, NULL) && make_grid(&of_faces, &faces, workspace)) {
        uint64_t far = count_far(&replacement, 1, &of_faces, &faces, patch.error) +
                       count_far(&faces, 1 + patch.face_count / SAMPLED_FACES, &of_replacement,
                                 &replacement, patch.error);
        CHECK(far == 0,
              "surface: octcode %" PRIu64 ": %" PRIu64 " points are farther than the error %.9g",
              tree->surface.patch[EBPO_PATCH_COLUMNS * index + EBPO_PATCH_OCTCODE], far,
              patch.error);
    } else {
        status = ebpo_workspace_fail(workspace, patch.face_count * 16, error);
    }
    free_grid(&of_replacement);
    free_grid(&of_faces);
    ebpo_patch_free(&patch);
    return status;
}

ebpo_status ebpo_check_patches(ebpo_tally *tally, const ebpo_tree *tree, ebpo_workspace *workspace,
                               ebpo_error *error)
{
    node_walk w = { .tally = tally, .tree = tree };
    const ebpo_surface *s = &tree->surface;
    if (!(tree->info.parts & EBPO_PART_SURFACE) || !(tree->info.parts & EBPO_PART_MESH) ||
        tree->info.pruned)
        return EBPO_OK;
    bool of_root = visit_node(&w, 1, ebpo_group_type(tree->level[0].types[0], 0));
    CHECK(of_root, "surface: the root has no patch");
    CHECK(w.found == s->patch_count,
          "surface: %" PRIu64 " of %" PRIu64 " patches are of nodes that are not in the tree",
          s->patch_count - w.found, s->patch_count);
    ebpo_status status = EBPO_OK;
    bool assigned = w.wrong == 0 && w.found == s->patch_count;
    for (uint64_t i = 0; assigned && i < s->patch_count && status == EBPO_OK; i++)
        status = check_error(tally, tree, i, workspace, error);
    return status;
}
