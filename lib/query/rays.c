/* Finds the first face that a ray hits, any hit, or all hits; and evaluates many rays on all cores.
 * A hit is a point origin + t * direction of a face.
 *
 * On the way down the tree, tests are conservative: a node is skipped only if the ray certainly
 * misses its cell, or if the cell is beyond the limit of t. In an accel (acceleration structure of
 * a subtree, accel.h), a filter in single precision (ray_kernels.c) excludes all but a few faces.
 * Exact predicates test these candidates, beginning with the least lower bound of t. Hits are
 * ordered by t, then by the face's index in the file. Many rays are divided among threads; each
 * thread takes some rays at a time and uses a separate context. Results do not depend on the number
 * of threads. Error bounds: docs/develop/bounds.md. */
#include "core/strict_fp.h"

#include <inttypes.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "core/alloc.h"
#include "core/error.h"
#include "core/fp_env.h"
#include "core/parallel.h"
#include "core/sort.h"
#include "geometry/expansion.h"
#include "geometry/ray.h"
#include "query/load_ahead.h"
#include "query/query_kernels.h"
#include "query/query_model.h"
#include "query/query_node.h"

/* A face that the ray hits, with the data for an exact comparison with other hits. */
struct ebpo_ray_found {
    double triangle[3][3];
    uint64_t file_face; /* index in the file */
    ebpo_ray_intersection intersection;
    /* Hits with the same number are in one corner or edge, so at the same t. 0: any other hit. */
    unsigned shared;
};

/* Maximum number of subtrees that a round requests: some megabytes of data. */
enum { MISSING_MAX = 128 };

/* State of a subtree in rounds. MISSING: the next hint requests it. PENDING: its bytes were
 * requested and are not available yet. */
typedef enum subtree_state {
    SUBTREE_UNKNOWN,
    SUBTREE_MISSING,
    SUBTREE_REQUESTED,
    SUBTREE_PENDING
} subtree_state;

/* The subtrees of a remote file that rays request together, round by round (cast_in_rounds). */
typedef struct ray_rounds {
    uint8_t *state; /* [top->below_count] */
    uint32_t missing[MISSING_MAX];
    unsigned missing_count;
    bool lacks_maps;    /* rays wait for chunks with the source indices of their hits */
    uint64_t map_chunk; /* number of the last of these chunks */
    ebpo_hints maps;    /* these chunks */
} ray_rounds;

/* A query with one ray. */
typedef struct casting {
    ebpo_context *context;
    ebpo_segment ray;
    ebpo_ray_wants wants;
    ebpo_ray_sides sides; /* only hits of these sides of faces count */
    double limit;         /* hits with a greater t are not needed; decreases during the search */
    bool done;            /* the search is complete */
    ray_rounds *rounds;   /* the rounds of rays through a remote file; or NULL */
    bool waits;           /* the ray waits for the next round */
    bool no_memory;
    /* the last corner or edge in which the ray was found to intersect a face, and the number of
     * such parts so far: the ray intersects most other faces around it, at the same t */
    ebpo_ray_shared shared;
    unsigned shared_count;
    uint64_t count;       /* number of hits that are kept */
    ebpo_ray_found first; /* EBPO_WANTS_FIRST: the first hit so far, if count > 0 */
    /* EBPO_WANTS_ALL: an array of the context or of a group of rays with the hits; its capacity */
    ebpo_ray_found **found;
    uint64_t *capacity;
} casting;

static inline void casting_begin(casting *c, ebpo_context *context, const double origin[3],
                                 const double direction[3], double t_max, ebpo_ray_wants wants,
                                 ebpo_ray_sides sides)
{
    c->context = context;
    memcpy(c->ray.origin, origin, sizeof c->ray.origin);
    memcpy(c->ray.direction, direction, sizeof c->ray.direction);
    c->ray.t_max = c->limit = t_max;
    c->wants = wants;
    c->sides = sides;
    c->done = c->waits = c->no_memory = false;
    c->rounds = NULL;
    c->shared.count = c->shared_count = 0;
    c->count = 0;
    c->found = &context->unsorted_hits;
    c->capacity = &context->found_capacity;
}

static inline ebpo_status give_hit(const casting *c, const ebpo_ray_found *m, ebpo_ray_hit *out,
                                   ebpo_error *error)
{
    *out = (ebpo_ray_hit){ m->intersection.t, EBPO_NO_FACE, m->intersection.side };
    return ebpo_model_source_face(c->context->model, m->file_face, &out->face, error);
}

/* --- one ray through one accel: limits --- */

/* Converts t to the frame (coordinates in which the subtree's cell has a size of 1 to 2), relative
 * to the moved origin. With `sign` 1, the result is at least the exact value; with -1, it is at
 * most the exact value. */
static float frame_t(const ebpo_ray_search *r, double t, int sign)
{
    double scaled = t * r->limit_scale;
    if (!(r->limit_scale > 0 && r->limit_scale < INFINITY && scaled < (double)EBPO_RAY_BEYOND))
        return sign > 0 || t == INFINITY ? EBPO_RAY_BEYOND : -1;
    double relative = scaled - r->moved + sign * (0x1p-50 * (scaled + r->moved) + 0x1p-90);
    return (float)(relative + sign * fabs(relative) * 0x1p-22);
}

/* Lowers r->bound to r->limit. */
static void lower_bound(ebpo_ray_search *r)
{
    float bound = frame_t(r, r->limit, 1);
    r->bound = bound < r->bound ? bound : r->bound;
}

/* --- the ray in the frame --- */

/* Returns the maximum, without a function call. */
static inline double greater_of(double a, double b) { return a > b ? a : b; }

/* Scales a very long or very short direction by a power of two. Scales only if necessary, because
 * scaling delays all later steps. */
static void scale_direction(ebpo_ray_search *r, double longest)
{
    int exponent;
    frexp(longest, &exponent);
    for (int k = 0; k < 3; k++)
        r->direction[k] = ldexp(r->ray->direction[k], -exponent);
    r->limit_scale = ldexp(r->s->scale, exponent);
}

/* Transforms the ray to the frame. Returns the largest absolute coordinate of the origin. */
static double to_frame(ebpo_ray_search *r)
{
    const ebpo_accel *s = r->s;
    double longest = 0, greatest = 0;
    for (int k = 0; k < 3; k++) {
        r->direction[k] = r->ray->direction[k];
        longest = greater_of(longest, fabs(r->direction[k]));
        r->from[k] = r->ray->origin[k];
        r->origin[k] = (r->ray->origin[k] - s->centre[k]) * s->scale;
        greatest = greater_of(greatest, fabs(r->origin[k]));
    }
    r->limit_scale = s->scale;
    if (!(longest >= EBPO_RAY_SHORTEST && longest <= EBPO_RAY_LONGEST))
        scale_direction(r, longest);
    r->moved = 0;
    return greatest;
}

/* Sets *t to a value shortly before the ray reaches the first faces: the t at which the ray enters
 * the cube from -2 * `largest` to 2 * `largest`. `largest`: upper bound of the faces' coordinates.
 * Returns false if the ray misses the cube. The rounding error of *t is far smaller than the margin
 * between faces and cube. (An origin that is too far away for this computation is not moved: see
 * place_ray.) */
static bool enters_cube(const ebpo_ray_search *r, double largest, double *t)
{
    double from = 0, to = INFINITY;
    for (int k = 0; k < 3; k++) {
        double cell_face = 2 * largest * (r->direction[k] < 0 ? -1 : 1);
        if (r->direction[k] == 0) {
            if (fabs(r->origin[k]) > 2 * largest)
                return false;
            continue;
        }
        from = fmax(from, (-cell_face - r->origin[k]) / r->direction[k]);
        to = fmin(to, (cell_face - r->origin[k]) / r->direction[k]);
    }
    *t = from;
    return from <= to;
}

/* Moves the origin along the ray towards the faces, in double-double arithmetic, so that the
 * original distance of the origin hardly adds to the error. Returns false if the ray misses all
 * faces. */
static bool move_origin(ebpo_ray_search *r, double *greatest)
{
    const ebpo_accel *s = r->s;
    double t;
    if (!enters_cube(r, s->largest_coordinate, &t))
        return false;
    r->moved = t;
    *greatest = 0;
    for (int k = 0; k < 3; k++) {
        ebpo_pair from = ebpo_two_difference(r->ray->origin[k], s->centre[k]),
                  step = ebpo_two_product(t, r->direction[k]);
        from = (ebpo_pair){ from.head * s->scale, from.tail * s->scale };
        r->origin[k] = ebpo_pair_add(from, step).head;
        *greatest = greater_of(*greatest, fabs(r->origin[k]));
        r->from[k] = s->centre[k] + r->origin[k] / s->scale;
    }
    return true;
}

/* Sets the error of the origin. `greatest`: as in ebpo_ray_error. */
static void set_error(ebpo_ray_search *r, double greatest)
{
    r->error = ebpo_ray_error(r->s, greatest);
    r->blur = greatest < 0x1p30 ? ebpo_ray_blur(r->error) : INFINITY;
    if (greatest < 0x1p80)
        return;
    r->error = (double)EBPO_RAY_BEYOND; /* the ray may intersect all boxes */
    memset(r->origin, 0, sizeof r->origin);
}

/* --- candidates --- */

/* Tests all waiting candidates. If only the first hit is wanted, begins with the candidate with the
 * least lower bound, because its hit may exclude other candidates. */
static void judge_waiting(ebpo_ray_search *r)
{
    while (r->count && !r->done) {
        int first = 0;
        for (int i = 1; i < r->count && r->wants == EBPO_WANTS_FIRST; i++)
            first = r->waiting[i].low < r->waiting[first].low ? i : first;
        ebpo_ray_candidate c = r->waiting[first];
        r->waiting[first] = r->waiting[--r->count];
        if (c.low > r->bound)
            continue;
        double before = r->limit;
        r->decide(r, c.slot, c.facing);
        if (r->limit < before)
            lower_bound(r);
    }
    r->count = 0;
}

/* Sets the fields of the frame (ebpo_ray_search.place). */
static bool place_ray(ebpo_ray_search *r)
{
    const ebpo_accel *s = r->s;
    double greatest = to_frame(r);
    if (!(greatest <= EBPO_RAY_NEAR * s->largest_coordinate) &&
        greatest < 0x1p46 * s->largest_coordinate && !move_origin(r, &greatest))
        return false;
    set_error(r, greatest);
    r->surely = frame_t(r, r->ray->t_max, -1);
    r->bound = EBPO_RAY_BEYOND;
    lower_bound(r);
    return true;
}

/* Returns true if the ray hits m->triangle from a side that counts (casting.sides); sets
 * m->intersection and m->shared. `facing`: the side, if it is already certain that the line goes
 * through the face's interior; otherwise 0. */
static bool casting_intersects(casting *c, int facing, ebpo_ray_found *m)
{
    const double(*triangle)[3] = (const double(*)[3])m->triangle;
    m->shared = 0;
    if (facing)
        ebpo_ray_interior(&c->ray, triangle, facing, &m->intersection);
    else if (c->shared.count && ebpo_ray_shares(&c->ray, &c->shared, triangle, &m->intersection))
        m->shared = c->shared_count;
    else {
        ebpo_ray_triangle(&c->ray, triangle, &m->intersection);
        if (m->intersection.part) {
            ebpo_ray_share(triangle, &m->intersection, &c->shared);
            m->shared = ++c->shared_count;
        }
    }
    return m->intersection.intersects &&
           (c->sides == EBPO_RAY_BOTH ||
            m->intersection.facing == (c->sides == EBPO_RAY_FRONT ? 1 : -1));
}

/* Orders by t, then by the order of the file. */
static int compare_found(const void *a, const void *b, void *ray)
{
    const ebpo_ray_found *x = a, *y = b;
    int sign = x->shared && x->shared == y->shared
                   ? 0
                   : ebpo_ray_compare(ray, (const double(*)[3])x->triangle, &x->intersection,
                                      (const double(*)[3])y->triangle, &y->intersection);
    return sign ? sign : (x->file_face > y->file_face) - (x->file_face < y->file_face);
}

/* Keeps a hit if it is the first hit so far, and lowers the limit. */
static void keep_first(casting *c, const ebpo_ray_found *m)
{
    if (c->count && compare_found(m, &c->first, &c->ray) >= 0)
        return;
    if (c->count)
        c->first = *m;
    c->count = 1;
    double limit = m->intersection.t * (1 + 0x1p-48) + DBL_MIN;
    c->limit = limit < c->limit ? limit : c->limit;
}

/* Keeps a hit, if it is wanted. */
static void casting_keep(casting *c, const ebpo_ray_found *m)
{
    if (c->wants == EBPO_WANTS_FIRST) {
        keep_first(c, m);
    } else if (c->wants == EBPO_WANTS_ANY) {
        c->count = 1;
        c->done = true;
    } else if (ebpo_grow(c->found, c->capacity, c->count + 1, sizeof **c->found)) {
        (*c->found)[c->count++] = *m;
    } else {
        c->done = c->no_memory = true;
    }
}

/* Orders by the rounded t, then by the order of the file. */
static int compare_rounded(const void *a, const void *b, void *unused)
{
    const ebpo_ray_found *x = a, *y = b;
    (void)unused;
    if (x->intersection.t != y->intersection.t)
        return x->intersection.t < y->intersection.t ? -1 : 1;
    return (x->file_face > y->file_face) - (x->file_face < y->file_face);
}

/* Sorts by insertion, which is fast for a few hits in nearly the right order. */
static void insert_found(ebpo_ray_found *found, uint64_t count,
                         int (*compare)(const void *, const void *, void *), ebpo_segment *ray)
{
    for (uint64_t i = 1; i < count; i++) {
        uint64_t at = i;
        if (compare(&found[i - 1], &found[i], ray) <= 0)
            continue;
        ebpo_ray_found m = found[i];
        do {
            found[at] = found[at - 1];
            at--;
        } while (at > 0 && compare(&found[at - 1], &m, ray) > 0);
        found[at] = m;
    }
}

/* Sorts hits. A few hits are first sorted by their rounded t. After this, the exact order rarely
 * differs, so nearly all exact comparisons, which are slow, are between neighbours. */
static void sort_found(ebpo_ray_found *found, uint64_t count, ebpo_segment *ray)
{
    if (count > 16) {
        ebpo_sort_with(found, count, sizeof *found, compare_found, ray);
        return;
    }
    insert_found(found, count, compare_rounded, NULL);
    insert_found(found, count, compare_found, ray);
}

/* Writes all hits in order, without duplicates, to context->hits from `begin` to *end. */
static ebpo_status casting_sort(casting *c, uint64_t begin, uint64_t *end, ebpo_error *error)
{
    ebpo_context *k = c->context;
    *end = begin;
    if (!ebpo_grow(&k->hits, &k->hit_capacity, begin + c->count, sizeof *k->hits))
        return ebpo_fail_memory(error, (begin + c->count) * sizeof *k->hits);
    const ebpo_ray_found *found = *c->found;
    sort_found(*c->found, c->count, &c->ray);
    ebpo_status status = EBPO_OK;
    for (uint64_t i = 0; i < c->count && status == EBPO_OK; i++)
        /* A face that several subtrees list may be hit several times. */
        if (i == 0 || found[i].file_face != found[i - 1].file_face)
            status = give_hit(c, &found[i], &k->hits[(*end)++], error);
    return status;
}

/* Returns the same as ray_fault, more slowly. */
static const char *ray_fault_of(const double o[3], const double d[3], double t_max)
{
    double not_finite = 0, longest = 0; /* not_finite: 0, or NaN if a coordinate is not finite */
    for (int k = 0; k < 3; k++) {
        not_finite += o[k] * 0 + d[k] * 0;
        longest = fabs(d[k]) > longest ? fabs(d[k]) : longest;
    }
    if (not_finite != 0)
        return "has a coordinate that is not a finite number";
    if (longest == 0)
        return "needs a direction other than (0, 0, 0)";
    return t_max >= 0 ? NULL : "needs a t_max of 0 or more";
}

/* Returns NULL for a valid ray, otherwise the end of an error message ("the ray ..."). */
static inline const char *ray_fault(const double o[3], const double d[3], double t_max)
{
    double far = fabs(o[0]) + fabs(o[1]) + fabs(o[2]), size = fabs(d[0]) + fabs(d[1]) + fabs(d[2]);
    if (size > 0 && far + size < INFINITY && t_max >= 0)
        return NULL;
    return ray_fault_of(o, d, t_max);
}

/* Returns false if the ray misses the box [low, high], enlarged by `slack`, for all t in 0 ..
 * limit. *enter, *leave: t where the ray enters and leaves the box; *leave is at most `limit`. */
static bool intersects_box(const double origin[3], const double direction[3], double limit,
                           const double low[3], const double high[3], double slack, double *enter,
                           double *leave)
{
    double from = 0, to = limit;
    for (int k = 0; k < 3; k++) {
        double a = low[k] - slack - origin[k], b = high[k] + slack - origin[k];
        if (direction[k] == 0) {
            if (a > 0 || b < 0)
                return false;
            continue;
        }
        double t0 = a / direction[k], t1 = b / direction[k];
        from = fmax(from, fmin(t0, t1) - fabs(fmin(t0, t1)) * 0x1p-50);
        to = fmin(to, fmax(t0, t1) + fabs(fmax(t0, t1)) * 0x1p-50);
    }
    *enter = from;
    *leave = to;
    return from <= to;
}

/* Tests a candidate exactly (ebpo_ray_search.decide). The first hit is made where it will be kept.
 */
static void decide_face(ebpo_ray_search *r, uint32_t slot, int facing)
{
    casting *c = r->user;
    ebpo_ray_found other, *m = c->count ? &other : &c->first;
    uint32_t local = ebpo_accel_slot_face(r->s, slot);
    ebpo_accel_triangle(r->s, slot, m->triangle);
    if (!casting_intersects(c, facing, m))
        return;
    m->file_face = ebpo_accel_file_face(r->s, local);
    casting_keep(c, m);
    r->done = c->done;
    r->limit = c->limit;
}

/* Returns the value of ebpo_ray_search.facing. */
static int facing_of(ebpo_ray_sides sides)
{
    return sides == EBPO_RAY_BOTH ? 0 : sides == EBPO_RAY_FRONT ? 1 : -1;
}

/* Prepares the search of the faces of a subtree or of the whole model. The caller calls a kernel
 * and then end_search, which call decide_face for every face that may be a wanted hit. */
static inline void begin_search(casting *c, ebpo_ray_search *r, const ebpo_accel *s)
{
    r->ray = &c->ray;
    r->wants = c->wants;
    r->facing = facing_of(c->sides);
    r->limit = c->limit;
    r->decide = decide_face;
    r->judge = judge_waiting;
    r->place = place_ray;
    r->user = c;
    r->s = s;
    r->done = r->any_hit = false;
    r->count = 0;
}

/* Ends a search after the kernel's walk. */
static inline void end_search(ebpo_ray_search *r)
{
    casting *c = r->user;
    if (r->count)
        judge_waiting(r);
    if (r->any_hit) {
        c->count = 1;
        c->done = true;
    }
}

/* Searches the faces of a subtree or of the whole model. */
static inline __attribute__((always_inline)) void cast_subtree(casting *c, const ebpo_accel *s)
{
    ebpo_ray_search r;
    begin_search(c, &r, s);
    c->context->model->kernels.ray->walk(&r);
    end_search(&r);
}

/* Returns true if the ray may enter the node's cell before its limit (conservative). *enter,
 * *leave: values of t at the cell's boundary. */
static bool intersects_cell(const casting *c, const ebpo_box *box, const ebpo_node *node,
                            double *enter, double *leave)
{
    double low[3], high[3], slack = 0;
    ebpo_cell_bounds(box, node->cell, low, high);
    for (int k = 0; k < 3; k++)
        slack = fmax(slack, (fabs(low[k]) + fabs(high[k]) + fabs(c->ray.origin[k])) * 0x1p-48);
    return intersects_box(c->ray.origin, c->ray.direction, c->limit, low, high, slack, enter,
                          leave);
}

/* Returns true if a hit may be in the node's cell (ebpo_matters_fn). */
static bool ray_matters(void *user, const ebpo_box *box, const ebpo_node *node)
{
    double enter, leave;
    return intersects_cell(user, box, node, &enter, &leave);
}

/* Returns true if a hit may be in the node's envelope. */
static bool intersects_envelope(const casting *c, const ebpo_box *box, const ebpo_node *node)
{
    uint32_t count;
    double enter, leave;
    const uint32_t *codes = ebpo_model_planes(c->context->model, node, &count);
    return intersects_cell(c, box, node, &enter, &leave) &&
           ebpo_ray_may_enter(box, node->cell, codes, count, c->ray.origin, c->ray.direction, enter,
                              leave);
}

/* Returns true if the ray may search a subtree now. In a round (cast_in_rounds), a subtree that is
 * neither in memory nor requested yet is marked, and the ray goes on in the next round. */
static bool may_search(casting *c, uint32_t below)
{
    const ebpo_model *m = c->context->model;
    ray_rounds *r = c->rounds;
    if (!r || r->state[below] == SUBTREE_REQUESTED || ebpo_context_has_pinned(c->context, below) ||
        ebpo_cache_has(m->cache, ebpo_context_key(c->context, below)))
        return true;
    if (r->state[below] == SUBTREE_UNKNOWN && r->missing_count < MISSING_MAX) {
        r->state[below] = SUBTREE_MISSING;
        r->missing[r->missing_count++] = below;
    }
    c->waits = true;
    c->done = c->wants != EBPO_WANTS_ALL; /* for all hits, marks all subtrees on the ray's way */
    return false;
}

/* Searches all subtrees at or below a node. */
static ebpo_status cast_node(casting *c, const ebpo_box *box, ebpo_node node, ebpo_error *error)
{
    const ebpo_model *m = c->context->model;
    if (c->done || ebpo_node_is_uniform(&node) || !intersects_envelope(c, box, &node) ||
        node.pruned) /* ray_walk checks pruned nodes at the end */
        return EBPO_OK;
    if (ebpo_node_is_subtree_root(&node)) {
        uint32_t below = ebpo_entry_value(node.entry);
        /* A ray that waits has no result in this round, so it only marks subtrees. */
        if (!may_search(c, below) || c->waits)
            return EBPO_OK;
        ebpo_status status = ebpo_model_enter(c->context, &node, error);
        if (status == EBPO_OK)
            cast_subtree(c, node.subtree);
        if (status == EBPO_E_PENDING && c->rounds)
            c->rounds->state[below] = SUBTREE_PENDING;
        return status;
    }
    /* Visits the children in the order in which the ray enters their cells. */
    unsigned octant_mask = 0;
    for (int k = 0; k < 3; k++)
        octant_mask |= (unsigned)(c->ray.direction[k] < 0) << k;
    ebpo_status status = EBPO_OK;
    for (unsigned i = 0; i < 8 && status == EBPO_OK; i++)
        status = cast_node(c, box, ebpo_model_child(m, &node, i ^ octant_mask), error);
    return status;
}

/* Ends the search of a valid ray. In a subset, fails if a pruned node may have another wanted hit.
 */
static inline ebpo_status ray_end(casting *c, ebpo_status status, ebpo_error *error)
{
    if (status == EBPO_OK && !c->done && !c->waits && c->context->model->info->pruned)
        status = ebpo_check_pruned(c->context, ray_matters, c, error);
    if (status == EBPO_OK && c->no_memory)
        status = ebpo_fail_memory(error, c->count * sizeof(ebpo_ray_found));
    return status;
}

/* Finds the hits of a valid ray. */
static inline ebpo_status ray_walk(casting *c, ebpo_error *error)
{
    ebpo_status status = EBPO_OK;
    if (c->context->model->whole) {
        cast_subtree(c, c->context->model->whole);
    } else {
        ebpo_box box = ebpo_model_box(c->context->model);
        status = cast_node(c, &box, ebpo_model_root(c->context->model), error);
    }
    return ray_end(c, status, error);
}

/* --- one ray --- */

static ebpo_status cast_ray(casting *c, ebpo_context *context, const double origin[3],
                            const double direction[3], double t_max, ebpo_ray_wants wants,
                            ebpo_error *error)
{
    casting_begin(c, context, origin, direction, t_max, wants, EBPO_RAY_BOTH);
    const char *fault = ray_fault(origin, direction, t_max);
    if (fault)
        return ebpo_fail(error, EBPO_E_ARGUMENT, "the ray %s", fault);
    if (!(context->model->info->parts & EBPO_PART_MESH))
        return ebpo_check_mesh(context->model, error);
    return ray_walk(c, error);
}

ebpo_status ebpo_ray_first(ebpo_context *context, const double origin[3], const double direction[3],
                           double t_max, ebpo_ray_hit *out, bool *hit, ebpo_error *error)
{
    EBPO_DEFAULT_FP;
    casting c;
    ebpo_status status = cast_ray(&c, context, origin, direction, t_max, EBPO_WANTS_FIRST, error);
    if (status == EBPO_OK && c.count)
        status = give_hit(&c, &c.first, out, error);
    *hit = status == EBPO_OK && c.count;
    return status;
}

ebpo_status ebpo_ray_any(ebpo_context *context, const double origin[3], const double direction[3],
                         double t_max, bool *any, ebpo_error *error)
{
    EBPO_DEFAULT_FP;
    casting c;
    ebpo_status status = cast_ray(&c, context, origin, direction, t_max, EBPO_WANTS_ANY, error);
    *any = status == EBPO_OK && c.count;
    return status;
}

ebpo_status ebpo_ray_all(ebpo_context *context, const double origin[3], const double direction[3],
                         double t_max, const ebpo_ray_hit **hits, uint64_t *count,
                         ebpo_error *error)
{
    EBPO_DEFAULT_FP;
    casting c;
    uint64_t end;
    *hits = NULL;
    *count = 0;
    ebpo_status status = cast_ray(&c, context, origin, direction, t_max, EBPO_WANTS_ALL, error);
    if (status == EBPO_OK)
        status = casting_sort(&c, 0, &end, error);
    if (status == EBPO_OK && end) {
        *hits = context->hits;
        *count = end;
    }
    return status;
}

/* --- many rays --- */

/* Number of rays that a thread takes at a time. If the model is loaded in parts, the rays are
 * sorted along the Morton curve, and a thread takes more rays, because neighbours on the curve need
 * the same subtrees. */
enum { RAYS_AT_A_TIME = 512, RAYS_ALONG_CURVE = 1024 };

/* The hits of a ray, before they are gathered: hits[begin .. end - 1] in the context of a thread.
 */
typedef struct found {
    unsigned worker; /* index of the thread */
    uint64_t begin, end;
} found;

typedef struct batch {
    const ebpo_ray *rays;
    uint64_t count;
    ebpo_ray_options options;
    ebpo_ray_wants wants;
    unsigned threads;
    ebpo_context **context; /* [threads] the first context is the caller's */
    uint64_t *hit_count;    /* [threads] EBPO_WANTS_ALL: number of hits in each context */
    uint64_t work;          /* number of rays to evaluate */
    uint64_t *order;        /* [work] indices of rays in the order of work; NULL: the given order */
    /* [count] results; `wants` decides which of the three arrays is used */
    ebpo_ray_hit *first;
    bool *any;
    found *all;
} batch;

/* --- a ray of many --- */

/* Begins the query of ray i. */
static void begin_ray(batch *b, uint64_t i, unsigned worker, casting *c)
{
    const ebpo_ray *r = &b->rays[i];
    casting_begin(c, b->context[worker], r->origin, r->direction, r->t_max, b->wants,
                  b->options.sides);
}

/* The result of a ray without a hit. */
static const ebpo_ray_hit no_hit = { INFINITY, EBPO_NO_FACE, 0 };

/* Stores the first hit of ray i. */
static void store_first(batch *b, uint64_t i, ebpo_ray_hit hit)
{
    b->first[i] = hit;
    if (b->options.done)
        b->options.done[i] = true;
}

/* Stores the result of ray i. */
static ebpo_status store_result(batch *b, uint64_t i, unsigned worker, casting *c,
                                ebpo_error *error)
{
    ebpo_status status = EBPO_OK;
    if (b->wants == EBPO_WANTS_FIRST) {
        ebpo_ray_hit hit = no_hit;
        if (c->count)
            status = give_hit(c, &c->first, &hit, error);
        if (status == EBPO_OK)
            store_first(b, i, hit);
        return status;
    }
    if (b->wants == EBPO_WANTS_ANY)
        b->any[i] = c->count;
    else {
        found f = { .worker = worker, .begin = b->hit_count[worker] };
        status = casting_sort(c, f.begin, &f.end, error);
        b->hit_count[worker] = f.end;
        b->all[i] = f;
    }
    if (status == EBPO_OK && b->options.done)
        b->options.done[i] = true;
    return status;
}

/* Stores the result of ray i, which has no hit. */
static ebpo_status store_miss(batch *b, uint64_t i, unsigned worker, ebpo_error *error)
{
    if (b->wants == EBPO_WANTS_FIRST) {
        store_first(b, i, no_hit);
        return EBPO_OK;
    }
    casting none;
    begin_ray(b, i, worker, &none);
    return store_result(b, i, worker, &none, error);
}

/* Adds to r->maps the chunks with the source indices of the ray's hits, unless they are in memory.
 * Returns true if there are such chunks. */
static bool lacks_maps(const casting *c, ray_rounds *r)
{
    const ebpo_ray_found *hit = c->wants == EBPO_WANTS_FIRST ? &c->first : *c->found;
    bool lacks = false;
    for (uint64_t i = 0; i < c->count && c->wants != EBPO_WANTS_ANY; i++) {
        uint64_t face = hit[i].file_face, chunk = face / EBPO_FACE_BLOCK;
        if ((r->lacks_maps && chunk == r->map_chunk) ||
            ebpo_chunks_hint(c->context->model->chunks, &r->maps, EBPO_A_FACE_SOURCE, 0, face, 1)) {
            r->map_chunk = chunk;
            lacks = r->lacks_maps = true;
        }
    }
    return lacks;
}

/* Evaluates ray i, and stores its result. In a round (rounds is not NULL), *waits is set to true if
 * the ray must go on in the next round; then it has no result. *hinted: the round before has
 * requested the source indices of the ray's hits; set to true if this round will do so. */
static ebpo_status cast_one(batch *b, uint64_t i, unsigned worker, ray_rounds *rounds, bool *waits,
                            bool *hinted, ebpo_error *error)
{
    casting c;
    begin_ray(b, i, worker, &c);
    c.rounds = rounds;
    ebpo_status status = ray_walk(&c, error);
    if (status == EBPO_OK && rounds && !c.waits && !*hinted)
        c.waits = *hinted = lacks_maps(&c, rounds);
    *waits = c.waits;
    return status == EBPO_OK && !c.waits ? store_result(b, i, worker, &c, error) : status;
}

/* Rays that are evaluated together. They are not on the stack, because a query needs less than
 * 64 KiB of it (ebpo/base.h). */
typedef struct group {
    batch *b;
    unsigned worker;
    ebpo_ray_group rays;
    uint64_t index[EBPO_RAY_GROUP]; /* indices in the batch */
    casting c[EBPO_RAY_GROUP];
    ebpo_ray_search search[EBPO_RAY_GROUP];
    ebpo_ray_found *found[EBPO_RAY_GROUP]; /* casting.found */
    uint64_t capacity[EBPO_RAY_GROUP];
} group;

/* Begins the search of ray i of a group (ebpo_ray_group.begin). */
static ebpo_ray_search *begin_of_group(void *user, unsigned i)
{
    group *g = user;
    begin_ray(g->b, g->index[i], g->worker, &g->c[i]);
    g->c[i].found = &g->found[i];
    g->c[i].capacity = &g->capacity[i];
    begin_search(&g->c[i], &g->search[i], g->rays.s);
    return g->rays.s->bound_count && place_ray(&g->search[i]) ? &g->search[i] : NULL;
}

static void add_to_group(group *g, uint64_t ray)
{
    unsigned i = g->rays.count++;
    g->rays.ray[i] = &g->b->rays[ray];
    g->index[i] = ray;
}

/* Returns the candidates of ray i of a group after walk_many. *count: their number. */
static const ebpo_ray_candidate *candidates_of(const group *g, unsigned i, unsigned *count)
{
    const ebpo_ray_search *r = g->rays.search[i];
    *count = r ? (unsigned)r->count : g->rays.few[i];
    return r ? r->waiting : g->rays.candidate[i];
}

/* Tests the candidates of ray i of a group, and stores the result. */
static ebpo_status end_ray(group *g, unsigned i, ebpo_error *error)
{
    unsigned few = g->rays.few[i];
    casting *c = &g->c[i];
    ebpo_ray_search *r = g->rays.search[i];
    if (!r && few && (r = begin_of_group(g, i))) {
        memcpy(r->waiting, g->rays.candidate[i], few * sizeof *r->waiting);
        r->count = (int)few;
    }
    if (r)
        end_search(r);
    else
        begin_ray(g->b, g->index[i], g->worker, c);
    ebpo_status status = ray_end(c, EBPO_OK, error);
    return status == EBPO_OK ? store_result(g->b, g->index[i], g->worker, c, error) : status;
}

/* Up to four rays of a group that have one candidate each, through whose interior the ray's line
 * certainly goes. */
typedef struct four {
    unsigned count, ray[4];
    ebpo_ray_candidate candidate[4];
} four;

/* Finds the first hits of four rays. */
static ebpo_status end_four(group *g, four *f, ebpo_error *error)
{
    const ebpo_accel *s = g->rays.s;
    const ebpo_model *m = g->b->context[g->worker]->model;
    ebpo_status status = EBPO_OK;
    ebpo_ray_four in;
    double t[4];
    for (unsigned i = 0; i < 4; i++) {
        unsigned lane = i < f->count ? i : 0;
        const ebpo_ray *ray = g->rays.ray[f->ray[lane]];
        double triangle[3][3];
        ebpo_accel_triangle(s, f->candidate[lane].slot, triangle);
        for (int k = 0; k < 3; k++) {
            in.origin[k][i] = ray->origin[k];
            in.direction[k][i] = ray->direction[k];
            for (int corner = 0; corner < 3; corner++)
                in.triangle[corner][k][i] = triangle[corner][k];
        }
        in.t_max[i] = ray->t_max;
        in.facing[i] = f->candidate[lane].facing;
    }
    unsigned done = ebpo_ray_interior_four(&in, t);
    for (unsigned i = 0; i < f->count && status == EBPO_OK; i++) {
        ebpo_ray_hit hit = { t[i], EBPO_NO_FACE, in.facing[i] };
        if (done >> i & 1) {
            uint32_t face = ebpo_accel_slot_face(s, f->candidate[i].slot);
            status = ebpo_model_source_face(m, face, &hit.face, error);
            if (status == EBPO_OK)
                store_first(g->b, g->index[f->ray[i]], hit);
        } else {
            status = end_ray(g, f->ray[i], error);
        }
    }
    f->count = 0;
    return status;
}

/* Finds the hits of a group of one or more rays. Results are those of cast_one. */
static ebpo_status cast_group(group *g, ebpo_error *error)
{
    const ebpo_accel *s = g->rays.s;
    const ebpo_model *m = g->b->context[g->worker]->model;
    four f = { .count = 0 };
    unsigned count;
    ebpo_status status = EBPO_OK;
    uint32_t open = m->kernels.ray->walk_many(&g->rays),
             all = UINT32_MAX >> (EBPO_RAY_GROUP - g->rays.count);
    /* In a subset, rays that miss all faces may come through pruned nodes. */
    if (m->info->pruned)
        open = all;
    for (uint32_t left = all & ~open; left && status == EBPO_OK; left &= left - 1)
        status = store_miss(g->b, g->index[__builtin_ctz(left)], g->worker, error);
    /* Prefetches what the exact tests of candidates will read. (gcc omits calls of a separate
     * function, as it has no result.) */
    for (uint32_t left = open; left; left &= left - 1) {
        const ebpo_ray_candidate *c = candidates_of(g, (unsigned)__builtin_ctz(left), &count);
        for (unsigned k = 0; k < count; k++)
            ebpo_accel_fetch_face(s, ebpo_accel_slot_face(s, c[k].slot));
    }
    for (uint32_t left = open; left && status == EBPO_OK; left &= left - 1) {
        unsigned i = (unsigned)__builtin_ctz(left);
        const ebpo_ray_candidate *c = candidates_of(g, i, &count);
        bool decided = g->rays.search[i] && (g->c[i].count || g->c[i].done);
        if (count == 1 && c->facing && g->rays.wants == EBPO_WANTS_FIRST && !decided &&
            !m->info->pruned) {
            f.candidate[f.count] = *c;
            f.ray[f.count++] = i;
            status = f.count == 4 ? end_four(g, &f, error) : EBPO_OK;
        } else {
            status = end_ray(g, i, error);
        }
    }
    return status == EBPO_OK && f.count ? end_four(g, &f, error) : status;
}

/* Finds the hits of the rays begin .. end - 1 in groups, in a model that is completely in memory.
 * The rays are checked here, so that they are read from memory once. */
static ebpo_status cast_groups(batch *b, uint64_t begin, uint64_t end, unsigned worker,
                               ebpo_error *error)
{
    ebpo_status status = ebpo_check_ray_rows(b->rays, begin, end, error);
    if (status != EBPO_OK)
        return status;
    group *g = ebpo_alloc(1, sizeof *g);
    if (!g)
        return ebpo_fail_memory(error, sizeof *g);
    g->b = b;
    g->worker = worker;
    g->rays.s = b->context[worker]->model->whole;
    g->rays.wants = b->wants;
    g->rays.facing = facing_of(b->options.sides);
    g->rays.begin = begin_of_group;
    g->rays.user = g;
    memset(g->found, 0, sizeof g->found);
    memset(g->capacity, 0, sizeof g->capacity);
    for (uint64_t i = begin; i < end && status == EBPO_OK;) {
        g->rays.count = 0;
        for (; i < end && g->rays.count < EBPO_RAY_GROUP; i++)
            if (!b->options.done || !b->options.done[i])
                add_to_group(g, i);
        status = g->rays.count ? cast_group(g, error) : EBPO_OK;
    }
    for (unsigned i = 0; i < EBPO_RAY_GROUP; i++)
        free(g->found[i]);
    free(g);
    return status;
}

/* Evaluates the rays begin .. end - 1 in the order of work. */
static ebpo_status cast_in_order(batch *b, uint64_t begin, uint64_t end, unsigned worker,
                                 ebpo_error *error)
{
    ebpo_status status = EBPO_OK;
    ebpo_batch along = { .context = b->context[worker], .count = end - begin, .as_given = true };
    ebpo_batch_begin(&along);
    for (uint64_t i = 0; i < end - begin && status == EBPO_OK; i++) {
        bool waits;
        uint64_t k = begin + i, ray = b->order ? b->order[k] : k;
        if (b->options.done && b->options.done[ray])
            continue;
        status = cast_one(b, ray, worker, NULL, &waits, NULL, error);
        status = ebpo_batch_note(&along, i, k, status, error);
    }
    return ebpo_batch_end(&along, status, error);
}

/* Bit of waiting.ray: the source indices of the ray's hits were requested. */
#define MAPS_HINTED (UINT64_C(1) << 63)

/* The rays of a range that have no result yet, in the order of work. */
typedef struct waiting {
    uint64_t *ray; /* [count] */
    uint64_t count;
    ray_rounds rounds;
    unsigned requested; /* number of requested subtrees */
    bool pending;       /* bytes for some rays are not available yet: `error` has the first error */
    ebpo_error error;
} waiting;

/* Requests the missing subtrees and source indices. Returns false if there are none. Also returns
 * false if there are too many subtrees together with those whose bytes are not available yet. */
static bool request_missing(waiting *w, const ebpo_context *c)
{
    ray_rounds *r = &w->rounds;
    unsigned count = r->missing_count;
    bool any = count || r->lacks_maps;
    w->requested += count;
    ebpo_hint_all(&r->maps);
    r->lacks_maps = false;
    if (!any || (w->pending && w->requested > MISSING_MAX))
        return false;
    for (unsigned i = 0; i < count; i++)
        r->state[r->missing[i]] = SUBTREE_REQUESTED;
    ebpo_context_hint(c, r->missing, count);
    r->missing_count = 0;
    return true;
}

/* Evaluates the waiting rays as far as they need only subtrees that are in memory or requested. */
static ebpo_status cast_round(batch *b, waiting *w, unsigned worker, ebpo_error *error)
{
    ebpo_status status = EBPO_OK;
    uint64_t kept = 0;
    for (uint64_t i = 0; i < w->count && status == EBPO_OK; i++) {
        uint64_t ray = w->ray[i] & ~MAPS_HINTED;
        bool waits, hinted = w->ray[i] & MAPS_HINTED;
        status = cast_one(b, ray, worker, &w->rounds, &waits, &hinted, error);
        if (status == EBPO_E_PENDING) {
            if (!w->pending)
                w->error = error ? *error : (ebpo_error){ .status = status, .offset = -1 };
            w->pending = true;
            status = EBPO_OK;
        } else if (waits) {
            w->ray[kept++] = ray | (hinted ? MAPS_HINTED : 0);
        }
    }
    w->count = kept;
    return status;
}

/* Evaluates the rays begin .. end - 1 of a remote file in rounds. In each round, a ray goes on
 * until it needs a subtree that is neither in memory nor requested. Then one round trip fetches the
 * subtrees that all rays need next, and the source indices of the faces that rays hit. (With the
 * source indices of whole subtrees, 100 rays fetch 9 % more bytes.) */
static ebpo_status cast_in_rounds(batch *b, uint64_t begin, uint64_t end, unsigned worker,
                                  ebpo_error *error)
{
    ebpo_context *c = b->context[worker];
    waiting w = { .rounds.maps = EBPO_HINTS_INIT(c->model->file) };
    uint64_t subtrees = c->model->top->below_count;
    w.ray = ebpo_alloc(end - begin, sizeof *w.ray);
    w.rounds.state = ebpo_alloc_zero(subtrees, 1);
    ebpo_status status = w.ray && w.rounds.state
                             ? EBPO_OK
                             : ebpo_fail_memory(error, (end - begin) * sizeof *w.ray + subtrees);
    for (uint64_t i = begin; i < end && status == EBPO_OK; i++) {
        uint64_t ray = b->order ? b->order[i] : i;
        if (!b->options.done || !b->options.done[ray])
            w.ray[w.count++] = ray;
    }
    atomic_fetch_add(&c->model->without_maps, 1);
    do
        status = status == EBPO_OK ? cast_round(b, &w, worker, error) : status;
    while (status == EBPO_OK && request_missing(&w, c));
    atomic_fetch_sub(&c->model->without_maps, 1);
    free(w.rounds.maps.range);
    free(w.ray);
    free(w.rounds.state);
    return status == EBPO_OK && w.pending ? ebpo_fail_with(error, &w.error) : status;
}

/* Evaluates the rays begin .. end - 1 in the order of work. */
static ebpo_status cast_range(void *user, uint64_t begin, uint64_t end, unsigned worker,
                              ebpo_error *error)
{
    batch *b = user;
    const ebpo_model *m = b->context[worker]->model;
    if (m->whole)
        return cast_groups(b, begin, end, worker, error);
    return m->options.loading != EBPO_LOAD_CACHE || !ebpo_input_prefetches(&m->file->in)
               ? cast_in_order(b, begin, end, worker, error)
               : cast_in_rounds(b, begin, end, worker, error);
}

/* --- the order of work --- */

/* Sets `out` to the approximate point where the ray enters the box. If the origin is in the box, or
 * the ray misses the box, the point is near the origin, within the box. */
static void entry_of(const ebpo_box *box, const ebpo_ray *ray, double out[3])
{
    double from = 0;
    for (int k = 0; k < 3; k++) {
        double low = box->origin[k], high = low + box->size[k],
               t = ((ray->direction[k] > 0 ? low : high) - ray->origin[k]) / ray->direction[k];
        from = t > from && t <= ray->t_max ? t : from;
    }
    for (int k = 0; k < 3; k++) {
        double low = box->origin[k], x = ray->origin[k] + from * ray->direction[k];
        out[k] = x > low ? fmin(x, low + box->size[k]) : low;
    }
}

/* Sorts the uncompleted rays along the Morton curve of the points where they enter the box. If
 * there is no memory for this, the rays are evaluated in the given order. */
static void put_in_order(batch *b, const ebpo_model *m)
{
    ebpo_box box = ebpo_model_box(m);
    uint64_t kept = 0;
    double *entry = ebpo_alloc(b->count, 3 * sizeof *entry);
    for (uint64_t i = 0; entry && i < b->count; i++)
        entry_of(&box, &b->rays[i], entry + 3 * i);
    if (entry)
        b->order = ebpo_curve_order(&box, entry, b->count);
    for (uint64_t i = 0; b->order && i < b->count; i++)
        if (!b->options.done || !b->options.done[b->order[i]])
            b->order[kept++] = b->order[i];
    b->work = b->order ? kept : b->count;
    free(entry);
}

/* --- on all cores --- */

ebpo_status ebpo_check_ray_rows(const ebpo_ray *rays, uint64_t begin, uint64_t end,
                                ebpo_error *error)
{
    for (uint64_t i = begin; i < end; i++) {
        const char *fault = ray_fault(rays[i].origin, rays[i].direction, rays[i].t_max);
        if (fault)
            return ebpo_fail(error, EBPO_E_ARGUMENT, "ray %" PRIu64 " %s", i, fault);
    }
    return EBPO_OK;
}

/* Makes a context for each thread; the first thread uses the caller's context. */
static ebpo_status make_contexts(batch *b, ebpo_context *callers, ebpo_error *error)
{
    b->context = ebpo_alloc_zero(b->threads, sizeof *b->context);
    b->hit_count = ebpo_alloc_zero(b->threads, sizeof *b->hit_count);
    if (!b->context || !b->hit_count)
        return ebpo_fail_memory(error, b->threads * sizeof *b->context);
    b->context[0] = callers;
    ebpo_status status = EBPO_OK;
    for (unsigned i = 1; i < b->threads && status == EBPO_OK; i++)
        status = ebpo_context_new(callers->model, &b->context[i], error);
    return status;
}

static void clear_batch(batch *b)
{
    for (unsigned i = 1; b->context && i < b->threads; i++)
        ebpo_context_free(b->context[i]);
    free(b->context);
    free(b->hit_count);
    free(b->order);
    free(b->all);
}

/* Checks the arguments, and evaluates all rays. */
static ebpo_status cast_all(batch *b, ebpo_context *context, const ebpo_ray_options *options,
                            ebpo_error *error)
{
    const ebpo_model *m = context->model;
    b->options = (ebpo_ray_options)EBPO_RAY_OPTIONS_INIT;
    ebpo_status status = EBPO_TAKE(ebpo_ray_options, &b->options, options, error);
    if (status == EBPO_OK && b->options.sides > EBPO_RAY_BACK)
        status = ebpo_fail_value(error);
    if (status == EBPO_OK)
        status = m->whole ? EBPO_OK : ebpo_check_ray_rows(b->rays, 0, b->count, error);
    if (status == EBPO_OK)
        status = ebpo_check_mesh(m, error);
    if (status == EBPO_OK && b->wants == EBPO_WANTS_ALL && b->options.done)
        status = ebpo_fail(error, EBPO_E_ARGUMENT, "ebpo_ray_all_many: `done` must be NULL");
    if (status != EBPO_OK || b->count == 0)
        return status;
    b->work = b->count;
    /* true if contexts of several threads can use the model at the same time */
    bool shared = m->whole || m->options.loading == EBPO_LOAD_CACHE;
    if (!m->whole && shared && b->count > 1)
        put_in_order(b, m);
    uint64_t grain = b->order ? RAYS_ALONG_CURVE : RAYS_AT_A_TIME,
             tasks = (b->work + grain - 1) / grain;
    b->threads = shared ? ebpo_thread_count(b->options.threads) : 1;
    if (b->threads > tasks)
        b->threads = (unsigned)tasks;
    status = tasks ? make_contexts(b, context, error) : EBPO_OK;
    if (status == EBPO_OK)
        status =
            ebpo_parallel_for(b->threads, NULL, b->work, grain, cast_range, b, NULL, NULL, error);
    return status;
}

ebpo_status ebpo_ray_first_many(ebpo_context *context, const ebpo_ray *rays, uint64_t count,
                                const ebpo_ray_options *options, ebpo_ray_hit *out,
                                ebpo_error *error)
{
    EBPO_DEFAULT_FP;
    batch b = { .rays = rays, .count = count, .wants = EBPO_WANTS_FIRST, .first = out };
    ebpo_status status = cast_all(&b, context, options, error);
    clear_batch(&b);
    return status;
}

ebpo_status ebpo_ray_any_many(ebpo_context *context, const ebpo_ray *rays, uint64_t count,
                              const ebpo_ray_options *options, bool *any, ebpo_error *error)
{
    EBPO_DEFAULT_FP;
    batch b = { .rays = rays, .count = count, .wants = EBPO_WANTS_ANY, .any = any };
    ebpo_status status = cast_all(&b, context, options, error);
    clear_batch(&b);
    return status;
}

/* Gathers the hits in the order of the rays, in the caller's context. */
static ebpo_status gather_hits(const batch *b, ebpo_context *context, ebpo_error *error)
{
    uint64_t total = 0;
    if (!ebpo_grow(&context->hit_begin, &context->hit_begin_capacity, b->count + 1,
                   sizeof *context->hit_begin))
        return ebpo_fail_memory(error, (b->count + 1) * sizeof *context->hit_begin);
    for (uint64_t i = 0; i < b->count; i++) {
        context->hit_begin[i] = total;
        total += b->all[i].end - b->all[i].begin;
    }
    context->hit_begin[b->count] = total;
    ebpo_ray_hit *hits = ebpo_alloc(total, sizeof *hits);
    if (!hits)
        return ebpo_fail_memory(error, total * sizeof *hits);
    for (uint64_t i = 0; i < b->count; i++) {
        const found *f = &b->all[i];
        if (f->end > f->begin)
            memcpy(hits + context->hit_begin[i], b->context[f->worker]->hits + f->begin,
                   (f->end - f->begin) * sizeof *hits);
    }
    free(context->hits);
    context->hits = hits;
    context->hit_capacity = total;
    return EBPO_OK;
}

ebpo_status ebpo_ray_all_many(ebpo_context *context, const ebpo_ray *rays, uint64_t count,
                              const ebpo_ray_options *options, const ebpo_ray_hit **hits,
                              const uint64_t **begin, ebpo_error *error)
{
    EBPO_DEFAULT_FP;
    batch b = { .rays = rays, .count = count, .wants = EBPO_WANTS_ALL };
    *hits = NULL;
    *begin = NULL;
    b.all = ebpo_alloc(count, sizeof *b.all);
    ebpo_status status = b.all ? cast_all(&b, context, options, error)
                               : ebpo_fail_memory(error, count * sizeof *b.all);
    if (status == EBPO_OK)
        status = gather_hits(&b, context, error);
    if (status == EBPO_OK) {
        *hits = context->hits;
        *begin = context->hit_begin;
    }
    clear_batch(&b);
    return status;
}
