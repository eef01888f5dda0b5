/* A tool of many points:
 * - for any motion and rotation of device and tool, no point passes a face or gets closer than half
 *   a skin (checked by exact arithmetic)
 * - force and torque on a plane, and the energy, follow the formulas
 * - a ball follows the device over a rough surface
 * - a haptic step calls nothing that could delay it */
#include <stdlib.h>
#include <ebpo/haptic.h>
#include <math.h>

#include "check_main.h"
#include "query_support.h"
#include "extras/haptic/tool.h"
#include "haptic_watch.h"

enum { POINTS = 40 };

typedef struct pose {
    double place[3], turn[4];
} pose;

typedef struct judged {
    query_model *m;
    ebpo_haptic *haptic;
    ebpo_haptic_options options;
    double point[POINTS][3], arm, diagonal;
    pose proxy, device;
    double force[3], torque[3], energy, step;
} judged;

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

static void point_at(const pose *at, const double p[3], double out[3])
{
    turned_by(at->turn, p, out);
    for (int i = 0; i < 3; i++)
        out[i] += at->place[i];
}

static double length(const double a[3]) { return hypot(hypot(a[0], a[1]), a[2]); }

/* The rotation from a to b, as a vector. */
static void turn_between(const double a[4], const double b[4], double out[3])
{
    double w = a[3] * b[3], v[3];
    for (int i = 0; i < 3; i++) {
        int j = (i + 1) % 3, k = (i + 2) % 3;
        v[i] = a[3] * b[i] - b[3] * a[i] - b[j] * a[k] + b[k] * a[j];
        w += a[i] * b[i];
    }
    double sine = length(v), angle = 2 * atan2(sine, fabs(w));
    for (int i = 0; i < 3; i++)
        out[i] = sine > 0 ? (w < 0 ? -angle : angle) * v[i] / sine : 0;
}

static bool has_area(judged *j, uint32_t face)
{
    double n[3];
    oracle_normal(j->m->judge, face, n);
    return n[0] != 0 || n[1] != 0 || n[2] != 0;
}

static void judge_point(judged *j, const double from[3], const double to[3])
{
    const oracle_hit *hits;
    oracle_nearest near;
    uint32_t count;
    double motion[3];
    for (int i = 0; i < 3; i++)
        motion[i] = to[i] - from[i];
    oracle_find_nearest(j->m->judge, to, &near);
    ck_assert_msg(near.distance >= j->options.skin * 0.5, "%s: %g from a face, skin %g", j->m->name,
                  near.distance, j->options.skin);
    if (motion[0] == 0 && motion[1] == 0 && motion[2] == 0)
        return;
    oracle_ray(j->m->judge, from, motion, 1, &hits, &count);
    for (uint32_t i = 0; i < count; i++)
        ck_assert_msg(!has_area(j, hits[i].face), "%s: a point went through face %u", j->m->name,
                      hits[i].face);
}

static void check_path(judged *j, const ebpo_haptic_tool_result *r)
{
    double path[EBPO_HAPTIC_PATH_MAX][7];
    uint32_t count = ebpo_haptic_tool_path(j->haptic, path);
    ck_assert_uint_ge(count, 1);
    ck_assert_mem_eq(path[0], &j->proxy, sizeof j->proxy);
    ck_assert_mem_eq(path[count - 1], r->proxy, sizeof r->proxy);
    ck_assert_mem_eq(path[count - 1] + 3, r->turn, sizeof r->turn);
    for (uint32_t i = 1; i < count; i++) {
        pose from, to;
        memcpy(&from, path[i - 1], sizeof from);
        memcpy(&to, path[i], sizeof to);
        for (int p = 0; p < POINTS; p++) {
            double a[3], b[3];
            point_at(&from, j->point[p], a);
            point_at(&to, j->point[p], b);
            judge_point(j, a, b);
        }
    }
}

/* Checks that a moving and rotating device gains no more energy than its longest step allows. */
static void judge_energy(judged *j, const pose *device)
{
    double turn[3], motion[3];
    turn_between(j->device.turn, device->turn, turn);
    for (int i = 0; i < 3; i++) {
        motion[i] = device->place[i] - j->device.place[i];
        j->energy += j->force[i] * motion[i] + j->torque[i] * turn[i];
    }
    j->step = fmax(j->step, hypot(length(motion), j->arm * length(turn)));
    ck_assert_msg(j->energy <= j->options.stiffness * j->step * j->step * (1 + 1e-9),
                  "%s: contact gave energy %g, the longest step is %g", j->m->name, j->energy,
                  j->step);
}

static ebpo_haptic_tool_result judge_step(judged *j, const pose *device, bool closely)
{
    ebpo_haptic_tool_result r;
    judge_energy(j, device);
    in_step = true;
    ebpo_haptic_step_tool(j->haptic, device->place, device->turn, &r);
    in_step = false;
    if (closely)
        check_path(j, &r);
    if (!(r.flags & EBPO_HAPTIC_CONTACT))
        ck_assert(length(r.force) == 0 && length(r.torque) == 0 && r.depth == 0);
    ck_assert_uint_le(r.work, 12000);
    memcpy(j->proxy.place, r.proxy, sizeof r.proxy);
    memcpy(j->proxy.turn, r.turn, sizeof r.turn);
    memcpy(j->force, r.force, sizeof r.force);
    memcpy(j->torque, r.torque, sizeof r.torque);
    j->device = *device;
    return r;
}

static void set_arm(judged *j)
{
    double sum = 0;
    for (int p = 0; p < POINTS; p++)
        sum += length(j->point[p]) * length(j->point[p]);
    j->arm = sqrt(sum / POINTS);
}

static ebpo_status begin(judged *j, query_model *m, const double place[3], ebpo_error *error)
{
    set_arm(j);
    j->m = m;
    j->options.kind = EBPO_HAPTIC_TOOL;
    j->options.points = (const double(*)[3])j->point;
    j->options.point_count = POINTS;
    memset(&j->proxy, 0, sizeof j->proxy);
    memcpy(j->proxy.place, place, sizeof j->proxy.place);
    j->proxy.turn[3] = 1;
    j->device = j->proxy;
    return ebpo_haptic_new(m->model, &j->options, place, &j->haptic, error);
}

/* Begins with a tool whose points are in a ball. Returns false when the position is unsuitable. */
static bool begin_wild(judged *j, query_model *m, uint64_t *state)
{
    const ebpo_info *info = ebpo_file_info(m->file);
    double place[3];
    j->options = (ebpo_haptic_options)EBPO_HAPTIC_OPTIONS_INIT;
    for (int i = 0; i < 3; i++) {
        place[i] =
            info->box_origin[i] + (1.4 * ebpo_test_random_unit(state) - 0.2) * info->box_size[i];
        j->diagonal = hypot(j->diagonal, info->box_size[i]);
    }
    for (int p = 0; p < POINTS; p++)
        for (int k = 0; k < 3; k++)
            j->point[p][k] = 0.08 * j->diagonal * (ebpo_test_random_unit(state) - 0.5);
    j->options.skin = 1e-4 * j->diagonal;
    j->options.faces = 1 << 11;
    j->options.friction = ebpo_test_random(state) % 2 ? 0.3 : 0;
    ebpo_error why = EBPO_ERROR_INIT;
    ebpo_status status = begin(j, m, place, &why);
    ck_assert_msg(status == EBPO_OK || status == EBPO_E_ARGUMENT, "%s", why.message);
    return status == EBPO_OK;
}

static void choose(const query_model *m, uint64_t *state, pose *out)
{
    const ebpo_info *info = ebpo_file_info(m->file);
    for (int k = 0; k < 3; k++)
        out->place[k] =
            info->box_origin[k] + (1.4 * ebpo_test_random_unit(state) - 0.2) * info->box_size[k];
    for (int k = 0; k < 4; k++)
        out->turn[k] = ebpo_test_random_unit(state) - 0.5;
}

static void move_randomly(judged *j, uint64_t step_count, uint64_t *state, uint64_t *contacts)
{
    for (uint64_t i = 0; i < step_count;) {
        uint64_t steps = ebpo_test_random(state) % 3 ? 1 + ebpo_test_random(state) % 60 : 1;
        pose goal, from = j->device, device;
        choose(j->m, state, &goal);
        for (uint64_t s = 1; s <= steps && i < step_count; s++, i++) {
            double part = (double)s / (double)steps, square = 0;
            for (int k = 0; k < 3; k++)
                device.place[k] = from.place[k] + (goal.place[k] - from.place[k]) * part;
            for (int k = 0; k < 4; k++) {
                device.turn[k] = from.turn[k] + (goal.turn[k] - from.turn[k]) * part;
                square += device.turn[k] * device.turn[k];
            }
            for (int k = 0; k < 4; k++)
                device.turn[k] /= sqrt(square);
            *contacts += (judge_step(j, &device, true).flags & EBPO_HAPTIC_CONTACT) != 0;
            if (i % 4 == 0)
                pause_a_little();
        }
    }
}

static const char *const wild[] = { "sphere",         "thin_wall",    "thin_hollow",
                                    "staircase",      "cone_slivers", "open_box",
                                    "zero_area_face", "turned_boxes", "mobius" };
enum { WILD = sizeof wild / sizeof *wild };

START_TEST(test_haptic_tool_never_penetrates)
{
    query_model m;
    uint64_t state = 900 + (uint64_t)_i, contacts = 0;
    query_model_make(&m, wild[_i], query_solid_by_name(wild[_i]), &query_variants[0]);
    for (int turn = 0, begun = 0; turn < 60 && begun < 2; turn++) {
        judged j = { .diagonal = 0 };
        if (!begin_wild(&j, &m, &state))
            continue;
        begun++;
        move_randomly(&j, query_scaled(400), &state, &contacts);
        ASSERT_OK(ebpo_haptic_check(j.haptic, error));
        ebpo_haptic_free(j.haptic);
    }
    ck_assert(contacts > 0 || ebpo_test_scale() < 1);
    ck_assert_msg(forbidden == 0, "%lu forbidden calls in haptic steps", forbidden);
    query_model_free(&m);
}
END_TEST

/* --- contacts push and never pull --- */

enum { PUSHING = 6 };

/* Computes the motion allowed by contacts that is nearest to the wanted one: a thousand iterations
 * of Hildreth's method over all contacts. */
static void hold_reference(const ebpo_tool_contacts *all, const double want[EBPO_SCREW],
                           double out[EBPO_SCREW])
{
    double force[PUSHING] = { 0 };
    memcpy(out, want, EBPO_SCREW * sizeof *out);
    for (int i = 0; i < 1000 * all->count; i++) {
        const ebpo_tool_contact *c = &all->at[i % all->count];
        double lacks = -c->space - ebpo_screw_dot(c->grip, out);
        double by = fmax(lacks / ebpo_screw_dot(c->grip, c->grip), -force[i % all->count]);
        force[i % all->count] += by;
        for (int k = 0; k < EBPO_SCREW; k++)
            out[k] += by * c->grip[k];
    }
}

static double apart_by(const double a[EBPO_SCREW], const double b[EBPO_SCREW])
{
    double difference[EBPO_SCREW];
    for (int k = 0; k < EBPO_SCREW; k++)
        difference[k] = a[k] - b[k];
    return ebpo_screw_length(difference);
}

/* Makes a contact of a point, with a lever of up to 3 arms, on a face with any upward normal. */
static void random_contact(uint64_t *state, ebpo_tool_contact *c)
{
    double lever[3];
    *c = (ebpo_tool_contact){ .space = 0.01 * ebpo_test_random_unit(state) };
    c->gap = c->space;
    for (int k = 0; k < 3; k++) {
        c->normal[k] = k == 2 ? 1 : 2 * ebpo_test_random_unit(state) - 1;
        lever[k] = 6 * ebpo_test_random_unit(state) - 3;
    }
    for (int k = 0; k < 3; k++)
        c->grip[k] = c->normal[k] / length(c->normal);
    ebpo_vec3_cross(lever, c->grip, c->grip + 3);
}

/* A contact must not pull, because its point would then stick to the face and restrain the motion
 * more than needed. The remaining error of a few sweeps is less than 0.02 here. */
START_TEST(test_haptic_tool_contacts_never_pull)
{
    ebpo_tool_contacts all;
    uint64_t state = 77;
    for (int turn = 0; turn < 3000; turn++) {
        double want[EBPO_SCREW], held[EBPO_SCREW], plain[EBPO_SCREW];
        all.count = 0;
        for (uint64_t i = 0, count = 2 + ebpo_test_random(&state) % (PUSHING - 1); i < count; i++) {
            ebpo_tool_contact c;
            random_contact(&state, &c);
            ebpo_tool_contact_add(&all, &c);
        }
        for (int k = 0; k < EBPO_SCREW; k++)
            want[k] = 2 * ebpo_test_random_unit(&state) - 1;
        (void)ebpo_tool_hold(&all, want, 1e-6, true, held);
        hold_reference(&all, want, plain);
        ck_assert_msg(apart_by(held, want) <= apart_by(plain, want) + 0.05,
                      "turn %d: %g is restrained, expected %g", turn, apart_by(held, want),
                      apart_by(plain, want));
    }
}
END_TEST

/* --- on a cube of 1: by formula --- */

static void settle(judged *j, const pose *device, ebpo_haptic_tool_result *r)
{
    for (int patience = 5000; patience > 0; patience--) {
        *r = judge_step(j, device, false);
        if (patience < 4990 && !(r->flags & (EBPO_HAPTIC_WAITING | EBPO_HAPTIC_PATH_UNFINISHED)))
            return;
        if (r->flags & EBPO_HAPTIC_WAITING)
            pause_a_little();
    }
    ck_abort_msg("the tool does not come to rest");
}

static void go(judged *j, const double to[3], int steps, ebpo_haptic_tool_result *r)
{
    pose from = j->device, device = j->device;
    for (int s = 1; s <= steps; s++) {
        for (int k = 0; k < 3; k++)
            device.place[k] = from.place[k] + (to[k] - from.place[k]) * s / steps;
        settle(j, &device, r);
    }
}

static void cube_begin(judged *j, query_model *m, double friction)
{
    static const double low[3] = { 0, 0, 0 }, high[3] = { 1, 1, 1 };
    const double above[3] = { 0.5, 0.5, 1.2 };
    query_model_make(m, "box", ebpo_test_box(low, high, 4), &query_variants[0]);
    *j = (judged){ .options = EBPO_HAPTIC_OPTIONS_INIT };
    j->options.skin = 1e-4;
    j->options.stiffness = 100;
    j->options.damping = 0;
    j->options.friction = friction;
    for (int p = 0; p < POINTS; p++) { /* a flat plate of 8 by 5 */
        j->point[p][0] = 0.04 * (p % 8 - 3.5);
        j->point[p][1] = 0.06 * (p / 8 - 2);
    }
    ASSERT_OK(begin(j, m, above, error));
}

static void cube_end(judged *j, query_model *m)
{
    ck_assert_uint_eq(forbidden, 0);
    ASSERT_OK(ebpo_haptic_check(j->haptic, error));
    ebpo_haptic_free(j->haptic);
    query_model_free(m);
}

static void check_vector(const double got[3], double x, double y, double z, double within)
{
    ck_assert_msg(fabs(got[0] - x) <= within && fabs(got[1] - y) <= within &&
                      fabs(got[2] - z) <= within,
                  "(%g, %g, %g), not (%g, %g, %g)", got[0], got[1], got[2], x, y, z);
}

START_TEST(test_haptic_plate_rests_on_cube)
{
    query_model m;
    judged j;
    ebpo_haptic_tool_result r;
    cube_begin(&j, &m, 0);
    go(&j, (const double[3]){ 0.5, 0.5, 0.9 }, 40, &r);
    check_vector(r.proxy, 0.5, 0.5, 1 + 1e-4, 1e-4);
    check_vector(r.force, 0, 0, 10, 0.03);
    check_vector(r.torque, 0, 0, 0, 0.003);
    ck_assert_double_le(fabs(r.depth - 0.1), 3e-4);
    ck_assert_uint_gt(r.contacts, 3);
    ck_assert_double_ge(r.normal[2], 0.999);
    go(&j, (const double[3]){ 0.55, 0.45, 0.9 }, 20, &r); /* along the top */
    check_vector(r.proxy, 0.55, 0.45, 1 + 1e-4, 2e-4);
    go(&j, (const double[3]){ 0.55, 0.45, -2 }, 1,
       &r); /* the device leaves at the bottom, the tool is still on top */
    ck_assert_double_ge(r.proxy[2], 0.999);
    cube_end(&j, &m);
}
END_TEST

/* The device tilts the plate on the cube. The plate stays flat and exerts a torque. */
START_TEST(test_haptic_tilted_plate_restores_device)
{
    query_model m;
    judged j;
    ebpo_haptic_tool_result r;
    cube_begin(&j, &m, 0);
    go(&j, (const double[3]){ 0.5, 0.5, 0.9 }, 40, &r);
    pose device = j.device;
    for (int s = 1; s <= 50; s++) {
        device.turn[1] = sin(0.001 * s);
        device.turn[3] = cos(0.001 * s);
        settle(&j, &device, &r);
    }
    double turn[3];
    turn_between(r.turn, device.turn, turn); /* 0.1 about y, while the plate is in contact */
    ck_assert_double_ge(turn[1], 0.09);
    check_vector(r.torque, 0, -100 * j.arm * j.arm * turn[1], 0, 0.02 * 100 * j.arm * j.arm);
    check_vector(r.force, 0, 0, 10, 0.2);
    cube_end(&j, &m);
}
END_TEST

START_TEST(test_haptic_friction_holds_plate)
{
    query_model m;
    judged j;
    ebpo_haptic_tool_result r;
    cube_begin(&j, &m, 0.5);
    go(&j, (const double[3]){ 0.5, 0.5, 0.9 }, 40, &r);
    double x = r.proxy[0];
    go(&j, (const double[3]){ 0.54, 0.5, 0.9 }, 10, &r); /* sticks, because 0.04 < 0.5 * 0.1 */
    ck_assert_double_le(fabs(r.proxy[0] - x), 1e-3);
    ck_assert_double_le(fabs(r.force[0] + 4), 0.15);
    /* friction pulls the tool along, 0.05 behind the device */
    go(&j, (const double[3]){ 0.7, 0.5, 0.9 }, 80, &r);
    ck_assert_double_le(fabs(r.proxy[0] - 0.65), 3e-3);
    cube_end(&j, &m);
}
END_TEST

/* Uses 10,000 points, a third of them in contact with the cube. Steps do not take longer. */
START_TEST(test_haptic_step_time_with_many_points)
{
    static const double low[3] = { 0, 0, 0 }, high[3] = { 1, 1, 1 };
    static double point[10000][3];
    const double above[3] = { 0.5, 0.5, 1.5 };
    query_model m;
    ebpo_haptic *haptic, *none;
    ebpo_haptic_tool_result r = { .flags = 0 };
    ebpo_error why = EBPO_ERROR_INIT;
    ebpo_haptic_options options = EBPO_HAPTIC_OPTIONS_INIT;
    query_model_make(&m, "box", ebpo_test_box(low, high, 4), &query_variants[0]);
    for (int p = 0; p < 10000; p++) {
        point[p][0] = 0.004 * (p % 100 - 49.5);
        point[p][1] = 0.01 * (p / 100 % 34 - 17);
        point[p][2] = 0.1 * (p / 3400);
    }
    options.kind = EBPO_HAPTIC_TOOL;
    options.points = (const double(*)[3])point;
    options.point_count = 10001;
    ck_assert_int_eq(ebpo_haptic_new(m.model, &options, above, &none, &why), EBPO_E_ARGUMENT);
    options.point_count = 10000;
    ASSERT_OK(ebpo_haptic_new(m.model, &options, above, &haptic, error));
    bool rests = false;
    for (int i = 0; i < 1500 || (!rests && i < 20000); i++) { /* boxes may be loaded late */
        const double device[3] = { 0.5, 0.5, fmax(0.9, 1.5 - 0.002 * i) }, turn[4] = { 0, 0, 0, 1 };
        in_step = true;
        ebpo_haptic_step_tool(haptic, device, turn, &r);
        in_step = false;
        ck_assert_uint_le(r.work, 12000);
        rests = !(r.flags & (EBPO_HAPTIC_WAITING | EBPO_HAPTIC_PATH_UNFINISHED));
        if (i % 8 == 0)
            pause_a_little();
    }
    ck_assert_double_le(fabs(r.proxy[2] - 1), 3e-4);
    ck_assert_uint_eq(r.contacts, 256);
    ck_assert((r.flags & EBPO_HAPTIC_CONTACT) != 0);
    ck_assert_uint_eq(forbidden, 0);
    ebpo_haptic_free(haptic);
    query_model_free(&m);
}
END_TEST

/* A ball of 2,000 points follows the device over a rough sphere. Its points do not jam where they
 * touch two faces. */
START_TEST(test_haptic_ball_slides_on_rough_sphere)
{
    enum { STEPS = 4000 };
    static double point[2000][3];
    static const double centre[3] = { 0, 0, 0 }, above[3] = { 0, 0, 1.4 };
    query_model m;
    judged j = { .options = EBPO_HAPTIC_OPTIONS_INIT };
    ebpo_haptic_tool_result r = { .flags = 0 };
    ebpo_mesh rough = ebpo_test_sphere(centre, 1, 6);
    uint64_t state = 5;
    for (uint64_t v = 0; v < rough.vertex_count; v++) {
        double radius = 1 + 0.01 * (ebpo_test_random_unit(&state) - 0.5);
        for (int k = 0; k < 3; k++)
            rough.xyz64[3 * v + (uint64_t)k] *= radius;
    }
    query_model_make(&m, "rough sphere", rough, &query_variants[0]);
    for (int p = 0; p < 2000; p++) {
        double z = 1 - (2 * p + 1) / 2000.0, wide = sqrt(1 - z * z);
        point[p][0] = 0.1 * wide * cos(2.4 * p);
        point[p][1] = 0.1 * wide * sin(2.4 * p);
        point[p][2] = 0.1 * z;
    }
    j.options.kind = EBPO_HAPTIC_TOOL;
    j.options.points = (const double(*)[3])point;
    j.options.point_count = 2000;
    j.options.faces = 131072;
    ASSERT_OK(ebpo_haptic_new(m.model, &j.options, above, &j.haptic, error));
    for (int i = 0; i < STEPS; i++) {
        double angle = 1.2 * i / STEPS, far = fmax(1.0334, 1.4 - i / 900.0);
        double tilt = 0.2 * sin(15.0 * i / STEPS);
        const double device[3] = { far * sin(angle), far * tilt, far * cos(angle) };
        const double turn[4] = { 0, 0, 0, 1 };
        for (int patience = 5000; patience > 0; patience--) {
            ebpo_haptic_step_tool(j.haptic, device, turn, &r);
            if (!(r.flags & EBPO_HAPTIC_WAITING))
                break;
            pause_a_little();
        }
        double apart[3];
        for (int k = 0; k < 3; k++)
            apart[k] = r.proxy[k] - device[k];
        /* At most 0.16, and 1 at the end if a jam of points is not ended. */
        ck_assert_msg(length(apart) < 0.3, "step %d: the ball is %g behind", i, length(apart));
    }
    ebpo_haptic_free(j.haptic);
    query_model_free(&m);
}
END_TEST

static int by_gap(const void *a, const void *b)
{
    const double *x = a, *y = b;
    return (*x > *y) - (*x < *y);
}

START_TEST(test_haptic_tool_keeps_nearest_contacts)
{
    enum { ADDED = 3 * EBPO_CONTACTS_MAX };
    static ebpo_tool_contacts kept;
    double gap[ADDED], found[EBPO_CONTACTS_MAX];
    uint64_t state = 71;
    for (int round = 0; round < 20; round++) {
        kept.count = 0;
        for (int i = 0; i < ADDED; i++) {
            gap[i] = ebpo_test_random_unit(&state);
            ebpo_tool_contact_add(&kept, &(ebpo_tool_contact){ .gap = gap[i] });
        }
        ck_assert_int_eq(kept.count, EBPO_CONTACTS_MAX);
        for (int i = 0; i < EBPO_CONTACTS_MAX; i++)
            found[i] = kept.at[i].gap;
        qsort(gap, ADDED, sizeof *gap, by_gap);
        qsort(found, EBPO_CONTACTS_MAX, sizeof *found, by_gap);
        ck_assert_mem_eq(found, gap, sizeof found);
    }
}
END_TEST

TEST_SUITE(haptic_tool)
{
    Suite *suite = suite_create("haptic_tool");
    TCase *tools = tcase_create("tool");
    watch_gmp();
    tcase_set_timeout(tools, 600);
    tcase_add_loop_test(tools, test_haptic_tool_never_penetrates, 0, WILD);
    tcase_add_test(tools, test_haptic_plate_rests_on_cube);
    tcase_add_test(tools, test_haptic_tilted_plate_restores_device);
    tcase_add_test(tools, test_haptic_tool_contacts_never_pull);
    tcase_add_test(tools, test_haptic_friction_holds_plate);
    tcase_add_test(tools, test_haptic_step_time_with_many_points);
    tcase_add_test(tools, test_haptic_tool_keeps_nearest_contacts);
    tcase_add_test(tools, test_haptic_ball_slides_on_rough_sphere);
    suite_add_tcase(suite, tools);
    return suite;
}
