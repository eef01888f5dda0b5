/* Makes skeletons, which give lower bounds of the distance to the faces of subtrees that are not in
 * memory.
 *
 * The skeleton of a subtree has the upper nodes of the subtree's hierarchy over blocks of faces
 * (accel.h), eight at first. The skeleton is made when the subtree is loaded. Later searches load
 * the subtree again only if the lower bound from its skeleton is within the search's limit. If a
 * search has loaded a subtree and found no near face in it, nodes near the query point are added to
 * the skeleton. All skeletons together stay within their share of the budget. Skeletons give lower
 * bounds only (model_parts.h has the reason). Any thread may use a skeleton, also while it grows.
 *
 * A subtree owns some of the faces that it lists. The other listed faces are shared faces, which
 * other subtrees own (accel.h). */
#include "core/strict_fp.h"

#include "query/model_parts.h"

#include <float.h>
#include <math.h>
#include <pthread.h>
#include <stdatomic.h>
#include <stddef.h>
#include <stdlib.h>
#include <string.h>

#include "core/alloc.h"

/* A node of a skeleton. */
typedef struct kept_node {
    /* bound.child has three kinds of values: a block (EBPO_IS_BLOCK); a node of the skeleton
     * (IS_KEPT + the node's index in the skeleton); a node that the skeleton does not have (the
     * node's index in the subtree's hierarchy). */
    ebpo_bound bound;
    ebpo_bound_cylinder cylinder;
} kept_node;

/* Nodes are allocated in parts of PART_NODES nodes; the first part may be smaller. GROWN_AT_ONCE:
 * maximum number of nodes that ebpo_skeleton_grow adds. */
enum { PART_NODES = 8, PARTS = EBPO_SKELETON_NODES / PART_NODES, GROWN_AT_ONCE = 8 };
#define IS_KEPT UINT32_C(0x40000000)

struct ebpo_skeleton {
    double centre[3], scale; /* frame of the subtree */
    unsigned count, first;   /* number of nodes; capacity of the first part, in nodes */
    /* Masks of the children of node 0 (the root of the hierarchy): children with owned faces, and
     * children with shared faces. No child has both. */
    uint8_t owned, shared;
    kept_node *_Atomic part[PARTS]; /* NULL: not allocated yet */
};

static kept_node *node_at(const ebpo_skeleton *k, uint32_t number)
{
    return atomic_load_explicit(&k->part[number / PART_NODES], memory_order_acquire) +
           number % PART_NODES;
}

/* Returns a child. Another thread may be adding the child's node to the skeleton at the same time.
 */
static uint32_t child_of(const kept_node *n, int lane)
{
    return __atomic_load_n(&n->bound.child[lane], __ATOMIC_ACQUIRE);
}
static bool is_kept(uint32_t child) { return (child & (IS_KEPT | EBPO_IS_BLOCK)) == IS_KEPT; }

/* Limits of the frame's scale and of coordinates in the frame. Within these limits, squares and
 * results neither overflow nor underflow. */
static const double scale_max = 0x1p500, coordinate_max = 0x1p200;

static uint64_t part_bytes(unsigned nodes) { return nodes * (uint64_t)sizeof(kept_node); }
uint64_t ebpo_skeleton_bytes(unsigned nodes) { return sizeof(ebpo_skeleton) + part_bytes(nodes); }

/* Adds the node of a child to the skeleton. `entry`: address of the child in bound.child of the
 * child's parent. */
static void keep_child(ebpo_skeleton *k, const ebpo_accel *s, uint32_t *entry)
{
    uint32_t index = k->count++;
    kept_node *n = node_at(k, index);
    n->bound = s->bound[*entry];
    n->cylinder = s->cylinder[*entry];
    __atomic_store_n(entry, IS_KEPT | index, __ATOMIC_RELEASE);
}

static double squared_diagonal(const ebpo_bound *b, int lane)
{
    double sum = 0;
    for (int k = 0; k < 3; k++) {
        ebpo_bound_sides side = ebpo_bound_side(b, lane, k);
        sum += (side.high - side.low) * (side.high - side.low);
    }
    return sum;
}

/* Returns true if the faces below a child of the hierarchy's root are shared. (Below such a child,
 * either all faces are shared or all are owned: block_tree.c.) */
static bool is_shared(const ebpo_accel *s, uint32_t child)
{
    while (!(child & EBPO_IS_BLOCK))
        child = s->bound[child].child[0];
    return ebpo_accel_slot_face(s, (child & ~EBPO_IS_BLOCK) * EBPO_BLOCK) < s->shared_count;
}

/* Sets k->owned and k->shared. */
static void record_kinds(ebpo_skeleton *k, const ebpo_accel *s)
{
    const ebpo_bound *top = &s->bound[s->root_bound];
    for (int lane = 0; lane < top->count; lane++)
        if (is_shared(s, top->child[lane]))
            k->shared |= (uint8_t)(1u << lane);
        else
            k->owned |= (uint8_t)(1u << lane);
}

/* Adds the nodes of those children of the root that have shared faces, because small boxes around
 * shared faces are needed to find the subtrees that own them. */
static void keep_shared(ebpo_skeleton *k, const ebpo_accel *s)
{
    kept_node *top = node_at(k, 0);
    for (int lane = 0; lane < top->bound.count && k->count < k->first; lane++)
        if (k->shared >> lane & 1 && !(top->bound.child[lane] & EBPO_IS_BLOCK))
            keep_child(k, s, &top->bound.child[lane]);
}

/* Finds the largest child that has owned faces and whose node is not in the skeleton, and adds its
 * node, which improves the bounds most. Returns false if there is no such child. `shared_end`:
 * index of the first node after the nodes of shared faces. */
static bool keep_largest(ebpo_skeleton *k, const ebpo_accel *s, uint32_t shared_end)
{
    double largest = -1;
    uint32_t *entry = NULL;
    for (uint32_t index = 0; index < k->count; index += index ? 1 : shared_end) {
        ebpo_bound *b = &node_at(k, index)->bound;
        for (int lane = 0; lane < b->count; lane++) {
            bool can_be_added =
                !(b->child[lane] & (IS_KEPT | EBPO_IS_BLOCK)) && (index || k->owned >> lane & 1);
            double size = can_be_added ? squared_diagonal(b, lane) : -1;
            if (size > largest) {
                largest = size;
                entry = &b->child[lane];
            }
        }
    }
    if (entry)
        keep_child(k, s, entry);
    return entry != NULL;
}

ebpo_skeleton *ebpo_skeleton_make(const ebpo_accel *s, unsigned nodes)
{
    if (s->bound_count == 0 || !(s->scale <= scale_max && s->scale >= 1 / scale_max))
        return NULL;
    ebpo_skeleton *k = ebpo_alloc_zero(1, sizeof *k);
    unsigned node_count = s->bound_count < nodes ? s->bound_count : nodes;
    kept_node *first = k ? aligned_alloc(64, part_bytes(node_count)) : NULL;
    if (!first) {
        free(k);
        return NULL;
    }
    memcpy(k->centre, s->centre, sizeof k->centre);
    k->scale = s->scale;
    k->part[0] = first;
    k->first = node_count;
    uint32_t top = s->root_bound;
    keep_child(k, s, &top);
    record_kinds(k, s);
    keep_shared(k, s);
    for (uint32_t shared_end = k->count; k->count < node_count && keep_largest(k, s, shared_end);)
        ;
    return k;
}

void ebpo_skeleton_free(ebpo_skeleton *k)
{
    for (int i = 0; k && i < PARTS; i++)
        free(k->part[i]);
    free(k);
}

/* --- bounds --- */

/* A factor that makes distances lower bounds despite rounding. Near the point, the enlargement of
 * boxes and cylinders covers the rounding errors of doubles. Elsewhere these errors are below 2^-45
 * of the distance, which this factor covers (docs/develop/bounds.md, "Points against skeletons").
 */
static const double certainly = 1 - 0x1p-40;

/* Returns a squared lower bound of the distance to a cylinder, as in nearest_kernels.c. `to`:
 * position of the query point relative to the middle of the child's box. */
static double by_cylinder(const ebpo_child_cylinder *cylinder, const double to[3])
{
    double along = 0, square = 0;
    for (int k = 0; k < 3; k++) {
        along += to[k] * cylinder->axis[k];
        square += to[k] * to[k];
    }
    double over = fmax(fmax(cylinder->from - along, along - cylinder->to), 0);
    /* Because of the factor, the root of a small difference of large squares is a lower bound. */
    double aside2 = fmax(square * (1 - 0x1p-48) - along * along, 0);
    double aside = fmax(sqrt(aside2) - cylinder->radius, 0);
    return aside * aside + over * over;
}

/* Computes squared lower bounds of the distances to the children from their boxes, in the frame
 * (coordinates in which the subtree's cell has a size of 1 to 2). The factor `certainly` is applied
 * later. */
static void by_boxes(const ebpo_bound *b, const double p[3], double lower2[8])
{
    for (int lane = 0; lane < 8; lane++)
        lower2[lane] = 0;
    for (int k = 0; k < 3; k++)
        for (int lane = 0; lane < 8; lane++) {
            double below = (double)b->origin[k] + (double)b->step[k] * b->low[k][lane] - p[k],
                   above = p[k] - ((double)b->origin[k] + (double)b->step[k] * b->high[k][lane]),
                   d = below > above ? below : above;
            d = d > 0 ? d : 0;
            lower2[lane] += d * d;
        }
}

/* Returns a squared lower bound of the distance to a child, from its bounding cylinder. */
static double by_child_cylinder(const kept_node *n, int lane, const double p[3])
{
    double to[3];
    for (int k = 0; k < 3; k++) {
        ebpo_bound_sides side = ebpo_bound_side(&n->bound, lane, k);
        to[k] = p[k] - (side.low + side.high) / 2;
    }
    ebpo_child_cylinder cylinder = ebpo_bound_cylinder_of(&n->cylinder, lane);
    return by_cylinder(&cylinder, to);
}

/* The nearest child whose node is not in the skeleton (nearest_child.entry, see keep_child), and
 * its squared lower bound. The bound is a lower bound for all faces below the searched nodes. */
typedef struct nearest_child {
    double lower2;
    uint32_t *entry; /* NULL: none found */
} nearest_child;

/* Searches, at or below the children `lanes` of a node, for a child whose node is not in the
 * skeleton and which is nearer than *best. Visits the nearest child first, and tests the bounding
 * cylinder of a child only if the child's box is near enough. `index`: index of the node in the
 * skeleton. `parent`: squared bound of the node. */
static void search_below(const ebpo_skeleton *k, uint32_t index, unsigned lanes, const double p[3],
                         double parent, nearest_child *best)
{
    kept_node *n = node_at(k, index);
    double lower2[8];
    unsigned tested = 0; /* lanes whose bound includes the cylinder */
    by_boxes(&n->bound, p, lower2);
    lanes &= (1u << n->bound.count) - 1;
    while (lanes) {
        int lane = __builtin_ctz(lanes);
        for (int other = lane + 1; other < n->bound.count; other++)
            if (lanes >> other & 1 && lower2[other] < lower2[lane])
                lane = other;
        if (lower2[lane] >= best->lower2)
            break;
        if (!(tested >> lane & 1)) {
            tested |= 1u << lane;
            lower2[lane] = fmax(fmax(lower2[lane], parent), by_child_cylinder(n, lane, p));
            continue;
        }
        lanes &= ~(1u << lane);
        uint32_t child = child_of(n, lane);
        if (is_kept(child))
            search_below(k, child & ~IS_KEPT, 255, p, lower2[lane], best);
        else
            *best = (nearest_child){ lower2[lane], &n->bound.child[lane] };
    }
}

/* Transforms a point to the frame. If the point is too far, sets p to 0 and returns false. */
static bool to_frame(const ebpo_skeleton *k, const double point[3], double p[3])
{
    bool near = true;
    for (int i = 0; i < 3; i++) {
        p[i] = (point[i] - k->centre[i]) * k->scale;
        near = near && fabs(p[i]) < coordinate_max;
    }
    for (int i = 0; i < 3 && !near; i++)
        p[i] = 0;
    return near;
}

/* Returns the square of the limit in the frame, rounded up. */
static double frame_limit2(const ebpo_skeleton *k, double limit)
{
    double local = limit * k->scale * (1 + 0x1p-38);
    return local < coordinate_max ? local * local * (1 + 0x1p-38) + DBL_MIN : INFINITY;
}

/* Returns a lower bound of the distance to the faces below the children `lanes` of the root;
 * INFINITY: there are no faces within the limit. */
static double lower_bound(const ebpo_skeleton *k, unsigned lanes, const double p[3], double limit2)
{
    nearest_child best = { limit2, NULL };
    if (lanes)
        search_below(k, 0, lanes, p, 0, &best);
    return best.entry ? sqrt(best.lower2) * certainly / k->scale : INFINITY;
}

ebpo_skeleton_bounds ebpo_skeleton_lower_bounds(const ebpo_skeleton *k, const double point[3],
                                                double limit)
{
    double p[3], limit2 = frame_limit2(k, limit);
    if (!to_frame(k, point, p))
        return (ebpo_skeleton_bounds){ k->owned ? 0 : INFINITY, k->shared ? 0 : INFINITY };
    return (ebpo_skeleton_bounds){ lower_bound(k, k->owned, p, limit2),
                                   lower_bound(k, k->shared, p, limit2) };
}

/* --- for a far point --- */

typedef struct far_search {
    const ebpo_skeleton *skeleton;
    const ebpo_far *far;
    ebpo_far_frame frame;
    double best; /* least lower bound so far of a child whose node is not in the skeleton; a key */
} far_search;

/* Does the same as search_below, with keys (point_bounds.h). */
static void search_below_far(far_search *g, uint32_t index, unsigned lanes)
{
    const kept_node *n = node_at(g->skeleton, index);
    double lower[8];
    ebpo_far_boxes(g->far, &g->frame, &n->bound, lower);
    for (int lane = 0; lane < n->bound.count; lane++) {
        if (!(lanes >> lane & 1) || lower[lane] >= g->best)
            continue;
        uint32_t child = child_of(n, lane);
        double cylinder = ebpo_far_cylinder(g->far, &g->frame, &n->bound, &n->cylinder, lane);
        if (fmax(lower[lane], cylinder) >= g->best)
            continue;
        if (is_kept(child))
            search_below_far(g, child & ~IS_KEPT, 255);
        else
            g->best = fmax(lower[lane], cylinder);
    }
}

ebpo_skeleton_bounds ebpo_skeleton_far_bounds(const ebpo_skeleton *k, const ebpo_far *far,
                                              double limit)
{
    const ebpo_bound *top = &node_at(k, 0)->bound;
    double largest = 1, beyond = nextafter(limit, INFINITY);
    for (int i = 0; i < 3; i++)
        largest = fmax(largest, fabs((double)top->origin[i]) + 255 * (double)top->step[i]);
    far_search owned = { k, far, ebpo_far_frame_of(far, k->centre, k->scale, largest), beyond },
               shared = owned;
    search_below_far(&owned, 0, k->owned);
    search_below_far(&shared, 0, k->shared);
    return (ebpo_skeleton_bounds){ k->owned ? owned.best : INFINITY,
                                   k->shared ? shared.best : INFINITY };
}

/* Makes space for another node: allocates the next part of nodes if needed. Returns false if the
 * skeleton has its maximum size, or if there is no memory. `take`: as for ebpo_skeleton_grow. */
static bool reserve_node(ebpo_skeleton *k, bool (*take)(void *user, uint64_t bytes), void *user)
{
    unsigned part = k->count / PART_NODES;
    if (k->first < PART_NODES || part >= PARTS)
        return false;
    if (k->part[part])
        return true;
    kept_node *nodes =
        take(user, part_bytes(PART_NODES)) ? aligned_alloc(64, part_bytes(PART_NODES)) : NULL;
    if (nodes)
        atomic_store_explicit(&k->part[part], nodes, memory_order_release);
    return nodes != NULL;
}

void ebpo_skeleton_grow(ebpo_skeleton *k, const ebpo_accel *s, const double point[3], double limit,
                        bool (*take)(void *user, uint64_t bytes), void *user)
{
    double p[3], limit2 = frame_limit2(k, limit);
    if (!k->owned || !to_frame(k, point, p))
        return;
    for (int added = 0; added < GROWN_AT_ONCE; added++) {
        nearest_child best = { limit2, NULL };
        search_below(k, 0, k->owned, p, 0, &best);
        if (!best.entry || *best.entry & EBPO_IS_BLOCK || !reserve_node(k, take, user))
            return;
        keep_child(k, s, best.entry);
    }
}

static ebpo_faces_box box_of(const ebpo_skeleton *k, const ebpo_bound *b, int lane)
{
    ebpo_faces_box out;
    for (int i = 0; i < 3; i++) {
        ebpo_bound_sides side = ebpo_bound_side(b, lane, i);
        double low = k->centre[i] + side.low / k->scale, high = k->centre[i] + side.high / k->scale;
        double rounding = (fabs(k->centre[i]) + fabs(low) + fabs(high)) * 0x1p-50;
        out.low[i] = low - rounding;
        out.high[i] = high + rounding;
    }
    return out;
}

/* Writes the boxes of all children, at or below the children `lanes` of a node, that may be within
 * the limit and whose nodes are not in the skeleton. Returns their number. */
static unsigned boxes_of(const ebpo_skeleton *k, uint32_t index, unsigned lanes, const double p[3],
                         double limit2, ebpo_faces_box out[])
{
    unsigned count = 0;
    double lower2[8];
    const kept_node *n = node_at(k, index);
    by_boxes(&n->bound, p, lower2);
    for (int lane = 0; lane < n->bound.count; lane++) {
        if (!(lanes >> lane & 1) || lower2[lane] > limit2 || by_child_cylinder(n, lane, p) > limit2)
            continue;
        uint32_t child = child_of(n, lane);
        if (is_kept(child))
            count += boxes_of(k, child & ~IS_KEPT, 255, p, limit2, out + count);
        else
            out[count++] = box_of(k, &n->bound, lane);
    }
    return count;
}

unsigned ebpo_skeleton_shared_boxes(const ebpo_skeleton *k, const double point[3], double limit,
                                    ebpo_faces_box out[EBPO_SHARED_BOXES])
{
    double p[3];
    bool near = to_frame(k, point, p);
    return boxes_of(k, 0, k->shared, p, near ? frame_limit2(k, limit) : INFINITY, out);
}

/* --- a copy for walks --- */

/* Copies a node without its children, which another thread may be changing. */
static void copy_node(const kept_node *from, ebpo_bound *bound, ebpo_bound_cylinder *cylinder)
{
    const size_t child = offsetof(ebpo_bound, child), after = child + sizeof bound->child;
    memcpy(bound, &from->bound, child);
    memcpy((char *)bound + after, (const char *)&from->bound + after, sizeof *bound - after);
    *cylinder = from->cylinder;
}

void ebpo_skeleton_copy(const ebpo_skeleton *k, ebpo_skeleton_accel *out)
{
    uint32_t index[EBPO_SKELETON_NODES] = { 0 },
             count = 1; /* index: of the nodes in the skeleton */
    double largest = 1;
    for (uint32_t i = 0; i < count; i++) {
        const kept_node *n = node_at(k, index[i]);
        ebpo_bound *bound = &out->bound[i];
        copy_node(n, bound, &out->cylinder[i]);
        for (int lane = 0; lane < bound->count; lane++) {
            uint32_t child = child_of(n, lane);
            if (is_kept(child))
                index[count] = child & ~IS_KEPT;
            bound->child[lane] = is_kept(child) ? count++ : EBPO_IS_BLOCK;
        }
    }
    for (int i = 0; i < 3; i++)
        largest = fmax(largest,
                       fabs((double)out->bound[0].origin[i]) + 255 * (double)out->bound[0].step[i]);
    out->accel = (ebpo_accel){ .scale = k->scale,
                               .largest_coordinate = largest,
                               .bound = out->bound,
                               .cylinder = out->cylinder,
                               .bound_count = count };
    memcpy(out->accel.centre, k->centre, sizeof k->centre);
}

/* --- the skeletons of a model --- */

/* Initial number of nodes of each skeleton, if the quota is sufficient for all skeletons. */
enum { BEGIN_NODES = PART_NODES };

struct ebpo_skeletons {
    uint64_t count, space; /* number of subtrees; quota in bytes */
    ebpo_cache *cache;     /* the cache whose budget is used, or NULL */
    unsigned nodes;        /* initial number of nodes of each skeleton */
    pthread_mutex_t lock;  /* protects the changing fields; searches do not wait for it */
    uint64_t missing;      /* number of subtrees without a skeleton */
    _Atomic uint64_t bytes;
    _Atomic(ebpo_skeleton *) of[]; /* [count] NULL: none */
};

/* Returns the bytes of the table without skeletons. */
static uint64_t table_bytes(uint64_t count)
{
    return sizeof(ebpo_skeletons) + count * sizeof(ebpo_skeleton *);
}

/* Returns the initial number of nodes of each skeleton: as many as the quota allows for all
 * skeletons, at least 1 and at most BEGIN_NODES. */
static unsigned nodes_each(uint64_t count, uint64_t space)
{
    unsigned nodes = BEGIN_NODES;
    while (nodes > 1 && table_bytes(count) + count * ebpo_skeleton_bytes(nodes) > space)
        nodes--;
    return nodes;
}

uint64_t ebpo_skeletons_capacity(uint64_t count, uint64_t space)
{
    uint64_t usable = table_bytes(count) + count * ebpo_skeleton_bytes(EBPO_SKELETON_NODES);
    return space < table_bytes(count) + ebpo_skeleton_bytes(1) ? 0
           : space < usable                                    ? space
                                                               : usable;
}

/* Reserves bytes of the quota. `reserve`: bytes that must still be free afterwards. Returns false
 * if the quota is too small. */
static bool reserve_capacity(ebpo_skeletons *all, uint64_t bytes, uint64_t reserve)
{
    if (all->bytes + bytes > all->space || all->space - all->bytes - bytes < reserve ||
        (all->cache && !ebpo_cache_take_aside(all->cache, bytes)))
        return false;
    all->bytes += bytes;
    return true;
}

/* Reserves bytes for a skeleton that grows. The bytes for the initial nodes of all skeletons that
 * are not made yet stay free. */
static bool reserve_more(void *user, uint64_t bytes)
{
    ebpo_skeletons *all = user;
    return reserve_capacity(all, bytes, all->missing * ebpo_skeleton_bytes(all->nodes));
}

ebpo_skeletons *ebpo_skeletons_make(uint64_t count, uint64_t space, ebpo_cache *cache)
{
    ebpo_skeletons *all = ebpo_alloc_zero(1, table_bytes(count));
    if (!all)
        return NULL;
    all->count = all->missing = count;
    all->space = space;
    all->cache = cache;
    all->nodes = nodes_each(count, space);
    pthread_mutex_init(&all->lock, NULL);
    if (cache)
        ebpo_cache_set_aside(cache, space);
    if (reserve_capacity(all, table_bytes(count), 0))
        return all;
    ebpo_skeletons_free(all);
    return NULL;
}

void ebpo_skeletons_free(ebpo_skeletons *all)
{
    if (!all)
        return;
    for (uint64_t i = 0; i < all->count; i++)
        ebpo_skeleton_free(all->of[i]);
    pthread_mutex_destroy(&all->lock);
    free(all);
}

bool ebpo_skeletons_take(ebpo_skeletons *all, uint64_t bytes)
{
    pthread_mutex_lock(&all->lock);
    bool taken = reserve_capacity(all, bytes, 0);
    pthread_mutex_unlock(&all->lock);
    return taken;
}

void ebpo_skeletons_give_back(ebpo_skeletons *all, uint64_t bytes)
{
    pthread_mutex_lock(&all->lock);
    all->bytes -= bytes;
    if (all->cache)
        ebpo_cache_give_back_aside(all->cache, bytes);
    pthread_mutex_unlock(&all->lock);
}

uint64_t ebpo_skeletons_bytes(const ebpo_skeletons *all) { return all ? all->bytes : 0; }

void ebpo_skeletons_keep(ebpo_skeletons *all, uint64_t number, const ebpo_accel *subtree)
{
    if (!all || all->of[number])
        return;
    ebpo_skeleton *made = ebpo_skeleton_make(subtree, all->nodes);
    pthread_mutex_lock(&all->lock);
    /* Another thread may have loaded the same subtree at the same time (with planes). */
    if (made && !all->of[number] && reserve_capacity(all, ebpo_skeleton_bytes(made->first), 0)) {
        atomic_store_explicit(&all->of[number], made, memory_order_release);
        all->missing--;
        made = NULL;
    }
    pthread_mutex_unlock(&all->lock);
    ebpo_skeleton_free(made);
}

void ebpo_skeletons_grow(ebpo_skeletons *all, uint64_t number, const ebpo_accel *subtree,
                         const double p[3], double limit)
{
    if (!all || !all->of[number])
        return;
    pthread_mutex_lock(&all->lock);
    ebpo_skeleton_grow(all->of[number], subtree, p, limit, reserve_more, all);
    pthread_mutex_unlock(&all->lock);
}

const ebpo_skeleton *ebpo_skeletons_find(const ebpo_skeletons *all, uint64_t number)
{
    return all ? atomic_load_explicit(&all->of[number], memory_order_acquire) : NULL;
}
