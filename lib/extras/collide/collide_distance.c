/* Computes the distance of two posed models, and a pair of faces at that distance (a nearest pair).
 *
 * The kernels of gap_walk_kernels.c walk through pairs of nodes in floats, and drop pairs that are
 * certainly farther apart than the limit (ebpo_gap_search.limit). The kernels store the remaining
 * pairs of faces as waiting pairs. This file decides the waiting pairs in doubles with error bounds
 * (ebpo_triangles_distance_bounds), and exactly if the bounds of two pairs overlap. If several
 * pairs have the same distance, the first pair in file order is returned. So the result is the same
 * with every processor and number of threads.
 *
 * Partly loaded models are searched in pairs of subtrees, in the order of the gaps of their
 * envelopes. A subtree is loaded only if its envelope is nearer than the best pair so far. A
 * collider keeps the nearest pair of its last query; the next search may begin with this pair.
 * Bounds: docs/develop/collision.md. */
#include "core/strict_fp.h"

#include <math.h>
#include <string.h>

#include <ebpo/base.h>

#include "core/alloc.h"
#include "core/os.h"
#include "core/error.h"
#include "core/fp_env.h"
#include "core/parallel.h"
#include "extras/collide/collider.h"
#include "extras/collide/face_pairs.h"
#include "extras/collide/hierarchy_walk.h"
#include "extras/collide/subtree_search.h"
#include "geometry/triangle_pair.h"

/* Two faces, one of each model. */
typedef struct ebpo_face_two {
    uint64_t file[2];        /* face indices in the files */
    double unposed[2][3][3]; /* corners as in the files */
    double corner[2][3][3];  /* corners at the poses */
    ebpo_pair_distance_bounds bounds;
} ebpo_face_two;

/* The search for the nearest pair of faces, in one pair of hierarchies or in several pairs of
 * hierarchies one after the other. */
typedef struct nearest_pair {
    /* Input: */
    double tolerance;  /* greatest allowed difference of hi and lo; 0: exact */
    double at_least;   /* the search only compares the distance with this value; NAN: the search
                          computes the distance */
    uint64_t deadline; /* deadline, a time of ebpo_clock; UINT64_MAX: none */
    const ebpo_progress *progress;
    /* Output: lo <= distance <= hi, equal if the result is exact. */
    double lo, hi;
    bool found;         /* `best` is set */
    bool intersects;    /* the faces of `best` intersect, but another intersecting pair may precede
                         * `best` in file order */
    int is_at_least;    /* 1: the distance is at least `at_least`; 0: the distance is less; -1: not
                           compared, or undecided */
    ebpo_face_two best; /* if `found`: the nearest pair so far */
    bool ended;         /* the search ended before all pairs were visited */
    double unvisited;   /* if `ended`: lower bound of the distances of the unvisited pairs */
    ebpo_status status; /* failure of the function that reports progress, and its error */
    ebpo_error *error;
} nearest_pair;

/* The three corners of one face of an ebpo_face_two, in the type that functions expect. */
typedef const double (*corners)[3];
#define CORNERS(face, side) ((corners)(face)->corner[side])

/* --- one pair --- */

/* Computes the posed corners and the bounds of the distance of two faces. */
static void pose_faces(const ebpo_posing *const posing[2], ebpo_face_two *out)
{
    for (int i = 0; i < 6; i++)
        ebpo_posing_apply(posing[i / 3], out->unposed[i / 3][i % 3], out->corner[i / 3][i % 3]);
    ebpo_triangles_distance_bounds(CORNERS(out, 0), CORNERS(out, 1), &out->bounds);
}

/* Looks up two faces by their slots, and computes the bounds of their distance. */
static void inspect_slots(const ebpo_gap_search *g, const uint32_t slot[2], ebpo_face_two *out)
{
    const ebpo_posing *posing[2] = { &g->posing[0].posing, &g->posing[1].posing };
    for (int s = 0; s < 2; s++) {
        uint32_t local = ebpo_accel_slot_face(g->accel[s], slot[s]);
        out->file[s] = ebpo_accel_file_face(g->accel[s], local);
        ebpo_accel_triangle(g->accel[s], slot[s], out->unposed[s]);
    }
    pose_faces(posing, out);
}

/* Returns true if the pair f precedes the pair `than` in file order: by the first face's index,
 * then by the second face's index. */
static bool is_earlier(const ebpo_face_two *f, const ebpo_face_two *than)
{
    return f->file[0] != than->file[0] ? f->file[0] < than->file[0] : f->file[1] < than->file[1];
}

/* Returns true if the pair f is nearer than the pair `than`, or if it is equally near and precedes
 * `than` in file order. */
static bool is_nearer(const ebpo_face_two *f, const ebpo_face_two *than)
{
    if (f->bounds.hi < than->bounds.lo)
        return true;
    if (f->bounds.lo > than->bounds.hi)
        return false;
    int order = 0;
    if (!ebpo_same_distance(CORNERS(f, 0), CORNERS(f, 1), &f->bounds, CORNERS(than, 0),
                            CORNERS(than, 1), &than->bounds))
        order = ebpo_triangles_distance_compare(CORNERS(f, 0), CORNERS(f, 1), CORNERS(than, 0),
                                                CORNERS(than, 1));
    return order < 0 || (order == 0 && is_earlier(f, than));
}

/* --- all waiting pairs --- */

/* Converts a distance to the unit of the walk's lengths (ebpo_block_unit), rounded up. */
static float to_unit(const ebpo_gap_search *g, double distance)
{
    return (float)(distance * g->posing[0].unit * (1 + 0x1p-22)) + 0x1p-100f;
}

/* Compares the distance of two disjoint faces with n->at_least. Returns false, to end the search,
 * if the distance is less. */
static bool compare_with_at_least(nearest_pair *n, const ebpo_face_two *f)
{
    if (!(f->bounds.lo < n->at_least) ||
        (!(f->bounds.hi < n->at_least) &&
         ebpo_triangles_distance_compare_to(CORNERS(f, 0), CORNERS(f, 1), n->at_least) >= 0))
        return true;
    n->is_at_least = 0;
    n->best = *f;
    n->found = true;
    return false;
}

/* Updates the result of a search with a tolerance by a pair. If the distance is tiny compared with
 * the faces, the direction of the distance is inaccurate in doubles, and the bounds are wider than
 * the tolerance. Then the bounds are computed from the exact distance. */
static void compare_within_tolerance(nearest_pair *n, const ebpo_face_two *given)
{
    ebpo_face_two f = *given;
    double hi = n->found ? fmin(f.bounds.hi, n->best.bounds.hi) : f.bounds.hi;
    if (f.bounds.lo < hi - n->tolerance) {
        double exact = ebpo_triangles_distance(CORNERS(&f, 0), CORNERS(&f, 1));
        f.bounds.lo = nextafter(exact, 0);
        f.bounds.hi = nextafter(exact, INFINITY);
    }
    n->lo = fmin(n->lo, f.bounds.lo);
    if (!n->found || f.bounds.hi < n->best.bounds.hi)
        n->best = f;
    n->found = true;
}

/* Updates the result by a pair of faces. Returns false if further pairs are not needed. */
static bool consider_faces(nearest_pair *n, const ebpo_face_two *f)
{
    if (!(f->bounds.lo > 0) &&
        ebpo_triangle_pair(CORNERS(f, 0), CORNERS(f, 1)) != EBPO_PAIR_APART) {
        n->best = *f;
        n->found = n->intersects = true;
        return false;
    }
    if (!isnan(n->at_least))
        return compare_with_at_least(n, f);
    if (n->tolerance > 0)
        compare_within_tolerance(n, f);
    else if (!n->found || is_nearer(f, &n->best)) {
        n->best = *f;
        n->found = true;
    }
    return true;
}

/* Decides a waiting pair of faces. Returns false if further pairs are not needed. */
static bool decide_faces(ebpo_gap_search *g, nearest_pair *n, const uint32_t slot[2])
{
    ebpo_face_two f;
    inspect_slots(g, slot, &f);
    ebpo_gap_set_best(g, to_unit(g, f.bounds.hi), slot[0], slot[1]);
    return consider_faces(n, &f);
}

/* Reports progress and checks the deadline. Returns false to end the search. */
static bool continue_search(ebpo_gap_search *g)
{
    nearest_pair *n = g->user;
    if (!ebpo_progress_step(n->progress, "distance", 0, 0, n->error))
        n->status = EBPO_E_CANCELLED;
    g->ended = n->status != EBPO_OK || (n->deadline != UINT64_MAX && ebpo_clock() >= n->deadline);
    return !g->ended;
}

/* Returns the least lower bound of the distances of the waiting pairs from index `first` on. The
 * loop does not use fmin, because gcc 12 for ARM fails to compile a loop with fmin. */
static double least_waiting(const ebpo_gap_search *g, unsigned first)
{
    double least = INFINITY;
    for (unsigned i = first; i < g->waiting_count; i++)
        if ((double)g->waiting[i].low < least)
            least = (double)g->waiting[i].low;
    return fmax(least / g->posing[0].unit * (1 - 0x1p-20), 0);
}

/* Decides the waiting pairs. Calls continue_search after every 16 pairs, because many pairs may
 * wait if models have flat parts. Returns false if further pairs are not needed, or if
 * continue_search returns false. */
static bool decide_waiting(ebpo_gap_search *g)
{
    nearest_pair *n = g->user;
    bool go_on = true;
    unsigned evaluated = 0, i = 0;
    for (; i < g->waiting_count && go_on; i++)
        if (!(g->waiting[i].low > g->limit))
            go_on =
                decide_faces(g, n, g->waiting[i].slot) && (++evaluated % 16 || continue_search(g));
    if (!go_on)
        n->lo = fmin(n->lo, least_waiting(g, i));
    g->waiting_count = 0;
    return go_on;
}

/* --- the result --- */

/* Returns a lower bound of the distance of the pairs that have not been visited. */
static double least_unvisited(const ebpo_gap_search *g)
{
    double least = INFINITY;
    for (uint64_t i = 0; i < g->count; i++)
        if ((double)g->stack[i].key < least)
            least = (double)g->stack[i].key;
    return sqrt(fmax(least, 0)) / g->posing[0].unit * (1 - 0x1p-18);
}

/* Sets lo and hi to the exact distance of the best pair, rounded once. */
static void set_exact_distance(nearest_pair *n)
{
    n->lo = n->hi = ebpo_triangles_distance(CORNERS(&n->best, 0), CORNERS(&n->best, 1));
}

/* Sets lo and hi to bounds of the distance, for a search that has a tolerance or ended early. */
static void set_distance_bounds(nearest_pair *n)
{
    n->hi = n->found ? n->best.bounds.hi : INFINITY;
    n->lo = fmin(fmin(n->lo, n->hi), n->unvisited);
    if (n->tolerance > 0)
        n->lo = fmin(n->lo, n->hi - n->tolerance);
    else if (n->found)
        n->lo = fmin(n->lo, n->best.bounds.lo);
    n->lo = fmax(n->lo, 0);
}

/* Sets the output from the result of the search. */
static void nearest_pair_end(nearest_pair *n)
{
    bool has_threshold = !isnan(n->at_least);
    if (n->intersects) {
        n->lo = n->hi = 0;
        n->is_at_least = has_threshold ? n->at_least <= 0 : -1;
    } else if (has_threshold) {
        if (n->is_at_least < 0 && !n->ended)
            n->is_at_least = 1;
        n->lo = n->is_at_least == 1 ? n->at_least : fmin(n->lo, n->at_least);
        if (n->is_at_least == 1)
            n->hi = INFINITY;
        else
            set_distance_bounds(n);
    } else if (!n->ended && n->tolerance == 0 && n->found)
        set_exact_distance(n);
    else
        set_distance_bounds(n);
}

/* Records an early end of the search. low: lower bound of the distances of the unvisited pairs. */
static void record_unvisited(nearest_pair *n, double low)
{
    n->ended = true;
    n->unvisited = fmin(n->unvisited, low);
}

/* --- the search --- */

/* Begins a search whose input has been set. */
static void nearest_pair_begin(nearest_pair *n)
{
    n->lo = n->unvisited = INFINITY;
    n->found = n->intersects = n->ended = false;
    n->status = EBPO_OK;
    n->is_at_least = -1;
}

/* Updates the result by a pair of faces from an earlier query. Only the members unposed, file and
 * source of `pair` are used. */
static void nearest_pair_start(nearest_pair *n, const ebpo_posing posing[2],
                               const ebpo_face_two *pair)
{
    const ebpo_posing *const posings[2] = { &posing[0], &posing[1] };
    ebpo_face_two f = *pair;
    pose_faces(posings, &f);
    (void)consider_faces(n, &f);
}

/* Records that two faces of `g`, given by their slots, intersect. */
static void nearest_pair_found(nearest_pair *n, const ebpo_gap_search *g, const uint32_t slot[2])
{
    inspect_slots(g, slot, &n->best);
    n->found = n->intersects = true;
}

/* Returns the distance beyond which pairs do not matter any more. */
static double nearest_pair_limit(const nearest_pair *n)
{
    if (!isnan(n->at_least))
        return n->at_least;
    return n->found ? n->best.bounds.hi - n->tolerance : INFINITY;
}

/* Returns true if further pairs cannot change the result. */
static bool nearest_pair_is_done(const nearest_pair *n)
{
    return n->intersects || n->is_at_least >= 0 || n->ended || n->status != EBPO_OK;
}

/* Sets the walk's tolerance, and computes the walk's limit from the result so far. */
static void begin_search(const nearest_pair *n, ebpo_gap_search *g)
{
    g->tolerance = (float)(n->tolerance * g->posing[0].unit * (1 - 0x1p-20));
    if (!isnan(n->at_least)) {
        ebpo_gap_set_limit(g, to_unit(g, n->at_least));
    } else if (n->found) {
        g->best = to_unit(g, n->best.bounds.hi);
        ebpo_gap_set_limit(g, g->best - g->tolerance);
    }
}

/* Decides the pairs that still wait after the walk. With a tolerance, also decides the pair
 * g->best_slot, if the walk has found a pair that is nearer than `before`, the value of g->best at
 * the beginning of the walk. */
static void decide_last(ebpo_gap_search *g, nearest_pair *n, float before)
{
    if (nearest_pair_is_done(n) || !decide_waiting(g) || n->intersects || !isnan(n->at_least))
        return;
    if (n->tolerance > 0 && g->best < before)
        decide_faces(g, n, g->best_slot);
}

/* Continues the search in another pair of hierarchies, for which ebpo_gap_begin has been called.
 * Fails with EBPO_E_MEMORY, EBPO_E_CANCELLED. */
static ebpo_status nearest_pair_search(nearest_pair *n, ebpo_gap_search *g, ebpo_error *error)
{
    g->user = n;
    g->decide_waiting = decide_waiting;
    g->keep_going = continue_search;
    n->error = error;
    begin_search(n, g);
    float before = g->best;
    ebpo_gap_kernels_best()->walk(g);
    if (g->no_memory)
        return ebpo_fail_memory(error, g->capacity * sizeof *g->stack);
    decide_last(g, n, before);
    if (g->ended)
        record_unvisited(n, least_unvisited(g));
    return n->status;
}

static const char stage[] = "distance"; /* for the progress function */

/* The search in pairs of subtrees. */
typedef struct node_search {
    ebpo_subtree_search subtrees;
    nearest_pair *n;
    double hi; /* upper bound of the distance, computed from the cells of nodes with faces */
} node_search;

/* --- two accels (acceleration structures of subtrees) --- */

/* Continues the search in another pair of hierarchies of the query's models. may_intersect: first
 * search for a contact, because lower bounds exclude few pairs if the models intersect. */
static ebpo_status distance_of_accels(const ebpo_collision *q, const ebpo_accel *const accel[2],
                                      bool may_intersect, nearest_pair *n, ebpo_error *error)
{
    ebpo_collider *c = q->collider;
    ebpo_posing posing[2] = { q->posing[0].posing, q->posing[1].posing };
    int32_t intersects = 0;
    if (accel[0]->bound_count == 0 || accel[1]->bound_count == 0)
        return EBPO_OK;
    ebpo_gap_begin(c->gap, accel, posing, q->max_coordinate);
    ebpo_status status =
        may_intersect ? ebpo_collision_first(q, accel, stage, &intersects, error) : EBPO_OK;
    if (status != EBPO_OK)
        return status;
    if (intersects == 1) {
        nearest_pair_found(n, c->gap, c->walk.found_slot);
        return EBPO_OK;
    }
    status = nearest_pair_search(n, c->gap, error);
    c->node_pairs += c->gap->node_pairs;
    c->block_pairs += c->gap->block_pairs;
    return status;
}

/* --- pairs of nodes --- */

/* Loads a pair of subtrees, and continues the search in their hierarchies. */
static ebpo_status search_pair(node_search *s, const ebpo_node_gap *pair, ebpo_error *error)
{
    const ebpo_accel *accel[2];
    bool loaded;
    ebpo_status status = ebpo_subtree_search_load(&s->subtrees, pair->node, accel, &loaded, error);
    return status == EBPO_OK && loaded
               ? distance_of_accels(s->subtrees.collision, accel, pair->gap == 0, s->n, error)
               : status;
}

/* Adds a pair of nodes to the heap if the nodes are near enough. gap: lower bound of the distance
 * of the pair from which the nodes were made. */
static ebpo_status add_node_pair(node_search *s, const ebpo_posed_node node[2], double gap,
                                 ebpo_error *error)
{
    ebpo_node_gaps *nodes = &s->subtrees.nodes;
    ebpo_model *const *model = s->subtrees.collision->model;
    ebpo_node_gap pair = { { node[0], node[1] }, 0 };
    for (int i = 0; i < 2; i++)
        if (ebpo_entry_kind_of(node[i].entry) == EBPO_ENTRY_UNIFORM)
            return EBPO_OK;
    ebpo_status status = ebpo_node_gap_of(nodes, node, &pair.gap, error);
    pair.gap = fmax(pair.gap, gap);
    if (status != EBPO_OK || pair.gap > fmin(s->hi, nearest_pair_limit(s->n)))
        return status;
    if (!model[0]->info->pruned && !model[1]->info->pruned)
        s->hi = fmin(s->hi, ebpo_node_far_bound(nodes, node));
    return ebpo_node_gaps_push(nodes, &pair, error);
}

/* Replaces a pair by the pairs of each child of node `side` with the other node. */
static ebpo_status divide_pair(node_search *s, const ebpo_node_gap *pair, int side,
                               ebpo_error *error)
{
    ebpo_posed_node part[2] = { pair->node[0], pair->node[1] };
    ebpo_status status = EBPO_OK;
    for (unsigned octant = 0; octant < 8 && status == EBPO_OK; octant++) {
        part[side] = ebpo_posed_child(&s->subtrees.nodes.side[side], &pair->node[side], octant);
        status = add_node_pair(s, part, pair->gap, error);
    }
    return status;
}

/* Visits pairs of nodes in the order of their gaps, until the gap of a pair is above the limit. */
static ebpo_status search_subtrees(node_search *s, ebpo_error *error)
{
    ebpo_status status = EBPO_OK;
    ebpo_node_gaps *nodes = &s->subtrees.nodes;
    const ebpo_collision *q = s->subtrees.collision;
    while (nodes->count > 0 && status == EBPO_OK && !nearest_pair_is_done(s->n)) {
        ebpo_node_gap pair = ebpo_node_gaps_pop(nodes);
        int side = ebpo_subtree_search_side(&s->subtrees, pair.node);
        if (pair.gap > nearest_pair_limit(s->n))
            return EBPO_OK;
        if (ebpo_collision_is_late(q))
            record_unvisited(s->n, pair.gap);
        else
            status = side < 0 ? search_pair(s, &pair, error) : divide_pair(s, &pair, side, error);
        if (nearest_pair_is_done(s->n)) /* the pairs that are still in the heap are not visited */
            record_unvisited(s->n, pair.gap);
        if (!ebpo_progress_step(&q->options.progress, stage, 0, 0, error))
            return EBPO_E_CANCELLED;
    }
    return status;
}

/* Searches pairs of subtrees in the order of the gaps of their envelopes, until the gap is greater
 * than the best distance. The result is the same as for models that are entirely in memory. */
static ebpo_status distance_of_subtrees(const ebpo_collision *q, nearest_pair *n, ebpo_error *error)
{
    node_search s = { .n = n, .hi = INFINITY };
    ebpo_status status = ebpo_subtree_search_begin(&s.subtrees, q, error);
    if (status == EBPO_OK) {
        ebpo_posed_node root[2] = { ebpo_posed_root(&s.subtrees.nodes.side[0]),
                                    ebpo_posed_root(&s.subtrees.nodes.side[1]) };
        status = add_node_pair(&s, root, 0, error);
    }
    if (status == EBPO_OK)
        status = search_subtrees(&s, error);
    ebpo_subtree_search_end(&s.subtrees);
    return status;
}

/* --- the query --- */

/* Refuses options that are not numbers in their ranges. */
static ebpo_status check_options(const ebpo_collide_distance_options *o, ebpo_error *error)
{
    if (!(o->tolerance >= 0 && o->tolerance < INFINITY) || isnan(o->at_least))
        return ebpo_fail(
            error, EBPO_E_ARGUMENT,
            "expected a tolerance of the distance that is 0 or more and finite, and an "
            "at_least that is a number");
    return EBPO_OK;
}

/* Sets both points to a common point if the faces cross; otherwise changes nothing. */
static void set_common_point(const ebpo_face_two *f, ebpo_pair_kind kind, double point[2][3])
{
    ebpo_contact_end end[2];
    if (kind != EBPO_PAIR_CROSSING)
        return;
    ebpo_triangle_contact((const double(*)[3])f->corner[0], (const double(*)[3])f->corner[1], end);
    for (int k = 0; k < 3; k++)
        point[0][k] = point[1][k] = end[0].point[k];
}

/* Sets the faces and points of the result to the nearest pair, in the caller's order. */
static void report_pair(const ebpo_collision *q, const nearest_pair *n,
                        ebpo_collide_distance_result *out)
{
    const ebpo_face_two *f = &n->best;
    int a = q->swapped, b = !q->swapped;
    ebpo_pair_kind kind = EBPO_PAIR_APART;
    double point[2][3];
    for (int i = 0; i < 6; i++)
        point[i / 3][i % 3] = f->bounds.point[i / 3][i % 3];
    if (n->intersects) {
        kind =
            ebpo_triangle_pair((const double(*)[3])f->corner[0], (const double(*)[3])f->corner[1]);
        set_common_point(f, kind, point);
    }
    out->pair =
        (ebpo_face_pair){ EBPO_NO_FACE, EBPO_NO_FACE, f->file[a], f->file[b], (int32_t)kind, 0 };
    for (int k = 0; k < 3; k++) {
        out->point_a[k] = point[a][k];
        out->point_b[k] = point[b][k];
    }
}

/* --- from one query to the next --- */

/* Converts a pair between the caller's order and the query's order of the models: returns the pair
 * with its faces exchanged if both orders differ. Only file and unposed are exchanged. */
static ebpo_face_two in_query_order(const ebpo_collision *q, const ebpo_face_two *f)
{
    ebpo_face_two out = *f;
    for (int i = 0; i < 2 && q->swapped; i++) {
        out.file[i] = f->file[!i];
        memcpy(out.unposed[i], f->unposed[!i], sizeof out.unposed[i]);
    }
    return out;
}

/* Stores the nearest pair in the collider, for the next query. */
static ebpo_status keep_nearest(const ebpo_collision *q, const nearest_pair *n, ebpo_error *error)
{
    ebpo_collider *c = q->collider;
    if (!c->nearest)
        c->nearest = ebpo_alloc_zero(1, sizeof *c->nearest);
    if (!c->nearest)
        return ebpo_fail_memory(error, sizeof *c->nearest);
    *c->nearest = in_query_order(q, &n->best);
    return EBPO_OK;
}

/* Begins a search with the nearest pair of the last query. If this pair decides the result, no pair
 * is visited. */
static void start_search(const ebpo_collision *q, nearest_pair *n)
{
    const ebpo_posing posing[2] = { q->posing[0].posing, q->posing[1].posing };
    ebpo_face_two known = in_query_order(q, q->collider->nearest);
    nearest_pair_start(n, posing, &known);
    if (nearest_pair_is_done(n))
        record_unvisited(n, 0);
}

/* --- the search of a query --- */

/* Returns true if a model has faces in its file. */
static bool has_faces(const ebpo_model *m)
{
    return m->whole ? m->whole->bound_count > 0 : m->info->face_count > 0;
}

/* Searches for the nearest pair. warm: begin with the nearest pair of the collider's last query. */
static ebpo_status search_nearest(const ebpo_collision *q, bool warm, nearest_pair *n,
                                  ebpo_error *error)
{
    ebpo_collider *c = q->collider;
    const ebpo_accel *accel[2] = { q->model[0]->whole, q->model[1]->whole };
    if (!c->gap)
        c->gap = ebpo_gap_new();
    if (!c->gap)
        return ebpo_fail_memory(error, sizeof *c->gap);
    if (warm && c->nearest)
        start_search(q, n);
    if (nearest_pair_is_done(n))
        return EBPO_OK;
    return ebpo_collision_is_in_parts(q) ? distance_of_subtrees(q, n, error)
                                         : distance_of_accels(q, accel, true, n, error);
}

ebpo_status ebpo_collide_distance(ebpo_collider *c, const ebpo_collide_options *options,
                                  const ebpo_collide_distance_options *distance_options,
                                  ebpo_collide_distance_result *out, ebpo_error *error)
{
    EBPO_DEFAULT_FP;
    ebpo_collision q;
    ebpo_collide_distance_options wanted = EBPO_COLLIDE_DISTANCE_OPTIONS_INIT;
    *out = (ebpo_collide_distance_result){ .at_least = -1,
                                           .pair = { EBPO_NO_FACE, EBPO_NO_FACE, EBPO_NO_FACE,
                                                     EBPO_NO_FACE, EBPO_PAIR_APART, 0 } };
    ebpo_status status = EBPO_TAKE(ebpo_collide_distance_options, &wanted, distance_options, error);
    if (status == EBPO_OK)
        status = check_options(&wanted, error);
    if (status == EBPO_OK)
        status = ebpo_collision_begin(&q, c, options, error);
    if (status != EBPO_OK)
        return status;
    if (!has_faces(q.model[0]) || !has_faces(q.model[1])) {
        out->distance = ebpo_value_bounds_of(INFINITY, INFINITY);
        out->at_least = wanted.at_least < 0 ? -1 : 1;
        return EBPO_OK;
    }
    nearest_pair n = { .tolerance = wanted.tolerance,
                       .at_least = wanted.at_least < 0 ? NAN : wanted.at_least,
                       .deadline = q.deadline,
                       .progress = &q.options.progress };
    nearest_pair_begin(&n);
    status = search_nearest(&q, wanted.warm, &n, error);
    if (status != EBPO_OK)
        return status;
    nearest_pair_end(&n);
    out->distance = ebpo_value_bounds_of(n.lo, n.hi);
    out->at_least = n.is_at_least;
    if (!n.found)
        return EBPO_OK;
    report_pair(&q, &n, out);
    status = ebpo_collision_find_sources(&q, &out->pair, 1, error);
    return status == EBPO_OK ? keep_nearest(&q, &n, error) : status;
}
