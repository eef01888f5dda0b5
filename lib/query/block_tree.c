/* Makes the hierarchy over the blocks of an accel (accel.h) from the boxes of the blocks.
 *
 * The blocks of a node are divided among at most eight children: all blocks are cut in two groups,
 * then the group with the largest box, until there are eight groups. A cut divides a group by the
 * centres of its boxes. Of three cuts on each axis, the one with the least cost is chosen: the sum
 * over both parts of the surface of the part's box times the number of full nodes that the part
 * needs. (The share of rays that visit a box is about proportional to its surface.) */
#include "core/strict_fp.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>
#if defined(__SSE2__)
#include <emmintrin.h>
#endif

#include "core/alloc.h"
#include "core/error.h"
#include "query/accel_parts.h"

/* BINS: an axis is divided into this number of equal parts, between which a group may be cut.
 * SAMPLES: of a larger group, about this number of blocks is read to choose a cut. LEAST: least
 * number of blocks on each side of a cut, which bounds the number of nodes. DEEP: nodes at this
 * depth and below are cut into equal numbers of blocks, which bounds the depth. */
enum { BINS = 4, SAMPLES = 64, LEAST = EBPO_BLOCK / 2, DEEP = 24 };

typedef float v4f __attribute__((vector_size(16)));
typedef int32_t v4i __attribute__((vector_size(16)));

#if defined(__SSE2__)
static inline v4f lesser_four(v4f a, v4f b) { return (v4f)_mm_min_ps((__m128)a, (__m128)b); }
static inline v4f greater_four(v4f a, v4f b) { return (v4f)_mm_max_ps((__m128)a, (__m128)b); }
static inline v4i whole_four(v4f a) { return (v4i)_mm_cvttps_epi32((__m128)a); }
#else
static inline v4f pick_four(v4i mask, v4f yes, v4f no)
{
    return (v4f)(((v4i)yes & mask) | ((v4i)no & ~mask));
}
static inline v4f lesser_four(v4f a, v4f b) { return pick_four(a < b, a, b); }
static inline v4f greater_four(v4f a, v4f b) { return pick_four(a > b, a, b); }
static inline v4i whole_four(v4f a) { return __builtin_convertvector(a, v4i); }
#endif

/* A box; the last lane is not used. */
typedef struct box {
    v4f low, high;
} box;

static inline box empty_box(void)
{
    return (box){ { INFINITY, INFINITY, INFINITY, INFINITY },
                  { -INFINITY, -INFINITY, -INFINITY, -INFINITY } };
}

static inline void add_box(box *to, const box *b)
{
    to->low = lesser_four(b->low, to->low);
    to->high = greater_four(b->high, to->high);
}

/* Returns twice the centre of a box. */
static inline v4f centre_of(const box *b) { return b->low + b->high; }

/* Returns half the surface of a box, or 0 if the box is empty. */
static inline float surface_of(const box *b)
{
    v4f d = b->high - b->low;
    return d[0] >= 0 ? d[0] * d[1] + d[1] * d[2] + d[2] * d[0] : 0;
}

/* The blocks order[begin .. end - 1] of a builder. The boxes are around samples of the blocks, and
 * around the doubled centres of their boxes. */
typedef struct group {
    uint32_t begin, end;
    box all, centres;
} group;

typedef struct builder {
    ebpo_layout *out;
    box *boxes;      /* [block] */
    uint32_t *order; /* [block_count] the blocks below a node are contiguous */
    uint32_t *moved; /* [block_count] space for one side of a cut */
    bool failed;     /* out of memory */
} builder;

static uint32_t size_of(const group *g) { return g->end - g->begin; }

/* Returns the distance of the blocks of a group that are read. */
static uint32_t step_of(uint32_t count) { return count / SAMPLES + 1; }

static group make_group(const builder *t, uint32_t begin, uint32_t end)
{
    group g = { begin, end, empty_box(), empty_box() };
    for (uint32_t i = begin, step = step_of(end - begin); i < end; i += step) {
        const box *b = &t->boxes[t->order[i]];
        v4f centre = centre_of(b);
        add_box(&g.all, b);
        add_box(&g.centres, &(box){ centre, centre });
    }
    return g;
}

/* A cut of a group: boxes in the bins 0 .. `bin` of an axis are on the lower side. */
typedef struct cut {
    v4f from, scale; /* a box is in bin (doubled centre - from) * scale */
    int axis, bin;   /* axis < 0: there is no cut */
} cut;

/* A NaN, in a damaged file, is in bin 0. */
static inline v4i bins_of(const cut *c, const box *b)
{
    v4f at = (centre_of(b) - c->from) * c->scale, zero = { 0, 0, 0, 0 };
    return whole_four(lesser_four(greater_four(at, zero), zero + (BINS - 1)));
}

/* The blocks of a group whose centres are in one part of an axis. */
typedef struct bin {
    box all;
    uint32_t count;
} bin;

/* Returns the cost of a part. `step`: one of so many blocks was read. */
static float cost_of(const box *all, uint32_t count, uint32_t step)
{
    return surface_of(all) * (float)((count * step + EBPO_BLOCK - 1) / EBPO_BLOCK);
}

/* Compares the cuts of one axis with the least cost so far. */
static void compare_cuts(const bin bins[BINS], int axis, uint32_t step, cut *best, float *least)
{
    float upper[BINS]; /* costs of the bins i .. BINS - 1 */
    box all = empty_box();
    uint32_t count = 0;
    for (int i = BINS - 1; i > 0; i--) {
        add_box(&all, &bins[i].all);
        count += bins[i].count;
        upper[i] = cost_of(&all, count, step);
    }
    uint32_t total = count + bins[0].count;
    all = empty_box();
    count = 0;
    for (int i = 0; i < BINS - 1; i++) {
        add_box(&all, &bins[i].all);
        count += bins[i].count;
        float cost = cost_of(&all, count, step) + upper[i + 1];
        if (count && count < total && cost < *least) {
            *least = cost;
            best->axis = axis;
            best->bin = i;
        }
    }
}

static cut choose_cut(const builder *t, const group *g)
{
    cut c = { .from = g->centres.low, .axis = -1 };
    v4f size = g->centres.high - g->centres.low;
    for (int k = 0; k < 3; k++)
        c.scale[k] = size[k] > 0 ? BINS * (1 - 0x1p-20f) / size[k] : 0;
    bin bins[3][BINS];
    for (int k = 0; k < 3; k++)
        for (int i = 0; i < BINS; i++)
            bins[k][i] = (bin){ empty_box(), 0 };
    uint32_t step = step_of(size_of(g));
    for (uint32_t i = g->begin; i < g->end; i += step) {
        const box *b = &t->boxes[t->order[i]];
        v4i at = bins_of(&c, b);
        for (int k = 0; k < 3; k++) {
            add_box(&bins[k][at[k]].all, b);
            bins[k][at[k]].count++;
        }
    }
    float least = INFINITY;
    for (int k = 0; k < 3; k++)
        compare_cuts(bins[k], k, step, &c, &least);
    return c;
}

/* Sorts the blocks of the group by the sides of the cut, and otherwise keeps their order, so that
 * blocks that are neighbours in memory stay together. Returns the end of the lower side. */
static uint32_t apply_cut(const builder *t, const group *g, const cut *c)
{
    uint32_t lower = g->begin, upper = 0;
    for (uint32_t i = g->begin; i < g->end; i++) {
        uint32_t block = t->order[i];
        bool above = bins_of(c, &t->boxes[block])[c->axis] > c->bin;
        t->order[lower] = t->moved[upper] = block; /* without an unpredictable branch */
        lower += !above;
        upper += above;
    }
    memcpy(t->order + lower, t->moved, upper * sizeof *t->moved);
    return lower;
}

/* Cuts a group in two. */
static void cut_group(const builder *t, group *g, group *other, int depth)
{
    uint32_t middle = g->begin;
    if (depth < DEEP) {
        cut c = choose_cut(t, g);
        middle = c.axis < 0 ? g->begin : apply_cut(t, g, &c);
    }
    if (middle - g->begin < LEAST || g->end - middle < LEAST)
        middle = g->begin + size_of(g) / 2;
    *other = make_group(t, middle, g->end);
    *g = make_group(t, g->begin, middle);
}

/* Returns the group with the largest box, of the groups with `least` to `most` blocks, or -1. */
static int largest_group(const group g[8], int count, uint32_t least, uint32_t most)
{
    int best = -1;
    float largest = -1;
    for (int i = 0; i < count; i++)
        if (size_of(&g[i]) >= least && size_of(&g[i]) <= most &&
            (best < 0 || surface_of(&g[i].all) > largest)) {
            largest = surface_of(&g[i].all);
            best = i;
        }
    return best;
}

/* Divides the groups until there are eight. Returns their number, which is less if all groups have
 * at most eight blocks and do not fit into the remaining places as single blocks. */
static int divide_groups(const builder *t, group g[8], int count, int depth)
{
    int i;
    while (count < 8 && (i = largest_group(g, count, EBPO_BLOCK + 1, UINT32_MAX)) >= 0)
        cut_group(t, &g[i], &g[count++], depth);
    while (count < 8 && (i = largest_group(g, count, 2, (uint32_t)(9 - count))) >= 0) {
        group old = g[i];
        g[i] = make_group(t, old.begin, old.begin + 1);
        for (uint32_t k = old.begin + 1; k < old.end; k++)
            g[count++] = make_group(t, k, k + 1);
    }
    return count;
}

/* Makes a node whose blocks are in these groups (not divided yet), after the nodes of its children.
 * Returns the node's index. */
static uint32_t make_node(builder *t, group g[8], int count, int depth)
{
    ebpo_layout_node n = { .begin = g[0].begin, .end = g[count - 1].end };
    count = divide_groups(t, g, count, depth);
    for (int i = 0; i < 8; i++)
        n.child[i] = i >= count            ? EBPO_NO_CHILD
                     : size_of(&g[i]) == 1 ? t->order[g[i].begin] | EBPO_IS_BLOCK
                                           : make_node(t, (group[8]){ g[i] }, 1, depth + 1);
    ebpo_layout *o = t->out;
    if (t->failed || !ebpo_grow(&o->node, &o->node_capacity, o->node_count + 1, sizeof *o->node)) {
        t->failed = true;
        return EBPO_NO_CHILD;
    }
    o->node[o->node_count] = n;
    return (uint32_t)o->node_count++;
}

ebpo_status ebpo_layout_join(ebpo_layout *layout, const ebpo_extent *extent, ebpo_error *error)
{
    uint32_t blocks = (uint32_t)layout->block_count, shared = (uint32_t)layout->shared_blocks;
    builder t = { .out = layout,
                  .boxes = aligned_alloc(sizeof(v4f), (blocks + (size_t)1) * sizeof *t.boxes),
                  .order = ebpo_alloc(blocks, sizeof *t.order),
                  .moved = ebpo_alloc(blocks, sizeof *t.moved) };
    t.failed = !t.boxes || !t.order || !t.moved;
    for (uint32_t b = 0; b < blocks && !t.failed; b++) {
        t.order[b] = b;
        const double *low = extent[b].low, *high = extent[b].high;
        t.boxes[b] = (box){ { (float)low[0], (float)low[1], (float)low[2], 0 },
                            { (float)high[0], (float)high[1], (float)high[2], 0 } };
    }
    if (blocks && !t.failed) {
        group g[8];
        int count = 0;
        if (shared)
            g[count++] = make_group(&t, 0, shared);
        if (shared < blocks)
            g[count++] = make_group(&t, shared, blocks);
        layout->top = make_node(&t, g, count, 0);
    }
    for (uint32_t i = 0; i < blocks && !t.failed; i++)
        t.order[i] = layout->block_number[t.order[i]];
    layout->ordered_number = t.order;
    free(t.boxes);
    free(t.moved);
    return t.failed ? ebpo_fail_memory(error, blocks * (uint64_t)sizeof *t.boxes) : EBPO_OK;
}
