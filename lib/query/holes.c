/* Point in a mesh with holes.
 *
 * The integer winding number of the mesh and its caps (cap_tree.h) is counted along a segment
 * parallel to an axis, from the point to the nearest side of the model's box, outside of which it
 * is 0: crossings of faces, found in the hierarchy of blocks, and of caps, found in their tree.
 * Crossings are exact (ebpo_axis_crossing). The faces that contain the point are found on the way.
 * The solid angles of the border's discs complete the winding number (cap_winding.c). */
#include "core/strict_fp.h"

#include <math.h>
#include <stdlib.h>

#include "core/alloc.h"
#include "core/error.h"
#include "core/fp_env.h"
#include "core/simd.h"
#include "geometry/cap_triangles.h"
#include "geometry/predicates.h"
#include "mesh/border.h"
#include "mesh/mesh_parts.h"
#include "query/holes.h"

/* --- construction --- */

ebpo_status ebpo_holes_make(ebpo_holes **out, const ebpo_mesh *mesh, const ebpo_info *info,
                            double threshold, unsigned threads, ebpo_error *error)
{
    ebpo_border border;
    ebpo_status status = ebpo_border_find(&border, mesh, threads, error);
    if (status != EBPO_OK)
        return status;
    uint64_t count = border.loop_count ? border.first[border.loop_count] : 0;
    ebpo_holes *h = ebpo_alloc_zero(1, sizeof *h);
    double(*position)[3] = ebpo_alloc(count ? count : 1, sizeof *position);
    if (!h || !position) {
        free(position);
        status = ebpo_fail_memory(error, count * sizeof *position);
    } else {
        for (uint64_t i = 0; i < count; i++)
            ebpo_mesh_position(mesh, border.vertex[i], position[i]);
        status = ebpo_cap_tree_make(&h->caps, position, border.first, border.weight,
                                    border.loop_count, error);
    }
    ebpo_border_free(&border);
    if (status != EBPO_OK) {
        free(h);
        return status;
    }
    h->rule = (ebpo_cap_rule){ (uint8_t)info->rule, threshold };
    for (int k = 0; k < 3; k++) {
        h->low[k] = info->box_origin[k];
        h->high[k] = info->box_origin[k] + info->box_size[k];
    }
    *out = h;
    return EBPO_OK;
}

void ebpo_holes_attach(ebpo_holes *h, const ebpo_accel *whole, const ebpo_locator *locator)
{
    h->whole = whole;
    h->locator = *locator;
    uint64_t grid = whole->nodes.grid ? UINT64_C(1) << 3 * whole->nodes.grid_bits : 1;
    h->cell_count = grid + 8 * (uint64_t)whole->nodes.group_count;
    h->leaf_count = whole->leaf_count;
    h->cell = ebpo_alloc_zero(h->cell_count, sizeof *h->cell);
    h->leaf = ebpo_alloc_zero(h->leaf_count + 1, sizeof *h->leaf);
    h->leaf_winding = ebpo_alloc_zero(h->leaf_count + 1, sizeof *h->leaf_winding);
    if (h->cell && h->leaf && h->leaf_winding)
        return;
    free(h->cell);
    free(h->leaf);
    free(h->leaf_winding);
    h->cell = h->leaf = NULL;
    h->leaf_winding = NULL;
    h->cell_count = h->leaf_count = 0;
}

void ebpo_holes_free(ebpo_holes *holes)
{
    if (!holes)
        return;
    ebpo_cap_tree_free(&holes->caps);
    free(holes->cell);
    free(holes->leaf);
    free(holes->leaf_winding);
    free(holes);
}

uint64_t ebpo_holes_bytes(const ebpo_holes *holes)
{
    return holes ? sizeof *holes + holes->caps.position_count * sizeof *holes->caps.position +
                       holes->caps.node_count * sizeof *holes->caps.node + holes->cell_count +
                       5 * holes->leaf_count
                 : 0;
}

/* --- crossings --- */

typedef struct segment {
    const double *p;
    double from[3], to;
    int axis;
    double low[3], high[3];          /* its box */
    float near_low[3], near_high[3]; /* the same in the frame of the blocks */
    int32_t sum;                     /* crossings from its beginning to its end */
    bool on_face;
    bool goes_on; /* also when p is on a face */
} segment;

/* Sets the segment from p to the nearest side of the box, or from there to p. Returns the sign with
 * which its crossings count for p. */
static int choose_segment(segment *g, const ebpo_holes *h, const double p[3])
{
    double best = INFINITY;
    int side = 1;
    for (int k = 0; k < 3; k++) {
        double below = p[k] - h->low[k], above = h->high[k] - p[k];
        if (fmin(below, above) < best) {
            best = fmin(below, above);
            g->axis = k;
            side = below <= above ? 1 : -1;
        }
        g->from[k] = g->low[k] = g->high[k] = p[k];
    }
    g->p = p;
    g->to = p[g->axis];
    if (side > 0) /* begins outside, also when it is shifted */
        g->from[g->axis] = g->low[g->axis] = nextafter(h->low[g->axis], -INFINITY);
    else
        g->to = g->high[g->axis] = h->high[g->axis];
    return side;
}

static void cross_block(segment *g, const ebpo_accel *s, uint32_t block)
{
    for (uint32_t lane = 0; lane < EBPO_BLOCK && (!g->on_face || g->goes_on); lane++) {
        uint32_t slot = block * EBPO_BLOCK + lane;
        double t[3][3];
        if (ebpo_accel_slot_face(s, slot) == EBPO_NO_SLOT)
            return;
        ebpo_accel_triangle(s, slot, t);
        g->on_face = g->on_face || ebpo_point_on_triangle(g->p, t[0], t[1], t[2]);
        g->sum += ebpo_axis_crossing(g->from, g->to, g->axis, t[0], t[1], t[2]);
    }
}

/* Counts crossings of the faces below a child of a node of the hierarchy; the boxes were enlarged
 * by more than the rounding error of floats (faces_in_box.c). */
static void cross_child(segment *g, const ebpo_accel *s, uint32_t child)
{
    if (child & EBPO_IS_BLOCK) {
        cross_block(g, s, child & ~EBPO_IS_BLOCK);
        return;
    }
    const ebpo_bound *b = &s->bound[child];
    f8 apart = f8_all(0);
    for (int k = 0; k < 3; k++) {
        f8 step = f8_all(b->step[k]), origin = f8_all(b->origin[k]);
        f8 from = f8_add(origin, f8_mul(f8_from_bytes(b->low[k]), step)),
           to = f8_add(origin, f8_mul(f8_from_bytes(b->high[k]), step));
        apart = f8_or(apart, f8_or(f8_less(f8_all(g->near_high[k]), from),
                                   f8_less(to, f8_all(g->near_low[k]))));
    }
    for (unsigned lanes = ~f8_bits(apart) & ((1u << b->count) - 1);
         lanes && (!g->on_face || g->goes_on); lanes &= lanes - 1)
        cross_child(g, s, b->child[__builtin_ctz(lanes)]);
}

/* Returns true if the ball around a node's caps is certainly apart from the segment. */
static bool ball_is_apart(const segment *g, const ebpo_cap_node *n)
{
    for (int k = 0; k < 3; k++)
        if ((g->low[k] - n->centre[k]) * (1 - 0x1p-50) > n->radius ||
            (n->centre[k] - g->high[k]) * (1 - 0x1p-50) > n->radius)
            return true;
    return false;
}

/* Subtracts the crossings of the discs below a node: caps turn against them. */
static void cross_caps(segment *g, const ebpo_cap_tree *t, uint64_t at)
{
    const ebpo_cap_node *n = &t->node[at];
    if (ball_is_apart(g, n))
        return;
    if (n->weight == 0) {
        cross_caps(g, t, n->from);
        cross_caps(g, t, n->to);
        return;
    }
    uint64_t m = ebpo_cap_middle(n->from, n->to), first = ebpo_cap_count(n->from, m);
    g->sum -= (int32_t)n->weight * ebpo_axis_crossing(g->from, g->to, g->axis, t->position[n->from],
                                                      t->position[m], t->position[n->to]);
    if (first)
        cross_caps(g, t, at + 1);
    if (ebpo_cap_count(m, n->to))
        cross_caps(g, t, at + 1 + first);
}

bool ebpo_holes_crossings(const ebpo_holes *h, const double p[3], bool on_faces_too,
                          int32_t *winding)
{
    const ebpo_accel *s = h->whole;
    segment g = { .goes_on = on_faces_too };
    *winding = 0;
    for (int k = 0; k < 3; k++)
        if (!(p[k] >= h->low[k] && p[k] <= h->high[k]))
            return true;
    int side = choose_segment(&g, h, p);
    for (int k = 0; k < 3; k++) {
        g.near_low[k] = (float)((g.low[k] - s->centre[k]) * s->scale);
        g.near_high[k] = (float)((g.high[k] - s->centre[k]) * s->scale);
    }
    if (s->bound_count)
        cross_child(&g, s, s->root_bound);
    if (g.on_face && !on_faces_too)
        return false;
    if (h->caps.node_count)
        cross_caps(&g, &h->caps, 0);
    *winding = side * g.sum;
    return !g.on_face;
}

/* --- results --- */

ebpo_where ebpo_holes_where(ebpo_holes *h, const double p[3])
{
    int32_t winding;
    if (!ebpo_holes_crossings(h, p, false, &winding))
        return EBPO_ON;
    ebpo_cap_decision d = ebpo_cap_decide(&h->caps, p, winding, &h->rule);
    if (d.tie)
        h->ties++;
    return d.inside ? EBPO_IN : EBPO_OUT;
}

bool ebpo_holes_winding(const ebpo_holes *h, const double p[3], double width, ebpo_bounded *out)
{
    int32_t winding;
    if (!ebpo_holes_crossings(h, p, false, &winding))
        return false;
    *out = ebpo_cap_winding(&h->caps, p, winding, width);
    return true;
}
