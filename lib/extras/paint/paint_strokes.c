/* Strokes and their points. */
#include "core/strict_fp.h"

#include <ebpo/paint.h>

#include <math.h>
#include <string.h>

#include "core/alloc.h"
#include "core/error.h"
#include "extras/paint/paint_parts.h"

const char *ebpo_paint_point_wrong(const ebpo_paint_point *q)
{
    for (int i = 0; i < 3; i++)
        if (!(fabs(q->place[i]) <= EBPO_PAINT_MOST))
            return "a place is not finite, or beyond 2^200";
    if (q->face == UINT32_MAX)
        return "a point has no face";
    if ((uint64_t)q->weight[0] + q->weight[1] > EBPO_PAINT_WEIGHTS)
        return "the weights of a point are more than 2^30 in sum";
    if (q->size < 1 || q->size > EBPO_PAINT_FULL)
        return "the size of a point is not 1 to 2^15";
    return NULL;
}

const char *ebpo_paint_stroke_wrong(const ebpo_stroke_held *s, uint64_t layers)
{
    static const uint8_t none[4];
    if (s->layer >= layers)
        return "a stroke is in a layer that there is not";
    if (s->kind > EBPO_PAINT_ERASES)
        return "a stroke is of a kind that is not known";
    if (s->kind == EBPO_PAINT_ERASES && memcmp(s->rgba, none, sizeof none) != 0)
        return "an erasing stroke has a colour, which has to be 0";
    if (!(s->radius >= 1 / EBPO_PAINT_MOST && s->radius <= EBPO_PAINT_MOST))
        return "the radius of a stroke is not 2^-200 to 2^200";
    if (s->time > EBPO_PAINT_TIME_MOST)
        return "the time of a stroke is beyond 2^53";
    return s->count == 0 ? "a stroke has no point" : NULL;
}

ebpo_status ebpo_paint_get_stroke(const ebpo_paint *p, uint64_t number, ebpo_paint_stroke *out)
{
    ebpo_paint_stroke own = EBPO_PAINT_STROKE_INIT;
    ebpo_status status = EBPO_CHECK_SIZED(ebpo_paint_stroke, out, NULL);
    if (status != EBPO_OK || number >= p->stroke_count)
        return EBPO_E_ARGUMENT;
    const ebpo_stroke_held *s = &p->stroke[number];
    own.layer = s->layer;
    own.kind = (ebpo_paint_kind)s->kind;
    own.colour = ebpo_paint_pack(s->rgba);
    own.radius = s->radius;
    own.time = s->time;
    own.point_count = s->count;
    own.points = p->point + s->first;
    return EBPO_GIVE(ebpo_paint_stroke, out, &own);
}

static ebpo_status check(const ebpo_paint *p, const ebpo_paint_stroke *stroke,
                         ebpo_stroke_held *out, ebpo_error *error)
{
    *out = (ebpo_stroke_held){ .radius = stroke->radius,
                               .time = stroke->time,
                               .first = p->point_count,
                               .layer = stroke->layer < UINT32_MAX ? (uint32_t)stroke->layer
                                                                   : UINT32_MAX,
                               .kind = (uint32_t)stroke->kind };
    for (int i = 0; i < 4; i++)
        out->rgba[i] = (uint8_t)(stroke->colour >> (24 - 8 * i));
    if (p->stroke_count == EBPO_PAINT_STROKES ||
        stroke->point_count > EBPO_PAINT_POINTS - p->point_count)
        return ebpo_fail(error, EBPO_E_LIMIT,
                         "a paint has at most %d strokes, and %d points in all of them",
                         EBPO_PAINT_STROKES, EBPO_PAINT_POINTS);
    out->count = (uint32_t)stroke->point_count;
    const char *wrong = ebpo_paint_stroke_wrong(out, p->layer_count);
    for (uint64_t i = 0; i < stroke->point_count && !wrong; i++)
        wrong = ebpo_paint_point_wrong(&stroke->points[i]);
    return wrong ? ebpo_fail(error, EBPO_E_ARGUMENT, "%s", wrong) : EBPO_OK;
}

ebpo_status ebpo_paint_add_stroke(ebpo_paint *p, const ebpo_paint_stroke *given, ebpo_error *error)
{
    ebpo_stroke_held held;
    ebpo_paint_stroke stroke = EBPO_PAINT_STROKE_INIT;
    ebpo_status status = EBPO_TAKE(ebpo_paint_stroke, &stroke, given, error);
    if (status == EBPO_OK)
        status = check(p, &stroke, &held, error);
    if (status != EBPO_OK)
        return status;
    if (!ebpo_grow(&p->stroke, &p->stroke_capacity, p->stroke_count + 1, sizeof *p->stroke) ||
        !ebpo_grow(&p->point, &p->point_capacity, p->point_count + held.count, sizeof *p->point))
        return ebpo_fail_memory(error, held.count * sizeof *p->point);
    memcpy(p->point + p->point_count, stroke.points, held.count * sizeof *p->point);
    for (uint32_t i = 0; i < held.count; i++)
        p->point[p->point_count + i].reserved = 0;
    p->stroke[p->stroke_count++] = held;
    p->point_count += held.count;
    return EBPO_OK;
}

ebpo_status ebpo_paint_remove_stroke(ebpo_paint *p, uint64_t number, ebpo_error *error)
{
    if (number >= p->stroke_count)
        return ebpo_fail(
            error, EBPO_E_ARGUMENT,
            "there is no stroke %llu: strokes are counted from 0, and the paint has %llu",
            (unsigned long long)number, (unsigned long long)p->stroke_count);
    ebpo_stroke_held gone = p->stroke[number];
    uint64_t end = gone.first + gone.count;
    memmove(p->point + gone.first, p->point + end, (p->point_count - end) * sizeof *p->point);
    p->point_count -= gone.count;
    p->stroke_count--;
    memmove(p->stroke + number, p->stroke + number + 1,
            (p->stroke_count - number) * sizeof *p->stroke);
    for (uint64_t i = number; i < p->stroke_count; i++)
        p->stroke[i].first -= gone.count;
    return EBPO_OK;
}
