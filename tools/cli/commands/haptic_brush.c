/* The points are in a tree of balls. The search for pressed points omits a ball if no surface is
 * near enough, so its work depends on the part of the brush that is near the surface. It tests the
 * remaining points in an order that is spread over them, and ends when enough are pressed. */
#include "cli/commands/haptic_brush.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

/* Greatest number of points of a leaf of the tree. */
enum { LEAF = 16 };

/* A ball around points first .. first + count - 1. The tree is in depth-first order. */
typedef struct brush_ball {
    double middle[3], radius;
    uint32_t first, count;
    uint32_t next; /* number of the next ball that is not within this one */
} brush_ball;

struct haptic_brush {
    double (*point)[3]; /* [count] */
    uint32_t *close;    /* [count] workspace: points that may be pressed */
    brush_ball *ball;   /* [ball_count], at most 2 * count */
    uint32_t count, ball_count;
};

void haptic_rotate(const double q[4], const double v[3], double out[3])
{
    const double t[3] = { 2 * (q[1] * v[2] - q[2] * v[1]), 2 * (q[2] * v[0] - q[0] * v[2]),
                          2 * (q[0] * v[1] - q[1] * v[0]) };
    out[0] = v[0] + q[3] * t[0] + q[1] * t[2] - q[2] * t[1];
    out[1] = v[1] + q[3] * t[1] + q[2] * t[0] - q[0] * t[2];
    out[2] = v[2] + q[3] * t[2] + q[0] * t[1] - q[1] * t[0];
}

void haptic_to_model(const ebpo_pose *pose, const double from[3], double out[3])
{
    for (int k = 0; k < 3; k++)
        out[k] = from[k];
    for (int k = 0; pose && k < 3; k++) {
        out[k] = 0;
        for (int i = 0; i < 3; i++)
            out[k] += pose->rotation[i][k] * (from[i] - pose->translation[i]);
        out[k] /= pose->scale;
    }
}

void haptic_to_world(const ebpo_pose *pose, const double from[3], double out[3])
{
    for (int i = 0; i < 3; i++)
        out[i] = from[i];
    for (int i = 0; pose && i < 3; i++) {
        out[i] = pose->translation[i];
        for (int k = 0; k < 3; k++)
            out[i] += pose->rotation[i][k] * pose->scale * from[k];
    }
}

/* --- the tree --- */

static int compare_along(const void *a, const void *b, int axis)
{
    double x = ((const double *)a)[axis], y = ((const double *)b)[axis];
    return (x > y) - (x < y);
}
static int along_x(const void *a, const void *b) { return compare_along(a, b, 0); }
static int along_y(const void *a, const void *b) { return compare_along(a, b, 1); }
static int along_z(const void *a, const void *b) { return compare_along(a, b, 2); }

static double length_of(const double v[3]) { return hypot(hypot(v[0], v[1]), v[2]); }

/* Adds the balls around points first .. first + count - 1. */
static void add_balls(haptic_brush *b, uint32_t first, uint32_t count)
{
    static int (*const compare[3])(const void *, const void *) = { along_x, along_y, along_z };
    double min[3], max[3], off[3];
    int axis = 0;
    for (int k = 0; k < 3; k++) {
        min[k] = max[k] = b->point[first][k];
        for (uint32_t i = first; i < first + count; i++) {
            min[k] = fmin(min[k], b->point[i][k]);
            max[k] = fmax(max[k], b->point[i][k]);
        }
        if (max[k] - min[k] > max[axis] - min[axis])
            axis = k;
    }
    uint32_t number = b->ball_count++;
    brush_ball *made = &b->ball[number];
    *made = (brush_ball){ .first = first, .count = count };
    for (int k = 0; k < 3; k++)
        made->middle[k] = (min[k] + max[k]) / 2;
    for (uint32_t i = first; i < first + count; i++) {
        for (int k = 0; k < 3; k++)
            off[k] = b->point[i][k] - made->middle[k];
        made->radius = fmax(made->radius, length_of(off));
    }
    if (count > LEAF) {
        qsort(b->point + first, count, sizeof *b->point, compare[axis]);
        add_balls(b, first, count / 2);
        add_balls(b, first + count / 2, count - count / 2);
    }
    made->next = b->ball_count;
}

haptic_brush *haptic_brush_new(const double (*points)[3], uint64_t count)
{
    haptic_brush *b = calloc(1, sizeof *b);
    if (!b)
        return NULL;
    b->count = (uint32_t)count;
    b->point = malloc(count * sizeof *b->point);
    b->close = malloc(count * sizeof *b->close);
    b->ball = malloc(2 * count * sizeof *b->ball);
    if (!b->point || !b->close || !b->ball) {
        haptic_brush_free(b);
        return NULL;
    }
    memcpy(b->point, points, count * sizeof *b->point);
    add_balls(b, 0, b->count);
    return b;
}

void haptic_brush_free(haptic_brush *b)
{
    if (!b)
        return;
    free(b->point);
    free(b->close);
    free(b->ball);
    free(b);
}

/* --- pressed points --- */

typedef struct search {
    haptic_brush *brush;
    ebpo_context *context;
    const ebpo_pose *pose; /* of the model of `context`, or NULL */
    const haptic_sample *sample;
    double near;
    double shift, turn; /* length and angle of the motion from proxy to device */
    ebpo_error *error;
} search;

static search begin_search(haptic_brush *brush, ebpo_context *context, const ebpo_pose *pose,
                           const haptic_sample *sample, double near, ebpo_error *error)
{
    double shift[3], cosine = 0;
    for (int k = 0; k < 3; k++)
        shift[k] = sample->device[k] - sample->proxy[k];
    for (int k = 0; k < 4; k++)
        cosine += sample->device_rotation[k] * sample->rotation[k];
    return (search){ .brush = brush,
                     .context = context,
                     .pose = pose,
                     .sample = sample,
                     .near = near,
                     .shift = length_of(shift),
                     .turn = 2 * acos(fmin(1, fabs(cosine))) + 0x1p-20,
                     .error = error };
}

/* Places a point of the brush with the proxy or with the device. */
static void place_point(const double rotation[4], const double position[3], const double point[3],
                        double out[3])
{
    haptic_rotate(rotation, point, out);
    for (int k = 0; k < 3; k++)
        out[k] += position[k];
}

/* Finds the nearest point of the model if it is near enough for a pressed point of a ball around
 * `point`, and sets `out` to the position of `point`. near->face is EBPO_NO_FACE if it is not. */
static ebpo_status find_surface(const search *s, const double point[3], double radius,
                                double out[3], ebpo_distance_result *near)
{
    ebpo_distance_options options = EBPO_DISTANCE_OPTIONS_INIT;
    options.unsigned_distance = true;
    options.max_distance = s->near + s->shift + s->turn * (length_of(point) + radius) + radius;
    place_point(s->sample->rotation, s->sample->proxy, point, out);
    if (!s->pose)
        return ebpo_distance(s->context, out, &options, near, s->error);
    double at[3], found[3];
    options.max_distance /= s->pose->scale;
    haptic_to_model(s->pose, out, at);
    ebpo_status status = ebpo_distance(s->context, at, &options, near, s->error);
    memcpy(found, near->point, sizeof found);
    haptic_to_world(s->pose, found, near->point);
    near->distance *= s->pose->scale;
    return status;
}

/* Collects the points that may be pressed in brush->close. Sets *count to their number. */
static ebpo_status find_close(const search *s, uint32_t *count)
{
    haptic_brush *b = s->brush;
    *count = 0;
    for (uint32_t i = 0; i < b->ball_count;) {
        const brush_ball *ball = &b->ball[i];
        double at[3];
        ebpo_distance_result near;
        ebpo_status status = find_surface(s, ball->middle, ball->radius, at, &near);
        if (status != EBPO_OK)
            return status;
        bool is_leaf = ball->count <= LEAF, is_near = near.face != EBPO_NO_FACE;
        for (uint32_t k = 0; is_near && is_leaf && k < ball->count; k++)
            b->close[(*count)++] = ball->first + k;
        i = is_near ? i + 1 : ball->next;
    }
    return EBPO_OK;
}

/* Sets *pressed for a point, and `out` to its position. */
static ebpo_status test_point(const search *s, const double point[3], double out[3], bool *pressed)
{
    double target[3], height = 0;
    ebpo_distance_result near;
    ebpo_status status = find_surface(s, point, 0, out, &near);
    *pressed = false;
    if (status != EBPO_OK || near.face == EBPO_NO_FACE)
        return status;
    place_point(s->sample->device_rotation, s->sample->device, point, target);
    for (int k = 0; k < 3; k++)
        height += (target[k] - near.point[k]) * (out[k] - near.point[k]) / near.distance;
    *pressed = near.distance <= s->near || height <= s->near;
    return EBPO_OK;
}

/* Returns a step that visits the numbers below `count` in an order that is spread over them: about
 * the golden ratio times count, without a common divisor. */
static uint32_t spread_step(uint32_t count)
{
    uint32_t step = (uint32_t)(0.618 * count), a, b;
    do {
        step++;
        for (a = count, b = step; b;) {
            uint32_t rest = a % b;
            a = b;
            b = rest;
        }
    } while (a != 1);
    return step;
}

ebpo_status haptic_brush_press(haptic_brush *brush, ebpo_context *context, const ebpo_pose *pose,
                               const haptic_sample *sample, double near,
                               double out[HAPTIC_BRUSH_MAX][3], int *count, ebpo_error *error)
{
    search s = begin_search(brush, context, pose, sample, near, error);
    uint32_t close;
    ebpo_status status = find_close(&s, &close);
    *count = 0;
    if (close == 0)
        return status;
    uint32_t step = spread_step(close), at = 0;
    for (uint32_t i = 0; status == EBPO_OK && i < close && *count < HAPTIC_BRUSH_MAX; i++) {
        bool pressed;
        status = test_point(&s, brush->point[brush->close[at]], out[*count], &pressed);
        *count += pressed;
        at = (uint32_t)(((uint64_t)at + step) % close);
    }
    return status;
}
