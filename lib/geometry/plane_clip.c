#include "core/strict_fp.h"

#include "geometry/plane_clip.h"

void ebpo_planes_cut(ebpo_polytope *envelope, const uint32_t *codes, uint64_t count)
{
    for (uint64_t i = 0; i < count; i++) {
        int32_t v[3], d;
        double n[3];
        if (!ebpo_plane_code_decode(codes[i], v, &d))
            continue;
        double offset = ebpo_plane_as_double(v, d, n);
        (void)ebpo_polytope_clip(envelope, n, offset, (int32_t)i);
    }
}
