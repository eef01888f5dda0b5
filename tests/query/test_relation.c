/* Tests relations of two models. A reference implementation fills the cells of a grid: solids of
 * boxes and surfaces of rectangles on this grid, at quarter turns and half steps. Solids of all
 * kinds are tested by points, in rational arithmetic. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <ebpo/collide.h>

#include "check_main.h"
#include "query_support.h"

/* --- models on a grid --- */

enum { BOXES = 6, CELLS = 44, MIDDLE = 22 };

/* A box, or a rectangle where low and high are equal on one axis. */
typedef struct part {
    int low[3], high[3], sign;
} part;

typedef struct grid_model {
    part part[BOXES];
    int parts;
    bool solid;
} grid_model;

/* Returns the index of a vertex. Faces of a part share vertices, because the part would otherwise
 * not be closed. */
static uint32_t vertex(ebpo_mesh *m, const double x[3])
{
    for (uint64_t i = 0; i < m->vertex_count; i++) {
        double y[3];
        ebpo_test_point(m, i, y);
        if (memcmp(x, y, sizeof y) == 0)
            return (uint32_t)i;
    }
    return ebpo_test_append_vertex(m, x[0], x[1], x[2]);
}

/* Adds a rectangle: two faces on either side of a diagonal, or four faces around its middle. */
static void add_rectangle(ebpo_mesh *m, const double corner[4][3], bool reversed, unsigned how)
{
    uint32_t v[5], n = 4;
    for (int i = 0; i < 4; i++) {
        v[i] = vertex(m, corner[reversed ? 3 - i : i]);
    }
    if (how == 2) {
        const double *a = corner[0], *b = corner[2];
        const double x[3] = { (a[0] + b[0]) / 2, (a[1] + b[1]) / 2, (a[2] + b[2]) / 2 };
        v[n] = vertex(m, x);
        for (uint32_t i = 0; i < 4; i++)
            ebpo_test_append_face(m, v[i], v[(i + 1) % 4], v[4]);
        return;
    }
    ebpo_test_append_face(m, v[how], v[how + 1], v[how + 2]);
    ebpo_test_append_face(m, v[how], v[how + 2], v[(how + 3) % 4]);
}

/* Adds the side of a box across `axis`; its normal points up the axis unless `reversed`. */
static void add_side(ebpo_mesh *m, const part *p, int axis, bool upper, bool reversed, unsigned how)
{
    int u = (axis + 1) % 3, v = (axis + 2) % 3;
    double corner[4][3];
    for (int i = 0; i < 4; i++) {
        corner[i][axis] = upper ? p->high[axis] : p->low[axis];
        corner[i][u] = i == 1 || i == 2 ? p->high[u] : p->low[u];
        corner[i][v] = i >= 2 ? p->high[v] : p->low[v];
    }
    add_rectangle(m, (const double(*)[3])corner, reversed, how);
}

static ebpo_mesh mesh_of(const grid_model *g, uint64_t seed)
{
    ebpo_mesh m;
    memset(&m, 0, sizeof m);
    for (int i = 0; i < g->parts; i++) {
        const part *p = &g->part[i];
        for (int side = 0; side < 6; side++) {
            int axis = side / 2;
            bool flat = p->low[axis] == p->high[axis];
            unsigned how = (unsigned)(ebpo_test_random(&seed) % 3);
            if (g->solid || (flat && side % 2))
                add_side(&m, p, axis, side % 2, (p->sign < 0) == (side % 2 == 1), how);
        }
    }
    if (seed % 2)
        ebpo_test_shuffle(&m, seed);
    return m;
}

/* --- poses that keep the grid --- */

/* World coordinates in half steps: coordinate axis[k] of the model times twice the scale, rotated.
 */
typedef struct grid_pose {
    int axis[3], sign[3], twice_scale, shift[3];
} grid_pose;

static ebpo_pose pose_of(const grid_pose *g)
{
    ebpo_pose p = EBPO_POSE_INIT;
    p.scale = g->twice_scale / 2.0;
    for (int i = 0; i < 3; i++) {
        p.translation[i] = g->shift[i] / 2.0;
        for (int k = 0; k < 3; k++)
            p.rotation[i][k] = g->axis[i] == k ? g->sign[i] : 0;
    }
    return p;
}

static grid_pose still(void) { return (grid_pose){ { 0, 1, 2 }, { 1, 1, 1 }, 2, { 0, 0, 0 } }; }

static grid_pose random_pose(uint64_t *state, bool scaled)
{
    grid_pose g = still();
    /* each by a quarter turn */
    for (uint64_t turns = ebpo_test_random(state) % 3; turns > 0; turns--) {
        int k = (int)(ebpo_test_random(state) % 3), l = (k + 1) % 3;
        int axis = g.axis[k], sign = g.sign[k];
        g.axis[k] = g.axis[l];
        g.sign[k] = -g.sign[l];
        g.axis[l] = axis;
        g.sign[l] = sign;
    }
    for (int k = 0; k < 3; k++)
        g.shift[k] = (int)(ebpo_test_random(state) % 7) - 3;
    if (scaled)
        g.twice_scale = 1 << ebpo_test_random(state) % 3;
    return g;
}

static part posed_part(const part *p, const grid_pose *g)
{
    part out = *p;
    for (int i = 0; i < 3; i++) {
        int a = g->sign[i] * p->low[g->axis[i]] * g->twice_scale + g->shift[i],
            b = g->sign[i] * p->high[g->axis[i]] * g->twice_scale + g->shift[i];
        out.low[i] = a < b ? a : b;
        out.high[i] = a < b ? b : a;
    }
    return out;
}

/* --- the reference implementation: cells of the world --- */

typedef struct cells {
    int8_t *winding; /* [z][y][x], winding numbers of solids */
    part part[BOXES];
    int parts;
    bool solid;
    ebpo_rule rule;
} cells;

static size_t cell_at(int x, int y, int z)
{
    return ((size_t)(z + MIDDLE) * CELLS + (size_t)(y + MIDDLE)) * CELLS + (size_t)(x + MIDDLE);
}

static cells fill(const grid_model *m, const grid_pose *pose, ebpo_rule rule)
{
    cells c = { .parts = m->parts, .solid = m->solid, .rule = rule };
    c.winding = calloc((size_t)CELLS * CELLS * CELLS, 1);
    ck_assert(c.winding != NULL);
    for (int i = 0; i < m->parts; i++) {
        part p = c.part[i] = posed_part(&m->part[i], pose);
        for (int z = p.low[2]; z < p.high[2] && m->solid; z++)
            for (int y = p.low[1]; y < p.high[1]; y++)
                for (int x = p.low[0]; x < p.high[0]; x++)
                    c.winding[cell_at(x, y, z)] += (int8_t)p.sign;
    }
    return c;
}

static bool in_cell(const cells *c, int x, int y, int z)
{
    int w = c->winding[cell_at(x, y, z)];
    return c->rule == EBPO_RULE_EVENODD ? w & 1 : c->rule == EBPO_RULE_POSITIVE ? w > 0 : w != 0;
}

typedef struct facts {
    bool both, only[2], touch;
} facts;

static int32_t relation_of(const facts *f)
{
    if (!f->both && !f->touch)
        return EBPO_DISJOINT;
    if (f->both && !f->only[0] && !f->only[1])
        return EBPO_EQUAL;
    if (f->both && !f->only[0])
        return EBPO_A_INSIDE_B;
    if (f->both && !f->only[1])
        return EBPO_B_INSIDE_A;
    return f->both ? EBPO_INTERSECTING : EBPO_TOUCHING;
}

#define EACH_CELL                                     \
    for (int z = 1 - MIDDLE; z < MIDDLE - 1; z++)     \
        for (int y = 1 - MIDDLE; y < MIDDLE - 1; y++) \
            for (int x = 1 - MIDDLE; x < MIDDLE - 1; x++)

static int32_t reference_of_solids(const cells *a, const cells *b)
{
    facts f = { 0 };
    EACH_CELL
    {
        bool in = in_cell(a, x, y, z), other = in_cell(b, x, y, z);
        f.both |= in && other;
        f.only[0] |= in && !other;
        f.only[1] |= other && !in;
        for (int i = 0; i < 27 && in && !f.touch; i++)
            f.touch |= in_cell(b, x + i % 3 - 1, y + i / 3 % 3 - 1, z + i / 9 - 1);
    }
    return relation_of(&f);
}

/* Classifies squares of a surface beside a solid. */
static void inspect_square(const cells *solid, int axis, const int at[3], facts *f)
{
    int below[3] = { at[0], at[1], at[2] };
    below[axis]--;
    bool up = in_cell(solid, at[0], at[1], at[2]),
         down = in_cell(solid, below[0], below[1], below[2]);
    f->both |= up && down;
    f->only[0] |= !up && !down;
    for (int i = 0; i < 27; i++) {
        int d[3] = { i % 3 - 1, i / 3 % 3 - 1, i / 9 - 1 };
        if (d[axis] <= 0) /* a cell with a point of the closed square */
            f->touch |= in_cell(solid, at[0] + d[0], at[1] + d[1], at[2] + d[2]);
    }
}

/* Returns the relation of the surface to the solid. */
static int32_t reference_of_surface(const cells *surface, const cells *solid)
{
    facts f = { 0 };
    for (int i = 0; i < surface->parts; i++) {
        const part *p = &surface->part[i];
        int axis = p->low[0] == p->high[0] ? 0 : p->low[1] == p->high[1] ? 1 : 2;
        int at[3], u = (axis + 1) % 3, v = (axis + 2) % 3;
        at[axis] = p->low[axis];
        for (at[u] = p->low[u]; at[u] < p->high[u]; at[u]++)
            for (at[v] = p->low[v]; at[v] < p->high[v]; at[v]++)
                inspect_square(solid, axis, at, &f);
    }
    if (!f.only[0] && f.touch)
        return EBPO_A_INSIDE_B;
    return f.both ? EBPO_INTERSECTING : f.touch ? EBPO_TOUCHING : EBPO_DISJOINT;
}

/* Marks the squares of a surface, with a bit for each axis. */
static void mark_squares(const cells *s, int8_t *mark)
{
    for (int i = 0; i < s->parts; i++) {
        const part *p = &s->part[i];
        int axis = p->low[0] == p->high[0] ? 0 : p->low[1] == p->high[1] ? 1 : 2;
        for (int z = p->low[2]; z < p->high[2] + (axis == 2); z++)
            for (int y = p->low[1]; y < p->high[1] + (axis == 1); y++)
                for (int x = p->low[0]; x < p->high[0] + (axis == 0); x++)
                    mark[cell_at(x, y, z)] |= (int8_t)(1 << axis);
    }
}

/* Returns true when inner points of two rectangles intersect, in a segment or an area. */
static bool cross(const part *p, const part *q)
{
    for (int k = 0; k < 3; k++) {
        int low = p->low[k] > q->low[k] ? p->low[k] : q->low[k],
            high = p->high[k] < q->high[k] ? p->high[k] : q->high[k];
        bool flat_p = p->low[k] == p->high[k], flat_q = q->low[k] == q->high[k];
        if (flat_p && flat_q ? low != high : low >= high && !(flat_p || flat_q))
            return false;
        if (flat_p && !flat_q && !(q->low[k] < p->low[k] && p->low[k] < q->high[k]))
            return false;
        if (flat_q && !flat_p && !(p->low[k] < q->low[k] && q->low[k] < p->high[k]))
            return false;
    }
    return true;
}

static bool meet(const part *p, const part *q)
{
    for (int k = 0; k < 3; k++)
        if (p->low[k] > q->high[k] || q->low[k] > p->high[k])
            return false;
    return true;
}

static int32_t reference_of_surfaces(const cells *a, const cells *b)
{
    bool inner = false, touch = false;
    for (int i = 0; i < a->parts; i++)
        for (int k = 0; k < b->parts; k++) {
            inner |= cross(&a->part[i], &b->part[k]);
            touch |= meet(&a->part[i], &b->part[k]);
        }
    mark_squares(a, a->winding);
    mark_squares(b, b->winding);
    if (memcmp(a->winding, b->winding, (size_t)CELLS * CELLS * CELLS) == 0)
        return EBPO_EQUAL;
    return inner ? EBPO_INTERSECTING : touch ? EBPO_TOUCHING : EBPO_DISJOINT;
}

static int32_t turned(int32_t r)
{
    return r == EBPO_A_INSIDE_B ? EBPO_B_INSIDE_A : r == EBPO_B_INSIDE_A ? EBPO_A_INSIDE_B : r;
}

static int32_t reference(const cells *a, const cells *b)
{
    if (a->solid && b->solid)
        return reference_of_solids(a, b);
    if (a->solid)
        return turned(reference_of_surface(b, a));
    return b->solid ? reference_of_surface(a, b) : reference_of_surfaces(a, b);
}

/* --- queries --- */

static int32_t run_query(ebpo_model *a, const ebpo_pose *pa, ebpo_model *b, const ebpo_pose *pb)
{
    ebpo_collide_options options = EBPO_COLLIDE_OPTIONS_INIT;
    ebpo_collider_options with = EBPO_COLLIDER_OPTIONS_INIT;
    ebpo_collider *c;
    ebpo_relation_result out;
    ebpo_face_pair pair;
    int32_t found;
    options.pose_a = *pa;
    options.pose_b = *pb;
    with.threads = 2;
    ASSERT_OK(ebpo_collider_new(a, b, &with, &c, error));
    ASSERT_OK(ebpo_collide_relation(c, &options, &out, error));
    ASSERT_OK(ebpo_collide_first(c, &options, &pair, &found, error));
    ck_assert_int_eq(out.contact, found);
    ebpo_collider_free(c);
    return out.relation;
}

static ebpo_model *in_parts(const query_model *m, int cut_level)
{
    ebpo_model_options options = EBPO_MODEL_OPTIONS_INIT;
    ebpo_model *out;
    options.cut_level = cut_level;
    ASSERT_OK(ebpo_model_new(m->file, &options, &out, error));
    return out;
}

/* Runs the query also swapped, and in parts. */
static int32_t query_both_ways(const query_model *a, const ebpo_pose *pa, const query_model *b,
                               const ebpo_pose *pb)
{
    int32_t r = run_query(a->model, pa, b->model, pb);
    ebpo_model *parts[2] = { in_parts(a, 1), in_parts(b, 2) };
    ck_assert_int_eq(run_query(b->model, pb, a->model, pa), turned(r));
    ck_assert_int_eq(run_query(parts[0], pa, parts[1], pb), r);
    ebpo_model_free(parts[0]);
    ebpo_model_free(parts[1]);
    return r;
}

static const char *const names[] = { "DISJOINT",   "TOUCHING", "INTERSECTING", "A_INSIDE_B",
                                     "B_INSIDE_A", "EQUAL",    "OPEN" };

static query_model make(const grid_model *g, uint64_t seed, int variant)
{
    query_model m;
    query_model_make(&m, "grid", mesh_of(g, seed), &query_variants[variant]);
    return m;
}

/* Checks two models at some poses of both. */
static void check_models(const grid_model *a, const grid_model *b, uint64_t seed, int poses)
{
    int variant[2] = { (int)(seed % 4), (int)(seed / 4 % 4) };
    query_model ma = make(a, seed, variant[0]), mb = make(b, seed + 1, variant[1]);
    uint64_t state = seed;
    for (int i = 0; i < poses && ma.info.solid == a->solid && mb.info.solid == b->solid; i++) {
        grid_pose ga = i % 2 ? random_pose(&state, false) : still(),
                  gb = i ? random_pose(&state, i % 3 == 2) : still();
        ebpo_pose pa = pose_of(&ga), pb = pose_of(&gb);
        cells ca = fill(a, &ga, ma.info.rule), cb = fill(b, &gb, mb.info.rule);
        int32_t want = reference(&ca, &cb), got = query_both_ways(&ma, &pa, &mb, &pb);
        ck_assert_msg(want == got, "seed %llu, pose %d: %s, not %s", (unsigned long long)seed, i,
                      names[got], names[want]);
        free(ca.winding);
        free(cb.winding);
    }
    query_model_free(&ma);
    query_model_free(&mb);
}

static part random_part(uint64_t *state, bool solid, int most)
{
    part p = { .sign = ebpo_test_random(state) % 4 ? 1 : -1 };
    int flat = solid ? -1 : (int)(ebpo_test_random(state) % 3);
    for (int k = 0; k < 3; k++) {
        p.low[k] = (int)(ebpo_test_random(state) % (uint64_t)most);
        p.high[k] = p.low[k] + (k == flat ? 0 : 1 + (int)(ebpo_test_random(state) % 2));
    }
    return p;
}

static grid_model random_model(uint64_t *state, bool solid)
{
    grid_model g = { .solid = solid, .parts = 1 + (int)(ebpo_test_random(state) % 3) };
    for (int i = 0; i < g.parts; i++)
        g.part[i] = random_part(state, solid, 2 + (int)(ebpo_test_random(state) % 2));
    return g;
}

/* In half of the cases both models have the same parts, triangulated in different ways. */
static void check_random(uint64_t seed, bool solid_a, bool solid_b)
{
    uint64_t state = seed * 7919 + solid_a + 2 * solid_b;
    grid_model a = random_model(&state, solid_a), b = random_model(&state, solid_b);
    if (solid_a == solid_b && seed % 2)
        memcpy(b.part, a.part, sizeof b.part);
    check_models(&a, &b, seed, 6);
}

enum { RANDOM = 40 };

START_TEST(test_relation_of_grid_solids)
{
    if (ebpo_test_wanted(_i))
        check_random((uint64_t)_i, true, true);
}
END_TEST

START_TEST(test_relation_of_grid_surfaces)
{
    if (ebpo_test_wanted(_i))
        check_random((uint64_t)_i, false, _i % 3 != 0);
}
END_TEST

/* Parts that overlap, so that only points of pieces of faces show a common point. */
START_TEST(test_relation_by_pieces_of_faces) { check_random(13, true, true); }
END_TEST

/* --- named cases --- */

#define BOX(x, y, z, X, Y, Z, sign)    \
    {                                  \
        { x, y, z }, { X, Y, Z }, sign \
    }

static const grid_model
    cube = { { BOX(0, 0, 0, 2, 2, 2, 1) }, 1, true },
    large = { { BOX(-2, -2, -2, 4, 4, 4, 1) }, 1, true },
    corner = { { BOX(-2, -2, -2, 2, 2, 2, 1) }, 1, true },
    hollow = { { BOX(-2, -2, -2, 4, 4, 4, 1), BOX(0, 0, 0, 2, 2, 2, -1) }, 2, true },
    roomy = { { BOX(-2, -2, -2, 4, 4, 4, 1), BOX(-1, -1, -1, 3, 3, 3, -1) }, 2, true },
    nested = { { BOX(-2, -2, -2, 4, 4, 4, 1), BOX(-1, -1, -1, 3, 3, 3, 1) }, 2, true },
    twice = { { BOX(-2, -2, -2, 4, 4, 4, 1), BOX(-2, -2, -2, 4, 4, 4, 1) }, 2, true },
    beside = { { BOX(2, 0, 0, 4, 2, 2, 1) }, 1, true },
    at_edge = { { BOX(2, 2, 0, 4, 4, 2, 1) }, 1, true },
    at_corner = { { BOX(2, 2, 2, 4, 4, 4, 1) }, 1, true },
    half = { { BOX(1, 0, 0, 3, 2, 2, 1) }, 1, true },
    dumbbell = { { BOX(0, 0, 0, 1, 1, 1, 1), BOX(8, 0, 0, 9, 1, 1, 1) }, 2, true },
    side = { { BOX(0, 0, 2, 2, 2, 2, 1) }, 1, false },
    wide = { { BOX(0, 0, 2, 4, 2, 2, 1) }, 1, false },
    through = { { BOX(-1, 0, 1, 3, 2, 1, 1) }, 1, false },
    inner = { { BOX(0, 0, 1, 2, 2, 1, 1) }, 1, false };

static const struct {
    const grid_model *a, *b;
    int32_t relation;
} known[] = {
    { &cube, &cube, EBPO_EQUAL },
    { &cube, &half, EBPO_INTERSECTING },
    { &cube, &beside, EBPO_TOUCHING },
    { &cube, &at_edge, EBPO_TOUCHING },
    { &cube, &at_corner, EBPO_TOUCHING },
    { &cube, &large, EBPO_A_INSIDE_B },
    { &corner, &cube, EBPO_B_INSIDE_A },
    { &cube, &hollow, EBPO_TOUCHING },
    { &cube, &roomy, EBPO_DISJOINT },
    { &cube, &nested, EBPO_A_INSIDE_B },
    { &nested, &large, EBPO_EQUAL },
    { &twice, &large, EBPO_EQUAL },
    { &roomy, &large, EBPO_A_INSIDE_B },
    { &roomy, &nested, EBPO_A_INSIDE_B },
    { &dumbbell, &large, EBPO_INTERSECTING },
    { &dumbbell, &cube, EBPO_INTERSECTING },
    { &side, &cube, EBPO_A_INSIDE_B },
    { &wide, &cube, EBPO_TOUCHING },
    { &through, &cube, EBPO_INTERSECTING },
    { &inner, &cube, EBPO_A_INSIDE_B },
    { &inner, &roomy, EBPO_DISJOINT },
    { &side, &side, EBPO_EQUAL },
    { &side, &wide, EBPO_INTERSECTING },
    { &side, &inner, EBPO_DISJOINT },
};
enum { KNOWN = sizeof known / sizeof *known };

START_TEST(test_relation_known_cases)
{
    ebpo_pose here = EBPO_POSE_INIT, turned_pose = EBPO_POSE_INIT;
    turned_pose.rotation[0][0] = turned_pose.rotation[1][1] = 0.6;
    turned_pose.rotation[0][1] = -0.8;
    turned_pose.rotation[1][0] = 0.8;
    query_model a = make(known[_i].a, 1, 0), b = make(known[_i].b, 4, 0);
    ck_assert_int_eq(a.info.solid, known[_i].a->solid);
    int32_t got = query_both_ways(&a, &here, &b, &here);
    ck_assert_msg(got == known[_i].relation, "%d: %s, not %s", _i, names[got],
                  names[known[_i].relation]);
    if (known[_i].relation == EBPO_EQUAL || known[_i].relation == EBPO_DISJOINT) {
        got = query_both_ways(&a, &turned_pose, &b, &turned_pose);
        ck_assert_msg(got == known[_i].relation || known[_i].relation == EBPO_EQUAL,
                      "%d, turned: %s", _i, names[got]);
    }
    query_model_free(&a);
    query_model_free(&b);
}
END_TEST

/* --- any solids: points in both, or in one, must agree --- */

static void check_points(query_model *a, query_model *b, const double shift[3], uint64_t seed)
{
    ebpo_pose pa = EBPO_POSE_INIT, pb = EBPO_POSE_INIT;
    facts f = { 0 };
    memcpy(pb.translation, shift, sizeof pb.translation);
    int32_t got = query_both_ways(a, &pa, b, &pb);
    for (uint64_t i = 0; i < query_scaled(200); i++) {
        double x[2][3];
        query_truth truth[2];
        for (int k = 0; k < 3; k++) {
            x[0][k] = floor(4096 * (12 * ebpo_test_random_unit(&seed) - 2)) / 4096;
            x[1][k] = x[0][k] - shift[k];
        }
        query_find_truths(a, x[0], 1, &truth[0]);
        query_find_truths(b, x[1], 1, &truth[1]);
        if (truth[0].where == EBPO_ON || truth[1].where == EBPO_ON)
            continue;
        f.both |= truth[0].where == EBPO_IN && truth[1].where == EBPO_IN;
        f.only[0] |= truth[0].where == EBPO_IN && truth[1].where == EBPO_OUT;
        f.only[1] |= truth[1].where == EBPO_IN && truth[0].where == EBPO_OUT;
    }
    ck_assert_msg(!f.both || (got != EBPO_DISJOINT && got != EBPO_TOUCHING), "%s", names[got]);
    ck_assert_msg(!f.only[0] || (got != EBPO_A_INSIDE_B && got != EBPO_EQUAL), "%s", names[got]);
    ck_assert_msg(!f.only[1] || (got != EBPO_B_INSIDE_A && got != EBPO_EQUAL), "%s", names[got]);
}

START_TEST(test_relation_of_all_solid_kinds)
{
    uint64_t state = (uint64_t)_i;
    if (!ebpo_test_wanted(_i))
        return;
    query_model a, b;
    query_model_make(&a, "random", query_random_solid((uint64_t)_i, true), &query_variants[0]);
    query_model_make(&b, "random", query_random_solid((uint64_t)_i / 2 + 100, true),
                     &query_variants[2]);
    for (int i = 0; i < 4; i++) {
        double shift[3];
        for (int k = 0; k < 3; k++)
            shift[k] = ((double)(ebpo_test_random(&state) % 13) - 6) / 2;
        check_points(&a, &b, shift, state);
    }
    query_model_free(&a);
    query_model_free(&b);
}
END_TEST

START_TEST(test_relation_is_open_after_deadline)
{
    query_model a = make(&cube, 1, 0), b = make(&beside, 2, 0);
    ebpo_collide_options options = EBPO_COLLIDE_OPTIONS_INIT;
    ebpo_collider *c;
    ebpo_relation_result out;
    ASSERT_OK(ebpo_collider_new(a.model, b.model, NULL, &c, error));
    options.deadline_ns = 1;
    ASSERT_OK(ebpo_collide_relation(c, &options, &out, error));
    ck_assert_int_eq(out.relation, EBPO_RELATION_UNDECIDED);
    options.deadline_ns = 0;
    ASSERT_OK(ebpo_collide_relation(c, &options, &out, error));
    ck_assert_int_eq(out.relation, EBPO_TOUCHING);
    ck_assert_int_eq(out.contact, 1);
    ebpo_collider_free(c);
    query_model_free(&a);
    query_model_free(&b);
}
END_TEST

TEST_SUITE(relation)
{
    TCase *tests = tcase_create("relation");
    tcase_set_timeout(tests, 900);
    tcase_add_loop_test(tests, test_relation_known_cases, 0, KNOWN);
    tcase_add_loop_test(tests, test_relation_of_grid_solids, 0, RANDOM);
    tcase_add_test(tests, test_relation_by_pieces_of_faces);
    tcase_add_loop_test(tests, test_relation_of_grid_surfaces, 0, RANDOM);
    tcase_add_loop_test(tests, test_relation_of_all_solid_kinds, 0, 24);
    tcase_add_test(tests, test_relation_is_open_after_deadline);
    Suite *suite = suite_create("relation");
    suite_add_tcase(suite, tests);
    return suite;
}
