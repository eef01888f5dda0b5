#include "geom/strict_fp.h"

#include "deviation/cut.h"

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

static void make_box(const ebpo_extent *e, ebpo_polytope *out)
{
    ebpo_polytope_cube(out);
    for (int i = 0; i < 8; i++)
        for (int k = 0; k < 3; k++)
            out->vertex[i][k] = i >> k & 1 ? e->max[k] : e->min[k];
}

bool ebpo_cut_axis(const ebpo_polytope *p, int axis, int side, double at, ebpo_polytope *out)
{
    double n[3] = { 0, 0, 0 };
    ebpo_extent e;
    ebpo_extent_of(p, &e);
    if (side ? e.max[axis] < at - EBPO_CUT_SLACK : e.min[axis] > at + EBPO_CUT_SLACK)
        return false;
    n[axis] = side ? -1 : 1;
    ebpo_polytope_copy(out, p);
    if (ebpo_polytope_clip(out, n, (side ? -at : at) + EBPO_CUT_SLACK, CUT_TAG) != EBPO_CLIP_REFUSED)
        return true;
    if (side)
        e.min[axis] = fmax(e.min[axis], at - EBPO_CUT_SLACK);
    else
        e.max[axis] = fmin(e.max[axis], at + EBPO_CUT_SLACK);
    make_box(&e, out);
    return true;
}

bool ebpo_cut_plane(const ebpo_polytope *p, const double n[3], double d, ebpo_polytope *out)
{
    ebpo_polytope_copy(out, p);
    return ebpo_polytope_clip(out, n, d + EBPO_CUT_SLACK, CUT_TAG) != EBPO_CLIP_REFUSED;
}
