/* Bounds the distance by which an envelope extends beyond the model. The envelope of a node is a
 * convex polyhedron that contains the part of the solid in the node's cell. Gray nodes have
 * children, leaves list faces, and black nodes are inside the solid.
 *
 * ebpo_bound_envelope is a branch and bound over fragments (fragments.c), the convex parts into
 * which an envelope is cut. The upper bound of a fragment is computed from the distance of its
 * centre, and from the face nearest to its centre. The largest distance found is the lower bound.
 *
 * The ebpo_tolerance functions decide for many nodes, with several threads, if the envelopes are
 * within max_error of the model. They keep the results, and use them again for other values of
 * max_error. */
#include "core/strict_fp.h"

#include <float.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "core/alloc.h"
#include "core/error.h"
#include "core/parallel.h"
#include "derive/error_bound.h"
#include "derive/fragments.h"
#include "geometry/polytope.h"
#include "query/query_model.h"

ebpo_status ebpo_bounder_make(ebpo_bounder *out, const ebpo_lod_model *model_tree,
                              ebpo_model *model, ebpo_error *error)
{
    memset(out, 0, sizeof *out);
    out->model_tree = model_tree;
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

/* --- measures of a fragment --- */

/* Sets the centre of a fragment, and the radius of a ball around the centre that contains the
 * fragment. */
static void find_centre(const ebpo_bounder *b, const ebpo_polytope *p,
                        ebpo_fragment_measure *measure)
{
    ebpo_extent e;
    ebpo_extent_of(p, &e);
    measure->radius = 0;
    for (int k = 0; k < 3; k++) {
        measure->centre[k] = 0;
        for (int i = 0; i < p->vertex_count; i++)
            measure->centre[k] += p->vertex[i][k];
        measure->centre[k] =
            fmin(fmax(measure->centre[k] / p->vertex_count, fmax(e.min[k], 0)), fmin(e.max[k], 1));
    }
    for (int i = 0; i < p->vertex_count; i++)
        measure->radius =
            fmax(measure->radius, ebpo_cell_frame_apart(&b->frame, p->vertex[i], measure->centre));
}

/* Queries the signed distance of a point in cell coordinates; *distance is in the frame's unit. */
static ebpo_status query_distance(ebpo_bounder *b, const double xi[3], double *distance)
{
    ebpo_distance_result result;
    double p[3];
    ebpo_cell_frame_point(&b->frame, xi, p);
    b->queries++;
    ebpo_status status = ebpo_distance(b->context, p, NULL, &result, b->error);
    *distance = ebpo_cell_frame_length(&b->frame, result.distance);
    return status;
}

/* Returns true if the point is certainly in the envelope, despite rounding. */
static bool is_in_envelope(const ebpo_bounder *b, const double xi[3])
{
    for (int i = 0; i < b->half_spaces.count; i++) {
        double n[3], d = ebpo_plane_as_double(b->half_spaces.at[i].n, b->half_spaces.at[i].d, n);
        if (n[0] * xi[0] + n[1] * xi[1] + n[2] * xi[2] > d - 1e-12)
            return false;
    }
    return true;
}

/* Moves a point that is outside the envelope towards the envelope's middle (b->inner) until the
 * point is inside. Fragments extend a little beyond the envelope, and at a sharp corner of the
 * envelope, all of a fragment may be outside. `out` is the moved point. */
static void move_into_envelope(const ebpo_bounder *b, const double xi[3], double out[3])
{
    double share = 0;
    for (int i = 0; i < b->half_spaces.count; i++) {
        double n[3],
            d = ebpo_plane_as_double(b->half_spaces.at[i].n, b->half_spaces.at[i].d, n) - 2e-12,
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

/* Raises the lower bound b->lo if the queried distance of the point xi shows a greater bound. If xi
 * must be moved into the envelope, its distance may decrease by the length of the move. */
static void raise_lower_bound(ebpo_bounder *b, const double xi[3], double distance)
{
    double moved[3], lower_bound = distance - 4 * b->frame.grain;
    if (lower_bound <= b->lo)
        return;
    move_into_envelope(b, xi, moved);
    lower_bound -= ebpo_cell_frame_apart(&b->frame, xi, moved);
    if (lower_bound <= b->lo || !is_in_envelope(b, moved))
        return;
    b->lo = lower_bound;
    ebpo_cell_frame_point(&b->frame, moved, b->location);
    b->target = fmax(b->target, b->ratio * b->lo);
}

/* Bounds the distance of a fragment's points with one or two queries: at the centre, and at the
 * corner that is farthest from the face nearest to the centre. */
static ebpo_status measure_fragment(ebpo_bounder *b, const ebpo_fragment *fragment,
                                    ebpo_fragment_measure *measure)
{
    double corner = 0; /* greatest distance of a corner from the face nearest to the centre */
    int farthest = 0;  /* index of the corner with this distance */
    find_centre(b, &fragment->p, measure);
    ebpo_status status = query_distance(b, measure->centre, &measure->distance);
    if (status != EBPO_OK)
        return status;
    memcpy(measure->face, b->context->warm_triangle, sizeof measure->face);
    raise_lower_bound(b, measure->centre, measure->distance);
    for (int i = 0; i < fragment->p.vertex_count; i++) {
        double d = ebpo_cell_frame_distance(&b->frame, fragment->p.vertex[i],
                                            (const double(*)[3])measure->face);
        farthest = d > corner ? i : farthest;
        corner = fmax(corner, d);
    }
    measure->upper =
        fmin(fmin(fragment->upper, corner), fmax(0, measure->distance + measure->radius)) +
        4 * b->frame.grain;
    if (measure->upper <= b->target || (measure->distance < 0 && corner <= -measure->distance))
        return EBPO_OK;
    /* Also query the farthest corner. Rounding may have put the corner outside the envelope, so the
     * queried point is moved a little from the corner towards the centre. */
    double xi[3], d;
    for (int k = 0; k < 3; k++)
        xi[k] = fmin(fmax(fragment->p.vertex[farthest][k] +
                              1e-5 * (measure->centre[k] - fragment->p.vertex[farthest][k]),
                          0),
                     1);
    status = query_distance(b, xi, &d);
    if (status == EBPO_OK)
        raise_lower_bound(b, xi, d);
    return status;
}

/* --- the search --- */

/* Sets the stack to one fragment, which is the whole envelope. The envelope of a black node is in
 * the solid. For a black node, the stack is therefore empty, and the bounds stay 0. */
static ebpo_status begin_search(ebpo_bounder *b)
{
    ebpo_node node;
    ebpo_fragment *first = NULL;
    if (!ebpo_tree_find(b->model_tree, b->frame.cell, &node))
        return ebpo_fail(b->error, EBPO_E_ARGUMENT,
                         "a node of level %d was not found in the model: the file of the level and "
                         "the model do not belong together; open the model of the original file",
                         b->frame.cell.level);
    b->fragment_count = b->face_count = 0;
    if (node.type == EBPO_BLACK)
        return EBPO_OK;
    ebpo_status status = ebpo_fragment_push(b, ebpo_fragment_kind_in(b, &node), NULL, &first);
    if (status != EBPO_OK)
        return status;
    ebpo_half_spaces_cut(&b->half_spaces, EBPO_CUT_SLACK, &first->p);
    first->node = node;
    for (int k = 0; k < 3; k++) {
        b->inner[k] = 0;
        for (int i = 0; i < first->p.vertex_count; i++)
            b->inner[k] += first->p.vertex[i][k] / first->p.vertex_count;
    }
    return node.type == EBPO_LEAF ? ebpo_fragment_leaf_faces(b, first, &node) : EBPO_OK;
}

/* Takes a fragment from the stack. If the fragment's upper bound is above the target, measures the
 * fragment. If the measured upper bound is still above the target, cuts the fragment. */
static ebpo_status search_step(ebpo_bounder *b)
{
    ebpo_fragment fragment;
    ebpo_fragment_measure measure;
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
    ebpo_status status = measure_fragment(b, &fragment, &measure);
    if (status != EBPO_OK)
        return status;
    fragment.upper = measure.upper;
    if (measure.upper <= b->target || measure.radius < EBPO_FRAGMENT_LEAST) {
        ebpo_bound_raise(b, measure.upper);
        return EBPO_OK;
    }
    return ebpo_fragment_cut(b, &fragment, &measure);
}

ebpo_status ebpo_bound_envelope(ebpo_bounder *b, ebpo_cell cell, const ebpo_bound_goal *goal,
                                ebpo_envelope_bound *out, ebpo_error *error)
{
    ebpo_box box = b->model_tree->box;
    ebpo_cell_frame_make(&b->frame, &box, cell);
    b->error = error;
    b->target = ebpo_cell_frame_length(&b->frame, goal->enough) * (1 - 0x1p-40);
    b->quit = ebpo_cell_frame_length(&b->frame, goal->too_much);
    b->ratio = goal->ratio;
    b->lo = b->hi = 0;
    b->queries = 0;
    ebpo_status status = begin_search(b);
    while (status == EBPO_OK && b->fragment_count && b->queries < goal->queries && b->lo <= b->quit)
        status = search_step(b);
    for (uint64_t i = 0; i < b->fragment_count; i++)
        ebpo_bound_raise(b, b->fragments[i].upper);
    *out = (ebpo_envelope_bound){ b->lo > 0 ? ldexp(b->lo, b->frame.exponent) : 0,
                                  ebpo_cell_frame_model_length(&b->frame, b->hi),
                                  { b->location[0], b->location[1], b->location[2] },
                                  b->queries };
    return status;
}

/* Improves the known bounds by the bounds that a further search has found. */
static void merge_bounds(ebpo_envelope_bound *known, const ebpo_envelope_bound *found)
{
    known->hi = fmin(known->hi, found->hi);
    known->queries += found->queries;
    if (found->lo <= known->lo)
        return;
    known->lo = found->lo;
    memcpy(known->location, found->location, sizeof known->location);
}

ebpo_status ebpo_bound_closely(ebpo_bounder *b, ebpo_cell cell, const ebpo_bound_goal *goal,
                               ebpo_envelope_bound *out, ebpo_error *error)
{
    ebpo_envelope_bound found;
    ebpo_bound_goal step_goal = *goal;
    uint64_t queries_done = 0;
    ebpo_status status = EBPO_OK;
    if (isinf(out->hi)) {
        ebpo_cell_frame frame;
        ebpo_box box = b->model_tree->box;
        ebpo_cell_frame_make(&frame, &box, cell);
        /* A face touches the cell of a gray node or leaf, so no point of the cell is farther from
         * this face than the cell's diagonal. With border_inside, this is only certain of the
         * parent's cell. */
        double cells = b->model_tree->info->border_inside ? 2 : 1;
        out->hi = ebpo_cell_frame_model_length(&frame, cells * ebpo_cell_frame_diagonal(&frame, 0));
    }
    for (;;) {
        double sufficient = fmax(goal->enough, goal->ratio * out->lo);
        if (status != EBPO_OK || out->hi <= sufficient || queries_done >= goal->queries ||
            out->lo > goal->too_much)
            return status;
        step_goal.enough = fmax(out->hi / 2, sufficient);
        step_goal.queries = goal->queries - queries_done;
        status = ebpo_bound_envelope(b, cell, &step_goal, &found, error);
        if (status != EBPO_OK)
            return status;
        bool unchanged = found.hi >= out->hi && found.lo <= out->lo;
        queries_done += found.queries;
        merge_bounds(out, &found);
        if (unchanged)
            return EBPO_OK; /* the bounds differ only by rounding errors */
    }
}

/* --- deciding which envelopes are close enough to the model --- */

/* Maximum number of queries for a node. If a node needs more queries, its envelope is not accepted,
 * and the caller uses its children, whose envelopes are smaller and closer to the model. */
enum { NODE_QUERIES = 4096 };

/* Results of earlier searches for a node. They decide the test for some other values of max_error,
 * because a search for a larger max_error never needs more queries (error_bound.h). The upper bound
 * that an earlier search found is not kept, because the result of a test must not depend on earlier
 * calls. A search with this bound as max_error might use up its queries and fail, while the kept
 * bound would accept the envelope. */
typedef struct earlier_results {
    double enough; /* least max_error for which the envelope was accepted; INFINITY: none */
    double failed; /* largest max_error for which it was not accepted; -1: none */
    double lo;     /* a guaranteed lower bound of the envelope's error */
} earlier_results;

struct ebpo_tolerance {
    ebpo_model *model;
    ebpo_lod_model tree;
    /* true: envelopes are bounded by planes; false: an envelope is the whole cell of its node */
    bool planes;
    unsigned threads;
    ebpo_progress progress;
    /* for each level, the earlier results of its gray nodes, and of its leaves, by rank */
    earlier_results *gray[EBPO_LEVELS_MAX], *leaf[EBPO_LEVELS_MAX];
    ebpo_bounder *bounders;     /* [threads] state of the searches of each thread */
    ebpo_tolerance_node *nodes; /* argument of the current call of ebpo_tolerance_judge */
    double max_error;           /* argument of the current call */
};

static earlier_results *new_results(uint64_t count)
{
    earlier_results *out = ebpo_alloc(count, sizeof *out);
    for (uint64_t i = 0; out && i < count; i++)
        out[i] = (earlier_results){ .enough = INFINITY, .failed = -1, .lo = 0 };
    return out;
}

ebpo_status ebpo_tolerance_open(ebpo_tolerance **out, const ebpo_file *file, bool planes,
                                unsigned threads, ebpo_progress progress, ebpo_error *error)
{
    ebpo_model_options options = EBPO_MODEL_OPTIONS_INIT;
    ebpo_tolerance *n = *out = ebpo_alloc_zero(1, sizeof *n);
    if (!n)
        return ebpo_fail_memory(error, sizeof *n);
    n->planes = planes;
    n->threads = ebpo_thread_count(threads);
    n->progress = progress;
    options.threads = threads;
    options.progress = progress;
    ebpo_status status = ebpo_tree_read_whole(&n->tree, file, threads, error);
    if (status == EBPO_OK)
        status = ebpo_model_new(file, &options, &n->model, error);
    if (status == EBPO_OK && !(n->bounders = ebpo_alloc_zero(n->threads, sizeof *n->bounders)))
        status = ebpo_fail_memory(error, n->threads * sizeof *n->bounders);
    for (unsigned i = 0; i < n->threads && status == EBPO_OK; i++)
        status = ebpo_bounder_make(&n->bounders[i], &n->tree, n->model, error);
    for (int i = 0; i <= n->tree.target && status == EBPO_OK; i++) {
        n->gray[i] = new_results(n->tree.level[i].gray_count);
        n->leaf[i] = new_results(n->tree.level[i].leaf_count);
        if (!n->gray[i] || !n->leaf[i])
            status = ebpo_fail_memory(error,
                                      (n->tree.level[i].gray_count + n->tree.level[i].leaf_count) *
                                          sizeof(earlier_results));
    }
    if (status != EBPO_OK) {
        ebpo_tolerance_close(n);
        *out = NULL;
    }
    return status;
}

void ebpo_tolerance_close(ebpo_tolerance *n)
{
    if (!n)
        return;
    for (unsigned i = 0; n->bounders && i < n->threads; i++)
        ebpo_bounder_free(&n->bounders[i]);
    for (int i = 0; i < EBPO_LEVELS_MAX; i++) {
        free(n->gray[i]);
        free(n->leaf[i]);
    }
    free(n->bounders);
    ebpo_model_free(n->model);
    ebpo_lod_model_free(&n->tree);
    free(n);
}

/* Decides for one node if its envelope is within n->max_error of the model: from earlier results if
 * possible, otherwise by a search. */
static ebpo_status judge_node(ebpo_tolerance *n, ebpo_bounder *b, ebpo_tolerance_node *node,
                              ebpo_error *error)
{
    ebpo_node stored;
    ebpo_envelope_bound found;
    ebpo_bound_goal goal = { .enough = n->max_error,
                             .too_much = n->max_error,
                             .queries = NODE_QUERIES };
    node->enough = false;
    if (!node->required)
        return EBPO_OK;
    if (!ebpo_tree_find(&n->tree, node->cell, &stored) ||
        (stored.type != EBPO_GRAY && stored.type != EBPO_LEAF))
        return ebpo_fail(error, EBPO_E_FORMAT,
                         "level %d: a node is missing in the tree; run ebpo verify",
                         node->cell.level);
    earlier_results *earlier = stored.type == EBPO_GRAY ? &n->gray[node->cell.level][stored.rank]
                                                        : &n->leaf[node->cell.level][stored.rank];
    node->enough = n->max_error >= earlier->enough;
    if (node->enough || n->max_error <= earlier->failed || n->max_error < earlier->lo)
        return EBPO_OK;
    if (n->planes)
        (void)ebpo_tree_bounds(&n->tree, node->cell, stored.type == EBPO_GRAY, &stored,
                               &b->half_spaces);
    else
        b->half_spaces.count = 0;
    ebpo_status status = ebpo_bound_envelope(b, node->cell, &goal, &found, error);
    if (status != EBPO_OK)
        return status;
    node->enough = found.hi <= n->max_error;
    earlier->lo = fmax(earlier->lo, found.lo);
    if (node->enough)
        earlier->enough = fmin(earlier->enough, n->max_error);
    else
        earlier->failed = fmax(earlier->failed, n->max_error);
    return EBPO_OK;
}

static ebpo_status judge_some(void *context, uint64_t begin, uint64_t end, unsigned worker,
                              ebpo_error *error)
{
    ebpo_tolerance *n = context;
    ebpo_status status = EBPO_OK;
    for (uint64_t i = begin; i < end && status == EBPO_OK; i++)
        status = judge_node(n, &n->bounders[worker], &n->nodes[i], error);
    return status;
}

ebpo_status ebpo_tolerance_judge(ebpo_tolerance *n, ebpo_tolerance_node *nodes, uint64_t count,
                                 double max_error, ebpo_error *error)
{
    n->nodes = nodes;
    n->max_error = max_error;
    return ebpo_parallel_for(n->threads, NULL, count, 8, judge_some, n, &n->progress,
                             "measuring envelopes", error);
}

ebpo_status ebpo_tolerance_max(ebpo_tolerance *n, double *out, ebpo_error *error)
{
    ebpo_node stored;
    ebpo_envelope_bound found = { 0, INFINITY, { 0, 0, 0 }, 0 };
    ebpo_cell root = { 0, { 0, 0, 0 } };
    ebpo_bound_goal goal = { .too_much = INFINITY, .ratio = 1.02, .queries = NODE_QUERIES };
    (void)ebpo_tree_bounds(&n->tree, root, true, &stored, &n->bounders[0].half_spaces);
    if (stored.type == EBPO_LEAF || !n->planes)
        n->bounders[0].half_spaces.count = 0;
    ebpo_status status = ebpo_bound_closely(&n->bounders[0], root, &goal, &found, error);
    /* judge_node searches in another way, so it may not accept the root's envelope with found.hi as
     * max_error. Therefore max_error is increased until judge_node accepts the envelope. The loop
     * ends, because judge_node accepts the envelope without queries when max_error is the root
     * cell's diagonal. */
    ebpo_tolerance_node node = { root, true, false };
    double upper = found.hi > 0 ? found.hi : DBL_MIN;
    *out = upper;
    for (double excess = 0x1p-30; status == EBPO_OK && !node.enough; excess *= 2) {
        n->max_error = *out;
        status = judge_node(n, &n->bounders[0], &node, error);
        if (!node.enough)
            *out = upper * (1 + excess);
    }
    return status;
}
