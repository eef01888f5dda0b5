#include "core/strict_fp.h"

#include "extras/collide/depth_parts.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "core/alloc.h"
#include "core/os.h"
#include "core/error.h"
#include "core/sort.h"
#include "geometry/distance.h"
#include "geometry/length.h"

/* --- one point --- */

/* How deep it is in the solid, less than 0 outside: surely within *lo .. *hi. rounding: how far it
 * may be from where it should be. */
static ebpo_status depth_at(ebpo_depth_search *s, const double w[3], double *lo, double *hi,
                            double *rounding, ebpo_error *error)
{
    double p[3], doubt, scale = s->solid->posing.scale;
    ebpo_distance_result r;
    ebpo_unpose(s->solid, w, p, &doubt);
    *rounding = doubt * scale;
    s->asked++;
    ebpo_status status = ebpo_distance(s->context, p, NULL, &r, error);
    if (status != EBPO_OK)
        return status;
    double size = fabs(r.distance), off = 2 * doubt + 0x1p-50 * size;
    *hi = (size + off) * scale;
    *lo = -*hi;
    if (!(size > off)) /* a face may be on either side of it */
        return EBPO_OK;
    if (r.distance < 0)
        *lo = (size - off) * scale;
    else
        *hi = (off - size) * scale;
    return EBPO_OK;
}

/* No point of the triangle in the solid is deeper than it is away from the face that was nearest to
 * the last point asked about; and that is convex, so its corners tell. */
static double most_at_corners(const ebpo_depth_search *s, const double corner[3][3])
{
    double most = 0, p[3], doubt;
    for (int i = 0; i < 3; i++) {
        ebpo_distance_bounds d;
        ebpo_unpose(s->solid, corner[i], p, &doubt);
        ebpo_triangle_distance_bounds(p, (const double(*)[3])s->context->warm_triangle, &d);
        most = fmax(most, (d.hi + 2 * doubt) * s->solid->posing.scale + s->lost);
    }
    return most * (1 + 0x1p-50);
}

/* --- the heap --- */

static bool is_deeper(const ebpo_depth_part *a, const ebpo_depth_part *b)
{
    return a->most > b->most;
}

EBPO_HEAP(heap, ebpo_depth_part, is_deeper)

static bool push(ebpo_depth_search *s, const ebpo_depth_part *part)
{
    if (!ebpo_grow(&s->part, &s->capacity, s->count + 1, sizeof *s->part))
        return false;
    heap_add(s->part, s->count++, part);
    return true;
}

/* --- parts --- */

bool ebpo_depth_is_late(const ebpo_depth_search *s)
{
    return s->late != UINT64_MAX && ebpo_clock() >= s->late;
}

/* What rounding alone leaves in doubt is no reason to divide: parts of faces that lie on others
 * have no end. */
static bool is_enough(ebpo_depth_search *s, double most, double rounding)
{
    if (most > s->lo + s->tolerance + 4 * (rounding + s->lost))
        return false;
    s->left = fmax(s->left, most);
    return true;
}

static double most_within(double hi, double radius)
{
    return (hi + radius) * (hi + radius > 0 ? 1 + 0x1p-50 : 1);
}

ebpo_status ebpo_depth_ask_ball(ebpo_depth_search *s, const double middle[3], ebpo_depth_ball *ball,
                                ebpo_error *error)
{
    double lo, hi, rounding;
    ball->open = false;
    if (!ebpo_posed_solid_near(s->solid, middle, ball->radius))
        return EBPO_OK;
    ebpo_status status = depth_at(s, middle, &lo, &hi, &rounding, error);
    if (status != EBPO_OK)
        return status;
    s->lo = fmax(s->lo, (lo - ball->far) * (1 - 0x1p-50) - s->lost);
    ball->most = most_within(hi, ball->radius);
    ball->open = !is_enough(s, ball->most, rounding);
    return EBPO_OK;
}

/* The part is within `radius` of the centre, a point of it. */
static ebpo_status offer(ebpo_depth_search *s, ebpo_depth_part *part, const double centre[3],
                         double radius, ebpo_error *error)
{
    double lo, hi, rounding;
    if (!ebpo_posed_solid_near(s->solid, centre, radius))
        return EBPO_OK;
    ebpo_status status = depth_at(s, centre, &lo, &hi, &rounding, error);
    if (status != EBPO_OK)
        return status;
    s->lo = fmax(s->lo, lo - s->lost);
    part->most = most_within(hi, radius);
    if (part->most > s->lo && s->context->warm)
        part->most = fmin(part->most, most_at_corners(s, (const double(*)[3])part->corner));
    if (is_enough(s, part->most, rounding))
        return EBPO_OK;
    if (!(radius > 4 * s->lost)) {
        s->left = fmax(s->left, part->most);
        return EBPO_OK;
    }
    return push(s, part) ? EBPO_OK : ebpo_fail_memory(error, s->capacity * sizeof *s->part);
}

static ebpo_status offer_triangle(ebpo_depth_search *s, const double a[3], const double b[3],
                                  const double c[3], ebpo_error *error)
{
    ebpo_depth_part part;
    double centre[3], radius = 0;
    const double *corner[3] = { a, b, c };
    for (int k = 0; k < 3; k++)
        centre[k] = a[k] + ((b[k] - a[k]) + (c[k] - a[k])) / 3;
    for (int i = 0; i < 3; i++) {
        memcpy(part.corner[i], corner[i], sizeof part.corner[i]);
        radius = fmax(radius, ebpo_length_between(corner[i], centre));
    }
    return offer(s, &part, centre, radius * (1 + 0x1p-50) + s->lost, error);
}

ebpo_status ebpo_depth_offer_face(ebpo_depth_search *s, const double corner[3][3],
                                  ebpo_error *error)
{
    return offer_triangle(s, corner[0], corner[1], corner[2], error);
}

/* The middle of corner k and the next one. */
static void middle_of(const ebpo_depth_part *p, int k, double out[3])
{
    for (int i = 0; i < 3; i++)
        out[i] = p->corner[k][i] + (p->corner[(k + 1) % 3][i] - p->corner[k][i]) / 2;
}

/* Into two, by the middle of edge k. */
static ebpo_status halve_triangle(ebpo_depth_search *s, const ebpo_depth_part *p, int k,
                                  ebpo_error *error)
{
    double middle[3];
    const double *opposite = p->corner[(k + 2) % 3];
    middle_of(p, k, middle);
    ebpo_status status = offer_triangle(s, p->corner[k], middle, opposite, error);
    return status == EBPO_OK ? offer_triangle(s, middle, p->corner[(k + 1) % 3], opposite, error)
                             : status;
}

/* Into four, by the middles of the edges; but a long one into two, as quarters of it would lie
 * beside each other, ever more of them as near to what is near to one. */
static ebpo_status divide_triangle(ebpo_depth_search *s, const ebpo_depth_part *p,
                                   ebpo_error *error)
{
    double middle[3][3], length[3];
    int longest = 0, shortest = 0;
    for (int k = 0; k < 3; k++) {
        length[k] = ebpo_length_between(p->corner[k], p->corner[(k + 1) % 3]);
        longest = length[k] > length[longest] ? k : longest;
        shortest = length[k] < length[shortest] ? k : shortest;
    }
    if (length[longest] > 2 * length[shortest])
        return halve_triangle(s, p, longest, error);
    for (int k = 0; k < 3; k++)
        middle_of(p, k, middle[k]);
    ebpo_status status = offer_triangle(s, middle[0], middle[1], middle[2], error);
    for (int k = 0; k < 3 && status == EBPO_OK; k++)
        status = offer_triangle(s, p->corner[k], middle[k], middle[(k + 2) % 3], error);
    return status;
}

bool ebpo_depth_is_done(const ebpo_depth_search *s)
{
    return s->count == 0 || !(s->part[0].most > s->lo + s->tolerance);
}

ebpo_status ebpo_depth_divide_next(ebpo_depth_search *s, ebpo_error *error)
{
    ebpo_depth_part part = heap_take(s->part, s->count--);
    return divide_triangle(s, &part, error);
}
