/* Computes the haptic step of a probe (a point): bounds of its distance to the surface, and if it
 * is inside or outside.
 *
 * Certain bounds come from three sources: the faces of the current box, the exact result for a
 * recent position of the probe, and the first levels of the octree. The step returns the
 * intersection of these intervals. The side (EBPO_IN, EBPO_OUT) follows from the winding number,
 * which changes at each face that the probe crosses. Exact arithmetic finds these faces. The side
 * is EBPO_MAYBE if the step reaches its limit of work before it finds the side. */
#include "core/strict_fp.h"

#include <math.h>

#include "core/fp_env.h"
#include "query/query_model.h"
#include "extras/haptic/haptic_parts.h"
#include "geometry/vec3.h"

/* Greatest number of visited nodes of the first levels. */
enum { VISITS = 512 };

/* Bounds of the unsigned distance. */
typedef struct bounds {
    double lo, hi;
} bounds;

static void narrow_bounds(bounds *b, double lo, double hi)
{
    b->lo = fmax(b->lo, lo);
    b->hi = fmin(b->hi, hi);
}

/* Bounds the rounding error of a length between points of the model. */
static double rounding_of(const ebpo_haptic *t, double length)
{
    return t->levels.slack + EBPO_LENGTH_SLACK * length;
}

/* Narrows the bounds by the faces of the current box. Returns true if the nearest face is known. */
static bool bound_by_faces(ebpo_haptic *t, const double place[3], ebpo_haptic_probe_result *out,
                           bounds *b)
{
    ebpo_haptic_ball_result near = { 0 };
    ebpo_haptic_find_nearest(t, &near);
    out->work += near.work;
    out->flags |= near.flags;
    out->face = near.face;
    ebpo_vec3_copy(near.normal, out->normal);
    ebpo_vec3_copy(near.point, out->point);
    ebpo_vec3_copy(near.weight, out->weight);
    bool all = !(near.flags & EBPO_HAPTIC_FACES_OMITTED);
    double distance = INFINITY, search_radius = t->options.search_radius;
    if (near.face != EBPO_NO_FACE) {
        double motion[3];
        ebpo_vec3_subtract(place, near.point, motion);
        distance = sqrt(ebpo_vec3_dot(motion, motion));
    }
    double nearer = fmin(distance, search_radius);
    narrow_bounds(b, all ? nearer - rounding_of(t, nearer) : 0,
                  distance + rounding_of(t, distance));
    return all && near.face != EBPO_NO_FACE;
}

/* Narrows the bounds by the newest exact result and the distance of its position from `place`.
 * Returns true if these positions are equal. */
static bool bound_by_known(ebpo_haptic *t, const double place[3], ebpo_haptic_probe_result *out,
                           bounds *b)
{
    const ebpo_probe_query *known = ebpo_haptic_newest_probe_query(t);
    double motion[3];
    if (!known->valid)
        return false;
    ebpo_vec3_subtract(place, known->place, motion);
    double far = sqrt(ebpo_vec3_dot(motion, motion)),
           rounding = rounding_of(t, far + known->distance);
    narrow_bounds(b, known->distance - far - rounding, known->distance + far + rounding);
    if (out->normal[0] == 0 && out->normal[1] == 0 && out->normal[2] == 0)
        ebpo_vec3_copy(known->normal, out->normal);
    return far == 0;
}

/* Finds the winding number at `place` by a move to `place` from the last position with a known
 * winding number. If the box does not contain that position, the move begins at the position of the
 * newest exact result. Returns false if the winding number is not found. */
static bool find_side(ebpo_haptic *t, const double place[3], ebpo_haptic_probe_result *out)
{
    const ebpo_probe_query *known = &t->known[t->step_result];
    const ebpo_face_box *box = &t->box[t->current_box];
    for (int attempt = 0; attempt < 2; attempt++) {
        if (ebpo_known_winding_move(&t->probed_point, box, place, t->found, EBPO_HAPTIC_FACES,
                                    EBPO_HAPTIC_VISITS, &out->work))
            return true;
        if (t->probed_point.known || !known->valid || known->on_face)
            return false;
        ebpo_vec3_copy(known->place, t->probed_point.at);
        t->probed_point.winding = known->winding;
        t->probed_point.known = true;
    }
    return false;
}

/* Returns EBPO_IN, EBPO_OUT, EBPO_ON or EBPO_MAYBE for a position. */
static int32_t classify_position(ebpo_haptic *t, const double place[3],
                                 ebpo_haptic_probe_result *out)
{
    int32_t winding;
    const ebpo_face_box *box = &t->box[t->current_box];
    if (!t->solid)
        return EBPO_OUT;
    if (ebpo_held_levels_winding(&t->levels, place, &winding)) {
        ebpo_vec3_copy(place, t->probed_point.at);
        t->probed_point.winding = winding;
        t->probed_point.known = true;
    } else if (ebpo_extent_holds(&box->allowed, place) &&
               ebpo_is_on_face(box, place, t->found, EBPO_HAPTIC_FACES, EBPO_HAPTIC_VISITS)) {
        return EBPO_ON;
    } else if (!find_side(t, place, out)) {
        return EBPO_MAYBE;
    }
    return ebpo_rule_inside(t->model->info->rule, t->probed_point.winding) ? EBPO_IN : EBPO_OUT;
}

/* Sets the interval of the signed distance. close: the nearest face or the exact distance is known,
 * so that the middle of the interval is accurate; if false, `distance` is NAN. */
static void fill_bounds(ebpo_haptic_probe_result *out, const bounds *b, bool close)
{
    double lo = fmax(0, fmin(b->lo, b->hi)), hi = b->hi;
    bool in = out->where == EBPO_IN, maybe = out->where == EBPO_MAYBE;
    out->lo = in || maybe ? -hi : lo;
    out->hi = in ? -lo : hi;
    out->distance = !close || maybe ? NAN : in ? 0.5 * (out->lo + out->hi) : 0.5 * (lo + hi);
    if (out->where == EBPO_ON)
        out->distance = 0;
    if (isfinite(out->distance))
        out->flags |= EBPO_HAPTIC_ACCURATE;
}

void ebpo_haptic_step_probe(ebpo_haptic *t, const double place[3], ebpo_haptic_probe_result *out)
{
    EBPO_DEFAULT_FP;
    double at[3];
    bool bad_input = false;
    bounds b = { 0, INFINITY };
    *out = (ebpo_haptic_probe_result){ .face = EBPO_NO_FACE, .where = EBPO_MAYBE };
    if (t->options.kind != EBPO_HAPTIC_PROBE) {
        out->flags = EBPO_HAPTIC_WRONG_KIND;
        return;
    }
    for (int i = 0; i < 3; i++)
        bad_input |= !(fabs(place[i]) <= 0x1p200);
    ebpo_vec3_copy(bad_input ? t->device : place, at);
    out->flags = (bad_input ? EBPO_HAPTIC_BAD_INPUT : 0) | ebpo_haptic_stopped(t);
    ebpo_vec3_copy(at, t->proxy);
    ebpo_vec3_copy(at, t->device);
    (void)ebpo_haptic_take_box(t);
    bool close = bound_by_faces(t, at, out, &b);
    close |= bound_by_known(t, at, out, &b);
    double lo, hi;
    ebpo_held_levels_bound(&t->levels, at, VISITS, &lo, &hi);
    narrow_bounds(&b, lo, hi);
    out->where = classify_position(t, at, out);
    fill_bounds(out, &b, close);
    ebpo_haptic_count(t, out->flags | (out->flags & EBPO_HAPTIC_ACCURATE ? 0 : EBPO_HAPTIC_WAITING),
                      out->work);
    ebpo_haptic_report(t, at);
}
