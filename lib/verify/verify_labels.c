#include "core/strict_fp.h"

#include "verify/verify_labels.h"

#include <inttypes.h>

#include "core/workspace.h"
#include "core/wide.h"
#include "verify/winding.h"

enum { SAMPLES_LEAST = 4096, SAMPLES_MANY = 1 << 20, CELLS_ALL = 1 << 22 };
/* Points looked at by faces, in all: some seconds. */
static const double ray_work_affordable = 4e8;

static uint64_t usual_samples(const ebpo_twin_tree *view, uint64_t cells)
{
    uint64_t samples = cells <= CELLS_ALL ? cells : SAMPLES_MANY;
    return ebpo_rays_work(&view->tree->mesh, &view->box, samples) <= ray_work_affordable
               ? samples
               : SAMPLES_LEAST;
}

void ebpo_label_plan_make(ebpo_label_plan *plan, const ebpo_twin_tree *view, uint64_t samples)
{
    uint64_t all = 0, classes = 0;
    for (int l = 0; l < view->tree->info.level_count; l++) {
        const ebpo_level *level = &view->tree->level[l];
        plan->cells[l][EBPO_WHITE] = level->white_count;
        plan->cells[l][EBPO_BLACK] = level->black_count;
        plan->cells[l][EBPO_LEAF] = level->leaf_count;
        plan->cells[l][EBPO_GRAY] = 0;
        for (int type = 0; type < EBPO_GRAY; type++) {
            all += plan->cells[l][type];
            classes += plan->cells[l][type] > 0;
        }
    }
    if (samples == 0)
        samples = usual_samples(view, all);
    /* Half of the samples go to the classes evenly, so that small levels are seen too; half by
     * size. */
    for (int l = 0; l < view->tree->info.level_count; l++)
        for (int type = 0; type <= EBPO_GRAY; type++) {
            uint64_t cells = plan->cells[l][type];
            uint64_t share =
                cells == 0
                    ? 0
                    : samples / (2 * classes) +
                          (uint64_t)((double)samples / 2 * ((double)cells / (double)all)) + 1;
            plan->take[l][type] = samples >= all || share > cells ? cells : share;
        }
}

/* True for `take` of the `cells` ranks, evenly spread. */
static bool planned(const ebpo_label_plan *plan, const ebpo_twin_node *node)
{
    uint64_t cells = plan->cells[node->cell.level][node->type],
             take = plan->take[node->cell.level][node->type];
    if (take >= cells)
        return true;
    /* (rank + 1) * take / cells is another integer than rank * take / cells */
    return ebpo_wide_modulo(ebpo_wide_product(node->rank, take), cells) >= cells - take;
}

static void corner_position(const ebpo_frame *frame, unsigned corner, double out[3])
{
    for (int k = 0; k < 3; k++)
        out[k] = corner >> k & 1 ? frame->high[k] : frame->low[k];
}

/* Changes of the winding number that one face makes along seven cell edges: a tree that reaches all
 * corners from corner 0. */
static const struct {
    unsigned char from, to, axis;
} edge_tree[7] = { { 0, 1, 0 }, { 0, 2, 1 }, { 0, 4, 2 }, { 2, 3, 0 },
                   { 4, 5, 0 }, { 4, 6, 1 }, { 6, 7, 0 } };

static void add_crossings(int64_t change[7], const ebpo_frame *frame, const ebpo_corners *face)
{
    for (int e = 0; e < 7; e++) {
        double from[3], to[3];
        corner_position(frame, edge_tree[e].from, from);
        corner_position(frame, edge_tree[e].to, to);
        change[e] +=
            ebpo_ray_hit(to, edge_tree[e].axis, face) - ebpo_ray_hit(from, edge_tree[e].axis, face);
    }
}

void ebpo_terminal_windings(ebpo_corner_windings *out, const ebpo_twin_tree *view,
                            const ebpo_twin_node *node, const ebpo_frame *frame,
                            const uint32_t *faces, uint64_t count)
{
    int64_t first = ebpo_twin_winding(view, node), change[7] = { 0 };
    for (int i = 0; i < 8; i++)
        out->at[i] = first;
    out->known = node->type == EBPO_LEAF && !view->has_mesh ? 1 : 255;
    if (node->type != EBPO_LEAF || !view->has_mesh)
        return;
    EBPO_FOR_ITEMS_SCATTERED(view->workspace, i, 0, count) {
        ebpo_corners face;
        ebpo_face_corners(&view->tree->mesh, faces[i], &face);
        add_crossings(change, frame, &face);
    }
    for (int e = 0; e < 7; e++)
        out->at[edge_tree[e].to] = out->at[edge_tree[e].from] + change[e];
}

void ebpo_check_terminal_label(ebpo_tally *tally, const ebpo_twin_tree *view,
                               const ebpo_twin_node *node)
{
    if (node->type == EBPO_LEAF)
        return;
    int64_t stored = ebpo_twin_winding(view, node);
    tally->checks[EBPO_VERIFY_LABELS]++;
    if (ebpo_twin_inside(view, stored) != (node->type == EBPO_BLACK))
        ebpo_tally_violation(tally, EBPO_VERIFY_LABELS,
                             &(ebpo_verify_place){ node->code, EBPO_NO_FACE, EBPO_NO_PLANE },
                             "%s, but winding number %" PRId64 " lies %s by the file's rule",
                             node->type == EBPO_BLACK ? "black" : "white", stored,
                             node->type == EBPO_BLACK ? "outside" : "inside");
}

bool ebpo_label_note(ebpo_ray_points *points, const ebpo_twin_tree *view,
                     const ebpo_twin_node *node, const ebpo_frame *frame,
                     const ebpo_label_plan *plan)
{
    if (!planned(plan, node))
        return true;
    ebpo_ray_point p = { { frame->low[0], frame->low[1], frame->low[2] },
                         node->code,
                         ebpo_twin_winding(view, node),
                         0 };
    return ebpo_rays_add(points, &p);
}

void ebpo_check_rays(ebpo_tally *tally, const ebpo_ray_points *points)
{
    tally->checks[EBPO_VERIFY_LABELS] += points->count;
    EBPO_FOR_ITEMS(points->workspace, i, 0, points->count) {
        const ebpo_ray_point *p = &points->point[i];
        if (p->found != p->stored)
            ebpo_tally_violation(tally, EBPO_VERIFY_LABELS,
                                 &(ebpo_verify_place){ p->octcode, EBPO_NO_FACE, EBPO_NO_PLANE },
                                 "winding number %" PRId64
                                 " is stored, a ray through the mesh finds %" PRId64,
                                 p->stored, p->found);
    }
}

/* Number of the point, 0 .. 26, that a child's corner is. */
static int shared_point(unsigned octant, unsigned corner)
{
    int point = 0, step = 1;
    for (int k = 0; k < 3; k++, step *= 3)
        point += step * (int)((octant >> k & 1) + (corner >> k & 1));
    return point;
}

void ebpo_check_links(ebpo_tally *tally, const ebpo_twin_node *node,
                      const ebpo_corner_windings children[8], ebpo_corner_windings *out)
{
    int64_t value[27];
    bool known[27] = { false };
    *out = (ebpo_corner_windings){ { 0 }, 0 };
    for (unsigned octant = 0; octant < 8; octant++)
        for (unsigned corner = 0; corner < 8; corner++) {
            int point = shared_point(octant, corner);
            if (!(children[octant].known >> corner & 1))
                continue;
            int64_t here = children[octant].at[corner];
            tally->checks[EBPO_VERIFY_LABELS] += known[point];
            if (known[point] && value[point] != here) {
                ebpo_verify_place place = { ebpo_octcode_child(node->code, octant), EBPO_NO_FACE,
                                            EBPO_NO_PLANE };
                ebpo_tally_violation(tally, EBPO_VERIFY_LABELS, &place,
                                     "winding number %" PRId64
                                     " at corner %u, a neighbour gives %" PRId64
                                     " for the same point",
                                     here, corner, value[point]);
            }
            if (!known[point])
                value[point] = here;
            known[point] = true;
        }
    for (unsigned i = 0; i < 8; i++)
        if (children[i].known >> i & 1) {
            out->at[i] = children[i].at[i];
            out->known |= 1u << i;
        }
}

void ebpo_check_root_corners(ebpo_tally *tally, const ebpo_corner_windings *root)
{
    for (unsigned i = 0; i < 8; i++) {
        if (!(root->known >> i & 1))
            continue;
        tally->checks[EBPO_VERIFY_LABELS]++;
        if (root->at[i] != 0)
            ebpo_tally_violation(tally, EBPO_VERIFY_LABELS,
                                 &(ebpo_verify_place){ 1, EBPO_NO_FACE, EBPO_NO_PLANE },
                                 "corner %u of the root cell has winding number %" PRId64
                                 ", but lies outside",
                                 i, root->at[i]);
    }
}

unsigned ebpo_windings_inside(const ebpo_twin_tree *view, const ebpo_corner_windings *corners)
{
    unsigned inside = 0;
    for (unsigned i = 0; i < 8; i++)
        inside |= (unsigned)((corners->known >> i & 1) && ebpo_twin_inside(view, corners->at[i]))
                  << i;
    return inside;
}
