/* Declares the kernels of queries and their data. A kernel is an inner loop over blocks of faces
 * and over the bounds of eight children (accel.h), compiled for several instruction sets with the
 * same results (core/cpu.h). Kernels are filters in low precision: a result that they call certain
 * is also the result of exact arithmetic. */
#ifndef EBPO_QUERY_QUERY_KERNELS_H
#define EBPO_QUERY_QUERY_KERNELS_H

#include <ebpo/query.h>
#include <math.h>
#include <stdint.h>
#include <string.h>

#include "core/cpu.h"
#include "geometry/ray.h"
#include "query/accel.h"

/* --- stack of children still to visit, the nearest on top --- */

/* A visit of a child. The upper 32 bits are the key, a nonnegative float (the child's bound); the
 * bits of such floats, read as integers, have the order of the floats. The lower 32 bits are the
 * child, as in ebpo_bound. */
typedef uint64_t ebpo_visit;

/* Maximum number of visits on a stack: eight for each level of the hierarchy, which has at most 64
 * levels (block_tree.c: at most 24 levels, and below them nodes are cut into equal parts). */
enum { EBPO_VISITS_MAX = 64 * 8 };

static inline ebpo_visit ebpo_visit_make(float key, uint32_t child)
{
    uint32_t bits;
    memcpy(&bits, &key, sizeof bits);
    return (uint64_t)bits << 32 | child;
}

static inline float ebpo_visit_key(ebpo_visit v)
{
    uint32_t bits = (uint32_t)(v >> 32);
    float key;
    memcpy(&key, &bits, sizeof key);
    return key;
}

/* Prefetches the first cache lines of a child's node or block into the processor's cache. */
static inline void ebpo_visit_fetch(const ebpo_accel *s, uint32_t child)
{
    const char *at = (const char *)&s->bound[child & ~EBPO_IS_BLOCK];
    unsigned lines = 2;
    if (child & EBPO_IS_BLOCK) {
        at = (const char *)ebpo_accel_meshlet(s, child & ~EBPO_IS_BLOCK);
        lines = s->wide ? 4 : 2;
    }
    for (unsigned i = 0; i < lines; i++)
        __builtin_prefetch(at + 64 * i);
}

static inline void ebpo_visit_fetch_cylinder(const ebpo_accel *s, uint32_t node)
{
    const char *at = (const char *)&s->cylinder[node];
    __builtin_prefetch(at);
    __builtin_prefetch(at + 64);
}

/* Pushes the children `lanes` (a bit for each), farthest first; returns the new top of the stack.
 */
static inline uint32_t ebpo_visit_push(ebpo_visit *stack, uint32_t top, const ebpo_bound *bound,
                                       unsigned lanes, const float key[8])
{
    uint32_t base = top;
    for (; lanes; lanes &= lanes - 1) {
        unsigned lane = (unsigned)__builtin_ctz(lanes);
        ebpo_visit v = ebpo_visit_make(key[lane], bound->child[lane]);
        uint32_t at = top++;
        for (; at > base && stack[at - 1] < v; at--)
            stack[at] = stack[at - 1];
        stack[at] = v;
    }
    return top;
}

/* --- a search for the nearest face of one accel (acceleration structure of a subtree) --- */

/* A point, prepared for kernels. */
typedef struct ebpo_probe {
    double p[3];
    float high[3], low[3]; /* p = high + low with an error of 2^-48 of |p| (for blocks of floats) */
    float local[3];        /* position in the subtree's frame */
    float scale;           /* scale of the frame */
    double scale64;        /* `scale` as a double */
    /* bound, in the frame, of the error of distances caused by the rounding of `local` */
    float error;
} ebpo_probe;

/* A face that may be nearest. Candidates wait until the end of the search, when nearly all of them
 * are known to be farther than another face. */
typedef struct ebpo_near_candidate {
    float low;           /* lower bound of the distance, in the frame */
    uint32_t slot, node; /* the face's slot; the parent of the face's block */
} ebpo_near_candidate;
enum { EBPO_NEAR_CANDIDATES = 64 };
#define EBPO_NO_BLOCK UINT32_MAX

typedef struct ebpo_near_search ebpo_near_search;
struct ebpo_near_search {
    const ebpo_accel *s;
    ebpo_probe probe;
    void *user;                              /* data for the functions below */
    void (*judge)(ebpo_near_search *search); /* compares all waiting candidates exactly */
    bool (*late)(ebpo_near_search *search); /* returns true after the deadline; NULL: no deadline */
    /* block that is visited before all others, and the node above it; EBPO_NO_BLOCK: none */
    uint32_t first_block, first_node;
    float best;   /* faces at a greater distance, in the frame, are not the result */
    float limit2; /* nodes with a greater squared lower bound are skipped */
    int count;    /* number of waiting candidates */
    ebpo_near_candidate waiting[EBPO_NEAR_CANDIDATES];
    uint32_t top; /* number of visits that remained at the deadline */
    ebpo_visit stack[EBPO_VISITS_MAX];
    uint32_t from[EBPO_VISITS_MAX]; /* parents of the stack's visits */
};

/* EBPO_NEAR_UNDERFLOW is added to errors of distances. The error from underflow of squares is far
 * less: about sqrt(2^-149). */
#define EBPO_NEAR_UNDERFLOW 0x1p-56f

/* Lowers `best` and the limit for squared bounds, which includes rounding errors. */
static inline void ebpo_near_set_best(ebpo_near_search *g, float best)
{
    float limit = best * (1 + 0x1p-18f) + g->probe.error + EBPO_NEAR_UNDERFLOW;
    g->best = best;
    g->limit2 = limit * limit;
}

/* Drops candidates that are certainly farther than `best`. */
static inline void ebpo_near_drop_far(ebpo_near_search *g)
{
    int kept = 0;
    for (int i = 0; i < g->count; i++)
        if (g->waiting[i].low <= g->best)
            g->waiting[kept++] = g->waiting[i];
    g->count = kept;
}

/* --- a ray through one accel --- */

/* The origin of a ray is moved along the ray towards the faces if the origin is far from the accel.
 * That is so if a coordinate of the origin, in the accel's frame, is greater than this multiple of
 * the accel's largest coordinate. */
#define EBPO_RAY_NEAR 4
/* The direction of a ray is scaled if its longest coordinate is not between 2^-12 and 2^12. */
#define EBPO_RAY_SHORTEST 0x1p-12
#define EBPO_RAY_LONGEST  0x1p12
/* This value of t, in the frame, is used in place of infinity, because infinity times 0 is NaN. */
#define EBPO_RAY_BEYOND 0x1p100f

/* Returns a bound of the error of the origin in the frame. Several steps add an error. The origin
 * is moved, transformed to the frame and back to the model's unit, and split into floats. Small
 * coordinates of the direction are replaced (docs/develop/bounds.md, "A ray against boxes").
 * `greatest`: the largest absolute coordinate of the origin. */
static inline double ebpo_ray_error(const ebpo_accel *s, double greatest)
{
    const double *c = s->centre;
    double unit = (fabs(c[0]) + fabs(c[1]) + fabs(c[2])) * s->scale;
    return 0x1p-45 * (greatest + unit) + 0x1p-55 * s->largest_coordinate + 0x1p-53;
}

/* Returns the distance at which other rounding errors equal the origin's error. */
static inline float ebpo_ray_blur(double error) { return (float)(error * 0x1p23 + 0x1p-30); }

typedef enum ebpo_ray_wants { EBPO_WANTS_FIRST, EBPO_WANTS_ANY, EBPO_WANTS_ALL } ebpo_ray_wants;

typedef struct ebpo_ray_search ebpo_ray_search;

/* A face that the ray may hit, at a parameter t of at least `low` (in the frame). `facing`: as in
 * ebpo_ray_intersection if the line certainly goes through the face's interior, otherwise 0. */
typedef struct ebpo_ray_candidate {
    float low;
    uint32_t slot;
    int facing;
} ebpo_ray_candidate;
enum { EBPO_RAY_CANDIDATES = 64 };

struct ebpo_ray_search {
    /* Set by the caller. */
    const ebpo_segment *ray;
    ebpo_ray_wants wants;
    int facing;   /* 1: only front faces; -1: only back faces; 0: all faces */
    double limit; /* hits with a greater t are not needed; decreases during the search */
    /* Tests a face exactly (`facing`: as in a candidate), keeps it if it is a wanted hit, and
     * updates search->limit and search->done. */
    void (*decide)(ebpo_ray_search *search, uint32_t slot, int facing);
    void (*judge)(ebpo_ray_search *search); /* tests all waiting candidates */
    /* Sets the fields of the frame, for any ray. Returns false if the ray misses all faces. */
    bool (*place)(ebpo_ray_search *search);
    void *user;
    const ebpo_accel *s;
    bool done;    /* false; later: the search is complete */
    bool any_hit; /* false; later, EBPO_WANTS_ANY: some face is certainly hit, and `decide` was not
                   * called */
    int count;    /* 0; later: the number of waiting candidates */

    /* Fields of the frame (coordinates in which the subtree's cell has a size of 1 to 2), set by
     * `place` or, for most rays, by ray_place (ray_kernels.c). The fourth doubles are not used.
     * direction: its longest coordinate is 2^-12 to 2^12. origin: the ray's origin, moved along the
     * ray to t = `moved`. from: the same in the model's unit. error: bound of the error of
     * `origin`. */
    double direction[4], origin[4], from[4], error;
    float blur; /* distance at which other rounding errors equal the origin's error */
    double moved, limit_scale; /* limit_scale: converts t of the ray to t in the frame */
    float bound, surely;       /* `limit`, rounded up; t_max, rounded down */

    /* Set by the kernels. Each of the next three arrays has one float for each axis and an unused
     * fourth float. inverse: reciprocals of the direction's coordinates. near_from and far_from:
     * the origin times `inverse`, for tests of the nearer and of the farther sides of boxes; the
     * origin is moved by `error` so that no box is missed. */
    float near_from[4], far_from[4], inverse[4];
    float step_inverse[4];    /* unused value, then `inverse` */
    double inverse_double[4]; /* inverse of the direction; small coordinates were replaced */
    /* byte offsets in ebpo_bound: of the nearer sides of boxes on each axis, and of the farther
     * sides */
    const uint8_t (*side_at)[3];
    int axis[3]; /* the axes x, y, z of tests of faces; z has the direction's longest coordinate */
    /* how far the shear moves x and y at z = 1, and how t changes for a step of 1 along z */
    float shear[3];
    /* for blocks of floats: `from` is from_high - from_low / scale */
    float from_high[4], from_low[4];
    ebpo_ray_candidate waiting[EBPO_RAY_CANDIDATES];
};

/* --- point in solid --- */

/* A segment along an axis, from the point `from` up to the coordinate `to`, as in
 * ebpo_axis_crossing (predicates.h). */
typedef struct ebpo_axis_segment {
    double from[3];
    double to;
    int axis;
    /* Extent of the segment in the cell, in sixteenths of the cell, encoded almost as the box of an
     * ebpo_listed_block. For each axis, the segment's upper side is in the bits of the box's lower
     * side. 15 minus the segment's lower side is in the bits of 15 minus the box's upper side.
     * EBPO_REACH_ALL: the segment may intersect all boxes. */
    uint32_t reach;
} ebpo_axis_segment;
#define EBPO_REACH_ALL UINT32_C(0xffffff)

/* Compares the six values of the block's box (four bits each) with the six values of the segment.
 * Returns false if a value of the box is greater; the listed faces of the block then cannot
 * intersect the segment. */
static inline bool ebpo_axis_segment_intersects(const ebpo_axis_segment *g, uint64_t listed)
{
    const uint32_t digits = 0x0f0f0f, carry = 0x101010;
    uint32_t box = (uint32_t)(listed >> EBPO_LISTED_BOX);
    uint32_t even = ((g->reach & digits) | carry) - (box & digits),
             odd = ((g->reach >> 4 & digits) | carry) - (box >> 4 & digits);
    return (even & odd & carry) == carry;
}

/* --- tables --- */

/* These functions have no side effects except on their outputs. */
typedef struct ebpo_inside_kernels {
    /* Returns the sum of the certain crossings (ebpo_axis_crossing) of the segment with a leaf's
     * listed faces. The segment must be in the leaf's cell. Appends the slots of faces that are not
     * certain to `open` (capacity: 8 for each block), and adds their number to *open_count. Every
     * face that contains an end of the segment is among the appended faces. */
    int32_t (*crossings)(const ebpo_accel *s, const ebpo_listed_block *list,
                         const ebpo_axis_segment *segment, uint32_t *open, uint32_t *open_count);
    ebpo_cell_faces_fn *cell_faces;
} ebpo_inside_kernels;

/* These functions walk through search->s, and call search->judge when many candidates wait. After
 * the walk, the caller must test the candidates that still wait. */
typedef struct ebpo_nearest_kernels {
    void (*walk)(ebpo_near_search *search);
} ebpo_nearest_kernels;
/* EBPO_RAY_GROUP: maximum number of rays of a group, a bit of a mask for each. EBPO_RAY_TURNS:
 * maximum number of rays among them that take turns. */
enum { EBPO_RAY_GROUP = 32, EBPO_RAY_TURNS = 16 };
/* Maximum number of candidates of a ray of a packet. */
enum { EBPO_RAY_FEW = 8 };
/* Rays through one accel. */
typedef struct ebpo_ray_group {
    const ebpo_accel *s;
    ebpo_ray_wants wants; /* of all rays */
    unsigned count;       /* at least 1 */
    const ebpo_ray *ray[EBPO_RAY_GROUP];
    int facing; /* as in ebpo_ray_search */
    /* Begins the search of ray i. Returns NULL if the ray misses all faces. */
    ebpo_ray_search *(*begin)(void *user, unsigned i);
    void *user;
    /* Set by walk_many. search: the searches that are begun; NULL: not begun, or the ray misses all
     * faces. few, candidate: number of candidates and candidates of rays whose search is not begun.
     * The caller must test them. (During the walk of a packet, also those of other rays.) */
    ebpo_ray_search *search[EBPO_RAY_GROUP];
    uint8_t few[EBPO_RAY_GROUP];
    ebpo_ray_candidate candidate[EBPO_RAY_GROUP][EBPO_RAY_FEW];
    /* Space for walk_many. Without the additional visits, the beginnings of all rows would compete
     * for the same lines of the processor's cache. */
    ebpo_visit stack[EBPO_RAY_TURNS][EBPO_VISITS_MAX + 24];
    float enter[EBPO_VISITS_MAX]; /* keys of the visits in stack[0] of a packet */
} ebpo_ray_group;

typedef struct ebpo_ray_kernels {
    void (*walk)(ebpo_ray_search *search);
    /* Walks with all rays of a group. Rays with similar origins and directions, one after another,
     * share the visits of nodes; other rays take turns. Returns a bit for each ray that has a
     * search or candidates. */
    uint32_t (*walk_many)(ebpo_ray_group *group);
} ebpo_ray_kernels;

EBPO_KERNELS(ebpo_inside_kernels, ebpo_inside_kernels)
EBPO_KERNELS(ebpo_nearest_kernels, ebpo_nearest_kernels)
EBPO_KERNELS(ebpo_ray_kernels, ebpo_ray_kernels)

/* Kernels that a model uses. */
typedef struct ebpo_query_kernels {
    const ebpo_inside_kernels *inside;
    const ebpo_nearest_kernels *nearest;
    const ebpo_ray_kernels *ray;
} ebpo_query_kernels;

static inline ebpo_query_kernels ebpo_query_kernels_base(void)
{
    return (ebpo_query_kernels){ &ebpo_inside_kernels_base, &ebpo_nearest_kernels_base,
                                 &ebpo_ray_kernels_base };
}

static inline ebpo_query_kernels ebpo_query_kernels_best(void)
{
    return (ebpo_query_kernels){ ebpo_inside_kernels_best(), ebpo_nearest_kernels_best(),
                                 ebpo_ray_kernels_best() };
}

#endif
