#include "core/strict_fp.h"

#include "derive/bound.h"
#include "derive/fragments.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "core/alloc.h"
#include "core/error.h"
#include "geometry/plane_clip.h"
#include "query/query_model.h"

ebpo_status ebpo_bounder_make(ebpo_bounder *out, const ebpo_lod_model *whole, ebpo_model *model,
                              ebpo_error *error)
{
    memset(out, 0, sizeof *out);
    out->whole = whole;
    return ebpo_context_new(model, &out->context, error);
}

void ebpo_bounder_free(ebpo_bounder *b)
{
    ebpo_context_free(b->context);
    free(b->scratch.faces);
    free(b->fragments);
    free(b->faces);
    memset(b, 0, sizeof *b);
}

/* --- what is known of a piece --- */

static void find_centre(const ebpo_bounder *b, const ebpo_polytope *p, ebpo_fragment_measure *l)
{
    ebpo_extent e;
    ebpo_extent_of(p, &e);
    l->reach = 0;
    for (int k = 0; k < 3; k++) {
        l->centre[k] = 0;
        for (int i = 0; i < p->vertex_count; i++)
            l->centre[k] += p->vertex[i][k];
        l->centre[k] =
            fmin(fmax(l->centre[k] / p->vertex_count, fmax(e.min[k], 0)), fmin(e.max[k], 1));
    }
    for (int i = 0; i < p->vertex_count; i++)
        l->reach = fmax(l->reach, ebpo_cell_frame_apart(&b->frame, p->vertex[i], l->centre));
}

static ebpo_status query_distance(ebpo_bounder *b, const double xi[3], double *distance)
{
    ebpo_distance_result result;
    double p[3];
    ebpo_cell_frame_point(&b->frame, xi, p);
    b->questions++;
    ebpo_status status = ebpo_distance(b->context, p, NULL, &result, b->error);
    *distance = ebpo_cell_frame_length(&b->frame, result.distance);
    return status;
}

/* Without doubt in the envelope, whatever was rounded. */
static bool is_in_envelope(const ebpo_bounder *b, const double xi[3])
{
    for (int i = 0; i < b->halves.count; i++) {
        double n[3], d = ebpo_plane_as_double(b->halves.at[i].n, b->halves.at[i].d, n);
        if (n[0] * xi[0] + n[1] * xi[1] + n[2] * xi[2] > d - 1e-12)
            return false;
    }
    return true;
}

/* Pieces reach a little beyond the envelope, and where it is sharp all of a piece may lie there. So
 * a point outside is pulled towards the middle until it is inside: its distance changes by no more
 * than it was moved. */
static void pull_in(const ebpo_bounder *b, const double xi[3], double out[3])
{
    double share = 0;
    for (int i = 0; i < b->halves.count; i++) {
        double n[3], d = ebpo_plane_as_double(b->halves.at[i].n, b->halves.at[i].d, n) - 2e-12,
                     at = -d, middle = -d;
        for (int k = 0; k < 3; k++) {
            at += n[k] * xi[k];
            middle += n[k] * b->inner[k];
        }
        if (at > 0)
            share = middle < 0 ? fmax(share, at / (at - middle)) : 1;
    }
    for (int k = 0; k < 3; k++)
        out[k] = xi[k] + share * (b->inner[k] - xi[k]);
}

static void learn_distance(ebpo_bounder *b, const double xi[3], double distance)
{
    double at[3], certain = distance - 4 * b->frame.grain;
    if (certain <= b->lo)
        return;
    pull_in(b, xi, at);
    certain -= ebpo_cell_frame_apart(&b->frame, xi, at);
    if (certain <= b->lo || !is_in_envelope(b, at))
        return;
    b->lo = certain;
    ebpo_cell_frame_point(&b->frame, at, b->place);
    b->target = fmax(b->target, b->ratio * b->lo);
}

static ebpo_status measure_fragment(ebpo_bounder *b, const ebpo_fragment *fragment, ebpo_fragment_measure *l)
{
    double corner = 0;
    int farthest = 0;
    find_centre(b, &fragment->p, l);
    ebpo_status status = query_distance(b, l->centre, &l->distance);
    if (status != EBPO_OK)
        return status;
    memcpy(l->face, b->context->warm_triangle, sizeof l->face);
    learn_distance(b, l->centre, l->distance);
    for (int i = 0; i < fragment->p.vertex_count; i++) {
        double d =
            ebpo_cell_frame_distance(&b->frame, fragment->p.vertex[i], (const double(*)[3])l->face);
        farthest = d > corner ? i : farthest;
        corner = fmax(corner, d);
    }
    l->upper =
        fmin(fmin(fragment->upper, corner), fmax(0, l->distance + l->reach)) + 4 * b->frame.grain;
    if (l->upper <= b->target || (l->distance < 0 && corner <= -l->distance))
        return EBPO_OK;
    /* The likeliest place of the largest distance: that corner, moved off the rounded surface. */
    double xi[3], d;
    for (int k = 0; k < 3; k++)
        xi[k] = fmin(fmax(fragment->p.vertex[farthest][k] +
                              1e-5 * (l->centre[k] - fragment->p.vertex[farthest][k]),
                          0),
                     1);
    status = query_distance(b, xi, &d);
    if (status == EBPO_OK)
        learn_distance(b, xi, d);
    return status;
}

/* --- the search --- */

static ebpo_status begin_search(ebpo_bounder *b)
{
    ebpo_node node;
    ebpo_fragment *first = NULL;
    if (!ebpo_tree_find(b->whole, b->frame.cell, &node))
        return ebpo_fail(b->error, EBPO_E_ARGUMENT,
                         "the model has no node of level %d where the level has one: they are not "
                         "of the same file",
                         b->frame.cell.level);
    b->fragment_count = b->face_count = 0;
    if (node.type == EBPO_BLACK)
        return EBPO_OK;
    ebpo_status status = ebpo_fragment_push(b,
                                            node.type == EBPO_GRAY   ? EBPO_FRAGMENT_GRAY
                                            : node.type == EBPO_LEAF ? EBPO_FRAGMENT_LEAF
                                                                     : EBPO_FRAGMENT_OUTSIDE,
                                            NULL, &first);
    if (status != EBPO_OK)
        return status;
    ebpo_half_spaces_cut(&b->halves, EBPO_CUT_SLACK, &first->p);
    first->node = node;
    for (int k = 0; k < 3; k++) {
        b->inner[k] = 0;
        for (int i = 0; i < first->p.vertex_count; i++)
            b->inner[k] += first->p.vertex[i][k] / first->p.vertex_count;
    }
    return node.type == EBPO_LEAF ? ebpo_fragment_leaf_faces(b, first, &node) : EBPO_OK;
}

static ebpo_status search_step(ebpo_bounder *b)
{
    ebpo_fragment fragment;
    ebpo_fragment_measure l;
    const ebpo_fragment *top = &b->fragments[--b->fragment_count];
    memcpy(&fragment, top, offsetof(ebpo_fragment, p));
    ebpo_polytope_copy(&fragment.p, &top->p);
    b->face_count = fragment.face_first + fragment.face_count;
    if (fragment.kind != EBPO_FRAGMENT_OUTSIDE)
        fragment.upper = fmin(fragment.upper, ebpo_cell_frame_diagonal(&b->frame, fragment.levels) +
                                                  fragment.beyond);
    if (fragment.upper <= b->target) {
        ebpo_bound_raise(b, fragment.upper);
        return EBPO_OK;
    }
    ebpo_status status = measure_fragment(b, &fragment, &l);
    if (status != EBPO_OK)
        return status;
    fragment.upper = l.upper;
    if (l.upper <= b->target || l.reach < EBPO_FRAGMENT_LEAST) {
        ebpo_bound_raise(b, l.upper);
        return EBPO_OK;
    }
    return ebpo_fragment_cut(b, &fragment, &l);
}

ebpo_status ebpo_bound_envelope(ebpo_bounder *b, ebpo_cell cell, const ebpo_bound_goal *goal,
                                ebpo_reach_bound *out, ebpo_error *error)
{
    ebpo_box box = b->whole->box;
    ebpo_cell_frame_make(&b->frame, &box, cell);
    b->error = error;
    b->target = ebpo_cell_frame_length(&b->frame, goal->enough) * (1 - 0x1p-40);
    b->quit = ebpo_cell_frame_length(&b->frame, goal->too_much);
    b->ratio = goal->ratio;
    b->lo = b->hi = 0;
    b->questions = 0;
    ebpo_status status = begin_search(b);
    while (status == EBPO_OK && b->fragment_count && b->questions < goal->questions &&
           b->lo <= b->quit)
        status = search_step(b);
    for (uint64_t i = 0; i < b->fragment_count; i++)
        ebpo_bound_raise(b, b->fragments[i].upper);
    *out = (ebpo_reach_bound){ b->lo > 0 ? ldexp(b->lo, b->frame.exponent) : 0,
                               ebpo_cell_frame_model_length(&b->frame, b->hi),
                               { b->place[0], b->place[1], b->place[2] },
                               b->questions };
    return status;
}

static void merge_bounds(ebpo_reach_bound *known, const ebpo_reach_bound *found)
{
    known->hi = fmin(known->hi, found->hi);
    known->questions += found->questions;
    if (found->lo <= known->lo)
        return;
    known->lo = found->lo;
    memcpy(known->place, found->place, sizeof known->place);
}

ebpo_status ebpo_bound_closely(ebpo_bounder *b, ebpo_cell cell, const ebpo_bound_goal *goal,
                               ebpo_reach_bound *out, ebpo_error *error)
{
    ebpo_reach_bound found;
    ebpo_bound_goal now = *goal;
    uint64_t asked = 0;
    ebpo_status status = EBPO_OK;
    if (isinf(out->hi)) {
        ebpo_cell_frame frame;
        ebpo_box box = b->whole->box;
        ebpo_cell_frame_make(&frame, &box, cell);
        /* a gray node or leaf touches a face */
        out->hi = ebpo_cell_frame_model_length(&frame, ebpo_cell_frame_diagonal(&frame, 0));
    }
    for (;;) {
        double good = fmax(goal->enough, goal->ratio * out->lo);
        if (status != EBPO_OK || out->hi <= good || asked >= goal->questions ||
            out->lo > goal->too_much)
            return status;
        now.enough = fmax(out->hi / 2, good);
        now.questions = goal->questions - asked;
        status = ebpo_bound_envelope(b, cell, &now, &found, error);
        if (status != EBPO_OK)
            return status;
        bool stuck = found.hi >= out->hi && found.lo <= out->lo;
        asked += found.questions;
        merge_bounds(out, &found);
        if (stuck)
            return EBPO_OK; /* rounding is all there is left */
    }
}
