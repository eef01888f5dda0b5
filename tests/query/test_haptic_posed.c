/* Haptic objects for several models at poses. The faces of all models, posed, are one set of
 * triangles, which the oracle judges with integers of any size:
 * - no point of a ball's centre or of a tool passes a face or comes too close to one
 * - the device gains no energy
 * - the bounds of a probe contain the distance, and its side is correct
 * Two cubes that share a face feel like the box that they form. Hundreds of models do not slow the
 * proxy down. */
#include <stdlib.h>
#include <ebpo/haptic.h>
#include <math.h>
#include <string.h>

#include "check_main.h"
#include "query_support.h"
#include "geometry/pose.h"
#include "haptic_watch.h"

enum { PARTS = 3, POINTS = 6 };

typedef struct scene {
    query_model m[PARTS];
    ebpo_haptic_instance instance[PARTS];
    oracle *one[PARTS], *all; /* posed faces of each instance, and of all */
    uint64_t first[PARTS];    /* index in `all` of the first face of each instance */
    int count;
    double low[3], high[3], diagonal;
} scene;

static double random_of(uint64_t *state) { return 2 * ebpo_test_random_unit(state) - 1; }

/* Copies the mesh with posed coordinates. */
static ebpo_mesh posed_mesh(const query_model *m, const ebpo_pose *pose)
{
    ebpo_mesh out = m->mesh;
    ebpo_posing posing;
    const double largest[3] = { m->largest, m->largest, m->largest };
    ASSERT_OK(ebpo_posing_make(&posing, pose, largest, error));
    out.xyz32 = NULL;
    out.xyz64 = query_alloc(3 * out.vertex_count, sizeof *out.xyz64);
    for (uint64_t i = 0; i < out.vertex_count; i++) {
        double at[3];
        for (int k = 0; k < 3; k++)
            at[k] = m->mesh.xyz32 ? (double)m->mesh.xyz32[3 * i + (uint64_t)k]
                                  : m->mesh.xyz64[3 * i + (uint64_t)k];
        ebpo_posing_apply(&posing, at, out.xyz64 + 3 * i);
    }
    return out;
}

/* Appends a mesh. */
static void append_mesh(ebpo_mesh *all, const ebpo_mesh *more)
{
    all->xyz64 = realloc(all->xyz64, 24 * (all->vertex_count + more->vertex_count));
    all->faces = realloc(all->faces, 12 * (all->face_count + more->face_count));
    ck_assert(all->xyz64 && all->faces);
    memcpy(all->xyz64 + 3 * all->vertex_count, more->xyz64, 24 * more->vertex_count);
    for (uint64_t i = 0; i < 3 * more->face_count; i++)
        all->faces[3 * all->face_count + i] = more->faces[i] + (uint32_t)all->vertex_count;
    all->vertex_count += more->vertex_count;
    all->face_count += more->face_count;
}

static void widen(scene *s, const ebpo_mesh *mesh)
{
    for (uint64_t i = 0; i < 3 * mesh->vertex_count; i++) {
        s->low[i % 3] = fmin(s->low[i % 3], mesh->xyz64[i]);
        s->high[i % 3] = fmax(s->high[i % 3], mesh->xyz64[i]);
    }
}

/* Makes a scene of meshes [count], which are consumed. */
static void scene_make(scene *s, ebpo_mesh *mesh, const ebpo_pose *pose, int count)
{
    ebpo_mesh all = { 0 };
    *s = (scene){ .count = count };
    for (int k = 0; k < 3; k++) {
        s->low[k] = INFINITY;
        s->high[k] = -INFINITY;
    }
    for (int i = 0; i < count; i++) {
        query_model_make(&s->m[i], "part", mesh[i], &query_variants[0]);
        ebpo_mesh posed = posed_mesh(&s->m[i], &pose[i]);
        s->instance[i] = (ebpo_haptic_instance){ s->m[i].model, pose[i] };
        s->one[i] = oracle_make(&posed);
        s->first[i] = all.face_count;
        append_mesh(&all, &posed);
        widen(s, &posed);
        free(posed.xyz64);
    }
    s->all = oracle_make(&all);
    free(all.xyz64);
    free(all.faces);
    for (int k = 0; k < 3; k++)
        s->diagonal = hypot(s->diagonal, s->high[k] - s->low[k]);
}

static void scene_free(scene *s)
{
    for (int i = 0; i < s->count; i++) {
        oracle_free(s->one[i]);
        query_model_free(&s->m[i]);
    }
    oracle_free(s->all);
}

/* Makes a scene of overlapping models with random rotations and scales. */
static void scene_random(scene *s, int number, uint64_t *state)
{
    static const char *const names[][PARTS] = { { "sphere", "thin_wall", "l_shape" },
                                                { "cavity", "open_box", "cone_slivers" },
                                                { "turned_boxes", "blob", "staircase" } };
    ebpo_mesh mesh[PARTS];
    ebpo_pose pose[PARTS];
    for (int i = 0; i < PARTS; i++) {
        const double quaternion[4] = { random_of(state), random_of(state), random_of(state), 1 };
        double largest = 0, low[3], high[3];
        mesh[i] = query_solid_by_name(names[number % 3][i]);
        pose[i] = (ebpo_pose)EBPO_POSE_INIT;
        ASSERT_OK(ebpo_pose_turn(&pose[i], quaternion, error));
        for (uint64_t v = 0; v < 3 * mesh[i].vertex_count; v++) {
            double x = mesh[i].xyz32 ? (double)mesh[i].xyz32[v] : mesh[i].xyz64[v];
            low[v % 3] = v < 3 ? x : fmin(low[v % 3], x);
            high[v % 3] = v < 3 ? x : fmax(high[v % 3], x);
        }
        for (int k = 0; k < 3; k++)
            largest = fmax(largest, high[k] - low[k]);
        pose[i].scale = (0.7 + 0.5 * ebpo_test_random_unit(state)) / largest;
        for (int k = 0; k < 3; k++) /* the middle of the model is near the origin */
            for (int n = 0; n < 3; n++)
                pose[i].translation[k] -=
                    pose[i].rotation[k][n] * pose[i].scale * (low[n] + high[n]) / 2;
        for (int k = 0; k < 3; k++)
            pose[i].translation[k] += 0.5 * random_of(state);
    }
    scene_make(s, mesh, pose, PARTS);
}

static void choose(const scene *s, uint64_t *state, double out[3])
{
    for (int k = 0; k < 3; k++)
        out[k] = s->low[k] + (1.4 * ebpo_test_random_unit(state) - 0.2) * (s->high[k] - s->low[k]);
}

/* --- balls and tools --- */

typedef struct judged {
    scene *s;
    ebpo_haptic *haptic;
    ebpo_haptic_options options;
    double point[POINTS][3];
    double pose[7], device[7], force[6]; /* of the proxy and of the device: position, quaternion */
    double arm, energy, step;
    uint64_t contacts, instances[PARTS];
} judged;

static void turned_by(const double q[4], const double p[3], double out[3])
{
    double t[3];
    for (int i = 0; i < 3; i++)
        t[i] = 2 * (q[(i + 1) % 3] * p[(i + 2) % 3] - q[(i + 2) % 3] * p[(i + 1) % 3]);
    for (int i = 0; i < 3; i++)
        out[i] =
            p[i] + q[3] * t[i] + q[(i + 1) % 3] * t[(i + 2) % 3] - q[(i + 2) % 3] * t[(i + 1) % 3];
}

static void judge_point(judged *j, const double from[3], const double to[3])
{
    const oracle_hit *hits;
    oracle_nearest near;
    uint32_t count = 0;
    double motion[3], n[3];
    for (int i = 0; i < 3; i++)
        motion[i] = to[i] - from[i];
    oracle_find_nearest(j->s->all, to, &near);
    ck_assert_msg(near.distance >= j->options.radius + j->options.skin / 2, "%g from a face",
                  near.distance);
    if (motion[0] != 0 || motion[1] != 0 || motion[2] != 0)
        oracle_ray(j->s->all, from, motion, 1, &hits, &count);
    for (uint32_t i = 0; i < count; i++) {
        oracle_normal(j->s->all, hits[i].face, n);
        ck_assert_msg(n[0] == 0 && n[1] == 0 && n[2] == 0, "a point went through face %u",
                      hits[i].face);
    }
}

static void check_path(judged *j, const double path[][7], uint32_t count)
{
    ck_assert_uint_ge(count, 1);
    ck_assert_mem_eq(path[0], j->pose, sizeof j->pose);
    for (uint32_t i = 1; i < count; i++)
        for (int p = 0; p < (j->options.points ? POINTS : 1); p++) {
            double a[3] = { 0 }, b[3] = { 0 };
            if (j->options.points) {
                turned_by(path[i - 1] + 3, j->point[p], a);
                turned_by(path[i] + 3, j->point[p], b);
            }
            for (int k = 0; k < 3; k++) {
                a[k] += path[i - 1][k];
                b[k] += path[i][k];
            }
            judge_point(j, a, b);
        }
    memcpy(j->pose, path[count - 1], sizeof j->pose);
}

/* Checks the energy of a device that moves without rotation. */
static void judge_energy(judged *j, const double device[7])
{
    double length = 0;
    for (int i = 0; i < 3; i++) {
        j->energy += j->force[i] * (device[i] - j->device[i]);
        length = hypot(length, device[i] - j->device[i]);
    }
    j->step = fmax(j->step, length);
    ck_assert_msg(j->energy <= j->options.stiffness * j->step * j->step * (1 + 1e-9),
                  "contact gave energy %g, the longest step is %g", j->energy, j->step);
    memcpy(j->device, device, sizeof j->device);
}

static void count_contact(judged *j, uint64_t face, uint64_t instance)
{
    j->contacts++;
    if (face == EBPO_NO_FACE)
        return;
    ck_assert_uint_lt(instance, (uint64_t)j->s->count);
    ck_assert_uint_lt(face, j->s->m[instance].mesh.face_count);
    j->instances[instance]++;
}

static void judge_step(judged *j, const double device[7])
{
    double path[EBPO_HAPTIC_PATH_MAX][7] = { { 0 } }, centre[EBPO_HAPTIC_PATH_MAX][3];
    ebpo_haptic_ball_result ball;
    ebpo_haptic_tool_result tool;
    uint32_t count;
    judge_energy(j, device);
    if (j->options.points) {
        in_step = true;
        ebpo_haptic_step_tool(j->haptic, device, device + 3, &tool);
        in_step = false;
        memcpy(j->force, tool.force, sizeof tool.force);
        if (tool.flags & EBPO_HAPTIC_CONTACT)
            count_contact(j, tool.face, tool.instance);
        check_path(j, (const double(*)[7])path, ebpo_haptic_tool_path(j->haptic, path));
        return;
    }
    in_step = true;
    ebpo_haptic_step_ball(j->haptic, device, &ball);
    in_step = false;
    memcpy(j->force, ball.force, sizeof ball.force);
    if (ball.flags & EBPO_HAPTIC_CONTACT)
        count_contact(j, ball.face, ball.instance);
    count = ebpo_haptic_ball_path(j->haptic, centre);
    for (uint32_t i = 0; i < count; i++) {
        memcpy(path[i], centre[i], sizeof centre[i]);
        path[i][6] = 1;
    }
    check_path(j, (const double(*)[7])path, count);
}

static bool begin(judged *j, scene *s, bool is_tool, uint64_t *state)
{
    ebpo_error error = EBPO_ERROR_INIT;
    *j = (judged){ .s = s, .options = EBPO_HAPTIC_OPTIONS_INIT };
    choose(s, state, j->pose);
    j->pose[6] = 1;
    memcpy(j->device, j->pose, sizeof j->device);
    j->options.skin = (is_tool ? 1e-4 : 1e-5) * s->diagonal;
    j->options.search_radius = 0.05 * s->diagonal;
    j->options.faces = 1 << 11;
    j->options.radius = is_tool || ebpo_test_random(state) % 2 ? 0 : 0.02 * s->diagonal;
    j->options.friction = ebpo_test_random(state) % 2 ? 0.3 : 0;
    j->options.kind = is_tool ? EBPO_HAPTIC_TOOL : EBPO_HAPTIC_BALL;
    j->options.points = is_tool ? (const double(*)[3])j->point : NULL;
    j->options.point_count = is_tool ? POINTS : 0;
    for (int p = 0; p < POINTS; p++)
        for (int k = 0; k < 3; k++)
            j->point[p][k] = 0.04 * s->diagonal * random_of(state);
    ebpo_status status = ebpo_haptic_new_posed(s->instance, (uint64_t)s->count, &j->options,
                                               j->pose, &j->haptic, &error);
    ck_assert_msg(status == EBPO_OK || status == EBPO_E_ARGUMENT, "%s", error.message);
    return status == EBPO_OK;
}

/* Returns a number of inputs for the test's scale, enough for contacts at any scale. */
static uint64_t scaled(uint64_t count, uint64_t least)
{
    uint64_t n = query_scaled(count);
    return n > least ? n : least;
}

static void move_randomly(judged *j, uint64_t step_count, uint64_t *state)
{
    for (uint64_t i = 0; i < step_count;) {
        uint64_t steps = ebpo_test_random(state) % 3 ? 1 + ebpo_test_random(state) % 40 : 1;
        double goal[3], from[3], device[7] = { 0, 0, 0, 0, 0, 0, 1 };
        choose(j->s, state, goal);
        memcpy(from, j->device, sizeof from);
        for (uint64_t s = 1; s <= steps && i < step_count; s++, i++) {
            for (int k = 0; k < 3; k++)
                device[k] = from[k] + (goal[k] - from[k]) * (double)s / (double)steps;
            judge_step(j, device);
            if (i % 4 == 0)
                pause_a_little();
        }
    }
}

START_TEST(test_haptic_posed_proxy_never_penetrates)
{
    uint64_t state = 900 + (uint64_t)_i, contacts = 0, instances = 0;
    scene s;
    scene_random(&s, _i / 2, &state);
    for (int turn = 0, begun = 0; turn < 60 && begun < 3; turn++) {
        judged j;
        if (!begin(&j, &s, _i % 2, &state))
            continue;
        begun++;
        move_randomly(&j, scaled(_i % 2 ? 400 : 3000, _i % 2 ? 60 : 150), &state);
        ASSERT_OK(ebpo_haptic_check(j.haptic, error));
        ebpo_haptic_free(j.haptic);
        contacts += j.contacts;
        for (int i = 0; i < s.count; i++)
            instances += j.instances[i] > 0;
    }
    ck_assert_uint_gt(contacts, 5);
    ck_assert_uint_gt(instances, 1);
    ck_assert_msg(forbidden == 0, "%lu forbidden calls in haptic steps", forbidden);
    scene_free(&s);
}
END_TEST

/* --- probes --- */

static double exact(scene *s, const double place[3], int32_t *where)
{
    oracle_nearest near, own;
    oracle_find_nearest(s->all, place, &near);
    *where = EBPO_OUT;
    for (int i = 0; i < s->count && *where != EBPO_IN; i++) {
        if (!s->m[i].info.solid)
            continue;
        oracle_find_nearest(s->one[i], place, &own);
        if (own.on)
            *where = EBPO_ON;
        else if (oracle_winding(s->one[i], place) != 0) /* EBPO_RULE_NONZERO */
            *where = EBPO_IN;
    }
    return *where == EBPO_IN ? -near.distance : near.distance;
}

/* Returns true if the distance is known. */
static bool judge_probe(scene *s, ebpo_haptic *haptic, const double place[3], uint64_t *sided)
{
    ebpo_haptic_probe_result r;
    int32_t where;
    in_step = true;
    ebpo_haptic_step_probe(haptic, place, &r);
    in_step = false;
    double truth = exact(s, place, &where), rounding = 0x1p-36 * s->diagonal;
    ck_assert_msg(r.lo <= truth + rounding && truth <= r.hi + rounding,
                  "%.17g is not from %.17g to %.17g, where %d (%d), at %.17g %.17g %.17g, flags %u",
                  truth, r.lo, r.hi, r.where, where, place[0], place[1], place[2], r.flags);
    ck_assert_msg(r.where == EBPO_MAYBE || r.where == where, "where %d, not %d", r.where, where);
    *sided += r.where != EBPO_MAYBE;
    if (!(r.flags & EBPO_HAPTIC_ACCURATE))
        return false;
    ck_assert_msg(fabs(r.distance - truth) <= rounding, "%.17g, not %.17g", r.distance, truth);
    return true;
}

START_TEST(test_haptic_posed_probe_bounds_exact_distance)
{
    uint64_t state = 300 + (uint64_t)_i, goals = scaled(200, 20), sided = 0, close = 0, inside = 0;
    ebpo_haptic_options options = EBPO_HAPTIC_OPTIONS_INIT;
    ebpo_haptic *haptic;
    scene s;
    double at[3], goal[3];
    scene_random(&s, _i, &state);
    options.kind = EBPO_HAPTIC_PROBE;
    options.search_radius = 0.05 * s.diagonal;
    options.faces = 1 << 11;
    choose(&s, &state, at);
    ASSERT_OK(ebpo_haptic_new_posed(s.instance, PARTS, &options, at, &haptic, error));
    for (uint64_t i = 0; i < goals; i++) {
        int32_t where;
        choose(&s, &state, goal);
        for (int step = 1; step <= 10; step++) {
            double place[3];
            for (int k = 0; k < 3; k++)
                place[k] = at[k] + (goal[k] - at[k]) * step / 10;
            (void)judge_probe(&s, haptic, place, &sided);
        }
        memcpy(at, goal, sizeof at);
        int rests = 0;
        for (; rests < 20000 && !judge_probe(&s, haptic, at, &sided); rests++)
            pause_a_little();
        close += rests < 20000;
        (void)exact(&s, at, &where);
        inside += where == EBPO_IN;
    }
    ck_assert_uint_eq(close, goals); /* a probe at rest finds its distance */
    ck_assert_uint_ge(sided, close);
    ck_assert_uint_gt(inside, 0);
    ck_assert_msg(forbidden == 0, "%lu forbidden calls in haptic steps", forbidden);
    ASSERT_OK(ebpo_haptic_check(haptic, error));
    ebpo_haptic_free(haptic);
    scene_free(&s);
}
END_TEST

/* The matrix of a pose may differ from a rotation by 2^-20. Far away, this changes distances by
 * more than rounding. */
START_TEST(test_haptic_posed_probe_bounds_distance_of_inexact_rotation)
{
    ebpo_mesh mesh[1] = { query_solid_by_name("l_shape") };
    ebpo_pose pose[1] = { EBPO_POSE_INIT };
    ebpo_haptic_options options = EBPO_HAPTIC_OPTIONS_INIT;
    ebpo_haptic_probe_result r = { .hi = INFINITY };
    const double at[3] = { 300, 200, 100 };
    ebpo_haptic *haptic;
    oracle_nearest near;
    scene s;
    for (int k = 0; k < 3; k++)
        pose[0].rotation[k][k] += 0x1p-22;
    scene_make(&s, mesh, pose, 1);
    options.kind = EBPO_HAPTIC_PROBE;
    ASSERT_OK(ebpo_haptic_new_posed(s.instance, 1, &options, at, &haptic, error));
    oracle_find_nearest(s.all, at, &near);
    for (int rests = 0; !(r.hi - r.lo < 0.01); rests++) {
        ck_assert_int_lt(rests, 20000);
        pause_a_little();
        ebpo_haptic_step_probe(haptic, at, &r);
        ck_assert_msg(r.lo <= near.distance && near.distance <= r.hi,
                      "%.17g is not from %.17g to %.17g", near.distance, r.lo, r.hi);
        ck_assert(!(r.flags & EBPO_HAPTIC_ACCURATE));
    }
    ebpo_haptic_free(haptic);
    scene_free(&s);
}
END_TEST

/* --- two cubes with a common face --- */

static ebpo_mesh box_mesh(double length)
{
    const double low[3] = { 0, 0, 0 }, high[3] = { length, 1, 1 };
    return ebpo_test_box(low, high, 4);
}

/* A ball slides over the common edge of two cubes; one of them is rotated by a right angle. */
START_TEST(test_haptic_two_cubes_feel_like_their_union)
{
    ebpo_mesh mesh[2] = { box_mesh(1), box_mesh(1) };
    ebpo_pose pose[2] = { EBPO_POSE_INIT, EBPO_POSE_INIT };
    const double quarter[4] = { 0, 0, 1, 1 }, start[3] = { 0.3, 0.4, 1.5 };
    ebpo_haptic_options options = EBPO_HAPTIC_OPTIONS_INIT;
    ebpo_haptic *two, *one;
    ebpo_haptic_ball_result a, b = { .flags = 0 };
    query_model box;
    scene s;
    uint64_t contacts = 0, second = 0;
    pose[1].translation[0] = 2;
    ASSERT_OK(ebpo_pose_turn(&pose[1], quarter, error));
    scene_make(&s, mesh, pose, 2);
    query_model_make(&box, "box", box_mesh(2), &query_variants[0]);
    options.radius = _i ? 0.05 : 0;
    options.skin = 1e-5;
    options.search_radius = 0.1;
    ASSERT_OK(ebpo_haptic_new_posed(s.instance, 2, &options, start, &two, error));
    ASSERT_OK(ebpo_haptic_new(box.model, &options, start, &one, error));
    for (int i = 0; i < 2000; i++) {
        const double at[3] = { 0.3 + 0.0007 * i, 0.4 + 0.0001 * i,
                               fmax(0.97 + options.radius, 1.5 - 0.002 * i) };
        a.flags = EBPO_HAPTIC_WAITING; /* for the loading threads */
        for (int wait = 0; (a.flags | b.flags) & EBPO_HAPTIC_WAITING; wait++) {
            ck_assert_int_lt(wait, 20000);
            if (wait > 0)
                pause_a_little();
            ebpo_haptic_step_ball(two, at, &a);
            ebpo_haptic_step_ball(one, at, &b);
        }
        for (int k = 0; k < 3; k++) {
            ck_assert_double_le(fabs(a.proxy[k] - b.proxy[k]), options.skin);
            ck_assert_double_le(fabs(a.force[k] - b.force[k]), 400 * options.skin);
        }
        ck_assert_uint_eq(a.flags & EBPO_HAPTIC_CONTACT, b.flags & EBPO_HAPTIC_CONTACT);
        contacts += (a.flags & EBPO_HAPTIC_CONTACT) != 0;
        if (a.flags & EBPO_HAPTIC_CONTACT && fabs(a.proxy[0] - 1) > 0.06)
            ck_assert_uint_eq(a.instance, a.proxy[0] > 1);
        second += (a.flags & EBPO_HAPTIC_CONTACT) && a.instance == 1;
    }
    ck_assert_uint_gt(contacts, 1500);
    ck_assert_uint_gt(second, 500);
    ebpo_haptic_free(two);
    ebpo_haptic_free(one);
    query_model_free(&box);
    scene_free(&s);
}
END_TEST

/* --- many models --- */

enum { SIDE = 8, MANY = SIDE * SIDE * SIDE };

/* Poses the model at all nodes of a lattice, in a random order, with random rotations. */
static void fill_lattice(ebpo_haptic_instance instance[MANY], ebpo_model *model, uint64_t *state)
{
    for (int i = 0; i < MANY; i++) {
        const double quaternion[4] = { random_of(state), random_of(state), random_of(state), 1 };
        uint64_t other = ebpo_test_random(state) % (uint64_t)(i + 1);
        ebpo_pose pose = EBPO_POSE_INIT;
        ASSERT_OK(ebpo_pose_turn(&pose, quaternion, error));
        for (int k = 0, n = i; k < 3; k++, n /= SIDE)
            pose.translation[k] = n % SIDE;
        pose.scale = 0.4; /* half of the diagonal is less than 0.5 */
        instance[i] = instance[other];
        instance[other] = (ebpo_haptic_instance){ model, pose };
    }
}

/* Makes a step, and returns its flags. */
static uint32_t step_to(ebpo_haptic *haptic, bool is_tool, const double at[3])
{
    static const double turn[4] = { 0, 0, 0, 1 };
    ebpo_haptic_ball_result ball;
    ebpo_haptic_tool_result tool;
    if (!is_tool) {
        ebpo_haptic_step_ball(haptic, at, &ball);
        return ball.flags;
    }
    ebpo_haptic_step_tool(haptic, at, turn, &tool);
    return tool.flags;
}

/* A ball or a tool moves in the gaps between the models, and arrives without delay. */
START_TEST(test_haptic_follows_between_many_instances)
{
    static ebpo_haptic_instance instance[MANY];
    static const double point[2][3] = { { 0.01, 0, 0 }, { 0, 0.01, 0 } };
    const double low[3] = { -0.5, -0.5, -0.5 }, high[3] = { 0.5, 0.5, 0.5 };
    uint64_t state = 7;
    query_model cube;
    ebpo_haptic_options options = EBPO_HAPTIC_OPTIONS_INIT;
    ebpo_haptic *haptic;
    double at[3] = { -0.5, -0.5, -0.5 };
    query_model_make(&cube, "cube", ebpo_test_box(low, high, 1), &query_variants[0]);
    fill_lattice(instance, cube.model, &state);
    options.skin = 1e-3;
    options.search_radius = 0.05;
    options.kind = _i ? EBPO_HAPTIC_TOOL : EBPO_HAPTIC_BALL;
    options.points = _i ? point : NULL;
    options.point_count = _i ? 2 : 0;
    ASSERT_OK(ebpo_haptic_new_posed(instance, MANY, &options, at, &haptic, error));
    for (int leg = 0; leg < 60; leg++) {
        uint32_t flags = EBPO_HAPTIC_WAITING;
        at[leg % 3] = (double)(ebpo_test_random(&state) % SIDE) - 0.5;
        for (int waits = 0, steps = 0; flags && steps < 40 && waits < 20000;) {
            flags = step_to(haptic, _i, at);
            if (flags & EBPO_HAPTIC_WAITING) {
                waits++;
                pause_a_little(); /* for the loading thread */
            } else {
                steps++;
            }
        }
        ck_assert_uint_eq(flags, 0);
    }
    ebpo_haptic_free(haptic);
    query_model_free(&cube);
}
END_TEST

START_TEST(test_haptic_posed_refuses_invalid_instances)
{
    static const struct {
        double at[3];
        const char *part;
    } inside[] = { { { 0.5, 0.5, 0.5 }, "in the solid" }, { { 1.5, 0.5, 1.00001 }, "distance" } };
    ebpo_mesh mesh[2] = { box_mesh(1), box_mesh(1) };
    ebpo_pose pose[2] = { EBPO_POSE_INIT, EBPO_POSE_INIT };
    ebpo_error error = EBPO_ERROR_INIT;
    ebpo_haptic_options options = EBPO_HAPTIC_OPTIONS_INIT;
    ebpo_haptic *haptic;
    scene s;
    const double start[3] = { 0.5, 0.5, 2 };
    pose[1].translation[0] = 1;
    scene_make(&s, mesh, pose, 2);
    options.skin = 1e-4;
    ck_assert_int_eq(ebpo_haptic_new_posed(s.instance, 0, &options, start, &haptic, &error),
                     EBPO_E_ARGUMENT);
    for (int i = 0; i < 2; i++) {
        ck_assert_int_eq(ebpo_haptic_new_posed(s.instance, 2, &options, inside[i].at, &haptic,
                                               &error),
                         EBPO_E_ARGUMENT);
        ck_assert_msg(strstr(error.message, inside[i].part) != NULL, "%s", error.message);
        ck_assert_ptr_null(haptic);
    }
    s.instance[1].pose.rotation[0][0] = 2;
    ck_assert_int_eq(ebpo_haptic_new_posed(s.instance, 2, &options, start, &haptic, &error),
                     EBPO_E_ARGUMENT);
    ck_assert_msg(strstr(error.message, "pose") != NULL, "%s", error.message);
    scene_free(&s);
}
END_TEST

TEST_SUITE(haptic_posed)
{
    Suite *suite = suite_create("haptic_posed");
    TCase *posed = tcase_create("posed");
    watch_gmp();
    tcase_set_timeout(posed, 600);
    tcase_add_loop_test(posed, test_haptic_posed_proxy_never_penetrates, 0, 6);
    tcase_add_loop_test(posed, test_haptic_posed_probe_bounds_exact_distance, 0, 3);
    tcase_add_test(posed, test_haptic_posed_probe_bounds_distance_of_inexact_rotation);
    tcase_add_loop_test(posed, test_haptic_two_cubes_feel_like_their_union, 0, 2);
    tcase_add_loop_test(posed, test_haptic_follows_between_many_instances, 0, 2);
    tcase_add_test(posed, test_haptic_posed_refuses_invalid_instances);
    suite_add_tcase(suite, posed);
    return suite;
}
