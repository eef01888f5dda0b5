/* Computes the bounds of the hierarchy over blocks of faces (accel.h): for each child of a node, a
 * box and a bounding cylinder around all blocks below the child.
 *
 * Bounds are computed in doubles, in the subtree's frame (coordinates in which the subtree's cell
 * has a size of 1 to 2). Then they are rounded outward: boxes to 8 bits, cylinders to 16 bits.
 * Blocks of floats are measured by kernels (block_measure_kernels.c). docs/develop/bounds.md proves
 * that the bounds are still valid when kernels read them in single precision. */
#include "core/strict_fp.h"

#include <float.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>
#if defined(__SSE2__)
#include <emmintrin.h>
#endif

#include "core/alloc.h"
#include "core/error.h"
#include "core/os.h"
#include "core/parallel.h"
#include "query/accel_parts.h"
#include "query/query_kernels.h"

/* Enlargement of boxes, relative to the largest coordinate of their faces. */
static const double box_slack = 0x1p-19;
/* Enlargement of bounding cylinders, relative to the node's size. (Not relative to the largest
 * coordinate, because a node's faces may be in a layer that is much thinner than its distance from
 * the origin.) */
static const double cylinder_slack = 0x1p-19;
/* A search tests the cylinders of a node only if its squared distance limit exceeds this share of
 * the node's squared size (ebpo_bound.cylinder_limit2). */
static const double cylinder_share = 0.01;
/* Enlargement of boxes whose coordinates are all 0. */
static const double least_slack = 0x1p-60;
/* AXIS_UNIT: the coordinate 1 of an axis is stored as this value. SHORT_MAX: the greatest stored
 * value before it is rounded outward, so SHORT_MAX is one less than the greatest signed 16-bit
 * value. */
enum { AXIS_UNIT = 1 << 15, SHORT_MAX = 32766 };

typedef ebpo_extent extent;

typedef struct job {
    ebpo_accel *s;
    const ebpo_layout *layout;
    const ebpo_block_measures *measures; /* kernels for blocks of floats */
    extent *of_block, *of_node; /* [block_count] and [node_count] extents of blocks and nodes */
} job;

/* Two lanes of doubles. */
typedef double pair __attribute__((vector_size(16)));

#if defined(__SSE2__)
static inline pair lesser_pair(pair a, pair b) { return (pair)_mm_min_pd((__m128d)a, (__m128d)b); }
static inline pair greater_pair(pair a, pair b) { return (pair)_mm_max_pd((__m128d)a, (__m128d)b); }
#else
typedef int64_t pair_mask __attribute__((vector_size(16)));
static inline pair pick_pair(pair_mask mask, pair yes, pair no)
{
    return (pair)(((pair_mask)yes & mask) | ((pair_mask)no & ~mask));
}
static inline pair lesser_pair(pair a, pair b) { return pick_pair(a < b, a, b); }
static inline pair greater_pair(pair a, pair b) { return pick_pair(a > b, a, b); }
#endif

static double least_of(pair x) { return x[0] < x[1] ? x[0] : x[1]; }
static double max_of(pair x) { return x[0] > x[1] ? x[0] : x[1]; }

/* Vertices of a block of doubles, in the subtree's frame. */
enum { PAIRS = EBPO_MESHLET_VERTICES / 2 };
typedef struct vertices {
    pair x[3][PAIRS];
    unsigned pairs; /* number of pairs; if the number of vertices is odd, the last vertex is stored
                     * twice */
} vertices;

static void load_vertices(const ebpo_accel *s, uint32_t block, vertices *out)
{
    const ebpo_meshlet *m = ebpo_accel_meshlet(s, block);
    const double *x = ebpo_meshlet_doubles(m);
    unsigned count = m->vertices;
    out->pairs = (count + 1) / 2;
    for (unsigned k = 0; k < 3; k++, x += count)
        for (unsigned i = 0; i < count; i += 2)
            out->x[k][i / 2] =
                ((pair){ x[i], x[i + 1 < count ? i + 1 : i] } - s->centre[k]) * s->scale;
}

/* --- extents --- */

static const extent empty_extent = { { INFINITY, INFINITY, INFINITY },
                                     { -INFINITY, -INFINITY, -INFINITY },
                                     { 0, 0, 0 } };

static void add_vertices(const vertices *v, extent *e)
{
    for (int k = 0; k < 3; k++) {
        pair low = { e->low[k], e->low[k] }, high = { e->high[k], e->high[k] };
        for (unsigned i = 0; i < v->pairs; i++) {
            low = lesser_pair(v->x[k][i], low);
            high = greater_pair(v->x[k][i], high);
        }
        e->low[k] = least_of(low);
        e->high[k] = max_of(high);
    }
}

static void add_normals(const ebpo_accel *s, uint32_t block, double normal[3])
{
    const ebpo_meshlet *m = ebpo_accel_meshlet(s, block);
    for (uint32_t lane = 0; lane < m->faces; lane++) {
        double t[3][3];
        ebpo_accel_triangle(s, block * EBPO_BLOCK + lane, t);
        for (int k = 0; k < 3; k++) {
            int u = k == 2 ? 0 : k + 1, v = k == 0 ? 2 : k - 1;
            normal[k] += (t[1][u] - t[0][u]) * (t[2][v] - t[0][v]) -
                         (t[1][v] - t[0][v]) * (t[2][u] - t[0][u]);
        }
    }
}

/* Computes the extent of a block of doubles. */
static void extend_wide(const ebpo_accel *s, uint32_t block, extent *e)
{
    vertices v;
    load_vertices(s, block, &v);
    *e = empty_extent;
    add_vertices(&v, e);
    add_normals(s, block, e->normal);
}

/* Computes the extent of a block of floats. */
static void extend_narrow(const job *j, uint32_t block, extent *e)
{
    ebpo_block_extent b;
    j->measures->extent(j->s, block, &b);
    for (int k = 0; k < 3; k++) {
        e->low[k] = ((double)b.low[k] - j->s->centre[k]) * j->s->scale;
        e->high[k] = ((double)b.high[k] - j->s->centre[k]) * j->s->scale;
        e->normal[k] = (double)b.normal[k];
    }
}

static void add_extent(const extent *part, extent *e)
{
    for (int k = 0; k < 3; k++) {
        e->low[k] = part->low[k] < e->low[k] ? part->low[k] : e->low[k];
        e->high[k] = part->high[k] > e->high[k] ? part->high[k] : e->high[k];
        e->normal[k] += part->normal[k];
    }
}

static ebpo_status extend_blocks(void *context, uint64_t begin, uint64_t end, unsigned worker,
                                 ebpo_error *error)
{
    (void)worker;
    (void)error;
    job *j = context;
    for (uint64_t b = begin; b < end; b++) {
        uint32_t block = j->layout->block_number[b];
        if (j->s->wide)
            extend_wide(j->s, block, &j->of_block[b]);
        else
            extend_narrow(j, block, &j->of_block[b]);
    }
    return EBPO_OK;
}

/* Returns the extent of a child, which is a block or a node of the hierarchy. */
static const extent *extent_of(const job *j, uint32_t child)
{
    return child & EBPO_IS_BLOCK ? &j->of_block[child & ~EBPO_IS_BLOCK] : &j->of_node[child];
}

/* Computes the extents of nodes; a node comes after its children. */
static void extend_nodes(job *j)
{
    for (uint64_t n = 0; n < j->layout->node_count; n++) {
        const uint32_t *child = j->layout->node[n].child;
        j->of_node[n] = empty_extent;
        for (int lane = 0; lane < 8 && child[lane] != EBPO_NO_CHILD; lane++)
            add_extent(extent_of(j, child[lane]), &j->of_node[n]);
    }
}

/* --- boxes --- */

/* Returns fmax of values that are not NaN; the compiler needs no function call for it. */
static double larger_of(double a, double b) { return a > b ? a : b; }

/* Chooses origin and step of one axis so that 255 steps cover low .. high. Returns the slack by
 * which boxes must be enlarged on both sides. */
static double choose_grid(double low, double high, float *origin, float *step)
{
    double slack = larger_of(fabs(low), fabs(high)) * box_slack + least_slack;
    *origin = (float)(low - slack);
    if ((double)*origin > low - slack)
        *origin = nextafterf(*origin, -INFINITY);
    *step = (float)((high + slack - (double)*origin) / 255 * (1 + 0x1p-20));
    return slack;
}

/* round_down and round_up return floor and ceil of a value that fits into an int, without a
 * function call. */
static int round_down(double x)
{
    int whole = (int)x;
    return whole - (whole > x);
}
static int round_up(double x)
{
    int whole = (int)x;
    return whole + (whole < x);
}

static double to_byte(double x) { return x < 0 ? 0 : x > 255 ? 255 : x; }

/* Sets the boxes of a node's children, and cylinder_limit2. `all`: extent of the node. */
static void set_boxes(ebpo_bound *b, const extent *all, const extent child[8])
{
    for (int k = 0; k < 3; k++) {
        double slack = choose_grid(all->low[k], all->high[k], &b->origin[k], &b->step[k]);
        for (int lane = 0; lane < b->count; lane++) {
            double from = child[lane].low[k] - slack - (double)b->origin[k],
                   to = child[lane].high[k] + slack - (double)b->origin[k];
            b->low[k][lane] = (uint8_t)round_down(to_byte(from / (double)b->step[k]));
            b->high[k][lane] = (uint8_t)round_up(to_byte(to / (double)b->step[k]));
        }
    }
    double size = 0;
    for (int k = 0; k < 3; k++)
        size = larger_of(size, all->high[k] - all->low[k]);
    b->cylinder_limit2 = (float)(size * size * cylinder_share);
}

/* Returns the largest absolute coordinate of the node's boxes. */
static double greatest_coordinate(const ebpo_bound *b)
{
    double greatest = 0;
    for (int k = 0; k < 3; k++)
        greatest =
            larger_of(greatest, larger_of(fabs((double)b->origin[k]),
                                          fabs((double)b->origin[k] + 255 * (double)b->step[k])));
    return greatest;
}

/* --- bounding cylinders --- */

/* A bounding cylinder before it is rounded to 16 bits, in the subtree's frame. */
typedef struct cylinder {
    double middle[3], axis[3]; /* middle: middle of the child's box; axis: as it is stored */
    double from, to, radius2;  /* extent along the axis from the middle; squared radius */
} cylinder;

/* Chooses the axis along the mean normal of the faces. The axis is rounded towards zero, so the
 * decoded axis is never longer than 1, as the formula of ebpo_bound_cylinder requires. */
static void choose_axis(const extent *e, ebpo_bound_cylinder *b, int lane, cylinder *out)
{
    double length = sqrt(e->normal[0] * e->normal[0] + e->normal[1] * e->normal[1] +
                         e->normal[2] * e->normal[2]);
    for (int k = 0; k < 3; k++) {
        double part = length > 0 && length < INFINITY ? e->normal[k] / length : 0;
        b->axis[k][lane] = (int16_t)(part * (AXIS_UNIT - 0.5));
        out->axis[k] = (double)b->axis[k][lane] / AXIS_UNIT;
    }
}

/* As `cylinder`, for two lanes. */
typedef struct cylinder_pairs {
    pair middle[3], axis[3], from, to, radius2;
} cylinder_pairs;

static inline void add_to_cylinder(const vertices *v, cylinder_pairs *p)
{
    for (unsigned i = 0; i < v->pairs; i++) {
        pair along = { 0, 0 }, square = { 0, 0 };
        for (int k = 0; k < 3; k++) {
            pair d = v->x[k][i] - p->middle[k];
            along += d * p->axis[k];
            square += d * d;
        }
        p->from = lesser_pair(along, p->from);
        p->to = greater_pair(along, p->to);
        p->radius2 = greater_pair(square - along * along, p->radius2);
    }
}

/* Sets from, to and radius2 of a cylinder around all vertices of the blocks `block`[count]. The
 * interval from .. to need not contain 0. For example, if the faces are tilted against the axes of
 * coordinates, the middle of the faces' box may be on one side of all faces. */
static void enclose_wide(const job *j, const uint32_t *block, uint32_t count, cylinder *out)
{
    cylinder_pairs p = { .from = { INFINITY, INFINITY }, .to = { -INFINITY, -INFINITY } };
    for (int k = 0; k < 3; k++) {
        p.middle[k] = (pair){ out->middle[k], out->middle[k] };
        p.axis[k] = (pair){ out->axis[k], out->axis[k] };
    }
    for (uint32_t i = 0; i < count; i++) {
        vertices v;
        load_vertices(j->s, block[i], &v);
        add_to_cylinder(&v, &p);
    }
    out->from = least_of(p.from);
    out->to = max_of(p.to);
    out->radius2 = max_of(p.radius2);
}

/* Does the same as enclose_wide for blocks of floats, in single precision. The kernel's coordinates
 * are relative to an origin near the middle. The origin is the sum of two floats; its difference
 * from the middle (`off`) is added at the end. */
static void enclose_narrow(const job *j, const uint32_t *block, uint32_t count, cylinder *out)
{
    const ebpo_accel *s = j->s;
    ebpo_cylinder_view view = { .scale = (float)s->scale };
    ebpo_cylinder_extent e;
    double square = 0, along = 0, off2 = 0;
    for (int k = 0; k < 3; k++) {
        double middle = s->centre[k] + out->middle[k] / s->scale;
        view.origin_high[k] = (float)middle;
        view.origin_low[k] = (float)(middle - (double)view.origin_high[k]);
        view.axis[k] = (float)out->axis[k];
        square += out->axis[k] * out->axis[k];
        double origin = ((double)view.origin_high[k] - s->centre[k] + (double)view.origin_low[k]) *
                        s->scale,
               off = origin - out->middle[k];
        along += off * out->axis[k];
        off2 += off * off;
    }
    view.length2_defect = (float)(1 - square);
    j->measures->cylinder(s, block, count, &view, &e);
    double aside = sqrt((double)e.aside2) + sqrt(off2);
    out->from = (double)e.from + along;
    out->to = (double)e.to + along;
    out->radius2 = aside * aside;
}

/* Returns the bounding cylinder of a child of node n; stores its axis, and if it is large. `e`:
 * extent of the child. */
static cylinder measure_cylinder(const job *j, uint64_t n, int lane, const extent *e)
{
    const ebpo_bound *b = &j->s->bound[n];
    ebpo_bound_cylinder *cylinders = &j->s->cylinder[n];
    cylinder out = { { 0, 0, 0 }, { 0, 0, 0 }, 0, 0, 0 };
    for (int k = 0; k < 3; k++) {
        ebpo_bound_sides side = ebpo_bound_side(b, lane, k);
        out.middle[k] = (side.low + side.high) / 2;
    }
    uint32_t child = j->layout->node[n].child[lane], number = b->child[lane] & ~EBPO_IS_BLOCK,
             count = 1;
    const uint32_t *block = &number;
    if (!(child & EBPO_IS_BLOCK)) {
        const ebpo_layout_node *below = &j->layout->node[child];
        block = j->layout->ordered_number + below->begin;
        count = below->end - below->begin;
    }
    cylinders->large |= (uint8_t)((count > EBPO_LARGE_CHILD) << lane);
    choose_axis(e, cylinders, lane, &out);
    if (j->s->wide)
        enclose_wide(j, block, count, &out);
    else
        enclose_narrow(j, block, count, &out);
    return out;
}

/* Returns the longest side of the box of all children. This side is at least 2^-18 of the box's
 * largest coordinate. */
static double size_of(const ebpo_bound *b)
{
    return 255 * (double)fmaxf(b->step[0], fmaxf(b->step[1], b->step[2]));
}

/* Returns false if squares have overflowed, because some faces are very far from their leaf.
 * Untrusted files may have such faces. After an overflow, the steps of 16-bit values would be
 * infinite or NaN, so set_cylinders gives the node cylinders that exclude nothing. */
static bool are_finite(int count, const cylinder child[8], const double radius[8])
{
    for (int lane = 0; lane < count; lane++)
        if (!(fabs(child[lane].from) < FLT_MAX / 4 && fabs(child[lane].to) < FLT_MAX / 4 &&
              radius[lane] < FLT_MAX / 4))
            return false;
    return true;
}

static void set_cylinders(ebpo_bound_cylinder *b, int count, double size, const cylinder child[8])
{
    double slack = size * cylinder_slack, along = 0, aside = 0, radius[8];
    for (int lane = 0; lane < count; lane++) {
        along = larger_of(along, larger_of(child[lane].to, -child[lane].from) + slack);
        /* the error of the square is less than 2^-49 of size * size */
        radius[lane] = sqrt(larger_of(child[lane].radius2, 0) + size * size * 0x1p-46) + slack;
        aside = larger_of(aside, radius[lane]);
    }
    bool finite = are_finite(count, child, radius);
    b->along_step = (float)((finite ? along : FLT_MAX / 4) / SHORT_MAX);
    b->aside_step = (float)((finite ? aside : FLT_MAX / 4) / SHORT_MAX);
    for (int lane = 0; lane < count; lane++) {
        if (!finite) {
            b->from[lane] = -SHORT_MAX;
            b->to[lane] = b->radius[lane] = SHORT_MAX;
            continue;
        }
        b->from[lane] = (int16_t)round_down((child[lane].from - slack) / (double)b->along_step);
        b->to[lane] = (int16_t)round_up((child[lane].to + slack) / (double)b->along_step);
        b->radius[lane] = (int16_t)round_up(radius[lane] / (double)b->aside_step);
    }
}

/* --- all nodes --- */

/* Converts a child of the layout, where a block is given by its index, to a child of ebpo_bound,
 * where a block is given by its number. */
static uint32_t child_number(const job *j, uint32_t child)
{
    return child == EBPO_NO_CHILD || !(child & EBPO_IS_BLOCK)
               ? child
               : j->layout->block_number[child & ~EBPO_IS_BLOCK] | EBPO_IS_BLOCK;
}

/* Computes the boxes and cylinders of nodes begin .. end - 1. */
static ebpo_status bound_nodes(void *context, uint64_t begin, uint64_t end, unsigned worker,
                               ebpo_error *error)
{
    (void)worker;
    (void)error;
    job *j = context;
    for (uint64_t n = begin; n < end; n++) {
        ebpo_bound *b = &j->s->bound[n];
        extent part[8];
        cylinder cylinders[8];
        memset(b, 0, sizeof *b);
        memset(&j->s->cylinder[n], 0, sizeof j->s->cylinder[n]);
        for (int lane = 0; lane < 8; lane++) {
            uint32_t child = j->layout->node[n].child[lane];
            b->child[lane] = child_number(j, child);
            if (child == EBPO_NO_CHILD)
                continue;
            b->count = (uint8_t)(lane + 1);
            if (child & EBPO_IS_BLOCK) /* blocks are not in the order of nodes */
                ebpo_visit_fetch(j->s, b->child[lane]);
            part[lane] = *extent_of(j, child);
        }
        set_boxes(b, &j->of_node[n], part);
        for (int lane = 0; lane < b->count; lane++)
            cylinders[lane] = measure_cylinder(j, n, lane, &part[lane]);
        set_cylinders(&j->s->cylinder[n], b->count, size_of(b), cylinders);
    }
    return EBPO_OK;
}

static ebpo_status reserve_space(job *j, ebpo_error *error)
{
    uint64_t count = j->layout->node_count;
    ebpo_accel *s = j->s;
    s->bound_count = (uint32_t)count;
    s->root_bound = j->layout->top;
    if (count >= PTRDIFF_MAX / (sizeof *s->bound + sizeof *s->cylinder))
        return ebpo_fail_memory(error, count * (sizeof *s->bound + sizeof *s->cylinder));
    size_t bounds = (size_t)(count + 1) * sizeof *s->bound,
           cylinders = (size_t)(count + 1) * sizeof *s->cylinder;
    s->bound = aligned_alloc(64, bounds);
    s->cylinder = aligned_alloc(64, cylinders);
    ebpo_prefer_huge_pages(s->bound, bounds);
    ebpo_prefer_huge_pages(s->cylinder, cylinders);
    j->of_node = ebpo_alloc(count, sizeof *j->of_node);
    if (s->bound && s->cylinder && j->of_node)
        return EBPO_OK;
    return ebpo_fail_memory(error, count * (sizeof *s->bound + sizeof *s->cylinder));
}

/* Sets the parent of each node. */
static void link_parents(ebpo_accel *s)
{
    for (uint32_t n = 0; n < s->bound_count; n++)
        for (int lane = 0; lane < s->bound[n].count; lane++)
            if (!(s->bound[n].child[lane] & EBPO_IS_BLOCK))
                s->bound[s->bound[n].child[lane]].parent = n;
}

/* Makes the hierarchy, then all boxes and cylinders. */
static ebpo_status fill_levels(job *j, ebpo_layout *layout, unsigned threads, ebpo_error *error)
{
    j->of_block = ebpo_alloc(layout->block_count, sizeof *j->of_block);
    if (!j->of_block)
        return ebpo_fail_memory(error, layout->block_count * sizeof *j->of_block);
    ebpo_status status = ebpo_parallel_for(threads, NULL, layout->block_count, 512, extend_blocks,
                                           j, NULL, "open", error);
    if (status == EBPO_OK)
        status = ebpo_layout_join(layout, j->of_block, error);
    if (status == EBPO_OK)
        status = reserve_space(j, error);
    if (status != EBPO_OK)
        return status;
    extend_nodes(j);
    status = ebpo_parallel_for(threads, NULL, layout->node_count, 64, bound_nodes, j, NULL, "open",
                               error);
    if (status == EBPO_OK)
        link_parents(j->s);
    return status;
}

/* Sets the constants of rays whose origins are near. */
static void set_near_rays(ebpo_accel *s)
{
    double near = EBPO_RAY_NEAR * s->largest_coordinate;
    s->ray_error = ebpo_ray_error(s, near);
    s->ray_blur = ebpo_ray_blur(s->ray_error);
    s->ray_near = near < 0x1p30 && s->scale > 0 && s->scale < INFINITY ? near : -1;
}

ebpo_status ebpo_accel_fill_bounds(ebpo_accel *s, ebpo_layout *layout, unsigned threads,
                                   ebpo_error *error)
{
    job j = { .s = s, .layout = layout, .measures = ebpo_block_measures_best() };
    s->largest_coordinate = 1;
    ebpo_status status = fill_levels(&j, layout, threads, error);
    if (status == EBPO_OK && s->bound_count)
        s->largest_coordinate = larger_of(1, greatest_coordinate(&s->bound[s->root_bound]));
    set_near_rays(s);
    free(j.of_block);
    free(j.of_node);
    return status;
}
