/* Tests a ball that is large compared with the faces. Thousands of faces are around the ball; in a
 * cavity of nearly the ball's size, nearly all of them are in contact with the ball. The ball must
 * stop at contact and not before, compared with a reference implementation that measures the
 * distance from every face. It must come to rest when no path leads nearer to the device, and
 * visit no more faces in a haptic step than a ball in open space may. */
#include <stdlib.h>
#include <ebpo/haptic.h>
#include <math.h>
#include <stdio.h>

#include "check_main.h"
#include "query_support.h"
#include "haptic_watch.h"

/* --- the reference implementation --- */

static void corner(const ebpo_mesh *m, uint64_t face, int k, double out[3])
{
    uint64_t v = 3 * (uint64_t)m->faces[3 * face + (uint64_t)k];
    for (uint64_t i = 0; i < 3; i++)
        out[i] = m->xyz32 ? (double)m->xyz32[v + i] : m->xyz64[v + i];
}

static double product(const double a[3], const double b[3])
{
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

/* Returns the squared distance from the nearest point of a segment. */
static double from_edge(const double p[3], const double a[3], const double b[3])
{
    double e[3], d[3], part;
    for (int i = 0; i < 3; i++) {
        e[i] = b[i] - a[i];
        d[i] = p[i] - a[i];
    }
    part = product(e, e) > 0 ? fmin(fmax(product(d, e) / product(e, e), 0), 1) : 0;
    for (int i = 0; i < 3; i++)
        d[i] -= part * e[i];
    return product(d, d);
}

/* Returns the squared distance from a face. The plane counts when the projection of p is inside
 * all three edges. */
static double from_face(const double p[3], double t[3][3])
{
    double e[3], f[3], n[3], d[3], least = INFINITY;
    bool above = true;
    for (int i = 0; i < 3; i++) {
        e[i] = t[1][i] - t[0][i];
        f[i] = t[2][i] - t[0][i];
        d[i] = p[i] - t[0][i];
    }
    for (int i = 0; i < 3; i++)
        n[i] = e[(i + 1) % 3] * f[(i + 2) % 3] - e[(i + 2) % 3] * f[(i + 1) % 3];
    for (int k = 0; k < 3; k++) {
        const double *a = t[k], *b = t[(k + 1) % 3];
        double inward = 0;
        for (int i = 0; i < 3; i++) {
            int j = (i + 1) % 3, l = (i + 2) % 3;
            inward += n[i] * ((b[j] - a[j]) * (p[l] - a[l]) - (b[l] - a[l]) * (p[j] - a[j]));
        }
        above = above && inward > 0;
        least = fmin(least, from_edge(p, a, b));
    }
    double height = product(d, n);
    return above ? height * height / product(n, n) : least;
}

static double from_all(const ebpo_mesh *m, const double p[3])
{
    double least = INFINITY, t[3][3];
    for (uint64_t f = 0; f < m->face_count; f++) {
        for (int k = 0; k < 3; k++)
            corner(m, f, k, t[k]);
        least = fmin(least, from_face(p, t));
    }
    return sqrt(least);
}

/* --- a ball --- */

typedef struct ball {
    query_model m;
    ebpo_haptic *haptic;
    ebpo_haptic_options options;
    ebpo_haptic_ball_result r;
    double diagonal;
    uint32_t step_count; /* number of steps of the last move, without waiting steps */
} ball;

static void ball_begin(ball *b, const char *name, ebpo_mesh mesh, double radius,
                       const double place[3])
{
    const ebpo_info *info;
    query_model_make(&b->m, name, mesh, &query_variants[0]);
    info = ebpo_file_info(b->m.file);
    b->diagonal = hypot(hypot(info->box_size[0], info->box_size[1]), info->box_size[2]);
    b->options = (ebpo_haptic_options)EBPO_HAPTIC_OPTIONS_INIT;
    b->options.radius = radius;
    b->options.skin = 1e-5 * b->diagonal;
    b->options.faces = 1 << 17;
    b->options.damping = 0;
    ASSERT_OK(ebpo_haptic_new(b->m.model, &b->options, place, &b->haptic, error));
}

static void ball_end(ball *b)
{
    ck_assert_msg(forbidden == 0, "%lu forbidden calls in haptic steps", forbidden);
    ASSERT_OK(ebpo_haptic_check(b->haptic, error));
    ebpo_haptic_free(b->haptic);
    query_model_free(&b->m);
}

/* Maximum number of faces visited in a step of an open ball, and for the normal. */
enum { FACES_OF_A_STEP = 512 + 384 };

/* Moves until the ball is at rest, in at most `most` steps except steps that wait for faces. */
static void ball_move(ball *b, const double device[3], uint32_t most)
{
    int patience = 100000;
    for (b->step_count = 0;;) {
        in_step = true;
        ebpo_haptic_step_ball(b->haptic, device, &b->r);
        in_step = false;
        ck_assert_uint_le(b->r.work, FACES_OF_A_STEP);
        if (b->r.flags & EBPO_HAPTIC_WAITING) {
            ck_assert_int_gt(patience--, 0);
            pause_a_little();
            continue;
        }
        ck_assert_msg(++b->step_count <= most, "%s: not at rest after %u steps", b->m.name, most);
        if (!(b->r.flags & EBPO_HAPTIC_PATH_UNFINISHED))
            return;
    }
}

static double apart(const double a[3], const double b[3])
{
    return hypot(hypot(a[0] - b[0], a[1] - b[1]), a[2] - b[2]);
}

/* On curved surfaces a partial move ends beside the faces, and the next step returns to them. */
static void ball_rest(ball *b, const double device[3], uint32_t most)
{
    double before[3];
    int turns = 0;
    do {
        memcpy(before, b->r.proxy, sizeof before);
        ball_move(b, device, most);
        ck_assert_msg(turns++ < 1000, "%s: does not come to rest", b->m.name);
    } while (apart(before, b->r.proxy) > 1e-3 * b->options.skin);
}

/* Checks a ball at rest: it is in contact with a face and pushed away from the device, and every
 * position nearer to the device is too near to a face. */
static void judge_rest(const ball *b, const double device[3], uint64_t *state)
{
    double radius = b->options.radius, skin = b->options.skin, back[3];
    double gap = from_all(&b->m.mesh, b->r.proxy) - radius, depth = apart(b->r.proxy, device);
    ck_assert_msg(gap >= skin * (1 - 1e-3), "%s: %g too near", b->m.name, gap);
    if (!(b->r.flags & EBPO_HAPTIC_CONTACT)) {
        ck_assert_double_le(depth, skin);
        return;
    }
    ck_assert_msg(gap <= skin * (1 + 1e-3), "%s: held %g from the faces", b->m.name, gap);
    if (!(b->r.flags & EBPO_HAPTIC_FACES_OMITTED))
        ck_assert_double_le(fabs(apart(b->r.proxy, b->r.point) - (radius + gap)), skin / 16);
    for (int i = 0; i < 3; i++)
        back[i] = b->r.proxy[i] - device[i];
    ck_assert_double_ge(product(b->r.force, back), 0);
    ck_assert_double_gt(depth, 0);
    for (int k = 0; k < 4; k++) {
        double to[3], direction[3], length = 0;
        for (int i = 0; i < 3; i++) {
            direction[i] = ebpo_test_random_unit(state) - 0.5;
            length = hypot(length, direction[i]);
        }
        double nearer = -product(direction, back) / (length * depth);
        if (nearer < 0.3 || depth < 100 * skin)
            continue;
        for (int i = 0; i < 3; i++)
            to[i] = b->r.proxy[i] + 30 * skin * direction[i] / length;
        ck_assert_msg(from_all(&b->m.mesh, to) < radius + skin, "%s: it could come nearer",
                      b->m.name);
    }
}

/* --- cases --- */

/* The expected results are those of a box, although the box has 19,200 faces. When the ball is at
 * the edge, more than a thousand of them are in its range. */
START_TEST(test_haptic_large_ball_rests_on_box)
{
    static const double low[3] = { 0, 0, 0 }, high[3] = { 1, 1, 1 };
    const double above[3] = { 0.5, 0.5, 2 };
    ball b;
    ball_begin(&b, "box", ebpo_test_box(low, high, 40), 0.4, above);
    double skin = b.options.skin;
    /* moves down; the ball is in contact from 1.4 on, and not before */
    for (int i = 1; i <= 40; i++) {
        const double device[3] = { 0.5, 0.5, 2 - 0.0251 * i };
        ball_move(&b, device, 20);
        ck_assert_int_eq((b.r.flags & EBPO_HAPTIC_CONTACT) != 0, device[2] < 1.4);
        ck_assert_double_le(fabs(b.r.proxy[2] - fmax(device[2], 1.4 + skin)), skin / 16);
        ck_assert_double_le(fabs(b.r.force[2] - 400 * fmax(0, 1.4 + skin - device[2])), 400 * skin);
        if (b.r.flags & EBPO_HAPTIC_CONTACT)
            ck_assert_double_ge(b.r.normal[2], 0.999);
    }
    /* moves along the top, over the edge, and down beside the box */
    for (int i = 1; i <= 60; i++) {
        const double device[3] = { 0.5 + 0.02 * i, 0.5, 0.996 };
        ball_move(&b, device, 40);
        double over = fmax(b.r.proxy[0] - 1, 0);
        ck_assert_double_ge(hypot(over, b.r.proxy[2] - 1), 0.4 + skin / 2);
        if (device[0] < 1)
            ck_assert_double_le(fabs(b.r.proxy[0] - device[0]), 4 * skin);
    }
    ck_assert_uint_eq(b.r.flags & EBPO_HAPTIC_CONTACT, 0);
    ball_end(&b);
}
END_TEST

/* The inner sphere is oriented so that its interior is outside of the solid. The distance of some
 * 1,280 or 20,480 faces from the middle is nearly the radius of the ball. */
START_TEST(test_haptic_ball_fills_cavity)
{
    static const double low[3] = { -2, -2, -2 }, high[3] = { 2, 2, 2 }, zero[3] = { 0, 0, 0 };
    static const double rooms[] = { 2e-4, 3e-3, 0.05 }; /* times the skin, and of the radius */
    uint64_t state = 5 + (uint64_t)_i;
    ball b;
    ebpo_mesh mesh = ebpo_test_box(low, high, 2);
    ebpo_mesh hollow = ebpo_test_sphere(zero, 1, _i < 3 ? 3 : 5);
    for (uint64_t f = 0; f < hollow.face_count; f++) {
        uint32_t a = hollow.faces[3 * f];
        hollow.faces[3 * f] = hollow.faces[3 * f + 1];
        hollow.faces[3 * f + 1] = a;
    }
    double inner = from_all(&hollow, zero);
    ebpo_test_append(&mesh, &hollow);
    ebpo_mesh_free(&hollow);
    ball_begin(&b, "cavity", mesh, inner * (1 - rooms[_i % 3]), zero);
    for (int i = 0; i < 12; i++) {
        double device[3];
        for (int k = 0; k < 3; k++)
            device[k] = 2 * ebpo_test_random_unit(&state) - 1;
        ball_move(&b, device, 2000);
        ck_assert_uint_ne(b.r.flags & EBPO_HAPTIC_CONTACT, 0);
        ball_rest(&b, device, 2000);
        judge_rest(&b, device, &state);
        ball_rest(&b, zero, 2000);
        ck_assert_double_le(apart(b.r.proxy, zero), b.options.skin);
    }
    ball_end(&b);
}
END_TEST

/* Computes the middle of the model's box. */
static void middle_of(const ball *b, double out[3])
{
    const ebpo_info *info = ebpo_file_info(b->m.file);
    for (int k = 0; k < 3; k++)
        out[k] = info->box_origin[k] + info->box_size[k] / 2;
}

static const double of_diagonal[] = { 0.02, 0.1, 0.25, 0.8 };
enum { SIZES = sizeof of_diagonal / sizeof *of_diagonal };

/* Maximum number of steps until a ball rests on a curved surface. The largest ball on the sphere
 * takes 38. */
enum { STEPS_TO_REST = 60 };

/* Approaches in steps. The first contact is at the position that the reference implementation
 * reports. Then the ball moves along the surface. */
static void haptic_model(const char *name, ebpo_mesh mesh, double part, uint64_t seed)
{
    uint64_t state = seed;
    ball b;
    double size = 0, low[3] = { INFINITY, INFINITY, INFINITY }, high[3], start[3], middle[3];
    for (int k = 0; k < 3; k++)
        high[k] = -INFINITY;
    for (uint64_t f = 0; f < mesh.face_count; f++)
        for (int c = 0; c < 3; c++) {
            double p[3];
            corner(&mesh, f, c, p);
            for (int k = 0; k < 3; k++) {
                low[k] = fmin(low[k], p[k]);
                high[k] = fmax(high[k], p[k]);
            }
        }
    size = apart(low, high);
    for (int k = 0; k < 3; k++)
        start[k] = high[k] + (part + 0.2) * size;
    ball_begin(&b, name, mesh, part * size, start);
    middle_of(&b, middle);
    double gap = from_all(&b.m.mesh, start) - b.options.radius, at[3];
    /* free motion, as far as the reference implementation allows */
    for (int step = 0; gap > 4 * b.options.skin; step++) {
        ck_assert_int_lt(step, 200);
        double remaining = apart(start, middle),
               go = fmin(1, (gap - 2 * b.options.skin) / remaining);
        for (int k = 0; k < 3; k++)
            start[k] += go * (middle[k] - start[k]);
        ball_move(&b, start, 20);
        ck_assert_uint_eq(b.r.flags & EBPO_HAPTIC_CONTACT, 0);
        ck_assert_double_le(apart(b.r.proxy, start), b.options.skin);
        gap = from_all(&b.m.mesh, start) - b.options.radius;
    }
    for (int i = 1; i <= 3 + (int)(10 * ebpo_test_scale()); i++) {
        for (int k = 0; k < 3; k++)
            at[k] = start[k] + 0.02 * i * (middle[k] - start[k]) +
                    0.05 * size * (ebpo_test_random_unit(&state) - 0.5) * (i > 1);
        ball_move(&b, at, STEPS_TO_REST);
        if (i == 1)
            ck_assert_uint_ne(b.r.flags & EBPO_HAPTIC_CONTACT, 0);
        ball_rest(&b, at, STEPS_TO_REST);
        judge_rest(&b, at, &state);
    }
    ball_end(&b);
}

START_TEST(test_haptic_large_ball_contacts_model)
{
    static const char *const names[] = { "bunny_closed", "fertility" };
    const char *folder = getenv("EBPO_MODELS");
    char path[1024];
    ebpo_mesh mesh;
    ebpo_error error = EBPO_ERROR_INIT;
    if (!folder || (_i >= SIZES && ebpo_test_scale() < 0.2))
        return;
    snprintf(path, sizeof path, "%s/%s.ply", folder, names[_i / SIZES]);
    ck_assert_msg(ebpo_mesh_read(path, NULL, &mesh, &error) == EBPO_OK, "%s", error.message);
    haptic_model(names[_i / SIZES], mesh, of_diagonal[_i % SIZES], 90 + (uint64_t)_i);
}
END_TEST

START_TEST(test_haptic_large_ball_contacts_sphere)
{
    static const double zero[3] = { 0, 0, 0 };
    haptic_model("sphere", ebpo_test_sphere(zero, 1, 5), of_diagonal[_i], 70 + (uint64_t)_i);
}
END_TEST

TEST_SUITE(haptic_crowd)
{
    Suite *suite = suite_create("haptic_crowd");
    TCase *crowd = tcase_create("crowd");
    watch_gmp();
    tcase_set_timeout(crowd, 1200);
    tcase_add_test(crowd, test_haptic_large_ball_rests_on_box);
    tcase_add_loop_test(crowd, test_haptic_ball_fills_cavity, 0, 6);
    tcase_add_loop_test(crowd, test_haptic_large_ball_contacts_sphere, 0, SIZES);
    tcase_add_loop_test(crowd, test_haptic_large_ball_contacts_model, 0, 2 * SIZES);
    suite_add_tcase(suite, crowd);
    return suite;
}
