/* Points that are so close to a solid's faces that their place in its model is in doubt: the faces
 * near them are posed, and decide. From a point farther away, where the winding number is known, an
 * axis-parallel segment leads to the point in question; what it crosses is counted. */
#include "core/strict_fp.h"

#include "extras/collide/posed_sides.h"

#include <math.h>
#include <string.h>

#include "core/error.h"
#include "geometry/min_max.h"
#include "geometry/predicates.h"

/* --- faces --- */

typedef struct looking {
    const ebpo_posed_solid *solid;
    const double *w;
    int axis;              /* the segment runs along it, */
    double low[3], to;     /* from here to there */
    int32_t crossed, jump; /* winding numbers: end less beginning; above less below */
    ebpo_posed_sides *out;
} looking;

/* Which axis tells the two sides of a face apart: the first one that its plane is not parallel to;
 * -1: no area. */
static int side_axis(const double t[3][3])
{
    for (int k = 0; k < 3; k++)
        if (ebpo_normal_sign(k, t[0], t[1], t[2]) != 0)
            return k;
    return -1;
}

static bool in_plane(const double plane[3][3], const double t[3][3])
{
    return ebpo_orient3d(plane[0], plane[1], plane[2], t[0]) == 0 &&
           ebpo_orient3d(plane[0], plane[1], plane[2], t[1]) == 0 &&
           ebpo_orient3d(plane[0], plane[1], plane[2], t[2]) == 0;
}

/* A face that w is on. */
static void take_on(looking *l, const double t[3][3])
{
    int axis = side_axis(t);
    if (axis < 0)
        return; /* bounds nothing */
    if (!l->out->on)
        memcpy(l->out->plane, t, sizeof l->out->plane);
    else if (!in_plane((const double(*)[3])l->out->plane, t))
        l->out->flat = false;
    l->out->on = true;
    double from[3] = { l->w[0], l->w[1], l->w[2] };
    from[axis] = nextafter(from[axis], -INFINITY);
    l->jump += ebpo_axis_crossing(from, nextafter(l->w[axis], INFINITY), axis, t[0], t[1], t[2]);
}

static bool take(void *user, const ebpo_triangles *triangles)
{
    looking *l = user;
    for (uint64_t i = 0; i < triangles->count; i++) {
        double t[3][3];
        for (int c = 0; c < 3; c++)
            ebpo_posing_apply(&l->solid->posing, triangles->corners[i][c], t[c]);
        l->crossed += ebpo_axis_crossing(l->low, l->to, l->axis, t[0], t[1], t[2]);
        if (ebpo_point_on_triangle(l->w, t[0], t[1], t[2]))
            take_on(l, (const double(*)[3])t);
    }
    return true;
}

/* --- a point that is certainly far enough from faces --- */

typedef struct anchor {
    double at[3];
    int axis;        /* on which it is away from w */
    int32_t winding; /* there */
} anchor;

static ebpo_status try_anchor(const ebpo_posed_solid *s, ebpo_context *context, anchor *a,
                              bool *found, ebpo_error *error)
{
    double p[3], doubt;
    ebpo_inside_result inside = { 0 };
    *found = !ebpo_posed_solid_near(s, a->at, 0);
    a->winding = 0;
    if (*found)
        return EBPO_OK;
    ebpo_unpose(s, a->at, p, &doubt);
    ebpo_status status = ebpo_posed_solid_clear(context, p, doubt, found, error);
    if (status == EBPO_OK && *found)
        status = ebpo_inside(context, p, NULL, &inside, error);
    a->winding = inside.winding;
    return status;
}

/* Farther and farther away; beyond the solid's box at the latest. */
static ebpo_status find_anchor(const ebpo_posed_solid *s, ebpo_context *context, const double w[3],
                               double step, anchor *a, ebpo_error *error)
{
    for (;; step *= 4)
        for (int side = 0; side < 6; side++) {
            bool found;
            memcpy(a->at, w, sizeof a->at);
            a->axis = side / 2;
            a->at[a->axis] += side % 2 ? -step : step;
            ebpo_status status = try_anchor(s, context, a, &found, error);
            if (status != EBPO_OK || found)
                return status;
        }
}

static ebpo_status decide_by_faces(const ebpo_posed_solid *s, ebpo_context *context,
                                   const double w[3], double doubt, ebpo_posed_sides *out,
                                   ebpo_error *error)
{
    anchor a;
    double low[3], high[3];
    looking l = { .solid = s, .w = w, .out = out };
    ebpo_status status = find_anchor(s, context, w, 8 * doubt * s->posing.scale, &a, error);
    if (status != EBPO_OK)
        return status;
    bool upward = a.at[a.axis] > w[a.axis]; /* the segment begins at w */
    l.axis = a.axis;
    memcpy(l.low, upward ? w : a.at, sizeof l.low);
    l.to = upward ? a.at[a.axis] : w[a.axis];
    ebpo_unpose_box(s, w, a.at, low, high);
    status = ebpo_triangles_in_box(context, low, high, take, &l, error);
    if (status != EBPO_OK)
        return status;
    out->above = upward ? a.winding - l.crossed : a.winding + l.crossed;
    out->below = out->above - l.jump;
    return EBPO_OK;
}

ebpo_status ebpo_posed_solid_sides(const ebpo_posed_solid *s, ebpo_context *context,
                                   const double w[3], ebpo_posed_sides *out, ebpo_error *error)
{
    double p[3], doubt;
    bool clear = false;
    ebpo_inside_result inside;
    *out = (ebpo_posed_sides){ .flat = true };
    if (!ebpo_posed_solid_near(s, w, 0))
        return EBPO_OK;
    ebpo_unpose(s, w, p, &doubt);
    ebpo_status status = ebpo_posed_solid_clear(context, p, doubt, &clear, error);
    if (status == EBPO_OK && !clear)
        return decide_by_faces(s, context, w, doubt, out, error);
    if (status == EBPO_OK)
        status = ebpo_inside(context, p, NULL, &inside, error);
    if (status == EBPO_OK)
        out->above = out->below = inside.winding;
    return status;
}
