/* Filters of the kernels for eight faces. Compiled twice: for any processor, and for processors
 * with AVX2. */
#include "core/strict_fp.h"

#include "filter_faces.h"

/* The tables of the kernels, under the name of this set (EBPO_KERNEL_SUFFIX). */
extern const ebpo_inside_kernels EBPO_KERNEL(ebpo_inside_kernels);
extern const ebpo_nearest_kernels EBPO_KERNEL(ebpo_nearest_kernels);

#include "query/inside_kernels.c"
#include "query/nearest_kernels.c"

static void near_faces_of(const ebpo_accel *s, uint32_t block, const ebpo_probe *probe,
                          float low[EBPO_BLOCK], float high[EBPO_BLOCK])
{
    ebpo_face_block b = ebpo_face_block_open(s, block);
    ebpo_near_search g;
    g.probe = *probe;
    near_faces f = near_load(&g, &b, s->wide);
    f8 l, h;
    near_bounds(&f, &l, &h);
    f8_store(low, l);
    f8_store(high, h);
}

static void turns_of(const ebpo_accel *s, uint32_t block, const ebpo_axis_segment *segment,
                     unsigned *left, unsigned *right, unsigned *open)
{
    ebpo_face_block b = ebpo_face_block_open(s, block);
    int u = segment->axis == 2 ? 0 : segment->axis + 1,
        v = segment->axis == 0 ? 2 : segment->axis - 1;
    turns t = turns_of_floats(&b, ebpo_face_block_lanes(&b), u, v, segment, s->turn_error_constant);
    *left = t.left;
    *right = t.right;
    *open = t.open;
}

/* Becomes face_filters_base or face_filters_avx2. */
const face_filters EBPO_KERNEL(face) = { near_faces_of, turns_of };
