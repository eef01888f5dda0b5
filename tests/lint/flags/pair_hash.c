/* Built once for each set of compiler flags, with the sources of lib/extras/collide and
 * lib/geometry built the same way: prints one hash of posed coordinates, kinds, masks, contacts and
 * distances. */
#include "core/strict_fp.h"

#include <inttypes.h>
#include <stdio.h>

#include "exact_reference.h"
#include "extras/collide/face_pairs.h"
#include "geometry/pose.h"
#include "geometry/triangle_pair.h"
#include "pair_reference.h"

enum { ROUNDS = 1000 };

#define CORNERS(face) ((const double(*)[3])(face))

static uint64_t mix(uint64_t hash, uint64_t value) { return (hash ^ value) * 0x100000001b3; }

static uint64_t mix_doubles(uint64_t hash, const double *x, int n)
{
    for (int i = 0; i < n; i++) {
        union {
            double number;
            uint64_t bits;
        } u = { x[i] };
        hash = mix(hash, u.bits);
    }
    return hash;
}

static void pose_corners(double t[3][3])
{
    static const ebpo_pose pose = { { { 0.36, 0.48, -0.8 }, { -0.8, 0.6, 0 }, { 0.48, 0.64, 0.6 } },
                                    { 0.1, -0.2, 0.3 },
                                    1.7 };
    static const double reach[3] = { 1e8, 1e8, 1e8 };
    ebpo_posing posing;
    if (ebpo_posing_make(&posing, &pose, reach, NULL) != EBPO_OK)
        return;
    for (int i = 0; i < 3; i++) {
        double out[3];
        ebpo_posing_apply(&posing, t[i], out);
        for (int k = 0; k < 3; k++)
            t[i][k] = out[k];
    }
}

static uint64_t hash_filter(uint64_t hash, double a[3][3], double b[3][3])
{
    static float one[72], other[72];
    static int lane;
    for (int i = 0; i < 9; i++) {
        one[8 * i + lane] = (float)(a[i / 3][i % 3] - a[0][i % 3]);
        other[8 * i + lane] = (float)(b[i / 3][i % 3] - a[0][i % 3]);
    }
    lane = (lane + 1) & 7;
    ebpo_pair_masks m = ebpo_pair_kernels_base.eight(one, other, 0x1p-22f);
    return mix(hash, (uint64_t)(m.apart | m.crossing << 8));
}

static uint64_t hash_pair(uint64_t hash, double a[3][3], double b[3][3])
{
    ebpo_pair_kind kind = ebpo_triangle_pair(CORNERS(a), CORNERS(b));
    ebpo_pair_distance_bounds d;
    ebpo_triangles_distance_bounds(CORNERS(a), CORNERS(b), &d);
    hash = mix_doubles(mix_doubles(hash, &d.lo, 1), &d.hi, 1);
    hash = mix(mix_doubles(hash, &d.point[0][0], 6), (uint64_t)kind);
    if (kind != EBPO_PAIR_CROSSING)
        return hash;
    ebpo_contact_end end[2];
    ebpo_triangle_contact(CORNERS(a), CORNERS(b), end);
    for (int i = 0; i < 2; i++)
        hash = mix(mix_doubles(hash, end[i].point, 3), (uint64_t)(end[i].on_a + 8 * end[i].on_b));
    return hash;
}

int main(void)
{
    uint64_t hash = 0xcbf29ce484222325, state = 1;
    for (int i = 0; i < ROUNDS; i++)
        for (int kind = 0; kind < REFERENCE_PAIR_KINDS; kind++) {
            double a[3][3], b[3][3];
            reference_pair_case(a, b, kind, &state);
            hash = hash_pair(hash, a, b);
            if (kind == 12 || kind == 13)
                continue;
            hash = hash_filter(hash, a, b);
            pose_corners(a);
            pose_corners(b);
            hash = mix_doubles(hash_pair(hash, a, b), &a[0][0], 9);
        }
    printf("%016" PRIx64 "\n", hash);
    return 0;
}
