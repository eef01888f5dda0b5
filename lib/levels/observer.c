#include "core/strict_fp.h"

#include "levels/observer.h"

#include <math.h>
#include <string.h>

#include "core/error.h"

/* of a sum of three products, generously: what is hardly seen counts as seen */
static const double SLACK = 1e-12;

static double dot(const double a[3], const double b[3])
{
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

static void cross(const double a[3], const double b[3], double out[3])
{
    for (int k = 0; k < 3; k++)
        out[k] = a[(k + 1) % 3] * b[(k + 2) % 3] - a[(k + 2) % 3] * b[(k + 1) % 3];
}

/* To length 1, whatever its length; false for (0, 0, 0). */
static bool normalise(const double v[3], double out[3])
{
    double largest = fmax(fabs(v[0]), fmax(fabs(v[1]), fabs(v[2])));
    if (!(largest > 0))
        return false;
    for (int k = 0; k < 3; k++)
        out[k] = v[k] / largest;
    double length = sqrt(dot(out, out));
    for (int k = 0; k < 3; k++)
        out[k] /= length;
    return true;
}

static bool all_finite(const double v[3])
{
    return isfinite(v[0]) && isfinite(v[1]) && isfinite(v[2]);
}

static ebpo_status check(const ebpo_observer *o, ebpo_error *error)
{
    if (!all_finite(o->eye) || !all_finite(o->direction) || !all_finite(o->up))
        return ebpo_fail(error, EBPO_E_ARGUMENT,
                         "the observer's eye, direction and up must be finite numbers");
    if (!(o->fov > 0 && o->fov < 180))
        return ebpo_fail(
            error, EBPO_E_ARGUMENT,
            "the observer's angle of view must be above 0 and below 180 degrees; it is %g", o->fov);
    if (o->width == 0 || o->height == 0)
        return ebpo_fail(error, EBPO_E_ARGUMENT, "the observer's picture has no pixels");
    return EBPO_OK;
}

/* Side walls: inward normals t * forward +- right, where t is the tangent of half the angle. */
static ebpo_status make_frustum(ebpo_viewpoint *s, const ebpo_observer *o, double tangent,
                                ebpo_error *error)
{
    double forward[3], side[2][3], up[3];
    s->everywhere = !normalise(o->direction, forward);
    if (s->everywhere)
        return EBPO_OK;
    if (!normalise(o->up, up))
        return ebpo_fail(error, EBPO_E_ARGUMENT, "the observer's upward direction is (0, 0, 0)");
    cross(forward, up, side[0]);
    if (dot(side[0], side[0]) < 1e-12 || !normalise(side[0], side[0]))
        return ebpo_fail(
            error, EBPO_E_ARGUMENT,
            "the observer's upward direction lies along the viewing direction; give another one");
    cross(side[0], forward, side[1]);
    double tangents[2] = { tangent * ((double)o->width / o->height), tangent };
    for (int i = 0; i < 2; i++)
        for (int k = 0; k < 3; k++) {
            s->inward[2 * i][k] = tangents[i] * forward[k] + side[i][k];
            s->inward[2 * i + 1][k] = tangents[i] * forward[k] - side[i][k];
        }
    memcpy(s->inward[4], forward, sizeof forward);
    return EBPO_OK;
}

ebpo_status ebpo_viewpoint_make(ebpo_viewpoint *out, const ebpo_box *box,
                                const ebpo_observer *observer, ebpo_error *error)
{
    memset(out, 0, sizeof *out);
    if (!observer)
        return EBPO_OK;
    ebpo_status status = check(observer, error);
    if (status != EBPO_OK)
        return status;
    int exponent;
    (void)frexp(fmax(box->size[0], fmax(box->size[1], box->size[2])), &exponent);
    out->given = true;
    out->unit = ldexp(1, exponent);
    double root2 = 0, tangent = tan(observer->fov * (3.14159265358979323846 / 360));
    for (int k = 0; k < 3; k++) {
        double side = box->size[k] / out->unit;
        root2 += side * side;
        out->eye[k] = observer->eye[k];
    }
    for (int i = 0; i < EBPO_LEVELS_MAX; i++)
        out->diagonal2[i] = root2 * ebpo_half_power(2 * i);
    out->focal = (double)observer->height / (2 * tangent);
    return make_frustum(out, observer, tangent, error);
}

ebpo_seen ebpo_viewpoint_see(const ebpo_viewpoint *s, const ebpo_box *box, ebpo_cell cell)
{
    ebpo_seen out = { 0, true };
    double low[3], high[3]; /* from the eye */
    if (!s->given)
        return out;
    for (int k = 0; k < 3; k++) {
        low[k] = (ebpo_wall(box, k, cell.level, cell.at[k]) - s->eye[k]) / s->unit;
        high[k] = (ebpo_wall(box, k, cell.level, cell.at[k] + 1) - s->eye[k]) / s->unit;
        double away = low[k] > 0 ? low[k] : high[k] < 0 ? -high[k] : 0;
        out.distance2 += away * away;
    }
    for (int i = 0; i < 5 && !s->everywhere && out.seen; i++) {
        double most = 0, reach = 0;
        for (int k = 0; k < 3; k++) {
            double a = s->inward[i][k] * low[k], b = s->inward[i][k] * high[k];
            most += a > b ? a : b;
            reach += fabs(a) + fabs(b);
        }
        out.seen = !(most < -SLACK * reach);
    }
    return out;
}

double ebpo_viewpoint_distance(const ebpo_viewpoint *s, double distance2)
{
    return s->given ? sqrt(distance2) * s->unit : NAN;
}

double ebpo_viewpoint_pixels(const ebpo_viewpoint *s, int level, double distance2)
{
    return s->given ? s->focal * sqrt(s->diagonal2[level] / distance2) : NAN;
}

unsigned ebpo_viewpoint_octant(const ebpo_viewpoint *s, const ebpo_box *box, ebpo_cell cell)
{
    unsigned octant = 0;
    for (int k = 0; k < 3 && s->given; k++)
        octant |= (unsigned)(s->eye[k] >= ebpo_wall(box, k, cell.level + 1, 2 * cell.at[k] + 1))
                  << k;
    return octant;
}

/* Octants from the root down, each as seen from the eye: reading them as one number gives the
 * enumeration's order. */
static uint64_t enumerate(const ebpo_viewpoint *s, const ebpo_box *box, ebpo_octcode octcode)
{
    int level = ebpo_octcode_level(octcode);
    ebpo_cell cell = ebpo_cell_of_octcode(octcode);
    uint64_t key = 0;
    for (int i = 0; i < level; i++) {
        int below = level - i;
        ebpo_cell above = { i, { cell.at[0] >> below, cell.at[1] >> below, cell.at[2] >> below } };
        unsigned octant = octcode >> 3 * (below - 1) & 7;
        key |= (uint64_t)(octant ^ ebpo_viewpoint_octant(s, box, above))
               << 3 * (EBPO_MAX_LEVEL - 1 - i);
    }
    return key;
}

/* Doubles that are not negative sort as their bits do. */
static uint64_t bits(double v)
{
    uint64_t out;
    memcpy(&out, &v, sizeof out);
    return out;
}

uint64_t ebpo_viewpoint_key(const ebpo_viewpoint *s, const ebpo_box *box, ebpo_priority priority,
                            ebpo_octcode octcode, double distance2)
{
    switch (priority) {
    case EBPO_PRIORITY_DISTANCE: return bits(distance2);
    case EBPO_PRIORITY_PIXELS: return ~bits(s->diagonal2[ebpo_octcode_level(octcode)] / distance2);
    case EBPO_PRIORITY_FRONT_TO_BACK: return enumerate(s, box, octcode);
    case EBPO_PRIORITY_LEVEL:
    default: return octcode;
    }
}
