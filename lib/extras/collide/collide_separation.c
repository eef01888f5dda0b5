/* Computes how far one model has to move along a direction until both models have no common point.
 * The distance is given as the time t of the last contact: at the time t, the model has moved by t
 * * direction.
 *
 * A heap holds pairs of nodes; its first pair is the pair whose last contact may be the latest. The
 * extents of the nodes along the direction, and along two axes perpendicular to the direction,
 * bound the time of the nodes' last contact. The last contact of two faces is bounded in doubles
 * (ebpo_sweep_max) and computed exactly (ebpo_sweep_last). Partly loaded models are searched in
 * pairs of subtrees. A subtree is loaded only if the last contact of the subtree's envelope may be
 * later than the latest contact that has been found. A search runs in one thread. Bounds:
 * docs/develop/collision.md, "Separation distance along a direction". */
#include "core/strict_fp.h"

#include <math.h>
#include <stdlib.h>

#include "core/alloc.h"
#include "core/error.h"
#include "core/fp_env.h"
#include "core/sort.h"
#include "core/parallel.h"
#include "extras/collide/collider.h"
#include "extras/collide/face_pairs.h"
#include "extras/collide/subtree_search.h"
#include "geometry/vec3.h"

/* A pair of children of nodes (hierarchy_walk.h). A child is given by its reference: 8 * the node's
 * index + the child's lane. */
typedef struct separation_pair {
    double most;   /* upper bound of the last time at which the two children have a common point */
    uint32_t a, b; /* references of the children */
} separation_pair;

/* A hierarchy, and the map from points of its frame to their components along the three axes of
 * separation_search. */
typedef struct separation_side {
    const ebpo_accel *accel;   /* the hierarchy */
    const ebpo_posing *posing; /* posing of its model */
    double row[3][3], base[3]; /* [axis] a point x has the component row . x + base */
} separation_side;

typedef struct separation_search {
    /* Input: */
    const ebpo_collision *collision;
    double direction[3]; /* direction in which the query's first model moves; the absolute value of
                          * its greatest component is 1/2 to 1 */
    /* Output: the time of the latest contact that has been found, in the unit of `direction`, and
     * its pair of faces. Contacts before time 0 do not count. */
    ebpo_sweep_time last;
    ebpo_face_pair pair; /* faces of the caller's A and B */
    double hi;           /* upper bound of the contact times of pairs that were not visited before
                          * the deadline; negative: all pairs were visited */
    /* Initially 0: */
    separation_side side[2];
    double axis[3][3];      /* three perpendicular unit vectors; the first has the direction */
    double length;          /* length of `direction` */
    double extent_error;    /* greatest distance by which rounding moves ends of extents */
    double earliest;        /* lower bound of `last`, 0 or more; pairs that cannot have a contact at
                             * this time or later are not visited */
    separation_pair *pairs; /* [count] a heap; pairs[0] has the greatest `most` */
    uint64_t count, capacity;
    uint64_t evaluations; /* number of pairs of faces that were compared */
} separation_search;

/* Extents along the three axes. */
typedef struct separation_extent {
    double low[3], high[3];
} separation_extent;

/* --- the heap --- */

static bool is_later(const separation_pair *a, const separation_pair *b)
{
    return a->most > b->most;
}

EBPO_HEAP(heap, separation_pair, is_later)

/* Adds a pair to the heap. Returns false if memory is short. */
static bool push_pair(separation_search *s, const separation_pair *pair)
{
    if (!ebpo_grow(&s->pairs, &s->capacity, s->count + 1, sizeof *s->pairs))
        return false;
    heap_add(s->pairs, s->count++, pair);
    return true;
}

/* --- extents along the three axes --- */

/* Returns the extents of a child in hierarchy `which`. ref: the child's reference. */
static separation_extent extent_of(const separation_search *s, int which, uint32_t ref)
{
    const separation_side *side = &s->side[which];
    const ebpo_bound *b = &side->accel->bound[ref / 8];
    double middle[3], half[3];
    separation_extent out;
    for (int k = 0; k < 3; k++) {
        ebpo_bound_sides ends = ebpo_bound_side(b, (int)(ref % 8), k);
        middle[k] = (ends.low + ends.high) / 2;
        half[k] = (ends.high - ends.low) / 2;
    }
    for (int i = 0; i < 3; i++) {
        const double *row = side->row[i];
        double at = row[0] * middle[0] + row[1] * middle[1] + row[2] * middle[2] + side->base[i],
               width = fabs(row[0]) * half[0] + fabs(row[1]) * half[1] + fabs(row[2]) * half[2];
        out.low[i] = at - width;
        out.high[i] = at + width;
    }
    return out;
}

/* Returns an upper bound of the times at which sets with these extents have a common point;
 * negative if there is no such time. */
static double separation_max(const separation_search *s, const separation_extent *a,
                             const separation_extent *b)
{
    for (int i = 1; i < 3; i++)
        if (b->low[i] - a->high[i] > s->extent_error || a->low[i] - b->high[i] > s->extent_error)
            return -1;
    double along = b->high[0] - a->low[0] + s->extent_error;
    return along < 0 ? -1 : along / s->length * (1 + 0x1p-40);
}

/* Sets axis[0] to the direction d with length 1, and axis[1] and axis[2] to unit vectors that are
 * perpendicular to axis[0] and to each other. */
static void make_axes(const double d[3], double axis[3][3])
{
    double length = sqrt(d[0] * d[0] + d[1] * d[1] + d[2] * d[2]);
    int least = 0;
    for (int k = 0; k < 3; k++) {
        axis[0][k] = d[k] / length;
        least = fabs(d[k]) < fabs(d[least]) ? k : least;
    }
    int u = (least + 1) % 3, v = (least + 2) % 3;
    length = sqrt(axis[0][u] * axis[0][u] + axis[0][v] * axis[0][v]);
    axis[1][least] = 0;
    axis[1][u] = -axis[0][v] / length;
    axis[1][v] = axis[0][u] / length;
    for (int k = 0; k < 3; k++) {
        int p = (k + 1) % 3, q = (k + 2) % 3;
        axis[2][k] = axis[0][p] * axis[1][q] - axis[0][q] * axis[1][p];
    }
}

/* Prepares the map from the frame of a hierarchy of model `which`. */
static void make_side(separation_search *s, int which, const ebpo_accel *accel)
{
    separation_side *side = &s->side[which];
    double centre[3];
    side->accel = accel;
    side->posing = &s->collision->posing[which].posing;
    ebpo_posing_apply(side->posing, side->accel->centre, centre);
    for (int i = 0; i < 3; i++) {
        for (int k = 0; k < 3; k++) {
            double column[3] = { side->posing->matrix[0][k], side->posing->matrix[1][k],
                                 side->posing->matrix[2][k] };
            side->row[i][k] = ebpo_vec3_dot(s->axis[i], column) / side->accel->scale;
        }
        side->base[i] = ebpo_vec3_dot(s->axis[i], centre);
    }
}

/* --- faces --- */

/* Returns true if a pair precedes s->pair: by the index of the face of the query's first model,
 * then by the index of the other face. */
static bool is_earlier_pair(const separation_search *s, const ebpo_found_pair *pair)
{
    uint64_t a = ebpo_accel_file_face(s->side[0].accel, pair->a),
             b = ebpo_accel_file_face(s->side[1].accel, pair->b);
    const uint64_t known[2] = { s->pair.file_face_a, s->pair.file_face_b };
    bool swapped = s->collision->swapped;
    return a != known[swapped] ? a < known[swapped] : b < known[!swapped];
}

/* Computes the last contact of two faces. Sets s->last and s->pair if the contact is later than
 * s->last, or if it is at the same time and the pair precedes s->pair. */
static void inspect_faces(separation_search *s, const double a[3][3], const double b[3][3],
                          const ebpo_found_pair *pair)
{
    double most = ebpo_sweep_max(a, b, s->direction, INFINITY);
    ebpo_sweep_time t;
    s->evaluations++;
    if (most < s->earliest)
        return;
    ebpo_sweep_time_init(&t);
    ebpo_sweep_last(a, b, s->direction, &t);
    int order = t.ever && mpz_sgn(t.numerator) >= 0 ? ebpo_sweep_time_compare(&t, &s->last) : -1;
    if (order > 0 || (order == 0 && is_earlier_pair(s, pair))) {
        mpz_swap(t.numerator, s->last.numerator);
        mpz_swap(t.denominator, s->last.denominator);
        s->last.unit = t.unit;
        s->last.ever = true;
        s->pair = ebpo_collision_pair(s->collision, s->side[0].accel, s->side[1].accel, pair);
        s->earliest = fmax(0, nextafter(ebpo_sweep_time_round(&s->last), 0));
    }
    ebpo_sweep_time_clear(&t);
}

/* Computes the last contacts of all pairs of faces of two blocks. */
static void inspect_blocks(separation_search *s, uint32_t block_a, uint32_t block_b)
{
    const uint32_t block[2] = { block_a, block_b };
    const ebpo_meshlet *m[2];
    double corner[2][EBPO_BLOCK][3][3];
    for (int i = 0; i < 2; i++) {
        m[i] = ebpo_accel_meshlet(s->side[i].accel, block[i]);
        for (uint32_t lane = 0; lane < m[i]->faces; lane++)
            ebpo_posed_triangle(s->side[i].accel, s->side[i].posing, block[i] * EBPO_BLOCK + lane,
                                corner[i][lane]);
    }
    for (uint32_t i = 0; i < m[0]->faces; i++)
        for (uint32_t j = 0; j < m[1]->faces; j++) {
            ebpo_found_pair pair = { m[0]->face + i, m[1]->face + j, EBPO_PAIR_APART };
            inspect_faces(s, (const double(*)[3])corner[0][i], (const double(*)[3])corner[1][j],
                          &pair);
        }
}

/* --- the search --- */

/* Returns a child's entry: the index of a node, or the index of a block with EBPO_IS_BLOCK. */
static uint32_t child_of(const separation_search *s, int which, uint32_t ref)
{
    return s->side[which].accel->bound[ref / 8].child[ref % 8];
}

/* Returns the sum of the lengths of three extents. */
static double size_of(const separation_extent *e)
{
    return e->high[0] - e->low[0] + (e->high[1] - e->low[1]) + (e->high[2] - e->low[2]);
}

/* Adds to the heap the pairs of each child of `node`, a node of model `which`, with `other`, the
 * reference of a child in the other model. Omits pairs that cannot have a contact at the time
 * s->earliest or later. */
static ebpo_status offer_children(separation_search *s, int which, uint32_t node, uint32_t other,
                                  ebpo_error *error)
{
    separation_extent extent[2];
    extent[!which] = extent_of(s, !which, other);
    for (uint32_t i = 0; i < s->side[which].accel->bound[node].count; i++) {
        uint32_t ref[2];
        ref[which] = node * 8 + i;
        ref[!which] = other;
        extent[which] = extent_of(s, which, ref[which]);
        separation_pair pair = { separation_max(s, &extent[0], &extent[1]), ref[0], ref[1] };
        if (pair.most < s->earliest)
            continue;
        if (!push_pair(s, &pair))
            return ebpo_fail_memory(error, s->capacity * sizeof *s->pairs);
    }
    return EBPO_OK;
}

/* Compares the faces of a pair of two blocks. In a pair of a block and a node, divides the node; in
 * a pair of two nodes, divides the larger node. */
static ebpo_status divide_pair(separation_search *s, const separation_pair *pair, ebpo_error *error)
{
    uint32_t child[2] = { child_of(s, 0, pair->a), child_of(s, 1, pair->b) };
    bool block[2] = { child[0] & EBPO_IS_BLOCK, child[1] & EBPO_IS_BLOCK };
    if (block[0] && block[1]) {
        inspect_blocks(s, child[0] & ~EBPO_IS_BLOCK, child[1] & ~EBPO_IS_BLOCK);
        return EBPO_OK;
    }
    separation_extent a = extent_of(s, 0, pair->a), b = extent_of(s, 1, pair->b);
    int which = block[0] || (!block[1] && size_of(&b) > size_of(&a));
    return offer_children(s, which, child[which], which ? pair->a : pair->b, error);
}

/* Begins a search. The caller must clear s->last by ebpo_sweep_time_clear. */
static void separation_search_begin(separation_search *s)
{
    ebpo_sweep_time_init(&s->last);
    make_axes(s->direction, s->axis);
    s->length = ebpo_vec3_dot(s->axis[0], s->direction);
    s->extent_error = 0x1p-40 * s->collision->max_coordinate;
    s->hi = -1;
    s->pair = (ebpo_face_pair){ EBPO_NO_FACE, EBPO_NO_FACE,    EBPO_NO_FACE,
                                EBPO_NO_FACE, EBPO_PAIR_APART, 0 };
}

/* Adds the pairs of children of both top nodes to the heap. */
static ebpo_status offer_tops(separation_search *s, ebpo_error *error)
{
    ebpo_status status = EBPO_OK;
    const ebpo_accel *b = s->side[1].accel;
    for (uint32_t j = 0; j < b->bound[b->root_bound].count && status == EBPO_OK; j++)
        status = offer_children(s, 0, s->side[0].accel->root_bound, b->root_bound * 8 + j, error);
    return status;
}

/* Searches a pair of hierarchies of the query's models, until no pair in the heap can have a later
 * contact or the deadline has passed. Fails with EBPO_E_MEMORY, EBPO_E_CANCELLED. */
static ebpo_status separation_search_run(separation_search *s, const ebpo_accel *const accel[2],
                                         ebpo_error *error)
{
    const ebpo_progress *progress = &s->collision->options.progress;
    if (accel[0]->bound_count == 0 || accel[1]->bound_count == 0)
        return EBPO_OK;
    for (int i = 0; i < 2; i++)
        make_side(s, i, accel[i]);
    ebpo_status status = offer_tops(s, error);
    while (status == EBPO_OK && s->count > 0 && s->pairs[0].most >= s->earliest) {
        if (ebpo_collision_is_late(s->collision))
            break;
        if (s->evaluations % 64 == 0 &&
            !ebpo_progress_step(progress, "separation distance", 0, 0, error)) {
            status = EBPO_E_CANCELLED;
            break;
        }
        separation_pair pair = heap_take(s->pairs, s->count--);
        status = divide_pair(s, &pair, error);
    }
    if (s->count > 0 && s->pairs[0].most >= s->earliest)
        s->hi = fmax(s->hi, s->pairs[0].most);
    free(s->pairs);
    s->pairs = NULL;
    s->count = s->capacity = 0;
    return status;
}

/* --- pairs of subtrees --- */

/* The search in pairs of subtrees. A subtree lists the faces that have a point in its cell.
 * Therefore the last common point of two moving faces is, in each model, in the cell of a subtree
 * that lists the model's face. The envelopes of both subtrees contain the point, so the last
 * contact of the envelopes is not earlier than the last contact of the faces. */
typedef struct node_search {
    ebpo_subtree_search
        subtrees; /* a heap whose least gap comes first; here, ebpo_node_gap.gap is -1 times an
                     upper bound of the time of the envelopes' last contact */
    separation_search *search;
} node_search;

/* Computes the extents of the envelope of a node. */
static ebpo_status cell_extent(node_search *s, int which, ebpo_cell cell, separation_extent *out,
                               ebpo_error *error)
{
    ebpo_posed_subtrees *side = &s->subtrees.nodes.side[which];
    ebpo_convex hull;
    double slack = ebpo_posed_slack(side, cell, s->subtrees.collision->max_coordinate);
    ebpo_status status = ebpo_posed_envelope(side, cell, &hull, error);
    for (int i = 0; i < 3 && status == EBPO_OK; i++) {
        const double *axis = s->search->axis[i];
        out->low[i] = INFINITY;
        out->high[i] = -INFINITY;
        for (int v = 0; v < hull.count; v++) {
            const double *x = hull.point[v];
            double at = axis[0] * x[0] + axis[1] * x[1] + axis[2] * x[2];
            out->low[i] = fmin(out->low[i], at - slack);
            out->high[i] = fmax(out->high[i], at + slack);
        }
    }
    return status;
}

/* Adds a pair of nodes to the heap, if both nodes have faces and their envelopes may have a contact
 * at the time s->search->earliest or later. */
static ebpo_status add_node_pair(node_search *s, const ebpo_posed_node node[2], ebpo_error *error)
{
    separation_extent extent[2];
    for (int i = 0; i < 2; i++) {
        if (ebpo_entry_kind_of(node[i].entry) == EBPO_ENTRY_UNIFORM)
            return EBPO_OK;
        ebpo_status status = cell_extent(s, i, node[i].cell, &extent[i], error);
        if (status != EBPO_OK)
            return status;
    }
    ebpo_node_gap pair = { { node[0], node[1] },
                           -separation_max(s->search, &extent[0], &extent[1]) };
    return -pair.gap < s->search->earliest ? EBPO_OK
                                           : ebpo_node_gaps_push(&s->subtrees.nodes, &pair, error);
}

/* Adds the pairs of each child of node `side` with the other node of a pair. */
static ebpo_status divide_node_pair(node_search *s, const ebpo_node_gap *pair, int side,
                                    ebpo_error *error)
{
    ebpo_posed_node part[2] = { pair->node[0], pair->node[1] };
    ebpo_status status = EBPO_OK;
    for (unsigned octant = 0; octant < 8 && status == EBPO_OK; octant++) {
        part[side] = ebpo_posed_child(&s->subtrees.nodes.side[side], &pair->node[side], octant);
        status = add_node_pair(s, part, error);
    }
    return status;
}

/* Divides a pair of nodes, or, if both nodes are roots of subtrees, searches the subtrees. */
static ebpo_status inspect_pair(node_search *s, const ebpo_node_gap *pair, ebpo_error *error)
{
    const ebpo_accel *accel[2];
    bool loaded;
    int side = ebpo_subtree_search_side(&s->subtrees, pair->node);
    if (side >= 0)
        return divide_node_pair(s, pair, side, error);
    ebpo_status status = ebpo_subtree_search_load(&s->subtrees, pair->node, accel, &loaded, error);
    return status == EBPO_OK && loaded ? separation_search_run(s->search, accel, error) : status;
}

/* Visits pairs of nodes in the order of the bounds of their last contacts, the latest first. */
static ebpo_status search_node_pairs(node_search *s, ebpo_error *error)
{
    const ebpo_collision *q = s->subtrees.collision;
    ebpo_node_gaps *nodes = &s->subtrees.nodes;
    ebpo_posed_node root[2] = { ebpo_posed_root(&nodes->side[0]),
                                ebpo_posed_root(&nodes->side[1]) };
    ebpo_status status = add_node_pair(s, root, error);
    while (status == EBPO_OK && nodes->count > 0) {
        ebpo_node_gap pair = ebpo_node_gaps_pop(nodes);
        if (-pair.gap < s->search->earliest)
            return EBPO_OK;
        if (ebpo_collision_is_late(q)) {
            s->search->hi = fmax(s->search->hi, -pair.gap);
            return EBPO_OK;
        }
        status = inspect_pair(s, &pair, error);
        if (!ebpo_progress_step(&q->options.progress, "separation distance", 0, 0, error))
            return EBPO_E_CANCELLED;
    }
    return status;
}

/* Searches pairs of subtrees, until no pair of envelopes can have a contact after the latest
 * contact that has been found. The result is the same as for models that are entirely in memory. */
static ebpo_status separation_of_subtrees(separation_search *search, ebpo_error *error)
{
    node_search s = { .search = search };
    ebpo_status status = ebpo_subtree_search_begin(&s.subtrees, search->collision, error);
    if (status == EBPO_OK)
        status = search_node_pairs(&s, error);
    ebpo_subtree_search_end(&s.subtrees);
    return status;
}

/* --- the query --- */

/* Sets s->direction to 2^-exponent times the direction in which the query's first model moves, and
 * returns the exponent. direction: the direction in which the caller's A moves. */
static int set_direction(separation_search *s, const double direction[3])
{
    int exponent;
    (void)frexp(fmax(fabs(direction[0]), fmax(fabs(direction[1]), fabs(direction[2]))), &exponent);
    for (int k = 0; k < 3; k++)
        s->direction[k] =
            ldexp(s->collision->swapped ? -direction[k] : direction[k], -exponent) + 0.0;
    return exponent;
}

/* Sets the caller's result. exponent: result of set_direction. */
static void fill_separation(const separation_search *s, int exponent, ebpo_separation *out)
{
    double lo = 0, hi = ldexp(s->hi, -exponent) * (1 + 0x1p-50);
    *out = (ebpo_separation){ .pair = s->pair };
    if (s->last.ever) {
        ebpo_sweep_time t = s->last;
        t.unit -= exponent;
        lo = ebpo_sweep_time_round(&t);
    }
    out->t = ebpo_value_bounds_of(lo, s->hi < 0 ? lo : fmax(lo, hi));
}

ebpo_status ebpo_collide_separation(ebpo_collider *c, const ebpo_collide_options *options,
                                    const double direction[3], ebpo_separation *out,
                                    ebpo_error *error)
{
    EBPO_DEFAULT_FP;
    ebpo_collision q;
    double size = fabs(direction[0]) + fabs(direction[1]) + fabs(direction[2]);
    if (!(size > 0x1p-500 && size < 0x1p500))
        return ebpo_fail(
            error, EBPO_E_ARGUMENT,
            "expected a direction of three numbers whose absolute values have a sum of "
            "2^-500 to 2^500");
    ebpo_status status = ebpo_collision_begin(&q, c, options, error);
    if (status != EBPO_OK)
        return status;
    separation_search s = { .collision = &q };
    int exponent = set_direction(&s, direction);
    separation_search_begin(&s);
    const ebpo_accel *const whole[2] = { q.model[0]->whole, q.model[1]->whole };
    status = ebpo_collision_is_in_parts(&q) ? separation_of_subtrees(&s, error)
                                            : separation_search_run(&s, whole, error);
    if (status == EBPO_OK)
        fill_separation(&s, exponent, out);
    if (status == EBPO_OK && out->pair.file_face_a != EBPO_NO_FACE)
        status = ebpo_collision_find_sources(&q, &out->pair, 1, error);
    ebpo_sweep_time_clear(&s.last);
    return status;
}
