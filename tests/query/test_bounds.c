/* Checks the hierarchy over blocks of faces in rational arithmetic. The stored bounds contain the
 * faces below each child, with the margin of docs/develop/bounds.md and hardly more. The kernels
 * for any processor return the same results as the kernels for this processor. */
#include <gmp.h>
#include <inttypes.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "query/accel_parts.h"
#include "query/query_kernels.h"
#include "check_main.h"
#include "query/query_node.h"
#include "query_support.h"

/* --- bounds --- */

typedef struct exact {
    mpq_t x[3], middle[3], along, square, bound, part;
    /* bounds of a child's faces: along its axis, and the squared distance from the axis */
    double least, most, aside2;
    uint64_t wrong;
} exact;

static void exact_init(exact *e)
{
    for (int k = 0; k < 3; k++)
        mpq_inits(e->x[k], e->middle[k], NULL);
    mpq_inits(e->along, e->square, e->bound, e->part, NULL);
    e->wrong = 0;
}

static void exact_free(exact *e)
{
    for (int k = 0; k < 3; k++)
        mpq_clears(e->x[k], e->middle[k], NULL);
    mpq_clears(e->along, e->square, e->bound, e->part, NULL);
}

/* out = a * b + c * d */
static void set_sum(mpq_t out, double a, double b, double c, double d)
{
    mpq_t p, q;
    mpq_inits(p, q, NULL);
    mpq_set_d(out, a);
    mpq_set_d(p, b);
    mpq_mul(out, out, p);
    mpq_set_d(p, c);
    mpq_set_d(q, d);
    mpq_mul(p, p, q);
    mpq_add(out, out, p);
    mpq_clears(p, q, NULL);
}

/* Sets a corner in the frame of the subtree, without rounding. */
static void set_corner(exact *e, const ebpo_accel *s, const double corner[3])
{
    for (int k = 0; k < 3; k++)
        set_sum(e->x[k], corner[k], s->scale, -s->centre[k], s->scale);
}

/* Returns the rounding margin of a side in single precision: docs/develop/bounds.md, "Boxes". */
static double space(const ebpo_bound *b, int k)
{
    return 0x1p-22 * 1.25 * (fabs((double)b->origin[k]) + 255 * (double)b->step[k]);
}

static bool in_box(exact *e, const ebpo_bound *b, int lane)
{
    bool in = true;
    for (int k = 0; k < 3; k++) {
        set_sum(e->bound, b->origin[k], 1, b->step[k], b->low[k][lane]);
        mpq_set_d(e->part, space(b, k));
        mpq_add(e->bound, e->bound, e->part);
        in = in && mpq_cmp(e->bound, e->x[k]) <= 0;
        set_sum(e->bound, b->origin[k], 1, b->step[k], b->high[k][lane]);
        mpq_sub(e->bound, e->bound, e->part);
        in = in && mpq_cmp(e->x[k], e->bound) <= 0;
    }
    return in;
}

/* Returns the longest side of a node. */
static double size_of(const ebpo_bound *b)
{
    return 255 * fmax((double)b->step[0], fmax((double)b->step[1], (double)b->step[2]));
}

/* Computes the corner relative to the middle of the child's box: its coordinate along the axis, and
 * its squared distance from the axis. */
static void seen_from_middle(exact *e, const ebpo_bound *b, const ebpo_bound_cylinder *cylinder,
                             int lane)
{
    mpq_set_ui(e->along, 0, 1);
    mpq_set_ui(e->square, 0, 1);
    for (int k = 0; k < 3; k++) {
        set_sum(e->middle[k], b->origin[k], 1, b->step[k],
                (b->low[k][lane] + b->high[k][lane]) / 2.0);
        mpq_sub(e->middle[k], e->x[k], e->middle[k]);
        mpq_mul(e->part, e->middle[k], e->middle[k]);
        mpq_add(e->square, e->square, e->part);
        mpq_set_d(e->part, cylinder->axis[k][lane] * 0x1p-15);
        mpq_mul(e->part, e->part, e->middle[k]);
        mpq_add(e->along, e->along, e->part);
    }
    mpq_mul(e->part, e->along, e->along);
    mpq_sub(e->square, e->square, e->part);
}

/* Returns true when the corner is in the bounding cylinder with the margin for single precision, 15
 * u of the size of the node: docs/develop/bounds.md, "Points against bounding cylinders". */
static bool in_cylinder(exact *e, const ebpo_bound *b, const ebpo_bound_cylinder *cylinder,
                        int lane)
{
    double needed = size_of(b) * 0x1p-24 * 15;
    seen_from_middle(e, b, cylinder, lane);
    set_sum(e->bound, cylinder->along_step, cylinder->from[lane], needed, 1);
    bool in = mpq_cmp(e->bound, e->along) <= 0;
    set_sum(e->bound, cylinder->along_step, cylinder->to[lane], -needed, 1);
    in = in && mpq_cmp(e->along, e->bound) <= 0;
    set_sum(e->bound, cylinder->aside_step, cylinder->radius[lane], -needed, 1);
    in = in && mpq_sgn(e->bound) >= 0;
    mpq_mul(e->bound, e->bound, e->bound);
    e->least = fmin(e->least, mpq_get_d(e->along));
    e->most = fmax(e->most, mpq_get_d(e->along));
    e->aside2 = fmax(e->aside2, mpq_get_d(e->square));
    return in && mpq_cmp(e->square, e->bound) <= 0;
}

/* Returns true when the bounding cylinder is no wider than rounding requires. Call after all
 * corners of the child. */
static bool is_tight(const exact *e, const ebpo_bound *b, const ebpo_bound_cylinder *cylinder,
                     int lane)
{
    bool has_axis = cylinder->axis[0][lane] || cylinder->axis[1][lane] || cylinder->axis[2][lane];
    double loose = size_of(b) * 0x1p-18, step = (double)cylinder->along_step,
           aside_step = (double)cylinder->aside_step;
    return !has_axis || (step * cylinder->from[lane] >= e->least - loose - 2 * step &&
                         step * cylinder->to[lane] <= e->most + loose + 2 * step &&
                         aside_step * cylinder->radius[lane] <=
                             sqrt(fmax(e->aside2, 0)) + loose + 2 * aside_step);
}

/* Checks every face below `child` against the bounds of child `lane` in node `n`. */
static void check_below(exact *e, const ebpo_accel *s, uint32_t n, int lane, uint32_t child)
{
    if (!(child & EBPO_IS_BLOCK)) {
        for (int i = 0; i < s->bound[child].count; i++)
            check_below(e, s, n, lane, s->bound[child].child[i]);
        return;
    }
    for (uint32_t i = 0; i < EBPO_BLOCK; i++) {
        uint32_t slot = (child & ~EBPO_IS_BLOCK) * EBPO_BLOCK + i;
        double t[3][3];
        if (ebpo_accel_slot_face(s, slot) == EBPO_NO_SLOT)
            return;
        ebpo_accel_triangle(s, slot, t);
        for (int corner = 0; corner < 3; corner++) {
            set_corner(e, s, t[corner]);
            e->wrong += !in_box(e, &s->bound[n], lane) ||
                        !in_cylinder(e, &s->bound[n], &s->cylinder[n], lane);
        }
    }
}

/* No axis has a squared length greater than 1, as the proof for bounding cylinders requires. */
static bool axis_is_short(const ebpo_bound_cylinder *cylinder, int lane)
{
    int64_t square = 0;
    for (int k = 0; k < 3; k++)
        square += (int64_t)cylinder->axis[k][lane] * cylinder->axis[k][lane];
    return square <= INT64_C(1) << 30;
}

START_TEST(test_boxes_and_cylinders_contain_faces)
{
    query_model m;
    exact e;
    query_model_make(&m, query_solid_name(_i), query_solid_make(_i),
                     &query_variants[_i % query_variant_count]);
    const ebpo_accel *s = m.model->whole;
    ck_assert_ptr_nonnull(s);
    exact_init(&e);
    for (uint32_t n = 0; n < s->bound_count; n++)
        for (int lane = 0; lane < s->bound[n].count; lane++) {
            e.wrong += !axis_is_short(&s->cylinder[n], lane);
            e.least = INFINITY;
            e.most = -INFINITY;
            e.aside2 = 0;
            check_below(&e, s, n, lane, s->bound[n].child[lane]);
            e.wrong += !is_tight(&e, &s->bound[n], &s->cylinder[n], lane);
        }
    ck_assert_uint_eq(e.wrong, 0);
    exact_free(&e);
    query_model_free(&m);
}
END_TEST

/* --- inputs of bounding cylinders --- */

static void same_measures(const ebpo_accel *s, uint32_t block, const ebpo_cylinder_view *view)
{
    const ebpo_block_measures *base = &ebpo_block_measures_base, *best = ebpo_block_measures_best();
    ebpo_block_extent one, other;
    ebpo_cylinder_extent one_cylinder, other_cylinder;
    base->extent(s, block, &one);
    best->extent(s, block, &other);
    base->cylinder(s, &block, 1, view, &one_cylinder);
    best->cylinder(s, &block, 1, view, &other_cylinder);
    ck_assert_mem_eq(&one, &other, sizeof one);
    ck_assert_mem_eq(&one_cylinder, &other_cylinder, sizeof one_cylinder);
}

START_TEST(test_block_bounds_same_on_any_cpu)
{
    query_model m;
    query_model_make(&m, query_solid_name(_i), query_solid_make(_i),
                     &query_variants[_i % query_variant_count]);
    const ebpo_accel *s = m.model->whole;
    ebpo_cylinder_view view = { .scale = (float)s->scale, .axis = { 0.5f, -0.75f, 0.25f } };
    view.length2_defect = 0.125f;
    for (int k = 0; k < 3; k++)
        view.origin_high[k] = (float)s->centre[k];
    for (uint32_t n = 0; n < s->bound_count && !s->wide; n++)
        for (int lane = 0; lane < s->bound[n].count; lane++)
            if (s->bound[n].child[lane] & EBPO_IS_BLOCK)
                same_measures(s, s->bound[n].child[lane] & ~EBPO_IS_BLOCK, &view);
    query_model_free(&m);
}
END_TEST

/* --- the hierarchy --- */

/* Returns half the surface of a box. */
static double surface_of(const ebpo_bound *b, int lane)
{
    double size[3];
    for (int k = 0; k < 3; k++) {
        ebpo_bound_sides side = ebpo_bound_side(b, lane, k);
        size[k] = side.high - side.low;
    }
    return size[0] * size[1] + size[1] * size[2] + size[2] * size[0];
}

/* A random line that meets a convex box meets a box within it with a probability of the ratio of
 * their surfaces. So the sum of the ratios of all nodes is the number of nodes that a line visits.
 */
START_TEST(test_rays_visit_few_nodes)
{
    query_model m;
    query_model_make(&m, "sphere", ebpo_test_sphere((double[3]){ 0, 0, 0 }, 1, 6),
                     &query_variants[0]);
    const ebpo_accel *s = m.model->whole;
    double nodes = 0, blocks = 0, root = 0;
    for (uint32_t n = 0; n < s->bound_count; n++)
        for (int lane = 0; lane < s->bound[n].count; lane++)
            *(s->bound[n].child[lane] & EBPO_IS_BLOCK ? &blocks : &nodes) +=
                surface_of(&s->bound[n], lane);
    for (int k = 0; k < 3; k++) {
        const float *step = s->bound[s->root_bound].step;
        root += 255. * (double)step[k] * 255 * (double)step[(k + 1) % 3];
    }
    /* With nodes that follow the octree, 12.4 nodes; with cuts in equal halves, 22.8. */
    ck_assert_double_le(1 + nodes / root, 11.8);
    ck_assert_double_le(blocks / root, 3.7);
    ck_assert_uint_le(s->bound_count, s->face_count / 32);
    query_model_free(&m);
}
END_TEST

/* Sets the extents of blocks. kind: 0: random; 1: twice as far and as large as the block before, so
 * that cuts separate few blocks; 2: equal; 3: infinite or not a number. */
static void set_extents(ebpo_extent *extent, uint32_t count, int kind, uint64_t *state)
{
    for (uint32_t i = 0; i < count; i++)
        for (int k = 0; k < 3; k++) {
            double at = kind == 0   ? (double)(ebpo_test_random(state) % 1000)
                        : kind == 1 ? ldexp(1, (int)(i % 120))
                        : kind == 2 ? 1
                        : i % 2     ? INFINITY
                                    : NAN;
            extent[i].low[k] = at;
            extent[i].high[k] = kind == 1 ? 2 * at : at + 1;
        }
}

/* A walk through the hierarchy of a layout. place[b]: index of block b in the order of nodes. */
typedef struct layout_walk {
    const ebpo_layout *layout;
    uint32_t *place, nodes, blocks;
    int depth; /* the greatest depth of a node */
} layout_walk;

/* Checks that the blocks below a node are in its range, and that they are all shared or all owned
 * if the node is not the root. */
static void check_layout_node(layout_walk *w, uint32_t number, int depth)
{
    const ebpo_layout *layout = w->layout;
    const ebpo_layout_node *n = &layout->node[number];
    bool shared = layout->ordered_number[n->begin] < layout->shared_blocks;
    w->nodes++;
    w->depth = depth > w->depth ? depth : w->depth;
    for (int lane = 0; lane < 8 && n->child[lane] != EBPO_NO_CHILD; lane++) {
        uint32_t child = n->child[lane], block = child & ~EBPO_IS_BLOCK;
        if (child & EBPO_IS_BLOCK) {
            ck_assert(w->place[block] >= n->begin && w->place[block] < n->end);
            ck_assert(depth == 0 || shared == (block < layout->shared_blocks));
            w->blocks++;
            continue;
        }
        ck_assert_uint_lt(child, number); /* children come first */
        const ebpo_layout_node *below = &layout->node[child];
        ck_assert(below->begin >= n->begin && below->end <= n->end && below->begin < below->end);
        bool below_shared = layout->ordered_number[below->begin] < layout->shared_blocks;
        ck_assert(depth == 0 || shared == below_shared);
        check_layout_node(w, child, depth + 1);
    }
}

/* Makes and checks the hierarchy over blocks with these extents. */
static void check_layout(uint32_t count, uint32_t shared, ebpo_extent *extent)
{
    ebpo_layout layout = { .block_count = count, .shared_blocks = shared };
    layout.block_number = calloc(count, sizeof *layout.block_number);
    layout_walk w = { .layout = &layout, .place = calloc(count, sizeof *w.place) };
    for (uint32_t b = 0; b < count; b++)
        layout.block_number[b] = b;
    ASSERT_OK(ebpo_layout_join(&layout, extent, error));
    for (uint32_t i = 0; i < count; i++)
        w.place[layout.ordered_number[i]] = i;
    check_layout_node(&w, layout.top, 0);
    ck_assert_uint_eq(w.blocks, count);
    ck_assert_uint_eq(w.nodes, layout.node_count);
    ck_assert_uint_le(layout.node_count, ebpo_layout_nodes_max(count));
    ck_assert_int_lt(w.depth, EBPO_VISITS_MAX / 8);
    free(w.place);
    ebpo_layout_free(&layout);
}

/* Each block is in the hierarchy once, and the numbers of nodes and of levels are bounded, for any
 * extents, also of damaged files. */
START_TEST(test_layout_is_bounded_for_any_extents)
{
    enum { MOST = 200000, SMALL = 700 };
    ebpo_extent *extent = calloc(MOST, sizeof *extent);
    uint64_t state = 11;
    for (uint32_t count = 1; count <= SMALL; count++) {
        set_extents(extent, count, _i, &state);
        const uint32_t shared[] = { 0, 1, count / 3, count - 1, count };
        for (size_t i = 0; i < sizeof shared / sizeof *shared; i++)
            check_layout(count, shared[i], extent);
    }
    set_extents(extent, MOST, _i, &state);
    check_layout(MOST, 0, extent);
    free(extent);
}
END_TEST

/* --- kernels --- */

enum { KEPT = 64 };

typedef struct results {
    ebpo_ray_hit first, all[KEPT];
    ebpo_distance_result nearest;
    uint64_t count;
    bool hit, any;
} results;

static void query_all(query_model *m, const query_ray *r, results *out)
{
    const ebpo_ray_hit *hits;
    memset(out, 0, sizeof *out);
    ASSERT_OK(ebpo_ray_first(m->context, r->origin, r->direction, r->t_max, &out->first, &out->hit,
                             error));
    ASSERT_OK(ebpo_ray_any(m->context, r->origin, r->direction, r->t_max, &out->any, error));
    ASSERT_OK(
        ebpo_ray_all(m->context, r->origin, r->direction, r->t_max, &hits, &out->count, error));
    for (uint64_t i = 0; i < out->count && i < KEPT; i++)
        out->all[i] = hits[i];
    ASSERT_OK(ebpo_distance(m->context, r->origin, NULL, &out->nearest, error));
}

static bool same_hit(const ebpo_ray_hit *a, const ebpo_ray_hit *b)
{
    return memcmp(&a->t, &b->t, sizeof a->t) == 0 && a->face == b->face && a->side == b->side;
}

/* Compares all bits. */
static bool same_results(const results *a, const results *b)
{
    bool same = a->hit == b->hit && a->any == b->any && a->count == b->count &&
                memcmp(&a->nearest, &b->nearest, sizeof a->nearest) == 0 &&
                (!a->hit || same_hit(&a->first, &b->first));
    for (uint64_t i = 0; i < a->count && i < KEPT && same; i++)
        same = same_hit(&a->all[i], &b->all[i]);
    return same;
}

START_TEST(test_bounds_kernels_agree)
{
    query_model m;
    query_model_make(&m, query_solid_name(_i), query_solid_make(_i),
                     &query_variants[_i % query_variant_count]);
    const ebpo_query_kernels standard = m.model->kernels;
    uint64_t state = (uint64_t)_i, count = query_scaled(m.mesh.face_count > 500 ? 200 : 600);
    if (strcmp(m.name, "all_scales") == 0)
        count = query_scaled(100);
    for (uint64_t i = 0; i < count; i++) {
        query_ray r;
        results one, other;
        query_make_ray(&m, &state, r.origin, r.direction, &r.t_max);
        m.model->kernels = ebpo_query_kernels_base();
        query_all(&m, &r, &one);
        ck_assert(query_one_ray(&m, m.context, &r)); /* compares with rational arithmetic */
        m.model->kernels = standard;
        query_all(&m, &r, &other);
        ck_assert_msg(same_results(&one, &other), "%s: ray %" PRIu64, m.name, i);
        ck_assert(one.any == one.hit);
    }
    query_model_free(&m);
}
END_TEST

/* --- envelopes --- */

/* Returns true if the bound exceeds the distance of p and v. */
static bool exceeds_distance(double bound, const double p[3], const double v[3])
{
    mpq_t square, sum, x, y;
    mpq_inits(square, sum, x, y, NULL);
    mpq_set_d(square, bound);
    mpq_mul(square, square, square);
    for (int k = 0; k < 3; k++) {
        mpq_set_d(x, p[k]);
        mpq_set_d(y, v[k]);
        mpq_sub(x, x, y);
        mpq_mul(x, x, x);
        mpq_add(sum, sum, x);
    }
    bool exceeds = mpq_cmp(square, sum) > 0;
    mpq_clears(square, sum, x, y, NULL);
    return exceeds;
}

/* Returns the child of a gray node whose cell has the point v. */
static ebpo_node child_with(const query_model *m, const ebpo_node *gray, const double v[3])
{
    ebpo_box box = ebpo_model_box(m->model);
    unsigned octant = 0;
    for (int k = 0; k < 3; k++)
        if (v[k] >= ebpo_cell_face(&box, k, gray->cell.level + 1, 2 * gray->cell.at[k] + 1))
            octant |= 1u << k;
    return ebpo_model_child(m->model, gray, octant);
}

/* The sums of the bounds of all nodes with a vertex: from single half-spaces, and from all. */
typedef struct bound_sums {
    double single, all;
} bound_sums;

/* Checks the bounds of the nodes with the vertex v: no bound exceeds the distance of p and v. */
static void check_envelopes(const query_model *m, const double p[3], const double v[3],
                            bound_sums *sums)
{
    ebpo_box box = ebpo_model_box(m->model);
    ebpo_facing facing = { .count = 0 };
    ebpo_node node = ebpo_model_root(m->model);
    for (;;) {
        uint32_t count;
        const uint32_t *codes = ebpo_model_planes(m->model, &node, &count);
        double single = ebpo_envelope_distance(&box, node.cell, codes, count, p, INFINITY),
               all = ebpo_facing_distance(&box, node.cell, codes, count, p, INFINITY, &facing);
        ck_assert(facing.count >= 0 && facing.count <= 3);
        ck_assert(!exceeds_distance(all, p, v));
        sums->single += single / m->size;
        sums->all += all / m->size;
        if (node.type != EBPO_GRAY)
            return;
        node = child_with(m, &node, v);
    }
}

START_TEST(test_envelope_bounds_hold_exactly)
{
    query_model m;
    bound_sums sums = { 0, 0 };
    query_model_make(&m, query_solid_name(_i), query_solid_make(_i),
                     &query_variants[_i % query_variant_count]);
    uint64_t state = (uint64_t)_i, count = query_scaled(200);
    double *points = query_alloc(count, 3 * sizeof *points), v[3];
    query_make_points(&m, count, (uint64_t)_i, points);
    for (uint64_t i = 0; i < count; i++) {
        bound_sums any = { 0, 0 };
        double p[3], away = m.size * exp2(-12 * ebpo_test_random_unit(&state));
        ebpo_test_point(&m.mesh, (uint32_t)(ebpo_test_random(&state) % m.mesh.vertex_count), v);
        check_envelopes(&m, points + 3 * i, v, &any);
        for (int k = 0; k < 3; k++)
            p[k] = v[k] + away * (2 * ebpo_test_random_unit(&state) - 1);
        check_envelopes(&m, p, v, &sums);
    }
    /* the code gives no bounds for distances below 2^-900 */
    if (m.size > 0x1p-800)
        ck_assert_msg(sums.all >= sums.single * (1 - 1e-9), "%g, %g", sums.all, sums.single);
    free(points);
    query_model_free(&m);
}
END_TEST

TEST_SUITE(bounds)
{
    Suite *suite = suite_create("bounds");
    TCase *bounds = tcase_create("bounds");
    tcase_set_timeout(bounds, 600);
    tcase_add_loop_test(bounds, test_boxes_and_cylinders_contain_faces, 0, query_solid_count());
    tcase_add_test(bounds, test_rays_visit_few_nodes);
    tcase_add_loop_test(bounds, test_layout_is_bounded_for_any_extents, 0, 4);
    tcase_add_loop_test(bounds, test_block_bounds_same_on_any_cpu, 0, query_solid_count());
    tcase_add_loop_test(bounds, test_envelope_bounds_hold_exactly, 0, query_solid_count());
    tcase_add_loop_test(bounds, test_bounds_kernels_agree, 0, query_solid_count());
    suite_add_tcase(suite, bounds);
    return suite;
}
