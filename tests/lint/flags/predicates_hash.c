/* Built once for each set of compiler flags, with the predicates' sources built the same way:
 * prints one hash of many results, of all stages. */
#include "core/strict_fp.h"

#include <inttypes.h>
#include <math.h>
#include <stdio.h>

#include "exact_reference.h"
#include "geometry/cells.h"
#include "geometry/predicates.h"
#include "geometry/distance.h"
#include "geometry/ray.h"

enum { ROUNDS = 3000 };

static uint64_t mix(uint64_t hash, int value)
{
    return (hash ^ (uint64_t)(value + 8)) * 0x100000001b3;
}

static uint64_t mix_double(uint64_t hash, double x)
{
    union {
        double number;
        uint64_t bits;
    } u = { x };
    return (hash ^ u.bits) * 0x100000001b3;
}

static uint64_t hash_points(uint64_t hash, const double *p)
{
    hash = mix(hash, ebpo_orient3d(p, p + 3, p + 6, p + 9));
    hash = mix(hash, ebpo_orient3d_expansion(p, p + 3, p + 6, p + 9));
    hash = mix(hash, ebpo_orient2d(p, p + 2, p + 4));
    hash = mix(hash, ebpo_orient2d_expansion(p, p + 2, p + 4));
    hash = mix(hash, ebpo_sign_of_products(p, 6));
    hash = mix(hash, ebpo_sign_of_products_expansion(p, 6));
    for (int axis = 0; axis < 3; axis++)
        hash = mix(hash, ebpo_axis_crossing(p + 9, p[9 + axis] + 1, axis, p, p + 3, p + 6));
    return mix(hash, ebpo_point_on_triangle(p + 9, p, p + 3, p + 6));
}

static uint64_t hash_box(uint64_t hash, const double min[3], double extent)
{
    const double max[3] = { min[0] + extent, min[1] + extent, min[2] + extent };
    ebpo_box box;
    if (!ebpo_box_make(&box, min, max, 17))
        return mix(hash, 0);
    for (int k = 0; k < 3; k++)
        hash = mix_double(mix_double(hash, box.origin[k]), box.size[k]);
    return hash;
}

/* The ray from the first point to one near the last, and to the middle of the others. */
static uint64_t hash_rays(uint64_t hash, const double *p)
{
    const double triangle[3][3] = { { p[0], p[1], p[2] },
                                    { p[3], p[4], p[5] },
                                    { p[6], p[7], p[8] } };
    const double other[3][3] = { { p[0], p[1], p[2] }, { p[6], p[7], p[8] }, { p[3], p[5], p[4] } };
    ebpo_segment ray = { .t_max = 1.5 };
    for (int aim = 0; aim < 2; aim++) {
        ebpo_ray_intersection m, n;
        for (int k = 0; k < 3; k++) {
            double to = aim == 0 ? p[k] : .25 * p[k] + .25 * p[3 + k] + .5 * p[6 + k];
            ray.origin[k] = p[9 + k];
            ray.direction[k] =
                to - p[9 + k] < INFINITY && to - p[9 + k] > -INFINITY ? to - p[9 + k] : 1;
        }
        if (ray.direction[0] == 0 && ray.direction[1] == 0)
            ray.direction[0] = 1;
        ebpo_ray_triangle(&ray, triangle, &m);
        ebpo_ray_triangle(&ray, other, &n);
        hash = mix_double(mix(hash, m.intersects ? m.side : 7), m.t);
        if (m.intersects && n.intersects)
            hash = mix(hash, ebpo_ray_compare(&ray, triangle, &m, other, &n));
    }
    const double low[3] = { p[9], fmin(p[10], p[1]), p[11] },
                 high[3] = { p[9], fmax(p[10], p[1]), p[11] };
    return mix(hash, ebpo_triangle_intersects_box(triangle, low, high));
}

static uint64_t hash_distances(uint64_t hash, const double *p)
{
    const double triangle[3][3] = { { p[0], p[1], p[2] },
                                    { p[3], p[4], p[5] },
                                    { p[6], p[7], p[8] } };
    const double other[3][3] = { { p[0], p[1], p[2] }, { p[6], p[7], p[8] }, { p[3], p[5], p[4] } };
    ebpo_distance_bounds b;
    ebpo_triangle_nearest n;
    double normal[3];
    ebpo_triangle_distance_bounds(p + 9, triangle, &b);
    ebpo_triangle_nearest_exact(p + 9, triangle, NULL, normal, &n);
    hash = mix_double(mix_double(mix_double(mix(hash, (int)n.feature), b.lo), b.hi), n.distance);
    for (int k = 0; k < 3; k++)
        hash = mix_double(mix_double(hash, n.point[k]), normal[k]);
    return mix(hash, ebpo_triangle_distance_compare(p + 9, triangle, other));
}

int main(void)
{
    uint64_t hash = 0xcbf29ce484222325, state = 1;
    for (int i = 0; i < ROUNDS; i++)
        for (int kind = 0; kind < REFERENCE_KINDS; kind++) {
            double p[12];
            reference_points(p, 3, kind, &state);
            for (int k = 0; k < 12; k++)
                hash = mix_double(hash, p[k]);
            hash = hash_points(hash, p);
            hash = hash_rays(hash, p);
            hash = hash_distances(hash, p);
            hash = hash_box(hash, p, p[3] < 0 ? -p[3] : p[3]);
        }
    printf("%016" PRIx64 "\n", hash);
    return 0;
}
