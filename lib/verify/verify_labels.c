/* Verifies labels, which are the winding numbers of cells, in two independent ways:
 *
 * - By links, for all cells. A point must have the same winding number in all cells of which it is
 *   a corner. All corners of a cell without faces have the cell's winding number. A leaf stores
 *   the winding number of its lowest corner; the winding numbers of its other corners follow from
 *   signed crossings of faces with the cell's edges. The 64 corners of a gray node's eight
 *   children are 27 different points. The corners of the root have the winding number 0. These
 *   links connect every cell to the root. So all winding numbers are correct if no link is
 *   violated and the leaves list all their faces (verify_lists.c).
 * - By rays through the whole mesh, for all cells or an evenly spread sample of the cells. The
 *   points are sorted into columns along x, and each face is tested against the points in its
 *   columns. So faces are read once, in their order, and only the points are in memory. */
#include "core/strict_fp.h"

#include <inttypes.h>
#include <stdlib.h>
#include <string.h>

#include "core/alloc.h"
#include "core/error.h"
#include "core/parallel.h"
#include "core/wide.h"
#include "core/workspace.h"
#include "verify/verify_labels.h"
#include "verify/verify_geometry.h"

/* --- rays --- */

enum {
    SIDE_MAX = 2048,     /* greatest number of columns along y and along z */
    FACE_GRAIN = 1 << 14 /* number of faces for each call of a thread's function */
};

/* Columns of points along x. A column is a cell of a grid in y and z. */
typedef struct columns {
    const ebpo_mesh *mesh;
    double low[2], scale[2]; /* [y, z] least coordinate of the box; reciprocal of the box's side */
    uint64_t side;           /* number of columns along y and along z */
    uint64_t *first;         /* [side * side + 1] index in `point` of each column's first point */
    ebpo_ray_point *point;   /* the points, column after column */
} columns;

bool ebpo_rays_add(ebpo_ray_points *points, const ebpo_ray_point *point)
{
    if (!ebpo_array_grow(points->workspace, &points->point, &points->capacity, points->count + 1,
                         sizeof *points->point))
        return false;
    points->point[points->count++] = *point;
    return true;
}

static columns grid_for(const ebpo_mesh *mesh, const ebpo_box *box, uint64_t count)
{
    columns c = { .mesh = mesh, .side = 1 };
    while (c.side < SIDE_MAX && c.side * c.side * 2 < count)
        c.side *= 2;
    for (int i = 0; i < 2; i++) {
        c.low[i] = box->origin[i + 1];
        c.scale[i] = 1 / box->size[i + 1];
    }
    return c;
}

/* Returns the position in the grid of columns for a coordinate x, which is a y coordinate if i is 0
 * and a z coordinate if i is 1. The function is monotone, so a point within a face's range of
 * coordinates is also within the face's range of columns. */
static uint64_t column_of(const columns *c, int i, double x)
{
    double at = (x - c->low[i]) * c->scale[i] * (double)c->side;
    return at >= (double)c->side ? c->side - 1 : at > 0 ? (uint64_t)at : 0;
}

static uint64_t column_of_point(const columns *c, const ebpo_ray_point *p)
{
    return column_of(c, 1, p->at[2]) * c->side + column_of(c, 0, p->at[1]);
}

/* A range of columns: positions from[0] .. to[0] in y, and from[1] .. to[1] in z. */
typedef struct column_range {
    uint64_t from[2], to[2];
} column_range;

static column_range columns_of_face(const columns *c, const ebpo_corners *face)
{
    column_range range;
    for (int i = 0; i < 2; i++) {
        double low = face->at[0][i + 1], high = low;
        for (int j = 1; j < 3; j++) {
            double x = face->at[j][i + 1];
            low = x < low ? x : low;
            high = x > high ? x : high;
        }
        range.from[i] = column_of(c, i, low);
        range.to[i] = column_of(c, i, high);
    }
    return range;
}

/* Sorts the points by column. */
static ebpo_status sort_points(columns *c, ebpo_ray_points *points, ebpo_error *error)
{
    uint64_t cells = c->side * c->side;
    ebpo_ray_point *sorted = ebpo_array_alloc(points->workspace, points->count, sizeof *sorted);
    c->first = ebpo_alloc_zero(cells + 1, sizeof *c->first);
    if (!sorted || !c->first) {
        ebpo_array_free(points->workspace, sorted);
        return ebpo_workspace_fail(points->workspace, points->count * sizeof *sorted, error);
    }
    EBPO_FOR_ITEMS(points->workspace, i, 0, points->count)
        c->first[column_of_point(c, &points->point[i])]++;
    for (uint64_t i = 0, sum = 0; i <= cells; i++) {
        uint64_t in_column = c->first[i];
        c->first[i] = sum;
        sum += in_column;
    }
    EBPO_FOR_ITEMS_SCATTERED(points->workspace, i, 0, points->count)
        sorted[c->first[column_of_point(c, &points->point[i])]++] = points->point[i];
    /* each element of `first` has been advanced to the start of the next column */
    memmove(c->first + 1, c->first, cells * sizeof *c->first);
    c->first[0] = 0;
    ebpo_array_free(points->workspace, points->point);
    points->point = c->point = sorted;
    points->capacity = points->count;
    return EBPO_OK;
}

/* Adds a face's contributions to `found` of the points begin .. end - 1. Several threads may update
 * the same point. */
static void count_hits(const columns *c, const ebpo_corners *face, uint64_t begin, uint64_t end)
{
    for (uint64_t i = begin; i < end; i++) {
        int hit = ebpo_ray_hit(c->point[i].at, 0, face);
        if (hit)
            __atomic_fetch_add(&c->point[i].found, hit, __ATOMIC_RELAXED);
    }
}

/* Tests each face of the range against the points in its columns. */
static ebpo_status follow_faces(void *context, uint64_t begin, uint64_t end, unsigned worker,
                                ebpo_error *error)
{
    const columns *c = context;
    (void)worker;
    (void)error;
    /* number of visited rows of columns; points of different rows are far apart in memory */
    uint64_t rows = 0;
    for (uint64_t f = begin; f < end; f++) {
        ebpo_corners face;
        ebpo_face_corners(c->mesh, f, &face);
        column_range r = columns_of_face(c, &face);
        /* the points of columns with the same z are adjacent */
        for (uint64_t z = r.from[1]; z <= r.to[1]; z++) {
            count_hits(c, &face, c->first[z * c->side + r.from[0]],
                       c->first[z * c->side + r.to[0] + 1]);
            if (++rows % EBPO_ITEMS_SCATTERED == 0)
                ebpo_release_pages(c->mesh->workspace);
        }
    }
    return EBPO_OK;
}

ebpo_status ebpo_rays_follow(ebpo_ray_points *points, const ebpo_mesh *mesh, const ebpo_box *box,
                             unsigned threads, const ebpo_progress *progress, ebpo_error *error)
{
    columns c = grid_for(mesh, box, points->count);
    ebpo_status status = sort_points(&c, points, error);
    EBPO_FOR_ITEMS(points->workspace, i, 0, status == EBPO_OK ? points->count : 0)
        c.point[i].found = 0;
    if (status == EBPO_OK)
        status = ebpo_parallel_for(threads, mesh->workspace, mesh->face_count, FACE_GRAIN,
                                   follow_faces, &c, progress, "following rays", error);
    free(c.first);
    return status;
}

/* Estimates how many tests of a face against a point are needed, if `count` points are spread
 * evenly over the box. */
static double rays_work(const ebpo_mesh *mesh, const ebpo_box *box, uint64_t count)
{
    columns c = grid_for(mesh, box, count);
    uint64_t covered = 0; /* number of columns of each face, added up over all faces */
    EBPO_FOR_ITEMS(mesh->workspace, f, 0, mesh->face_count) {
        ebpo_corners face;
        ebpo_face_corners(mesh, f, &face);
        column_range r = columns_of_face(&c, &face);
        covered += (r.to[0] - r.from[0] + 1) * (r.to[1] - r.from[1] + 1);
    }
    return (double)covered * (double)count / (double)(c.side * c.side);
}

/* --- selection of the cells to check by rays --- */

/* Default number of cells to check by rays: all cells if there are at most CELLS_ALL cells,
 * otherwise SAMPLES_MANY. If checking this number of cells would take too long, the default is
 * SAMPLES_LEAST. */
enum { SAMPLES_LEAST = 4096, SAMPLES_MANY = 1 << 20, CELLS_ALL = 1 << 22 };
/* Maximum number of tests of a face against a point; more tests would take more than some seconds.
 */
static const double ray_work_affordable = 4e8;

static uint64_t default_samples(const ebpo_reference_tree *view, uint64_t cells)
{
    uint64_t samples = cells <= CELLS_ALL ? cells : SAMPLES_MANY;
    return rays_work(&view->tree->mesh, &view->box, samples) <= ray_work_affordable ? samples
                                                                                    : SAMPLES_LEAST;
}

void ebpo_label_plan_make(ebpo_label_plan *plan, const ebpo_reference_tree *view, uint64_t samples)
{
    uint64_t all = 0, classes = 0;
    for (int l = 0; l < view->tree->info.level_count; l++) {
        const ebpo_level *level = &view->tree->level[l];
        plan->cells[l][EBPO_WHITE] = level->white_count;
        plan->cells[l][EBPO_BLACK] = level->black_count;
        plan->cells[l][EBPO_LEAF] = level->leaf_count;
        plan->cells[l][EBPO_GRAY] = 0;
        for (int type = 0; type < EBPO_GRAY; type++) {
            all += plan->cells[l][type];
            classes += plan->cells[l][type] > 0;
        }
    }
    if (samples == 0)
        samples = default_samples(view, all);
    /* A class consists of the cells of one level and one type. Half of the samples are distributed
     * evenly to the classes, so that small levels are included. The other half is distributed in
     * proportion to the number of cells. */
    for (int l = 0; l < view->tree->info.level_count; l++)
        for (int type = 0; type <= EBPO_GRAY; type++) {
            uint64_t cells = plan->cells[l][type];
            uint64_t share =
                cells == 0
                    ? 0
                    : samples / (2 * classes) +
                          (uint64_t)((double)samples / 2 * ((double)cells / (double)all)) + 1;
            plan->take[l][type] = samples >= all || share > cells ? cells : share;
        }
}

/* Returns true if the node's rank is one of the `take` selected ranks, which are evenly spread over
 * the `cells` ranks of its level and type. */
static bool is_planned(const ebpo_label_plan *plan, const ebpo_reference_node *node)
{
    uint64_t cells = plan->cells[node->cell.level][node->type],
             take = plan->take[node->cell.level][node->type];
    if (take >= cells)
        return true;
    /* true if (rank + 1) * take / cells and rank * take / cells, rounded down, are different */
    return ebpo_wide_modulo(ebpo_wide_product(node->rank, take), cells) >= cells - take;
}

/* --- corners and links --- */

static void corner_position(const ebpo_frame *frame, unsigned corner, double out[3])
{
    for (int k = 0; k < 3; k++)
        out[k] = corner >> k & 1 ? frame->high[k] : frame->low[k];
}

/* Seven edges of a cell that connect all corners to corner 0: the corners at both ends of the edge,
 * and its axis. */
static const struct {
    unsigned char from, to, axis;
} edge_tree[7] = { { 0, 1, 0 }, { 0, 2, 1 }, { 0, 4, 2 }, { 2, 3, 0 },
                   { 4, 5, 0 }, { 4, 6, 1 }, { 6, 7, 0 } };

/* Adds to change[e] by how much a face changes the winding number along edge e of edge_tree. */
static void add_crossings(int64_t change[7], const ebpo_frame *frame, const ebpo_corners *face)
{
    for (int e = 0; e < 7; e++) {
        double from[3], to[3];
        corner_position(frame, edge_tree[e].from, from);
        corner_position(frame, edge_tree[e].to, to);
        change[e] +=
            ebpo_ray_hit(to, edge_tree[e].axis, face) - ebpo_ray_hit(from, edge_tree[e].axis, face);
    }
}

void ebpo_terminal_windings(ebpo_node_windings *out, const ebpo_reference_tree *view,
                            const ebpo_reference_node *node, const ebpo_frame *frame,
                            const uint32_t *faces, uint64_t count)
{
    int64_t first = ebpo_reference_winding(view, node), change[7] = { 0 };
    for (int i = 0; i < 8; i++)
        out->at[i] = first;
    out->known = node->type == EBPO_LEAF && !view->has_mesh ? 1 : 255;
    if (node->type != EBPO_LEAF || !view->has_mesh)
        return;
    EBPO_FOR_ITEMS_SCATTERED(view->workspace, i, 0, count) {
        ebpo_corners face;
        ebpo_face_corners(&view->tree->mesh, faces[i], &face);
        add_crossings(change, frame, &face);
    }
    for (int e = 0; e < 7; e++)
        out->at[edge_tree[e].to] = out->at[edge_tree[e].from] + change[e];
}

void ebpo_check_terminal_label(ebpo_tally *tally, const ebpo_reference_tree *view,
                               const ebpo_reference_node *node)
{
    if (node->type == EBPO_LEAF)
        return;
    int64_t stored = ebpo_reference_winding(view, node);
    tally->checks[EBPO_VERIFY_LABELS]++;
    if (ebpo_reference_inside(view, stored) != (node->type == EBPO_BLACK))
        ebpo_tally_violation(tally, EBPO_VERIFY_LABELS,
                             &(ebpo_verify_place){ node->code, EBPO_NO_FACE, EBPO_NO_PLANE },
                             "%s, but winding number %" PRId64 " is %s by the file's rule",
                             node->type == EBPO_BLACK ? "black" : "white", stored,
                             node->type == EBPO_BLACK ? "outside" : "inside");
}

bool ebpo_label_note(ebpo_ray_points *points, const ebpo_reference_tree *view,
                     const ebpo_reference_node *node, const ebpo_frame *frame,
                     const ebpo_label_plan *plan)
{
    if (!is_planned(plan, node))
        return true;
    ebpo_ray_point p = { { frame->low[0], frame->low[1], frame->low[2] },
                         node->code,
                         ebpo_reference_winding(view, node),
                         0 };
    return ebpo_rays_add(points, &p);
}

void ebpo_check_rays(ebpo_tally *tally, const ebpo_ray_points *points)
{
    tally->checks[EBPO_VERIFY_LABELS] += points->count;
    EBPO_FOR_ITEMS(points->workspace, i, 0, points->count) {
        const ebpo_ray_point *p = &points->point[i];
        if (p->found != p->stored)
            ebpo_tally_violation(tally, EBPO_VERIFY_LABELS,
                                 &(ebpo_verify_place){ p->octcode, EBPO_NO_FACE, EBPO_NO_PLANE },
                                 "winding number %" PRId64
                                 " is stored, but a ray through the mesh finds %" PRId64,
                                 p->stored, p->found);
    }
}

/* Returns the number, 0 to 26, of the point at a corner of a child. A corner of several children
 * has one number. */
static int shared_point(unsigned octant, unsigned corner)
{
    int point = 0, step = 1;
    for (int k = 0; k < 3; k++, step *= 3)
        point += step * (int)((octant >> k & 1) + (corner >> k & 1));
    return point;
}

void ebpo_check_links(ebpo_tally *tally, const ebpo_reference_node *node,
                      const ebpo_node_windings children[8], ebpo_node_windings *out)
{
    int64_t value[27];
    bool known[27] = { false };
    *out = (ebpo_node_windings){ { 0 }, 0 };
    for (unsigned octant = 0; octant < 8; octant++)
        for (unsigned corner = 0; corner < 8; corner++) {
            int point = shared_point(octant, corner);
            if (!(children[octant].known >> corner & 1))
                continue;
            int64_t winding = children[octant].at[corner];
            tally->checks[EBPO_VERIFY_LABELS] += known[point];
            if (known[point] && value[point] != winding) {
                ebpo_verify_place place = { ebpo_octcode_child(node->code, octant), EBPO_NO_FACE,
                                            EBPO_NO_PLANE };
                ebpo_tally_violation(tally, EBPO_VERIFY_LABELS, &place,
                                     "winding number %" PRId64
                                     " at corner %u, but a neighbour has %" PRId64
                                     " for the same point",
                                     winding, corner, value[point]);
            }
            if (!known[point])
                value[point] = winding;
            known[point] = true;
        }
    for (unsigned i = 0; i < 8; i++)
        if (children[i].known >> i & 1) {
            out->at[i] = children[i].at[i];
            out->known |= 1u << i;
        }
}

void ebpo_check_root_corners(ebpo_tally *tally, const ebpo_node_windings *root)
{
    for (unsigned i = 0; i < 8; i++) {
        if (!(root->known >> i & 1))
            continue;
        tally->checks[EBPO_VERIFY_LABELS]++;
        if (root->at[i] != 0)
            ebpo_tally_violation(tally, EBPO_VERIFY_LABELS,
                                 &(ebpo_verify_place){ 1, EBPO_NO_FACE, EBPO_NO_PLANE },
                                 "corner %u of the root cell has winding number %" PRId64
                                 ", but is outside",
                                 i, root->at[i]);
    }
}

unsigned ebpo_windings_inside(const ebpo_reference_tree *view, const ebpo_node_windings *corners)
{
    unsigned inside = 0;
    for (unsigned i = 0; i < 8; i++)
        inside |=
            (unsigned)((corners->known >> i & 1) && ebpo_reference_inside(view, corners->at[i]))
            << i;
    return inside;
}
