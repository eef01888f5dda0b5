#include "geom/strict_fp.h"

#include "query/skeleton.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "base/alloc.h"

struct ebpo_skeleton {
    double centre[3], scale;  /* the subtree's frame */
    ebpo_bound_slab *slab;    /* [count], behind the nodes */
    uint32_t count, is_outer; /* a bit for each node whose faces are outer ones */
    uint8_t own, outer;       /* a bit for each child of node 0 that has such faces: never both */
    /* the node below this child of that node; 0: not kept, or a block */
    uint8_t below[EBPO_SKELETON_NODES][8];
    ebpo_bound bound[]; /* `child` tells nothing here */
};

/* Squares of numbers in such frames, and what comes back from them, are far from the ends of
 * doubles. */
static const double scale_most = 0x1p500, place_most = 0x1p200;

uint64_t ebpo_skeleton_bytes(unsigned nodes)
{
    uint64_t bytes =
        sizeof(ebpo_skeleton) + nodes * (uint64_t)(sizeof(ebpo_bound) + sizeof(ebpo_bound_slab));
    return (bytes + 63) / 64 * 64;
}

static void copy_node(ebpo_skeleton *k, const ebpo_accel *s, uint32_t node)
{
    k->bound[k->count] = s->bound[node];
    k->slab[k->count++] = s->slab[node];
}

static double diagonal2(const ebpo_bound *b, int lane)
{
    double sum = 0;
    for (int k = 0; k < 3; k++) {
        ebpo_bound_sides side = ebpo_bound_side(b, lane, k);
        sum += (side.high - side.low) * (side.high - side.low);
    }
    return sum;
}

/* Blocks, and so children of the topmost node, hold outer faces or own ones: see
 * layout.c. */
static bool is_outer(const ebpo_accel *s, uint32_t child)
{
    while (!(child & EBPO_IS_BLOCK))
        child = s->bound[child].child[0];
    return s->slot_face[(uint64_t)(child & ~EBPO_IS_BLOCK) * EBPO_BLOCK] < s->outer_count;
}

static void tell_kinds(ebpo_skeleton *k, const ebpo_accel *s)
{
    for (int lane = 0; lane < k->bound[0].count; lane++)
        if (is_outer(s, k->bound[0].child[lane]))
            k->outer |= (uint8_t)(1u << lane);
        else
            k->own |= (uint8_t)(1u << lane);
}

/* The node below the largest child that is not kept yet: its box is the loosest. But of outer faces
 * only the one or two nodes that hold them all, and these first: they are looked for in the
 * subtrees whose own they are, and small boxes tell in which. */
static bool copy_next(ebpo_skeleton *k, const ebpo_accel *s)
{
    double most = -1;
    uint8_t *place = NULL;
    uint32_t next = 0;
    for (uint32_t node = 0; node < k->count; node++)
        for (int lane = 0; lane < k->bound[node].count; lane++) {
            uint32_t child = k->bound[node].child[lane];
            bool outer = node ? k->is_outer >> node & 1 : k->outer >> lane & 1;
            double size = child & EBPO_IS_BLOCK || k->below[node][lane] || (outer && node) ? -1
                          : outer ? INFINITY
                                  : diagonal2(&k->bound[node], lane);
            if (size > most) {
                most = size;
                place = &k->below[node][lane];
                next = child;
            }
        }
    if (!place)
        return false;
    *place = (uint8_t)k->count;
    k->is_outer |= (uint32_t)(most == INFINITY) << k->count;
    copy_node(k, s, next);
    return true;
}

ebpo_skeleton *ebpo_skeleton_make(const ebpo_accel *s, unsigned nodes)
{
    if (s->bound_count == 0 || !(s->scale <= scale_most && s->scale >= 1 / scale_most))
        return NULL;
    unsigned count = s->bound_count < nodes ? s->bound_count : nodes;
    ebpo_skeleton *k = aligned_alloc(64, ebpo_skeleton_bytes(count));
    if (!k)
        return NULL;
    memset(k, 0, sizeof *k);
    memcpy(k->centre, s->centre, sizeof k->centre);
    k->scale = s->scale;
    k->slab = (ebpo_bound_slab *)(k->bound + count);
    copy_node(k, s, s->top);
    tell_kinds(k, s);
    while (k->count < count && copy_next(k, s))
        ;
    return k;
}

void ebpo_skeleton_free(ebpo_skeleton *k) { free(k); }

/* --- bounds --- */

/* Boxes and slabs are wider than their faces by 2^-19 of their greatest coordinate, and more (see
 * block_bounds.c). That covers what doubles lose to numbers of up to 2^20 times their size; where
 * the point is farther, what they lose is below 2^-45 of the distance. The factor below is for
 * that. */
static const double certainly = 1 - 0x1p-40;

/* By |p - x|^2 >= (N(p) - radius)^2 + (along - [from, to])^2, as in the kernels: `to` is the place
 * of p from the middle of the box. */
static double by_slab(const ebpo_child_slab *slab, const double to[3])
{
    double along = 0, square = 0;
    for (int k = 0; k < 3; k++) {
        along += to[k] * slab->axis[k];
        square += to[k] * to[k];
    }
    double over = fmax(fmax(slab->from - along, along - slab->to), 0);
    /* less than the true one, so that the root of a small difference of large squares is not more
     */
    double aside2 = fmax(square * (1 - 0x1p-48) - along * along, 0);
    double aside = fmax(sqrt(aside2) - slab->radius, 0);
    return aside * aside + over * over;
}

/* Squared lower bound of the distance to a child, in the frame, before `certainly`. */
static double child_bound(const ebpo_bound *b, const ebpo_bound_slab *slab, int lane,
                          const double p[3])
{
    double square = 0, to[3];
    for (int k = 0; k < 3; k++) {
        ebpo_bound_sides side = ebpo_bound_side(b, lane, k);
        double d = fmax(fmax(side.low - p[k], p[k] - side.high), 0);
        to[k] = p[k] - (side.low + side.high) / 2;
        square += d * d;
    }
    ebpo_child_slab decoded = ebpo_bound_slab_of(slab, lane);
    return fmax(square, by_slab(&decoded, to));
}

/* The least of what is below these children of a node, or `least` if that is less. */
static double node_bound(const ebpo_skeleton *k, unsigned node, unsigned lanes, const double p[3],
                         double parent, double least)
{
    const ebpo_bound *b = &k->bound[node];
    double lower2[8];
    lanes &= (1u << b->count) - 1;
    for (int lane = 0; lane < b->count; lane++)
        lower2[lane] = fmax(parent, child_bound(b, &k->slab[node], lane, p));
    while (lanes) {
        int best = __builtin_ctz(lanes);
        for (int lane = best + 1; lane < b->count; lane++)
            if (lanes >> lane & 1 && lower2[lane] < lower2[best])
                best = lane;
        if (lower2[best] >= least)
            break;
        lanes &= ~(1u << best);
        unsigned below = k->below[node][best];
        least = below ? node_bound(k, below, 255, p, lower2[best], least) : lower2[best];
    }
    return least;
}

/* False, and somewhere: too far. */
static bool to_frame(const ebpo_skeleton *k, const double point[3], double p[3])
{
    bool near = true;
    for (int i = 0; i < 3; i++) {
        p[i] = (point[i] - k->centre[i]) * k->scale;
        near = near && fabs(p[i]) < place_most;
    }
    for (int i = 0; i < 3 && !near; i++)
        p[i] = 0;
    return near;
}

ebpo_skeleton_bounds ebpo_skeleton_lower_bounds(const ebpo_skeleton *k, const double point[3])
{
    double p[3];
    if (!to_frame(k, point, p))
        return (ebpo_skeleton_bounds){ k->own ? 0 : INFINITY, k->outer ? 0 : INFINITY };
    double own = node_bound(k, 0, k->own, p, 0, INFINITY),
           outer = k->outer ? node_bound(k, 0, k->outer, p, 0, INFINITY) : INFINITY;
    return (ebpo_skeleton_bounds){ sqrt(own) * certainly / k->scale,
                                   sqrt(outer) * certainly / k->scale };
}

static ebpo_outer_box box_of(const ebpo_skeleton *k, const ebpo_bound *b, int lane)
{
    ebpo_outer_box out;
    for (int i = 0; i < 3; i++) {
        ebpo_bound_sides side = ebpo_bound_side(b, lane, i);
        double low = k->centre[i] + side.low / k->scale, high = k->centre[i] + side.high / k->scale;
        double rounding = (fabs(k->centre[i]) + fabs(low) + fabs(high)) * 0x1p-50;
        out.low[i] = low - rounding;
        out.high[i] = high + rounding;
    }
    return out;
}

/* Those of a node's children, and of the nodes right below it. */
static unsigned boxes_of(const ebpo_skeleton *k, unsigned node, unsigned lanes, const double p[3],
                         double limit, ebpo_outer_box out[])
{
    unsigned count = 0;
    const ebpo_bound *b = &k->bound[node];
    for (int lane = 0; lane < b->count; lane++) {
        double lower2 = child_bound(b, &k->slab[node], lane, p);
        if (!(lanes >> lane & 1) || sqrt(lower2) * certainly / k->scale > limit)
            continue;
        if (k->below[node][lane])
            count += boxes_of(k, k->below[node][lane], 255, p, limit, out + count);
        else
            out[count++] = box_of(k, b, lane);
    }
    return count;
}

unsigned ebpo_skeleton_outer_boxes(const ebpo_skeleton *k, const double point[3], double limit,
                                   ebpo_outer_box out[EBPO_OUTER_BOXES])
{
    double p[3];
    return boxes_of(k, 0, k->outer, p, to_frame(k, point, p) ? limit : INFINITY, out);
}

/* --- those of a model --- */

struct ebpo_skeletons {
    uint64_t count, room;
    unsigned nodes; /* of each */
    _Atomic uint64_t bytes;
    _Atomic(ebpo_skeleton *) of[];
};

static uint64_t frame_bytes(uint64_t count)
{
    return sizeof(ebpo_skeletons) + count * sizeof(ebpo_skeleton *);
}

/* So many that all have them, one at least. */
static unsigned nodes_each(uint64_t count, uint64_t room)
{
    unsigned nodes = EBPO_SKELETON_NODES;
    while (nodes > 1 && frame_bytes(count) + count * ebpo_skeleton_bytes(nodes) > room)
        nodes--;
    return nodes;
}

uint64_t ebpo_skeletons_room(uint64_t count, uint64_t room)
{
    uint64_t most = frame_bytes(count) + count * ebpo_skeleton_bytes(EBPO_SKELETON_NODES);
    return room < frame_bytes(count) + ebpo_skeleton_bytes(1) ? 0 : room < most ? room : most;
}

ebpo_skeletons *ebpo_skeletons_make(uint64_t count, uint64_t room)
{
    ebpo_skeletons *all = ebpo_alloc_zero(1, frame_bytes(count));
    if (!all)
        return NULL;
    all->count = count;
    all->room = room;
    all->nodes = nodes_each(count, room);
    all->bytes = frame_bytes(count);
    return all;
}

void ebpo_skeletons_free(ebpo_skeletons *all)
{
    for (uint64_t i = 0; all && i < all->count; i++)
        ebpo_skeleton_free(all->of[i]);
    free(all);
}

uint64_t ebpo_skeletons_bytes(const ebpo_skeletons *all) { return all ? all->bytes : 0; }

static bool take_room(ebpo_skeletons *all, uint64_t bytes)
{
    uint64_t taken = all->bytes;
    while (taken + bytes <= all->room)
        if (atomic_compare_exchange_weak(&all->bytes, &taken, taken + bytes))
            return true;
    return false;
}

void ebpo_skeletons_keep(ebpo_skeletons *all, uint64_t number, const ebpo_accel *subtree)
{
    if (!all || all->of[number])
        return;
    unsigned nodes = subtree->bound_count < all->nodes ? subtree->bound_count : all->nodes;
    uint64_t bytes = ebpo_skeleton_bytes(nodes);
    ebpo_skeleton *none = NULL, *made = NULL;
    if (!take_room(all, bytes))
        return;
    made = ebpo_skeleton_make(subtree, nodes);
    /* another thread may have loaded it, too: with planes */
    if (made && atomic_compare_exchange_strong(&all->of[number], &none, made))
        return;
    atomic_fetch_sub(&all->bytes, bytes);
    ebpo_skeleton_free(made);
}

const ebpo_skeleton *ebpo_skeletons_find(const ebpo_skeletons *all, uint64_t number)
{
    return all ? atomic_load_explicit(&all->of[number], memory_order_acquire) : NULL;
}
