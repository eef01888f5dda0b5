#include "geom/strict_fp.h"

#include "query/query_node.h"

#include <math.h>

#include "geom/plane_code.h"
#include "query/pruned.h"

ebpo_spot ebpo_spot_root(const ebpo_model *model)
{
    const ebpo_nodes *nodes = model->whole ? &model->whole->nodes : &model->top->nodes;
    return (ebpo_spot){ model->whole, nodes->root, 0, { 0, 0, 0 } };
}

bool ebpo_spot_is_gray(const ebpo_model *model, const ebpo_spot *spot)
{
    if (ebpo_spot_is_below(spot) && spot->subtree)
        return true;
    if (ebpo_spot_is_below(spot))
        return model->top->below[ebpo_entry_value(spot->entry)].type == EBPO_GRAY;
    return ebpo_entry_kind_of(spot->entry) == EBPO_ENTRY_GRAY;
}

ebpo_status ebpo_spot_enter(ebpo_context *context, ebpo_spot *spot, ebpo_error *error)
{
    ebpo_subtree *subtree;
    if (ebpo_spot_is_pruned(context->model, spot))
        return ebpo_fail_pruned(context->model, spot->level, spot->at, error);
    ebpo_status status =
        ebpo_context_subtree(context, ebpo_entry_value(spot->entry), &subtree, error);
    if (status != EBPO_OK)
        return status;
    spot->subtree = subtree;
    spot->entry = subtree->nodes.root;
    if (ebpo_spot_is_below(spot)) /* a file whose counts do not tell of it */
        return ebpo_fail_pruned(context->model, spot->level, spot->at, error);
    return EBPO_OK;
}

ebpo_spot ebpo_spot_child(const ebpo_model *model, const ebpo_spot *gray, unsigned octant)
{
    const ebpo_nodes *nodes = gray->subtree ? &gray->subtree->nodes : &model->top->nodes;
    ebpo_spot child = { gray->subtree,
                        nodes->group[ebpo_entry_value(gray->entry)][octant],
                        gray->level + 1,
                        { 0, 0, 0 } };
    for (int k = 0; k < 3; k++)
        child.at[k] = 2 * gray->at[k] + (octant >> k & 1);
    return child;
}

const uint32_t *ebpo_spot_planes(const ebpo_model *model, const ebpo_spot *spot, uint32_t *count)
{
    uint32_t value = ebpo_entry_value(spot->entry);
    *count = 0;
    if ((ebpo_spot_is_below(spot) && !spot->subtree) ||
        (!spot->subtree && ebpo_entry_kind_of(spot->entry) == EBPO_ENTRY_GRAY)) {
        ebpo_top_planes planes =
            ebpo_spot_is_below(spot) ? model->top->below_planes[value] : model->top->gray[value];
        *count = planes.count;
        return model->top->planes + planes.first;
    }
    if (!(ebpo_entry_kind_of(spot->entry) & EBPO_ENTRY_GRAY) ||
        !spot->subtree->gray_first) /* GRAY and BELOW */
        return NULL;
    *count = spot->subtree->gray_first[value + 1] - spot->subtree->gray_first[value];
    return spot->subtree->gray_planes + spot->subtree->gray_first[value];
}

/* A node may list a face that only comes near, within 1/256 of the cell's size on each axis
 * (format-spec, section 5); and some room for rounding. */
static const double near_share = 0x1.1p-8;

static void cell_of(const ebpo_box *box, int level, const uint32_t at[3], double low[3],
                    double size[3])
{
    for (int k = 0; k < 3; k++) {
        low[k] = ebpo_wall(box, k, level, at[k]);
        size[k] = box->size[k] / (double)(1u << level);
    }
}

/* sqrt(x0^2 + x1^2 + x2^2) without overflow, right to a few ulp. */
static double length3(const double x[3])
{
    double most = fmax(fabs(x[0]), fmax(fabs(x[1]), fabs(x[2])));
    if (!(most > 0) || isinf(most))
        return most;
    double a = x[0] / most, b = x[1] / most, c = x[2] / most;
    return most * sqrt(a * a + b * b + c * c);
}

double ebpo_spot_diagonal(const ebpo_model *model, const ebpo_spot *spot)
{
    ebpo_box box = ebpo_model_box(model);
    double low[3], size[3];
    cell_of(&box, spot->level, spot->at, low, size);
    return length3(size) * (1 + near_share);
}

/* Value of a half-space at p, 4096 n . xi - d, and a bound on its error. */
static double plane_value(const double xi[3], uint32_t code, int32_t n[3], double *error)
{
    int32_t d;
    if (!ebpo_plane_code_decode(code, n, &d)) {
        *error = INFINITY;
        return 0;
    }
    double sum = 0, size = fabs((double)d);
    for (int k = 0; k < 3; k++) {
        sum += 4096.0 * n[k] * xi[k];
        size += 4096.0 * fabs((double)n[k]) * (fabs(xi[k]) + 1);
    }
    *error = size * 0x1p-48;
    return sum - d;
}

bool ebpo_outside_planes(const ebpo_box *box, int level, const uint32_t at[3],
                         const uint32_t *codes, uint32_t count, const double p[3])
{
    double low[3], size[3], xi[3], error;
    int32_t n[3];
    cell_of(box, level, at, low, size);
    for (int k = 0; k < 3; k++)
        xi[k] = (p[k] - low[k]) / size[k];
    for (uint32_t i = 0; i < count; i++)
        if (plane_value(xi, codes[i], n, &error) > error)
            return true;
    return false;
}

double ebpo_envelope_distance(const ebpo_box *box, int level, const uint32_t at[3],
                              const uint32_t *codes, uint32_t count, const double p[3])
{
    double low[3], size[3], xi[3], d[3];
    cell_of(box, level, at, low, size);
    for (int k = 0; k < 3; k++) {
        xi[k] = (p[k] - low[k]) / size[k];
        d[k] = fmax(fmax(low[k] - p[k], p[k] - (low[k] + size[k])), 0);
    }
    double best = length3(d) * (1 - 0x1p-48);
    for (uint32_t i = 0; i < count; i++) {
        int32_t n[3];
        double error, value = plane_value(xi, codes[i], n, &error);
        if (!(value > error))
            continue;
        double gradient[3] = { 4096.0 * n[0] / size[0], 4096.0 * n[1] / size[1],
                               4096.0 * n[2] / size[2] };
        double length = length3(gradient), distance = (value - error) / length * (1 - 0x1p-48);
        if (length > 0 && isfinite(length) && distance > best)
            best = distance;
    }
    return isnan(best) ? 0 : best;
}

double ebpo_cell_far(const ebpo_box *box, int level, const uint32_t at[3], const double p[3])
{
    double low[3], size[3], d[3];
    cell_of(box, level, at, low, size);
    for (int k = 0; k < 3; k++)
        d[k] = fmax(fabs(p[k] - low[k]), fabs(p[k] - (low[k] + size[k])));
    return length3(d) * (1 + 0x1p-40) + length3(size) * near_share;
}

double ebpo_spot_distance(const ebpo_model *m, const ebpo_box *box, const ebpo_spot *spot,
                          double parent, const double p[3])
{
    uint32_t count;
    const uint32_t *codes = ebpo_spot_planes(m, spot, &count);
    return fmax(parent, ebpo_envelope_distance(box, spot->level, spot->at, codes, count, p));
}

int ebpo_rank_children(const ebpo_model *m, const ebpo_box *box, const ebpo_spot *gray,
                       double parent, const double p[3], ebpo_ranked out[8])
{
    int count = 0;
    for (unsigned octant = 0; octant < 8; octant++) {
        ebpo_ranked r = { ebpo_spot_child(m, gray, octant), 0 };
        if (ebpo_spot_is_uniform(&r.spot))
            continue;
        r.lower = ebpo_spot_distance(m, box, &r.spot, parent, p);
        int at = count++;
        for (; at > 0 && out[at - 1].lower > r.lower; at--)
            out[at] = out[at - 1];
        out[at] = r;
    }
    return count;
}
