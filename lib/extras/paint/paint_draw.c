/* Makes strokes from the path of a pen: points at equal steps along the path. With more pressure
 * there are more points at each step.
 *
 * Every point is on a face of the model, and is stored as the face and two integer weights of the
 * face's corners. Points are scattered by pseudorandom numbers with a seed, so a path makes the
 * same stroke on every machine. */
#include "core/strict_fp.h"

#include <ebpo/paint.h>

#include <float.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "core/alloc.h"
#include "core/error.h"
#include "core/fp_env.h"
#include "core/parallel.h"
#include "core/hash.h"
#include "extras/paint/paint_parts.h"
#include "extras/paint/paint_reach.h"
#include "query/query_model.h"
#include "extras/haptic/face_box.h"
#include "geometry/vec3.h"

enum { DENSITY_MAX = 10000 };

/* A stroke that is not yet part of the paint: the index of its first point in drawing.point, and
 * the number of its points. */
typedef struct stroke_range {
    uint64_t first, count;
} stroke_range;

typedef struct ebpo_paint_drawing {
    ebpo_paint *paint;
    ebpo_context *context;
    ebpo_paint_pen pen;
    ebpo_reach_search reach;
    /* Results of the current call. */
    ebpo_paint_point *point; /* [point_count] points of all new strokes */
    stroke_range *run;       /* [run_count] the new strokes */
    uint64_t point_count, point_capacity, run_count, run_capacity;
    uint64_t space;        /* number of points that can be added to the paint */
    bool continues;        /* the first run continues the stroke of the previous call */
    uint64_t random;       /* state of the pseudorandom numbers */
    bool begun;            /* `last` and `ahead` are set */
    bool in_paint;         /* the stroke that is being drawn is the last stroke of the paint */
    bool pen_down;         /* the pen was painting at the previous step */
    double step_pressure;  /* pressure at the last step */
    double stroke_time;    /* time at which the current stroke began */
    ebpo_paint_input last; /* last position of the previous call */
    double ahead;          /* distance along the path from `last` to the next step */
    ebpo_paint_drawn drawn;
} drawing;

/* --- checking --- */

static bool is_in_range(double v, double least, double most) { return v >= least && v <= most; }

static const char *pen_wrong(const ebpo_paint_pen *pen)
{
    if (!is_in_range(pen->radius, 1 / EBPO_PAINT_MAX, EBPO_PAINT_MAX))
        return "a pen's radius must be 2^-200 to 2^200";
    if (!is_in_range(pen->spread, 0, EBPO_PAINT_MAX))
        return "a pen's spread must be 0 to 2^200";
    if (pen->density < 1 || pen->density > DENSITY_MAX || (pen->spread == 0 && pen->density != 1))
        return "a pen's density must be 1 to 10,000, and 1 if the spread is 0";
    if (!is_in_range(pen->size_least, 0x1p-15, 1) || !is_in_range(pen->size_full, 0x1p-15, 1))
        return "a pen's sizes must be 2^-15 to 1";
    if (pen->step != 0 && !is_in_range(pen->step, 1 / EBPO_PAINT_MAX, DBL_MAX))
        return "a pen's step must be 0, or at least 2^-200";
    if (pen->pressure_step != 0 && !is_in_range(pen->pressure_step, 0x1p-15, 1))
        return "a pen's step of the pressure must be 0, or 2^-15 to 1";
    return pen->within >= 0 ? NULL : "a pen's distance from the surface must be at least 0";
}

static const char *input_wrong(const ebpo_paint_input *h)
{
    for (int k = 0; k < 3; k++)
        if (!(fabs(h->place[k]) <= EBPO_PAINT_MAX))
            return "a position of the pen is not finite, or beyond 2^200";
    if (!is_in_range(h->pressure, 0, 1))
        return "the pen's pressure must be 0 to 1";
    return is_in_range(h->time, 0, UINT32_MAX) ? NULL : "the pen's time must be 0 to 2^32 - 1";
}

static ebpo_status check_input(const ebpo_paint_input *input, uint64_t count, ebpo_error *error)
{
    const char *wrong = count ? NULL : "a stroke needs at least one position of the pen";
    for (uint64_t i = 0; i < count && !wrong; i++)
        wrong = input_wrong(&input[i]);
    return wrong ? ebpo_fail(error, EBPO_E_ARGUMENT, "%s", wrong) : EBPO_OK;
}

static ebpo_status check_pen(const drawing *d, ebpo_error *error)
{
    const char *wrong = pen_wrong(&d->pen);
    ebpo_stroke_data stroke = { .radius = d->pen.radius,
                                .time = d->pen.time,
                                .layer =
                                    d->pen.layer < UINT32_MAX ? (uint32_t)d->pen.layer : UINT32_MAX,
                                .kind = (uint32_t)d->pen.kind,
                                .count = 1 };
    for (int i = 0; i < 4; i++)
        stroke.rgba[i] = (uint8_t)(d->pen.colour >> (24 - 8 * i));
    if (!wrong)
        wrong = ebpo_paint_stroke_wrong(&stroke, d->paint->layer_count);
    return wrong ? ebpo_fail(error, EBPO_E_ARGUMENT, "%s", wrong) : EBPO_OK;
}

/* --- a point --- */

/* Rounds the weights of the second and third corner to multiples of 2^-30. */
static void round_weights(const double weight[3], uint32_t out[2])
{
    for (int i = 0; i < 2; i++) {
        double w = floor(fmin(fmax(weight[i + 1], 0), 1) * EBPO_PAINT_WEIGHTS + 0.5);
        out[i] = (uint32_t)w;
    }
    if (out[0] + out[1] > EBPO_PAINT_WEIGHTS)
        out[1] = EBPO_PAINT_WEIGHTS - out[0];
}

static void set_point(ebpo_paint_point *q, const ebpo_distance_result *at,
                      const double corner[3][3])
{
    ebpo_face_near near;
    *q = (ebpo_paint_point){ .face = (uint32_t)at->face, .size = EBPO_PAINT_FULL };
    memcpy(q->place, at->point, sizeof q->place);
    ebpo_face_nearest(at->point, corner, &near);
    round_weights(near.weight, q->weight);
}

/* Finds the nearest point of the model within the distance `within`. is_found reports if there is
 * such a point. */
static ebpo_status find_nearest(ebpo_context *context, const double place[3], double within,
                                ebpo_distance_result *out, ebpo_error *error)
{
    ebpo_distance_options options = EBPO_DISTANCE_OPTIONS_INIT;
    options.unsigned_distance = true;
    options.max_distance = within;
    return ebpo_distance(context, place, &options, out, error);
}

/* Returns true if find_nearest has found a point. */
static bool is_found(const ebpo_distance_result *at)
{
    return at->face != EBPO_NO_FACE && isfinite(at->distance);
}

/* Finds the reach of a ball around a point of the model. Fails with EBPO_E_ABSENT if the model is a
 * subset that omits some of the faces around the point. */
static ebpo_status reach_around(ebpo_reach_search *reach, const ebpo_distance_result *at,
                                double radius, ebpo_error *error)
{
    ebpo_reach_ball ball = { { at->point[0], at->point[1], at->point[2] }, radius, at->face };
    bool complete;
    ebpo_status status = ebpo_reach_find(reach, &ball, &complete, error);
    return status != EBPO_OK || complete
               ? status
               : ebpo_fail(error, EBPO_E_ABSENT,
                           "the subset omits some faces around the pen; paint on the whole "
                           "model, or farther from the omitted faces");
}

ebpo_status ebpo_paint_locate(const ebpo_paint *p, ebpo_context *context, const double place[3],
                              ebpo_paint_point *out, ebpo_error *error)
{
    EBPO_DEFAULT_FP;
    ebpo_distance_result at;
    ebpo_reach_search reach;
    ebpo_status status = ebpo_paint_check_context(p, context, error);
    if (status == EBPO_OK)
        status = find_nearest(context, place, INFINITY, &at, error);
    if (status != EBPO_OK)
        return status;
    ebpo_reach_begin(&reach, context);
    status = reach_around(&reach, &at, 0, error);
    if (status == EBPO_OK)
        set_point(out, &at, (const double(*)[3])reach.face[reach.own].corner);
    ebpo_reach_end(&reach);
    return status;
}

/* --- a step --- */

static ebpo_status add_point(drawing *d, const ebpo_distance_result *at, const double corner[3][3],
                             const ebpo_paint_input *input, ebpo_error *error)
{
    double share = d->pen.size_least + input->pressure * (d->pen.size_full - d->pen.size_least);
    if (d->point_count == d->space)
        return ebpo_fail(error, EBPO_E_LIMIT,
                         "the stroke would exceed the %d points that a paint may have; use "
                         "longer steps or fewer points",
                         EBPO_PAINT_POINTS);
    if (!ebpo_grow(&d->point, &d->point_capacity, d->point_count + 1, sizeof *d->point))
        return ebpo_fail_memory(error, d->point_count * sizeof *d->point);
    ebpo_paint_point *q = &d->point[d->point_count++];
    set_point(q, at, corner);
    q->size = (uint16_t)fmax(1, floor(share * EBPO_PAINT_FULL + 0.5));
    q->pressure = (uint16_t)floor(input->pressure * UINT16_MAX + 0.5);
    q->time = (uint32_t)(input->time - d->stroke_time);
    d->run[d->run_count - 1].count++;
    return EBPO_OK;
}

/* Makes two unit vectors that are perpendicular to each other and to the normal. If the normal is
 * 0, 0, 0 (a face without area), they are perpendicular to the z axis. */
static void make_frame(const double normal[3], double u[3], double v[3])
{
    double n[3] = { 0, 0, 1 }, axis[3] = { 0, 0, 0 };
    int least = 0;
    if (normal[0] != 0 || normal[1] != 0 || normal[2] != 0)
        memcpy(n, normal, sizeof n);
    for (int k = 1; k < 3; k++)
        if (fabs(n[k]) < fabs(n[least]))
            least = k;
    axis[least] = 1;
    ebpo_vec3_cross(n, axis, u);
    double length = sqrt(ebpo_vec3_dot(u, u));
    for (int k = 0; k < 3; k++)
        u[k] /= length;
    ebpo_vec3_cross(n, u, v);
}

/* Computes a random point, uniformly distributed in the unit disc. */
static void random_in_disc(uint64_t *state, double out[2])
{
    do {
        for (int i = 0; i < 2; i++)
            out[i] = 2 * ebpo_random_unit(ebpo_random_next(state)) - 1;
    } while (out[0] * out[0] + out[1] * out[1] > 1);
}

/* Returns the face of the reach with this index, or NULL. */
static const ebpo_reach_face *face_of(const ebpo_reach_search *reach, uint64_t face)
{
    for (uint64_t i = 0; i < reach->count; i++)
        if (reach->face[i].face == face)
            return &reach->face[i];
    return NULL;
}

/* Adds points that are scattered around `middle` within its reach. Adds more points if the pressure
 * is greater. */
static ebpo_status scatter_points(drawing *d, const ebpo_distance_result *middle,
                                  const ebpo_paint_input *input, ebpo_error *error)
{
    double u[3], v[3], place[3], disc[2], spread = d->pen.spread;
    unsigned wanted = (unsigned)fmax(1, floor(input->pressure * d->pen.density + 0.5));
    ebpo_status status = EBPO_OK;
    make_frame(middle->normal, u, v);
    for (unsigned i = 0; i < wanted && status == EBPO_OK; i++) {
        ebpo_distance_result at;
        random_in_disc(&d->random, disc);
        for (int k = 0; k < 3; k++)
            place[k] = middle->point[k] + spread * (disc[0] * u[k] + disc[1] * v[k]);
        status = find_nearest(d->context, place, spread, &at, error);
        if (status != EBPO_OK)
            return status;
        const ebpo_reach_face *f = is_found(&at) ? face_of(&d->reach, at.face) : NULL;
        if (f && ebpo_ball_holds(middle->point, spread * spread, at.point))
            status = add_point(d, &at, f->corner, input, error);
        else
            d->drawn.strayed++;
    }
    return status;
}

/* Begins a stroke if the pen is not painting yet. */
static ebpo_status begin_stroke(drawing *d, const ebpo_paint_input *input, ebpo_error *error)
{
    if (d->pen_down)
        return EBPO_OK;
    if (!ebpo_grow(&d->run, &d->run_capacity, d->run_count + 1, sizeof *d->run))
        return ebpo_fail_memory(error, d->run_count * sizeof *d->run);
    d->run[d->run_count++] = (stroke_range){ d->point_count, 0 };
    d->stroke_time = input->time;
    d->pen_down = true;
    return EBPO_OK;
}

/* Makes the points of one step, or lifts the pen if it presses on no surface. */
static ebpo_status make_step(drawing *d, const ebpo_paint_input *input, ebpo_error *error)
{
    ebpo_distance_result at = { .face = EBPO_NO_FACE };
    ebpo_status status = EBPO_OK;
    d->step_pressure = input->pressure;
    if (input->pressure > 0)
        status = find_nearest(d->context, input->place, d->pen.within, &at, error);
    if (status != EBPO_OK)
        return status;
    if (!is_found(&at)) {
        d->pen_down = false;
        d->drawn.lifted++;
        return EBPO_OK;
    }
    d->drawn.steps++;
    status = begin_stroke(d, input, error);
    if (status == EBPO_OK)
        status = reach_around(&d->reach, &at, d->pen.spread, error);
    if (status != EBPO_OK)
        return status;
    return d->pen.spread > 0
               ? scatter_points(d, &at, input, error)
               : add_point(d, &at, (const double(*)[3])d->reach.face[d->reach.own].corner, input,
                           error);
}

/* --- the path --- */

/* Interpolates between two positions of the pen, at the fraction t of the way. */
static void interpolate_input(const ebpo_paint_input *a, const ebpo_paint_input *b, double t,
                              ebpo_paint_input *out)
{
    for (int k = 0; k < 3; k++)
        out->place[k] = a->place[k] + t * (b->place[k] - a->place[k]);
    out->pressure = fmin(fmax(a->pressure + t * (b->pressure - a->pressure), 0), 1);
    out->time = fmax(a->time + t * (b->time - a->time), 0);
}

static double length_between(const ebpo_paint_input *a, const ebpo_paint_input *b)
{
    double d[3];
    ebpo_vec3_subtract(b->place, a->place, d);
    return sqrt(ebpo_vec3_dot(d, d));
}

/* Follows the path, and makes a step at each multiple of the step's length along it. */
static ebpo_status follow_path(drawing *d, const ebpo_paint_input *input, uint64_t count,
                               ebpo_error *error)
{
    double step = d->pen.step != 0 ? d->pen.step : fmax(d->pen.radius, d->pen.spread) / 2;
    ebpo_status status = EBPO_OK;
    for (uint64_t i = 0; i < count && status == EBPO_OK; i++) {
        const ebpo_paint_input *from = i ? &input[i - 1] : &d->last;
        if (!d->begun) {
            status = make_step(d, &input[i], error);
            d->ahead = step;
            d->begun = true;
            continue;
        }
        double length = length_between(from, &input[i]), at = d->ahead;
        if (i % 64 == 1 && !ebpo_progress_step(&d->pen.progress, "drawing", i, count, error))
            return EBPO_E_CANCELLED;
        if (!(length / step <= EBPO_PAINT_POINTS))
            return ebpo_fail(
                error, EBPO_E_LIMIT,
                "two positions of the pen are more than %d steps apart; use longer steps",
                EBPO_PAINT_POINTS);
        for (uint64_t k = 1; at <= length && status == EBPO_OK; k++) {
            ebpo_paint_input pen;
            interpolate_input(from, &input[i], at / length, &pen);
            pen.time = fmax(pen.time, d->stroke_time);
            status = make_step(d, &pen, error);
            at = d->ahead + (double)k * step;
        }
        d->ahead = at - length;
        if (status == EBPO_OK && d->pen.pressure_step > 0 &&
            input[i].pressure >= d->step_pressure + d->pen.pressure_step)
            status = make_step(d, &input[i], error);
    }
    d->last = input[count - 1];
    return status;
}

/* Adds the points of a run to the last stroke of the paint. */
static ebpo_status extend_stroke(drawing *d, const stroke_range *run, ebpo_error *error)
{
    ebpo_paint *p = d->paint;
    if (!ebpo_grow(&p->point, &p->point_capacity, p->point_count + run->count, sizeof *p->point))
        return ebpo_fail_memory(error, run->count * sizeof *p->point);
    if (run->count)
        memcpy(p->point + p->point_count, d->point + run->first, run->count * sizeof *p->point);
    p->stroke[p->stroke_count - 1].count += (uint32_t)run->count;
    p->point_count += run->count;
    return EBPO_OK;
}

static ebpo_status add_stroke(drawing *d, const stroke_range *run, ebpo_error *error)
{
    ebpo_paint_stroke s = EBPO_PAINT_STROKE_INIT;
    s.layer = d->pen.layer;
    s.kind = d->pen.kind;
    s.colour = d->pen.colour;
    s.radius = d->pen.radius;
    s.time = d->pen.time;
    s.points = d->point + run->first;
    s.point_count = run->count;
    return ebpo_paint_add_stroke(d->paint, &s, error);
}

/* Adds the points of all runs to the paint. After a failure, removes those that were added. */
static ebpo_status keep_strokes(drawing *d, ebpo_error *error)
{
    ebpo_paint *p = d->paint;
    uint64_t strokes = p->stroke_count, points = p->point_count;
    bool extends = d->continues && d->in_paint;
    uint32_t extended = extends ? p->stroke[strokes - 1].count : 0;
    ebpo_status status = EBPO_OK;
    for (uint64_t i = 0; i < d->run_count && status == EBPO_OK; i++) {
        const stroke_range *run = &d->run[i];
        if (i > 0 || !d->continues)
            d->in_paint = false;
        if (d->in_paint)
            status = extend_stroke(d, run, error);
        else if (run->count)
            status = add_stroke(d, run, error);
        d->in_paint = d->in_paint || run->count > 0;
    }
    if (status == EBPO_OK) {
        d->drawn.strokes += p->stroke_count - strokes;
        d->drawn.points += d->point_count;
        return EBPO_OK;
    }
    p->stroke_count = strokes;
    p->point_count = points;
    if (extends)
        p->stroke[strokes - 1].count = extended;
    return status;
}

/* Draws the path of `input`, which begins at the end of the previous call's path. */
static ebpo_status draw_path(drawing *d, const ebpo_paint_input *input, uint64_t count,
                             ebpo_error *error)
{
    d->space = EBPO_PAINT_POINTS - d->paint->point_count;
    d->point_count = d->run_count = 0;
    d->continues = d->pen_down;
    if (d->continues) {
        if (!ebpo_grow(&d->run, &d->run_capacity, 1, sizeof *d->run))
            return ebpo_fail_memory(error, sizeof *d->run);
        d->run[d->run_count++] = (stroke_range){ 0, 0 };
    }
    ebpo_status status = follow_path(d, input, count, error);
    return status == EBPO_OK ? keep_strokes(d, error) : status;
}

ebpo_status ebpo_paint_drawing_new(ebpo_paint *p, ebpo_context *context, const ebpo_paint_pen *pen,
                                   ebpo_paint_drawing **out, ebpo_error *error)
{
    *out = NULL;
    drawing *d = ebpo_alloc_zero(1, sizeof *d);
    if (!d)
        return ebpo_fail_memory(error, sizeof *d);
    d->paint = p;
    d->context = context;
    d->pen = (ebpo_paint_pen)EBPO_PAINT_PEN_INIT;
    d->drawn.struct_size = sizeof d->drawn;
    ebpo_status status = EBPO_TAKE(ebpo_paint_pen, &d->pen, pen, error);
    if (status == EBPO_OK)
        status = check_pen(d, error);
    if (status == EBPO_OK)
        status = ebpo_paint_check_context(p, context, error);
    if (status != EBPO_OK) {
        free(d);
        return status;
    }
    d->random = d->pen.seed;
    ebpo_reach_begin(&d->reach, context);
    *out = d;
    return EBPO_OK;
}

ebpo_status ebpo_paint_drawing_add(ebpo_paint_drawing *d, const ebpo_paint_input *input,
                                   uint64_t count, ebpo_paint_drawn *drawn, ebpo_error *error)
{
    EBPO_DEFAULT_FP;
    const ebpo_paint_drawn before = d->drawn;
    ebpo_status status = drawn ? EBPO_CHECK_SIZED(ebpo_paint_drawn, drawn, error) : EBPO_OK;
    if (status == EBPO_OK)
        status = check_input(input, count, error);
    if (status != EBPO_OK)
        return status;
    status = draw_path(d, input, count, error);
    if (status == EBPO_OK && drawn)
        EBPO_GIVE(ebpo_paint_drawn, drawn, &d->drawn);
    if (status != EBPO_OK) {
        d->begun = d->pen_down = d->in_paint = false;
        d->drawn = before;
    }
    return status;
}

void ebpo_paint_drawing_free(ebpo_paint_drawing *d)
{
    if (!d)
        return;
    ebpo_reach_end(&d->reach);
    free(d->point);
    free(d->run);
    free(d);
}

ebpo_status ebpo_paint_draw(ebpo_paint *p, ebpo_context *context, const ebpo_paint_input *input,
                            uint64_t count, const ebpo_paint_pen *pen, ebpo_paint_drawn *drawn,
                            ebpo_error *error)
{
    ebpo_paint_drawing *d = NULL;
    ebpo_status status = ebpo_paint_drawing_new(p, context, pen, &d, error);
    if (status == EBPO_OK)
        status = ebpo_paint_drawing_add(d, input, count, drawn, error);
    ebpo_paint_drawing_free(d);
    return status;
}
