/* Measures blocks of floats for block_bounds.c, eight vertices at a time: the box of a block, and
 * how far its vertices extend along an axis and away from the axis.
 *
 * This file is compiled for several instruction sets (core/cpu.h), with the same operations in the
 * same order. Error bounds: docs/develop/bounds.md, "How bounding cylinders are measured". */
#include "core/strict_fp.h"

#include <math.h>

#include "query/accel_parts.h"
#include "query/face_block.h"

static const float lane_number[8] = { 0, 1, 2, 3, 4, 5, 6, 7 };

EBPO_EIGHT float max_of(f8 x) { return -f8_least(f8_sub(f8_all(0), x)); }

/* Loads one coordinate of the vertices first .. first + 7. Lanes beyond the last vertex get vertex
 * 0. x: [count] this coordinate of all vertices. */
EBPO_EIGHT f8 load_vertices(const float *x, unsigned first, unsigned count)
{
    f8 used = f8_less(f8_load(lane_number), f8_all((float)count - (float)first));
    return f8_pick(used, f8_load(x + first), f8_all(x[0]));
}

/* Sums the normals of the block's faces, each as long as twice the face's area. */
static void measure_normals(const ebpo_face_block *b, float normal[3])
{
    f8 x[3][3], used = f8_less(f8_load(lane_number), f8_all((float)b->m->faces));
    for (int k = 0; k < 3; k++) {
        ebpo_face_block_floats(b, k, x[k]);
        x[k][1] = f8_sub(x[k][1], x[k][0]);
        x[k][2] = f8_sub(x[k][2], x[k][0]);
    }
    for (int k = 0; k < 3; k++) {
        int u = k == 2 ? 0 : k + 1, v = k == 0 ? 2 : k - 1;
        float part[8];
        f8_store(part, f8_and(f8_sub(f8_mul(x[u][1], x[v][2]), f8_mul(x[v][1], x[u][2])), used));
        normal[k] = ((part[0] + part[4]) + (part[1] + part[5])) +
                    ((part[2] + part[6]) + (part[3] + part[7]));
    }
}

static void measure_extent(const ebpo_accel *s, uint32_t block, ebpo_block_extent *out)
{
    ebpo_face_block b = ebpo_face_block_open(s, block);
    unsigned count = b.m->vertices;
    const float *x = ebpo_meshlet_floats(b.m);
    for (int k = 0; k < 3; k++, x += count) {
        f8 low = f8_all(x[0]), high = low;
        for (unsigned i = 0; i < count; i += 8) {
            f8 vertices = load_vertices(x, i, count);
            low = f8_min(vertices, low);
            high = f8_max(vertices, high);
        }
        out->low[k] = f8_least(low);
        out->high[k] = max_of(high);
    }
    measure_normals(&b, out->normal);
}

/* ebpo_cylinder_extent of the vertices so far, in eight lanes. */
typedef struct cylinder_lanes {
    f8 from, to, aside2;
} cylinder_lanes;

/* Extends the cylinders by eight vertices. */
EBPO_EIGHT void measure_eight(const ebpo_cylinder_view *view, const f8 x[3], cylinder_lanes *lanes)
{
    f8 d[3], along, aside2;
    for (int k = 0; k < 3; k++)
        d[k] =
            f8_mul(f8_sub(f8_sub(x[k], f8_all(view->origin_high[k])), f8_all(view->origin_low[k])),
                   f8_all(view->scale));
    along = f8_add(f8_add(f8_mul(d[0], f8_all(view->axis[0])), f8_mul(d[1], f8_all(view->axis[1]))),
                   f8_mul(d[2], f8_all(view->axis[2])));
    aside2 = f8_mul(f8_mul(along, along), f8_all(view->length2_defect));
    for (int k = 0; k < 3; k++) {
        f8 aside = f8_sub(d[k], f8_mul(along, f8_all(view->axis[k])));
        aside2 = f8_add(aside2, f8_mul(aside, aside));
    }
    lanes->from = f8_min(along, lanes->from);
    lanes->to = f8_max(along, lanes->to);
    lanes->aside2 = f8_max(aside2, lanes->aside2);
}

static void measure_cylinder(const ebpo_accel *s, const uint32_t *block, uint32_t count,
                             const ebpo_cylinder_view *view, ebpo_cylinder_extent *out)
{
    cylinder_lanes lanes = { f8_all(INFINITY), f8_all(-INFINITY), f8_all(0) };
    for (uint32_t i = 0; i < count; i++) {
        const ebpo_meshlet *m = ebpo_accel_meshlet(s, block[i]);
        const float *v = ebpo_meshlet_floats(m);
        /* The blocks of a node are not in the order of memory. */
        const char *later =
            (const char *)ebpo_accel_meshlet(s, block[i + 4 < count ? i + 4 : count - 1]);
        for (int line = 0; line < 4; line++)
            __builtin_prefetch(later + EBPO_MESHLET_UNIT * line);
        for (unsigned at = 0; at < m->vertices; at += 8) {
            f8 x[3];
            for (unsigned k = 0; k < 3; k++)
                x[k] = load_vertices(v + k * m->vertices, at, m->vertices);
            measure_eight(view, x, &lanes);
        }
    }
    out->from = f8_least(lanes.from);
    out->to = max_of(lanes.to);
    out->aside2 = max_of(lanes.aside2);
}

const ebpo_block_measures EBPO_KERNEL(ebpo_block_measures) = { measure_extent, measure_cylinder };
