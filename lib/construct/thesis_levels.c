/* Computes envelopes as in the theses, for comparison: the volume and the number of planes of each
 * level, without a file.
 *
 * A candidate is a plane that may be chosen. In a file, a node has at most 255 planes, and only one
 * of several candidates with equal normals is kept before a percentage of the candidates is chosen.
 * The theses do not have these limits (BP 2008, 3.5.1: 2,955 planes at a root). Here, all
 * candidates of a node are kept, in the order of the node's faces or children, and polytopes have
 * any number of faces. Normals are rounded as in files; offsets are not rounded. Leaves are made by
 * one of three criteria (BP 2008, 3.3.1, algorithm 4). */
#include "core/strict_fp.h"

#include <stdlib.h>
#include <string.h>

#include "construct/construct_stages.h"
#include "construct/planes.h"
#include "construct/thesis_levels.h"
#include "core/alloc.h"

bool ebpo_thesis_coalesces(const ebpo_builder *b, const ebpo_branch *s, uint32_t node,
                           uint64_t *faces_max)
{
    uint64_t sum = 0, leaves = 0, limit = b->options->leaf_faces;
    for (uint32_t o = 0; o < 8; o++) {
        const ebpo_build_node *child = &s->nodes[s->nodes[node].child + o];
        if (child->type == EBPO_GRAY)
            return false;
        if (child->type != EBPO_LEAF)
            continue;
        const ebpo_build_detail *d = &s->details[child->detail];
        sum += d->entry_end - d->entry_begin;
        leaves++;
    }
    *faces_max = sum;
    return b->thesis->coalesce == EBPO_COALESCE_MEAN ? sum < limit * leaves : sum < limit;
}

/* Cuts the envelope by the chosen candidates. Sets chosen[i] to false if candidate i cuts nothing
 * off. Returns the number of candidates that are still chosen, or -1 when out of memory. */
static int64_t cut_by_chosen(ebpo_large_polytope *envelope, const ebpo_choice *choice, bool *chosen)
{
    int64_t planes = 0;
    for (int i = 0; i < choice->count; i++) {
        int32_t n[3], d;
        double normal[3];
        if (!chosen[i])
            continue;
        ebpo_plane_code_decode(choice->candidates[i].normal, n, &d);
        for (int k = 0; k < 3; k++)
            normal[k] = n[k] * (1.0 / EBPO_NORMAL_NORM);
        chosen[i] =
            ebpo_large_clip(envelope, normal, choice->candidates[i].support / EBPO_NORMAL_NORM,
                            i) == EBPO_CLIP_CUT;
        if (envelope->no_memory)
            return -1;
        planes += chosen[i];
    }
    return planes;
}

/* Adds to `out` the corners of those faces of the envelope that planes made (tag >= 0). Corners
 * that only faces of the cell have (tag < 0) are not added. Returns false when out of memory. */
static bool give_corners(const ebpo_large_polytope *envelope, ebpo_handover *out)
{
    const ebpo_large_shape *s = &envelope->now;
    bool *used = ebpo_alloc_zero(s->vertex_count + 1, sizeof *used);
    bool good = used && ebpo_grow(&out->corner, &out->corner_capacity, s->vertex_count,
                                  sizeof *out->corner);
    for (uint64_t f = 0; f < s->face_count && good; f++)
        for (uint64_t i = s->first[f]; i < s->first[f + 1] && s->tag[f] >= 0; i++)
            if (!used[s->corner[i]]) {
                used[s->corner[i]] = true;
                memcpy(out->corner[out->corner_count++], s->vertex[s->corner[i]],
                       sizeof *out->corner);
            }
    free(used);
    return good;
}

/* Adds the chosen offers to `out`. Returns false when out of memory. */
static bool give_planes(const bool *chosen, const ebpo_handover *given, ebpo_handover *out)
{
    for (uint64_t i = 0; i < given->offer_count; i++)
        if (chosen[i] && !ebpo_handover_add(out, given->offers[i].normal, given->offers[i].origin))
            return false;
    return true;
}

/* Adds a node to the sums of its level. `leaf_faces`: number of faces of a leaf; 0 for a gray node.
 * `share`: volume of the node's envelope, divided by the volume of its cell. */
static void add_node(const ebpo_builder *b, ebpo_thesis_level *l, int level, uint64_t leaf_faces,
                     uint64_t planes, double share)
{
    double volume = share * ebpo_cell_volume(&b->box, level);
    if (leaf_faces) {
        l->leaf_count++;
        l->leaf_faces += leaf_faces;
        l->leaf_plane_count += planes;
        l->leaf_volume += volume;
    } else {
        l->gray_count++;
        l->plane_count += planes;
        l->gray_volume += volume;
    }
}

bool ebpo_thesis_choose(const ebpo_builder *b, ebpo_large_polytope *envelope,
                        ebpo_thesis_level *levels, ebpo_cell cell, uint64_t leaf_faces,
                        ebpo_choice *choice, const ebpo_handover *given, ebpo_handover *out)
{
    const ebpo_build_options *o = b->options;
    bool *chosen = ebpo_alloc((uint64_t)choice->count + 1, sizeof *chosen);
    int64_t planes = -1;
    choice->wanted = ebpo_selection_requested(choice->count, cell.level, o->percent, o->k_root);
    if (chosen && ebpo_large_cube(envelope) && ebpo_choose_candidates(o->select, choice, chosen))
        planes = cut_by_chosen(envelope, choice, chosen);
    bool good = planes >= 0 && give_planes(chosen, given, out) && give_corners(envelope, out);
    if (good)
        add_node(b, &levels[cell.level], cell.level, leaf_faces, (uint64_t)planes,
                 ebpo_large_volume(envelope));
    free(chosen);
    return good;
}

void ebpo_thesis_add_empty(const ebpo_builder *b, ebpo_thesis_level *levels, int level,
                           int32_t winding)
{
    static const int32_t no_delta[8] = { 0 };
    if (!b->solid || !(ebpo_inside_corners(b, winding, no_delta) & 1))
        return;
    levels[level].black_count++;
    levels[level].black_volume += ebpo_cell_volume(&b->box, level);
}

void ebpo_thesis_add_up(ebpo_thesis_levels *out, const ebpo_thesis_level *levels)
{
    for (int i = 0; i < EBPO_LEVELS_MAX; i++) {
        ebpo_thesis_level *to = &out->level[i];
        to->gray_count += levels[i].gray_count;
        to->leaf_count += levels[i].leaf_count;
        to->black_count += levels[i].black_count;
        to->leaf_faces += levels[i].leaf_faces;
        to->plane_count += levels[i].plane_count;
        to->leaf_plane_count += levels[i].leaf_plane_count;
        to->gray_volume += levels[i].gray_volume;
        to->leaf_volume += levels[i].leaf_volume;
        to->black_volume += levels[i].black_volume;
        if (levels[i].gray_count || levels[i].leaf_count || levels[i].black_count)
            out->level_count = i + 1 > out->level_count ? i + 1 : out->level_count;
    }
}
