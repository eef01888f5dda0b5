/* Implements the kernels that find the hits of a ray, or of several rays together. A kernel walks
 * down the hierarchy over blocks of faces of one accel (acceleration structure of a subtree,
 * accel.h), and filters eight faces at a time, in single precision.
 *
 * The kernel drops only faces that the ray certainly misses, or certainly hits beyond the limit of
 * t (a hit is at origin + t * direction). If the kernel reports a certain hit, the face is also hit
 * in exact arithmetic. All faces that are not dropped become candidates, which rays.c tests
 * exactly.
 *
 * This file is compiled for several instruction sets with the same results (core/cpu.h). Error
 * bounds: docs/develop/bounds.md. */
#include "core/strict_fp.h"

#include <math.h>
#include <stddef.h>

#include "core/simd.h"
#include "query/face_block.h"
#include "query/query_kernels.h"

/* --- the ray --- */

/* Offsets in ebpo_bound of the sides of boxes on each axis: ray_side_at[bits][0] of the nearer
 * sides, ray_side_at[bits][1] of the farther sides. `bits` has a bit for each axis on which the
 * direction is negative. The table replaces branches, half of which would be mispredicted. */
#define LOW(k)  (offsetof(ebpo_bound, low) + 8 * (k))
#define HIGH(k) (offsetof(ebpo_bound, high) + 8 * (k))
static const uint8_t ray_side_at[8][2][3] = {
    { { LOW(0), LOW(1), LOW(2) }, { HIGH(0), HIGH(1), HIGH(2) } },
    { { HIGH(0), LOW(1), LOW(2) }, { LOW(0), HIGH(1), HIGH(2) } },
    { { LOW(0), HIGH(1), LOW(2) }, { HIGH(0), LOW(1), HIGH(2) } },
    { { HIGH(0), HIGH(1), LOW(2) }, { LOW(0), LOW(1), HIGH(2) } },
    { { LOW(0), LOW(1), HIGH(2) }, { HIGH(0), HIGH(1), LOW(2) } },
    { { HIGH(0), LOW(1), HIGH(2) }, { LOW(0), HIGH(1), LOW(2) } },
    { { LOW(0), HIGH(1), HIGH(2) }, { HIGH(0), LOW(1), LOW(2) } },
    { { HIGH(0), HIGH(1), HIGH(2) }, { LOW(0), LOW(1), LOW(2) } },
};
#undef LOW
#undef HIGH

/* Sets the fields of the frame for most rays, as `place` does, but faster. Returns false if `place`
 * must scale the direction, move the origin, or handle numbers that are too large. */
EBPO_EIGHT bool ray_place(ebpo_ray_search *r, d3 from, d3 d, d3 origin)
{
    const ebpo_accel *s = r->s;
    double longest = d3_greatest(d3_abs(d));
    if (!(longest >= EBPO_RAY_SHORTEST && longest <= EBPO_RAY_LONGEST &&
          d3_greatest(d3_abs(origin)) <= s->ray_near))
        return false;
    d3_store(r->direction, d);
    d3_store(r->origin, origin);
    d3_store(r->from, from);
    r->error = s->ray_error; /* not that of this origin, for which the walk would wait */
    r->blur = s->ray_blur;
    r->moved = 0;
    r->limit_scale = s->scale;
    double beyond = (double)EBPO_RAY_BEYOND, limit = r->limit * s->scale * (1 + 0x1p-20) + 0x1p-90,
           t_max = r->ray->t_max * s->scale * (1 - 0x1p-20) - 0x1p-90;
    r->bound = (float)(limit < beyond ? limit : beyond);
    r->surely = (float)(t_max < beyond ? t_max : beyond);
    return true;
}

/* Sets the fields of the search that are used in tests of boxes. */
EBPO_EIGHT void ray_set_boxes(ebpo_ray_search *r, d3 d, d3 origin)
{
    d3 slack = d3_add(d3_mul(d3_abs(origin), d3_all(0x1p-21)), d3_all(r->error)),
       ahead = d3_signed(slack, d),
       inverse = d3_div(d3_all(1), d3_signed(d3_max(d3_abs(d), d3_all(0x1p-72)), d));
    d3_store(r->inverse_double, inverse);
    d3_store_floats(r->inverse, inverse);
    d3_store_floats_after(r->step_inverse, inverse);
    d3_store_floats(r->near_from, d3_mul(d3_add(origin, ahead), inverse));
    d3_store_floats(r->far_from, d3_mul(d3_sub(origin, ahead), inverse));
    r->side_at = ray_side_at[d3_signs(d)];
}

/* Sets the fields of the search that are used in tests of faces. */
EBPO_EIGHT void ray_set_faces(ebpo_ray_search *r, d3 from)
{
    static const int axes[4][3] = { { 1, 2, 0 }, { 2, 0, 1 }, { 0, 1, 2 }, { 0, 1, 2 } };
    const double *d = r->direction;
    double x = fabs(d[0]), y = fabs(d[1]), longer = y > x ? y : x;
    /* A table replaces branches, which would often be mispredicted. */
    memcpy(r->axis, axes[(y > x) | (fabs(d[2]) > longer) << 1], sizeof r->axis);
    int z = r->axis[2];
    for (int i = 0; i < 2; i++)
        r->shear[i] = -(float)(d[r->axis[i]] * r->inverse_double[z]);
    r->shear[2] = (float)r->inverse_double[z];
    d3_store_floats(r->from_high, from);
    d3_store_floats(r->from_low, d3_mul(d3_beyond_floats(from), d3_all(-r->s->scale)));
}

/* --- boxes --- */

/* Returns step * side + from for the eight sides at this offset in ebpo_bound. */
EBPO_EIGHT f8 side_at(const ebpo_bound *b, unsigned offset, f8 step, f8 from)
{
    return f8_mul_add(f8_from_bytes((const uint8_t *)b + offset), step, from);
}

/* Returns a bit for each child whose box the ray may intersect between t = 0 and the limit. *enter:
 * the t at which the ray enters each box. The three axes are prepared together: the origin's
 * coordinates are in lanes 0 to 2, the step's coordinates in lanes 1 to 3. (Origin and step are
 * adjacent in memory, so each load of four floats also reads one number of the other array.) */
EBPO_EIGHT unsigned ray_children(const ebpo_ray_search *r, const ebpo_bound *b, f8 *enter)
{
    f8 origin = f8_load_twice(b->origin), inverse = f8_load_twice(r->inverse),
       step = f8_mul(f8_load_twice(b->origin + 2), f8_load_twice(r->step_inverse)),
       near = f8_mul_sub(origin, inverse, f8_load_twice(r->near_from)),
       far = f8_mul_sub(origin, inverse, f8_load_twice(r->far_from));
    f8 x = f8_spread1(step), y = f8_spread2(step), z = f8_spread3(step);
    f8 from = f8_max(f8_max(side_at(b, r->side_at[0][0], x, f8_spread0(near)),
                            side_at(b, r->side_at[0][1], y, f8_spread1(near))),
                     f8_max(side_at(b, r->side_at[0][2], z, f8_spread2(near)), f8_all(0)));
    f8 to = f8_min(f8_min(side_at(b, r->side_at[1][0], x, f8_spread0(far)),
                          side_at(b, r->side_at[1][1], y, f8_spread1(far))),
                   f8_min(side_at(b, r->side_at[1][2], z, f8_spread2(far)), f8_all(r->bound)));
    *enter = from;
    return f8_bits(f8_at_most(from, to)) & ((1u << b->count) - 1);
}

/* --- faces --- */

/* Eight faces in coordinates of the ray: z is along the axis with the longest coordinate of the
 * direction. x and y are sheared so that the ray is at x = y = 0. */
typedef struct projected {
    f8 x[3], y[3], z[3];
} projected;

/* Reads the corners' coordinates on one axis, relative to the origin, in the subtree's frame. */
EBPO_EIGHT void ray_axis(const ebpo_ray_search *r, const ebpo_face_block *b, int axis, bool wide,
                         f8 corner[3])
{
    if (!wide) {
        f8 high = f8_all(r->from_high[axis]), low = f8_all(r->from_low[axis]),
           scale = f8_all((float)r->s->scale);
        ebpo_face_block_floats(b, axis, corner);
        for (int i = 0; i < 3; i++)
            corner[i] = f8_mul_add(f8_sub(corner[i], high), scale, low);
        return;
    }
    double x[3][EBPO_BLOCK];
    ebpo_face_block_doubles(b, axis, x);
    for (int i = 0; i < 3; i++) {
        float eight[EBPO_BLOCK];
        for (int lane = 0; lane < EBPO_BLOCK; lane++)
            eight[lane] = (float)((x[i][lane] - r->from[axis]) * r->s->scale);
        corner[i] = f8_load(eight);
    }
}

EBPO_EIGHT projected ray_view(const ebpo_ray_search *r, const ebpo_face_block *b, bool wide)
{
    projected out;
    ray_axis(r, b, r->axis[2], wide, out.z);
    ray_axis(r, b, r->axis[0], wide, out.x);
    ray_axis(r, b, r->axis[1], wide, out.y);
    for (int i = 0; i < 3; i++) {
        out.x[i] = f8_mul_add(out.z[i], f8_all(r->shear[0]), out.x[i]);
        out.y[i] = f8_mul_add(out.z[i], f8_all(r->shear[1]), out.y[i]);
    }
    return out;
}

/* In the plane of x and y, the ray is the point 0. u, v, w: for each of a face's three edges, twice
 * the signed area of the triangle of the edge and this point. least, greatest: the least and the
 * greatest of u, v and w. error: bound of the rounding error of u, v and w. */
typedef struct edges {
    f8 u, v, w, least, greatest, error;
} edges;

EBPO_EIGHT f8 signed_area(f8 ax, f8 ay, f8 bx, f8 by) { return f8_mul_sub(ax, by, f8_mul(ay, bx)); }

EBPO_EIGHT edges ray_edges(const projected *a, f8 size_z)
{
    edges e;
    f8 size = f8_all(0);
    for (int i = 0; i < 3; i++)
        size = f8_add(size, f8_add(f8_abs(a->x[i]), f8_abs(a->y[i])));
    f8 wide = f8_add(f8_add(size_z, size_z), size);
    e.u = signed_area(a->x[2], a->y[2], a->x[1], a->y[1]);
    e.v = signed_area(a->x[0], a->y[0], a->x[2], a->y[2]);
    e.w = signed_area(a->x[1], a->y[1], a->x[0], a->y[0]);
    e.least = f8_min3(e.u, e.v, e.w);
    e.greatest = f8_max3(e.u, e.v, e.w);
    e.error = f8_mul(f8_add(size, f8_mul(wide, f8_all(0x1p-21f))), f8_mul(wide, f8_all(0x1p-22f)));
    return e;
}

/* Results for the faces of a block; masks have a bit for each lane. */
typedef struct ray_lanes {
    float low[8], high[8]; /* bounds of t of possible hits */
    /* alive: faces that may be hit at a t of 0 to the limit; sure: faces that are certainly hit at
     * such a t (in a packet: at a t of 0 or more) */
    unsigned alive, sure;
    /* faces through whose interior the ray's line certainly goes, from the front or from the back
     */
    unsigned front, back;
} ray_lanes;

/* Tests eight faces. Comparisons are written so that a lane with a NaN stays alive and is not
 * certain. */
EBPO_EIGHT void ray_faces(const ebpo_ray_search *r, uint32_t block, ray_lanes *out, bool wide)
{
    ebpo_face_block faces = ebpo_face_block_open(r->s, block);
    projected a = ray_view(r, &faces, wide);
    f8 zero = f8_all(0), least_z = f8_min3(a.z[0], a.z[1], a.z[2]),
       max_z = f8_max3(a.z[0], a.z[1], a.z[2]);
    f8 size_z = f8_add(f8_max(f8_abs(least_z), f8_abs(max_z)), f8_all(r->blur));
    edges e = ray_edges(&a, size_z);
    f8 below = f8_sub(zero, e.error);
    unsigned alive = ~f8_bits(f8_and(f8_less(e.least, below), f8_less(e.error, e.greatest))) &
                     ebpo_face_block_lanes(&faces);
    out->alive = alive;
    if (!alive)
        return;
    f8 left = f8_less(e.error, e.least), right = f8_less(e.greatest, below),
       in = f8_or(left, right);
    out->front = f8_bits(r->shear[2] > 0 ? left : right);
    out->back = f8_bits(r->shear[2] > 0 ? right : left);
    if (r->facing)
        alive &= ~(r->facing > 0 ? out->back : out->front);
    f8 per_step = f8_all(r->shear[2]), size = f8_mul(size_z, f8_all(fabsf(r->shear[2]) * 0x1p-19f));
    f8 whole = f8_add(e.u, f8_add(e.v, e.w)), inverse = f8_div(f8_all(1), whole);
    f8 sum = f8_mul_add(e.u, a.z[0], f8_mul_add(e.v, a.z[1], f8_mul(e.w, a.z[2])));
    f8 t = f8_mul(f8_mul(sum, inverse), per_step);
    f8 share = f8_min(f8_abs(f8_mul(f8_mul(e.error, f8_all(6)), inverse)), f8_all(1));
    f8 error = f8_add(f8_mul(f8_mul(f8_sub(max_z, least_z), share), f8_abs(per_step)), size);
    f8 t0 = f8_mul(least_z, per_step), t1 = f8_mul(max_z, per_step);
    f8 from = f8_pick(in, f8_sub(t, error), f8_sub(f8_min(t0, t1), size)),
       to = f8_pick(in, f8_add(t, error), f8_add(f8_max(t0, t1), size));
    alive &= ~f8_bits(f8_or(f8_less(f8_all(r->bound), from), f8_less(to, zero)));
    out->sure = alive & f8_bits(f8_and(f8_and(in, f8_at_most(zero, from)),
                                       f8_at_most(to, f8_all(r->surely))));
    out->alive = alive;
    f8_store(out->low, from);
    f8_store(out->high, to);
}

/* --- the walk --- */

/* Drops candidates beyond the limit. */
static void drop_beyond(ebpo_ray_search *r)
{
    int kept = 0;
    for (int i = 0; i < r->count; i++)
        if (!(r->waiting[i].low > r->bound))
            r->waiting[kept++] = r->waiting[i];
    r->count = kept;
}

/* Visits a block: adds its possible hits to the candidates, and lowers the limit to certain hits.
 */
EBPO_EIGHT void ray_block(ebpo_ray_search *r, uint32_t block, bool wide)
{
    ray_lanes found;
    const ebpo_meshlet *m = ebpo_accel_meshlet(r->s, block);
    /* Without this, the vertices would be fetched only after the head of the record, which has
     * their number. */
    for (int i = 1; i < (wide ? 6 : 4); i++)
        __builtin_prefetch((const char *)m + EBPO_MESHLET_UNIT * i);
    ray_faces(r, block, &found, wide);
    if (!found.alive)
        return;
    if (r->wants == EBPO_WANTS_ANY && found.sure) {
        r->any_hit = r->done = true;
        return;
    }
    for (unsigned lanes = found.alive; lanes; lanes &= lanes - 1) {
        unsigned lane = (unsigned)__builtin_ctz(lanes);
        int facing = (int)(found.front >> lane & 1) - (int)(found.back >> lane & 1);
        if (r->count == EBPO_RAY_CANDIDATES)
            drop_beyond(r);
        if (r->count == EBPO_RAY_CANDIDATES)
            r->judge(r);
        ebpo_accel_fetch_face(r->s, m->face + lane); /* for the exact test, after the walk */
        r->waiting[r->count++] =
            (ebpo_ray_candidate){ found.low[lane], block * EBPO_BLOCK + lane, facing };
        if (r->wants == EBPO_WANTS_FIRST && found.sure >> lane & 1 && found.high[lane] < r->bound)
            r->bound = found.high[lane];
    }
    if (r->wants == EBPO_WANTS_ANY && r->count)
        r->judge(r);
}

/* Prefetches cache lines of a child for a later visit, without a branch that would often be
 * mispredicted. */
EBPO_EIGHT void ray_fetch(const ebpo_accel *s, uint32_t child, bool wide)
{
    uint64_t number = child & ~EBPO_IS_BLOCK, is_node = (child >> 31) ^ 1;
    uintptr_t faces = (uintptr_t)s->meshlets, nodes = (uintptr_t)s->bound,
              at = faces + (-is_node & (nodes - faces)) + (number * EBPO_MESHLET_UNIT << is_node);
    for (int i = 0; i < (wide ? 4 : 3); i++)
        __builtin_prefetch((const char *)at + 64 * i);
}

/* Returns the nearest of two or more children (`lanes`), and pushes the other children onto the
 * stack, farthest first. */
EBPO_EIGHT uint32_t ray_nearest(const ebpo_accel *s, ebpo_visit *stack, uint32_t *top,
                                const ebpo_bound *b, unsigned lanes, f8 enter, bool wide)
{
    float key[8];
    f8_store(key, enter);
    unsigned first = (unsigned)__builtin_ctz(lanes), rest = lanes & (lanes - 1),
             second = (unsigned)__builtin_ctz(rest);
    if (!(rest & (rest - 1))) {
        ebpo_visit x = ebpo_visit_make(key[first], b->child[first]),
                   y = ebpo_visit_make(key[second], b->child[second]), far = x > y ? x : y;
        stack[(*top)++] = far;
        ray_fetch(s, (uint32_t)far, wide);
        return (uint32_t)(x ^ y ^ far); /* without a branch that would often be mispredicted */
    }
    for (unsigned left = lanes; left; left &= left - 1) {
        unsigned lane = (unsigned)__builtin_ctz(left);
        /* the children that are farther, and earlier children that are as far, are below */
        f8 own = f8_all(key[lane]);
        unsigned below = (f8_bits(f8_less(own, enter)) |
                          (f8_bits(f8_at_most(own, enter)) & ((1u << lane) - 1))) &
                         lanes;
        ray_fetch(s, b->child[lane], wide);
        stack[*top + (uint32_t)__builtin_popcount(below)] =
            ebpo_visit_make(key[lane], b->child[lane]);
    }
    *top += (uint32_t)__builtin_popcount(lanes) - 1;
    return (uint32_t)stack[*top];
}

/* Returns one of two or more children (`lanes`), and pushes the other children onto the stack, in
 * any order. */
EBPO_EIGHT uint32_t ray_next(const ebpo_accel *s, ebpo_visit *stack, uint32_t *top,
                             const ebpo_bound *b, unsigned lanes, bool wide)
{
    unsigned rest = lanes & (lanes - 1);
    do {
        uint32_t child = b->child[(unsigned)__builtin_ctz(rest)];
        stack[(*top)++] = child;
        ray_fetch(s, child, wide);
    } while (rest &= rest - 1);
    return b->child[(unsigned)__builtin_ctz(lanes)];
}

/* Returns one of the children `lanes`, and pushes the others. `sorted`: visits nearer children
 * first, which is faster if the limit decreases during the walk. */
EBPO_EIGHT uint32_t ray_enter(const ebpo_accel *s, ebpo_visit *stack, uint32_t *top,
                              const ebpo_bound *b, unsigned lanes, f8 enter, bool wide, bool sorted)
{
    if (!(lanes & (lanes - 1)))
        return b->child[(unsigned)__builtin_ctz(lanes)];
    return sorted ? ray_nearest(s, stack, top, b, lanes, enter, wide)
                  : ray_next(s, stack, top, b, lanes, wide);
}

/* Pops the next child that is not beyond the limit. Returns false if there is none. */
EBPO_EIGHT bool ray_pop(const ebpo_ray_search *r, const ebpo_visit *stack, uint32_t *top,
                        uint32_t *child, bool sorted)
{
    ebpo_visit v;
    do {
        if (*top == 0)
            return false;
        v = stack[--*top];
    } while (sorted && ebpo_visit_key(v) > r->bound);
    *child = (uint32_t)v;
    return true;
}

/* Walks through a child of the hierarchy (as in ebpo_bound). `stack`: space for the visits.
 * `sorted`: see ray_enter. */
EBPO_EIGHT void ray_walk_in(ebpo_ray_search *r, uint32_t begin, ebpo_visit *stack, bool wide,
                            bool sorted)
{
    const ebpo_accel *s = r->s;
    uint32_t top = 0, child = begin;
    for (;;) {
        while (!(child & EBPO_IS_BLOCK)) {
            f8 enter;
            const ebpo_bound *b = &s->bound[child];
            unsigned lanes = ray_children(r, b, &enter);
            if (lanes)
                child = ray_enter(s, stack, &top, b, lanes, enter, wide, sorted);
            else if (!ray_pop(r, stack, &top, &child, sorted))
                return;
        }
        ray_block(r, child & ~EBPO_IS_BLOCK, wide);
        if (r->done || !ray_pop(r, stack, &top, &child, sorted))
            return;
    }
}

/* Maximum number of visits that wait in a walk for all hits. */
enum { RAY_QUEUE = 2 * EBPO_VISITS_MAX };

/* Walks through a child for all hits. The oldest visit is next, so its memory arrives while the ray
 * makes other visits. If more than EBPO_VISITS_MAX visits wait, the newest one is next, and the
 * queue is a stack of at most EBPO_VISITS_MAX more. */
EBPO_EIGHT void ray_walk_all(ebpo_ray_search *r, uint32_t root, bool wide)
{
    const ebpo_accel *s = r->s;
    uint32_t queue[RAY_QUEUE], begin = 0, end = 1;
    queue[0] = root;
    while (begin != end && !r->done) {
        uint32_t at = end - begin > EBPO_VISITS_MAX ? --end : begin++, next = queue[at % RAY_QUEUE];
        if (next & EBPO_IS_BLOCK) {
            ray_block(r, next & ~EBPO_IS_BLOCK, wide);
            continue;
        }
        f8 enter;
        const ebpo_bound *b = &s->bound[next];
        for (unsigned lanes = ray_children(r, b, &enter); lanes; lanes &= lanes - 1) {
            uint32_t child = b->child[(unsigned)__builtin_ctz(lanes)];
            queue[end++ % RAY_QUEUE] = child;
            ray_fetch(s, child, wide);
        }
    }
}

/* Walks through a child with the variant of the walk for this search. */
static void ray_walk_from(ebpo_ray_search *r, uint32_t begin, ebpo_visit *stack)
{
    bool sorted = r->wants == EBPO_WANTS_FIRST;
    if (r->wants == EBPO_WANTS_ALL && r->s->wide)
        ray_walk_all(r, begin, true);
    else if (r->wants == EBPO_WANTS_ALL)
        ray_walk_all(r, begin, false);
    else if (r->s->wide && sorted)
        ray_walk_in(r, begin, stack, true, true);
    else if (r->s->wide)
        ray_walk_in(r, begin, stack, true, false);
    else if (sorted)
        ray_walk_in(r, begin, stack, false, true);
    else
        ray_walk_in(r, begin, stack, false, false);
}

static void ray_walk(ebpo_ray_search *r)
{
    ebpo_visit stack[EBPO_VISITS_MAX];
    if (r->s->bound_count == 0)
        return;
    d3 from = d3_load(r->ray->origin), d = d3_load(r->ray->direction),
       origin = d3_mul(d3_sub(from, d3_load(r->s->centre)), d3_all(r->s->scale));
    if (!ray_place(r, from, d, origin)) {
        if (!r->place(r))
            return;
        from = d3_load(r->from);
        d = d3_load(r->direction);
        origin = d3_load(r->origin);
    }
    ray_set_boxes(r, d, origin);
    ray_set_faces(r, from);
    ray_walk_from(r, r->s->root_bound, stack);
}

/* --- packets: several rays walked together --- */

/* Begins the search of ray i of a group. Returns NULL if the ray misses all faces. */
static ebpo_ray_search *ray_begin(const ebpo_ray_group *g, unsigned i)
{
    ebpo_ray_search *r = g->begin(g->user, i);
    if (r) {
        ray_set_boxes(r, d3_load(r->direction), d3_load(r->origin));
        ray_set_faces(r, d3_load(r->from));
    }
    return r;
}

/* Several rays together visit the boxes that their *bundle* may intersect. On each axis, the bundle
 * has one origin and one inverse direction for the nearer sides of boxes, and others for the
 * farther sides. They are chosen among those of the rays, so that the bundle enters a box before
 * each of its rays, and leaves it after each: for a positive direction, the nearer sides get the
 * greatest origin and the least inverse, the farther sides the least origin and the greatest
 * inverse. (An inverse that is wrong for a side behind the origin does not matter: the bundle then
 * enters at a negative t, or misses, as all rays do.) The proof for one ray
 * (docs/develop/bounds.md, "A ray against boxes") holds for the bundle, too. It compares the
 * rounding errors with the shift of the origin, at least 8u|o| + E. The shift of the ray whose
 * origin was chosen is as large as this; any other ray's origin is at a distance of at least its
 * own shift from the chosen origin, and if the two origins differ in size, at a greater distance.
 *
 * The arrays are those of ebpo_ray_search, except that origins are not multiplied by the inverses:
 * near_from and far_from are subtracted from sides before the product. The errors are within the
 * bounds of the proof, too. */
typedef struct ray_bundle {
    const uint8_t (*side_at)[3];
    float near_from[3], far_from[3], near_inverse[3], far_inverse[3];
    float bound; /* the greatest bound of all rays */
} ray_bundle;

/* The nearer and farther sides of a node's eight boxes on each axis. */
typedef struct bundle_sides {
    float near[3][8], far[3][8];
} bundle_sides;

/* Returns a bit for each child whose box the bundle may intersect (ray_children). */
EBPO_EIGHT unsigned bundle_children(const ray_bundle *p, const ebpo_bound *b, bundle_sides *sides,
                                    f8 *enter)
{
    f8 from = f8_all(0), to = f8_all(p->bound);
    for (int k = 0; k < 3; k++) {
        f8 origin = f8_all(b->origin[k]), step = f8_all(b->step[k]),
           near = side_at(b, p->side_at[0][k], step, origin),
           far = side_at(b, p->side_at[1][k], step, origin);
        f8_store(sides->near[k], near);
        f8_store(sides->far[k], far);
        from =
            f8_max(f8_mul(f8_sub(near, f8_all(p->near_from[k])), f8_all(p->near_inverse[k])), from);
        to = f8_min(f8_mul(f8_sub(far, f8_all(p->far_from[k])), f8_all(p->far_inverse[k])), to);
    }
    *enter = from;
    return f8_bits(f8_at_most(from, to)) & ((1u << b->count) - 1);
}

/* --- bundles that miss all faces --- */

/* fmax and fmin are function calls. */
EBPO_EIGHT double greater_of(double a, double b) { return a > b ? a : b; }
EBPO_EIGHT double lesser_of(double a, double b) { return a < b ? a : b; }

/* Greatest number of nodes that bundle_misses visits. */
enum { MISS_NODES = 12 };
/* Greatest coordinate of an origin in bundle_misses, as a multiple of the accel's largest
 * coordinate. Origins are not moved, so the bounds of a bundle from far away are wide. */
static const double miss_reach = 64;
/* Sets the bundle on one axis, from the least and greatest origin and direction in the frame. */
EBPO_EIGHT void bundle_set_axis(ray_bundle *b, int k, const double origin[2], const double d[2],
                                double error)
{
    bool down = d[0] < 0;
    double ahead = greater_of(fabs(origin[0]), fabs(origin[1])) * 0x1p-21 + error,
           sign = down ? -1 : 1, nearer = sign / greater_of(fabs(d[!down]), 0x1p-72),
           farther = sign / greater_of(fabs(d[down]), 0x1p-72);
    b->near_from[k] = (float)(down ? origin[0] - ahead : origin[1] + ahead);
    b->far_from[k] = (float)(down ? origin[1] + ahead : origin[0] - ahead);
    b->near_inverse[k] = (float)nearer;
    b->far_inverse[k] = (float)farther;
}

/* Four numbers of an ebpo_ray: those of the origin and the first one of the direction, or those of
 * the direction and t_max. */
EBPO_EIGHT v4d ray_numbers(const double *x)
{
    v4d out;
    memcpy(&out, x, sizeof out);
    return out;
}

/* Sets the bundle of rays. Returns false if they have no bundle: a coordinate of their directions
 * has both signs, the directions need to be scaled, or the origins are far away. */
EBPO_EIGHT bool bundle_set(ray_bundle *b, const ebpo_accel *s, const ebpo_ray *const *ray,
                           unsigned count)
{
    v4d o = ray_numbers(ray[0]->origin), v = ray_numbers(ray[0]->direction), least = o, most = o,
        d_least = v, d_most = v;
    for (unsigned i = 1; i < count; i++) {
        o = ray_numbers(ray[i]->origin);
        v = ray_numbers(ray[i]->direction);
        least = v4d_min(o, least);
        most = v4d_max(o, most);
        d_least = v4d_min(v, d_least);
        d_most = v4d_max(v, d_most);
    }
    double origin[3][2], d[3][2], greatest = 0, longest = 0, sure = 0;
    unsigned signs = 0;
    for (int k = 0; k < 3; k++) {
        origin[k][0] = (least[k] - s->centre[k]) * s->scale;
        origin[k][1] = (most[k] - s->centre[k]) * s->scale;
        d[k][0] = d_least[k];
        d[k][1] = d_most[k];
        if (d[k][0] < 0 && d[k][1] > 0)
            return false;
        greatest = greater_of(greatest, greater_of(fabs(origin[k][0]), fabs(origin[k][1])));
        longest = greater_of(longest, greater_of(fabs(d[k][0]), fabs(d[k][1])));
        sure = greater_of(sure, lesser_of(fabs(d[k][0]), fabs(d[k][1])));
        signs |= (unsigned)(d[k][0] < 0) << k;
    }
    if (!(longest <= EBPO_RAY_LONGEST && sure >= EBPO_RAY_SHORTEST && s->scale > 0 &&
          s->scale < INFINITY && greatest <= miss_reach * s->largest_coordinate))
        return false;
    for (int k = 0; k < 3; k++)
        bundle_set_axis(b, k, origin[k], d[k], ebpo_ray_error(s, greatest));
    b->side_at = ray_side_at[signs];
    b->bound = EBPO_RAY_BEYOND;
    return true;
}

/* Returns true if all rays certainly miss all faces. Only similar rays that do not come near faces
 * are certain. */
static bool bundle_misses(const ebpo_accel *s, const ebpo_ray *const *ray, unsigned count)
{
    ray_bundle bundle;
    uint32_t stack[8 * MISS_NODES];
    unsigned top = 0;
    if (!bundle_set(&bundle, s, ray, count))
        return false;
    stack[top++] = s->root_bound;
    for (int visits = 0; top; visits++) {
        bundle_sides sides;
        f8 enter;
        const ebpo_bound *b = &s->bound[stack[--top]];
        if (visits == MISS_NODES)
            return false;
        for (unsigned lanes = bundle_children(&bundle, b, &sides, &enter); lanes;
             lanes &= lanes - 1) {
            uint32_t child = b->child[__builtin_ctz(lanes)];
            if (child & EBPO_IS_BLOCK)
                return false;
            stack[top++] = child;
        }
    }
    return true;
}

/* --- packets: similar rays walked together --- */

/* Eights of a packet's rays. */
enum { EIGHTS = EBPO_RAY_GROUP / 8 };

/* The rays of a packet in the frame, as in ebpo_ray_search: four in each vector. */
typedef struct packet_frame {
    v4d origin[3][2 * EIGHTS], direction[3][2 * EIGHTS];
    double from[3]; /* the first ray's origin in the model's unit */
    double error;   /* the greatest of all rays */
} packet_frame;

/* Each child that the bundle may intersect is tested for the rays that enter its parent. If these
 * are only a few rays, the bundle is not used: all children are tested for each ray. Arrays of
 * floats have a ray in each lane; all numbers are in the frame, except `high` and `low`. */
typedef struct ray_packet {
    ebpo_ray_group *g;
    unsigned first, count; /* the group's rays first .. first + count - 1 */
    unsigned eights;       /* unused lanes of the last eight repeat a ray */
    packet_frame frame;
    ray_bundle bundle;
    float from_near[3][EBPO_RAY_GROUP], from_far[3][EBPO_RAY_GROUP], inverse[3][EBPO_RAY_GROUP];
    float bounds[EBPO_RAY_GROUP];
    /* For tests of faces (packet_faces). high + low: the first ray's origin in the model's unit.
     * shift: origins minus the first ray's origin. moment: shift x direction. apart: false if all
     * shifts are 0. axis: the longest axis of the first direction. */
    float high[3], low[3], direction[3][EBPO_RAY_GROUP], shift[3][EBPO_RAY_GROUP];
    float moment[3][EBPO_RAY_GROUP];
    bool apart;
    int axis;
    float side_error;               /* error of sides (packet_side), per length of an edge */
    float t_errors[EBPO_RAY_GROUP]; /* error of t for a certain weight of corners */
} ray_packet;

/* Greatest width of a bundle in an accel, in the frame. Wider packets have no advantage. */
static const double packet_width = 0.5;

/* Returns the greatest of eight floats. */
EBPO_EIGHT float greatest_of(f8 a) { return -f8_least(f8_sub(f8_all(0), a)); }

/* Returns a bit for each of the eight rays from `begin` that is similar enough to the first one to
 * walk with it: all directions have the same signs, and the bundle is narrow, all the way to the
 * far end of the accel. */
EBPO_EIGHT unsigned packet_similar(const packet_frame *f, const ebpo_accel *s, unsigned begin)
{
    double longest = 0, way = s->largest_coordinate;
    unsigned out = 0;
    for (int k = 0; k < 3; k++) {
        double d = fabs(f->direction[k][0][0]), o = fabs(f->origin[k][0][0]);
        longest = d > longest ? d : longest;
        way = o > way ? o : way;
    }
    for (unsigned h = 0; h < 2; h++) {
        v4l similar = ~(v4l){ 0, 0, 0, 0 };
        for (int k = 0; k < 3; k++) {
            v4d origin = f->origin[k][begin / 4 + h], d = f->direction[k][begin / 4 + h],
                first = v4d_all(f->direction[k][0][0]);
            similar &= v4d_abs(origin - f->origin[k][0][0]) * longest + v4d_abs(d - first) * way <
                       packet_width * longest;
            similar &= ~((v4l)d ^ (v4l)first);
        }
        out |= v4l_mask(similar) << 4 * h;
    }
    return out;
}

/* Sets the bundle's bound after bounds of rays have changed. */
EBPO_EIGHT void packet_set_bound(ray_packet *p)
{
    f8 greatest = f8_load(p->bounds);
    for (unsigned e = 1; e < p->eights; e++)
        greatest = f8_max(f8_load(p->bounds + 8 * e), greatest);
    p->bundle.bound = greatest_of(greatest);
}

/* Returns these bits in all lanes. */
EBPO_EIGHT f8 f8_of_bits(uint32_t bits)
{
    float x;
    memcpy(&x, &bits, sizeof x);
    return f8_all(x);
}

/* Sets what tests of boxes use (ray_set_boxes), on one axis. */
EBPO_EIGHT void packet_set_axis(ray_packet *p, int k)
{
    const packet_frame *f = &p->frame;
    bool down = v4l_mask((v4l)f->direction[k][0]) & 1;
    f8 most_near = f8_all(-INFINITY), most_far = most_near, most_inverse = most_near,
       least_near = f8_all(INFINITY), least_far = least_near, least_inverse = least_near;
    for (unsigned e = 0; e < p->eights; e++) {
        v4d near[2], far[2], inverse[2];
        for (int h = 0; h < 2; h++) {
            v4d d = f->direction[k][2 * e + h], origin = f->origin[k][2 * e + h],
                ahead = v4d_signed(v4d_abs(origin) * 0x1p-21 + f->error, d);
            near[h] = origin + ahead;
            far[h] = origin - ahead;
            inverse[h] = 1 / v4d_signed(v4d_max(v4d_abs(d), v4d_all(0x1p-72)), d);
        }
        f8 n = f8_from_doubles(near[0], near[1]), a = f8_from_doubles(far[0], far[1]),
           i = f8_from_doubles(inverse[0], inverse[1]);
        f8_store(p->from_near[k] + 8 * e, n);
        f8_store(p->from_far[k] + 8 * e, a);
        f8_store(p->inverse[k] + 8 * e, i);
        most_near = f8_max(n, most_near);
        least_near = f8_min(n, least_near);
        most_far = f8_max(a, most_far);
        least_far = f8_min(a, least_far);
        most_inverse = f8_max(i, most_inverse);
        least_inverse = f8_min(i, least_inverse);
    }
    float least = f8_least(least_inverse), most = greatest_of(most_inverse);
    p->bundle.near_from[k] = down ? f8_least(least_near) : greatest_of(most_near);
    p->bundle.far_from[k] = down ? greatest_of(most_far) : f8_least(least_far);
    p->bundle.near_inverse[k] = down ? most : least;
    p->bundle.far_inverse[k] = down ? least : most;
}

/* Sets what tests of boxes use, except the bounds. */
EBPO_EIGHT void packet_set(ray_packet *p)
{
    unsigned signs = 0;
    for (int k = 0; k < 3; k++) {
        packet_set_axis(p, k);
        signs |= (v4l_mask((v4l)p->frame.direction[k][0]) & 1) << k;
    }
    p->bundle.side_at = ray_side_at[signs];
}

/* Sets what tests of faces use. */
EBPO_EIGHT void packet_set_faces(ray_packet *p, const ebpo_accel *s)
{
    const packet_frame *f = &p->frame;
    v4d longest = v4d_all(0), widest = v4d_all(0);
    p->axis = 0;
    for (int k = 0; k < 3; k++) {
        v4d first = v4d_all(f->origin[k][0][0]);
        for (unsigned e = 0; e < p->eights; e++) {
            const v4d *d = &f->direction[k][2 * e];
            v4d x = f->origin[k][2 * e] - first, y = f->origin[k][2 * e + 1] - first;
            longest = v4d_max(v4d_abs(d[0]), v4d_max(v4d_abs(d[1]), longest));
            widest = v4d_max(v4d_abs(x), v4d_max(v4d_abs(y), widest));
            f8_store(p->shift[k] + 8 * e, f8_from_doubles(x, y));
            f8_store(p->direction[k] + 8 * e, f8_from_doubles(d[0], d[1]));
        }
        if (fabs(f->direction[k][0][0]) > fabs(f->direction[p->axis][0][0]))
            p->axis = k;
        p->high[k] = (float)f->from[k];
        p->low[k] = (float)(f->from[k] - (double)p->high[k]);
    }
    double width = v4d_greatest(widest), way = s->largest_coordinate + width;
    for (int k = 0; k < 3; k++)
        way = greater_of(way, s->largest_coordinate + width + fabs(f->origin[k][0][0]));
    float reach = (float)(way + f->error * 0x1p23 + 0x1p-30);
    p->apart = width > 0;
    p->side_error = reach * (float)v4d_greatest(longest) * 0x1.2p-18f;
    for (unsigned i = 0; i < 8 * p->eights; i += 8) {
        f8_store(p->t_errors + i,
                 f8_mul(f8_abs(f8_load(p->inverse[p->axis] + i)), f8_all(reach * 0x1p-19f)));
        for (int k = 0; k < 3 && p->apart; k++) {
            int u = k == 2 ? 0 : k + 1, v = k == 0 ? 2 : k - 1;
            f8_store(p->moment[k] + i,
                     f8_sub(f8_mul(f8_load(p->shift[u] + i), f8_load(p->direction[v] + i)),
                            f8_mul(f8_load(p->shift[v] + i), f8_load(p->direction[u] + i))));
        }
    }
}

/* Returns a bit for each of the eights begin .. end - 1 of rays that may intersect the box of child
 * `lane` before the ray's bound. */
EBPO_EIGHT unsigned packet_rays(const ray_packet *p, const bundle_sides *sides, unsigned lane,
                                unsigned begin, unsigned end)
{
    unsigned out = 0;
    for (unsigned i = begin; i < end; i += 8) {
        f8 from = f8_all(0), to = f8_load(p->bounds + i);
        for (int k = 0; k < 3; k++) {
            f8 near = f8_all(sides->near[k][lane]), far = f8_all(sides->far[k][lane]),
               inverse = f8_load(p->inverse[k] + i);
            from = f8_max(f8_mul(f8_sub(near, f8_load(p->from_near[k] + i)), inverse), from);
            to = f8_min(f8_mul(f8_sub(far, f8_load(p->from_far[k] + i)), inverse), to);
        }
        out |= f8_bits(f8_at_most(from, to)) << i;
    }
    return out;
}

/* Returns the search of a ray of the packet; NULL if the ray misses all faces. (This is certain
 * before the walk only for rays with moved origins, which packet_read refuses.) */
static ebpo_ray_search *packet_search(ray_packet *p, unsigned i)
{
    ebpo_ray_search **search = &p->g->search[p->first + i];
    if (!*search)
        *search = ray_begin(p->g, p->first + i);
    return *search;
}

/* The faces of a block, relative to the first origin of a packet. Edge i is from corner i to the
 * next corner. */
typedef struct packet_faces {
    f8 corner[3][3]; /* [axis][corner] */
    f8 edge[3][3];   /* [axis][edge] */
    f8 turn[3][3];   /* [axis][edge] corner i x edge i */
    f8 error;        /* bound of the error of sides (packet_side) */
    unsigned lanes;  /* a bit for each face */
} packet_faces;

/* Reads the corners and edges of a block on one axis. */
EBPO_EIGHT void packet_read_axis(const ray_packet *p, const ebpo_accel *s, const ebpo_face_block *b,
                                 int axis, packet_faces *out)
{
    f8 x[3], high = f8_all(p->high[axis]), low = f8_all(p->low[axis]),
             scale = f8_all((float)s->scale);
    ebpo_face_block_floats(b, axis, x);
    for (int i = 0; i < 3; i++) {
        out->corner[axis][i] = f8_mul(f8_sub(f8_sub(x[i], high), low), scale);
        out->edge[axis][i] = f8_mul(f8_sub(x[i == 2 ? 0 : i + 1], x[i]), scale);
    }
}

/* Does the same for blocks of doubles. */
static void packet_read_wide(const ray_packet *p, const ebpo_accel *s, const ebpo_face_block *b,
                             int axis, packet_faces *out)
{
    double x[3][EBPO_BLOCK];
    float at[3][EBPO_BLOCK], along[3][EBPO_BLOCK];
    ebpo_face_block_doubles(b, axis, x);
    for (int i = 0; i < 3; i++)
        for (int lane = 0; lane < EBPO_BLOCK; lane++) {
            at[i][lane] = (float)((x[i][lane] - p->frame.from[axis]) * s->scale);
            along[i][lane] = (float)((x[i == 2 ? 0 : i + 1][lane] - x[i][lane]) * s->scale);
        }
    for (int i = 0; i < 3; i++) {
        out->corner[axis][i] = f8_load(at[i]);
        out->edge[axis][i] = f8_load(along[i]);
    }
}

/* Computes one axis of the turns. Returns the greatest size of the edges on this axis. */
EBPO_EIGHT f8 packet_turn(packet_faces *f, int axis, int u, int v)
{
    const f8 *e = f->edge[axis];
    for (int i = 0; i < 3; i++)
        f->turn[axis][i] =
            f8_sub(f8_mul(f->corner[u][i], f->edge[v][i]), f8_mul(f->corner[v][i], f->edge[u][i]));
    return f8_max3(f8_abs(e[0]), f8_abs(e[1]), f8_abs(e[2]));
}

EBPO_EIGHT void packet_set_block(const ray_packet *p, const ebpo_accel *s, uint32_t block,
                                 packet_faces *out)
{
    ebpo_face_block b = ebpo_face_block_open(s, block);
    if (__builtin_expect(s->wide, 0)) {
        for (int k = 0; k < 3; k++)
            packet_read_wide(p, s, &b, k, out);
    } else {
        packet_read_axis(p, s, &b, 0, out);
        packet_read_axis(p, s, &b, 1, out);
        packet_read_axis(p, s, &b, 2, out);
    }
    f8 longest =
        f8_max3(packet_turn(out, 0, 1, 2), packet_turn(out, 1, 2, 0), packet_turn(out, 2, 0, 1));
    out->error = f8_add(f8_mul(longest, f8_all(p->side_error)), f8_all(0x1p-100f));
    out->lanes = ebpo_face_block_lanes(&b);
}

/* Returns d . (corner x edge), relative to the ray's origin: the side of the edge on which the ray
 * passes. */
EBPO_EIGHT f8 packet_side(const ray_packet *p, const packet_faces *b, int i, unsigned ray)
{
    f8 side = f8_mul(f8_all(p->direction[0][ray]), b->turn[0][i]);
    side = f8_add(side, f8_mul(f8_all(p->direction[1][ray]), b->turn[1][i]));
    side = f8_add(side, f8_mul(f8_all(p->direction[2][ray]), b->turn[2][i]));
    if (!p->apart)
        return side;
    f8 more = f8_mul(f8_all(p->moment[0][ray]), b->edge[0][i]);
    more = f8_add(more, f8_mul(f8_all(p->moment[1][ray]), b->edge[1][i]));
    more = f8_add(more, f8_mul(f8_all(p->moment[2][ray]), b->edge[2][i]));
    return f8_add(side, more);
}

/* Tests the faces of a block with one ray, as ray_faces does. (docs/develop/bounds.md, "A packet
 * against eight faces") */
EBPO_EIGHT void packet_hits(const ray_packet *p, const packet_faces *b, unsigned ray, f8 bound,
                            ray_lanes *out)
{
    f8 side[3], zero = f8_all(0), below = f8_sub(zero, b->error);
    for (int i = 0; i < 3; i++)
        side[i] = packet_side(p, b, i, ray);
    f8 least = f8_min3(side[0], side[1], side[2]), greatest = f8_max3(side[0], side[1], side[2]);
    unsigned alive =
        ~f8_bits(f8_and(f8_less(least, below), f8_less(b->error, greatest))) & b->lanes;
    out->alive = alive;
    if (!alive)
        return;
    f8 leaves = f8_less(b->error, least), enters = f8_less(greatest, below),
       in = f8_or(leaves, enters);
    out->front = f8_bits(enters);
    out->back = f8_bits(leaves);
    if (p->g->facing)
        alive &= ~(p->g->facing > 0 ? out->back : out->front);
    f8 per_step = f8_all(p->inverse[p->axis][ray]), shift = f8_all(p->shift[p->axis][ray]),
       size = f8_all(p->t_errors[ray]);
    const f8 *z = b->corner[p->axis];
    f8 least_z = f8_min3(z[0], z[1], z[2]), greatest_z = f8_max3(z[0], z[1], z[2]);
    f8 inverse = f8_div(f8_all(1), f8_add(side[0], f8_add(side[1], side[2])));
    f8 sum = f8_add(f8_mul(side[1], z[0]), f8_add(f8_mul(side[2], z[1]), f8_mul(side[0], z[2])));
    f8 t = f8_mul(f8_sub(f8_mul(sum, inverse), shift), per_step);
    f8 share = f8_min(f8_abs(f8_mul(f8_mul(b->error, f8_all(6)), inverse)), f8_all(1));
    f8 error = f8_add(f8_mul(f8_mul(f8_sub(greatest_z, least_z), share), f8_abs(per_step)), size);
    f8 t0 = f8_mul(f8_sub(least_z, shift), per_step),
       t1 = f8_mul(f8_sub(greatest_z, shift), per_step);
    f8 from = f8_pick(in, f8_sub(t, error), f8_sub(f8_min(t0, t1), size)),
       to = f8_pick(in, f8_add(t, error), f8_add(f8_max(t0, t1), size));
    alive &= ~f8_bits(f8_or(f8_less(bound, from), f8_less(to, zero)));
    /* Beyond t_max, the hit has no result, but lowers the bound: all farther hits have none. */
    out->sure = alive & f8_bits(f8_and(in, f8_at_most(zero, from)));
    out->alive = alive;
    f8_store(out->low, from);
    f8_store(out->high, to);
}

/* Drops candidates of ray i of the packet that are beyond `bound`. */
static void packet_drop_beyond(ray_packet *p, unsigned i, float bound)
{
    ebpo_ray_candidate *waiting = p->g->candidate[p->first + i];
    uint8_t *few = &p->g->few[p->first + i], kept = 0;
    for (unsigned k = 0; k < *few; k++)
        if (!(waiting[k].low > bound))
            waiting[kept++] = waiting[k];
    *few = kept;
}

/* Moves the candidates of ray i of the packet to its search. */
static void packet_move_waiting(ray_packet *p, unsigned i, ebpo_ray_search *r)
{
    uint8_t *few = &p->g->few[p->first + i];
    memcpy(r->waiting, p->g->candidate[p->first + i], *few * sizeof *r->waiting);
    r->count = *few;
    *few = 0;
}

/* Tests all candidates of ray i of the packet. Returns the new bound. */
static float packet_judge(ray_packet *p, unsigned i, float bound)
{
    ebpo_ray_search *r = packet_search(p, i);
    packet_move_waiting(p, i, r);
    r->bound = bound < r->bound ? bound : r->bound;
    r->judge(r);
    return r->bound;
}

/* Adds a ray's possible hits in a block to its candidates. Returns the ray's bound, which certain
 * hits lower. */
EBPO_EIGHT float packet_keep(ray_packet *p, unsigned i, uint32_t block, const ray_lanes *found,
                             float bound)
{
    ebpo_ray_candidate *waiting = p->g->candidate[p->first + i];
    uint8_t *few = &p->g->few[p->first + i];
    for (unsigned lanes = found->alive; lanes; lanes &= lanes - 1) {
        unsigned lane = (unsigned)__builtin_ctz(lanes);
        int facing = (int)(found->front >> lane & 1) - (int)(found->back >> lane & 1);
        if (*few == EBPO_RAY_FEW)
            packet_drop_beyond(p, i, bound);
        if (*few == EBPO_RAY_FEW)
            bound = packet_judge(p, i, bound);
        waiting[(*few)++] =
            (ebpo_ray_candidate){ found->low[lane], block * EBPO_BLOCK + lane, facing };
        if (found->sure >> lane & 1 && found->high[lane] < bound)
            bound = found->high[lane];
    }
    return bound;
}

/* Visits a block with the rays that may intersect its box at a t of at least `enter`. */
static void packet_block(ray_packet *p, const ebpo_accel *s, uint32_t block, unsigned rays,
                         float enter)
{
    packet_faces faces;
    for (unsigned left = rays; left; left &= left - 1)
        if (p->bounds[__builtin_ctz(left)] < enter)
            rays &= ~(left & -left);
    if (!rays)
        return;
    packet_set_block(p, s, block, &faces);
    for (; rays; rays &= rays - 1) {
        unsigned i = (unsigned)__builtin_ctz(rays);
        ray_lanes found;
        packet_hits(p, &faces, i, f8_all(p->bounds[i]), &found);
        if (found.alive)
            p->bounds[i] = packet_keep(p, i, block, &found, p->bounds[i]);
    }
}

/* Finds which of the rays may enter each child of a node: in[lane] has a bit for each ray. Returns
 * a bit for each child that a ray may enter. *enter: at most the t at which the first ray enters
 * each child. Tests the children that the bundle may intersect with eight rays at a time. */
EBPO_EIGHT unsigned packet_children(ray_packet *p, const ebpo_bound *b, unsigned rays,
                                    uint32_t in[8], f8 *enter)
{
    bundle_sides sides;
    unsigned found = 0, begin = (unsigned)__builtin_ctz(rays) & ~7u,
             end = 32 - (unsigned)__builtin_clz(rays);
    packet_set_bound(p);
    for (unsigned lanes = bundle_children(&p->bundle, b, &sides, enter); lanes;
         lanes &= lanes - 1) {
        unsigned lane = (unsigned)__builtin_ctz(lanes);
        in[lane] = packet_rays(p, &sides, lane, begin, end) & rays;
        found |= (unsigned)(in[lane] != 0) << lane;
    }
    return found;
}

/* Does the same as packet_children for a few rays: tests eight children with one ray at a time. */
EBPO_EIGHT unsigned packet_children_of_few(const ray_packet *p, const ebpo_bound *b, unsigned rays,
                                           uint32_t in[8], f8 *enter)
{
    f8 near[3], far[3], every = f8_all(0), any = every, least = f8_all(EBPO_RAY_BEYOND);
    for (int k = 0; k < 3; k++) {
        f8 origin = f8_all(b->origin[k]), step = f8_all(b->step[k]);
        near[k] = side_at(b, p->bundle.side_at[0][k], step, origin);
        far[k] = side_at(b, p->bundle.side_at[1][k], step, origin);
    }
    for (; rays; rays &= rays - 1) {
        unsigned i = (unsigned)__builtin_ctz(rays);
        f8 from = f8_all(0), to = f8_all(p->bounds[i]);
        for (int k = 0; k < 3; k++) {
            f8 inverse = f8_all(p->inverse[k][i]);
            from = f8_max(f8_mul(f8_sub(near[k], f8_all(p->from_near[k][i])), inverse), from);
            to = f8_min(f8_mul(f8_sub(far[k], f8_all(p->from_far[k][i])), inverse), to);
        }
        f8 enters = f8_at_most(from, to);
        any = f8_or(any, enters);
        every = f8_or(every, f8_and(enters, f8_of_bits(1u << i)));
        least = f8_min(from, least);
    }
    memcpy(in, &every, sizeof every);
    *enter = least;
    return f8_bits(any) & ((1u << b->count) - 1);
}

/* Greatest number of rays for packet_children_of_few. */
enum { PACKET_FEW = 6 };

/* Visits a node: pushes the children that one of the rays may enter, farthest first. Returns the
 * new top of the stack. */
EBPO_EIGHT uint32_t packet_node(ray_packet *p, const ebpo_accel *s, ebpo_visit *stack, uint32_t top,
                                uint32_t node, unsigned rays)
{
    const ebpo_bound *b = &s->bound[node];
    f8 enter;
    float key[8];
    uint32_t in[8];
    unsigned found = __builtin_popcount(rays) <= PACKET_FEW
                         ? packet_children_of_few(p, b, rays, in, &enter)
                         : packet_children(p, b, rays, in, &enter);
    f8_store(key, enter);
    for (unsigned lanes = found; lanes; lanes &= lanes - 1) {
        unsigned lane = (unsigned)__builtin_ctz(lanes), before = (1u << lane) - 1;
        /* the children that are farther, and earlier children that are as far, are below */
        f8 own = f8_all(key[lane]);
        unsigned below =
            (f8_bits(f8_less(own, enter)) | (f8_bits(f8_at_most(own, enter)) & before)) & found;
        uint32_t at = top + (uint32_t)__builtin_popcount(below);
        ray_fetch(s, b->child[lane], s->wide);
        stack[at] = (ebpo_visit)in[lane] << 32 | b->child[lane];
        p->g->enter[at] = key[lane];
    }
    return top + (uint32_t)__builtin_popcount(found);
}

/* Walks through the accel with all rays. A visit on the stack has a bit for each ray that may enter
 * the child's box in place of the key; g->enter has the key. Returns a bit for each ray of the
 * group with candidates or a search. */
static uint32_t packet_walk(ray_packet *p, const ebpo_accel *s, ebpo_visit *stack)
{
    uint32_t open = 0,
             top = packet_node(p, s, stack, 0, s->root_bound, UINT32_MAX >> (32 - p->count));
    while (top) {
        ebpo_visit v = stack[--top];
        uint32_t child = (uint32_t)v, rays = (uint32_t)(v >> 32);
        if (child & EBPO_IS_BLOCK)
            packet_block(p, s, child & ~EBPO_IS_BLOCK, rays, p->g->enter[top]);
        else
            top = packet_node(p, s, stack, top, child, rays);
    }
    for (unsigned i = 0; i < p->count; i++) {
        ebpo_ray_search *r = p->g->search[p->first + i];
        packet_drop_beyond(p, i, p->bounds[i]);
        open |= (uint32_t)(r || p->g->few[p->first + i]) << (p->first + i);
        if (r)
            packet_move_waiting(p, i, r);
    }
    return open;
}

/* --- turns: several rays walked in turns --- */

/* The walk of a ray that takes turns with other rays. Between its turns, the memory that the ray
 * needs next is fetched. */
typedef struct ray_turn {
    ebpo_ray_search *r;
    ebpo_visit *stack; /* [EBPO_VISITS_MAX] */
    uint32_t top;      /* number of visits on the stack */
    uint32_t next;     /* the child to visit at the next turn */
} ray_turn;

/* Visits children until the ray needs a child that is not prefetched yet, and prefetches it.
 * Returns false if the walk is complete. */
EBPO_EIGHT bool ray_take_turn(ray_turn *w, bool wide, bool sorted)
{
    ebpo_ray_search *r = w->r;
    const ebpo_accel *s = r->s;
    uint32_t top = w->top, child = w->next;
    for (;;) {
        if (child & EBPO_IS_BLOCK) {
            ray_block(r, child & ~EBPO_IS_BLOCK, wide);
        } else {
            f8 enter;
            const ebpo_bound *b = &s->bound[child];
            unsigned lanes = ray_children(r, b, &enter);
            if (lanes) {
                w->next = ray_enter(s, w->stack, &top, b, lanes, enter, wide, sorted);
                w->top = top;
                ray_fetch(s, w->next, wide);
                return true;
            }
        }
        do {
            if (top == 0 || r->done)
                return false;
            child = (uint32_t)w->stack[--top];
        } while (sorted && ebpo_visit_key(w->stack[top]) > r->bound);
    }
}

/* Walks through the accel with rays of a group that take turns. */
EBPO_EIGHT void ray_walk_in_turns(ebpo_ray_search *const *ray, unsigned count, ebpo_ray_group *g,
                                  bool wide, bool sorted)
{
    ray_turn turn[EBPO_RAY_TURNS];
    unsigned next = count < EBPO_RAY_TURNS ? count : EBPO_RAY_TURNS, left = next;
    for (unsigned i = 0; i < left; i++)
        turn[i] = (ray_turn){ ray[i], g->stack[i], 0, g->s->root_bound };
    for (unsigned i = 0; left; i = i < left ? i : 0) {
        if (ray_take_turn(&turn[i], wide, sorted)) {
            i++;
            continue;
        }
        drop_beyond(turn[i].r);
        if (next < count)
            turn[i] = (ray_turn){ ray[next++], turn[i].stack, 0, g->s->root_bound };
        else
            turn[i] = turn[--left];
    }
}

/* --- a group of rays --- */

/* Transforms eight rays from `begin` to the frame as place_ray (rays.c) does, and sets their
 * bounds. No search is begun: many rays of a picture miss all blocks. Lanes after the last ray
 * repeat the first of the eight. Returns false if place_ray would move an origin or scale a
 * direction. */
EBPO_EIGHT bool packet_read(ray_packet *p, packet_frame *f, unsigned begin, unsigned count)
{
    const ebpo_accel *s = p->g->s;
    v4d far = v4d_all(0), beyond = v4d_all((double)EBPO_RAY_BEYOND), bound[2];
    v4l plain = ~(v4l){ 0, 0, 0, 0 };
    for (unsigned h = 0; h < 2; h++) {
        const ebpo_ray *ray[4];
        for (unsigned i = 0; i < 4; i++)
            ray[i] = p->g->ray[p->first + begin + (4 * h + i < count ? 4 * h + i : 0)];
        v4d longest = v4d_all(0);
        for (int k = 0; k < 3; k++) {
            v4d origin = { ray[0]->origin[k], ray[1]->origin[k], ray[2]->origin[k],
                           ray[3]->origin[k] },
                d = { ray[0]->direction[k], ray[1]->direction[k], ray[2]->direction[k],
                      ray[3]->direction[k] };
            f->direction[k][begin / 4 + h] = d;
            f->origin[k][begin / 4 + h] = origin = (origin - s->centre[k]) * s->scale;
            far = v4d_max(v4d_abs(origin), far);
            longest = v4d_max(v4d_abs(d), longest);
        }
        plain &= longest >= EBPO_RAY_SHORTEST;
        plain &= longest <= EBPO_RAY_LONGEST;
        v4d t = { ray[0]->t_max, ray[1]->t_max, ray[2]->t_max, ray[3]->t_max };
        bound[h] = v4d_min(t * s->scale * (1 + 0x1p-20) + 0x1p-90, beyond);
    }
    if (begin == 0)
        memcpy(f->from, p->g->ray[p->first]->origin, sizeof f->from);
    f8_store(p->bounds + begin, f8_from_doubles(bound[0], bound[1]));
    double farthest = v4d_greatest(far);
    f->error = greater_of(f->error, ebpo_ray_error(s, farthest));
    return v4l_mask(plain) == 15 && farthest <= EBPO_RAY_NEAR * s->largest_coordinate &&
           s->scale > 0 && s->scale < INFINITY;
}

/* Does the same as packet_read with searches, which the function begins. */
static void packet_read_begun(ray_packet *p, packet_frame *f, unsigned begin, unsigned count)
{
    const ebpo_ray_search *any = NULL;
    for (unsigned i = begin; i < begin + count; i++) {
        const ebpo_ray_search *r = packet_search(p, i);
        any = r ? r : any;
    }
    for (unsigned i = begin; i < begin + 8; i++) {
        const ebpo_ray_search *r = i < begin + count ? p->g->search[p->first + i] : NULL;
        p->bounds[i] = r ? r->bound : -1; /* -1: misses all boxes */
        r = r ? r : any;
        if (i == 0 && r)
            memcpy(f->from, r->from, sizeof f->from);
        for (int k = 0; k < 3; k++) {
            f->origin[k][i / 4][i % 4] = r ? r->origin[k] : 0;
            f->direction[k][i / 4][i % 4] = r ? r->direction[k] : 0;
        }
        f->error = r && r->error > f->error ? r->error : f->error;
    }
}

/* Reads the longest run of similar rays from p->first. Returns false if the first ray has no
 * similar neighbour. An origin that is too far for the frame (set_error in rays.c) is unknown
 * there, so its ray cannot be compared with other rays. */
static bool packet_read_run(ray_packet *p)
{
    const ebpo_accel *s = p->g->s;
    unsigned rest = p->g->count - p->first;
    p->count = p->eights = 0;
    p->frame.error = 0;
    for (unsigned begin = 0; begin < rest; begin += 8) {
        unsigned count = rest - begin < 8 ? rest - begin : 8;
        double before = p->frame.error;
        if (!packet_read(p, &p->frame, begin, count)) {
            p->frame.error = before;
            packet_read_begun(p, &p->frame, begin, count);
        }
        unsigned other = ~packet_similar(&p->frame, s, begin) | 1u << count,
                 same = (unsigned)__builtin_ctz(other);
        if (!(p->frame.error < (double)EBPO_RAY_BEYOND)) {
            p->frame.error = before;
            break;
        }
        if (same == 0)
            break;
        p->count = begin + same;
        p->eights++;
        if (same < 8) {
            for (unsigned i = p->count; i < 8 * p->eights; i++) {
                p->bounds[i] = -1;
                for (int k = 0; k < 3; k++) {
                    p->frame.origin[k][i / 4][i % 4] = p->frame.origin[k][0][0];
                    p->frame.direction[k][i / 4][i % 4] = p->frame.direction[k][0][0];
                }
            }
            break;
        }
    }
    return p->count > 1;
}

/* Walks with similar rays of the group, beginning with ray p->first. Adds searches of rays that are
 * not similar to `other`. Adds a bit to *open for each ray that has candidates or a search. Returns
 * the number of rays. */
static unsigned ray_walk_packet(ray_packet *p, ebpo_ray_search **other, unsigned *others,
                                uint32_t *open)
{
    ebpo_ray_group *g = p->g;
    const ebpo_accel *s = g->s;
    unsigned rest = g->count - p->first;
    if (rest > 1 && !(s->root_bound & EBPO_IS_BLOCK)) {
        if (bundle_misses(s, g->ray + p->first, rest))
            return rest;
        if (g->wants == EBPO_WANTS_FIRST && packet_read_run(p)) {
            packet_set(p);
            packet_set_faces(p, s);
            *open |= packet_walk(p, s, g->stack[0]);
            return p->count;
        }
    }
    rest = rest < 8 ? rest : 8;
    for (unsigned i = 0; i < rest; i++)
        if (packet_search(p, i)) {
            other[(*others)++] = g->search[p->first + i];
            *open |= UINT32_C(1) << (p->first + i);
        }
    return rest;
}

static uint32_t ray_walk_many(ebpo_ray_group *g)
{
    ebpo_ray_search *other[EBPO_RAY_GROUP];
    unsigned others = 0;
    uint32_t open = 0;
    bool wide = g->s->wide, sorted = g->wants == EBPO_WANTS_FIRST;
    ray_packet p;
    p.g = g;
    memset(g->search, 0, sizeof g->search);
    memset(g->few, 0, sizeof g->few);
    for (p.first = 0; p.first < g->count && g->s->bound_count;)
        p.first += ray_walk_packet(&p, other, &others, &open);
    if (wide && sorted)
        ray_walk_in_turns(other, others, g, true, true);
    else if (wide)
        ray_walk_in_turns(other, others, g, true, false);
    else if (sorted)
        ray_walk_in_turns(other, others, g, false, true);
    else
        ray_walk_in_turns(other, others, g, false, false);
    return open;
}

const ebpo_ray_kernels EBPO_KERNEL(ebpo_ray_kernels) = { ray_walk, ray_walk_many };
