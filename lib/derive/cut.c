#include "core/strict_fp.h"

#include "derive/cut.h"

#include <math.h>

enum { CUT_TAG = 1 << 20 };

void ebpo_extent_of(const ebpo_polytope *p, ebpo_extent *out)
{
    for (int k = 0; k < 3; k++) {
        out->min[k] = INFINITY;
        out->max[k] = -INFINITY;
        for (int i = 0; i < p->vertex_count; i++) {
            out->min[k] = fmin(out->min[k], p->vertex[i][k]);
            out->max[k] = fmax(out->max[k], p->vertex[i][k]);
        }
    }
}

bool ebpo_cut_axis(const ebpo_polytope *p, int axis, int side, double at, ebpo_polytope *out)
{
    double n[3] = { 0, 0, 0 };
    ebpo_extent e;
    ebpo_extent_of(p, &e);
    /* Clipping gives up where next to nothing would be left, and a box around a thin part reaches
     * far beyond it. So thin parts go with the thick ones. */
    bool high_is_thin = e.max[axis] - at <= EBPO_CUT_THIN,
         low_is_thin = !high_is_thin && at - e.min[axis] <= EBPO_CUT_THIN;
    if (side ? high_is_thin : low_is_thin)
        return false;
    ebpo_polytope_copy(out, p);
    n[axis] = side ? -1 : 1;
    if (!high_is_thin && !low_is_thin)
        /* where it gives up all the same, too much is kept */
        (void)ebpo_polytope_clip(out, n, (side ? -at : at) + EBPO_CUT_SLACK, CUT_TAG);
    return true;
}

bool ebpo_cut_plane(const ebpo_polytope *p, const double n[3], double d, ebpo_polytope *out)
{
    ebpo_polytope_copy(out, p);
    return ebpo_polytope_clip(out, n, d + EBPO_CUT_SLACK, CUT_TAG) != EBPO_CLIP_REFUSED;
}
