#include "geom/strict_fp.h"

#include "query/modes.h"

#include <math.h>

#include "geom/polytope.h"
#include "lod/lod_model.h"
#include "query/inside.h"
#include "query/limited.h"
#include "query/locate.h"
#include "query/nearest.h"
#include "query/pruned.h"
#include "query/query_node.h"

static const ebpo_distance_result nothing = { INFINITY,          0,           INFINITY,
                                              { NAN, NAN, NAN }, { 0, 0, 0 }, EBPO_NO_FACE };

static ebpo_status all_leaves(ebpo_context *c, ebpo_nearest *n, ebpo_spot spot, ebpo_error *error)
{
    ebpo_status status = EBPO_OK;
    if (ebpo_spot_is_uniform(&spot))
        return EBPO_OK;
    if (ebpo_spot_is_below(&spot)) {
        status = ebpo_spot_enter(c, &spot, error);
        if (status == EBPO_OK)
            ebpo_nearest_search(n, c, spot.subtree);
        return status;
    }
    if (ebpo_entry_kind_of(spot.entry) == EBPO_ENTRY_LEAF) {
        ebpo_nearest_leaf(n, spot.subtree, &spot.subtree->leaf[ebpo_entry_value(spot.entry)]);
        return EBPO_OK;
    }
    for (unsigned octant = 0; octant < 8 && status == EBPO_OK; octant++)
        status = all_leaves(c, n, ebpo_spot_child(c->model, &spot, octant), error);
    return status;
}

ebpo_status ebpo_distance_around(ebpo_context *c, const double p[3], const ebpo_query_options *o,
                                 ebpo_distance_result *out, ebpo_error *error)
{
    ebpo_box box = ebpo_model_box(c->model);
    uint32_t at[3];
    int fine = c->model->info->level_count - 1;
    *out = nothing;
    if (!ebpo_locate(&box, fine, p, at))
        return EBPO_OK;
    ebpo_spot spot = ebpo_spot_root(c->model), gray = spot;
    ebpo_status status = EBPO_OK;
    while (status == EBPO_OK && !ebpo_spot_is_uniform(&spot)) {
        if (ebpo_spot_is_below(&spot))
            status = ebpo_spot_enter(c, &spot, error);
        if (status != EBPO_OK || ebpo_entry_kind_of(spot.entry) == EBPO_ENTRY_LEAF)
            break;
        gray = spot;
        spot = ebpo_spot_child(c->model, &spot, ebpo_octant_at(at, fine - spot.level - 1));
    }
    ebpo_nearest n;
    ebpo_nearest_begin(&n, p, o->max_distance);
    if (status == EBPO_OK && !ebpo_spot_is_uniform(&spot))
        ebpo_nearest_leaf(&n, spot.subtree, &spot.subtree->leaf[ebpo_entry_value(spot.entry)]);
    else if (status == EBPO_OK && o->mode == EBPO_DISTANCE_RECURSIVE)
        status = all_leaves(c, &n, gray, error);
    if (status == EBPO_OK)
        ebpo_nearest_end(&n, o->max_distance, out);
    out->lo = 0; /* not the minimum: only an upper bound is certain */
    return status == EBPO_OK ? ebpo_give_sign(c, p, o, out, error) : status;
}

static void corner_of(const ebpo_box *box, const ebpo_spot *spot, const double xi[3], double out[3])
{
    for (int k = 0; k < 3; k++) {
        double low = ebpo_wall(box, k, spot->level, spot->at[k]);
        out[k] = low + xi[k] * (box->size[k] / (double)(1u << spot->level));
    }
}

static void nearest_polygon(const ebpo_polytope *e, const ebpo_box *box, const ebpo_spot *spot,
                            const double p[3], ebpo_distance_result *out)
{
    double best[3][3];
    for (int f = 0; f < e->face_count; f++)
        for (int i = e->first[f] + 1; i + 1 < e->first[f + 1]; i++) {
            double t[3][3];
            ebpo_distance_bounds b;
            corner_of(box, spot, e->vertex[e->corner[e->first[f]]], t[0]);
            corner_of(box, spot, e->vertex[e->corner[i]], t[1]);
            corner_of(box, spot, e->vertex[e->corner[i + 1]], t[2]);
            ebpo_triangle_distance_bounds(p, (const double(*)[3])t, &b);
            if (b.hi < out->distance) {
                out->distance = b.hi;
                for (int k = 0; k < 9; k++)
                    best[k / 3][k % 3] = t[k / 3][k % 3];
            }
        }
    if (isinf(out->distance))
        return;
    ebpo_triangle_nearest exact;
    ebpo_triangle_nearest_exact(p, (const double(*)[3])best, NULL, &exact);
    ebpo_triangle_unit_normal((const double(*)[3])best, out->normal);
    out->distance = exact.distance;
    for (int k = 0; k < 3; k++)
        out->point[k] = exact.point[k];
}

ebpo_status ebpo_distance_to_envelope(ebpo_context *c, const double p[3],
                                      const ebpo_query_options *o, ebpo_distance_result *out,
                                      ebpo_error *error)
{
    ebpo_box box = ebpo_model_box(c->model);
    uint32_t at[3];
    int fine = c->model->info->level_count - 1;
    *out = nothing;
    if (!ebpo_locate(&box, fine, p, at))
        return EBPO_OK;
    ebpo_spot spot = ebpo_spot_root(c->model), gray = spot;
    ebpo_polytope envelope[2];
    int now = 0;
    ebpo_polytope_cube(&envelope[0]);
    for (;;) {
        uint32_t count;
        const uint32_t *codes = ebpo_spot_planes(c->model, &spot, &count);
        ebpo_planes_cut(&envelope[now], codes, count);
        gray = spot;
        if ((o->level >= 0 && spot.level >= o->level) || !ebpo_spot_is_gray(c->model, &spot))
            break;
        if (ebpo_spot_is_below(&spot)) {
            ebpo_status status = ebpo_spot_enter(c, &spot, error);
            if (status != EBPO_OK)
                return status;
        }
        unsigned octant = ebpo_octant_at(at, fine - spot.level - 1);
        ebpo_spot child = ebpo_spot_child(c->model, &spot, octant);
        if (!ebpo_spot_is_gray(c->model, &child))
            break;
        if (c->model->info->boxed &&
            ebpo_spot_is_pruned(c->model, &child)) /* leaves outside a subset's box look the same */
            return ebpo_fail_pruned(c->model, child.level, child.at, error);
        if (!ebpo_polytope_child(&envelope[now], octant, &envelope[1 - now]))
            break;
        now = 1 - now;
        spot = child;
    }
    nearest_polygon(&envelope[now], &box, &gray, p, out);
    out->lo = 0;
    out->hi = INFINITY;
    return EBPO_OK;
}
