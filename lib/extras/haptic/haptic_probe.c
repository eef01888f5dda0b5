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
    return t->slack + EBPO_LENGTH_SLACK * length;
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
    out->instance = near.instance;
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
 * Returns true if these positions are equal and the result is accurate: far from a model whose
 * pose is not exactly a rotation, it is not. */
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
    bool accurate = known->uncertainty <= 4 * rounding;
    rounding += known->uncertainty;
    narrow_bounds(b, known->distance - far - rounding, known->distance + far + rounding);
    if (out->normal[0] == 0 && out->normal[1] == 0 && out->normal[2] == 0)
        ebpo_vec3_copy(known->normal, out->normal);
    return far == 0 && accurate;
}

/* Narrows the bounds by the upper levels of the octrees. An instance whose box is farther away than
 * the upper bound is omitted. */
static void bound_by_levels(const ebpo_haptic *t, const double place[3], bounds *b)
{
    double lo = INFINITY, hi = INFINITY;
    for (uint64_t i = 0; i < t->part_count; i++) {
        const ebpo_haptic_part *part = &t->part[i];
        double p[3], uncertainty, low, high;
        if (part->is_posed && ebpo_haptic_part_gap(part, place) > fmin(hi, b->hi))
            continue; /* its faces are not the nearest ones */
        ebpo_haptic_part_point(part, place, p, &uncertainty);
        ebpo_held_levels_bound(&part->of->levels, p, t->part_count == 1 ? VISITS : VISITS / 8, &low,
                               &high);
        double wider = part->is_posed ? uncertainty * part->scale + t->slack : 0;
        lo = fmin(lo, low * part->scale - wider);
        hi = fmin(hi, high * part->scale + wider);
    }
    narrow_bounds(b, fmin(lo, b->hi), hi);
}

/* Finds the winding number of an instance at `place` by a move to `place` from the last position
 * with a known winding number. If the box does not contain that position, the move begins at the
 * position of the newest exact result. Returns false if the winding number is not found. */
static bool find_side(ebpo_haptic *t, ebpo_haptic_part *part, const double place[3],
                      ebpo_haptic_probe_result *out)
{
    const ebpo_probe_query *known = &t->known[t->step_result];
    const ebpo_probe_side *side = &known->side[part->probed_point.instance];
    const ebpo_face_box *box = &t->box[t->current_box];
    for (int attempt = 0; attempt < 2; attempt++) {
        if (ebpo_known_winding_move(&part->probed_point, box, place, t->found, EBPO_HAPTIC_FACES,
                                    EBPO_HAPTIC_VISITS, &out->work))
            return true;
        if (part->probed_point.known || !known->valid || side->on_face)
            return false;
        ebpo_vec3_copy(known->place, part->probed_point.at);
        part->probed_point.winding = side->winding;
        part->probed_point.known = true;
    }
    return false;
}

/* Sets *winding and returns true if the winding number of an instance at `place` follows from the
 * upper levels of its octree. */
static bool find_in_levels(const ebpo_haptic_part *part, const double place[3], int32_t *winding)
{
    double p[3], uncertainty;
    *winding = 0;
    if (part->is_posed && ebpo_haptic_part_gap(part, place) > 0)
        return true;
    ebpo_haptic_part_point(part, place, p, &uncertainty);
    return ebpo_held_levels_winding(&part->of->levels, p, uncertainty, winding);
}

/* Returns the side of `place` with respect to an instance: EBPO_IN, EBPO_OUT, EBPO_ON or
 * EBPO_MAYBE. */
static int32_t classify_in(ebpo_haptic *t, ebpo_haptic_part *part, const double place[3],
                           ebpo_haptic_probe_result *out)
{
    int32_t winding;
    const ebpo_face_box *box = &t->box[t->current_box];
    if (!part->solid)
        return EBPO_OUT;
    if (find_in_levels(part, place, &winding)) {
        ebpo_vec3_copy(place, part->probed_point.at);
        part->probed_point.winding = winding;
        part->probed_point.known = true;
    } else if (ebpo_extent_holds(&box->allowed, place) &&
               ebpo_is_on_face(box, part->probed_point.instance, place, t->found, EBPO_HAPTIC_FACES,
                               EBPO_HAPTIC_VISITS)) {
        return EBPO_ON;
    } else if (!find_side(t, part, place, out)) { /* also fails if `place` is on a face */
        return EBPO_MAYBE;
    }
    return ebpo_rule_inside(part->of->model->info->rule, part->probed_point.winding) ? EBPO_IN
                                                                                     : EBPO_OUT;
}

/* Returns EBPO_IN if a position is in an instance. Otherwise returns EBPO_MAYBE if it may be in
 * one, EBPO_ON if it is on a face, or EBPO_OUT. */
static int32_t classify_position(ebpo_haptic *t, const double place[3],
                                 ebpo_haptic_probe_result *out)
{
    bool on = false, maybe = false;
    for (uint64_t i = 0; i < t->part_count; i++) {
        int32_t where = classify_in(t, &t->part[i], place, out);
        if (where == EBPO_IN)
            return EBPO_IN;
        on |= where == EBPO_ON;
        maybe |= where == EBPO_MAYBE;
    }
    return maybe ? EBPO_MAYBE : on ? EBPO_ON : EBPO_OUT;
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
    bound_by_levels(t, at, &b);
    out->where = classify_position(t, at, out);
    fill_bounds(out, &b, close);
    ebpo_haptic_count(t, out->flags | (out->flags & EBPO_HAPTIC_ACCURATE ? 0 : EBPO_HAPTIC_WAITING),
                      out->work);
    ebpo_haptic_report(t, at);
}
