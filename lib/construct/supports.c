/* Computes the support of the solid in a cell: the greatest n . xi over the mesh vertices in the
 * cell, the points where the mesh crosses cell faces, the corners of the cell that are inside the
 * solid, and, for a surface with holes, the corners of cap cells (capped.h). The support is the
 * offset of a plane with normal n.
 *
 * If there are few vertices, all points are gathered, each once, and searched in stretches (32
 * consecutive points that share a box, sweep.h). If there are many vertices, only crossings and
 * corners are gathered. Then the vertices are searched by a hierarchy of boxes around ranges of
 * vertices along the Morton curve. The bound of a box is computed by the same operations in the
 * same order as the values of points, and rounding is monotone. So the bound is never less than the
 * value of a point in the box, and no search skips the greatest point. A search stops early when
 * the support is so large that the plane would not be worth storing. */
#include "core/strict_fp.h"

#include <stdlib.h>
#include <string.h>

#include "construct/capped.h"
#include "construct/construct_stages.h"
#include "construct/supports.h"
#include "core/alloc.h"
#include "core/error.h"
#include "core/hash.h"
#include "geometry/cells.h"
#include "geometry/polytope.h"

/* --- boxes around ranges of vertices, and boxes around boxes --- */

/* Enlarges a box so that it contains another box. */
static void join_box(double (*box)[3], const double low[3], const double high[3])
{
    for (int k = 0; k < 3; k++) {
        box[0][k] = low[k] < box[0][k] ? low[k] : box[0][k];
        box[1][k] = high[k] > box[1][k] ? high[k] : box[1][k];
    }
}

ebpo_status ebpo_bounds_make(ebpo_builder *b, ebpo_error *error)
{
    ebpo_bounds *bounds = &b->bounds;
    uint64_t below = b->vertex_count;
    for (int level = 0; level < EBPO_BOUNDS_LEVELS && below > 1; level++) {
        uint64_t n = (below + EBPO_BOUNDS_FAN - 1) / EBPO_BOUNDS_FAN;
        double(*box)[2][3] = ebpo_array_alloc(b->workspace, n, sizeof *box);
        if (!box)
            return ebpo_workspace_fail(b->workspace, n * sizeof *box, error);
        bounds->box[level] = box;
        bounds->count[level] = n;
        bounds->levels = level + 1;
        EBPO_FOR_ITEMS(b->workspace, i, 0, below) {
            double p[3], *low = level ? bounds->box[level - 1][i][0] : p,
                         *high = level ? bounds->box[level - 1][i][1] : p;
            if (level == 0)
                ebpo_mesh_position(b->mesh, i, p);
            if (i % EBPO_BOUNDS_FAN == 0) {
                memcpy(box[i / EBPO_BOUNDS_FAN][0], low, sizeof p);
                memcpy(box[i / EBPO_BOUNDS_FAN][1], high, sizeof p);
            } else
                join_box(box[i / EBPO_BOUNDS_FAN], low, high);
        }
        below = n;
    }
    return EBPO_OK;
}

void ebpo_bounds_free(ebpo_bounds *bounds)
{
    for (int i = 0; i < bounds->levels; i++)
        ebpo_array_free(bounds->workspace, bounds->box[i]);
    bounds->levels = 0;
}

/* A search, among the vertices begin .. end - 1, for the vertex with the greatest n . x. */
typedef struct vertex_search {
    const ebpo_builder *b;
    double corner[3], size[3]; /* lowest corner and size of the cell */
    double n[3];
    uint64_t begin, end;
    double best;          /* greatest value so far */
    uint64_t best_vertex; /* vertex with this value; EBPO_NO_VERTEX: none */
} vertex_search;

/* Returns the greatest n . x in a box, where x is in cell coordinates. `low`, `high`: the box in
 * the model's coordinates. */
static double bound_value(const vertex_search *q, const double low[3], const double high[3])
{
    double x = (q->n[0] < 0 ? low[0] : high[0]), y = (q->n[1] < 0 ? low[1] : high[1]),
           z = (q->n[2] < 0 ? low[2] : high[2]);
    return q->n[0] * ((x - q->corner[0]) / q->size[0]) +
           q->n[1] * ((y - q->corner[1]) / q->size[1]) +
           q->n[2] * ((z - q->corner[2]) / q->size[2]);
}

/* Searches a block of 16^level consecutive vertices. At level 0, `block` is the index of a vertex.
 */
static void visit_block(vertex_search *q, int level, uint64_t block)
{
    uint64_t width = 1;
    for (int i = 0; i < level; i++)
        width *= EBPO_BOUNDS_FAN;
    if (block * width >= q->end || (block + 1) * width <= q->begin)
        return;
    if (level == 0) {
        double p[3];
        ebpo_mesh_position(q->b->mesh, block, p);
        double v = bound_value(q, p, p);
        if (v > q->best) {
            q->best = v;
            q->best_vertex = block;
        }
        return;
    }
    const double(*box)[3] = (const double(*)[3])q->b->bounds.box[level - 1][block];
    if (bound_value(q, box[0], box[1]) <= q->best)
        return;
    uint64_t below = level > 1 ? q->b->bounds.count[level - 2] : q->b->vertex_count;
    for (uint64_t i = block * EBPO_BOUNDS_FAN; i < (block + 1) * EBPO_BOUNDS_FAN && i < below; i++)
        visit_block(q, level - 1, i);
}

/* Returns the greatest n . x over the vertices begin .. end - 1 in cell coordinates, but at least
 * `least`. Sets *vertex to the vertex with this value, or to EBPO_NO_VERTEX if no value exceeds
 * `least`. */
static double bounds_support(const ebpo_builder *b, ebpo_cell cell, const double n[3],
                             uint64_t begin, uint64_t end, double least, uint64_t *vertex)
{
    vertex_search q = {
        .b = b, .begin = begin, .end = end, .best_vertex = EBPO_NO_VERTEX, .best = least
    };
    for (int k = 0; k < 3; k++) {
        q.corner[k] = ebpo_cell_face(&b->box, k, cell.level, cell.at[k]);
        q.size[k] = b->box.size[k] / (double)(1u << cell.level);
        q.n[k] = n[k];
    }
    /* start at the deepest level at which the range still has few blocks */
    int level = 0;
    uint64_t width = 1;
    while (level < b->bounds.levels && width * EBPO_BOUNDS_FAN <= end - begin) {
        width *= EBPO_BOUNDS_FAN;
        level++;
    }
    if (begin < end)
        for (uint64_t block = begin / width; block * width < end; block++)
            visit_block(&q, level, block);
    *vertex = q.best_vertex;
    return q.best;
}

/* Returns the number of keys below `limit`; the keys are ascending. */
static uint64_t lower_bound(const uint64_t *key, uint64_t count, uint64_t limit)
{
    uint64_t low = 0;
    while (count) {
        uint64_t half = count / 2;
        if (key[low + half] < limit) {
            low += half + 1;
            count -= half + 1;
        } else
            count = half;
    }
    return low;
}

void ebpo_build_vertex_range(const ebpo_builder *b, ebpo_cell cell, uint64_t *begin, uint64_t *end)
{
    ebpo_octcode code = ebpo_octcode_of_cell(cell);
    int below = 3 * (b->box.grid_level - cell.level);
    *begin = lower_bound(b->key, b->vertex_count, code << below);
    *end = *begin + lower_bound(b->key + *begin, b->vertex_count - *begin, (code + 1) << below);
}

/* --- the points of a node --- */

/* FEW_VERTICES: if a node has more vertices, they are not gathered but searched by boxes.
 * TABLE_MAX: maximum size of the hash table. MANY_POINTS: if there are more points, pages of the
 * workspace are released before a search. */
enum { FEW_VERTICES = 4096, TABLE_MAX = 1 << 16, MANY_POINTS = 1 << 15 };

/* Returns true if point i has the coordinates x. */
static bool is_point(const ebpo_supports *s, unsigned i, const double x[3])
{
    const double(*p)[4] = (const double(*)[4])s->point[i / 4];
    return p[0][i % 4] == x[0] && p[1][i % 4] == x[1] && p[2][i % 4] == x[2];
}

/* Returns the hash of a point's coordinates. One round of mixing is enough for three numbers whose
 * bits are at different positions, and takes a third of the time of ebpo_hash_three. */
static uint64_t hash_point(const double x[3])
{
    uint64_t bits[3];
    memcpy(bits, x, sizeof bits);
    return ebpo_hash_number(bits[0] + (bits[1] << 21 | bits[1] >> 43) +
                            (bits[2] << 42 | bits[2] >> 22));
}

/* Returns true if there is a point with the coordinates x, and raises the error bound of this point
 * to at least `error`. Otherwise returns false and enters the index of the next point in the table;
 * then the caller must add this point. If the table is half full, returns false and enters nothing.
 */
static bool known_point(ebpo_supports *s, const double x[3], double error)
{
    uint64_t at;
    if (s->count >= s->table_size / 2)
        return false;
    EBPO_HASH_FIND(at, hash_point(x), s->table_size - 1,
                   !s->table[at] || is_point(s, s->table[at] - 1u, x));
    if (!s->table[at]) {
        s->table[at] = (uint16_t)(s->count + 1);
        return false;
    }
    unsigned i = s->table[at] - 1u, lane = i % 4;
    double(*p)[4] = s->point[i / 4];
    p[3][lane] = error > p[3][lane] ? error : p[3][lane];
    /* the lanes after the last point are copies of lane 0 */
    for (unsigned copy = lane ? 4 : (unsigned)(s->count - i); copy < 4; copy++)
        p[3][copy] = p[3][0];
    return true;
}

/* Adds a point. If there is an equal point already, only raises the error bound of that point.
 * `slack`: upper bound of the rounding errors of its coordinates. Returns false when out of memory.
 */
static bool add_point(ebpo_supports *s, const double x[3], double slack)
{
    if (!ebpo_array_grow_late(s->workspace, &s->point, &s->capacity, s->count / 4 + 1,
                              sizeof *s->point))
        return false;
    if (known_point(s, x, EBPO_NORMAL_NORM * slack))
        return true;
    double(*p)[4] = s->point[s->count / 4],
    values[4] = { x[0], x[1], x[2], EBPO_NORMAL_NORM * slack };
    unsigned point_lane = s->count % 4;
    /* the other lanes of a group of four are copies of lane 0 until they are set */
    for (int k = 0; k < 4; k++)
        for (unsigned lane = point_lane; lane < (point_lane ? point_lane + 1 : 4); lane++)
            p[k][lane] = values[k];
    s->count++;
    return true;
}

/* Adds the vertices begin .. end - 1. Returns false when out of memory. */
static bool add_vertices(ebpo_supports *s, uint64_t begin, uint64_t end)
{
    const ebpo_builder *b = s->b;
    double corner[3], size[3];
    for (int k = 0; k < 3; k++) {
        corner[k] = ebpo_cell_face(&b->box, k, s->cell.level, s->cell.at[k]);
        size[k] = b->box.size[k] / (double)(1u << s->cell.level);
    }
    for (uint64_t i = begin; i < end; i++) {
        double p[3];
        ebpo_mesh_position(b->mesh, i, p);
        /* the error bound is 0, because the rounding errors of the subtraction and the division,
         * for values up to 1, are far below the margin of ebpo_plane_code_offset */
        if (!add_point(s,
                       (const double[3]){ (p[0] - corner[0]) / size[0],
                                          (p[1] - corner[1]) / size[1],
                                          (p[2] - corner[2]) / size[2] },
                       0))
            return false;
    }
    return true;
}

/* Adds the crossings: for each face that crosses a cell face, the corners of its part in the cell.
 * Returns false when out of memory. */
static bool add_crossings(ebpo_supports *s, const ebpo_branch *branch, const ebpo_build_detail *d)
{
    /* number of faces after which pages of the workspace are released; smaller for the top, whose
     * faces are on many different pages */
    const uint64_t release_faces = branch->list ? 1024 : 32;
    EBPO_FOR_ITEMS_EVERY(s->workspace, release_faces, i, d->cross_begin, d->cross_end) {
        ebpo_triangle face;
        double points[9][3], slack;
        ebpo_branch_triangle(s->b, branch, branch->crossing[i], &face);
        int count = ebpo_clip_triangle(&s->b->box, s->cell, &face, points, &slack);
        for (int p = 0; p < count; p++)
            if (!add_point(s, points[p], slack))
                return false;
    }
    return true;
}

/* Clears the hash table, and chooses its size for about `points` points. Returns false when out of
 * memory. */
static bool clear_table(ebpo_supports *s, uint64_t points)
{
    uint64_t size = ebpo_hash_slots(2 * points < TABLE_MAX ? 2 * points : TABLE_MAX);
    s->table_size = size;
    if (!ebpo_array_grow_late(s->workspace, &s->table, &s->table_capacity, size, sizeof *s->table))
        return false;
    memset(s->table, 0, size * sizeof *s->table);
    return true;
}

/* Adds a corner of a cap cell (ebpo_capped_corners). */
static bool add_corner(void *context, const double x[3]) { return add_point(context, x, 0); }

/* Does the work of ebpo_supports_gather, except for the boxes of the stretches. */
static bool gather_points(ebpo_supports *s, const ebpo_builder *b, const ebpo_branch *branch,
                          const ebpo_build_detail *detail, ebpo_cell cell, int32_t winding)
{
    uint64_t begin, end;
    ebpo_build_vertex_range(b, cell, &begin, &end);
    s->b = b;
    s->workspace = b->workspace;
    s->cell = cell;
    s->sweep = ebpo_sweep_best();
    s->count = 0;
    bool few = end - begin <= FEW_VERTICES;
    if (!clear_table(s,
                     8 + (few ? end - begin : 0) + 2 * (detail->cross_end - detail->cross_begin)))
        return false;
    s->begin = few ? 0 : begin;
    s->end = few ? 0 : end;
    /* Corners come first: they have great values, so searches along directions of useless planes
     * stop early. */
    ebpo_cap_overlap overlap = b->capped ? ebpo_capped_overlap(b->capped, cell) : EBPO_CAP_NONE;
    unsigned corners =
        overlap == EBPO_CAP_WHOLE ? 0xff : ebpo_inside_corners(b, winding, detail->delta);
    for (int i = 0; i < 8; i++)
        if (corners >> i & 1 &&
            !add_point(s, (const double[3]){ i & 1, i >> 1 & 1, i >> 2 & 1 }, 0))
            return false;
    if (overlap == EBPO_CAP_PART && !ebpo_capped_corners(b->capped, cell, add_corner, s))
        return false;
    return (!few || add_vertices(s, begin, end)) && add_crossings(s, branch, detail);
}

/* Sets `where` to the point with the value `best` in the stretch that begins with point `first`. */
static void locate_point(const ebpo_supports *s, uint64_t first, const double n[3], double best,
                         double where[3])
{
    for (uint64_t i = first; i < s->count && i < first + 4 * EBPO_STRETCH; i++) {
        double(*p)[4] = s->point[i / 4];
        unsigned lane = i % 4;
        if (n[0] * p[0][lane] + n[1] * p[1][lane] + n[2] * p[2][lane] + p[3][lane] == best) {
            for (int k = 0; k < 3; k++)
                where[k] = p[k][lane];
            return;
        }
    }
}

/* Raises *support to the maximum over the gathered points. If *support was raised, sets `where` to
 * the point of the maximum. */
static void among_points(const ebpo_supports *s, const double n[3], double enough, double *support,
                         double where[3])
{
    if (s->count > MANY_POINTS)
        ebpo_release_pages(s->workspace);
    const ebpo_sweep_points points = { (const double(*)[4][4])s->point, (const double(*)[7])s->box,
                                       (s->count + 3) / 4 };
    uint64_t stretch = s->sweep->highest(&points, n, enough, support);
    if (stretch != UINT64_MAX)
        locate_point(s, stretch, n, *support, where);
}

/* Makes the boxes of the stretches of points. Returns false when out of memory. */
static bool box_points(ebpo_supports *s)
{
    uint64_t fours = (s->count + 3) / 4;
    if (!ebpo_array_grow_late(s->workspace, &s->box, &s->box_capacity, fours / EBPO_STRETCH + 1,
                              sizeof *s->box))
        return false;
    for (uint64_t i = 0; i < fours; i++) {
        double *box = s->box[i / EBPO_STRETCH];
        for (int lane = 0; lane < 4; lane++) {
            double(*p)[4] = s->point[i];
            bool first = i % EBPO_STRETCH == 0 && lane == 0;
            for (int k = 0; k < 3; k++) {
                box[k] = first || p[k][lane] < box[k] ? p[k][lane] : box[k];
                box[3 + k] = first || p[k][lane] > box[3 + k] ? p[k][lane] : box[3 + k];
            }
            box[6] = first || p[3][lane] > box[6] ? p[3][lane] : box[6];
        }
    }
    return true;
}

bool ebpo_supports_gather(ebpo_supports *s, const ebpo_builder *b, const ebpo_branch *branch,
                          const ebpo_build_detail *detail, ebpo_cell cell, int32_t winding)
{
    return gather_points(s, b, branch, detail, cell, winding) && box_points(s);
}

double ebpo_supports_find(const ebpo_supports *s, const int32_t n[3], double enough,
                          double where[3])
{
    return ebpo_supports_find_from(s, n, enough, NULL, 0, where);
}

double ebpo_supports_find_from(const ebpo_supports *s, const int32_t normal[3], double enough,
                               const double (*known)[3], int known_count, double where[3])
{
    double n[3] = { normal[0], normal[1], normal[2] }, support = -1e300;
    for (int i = 0; i < known_count; i++) {
        double value = n[0] * known[i][0] + n[1] * known[i][1] + n[2] * known[i][2];
        if (value > support) {
            support = value;
            memcpy(where, known[i], 3 * sizeof *where);
        }
    }
    among_points(s, n, enough, &support, where);
    if (s->begin >= s->end || support >= enough)
        return support;
    /* the vertices are so many that their pages are in different parts of the workspace's files */
    ebpo_release_pages(s->workspace);
    uint64_t vertex;
    double p[3] = { 0, 0, 0 };
    support = bounds_support(s->b, s->cell, n, s->begin, s->end, support, &vertex);
    if (vertex != EBPO_NO_VERTEX)
        ebpo_mesh_position(s->b->mesh, vertex, p);
    if (vertex != EBPO_NO_VERTEX)
        for (int k = 0; k < 3; k++)
            where[k] = (p[k] - ebpo_cell_face(&s->b->box, k, s->cell.level, s->cell.at[k])) /
                       (s->b->box.size[k] / (double)(1u << s->cell.level));
    return support;
}

void ebpo_supports_free(ebpo_supports *s)
{
    ebpo_array_free(s->workspace, s->point);
    ebpo_array_free(s->workspace, s->box);
    ebpo_array_free(s->workspace, s->table);
    s->point = NULL;
    s->table = NULL;
    s->box = NULL;
    s->box_capacity = 0;
    s->capacity = s->count = s->table_capacity = s->table_size = 0;
}
