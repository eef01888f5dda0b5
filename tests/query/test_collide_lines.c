/* Tests contact segments against the exact contact of each crossing pair, and lines of contact:
 * each segment occurs once, segments are joined end to end, and lines are closed when both models
 * are closed. */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include <ebpo/collide.h>

#include "check_main.h"
#include "extras/collide/face_pairs.h"
#include "query_support.h"

typedef struct gathered {
    ebpo_face_pair *pair; /* crossing pairs */
    ebpo_contact_segment *segment;
    uint64_t pairs, segments;
    /* counts of lines and of their parts */
    uint64_t lines, open, parts;
    double length;
    const struct gathered *all; /* the owner of the segments */
    const ebpo_collide_options *how;
    double *points; /* points of all lines, for comparisons */
    uint64_t point_count;
} gathered;

static void *more(void *array, uint64_t count, size_t size)
{
    void *out = realloc(array, (count + 1) * size);
    ck_assert(out != NULL);
    return out;
}

static bool take_pairs(void *user, const ebpo_face_pair *pairs, uint64_t count)
{
    gathered *g = user;
    for (uint64_t i = 0; i < count; i++)
        if (pairs[i].kind == EBPO_PAIR_CROSSING) {
            g->pair = more(g->pair, g->pairs, sizeof *g->pair);
            g->pair[g->pairs++] = pairs[i];
        }
    return true;
}

static bool take_segments(void *user, const ebpo_contact_segment *segments, uint64_t count)
{
    gathered *g = user;
    for (uint64_t i = 0; i < count; i++) {
        g->segment = more(g->segment, g->segments, sizeof *g->segment);
        g->segment[g->segments++] = segments[i];
    }
    return true;
}

static void posed_face(const query_model *m, const ebpo_pose *p, uint64_t f, double out[3][3])
{
    for (int i = 0; i < 3; i++) {
        double x[3];
        ebpo_test_point(&m->mesh, m->mesh.faces[3 * f + (uint64_t)i], x);
        for (int k = 0; k < 3; k++) {
            const double *r = p->rotation[k];
            double a = p->scale * r[0] * x[0], b = p->scale * r[1] * x[1],
                   c = p->scale * r[2] * x[2];
            out[i][k] = ((a + b) + c) + p->translation[k];
        }
    }
}

/* Checks points and features. */
static void check_segment(const query_model *a, const query_model *b,
                          const ebpo_collide_options *how, const ebpo_face_pair *pair,
                          const ebpo_contact_segment *s)
{
    double x[3][3], y[3][3];
    ebpo_contact_end end[2];
    posed_face(a, &how->pose_a, pair->file_face_a, x);
    posed_face(b, &how->pose_b, pair->file_face_b, y);
    ebpo_triangle_contact((const double(*)[3])x, (const double(*)[3])y, end);
    ck_assert_uint_eq(s->face_a, pair->face_a);
    ck_assert_uint_eq(s->face_b, pair->face_b);
    for (int i = 0; i < 2; i++) {
        ck_assert(memcmp(s->point[i], end[i].point, sizeof end[i].point) == 0);
        ck_assert_uint_eq(s->on_a[i], (unsigned)end[i].on_a);
        ck_assert_uint_eq(s->on_b[i], (unsigned)end[i].on_b);
    }
}

static const ebpo_contact_segment *segment_of(const gathered *all, const uint64_t faces[2])
{
    for (uint64_t i = 0; i < all->segments; i++)
        if (all->segment[i].face_a == faces[0] && all->segment[i].face_b == faces[1])
            return &all->segment[i];
    return NULL;
}

static double distance(const double p[3], const double q[3])
{
    return sqrt((p[0] - q[0]) * (p[0] - q[0]) + (p[1] - q[1]) * (p[1] - q[1]) +
                (p[2] - q[2]) * (p[2] - q[2]));
}

static bool take_line(void *user, const ebpo_polyline *line)
{
    gathered *g = user;
    ck_assert_uint_ge(line->count, 2);
    g->lines++;
    g->open += !line->closed;
    if (line->closed)
        ck_assert(memcmp(line->points, line->points + 3 * (line->count - 1), 24) == 0);
    for (uint64_t i = 0; i + 1 < line->count; i++) {
        const double *p = line->points + 3 * i, *n = line->normals + 6 * i;
        const ebpo_contact_segment *s = segment_of(g->all, line->faces + 2 * i);
        double along[3], length = distance(p, p + 3);
        ck_assert_ptr_nonnull(s);
        ck_assert(memcmp(p, s->point[0], sizeof s->point[0]) == 0);
        ck_assert(distance(p + 3, s->point[1]) < 1e-12);
        ck_assert(fabs(n[0] * n[0] + n[1] * n[1] + n[2] * n[2] - 1) < 1e-12);
        for (int k = 0; k < 3; k++)
            along[k] = n[(k + 1) % 3] * n[3 + (k + 2) % 3] - n[(k + 2) % 3] * n[3 + (k + 1) % 3];
        for (int k = 0; k < 3; k++)
            ck_assert(along[k] * (p[3 + k] - p[k]) >= -1e-12 * length);
        g->length += length;
        g->parts++;
    }
    g->points = realloc(g->points, (g->point_count + line->count) * 24);
    ck_assert(g->points != NULL);
    memcpy(g->points + 3 * g->point_count, line->points, line->count * 24);
    g->point_count += line->count;
    return true;
}

static gathered run_query(ebpo_model *a, ebpo_model *b, const ebpo_collide_options *how,
                          unsigned threads)
{
    gathered g = { .how = how };
    ebpo_collider_options with = EBPO_COLLIDER_OPTIONS_INIT;
    ebpo_collider *c;
    with.threads = threads;
    ASSERT_OK(ebpo_collider_new(a, b, &with, &c, error));
    ASSERT_OK(ebpo_collide_all(c, how, take_pairs, &g, error));
    ASSERT_OK(ebpo_collide_contacts(c, how, take_segments, &g, error));
    g.all = &g;
    ASSERT_OK(ebpo_collide_polylines(c, how, take_line, &g, error));
    ck_assert_uint_eq(g.pairs, g.segments);
    ck_assert_uint_eq(g.pairs, g.parts);
    ebpo_collider_free(c);
    return g;
}

static void forget(gathered *g)
{
    free(g->pair);
    free(g->segment);
    free(g->points);
}

static ebpo_collide_options swapped(const ebpo_collide_options *how)
{
    ebpo_collide_options out = *how;
    out.pose_a = how->pose_b;
    out.pose_b = how->pose_a;
    return out;
}

/* Compares with the lines of swapped models, which run in the opposite direction. */
static void check_swap(const query_model *a, const query_model *b, const ebpo_collide_options *how,
                       const gathered *g)
{
    ebpo_collide_options other = swapped(how);
    gathered s = run_query(b->model, a->model, &other, 3);
    ck_assert_uint_eq(s.segments, g->segments);
    ck_assert_uint_eq(s.lines, g->lines);
    ck_assert_uint_eq(s.open, g->open);
    ck_assert(fabs(s.length - g->length) < 1e-9 * (1 + g->length));
    for (uint64_t i = 0; i < s.segments; i++)
        for (int e = 0; e < 2; e++)
            ck_assert(memcmp(s.segment[i].point[e], g->segment[i].point[1 - e], 24) == 0);
    forget(&s);
}

static gathered check_two(const query_model *a, const query_model *b,
                          const ebpo_collide_options *how)
{
    gathered g = run_query(a->model, b->model, how, 1);
    for (uint64_t i = 0; i < g.pairs; i++)
        check_segment(a, b, how, &g.pair[i], &g.segment[i]);
    check_swap(a, b, how, &g);
    return g;
}

static query_model model_of(const char *name, int variant)
{
    query_model m;
    query_model_make(&m, name, query_solid_by_name(name), &query_variants[variant]);
    return m;
}

/* Each of two boxes has one corner in the other. The line has six edges of the common box. */
START_TEST(test_intersection_lines_of_two_cubes)
{
    query_model m = model_of("cube", 0);
    ebpo_collide_options how = EBPO_COLLIDE_OPTIONS_INIT;
    const double share[3] = { 0.5, 0.25, 0.125 };
    for (int k = 0; k < 3; k++)
        how.pose_b.translation[k] = share[k] * m.size;
    gathered g = check_two(&m, &m, &how);
    ck_assert_uint_eq(g.lines, 1);
    ck_assert_uint_eq(g.open, 0);
    ck_assert(fabs(g.length - 4.25 * m.size) < 1e-9 * m.size);
    forget(&g);
    query_model_free(&m);
}
END_TEST

/* Two manifold solids in general position have only closed lines. */
START_TEST(test_intersection_lines_of_solids_are_closed)
{
    static const char *const names[] = { "torus", "sphere_float", "cube" };
    query_model a = model_of(names[_i / 3], 0), b = model_of(names[_i % 3], 1);
    ebpo_collide_options how = EBPO_COLLIDE_OPTIONS_INIT;
    double corner[2][3][3], turned[3];
    how.pose_b.scale = a.size / b.size;
    how.pose_b.rotation[0][0] = how.pose_b.rotation[1][1] = 0.6;
    how.pose_b.rotation[0][1] = -0.8;
    how.pose_b.rotation[1][0] = 0.8;
    /* a face of B approximately on a face of A */
    posed_face(&a, &how.pose_a, a.mesh.face_count / 3, corner[0]);
    posed_face(&b, &how.pose_b, b.mesh.face_count / 2, corner[1]);
    for (int k = 0; k < 3; k++) {
        turned[k] = (corner[1][0][k] + corner[1][1][k] + corner[1][2][k]) / 3;
        how.pose_b.translation[k] = (0.011 + 0.007 * k) * a.size - turned[k] +
                                    (corner[0][0][k] + corner[0][1][k] + corner[0][2][k]) / 3;
    }
    gathered g = check_two(&a, &b, &how);
    ck_assert_uint_gt(g.segments, 0);
    ck_assert_uint_eq(g.open, 0);
    forget(&g);
    query_model_free(&a);
    query_model_free(&b);
}
END_TEST

/* Lines end at the border of a surface. */
START_TEST(test_intersection_lines_end_at_borders)
{
    query_model a = model_of("sheet", 0), b = model_of("torus", 1);
    ebpo_collide_options how = EBPO_COLLIDE_OPTIONS_INIT;
    how.pose_b.scale = 0.5 * a.size / b.size;
    for (int k = 0; k < 3; k++)
        how.pose_b.translation[k] = 0.01 * (k + 1) * a.size;
    gathered g = check_two(&a, &b, &how);
    forget(&g);
    query_model_free(&a);
    query_model_free(&b);
}
END_TEST

static bool take_none(void *user, const ebpo_polyline *line)
{
    (void)line;
    ++*(int *)user;
    return false;
}

START_TEST(test_intersection_lines_memory_and_cancel)
{
    query_model m = model_of("torus", 0);
    ebpo_collide_options how = EBPO_COLLIDE_OPTIONS_INIT;
    ebpo_collider_options with = EBPO_COLLIDER_OPTIONS_INIT;
    ebpo_collider *c;
    ebpo_error refusal = EBPO_ERROR_INIT;
    int calls = 0;
    how.pose_b.translation[0] = 0.21 * m.size;
    how.pose_b.translation[2] = 0.013 * m.size;
    ASSERT_OK(ebpo_collider_new(m.model, m.model, NULL, &c, error));
    ASSERT_OK(ebpo_collide_polylines(c, &how, take_none, &calls, error));
    ck_assert_int_eq(calls, 1);
    ebpo_collider_free(c);
    with.memory = 1000;
    ASSERT_OK(ebpo_collider_new(m.model, m.model, &with, &c, error));
    ck_assert_int_eq(ebpo_collide_polylines(c, &how, take_none, &calls, &refusal), EBPO_E_LIMIT);
    ck_assert_int_eq(calls, 1);
    ebpo_collider_free(c);
    query_model_free(&m);
}
END_TEST

TEST_SUITE(collide_lines)
{
    TCase *tests = tcase_create("collide_lines");
    tcase_set_timeout(tests, 900);
    tcase_add_test(tests, test_intersection_lines_of_two_cubes);
    tcase_add_loop_test(tests, test_intersection_lines_of_solids_are_closed, 0, 9);
    tcase_add_test(tests, test_intersection_lines_end_at_borders);
    tcase_add_test(tests, test_intersection_lines_memory_and_cancel);
    Suite *suite = suite_create("collide_lines");
    suite_add_tcase(suite, tests);
    return suite;
}
