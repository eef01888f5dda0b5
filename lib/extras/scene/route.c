/* Evaluates routes: the pose at a time between keys, and bounds of the motion of points that follow
 * a route.
 *
 * A rotation is interpolated along the arc between two unit quaternions by repeated halving. Only
 * sums, products, quotients and square roots are used, so that a pose has the same bits on every
 * machine.
 *
 * For two times with no key between them, functions return upper bounds of three lengths: the
 * length of the motion, the distance of the motion from a straight line, and the motion that
 * rounding alone causes. The bounds are rounded upwards. */
#include "core/strict_fp.h"

#include <math.h>
#include <string.h>

#include "core/alloc.h"
#include "core/error.h"
#include "geometry/pose.h"
#include "extras/scene/scene_parts.h"

/* Upper bound of the relative rounding error of a length after a few dozen operations, each with an
 * error of at most 2^-53. */
static const double slack = 0x1p-44;
/* Greatest absolute time. Differences of times in this range are finite. */
static const double max_time = 0x1p1000;

void ebpo_scene_quaternion_of_matrix(const double m[3][3], double quaternion[4])
{
    double trace = m[0][0] + m[1][1] + m[2][2];
    int i = m[1][1] > m[0][0] ? 1 : 0;
    i = m[2][2] > m[i][i] ? 2 : i;
    if (trace > m[i][i]) { /* the real part is the greatest */
        quaternion[0] = m[2][1] - m[1][2];
        quaternion[1] = m[0][2] - m[2][0];
        quaternion[2] = m[1][0] - m[0][1];
        quaternion[3] = 1 + trace;
        return;
    }
    int j = (i + 1) % 3, k = (i + 2) % 3;
    quaternion[i] = 1 + m[i][i] - m[j][j] - m[k][k];
    quaternion[j] = m[j][i] + m[i][j];
    quaternion[k] = m[k][i] + m[i][k];
    quaternion[3] = m[k][j] - m[j][k];
}

/* Returns true if the time, translation and scale of a key are in range. */
static bool key_is_in_range(const ebpo_route_key *key)
{
    static const double origin[3] = { 0, 0, 0 };
    ebpo_pose pose = EBPO_POSE_INIT;
    ebpo_posing posing;
    memcpy(pose.translation, key->translation, sizeof pose.translation);
    pose.scale = key->scale;
    return fabs(key->time) <= max_time && ebpo_posing_make(&posing, &pose, origin, NULL) == EBPO_OK;
}

ebpo_status ebpo_scene_add_key(ebpo_scene_route *route, const ebpo_route_key *key,
                               ebpo_error *error)
{
    ebpo_route_key k = *key;
    if (!key_is_in_range(&k))
        return ebpo_fail(
            error, EBPO_E_ARGUMENT,
            "a number is not finite, the time is beyond 2^1000, or the scale is not from "
            "2^-300 to 2^300");
    if (!ebpo_quaternion_normalise(k.quaternion))
        return ebpo_fail(error, EBPO_E_ARGUMENT, "the quaternion is 0 or too long");
    if (route->count && !(k.time > route->keys[route->count - 1].time))
        return ebpo_fail(error, EBPO_E_ARGUMENT, "time %g is not later than the previous time, %g",
                         k.time, route->keys[route->count - 1].time);
    if (!ebpo_grow(&route->keys, &route->capacity, route->count + 1, sizeof *route->keys))
        return ebpo_fail_memory(error, (route->count + 1) * sizeof *route->keys);
    route->keys[route->count++] = k;
    return EBPO_OK;
}

/* Returns the last key whose time is at most `time`, or the first key. */
static uint64_t key_at(const ebpo_scene_route *route, double time)
{
    uint64_t low = 0, high = route->count;
    while (high - low > 1) {
        uint64_t middle = low + (high - low) / 2;
        if (route->keys[middle].time <= time)
            low = middle;
        else
            high = middle;
    }
    return low;
}

/* Interpolates at constant speed along the shorter arc. u: fraction of the arc, 0 to 1. Halves the
 * arc 28 times. The remaining arc is so short that it is equal to its chord in doubles, so `out` is
 * interpolated linearly along the chord. */
static void interpolate_rotation(const double from[4], const double to[4], double u, double out[4])
{
    double a[4], b[4];
    double dot = (from[0] * to[0] + from[1] * to[1]) + (from[2] * to[2] + from[3] * to[3]);
    for (int k = 0; k < 4; k++) {
        a[k] = from[k];
        b[k] = dot < 0 ? -to[k] : to[k];
    }
    for (int i = 0; i < 28; i++) {
        double middle[4];
        for (int k = 0; k < 4; k++)
            middle[k] = a[k] + b[k];
        ebpo_quaternion_normalise(middle); /* never near 0: the angle of a and b is at most 90
                                            * degrees */
        bool later = u >= 0.5;             /* the result is in the second half */
        memcpy(later ? a : b, middle, sizeof middle);
        u = later ? 2 * u - 1 : 2 * u;
    }
    for (int k = 0; k < 4; k++)
        out[k] = a[k] + u * (b[k] - a[k]);
    ebpo_quaternion_normalise(out);
}

void ebpo_scene_route_at(const ebpo_scene_route *route, double time, ebpo_pose *out)
{
    uint64_t n = key_at(route, time);
    const ebpo_route_key *a = &route->keys[n], *b = n + 1 < route->count ? a + 1 : a;
    *out = (ebpo_pose)EBPO_POSE_INIT;
    if (a == b || route->jumps || time <= a->time) {
        ebpo_quaternion_matrix(a->quaternion, out->rotation);
        memcpy(out->translation, a->translation, sizeof out->translation);
        out->scale = a->scale;
        return;
    }
    double u = (time - a->time) / (b->time - a->time), quaternion[4];
    interpolate_rotation(a->quaternion, b->quaternion, u, quaternion);
    ebpo_quaternion_matrix(quaternion, out->rotation);
    for (int k = 0; k < 3; k++)
        out->translation[k] = a->translation[k] + u * (b->translation[k] - a->translation[k]);
    out->scale = a->scale + u * (b->scale - a->scale);
}

void ebpo_scene_compose(const ebpo_pose *outer, const ebpo_pose *inner, ebpo_pose *out)
{
    ebpo_pose p;
    for (int i = 0; i < 3; i++) {
        const double *r = outer->rotation[i], *t = inner->translation;
        for (int k = 0; k < 3; k++)
            p.rotation[i][k] = (r[0] * inner->rotation[0][k] + r[1] * inner->rotation[1][k]) +
                               r[2] * inner->rotation[2][k];
        p.translation[i] =
            outer->scale * ((r[0] * t[0] + r[1] * t[1]) + r[2] * t[2]) + outer->translation[i];
    }
    p.scale = outer->scale * inner->scale;
    *out = p;
}

double ebpo_scene_route_next(const ebpo_scene_route *route, double from, double to)
{
    uint64_t n = key_at(route, from);
    if (from < route->keys[0].time)
        return fmin(to, route->keys[0].time);
    return n + 1 < route->count ? fmin(to, route->keys[n + 1].time) : to;
}

/* Returns an upper bound of the angle, in radians, of the rotation from a to b. This angle is twice
 * the angle between the quaternions, 2 asin(chord / 2). asin is computed by its series. */
static double angle_between(const double a[4], const double b[4])
{
    double less[4], more[4];
    for (int k = 0; k < 4; k++) {
        less[k] = a[k] - b[k];
        more[k] = a[k] + b[k];
    }
    double y =
        fmin(fmin(ebpo_quaternion_length(less), ebpo_quaternion_length(more)) / 2 * (1 + slack) +
                 0x1p-50,
             0.70711);
    double square = y * y, term = y, sum = y;
    for (int n = 1; n < 40; n++) {
        term *= square * (2 * n - 1) / (2 * n);
        sum += term / (2 * n + 1);
    }
    /* y^2 is at most about 1/2, so the sum of the omitted terms is less than `term` */
    return 4 * (sum + term) * (1 + slack);
}

double ebpo_scene_length_above(const double vector[3])
{
    double most = fmax(fmax(fabs(vector[0]), fabs(vector[1])), fabs(vector[2])), sum = 0;
    if (!(most > 0 && most < INFINITY))
        return most;
    for (int k = 0; k < 3; k++)
        sum += (vector[k] / most) * (vector[k] / most);
    return sqrt(sum) * (1 + slack) * most;
}

ebpo_scene_step ebpo_scene_route_step(const ebpo_scene_route *route, double from, double to,
                                      ebpo_scene_extent extent)
{
    uint64_t n = key_at(route, from);
    const ebpo_route_key *a = &route->keys[n], *b = n + 1 < route->count ? a + 1 : a;
    /* the fraction of the time from key a to key b that is between `from` and `to` */
    double fraction = a == b ? 0 : (to - fmax(from, a->time)) / (b->time - a->time);
    if (!(fraction > 0) || from < a->time || route->jumps)
        return (ebpo_scene_step){ 0, 0 };
    fraction = fraction * (1 + slack) + slack;
    double vector[3], size = 0;
    for (int k = 0; k < 3; k++) {
        vector[k] = b->translation[k] - a->translation[k];
        size += fabs(a->translation[k]) + fabs(b->translation[k]);
    }
    double angle = angle_between(a->quaternion, b->quaternion), scale = fmax(a->scale, b->scale);
    double step_angle = angle * fraction, scale_change = fabs(b->scale - a->scale) * fraction;
    double rounding = slack * (size + (extent.max_distance + extent.size) * scale);
    return (ebpo_scene_step){
        (ebpo_scene_length_above(vector) * fraction +
         extent.max_distance * (scale * step_angle + scale_change)) *
                (1 + slack) +
            rounding,
        extent.max_distance / 8 *
                (scale * step_angle * step_angle + 2 * scale_change * step_angle) * (1 + slack) +
            rounding,
    };
}

/* Statistics of the scales and translations of a sequence of poses. */
typedef struct pose_statistics {
    double scale;        /* scale of the pose that was added last */
    double scale_change; /* sum of the absolute changes of the scale */
    double max_scale;
    double max_size; /* greatest 1-norm of a translation */
} pose_statistics;

/* Adds a pose to the statistics. */
static void add_pose_statistics(pose_statistics *g, double scale, const double translation[3])
{
    double size = 0;
    for (int k = 0; k < 3; k++)
        size += fabs(translation[k]);
    g->scale_change += fabs(scale - g->scale);
    g->scale = scale;
    g->max_scale = fmax(g->max_scale, scale);
    g->max_size = fmax(g->max_size, size);
}

double ebpo_scene_route_growth(const ebpo_scene_route *route, double from, double to,
                               ebpo_scene_extent extent)
{
    ebpo_pose at;
    ebpo_scene_route_at(route, from, &at);
    pose_statistics g = { .scale = at.scale };
    add_pose_statistics(&g, at.scale, at.translation);
    for (uint64_t n = key_at(route, from) + 1; n < route->count; n++) {
        if (!(route->keys[n].time < to))
            break;
        add_pose_statistics(&g, route->keys[n].scale, route->keys[n].translation);
    }
    ebpo_scene_route_at(route, to, &at);
    add_pose_statistics(&g, at.scale, at.translation);
    return extent.max_distance * g.scale_change * (1 + slack) +
           slack * (2 * g.max_size + (extent.max_distance + extent.size) * g.max_scale);
}

double ebpo_scene_route_rounding(const ebpo_scene_route *route, ebpo_scene_extent extent)
{
    pose_statistics g = { .scale = 0 };
    for (uint64_t n = 0; n < route->count; n++)
        add_pose_statistics(&g, route->keys[n].scale, route->keys[n].translation);
    return slack * (g.max_size + (extent.max_distance + extent.size) * g.max_scale);
}
