/* Haptic proxies and tools on real models (the folder EBPO_MODELS) and on degenerate or
 * ill-conditioned cases: they pass no face, keep their distance, and gain no energy from contact.
 * This is checked by exact arithmetic on the faces around each step, which a separate grid finds.
 * EBPO_TEST_SCALE=500 plays a million steps each. */
#include <stdlib.h>
#include <ebpo/haptic.h>
#include <math.h>
#include <stdio.h>

#include "check_main.h"
#include "query_support.h"
#include "degenerate.h"
#include "haptic_watch.h"

/* --- faces by cells of a grid --- */

enum { SIDE = 40, CELLS = SIDE * SIDE * SIDE };

typedef struct grid {
    const ebpo_mesh *mesh;
    double low[3], high[3];
    uint32_t *first, *list, *seen, mark;
} grid;

static double at(const ebpo_mesh *m, uint64_t face, int corner, int k)
{
    uint64_t i = 3 * (uint64_t)m->faces[3 * face + (uint64_t)corner] + (uint64_t)k;
    return m->xyz32 ? (double)m->xyz32[i] : m->xyz64[i];
}

static int cell_of(const grid *g, double x, int k)
{
    double part = (x - g->low[k]) / (g->high[k] - g->low[k]) * SIDE;
    return (int)fmin(fmax(part, 0), SIDE - 1);
}

typedef void (*visit)(grid *g, uint32_t cell, uint32_t face);

static void cells_of(grid *g, const double low[3], const double high[3], uint32_t face, visit do_it)
{
    int a[3], b[3];
    for (int k = 0; k < 3; k++) {
        a[k] = cell_of(g, low[k], k);
        b[k] = cell_of(g, high[k], k);
    }
    for (int z = a[2]; z <= b[2]; z++)
        for (int y = a[1]; y <= b[1]; y++)
            for (int x = a[0]; x <= b[0]; x++)
                do_it(g, (uint32_t)((z * SIDE + y) * SIDE + x), face);
}

static void face_box(const ebpo_mesh *m, uint64_t face, double low[3], double high[3])
{
    for (int k = 0; k < 3; k++) {
        low[k] = fmin(at(m, face, 0, k), fmin(at(m, face, 1, k), at(m, face, 2, k)));
        high[k] = fmax(at(m, face, 0, k), fmax(at(m, face, 1, k), at(m, face, 2, k)));
    }
}

static void tally(grid *g, uint32_t cell, uint32_t face)
{
    (void)face;
    g->first[cell + 1]++;
}

static void enter(grid *g, uint32_t cell, uint32_t face) { g->list[g->first[cell]++] = face; }

static void for_all(grid *g, visit do_it)
{
    double low[3], high[3];
    for (uint64_t f = 0; f < g->mesh->face_count; f++) {
        face_box(g->mesh, f, low, high);
        cells_of(g, low, high, (uint32_t)f, do_it);
    }
}

static void grid_make(grid *g, const ebpo_mesh *mesh)
{
    double low[3], high[3];
    *g = (grid){ .mesh = mesh,
                 .low = { INFINITY, INFINITY, INFINITY },
                 .high = { -INFINITY, -INFINITY, -INFINITY } };
    for (uint64_t f = 0; f < mesh->face_count; f++) {
        face_box(mesh, f, low, high);
        for (int k = 0; k < 3; k++) {
            g->low[k] = fmin(g->low[k], low[k]);
            g->high[k] = fmax(g->high[k], high[k]);
        }
    }
    for (int k = 0; k < 3; k++)
        g->high[k] = g->high[k] > g->low[k] ? g->high[k] : g->low[k] + 1;
    g->first = calloc(CELLS + 2, sizeof *g->first);
    g->seen = calloc(mesh->face_count + 1, sizeof *g->seen);
    for_all(g, tally);
    for (int c = 0; c < CELLS; c++)
        g->first[c + 1] += g->first[c];
    g->list = malloc((g->first[CELLS] + 1) * sizeof *g->list);
    for_all(g, enter); /* each `first` is now the beginning of the next cell */
    for (int c = CELLS; c > 0; c--)
        g->first[c] = g->first[c - 1];
    g->first[0] = 0;
}

static void grid_free(grid *g)
{
    free(g->first);
    free(g->list);
    free(g->seen);
}

/* Returns a reference implementation with the faces that may be within `wide` of the box; NULL
 * when there are none. */
static oracle *judge_around(grid *g, const double p[3], const double q[3], double wide)
{
    double low[3], high[3], l[3], h[3];
    int a[3], b[3];
    ebpo_mesh part = { .face_count = 0 };
    for (int k = 0; k < 3; k++) {
        low[k] = fmin(p[k], q[k]) - wide;
        high[k] = fmax(p[k], q[k]) + wide;
        a[k] = cell_of(g, low[k], k);
        b[k] = cell_of(g, high[k], k);
    }
    uint64_t space = 0;
    g->mark++;
    for (int z = a[2]; z <= b[2]; z++)
        for (int y = a[1]; y <= b[1]; y++)
            for (int x = a[0]; x <= b[0]; x++)
                for (uint32_t c = (uint32_t)((z * SIDE + y) * SIDE + x), i = g->first[c];
                     i < g->first[c + 1]; i++) {
                    uint32_t f = g->list[i];
                    if (g->seen[f] == g->mark)
                        continue;
                    g->seen[f] = g->mark;
                    face_box(g->mesh, f, l, h);
                    bool far = false;
                    for (int k = 0; k < 3; k++)
                        far |= l[k] > high[k] || h[k] < low[k];
                    if (far)
                        continue;
                    if (part.face_count == space) {
                        space = 2 * space + 16;
                        part.xyz64 = realloc(part.xyz64, space * 9 * sizeof(double));
                        part.faces = realloc(part.faces, space * 3 * sizeof(uint32_t));
                    }
                    for (int n = 0; n < 9; n++)
                        part.xyz64[9 * part.face_count + (uint64_t)n] =
                            at(g->mesh, f, n / 3, n % 3);
                    for (uint32_t n = 0; n < 3; n++)
                        part.faces[3 * part.face_count + n] = 3 * (uint32_t)part.face_count + n;
                    part.face_count++;
                }
    part.vertex_count = 3 * part.face_count;
    oracle *out = part.face_count ? oracle_make(&part) : NULL;
    free(part.xyz64);
    free(part.faces);
    return out;
}

static void judge_step(const char *name, oracle *o, const double p[3], const double q[3],
                       double least)
{
    const oracle_hit *hits;
    oracle_nearest near;
    uint32_t count;
    const double motion[3] = { q[0] - p[0], q[1] - p[1], q[2] - p[2] };
    if (!o)
        return;
    oracle_find_nearest(o, q, &near);
    ck_assert_msg(near.distance >= least, "%s: %g from a face", name, near.distance);
    if (motion[0] == 0 && motion[1] == 0 && motion[2] == 0)
        return;
    oracle_ray(o, p, motion, 1, &hits, &count);
    for (uint32_t i = 0; i < count; i++) {
        double n[3];
        oracle_normal(o, hits[i].face, n);
        ck_assert_msg(n[0] == 0 && n[1] == 0 && n[2] == 0, "%s: through a face", name);
    }
}

/* --- proxies --- */

enum { POINTS = 24 };

typedef struct device {
    const query_model *m;
    grid grid;
    ebpo_haptic *haptic;
    ebpo_haptic_options options;
    double point[POINTS][3], arm, diagonal;
    double at[7], force[6], energy, step;
    uint64_t contacts;
} device;

static void turned_by(const double q[4], const double p[3], double out[3])
{
    double u[3], v[3];
    for (int i = 0; i < 3; i++)
        u[i] = q[(i + 1) % 3] * p[(i + 2) % 3] - q[(i + 2) % 3] * p[(i + 1) % 3] + q[3] * p[i];
    for (int i = 0; i < 3; i++)
        v[i] = q[(i + 1) % 3] * u[(i + 2) % 3] - q[(i + 2) % 3] * u[(i + 1) % 3];
    for (int i = 0; i < 3; i++)
        out[i] = p[i] + 2 * v[i];
}

static void check_path(device *h, double motion[][7], uint32_t count)
{
    double margin = h->options.radius + h->options.skin, wide = 0;
    if (h->options.point_count)
        for (int p = 0; p < POINTS; p++)
            wide = fmax(wide, hypot(hypot(h->point[p][0], h->point[p][1]), h->point[p][2]));
    for (uint32_t i = 1; i < count; i++) {
        if (memcmp(motion[i - 1], motion[i], sizeof motion[i]) == 0)
            continue;
        oracle *o = judge_around(&h->grid, motion[i - 1], motion[i], margin + wide);
        if (!h->options.point_count)
            judge_step(h->m->name, o, motion[i - 1], motion[i], margin - h->options.skin / 2);
        for (int p = 0; h->options.point_count && p < POINTS; p++) {
            double a[3], b[3];
            turned_by(motion[i - 1] + 3, h->point[p], a);
            turned_by(motion[i] + 3, h->point[p], b);
            for (int k = 0; k < 3; k++) {
                a[k] += motion[i - 1][k];
                b[k] += motion[i][k];
            }
            judge_step(h->m->name, o, a, b, h->options.skin / 2);
        }
        if (o)
            oracle_free(o);
    }
}

/* Checks the energy. All rotations are about one axis, so that the angle is known. */
static void judge_energy(device *h, const double to[7], double turn)
{
    double square = 0;
    for (int k = 0; k < 3; k++) {
        h->energy += h->force[k] * (to[k] - h->at[k]);
        square += (to[k] - h->at[k]) * (to[k] - h->at[k]);
    }
    h->energy += h->force[5] * turn;
    h->step = fmax(h->step, sqrt(square + h->arm * h->arm * turn * turn));
    ck_assert_msg(h->energy <= h->options.stiffness * h->step * h->step * (1 + 1e-9),
                  "%s: contact gave energy %g, the longest step is %g", h->m->name, h->energy,
                  h->step);
}

static void step_seconds(device *h, const double to[7], double turn)
{
    double motion[EBPO_HAPTIC_PATH_MAX][7] = { { 0 } }, places[EBPO_HAPTIC_PATH_MAX][3];
    uint32_t flags, count;
    judge_energy(h, to, turn);
    if (h->options.point_count) {
        ebpo_haptic_tool_result r;
        in_step = true;
        ebpo_haptic_step_tool(h->haptic, to, to + 3, &r);
        in_step = false;
        memcpy(h->force, r.force, sizeof r.force);
        memcpy(h->force + 3, r.torque, sizeof r.torque);
        flags = r.flags;
        count = ebpo_haptic_tool_path(h->haptic, motion);
    } else {
        ebpo_haptic_ball_result r;
        in_step = true;
        ebpo_haptic_step_ball(h->haptic, to, &r);
        in_step = false;
        memcpy(h->force, r.force, sizeof r.force);
        flags = r.flags;
        count = ebpo_haptic_ball_path(h->haptic, places);
        for (uint32_t i = 0; i < count; i++)
            memcpy(motion[i], places[i], sizeof places[i]);
    }
    h->contacts += (flags & EBPO_HAPTIC_CONTACT) != 0;
    memcpy(h->at, to, sizeof h->at);
    check_path(h, motion, count);
}

static void move_randomly(device *h, uint64_t step_count, uint64_t *state)
{
    const ebpo_info *info = ebpo_file_info(h->m->file);
    double angle = 0;
    for (uint64_t i = 0; i < step_count;) {
        uint64_t steps = ebpo_test_random(state) % 5 ? 1 + ebpo_test_random(state) % 200 : 1;
        double goal[3], from[3] = { h->at[0], h->at[1], h->at[2] };
        double turn =
            h->options.point_count ? (ebpo_test_random_unit(state) - 0.5) / (double)steps : 0;
        for (int k = 0; k < 3; k++)
            goal[k] = info->box_origin[k] +
                      (1.2 * ebpo_test_random_unit(state) - 0.1) * info->box_size[k];
        for (uint64_t s = 1; s <= steps && i < step_count; s++, i++) {
            double to[7] = { 0 }, part = (double)s / (double)steps;
            for (int k = 0; k < 3; k++)
                to[k] = from[k] + (goal[k] - from[k]) * part;
            angle += turn;
            to[5] = sin(angle / 2);
            to[6] = cos(angle / 2);
            step_seconds(h, to, turn);
            if (i % 16 == 0)
                pause_a_little();
        }
    }
}

/* Returns false when the position is unsuitable, or the model is beyond the range for haptic
 * proxies. */
static bool begin(device *h, const query_model *m, bool tool, uint64_t *state)
{
    const ebpo_info *info = ebpo_file_info(m->file);
    double square = 0, place[3];
    *h = (device){ .m = m, .options = EBPO_HAPTIC_OPTIONS_INIT, .arm = 1 };
    for (int k = 0; k < 3; k++) {
        place[k] =
            info->box_origin[k] + (1.4 * ebpo_test_random_unit(state) - 0.2) * info->box_size[k];
        h->diagonal = hypot(h->diagonal, info->box_size[k]);
    }
    for (int p = 0; p < POINTS; p++)
        for (int k = 0; k < 3; k++) {
            h->point[p][k] = 0.04 * h->diagonal * (ebpo_test_random_unit(state) - 0.5);
            square += h->point[p][k] * h->point[p][k] / POINTS;
        }
    h->options.skin = 1e-4 * h->diagonal;
    h->options.search_radius = 2e-3 * h->diagonal;
    h->options.faces = 1 << 14;
    h->options.friction = ebpo_test_random(state) % 2 ? 0.3 : 0;
    if (tool) {
        h->arm = sqrt(square);
        h->options.kind = EBPO_HAPTIC_TOOL;
        h->options.points = (const double(*)[3])h->point;
        h->options.point_count = POINTS;
    } else {
        h->options.radius = ebpo_test_random(state) % 2 ? 0.01 * h->diagonal : 0;
    }
    memcpy(h->at, place, sizeof place);
    h->at[6] = 1;
    ebpo_error why = EBPO_ERROR_INIT;
    ebpo_status status = ebpo_haptic_new(m->model, &h->options, place, &h->haptic, &why);
    ck_assert_msg(status == EBPO_OK || status == EBPO_E_ARGUMENT || status == EBPO_E_UNSUPPORTED ||
                      status == EBPO_E_LIMIT,
                  "%s: %s", m->name, why.message);
    return status == EBPO_OK;
}

static uint64_t play(const query_model *m, bool tool, uint64_t step_count, uint64_t seed)
{
    uint64_t state = seed, contacts = 0;
    for (int turn = 0; turn < 40; turn++) {
        device h;
        if (!begin(&h, m, tool, &state))
            continue;
        grid_make(&h.grid, &m->mesh);
        move_randomly(&h, step_count, &state);
        contacts = h.contacts;
        ASSERT_OK(ebpo_haptic_check(h.haptic, error));
        ebpo_haptic_free(h.haptic);
        grid_free(&h.grid);
        break;
    }
    ck_assert_msg(forbidden == 0, "%lu forbidden calls in haptic steps", forbidden);
    return contacts;
}

static const char *const names[] = { "fertility",     "cheese_g133", "selfint_A",
                                     "cad_adis16480", "armadillo",   "lucy100k" };
enum { NAMES = sizeof names / sizeof *names, SMALL = 4 };

START_TEST(test_haptic_on_real_models)
{
    const char *folder = getenv("EBPO_MODELS");
    char path[1024];
    ebpo_mesh mesh;
    ebpo_error error = EBPO_ERROR_INIT;
    query_model m;
    if (!folder || (_i / 2 >= SMALL && ebpo_test_scale() < 1))
        return;
    snprintf(path, sizeof path, "%s/%s.ply", folder, names[_i / 2]);
    ck_assert_msg(ebpo_mesh_read(path, NULL, &mesh, &error) == EBPO_OK, "%s", error.message);
    query_model_make(&m, names[_i / 2], mesh, &query_variants[0]);
    uint64_t step_count = query_scaled(2000);
    uint64_t contacts = play(&m, _i % 2, step_count, 40 + (uint64_t)_i);
    ck_assert_msg(contacts > 0 || step_count < 2000, "%s: never in contact", names[_i / 2]);
    query_model_free(&m);
}
END_TEST

START_TEST(test_haptic_on_degenerate_models)
{
    const degenerate_case *c = &degenerate_cases[_i / 2];
    ebpo_error error = EBPO_ERROR_INIT;
    query_model m;
    if (_i / 2 % 12 && ebpo_test_scale() < 1)
        return; /* runs only a share of the cases */
    ebpo_mesh mesh = c->make(c);
    if (mesh.face_count > 20000 || c->status != EBPO_OK) {
        ebpo_mesh_free(&mesh);
        return;
    }
    if (query_model_try(&m, c->name, mesh, &query_variants[0], &error) != EBPO_OK)
        return; /* test_degenerate checks these cases */
    play(&m, _i % 2, query_scaled(2000), 80 + (uint64_t)_i);
    query_model_free(&m);
}
END_TEST

TEST_SUITE(haptic_models)
{
    Suite *suite = suite_create("haptic_models");
    TCase *models = tcase_create("models");
    watch_gmp();
    tcase_set_timeout(models, 7200);
    tcase_add_loop_test(models, test_haptic_on_real_models, 0, 2 * NAMES);
    TCase *degenerate = tcase_create("degenerate");
    tcase_set_timeout(degenerate, 7200);
    tcase_add_loop_test(degenerate, test_haptic_on_degenerate_models, 0, 2 * degenerate_case_count);
    suite_add_tcase(suite, models);
    suite_add_tcase(suite, degenerate);
    return suite;
}
