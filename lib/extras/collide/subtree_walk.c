/* Finds pairs of intersecting faces of partly loaded models, with the same result as for models
 * that are entirely in memory (whole models).
 *
 * Two faces with a common point are listed by subtrees whose cells contain this point. So only
 * pairs of subtrees whose envelopes may have a common point must be searched. The envelopes of the
 * first levels below the roots of subtrees (deep bounds, query/nearest.h), if they are in memory,
 * must also have a common point. If both subtrees were loaded before, the boxes and cylinders of
 * their skeletons must intersect, too. This is tested again before each load, because the query
 * itself makes skeletons.
 *
 * For all pairs of faces, these pairs of subtrees are found before any subtree is loaded, and are
 * sorted so that a loaded subtree is used again soon. If many subtrees were never loaded, the deep
 * bounds are read first. For a first contact, pairs of subtrees are found one by one, the nearest
 * first, because nearly all of them are never needed. Several threads search pairs of subtrees. A
 * pair of faces is found more than once if several subtrees list one of its faces. So the pairs of
 * faces are stored, sorted and made unique before they are returned.
 *
 * If the collider's memory is too small for all pairs of faces, the search has several rounds. A
 * round that finds too many pairs drops the pairs of the last faces of the first model, and the
 * next round finds the dropped pairs again. */
#include "core/strict_fp.h"

#include <limits.h>
#include <math.h>
#include <pthread.h>
#include <stdlib.h>
#include <string.h>

#include "core/alloc.h"
#include "core/error.h"
#include "core/parallel.h"
#include "core/sort.h"
#include "extras/collide/collider.h"
#include "extras/collide/subtree_walk.h"
#include "extras/collide/posed_subtrees.h"
#include "geometry/vec3.h"
#include "query/nearest.h"

/* Two subtrees that may have intersecting faces. */
typedef struct subtree_pair {
    uint32_t a, b;           /* indices of the subtrees */
    uint32_t rank_a, rank_b; /* ranks of the subtrees in the order of the files' faces */
    double apart;            /* distance of the middles of both cells, divided by half the sum of
                              * the cells' diagonals */
} subtree_pair;

typedef struct subtree_pairs {
    subtree_pair *pair; /* [count] */
    uint64_t count, capacity;
    uint64_t subtrees[2]; /* number of different subtrees of each model */
} subtree_pairs;

/* Two intersecting faces. */
typedef struct stored_pair {
    uint32_t file[2]; /* [model] indices of the faces in the files */
    int32_t kind;     /* ebpo_pair_kind */
} stored_pair;

/* The search of one thread. Zero at the beginning. */
typedef struct subtree_walk {
    const ebpo_collision *collision;
    bool self;                /* both models are the same model at the same pose */
    ebpo_context *context[2]; /* contexts of partly loaded models; each holds the last subtree */
    ebpo_pair_walk walk;
    stored_pair *stored; /* [count] pairs of faces of the last pair of subtrees, in no order */
    uint64_t count, capacity;
    uint64_t first_end; /* greater than the indices of all faces that the first subtree of the last
                         * pair lists; 0: not known */
    bool late;          /* the deadline passed before all pairs were found */
    ebpo_skeleton_accel skeleton[2]; /* skeletons of a pair of subtrees that may be loaded */
} subtree_walk;

/* The search for pairs of subtrees. */
typedef struct subtree_pair_search {
    subtree_pairs *out;
    ebpo_posed_subtrees *side[2];
    const ebpo_collision *collision;
    subtree_walk *walk; /* for walks through skeletons */
    bool self;          /* as in subtree_walk */
    ebpo_error *error;
} subtree_pair_search;

static const char stage[] = "pairs of subtrees"; /* for the progress function */

static ebpo_status fail_late(ebpo_error *error)
{
    return ebpo_fail(error, EBPO_E_CANCELLED, "%s: the deadline has passed", stage);
}

/* --- pairs of nodes --- */

/* Returns the sum of the error bounds of both nodes' envelopes. */
static double slack_of(const subtree_pair_search *f, const ebpo_posed_node node[2])
{
    return ebpo_posed_slack(f->side[0], node[0].cell, f->collision->max_coordinate) +
           ebpo_posed_slack(f->side[1], node[1].cell, f->collision->max_coordinate);
}

/* The posed cells of two nodes, which are boxes. */
typedef struct posed_cells {
    double axis[2][3][3]; /* [model][edge] directions of the edges, about 1 long */
    double side[2][3];    /* [model][edge] lengths of the edges */
    double between[3];    /* twice the difference of the middles */
    double margin;        /* of rounding errors, and of posed faces and envelopes */
} posed_cells;

/* Returns the posed cells of two nodes. */
static posed_cells posed_cells_of(const subtree_pair_search *f, const ebpo_posed_node node[2])
{
    posed_cells out = { .margin = 3 * slack_of(f, node) };
    double ends[2][3];
    for (int i = 0; i < 2; i++) {
        const ebpo_posed_subtrees *s = f->side[i];
        ebpo_posed_ends(s, node[i].cell, ends[i]);
        for (int j = 0; j < 3; j++) {
            out.side[i][j] =
                s->model->info->box_size[j] * s->posing.scale / (double)(1u << node[i].cell.level);
            for (int k = 0; k < 3; k++)
                out.axis[i][j][k] = s->posing.matrix[k][j] / s->posing.scale;
        }
    }
    for (int k = 0; k < 3; k++)
        out.between[k] = ends[0][k] - ends[1][k];
    return out;
}

/* Returns true if two cells are certainly apart along a direction, which is at most about 1 long.
 */
static bool apart_along(const posed_cells *c, const double direction[3])
{
    double extent = 0; /* sum of the extents of both cells */
    for (int i = 0; i < 2; i++)
        for (int j = 0; j < 3; j++)
            extent += fabs(ebpo_vec3_dot(c->axis[i][j], direction)) * c->side[i][j];
    return fabs(ebpo_vec3_dot(c->between, direction)) - extent > c->margin;
}

/* Returns true if the cells of two nodes are certainly apart. Two boxes are apart exactly if they
 * are apart along an edge of either box or along the vector product of an edge of each (Gottschalk
 * et al. 1996). */
static bool cells_apart(const subtree_pair_search *f, const ebpo_posed_node node[2])
{
    posed_cells c = posed_cells_of(f, node);
    double direction[3];
    for (int i = 0; i < 2; i++)
        for (int j = 0; j < 3; j++)
            if (apart_along(&c, c.axis[i][j]))
                return true;
    for (int j = 0; j < 3; j++)
        for (int k = 0; k < 3; k++) {
            ebpo_vec3_cross(c.axis[0][j], c.axis[1][k], direction);
            if (apart_along(&c, direction))
                return true;
        }
    return false;
}

/* Returns the sum of the diagonals of two nodes' cells. */
static double diagonals_of(const subtree_pair_search *f, const ebpo_posed_node node[2])
{
    return ebpo_posed_diagonal(f->side[0], node[0].cell) +
           ebpo_posed_diagonal(f->side[1], node[1].cell);
}

/* Returns subtree_pair.apart of two nodes. */
static double apart_of(const subtree_pair_search *f, const ebpo_posed_node node[2])
{
    double middle[2][3], d[3]; /* middle: twice the cells' middles */
    for (int i = 0; i < 2; i++)
        ebpo_posed_ends(f->side[i], node[i].cell, middle[i]);
    for (int k = 0; k < 3; k++)
        d[k] = middle[0][k] - middle[1][k];
    return ebpo_vec3_scaled_length(d) / diagonals_of(f, node);
}

/* Returns a lower bound of subtree_pair.apart of all pairs of subtrees below two nodes. apart, sum:
 * of the nodes. least: sum of the diagonals of the smallest cells of subtrees. A cell's middle is
 * at most half the difference of the diagonals away from the middle of a cell that contains it. So,
 * if d is the sum of the diagonals of the subtrees, (apart of the subtrees) * d is at least
 * apart * sum - (sum - d). */
static double apart_bound(const subtree_pair_search *f, double apart, double sum, double least)
{
    double bound = apart < 1 ? 1 + (apart - 1) * (sum / least) : apart,
           error = 0x1p-40 * sum / least + 0x1p-44 * f->collision->max_coordinate / least;
    return fmax(bound - error, 0);
}

/* Returns true if a subtree is pruned: its faces are not in this file. */
static bool is_pruned(const ebpo_posed_subtrees *s, uint32_t number)
{
    return !s->model->whole && s->model->top->below[number].pruned;
}

/* Returns the pair of subtrees whose roots are the two nodes. */
static subtree_pair pair_of(const subtree_pair_search *f, const ebpo_posed_node node[2])
{
    uint32_t a = ebpo_entry_value(node[0].entry), b = ebpo_entry_value(node[1].entry);
    return (subtree_pair){ a, b, f->side[0]->rank[a], f->side[1]->rank[b], apart_of(f, node) };
}

/* Returns the index of the node of a pair that is divided: the larger one, but never the root of a
 * subtree. */
static int divided_of(const subtree_pair_search *f, const ebpo_posed_node node[2],
                      const bool is_root[2])
{
    bool first_is_larger = ebpo_posed_diagonal(f->side[0], node[0].cell) >=
                           ebpo_posed_diagonal(f->side[1], node[1].cell);
    return is_root[0] ? 1 : is_root[1] ? 0 : first_is_larger ? 0 : 1;
}

/* Returns a hierarchy over the faces of a subtree: of the whole model, or a copy of the skeleton in
 * *copy. Returns NULL if there is no skeleton, because the subtree was never loaded. */
static const ebpo_accel *hierarchy_of(const ebpo_model *m, uint32_t number,
                                      ebpo_skeleton_accel *copy)
{
    if (m->whole)
        return m->whole->bound_count ? m->whole : NULL;
    const ebpo_skeleton *skeleton = ebpo_skeletons_find(m->skeletons, number);
    if (skeleton)
        ebpo_skeleton_copy(skeleton, copy);
    return skeleton ? &copy->accel : NULL;
}

/* Returns true if the faces below all pairs of nodes on the stack of a walk are certainly apart. */
static bool nodes_apart(ebpo_pair_walk *walk)
{
    const ebpo_accel *const *accel = walk->pair->accel;
    while (walk->top > 0) {
        ebpo_node_pair pair = walk->stack[--walk->top];
        uint32_t a = accel[0]->bound[pair.a >> 3].child[pair.a & 7],
                 b = accel[1]->bound[pair.b >> 3].child[pair.b & 7];
        if (a & b & EBPO_IS_BLOCK || !walk->kernels->expand(walk, pair))
            return false;
    }
    return true;
}

/* Returns true if the faces of two hierarchies are certainly apart, by the boxes and cylinders of
 * their nodes. A hierarchy may be a skeleton. */
static bool hierarchies_apart(subtree_walk *w, const ebpo_accel *const accel[2])
{
    const ebpo_collision *q = w->collision;
    const ebpo_block_posing *posing[2] = { &q->posing[0], &q->posing[1] };
    ebpo_pair_walk *walk = &w->walk;
    ebpo_accel_pair pair;
    ebpo_accel_pair_make(&pair, accel, posing, q->max_coordinate);
    if (pair.apart)
        return true;
    ebpo_pair_walk_begin(walk, &pair);
    walk->first = walk->self = false;
    return walk->kernels->start(walk) && nodes_apart(walk);
}

/* Returns true if the faces of two subtrees, which were loaded before, are certainly apart, by
 * their skeletons. */
static bool faces_apart(const subtree_pair_search *f, const ebpo_posed_node node[2])
{
    const ebpo_accel *accel[2];
    for (int i = 0; i < 2; i++) {
        accel[i] =
            hierarchy_of(f->side[i]->model, ebpo_entry_value(node[i].entry), &f->walk->skeleton[i]);
        if (!accel[i])
            return false;
    }
    return hierarchies_apart(f->walk, accel);
}

/* Sets *apart to true if the envelopes of two nodes of deep bounds, or of all pairs of their
 * descendants, are certainly apart. */
static ebpo_status deep_apart(const subtree_pair_search *f, const ebpo_posed_node node[2],
                              bool *apart)
{
    ebpo_convex convex[2];
    ebpo_status status = EBPO_OK;
    double slack = slack_of(f, node);
    *apart = cells_apart(f, node);
    if (*apart)
        return EBPO_OK;
    for (int i = 0; i < 2 && status == EBPO_OK; i++)
        status = ebpo_posed_deep_envelope(f->side[i], node[i].cell, &convex[i], f->error);
    if (status != EBPO_OK)
        return status;
    *apart = ebpo_convex_gap(&convex[0], &convex[1], slack) > slack;
    bool is_end[2];
    for (int i = 0; i < 2; i++)
        is_end[i] = ebpo_entry_kind_of(node[i].entry) != EBPO_ENTRY_GRAY;
    if (*apart || (is_end[0] && is_end[1]))
        return EBPO_OK;
    int divided = divided_of(f, node, is_end);
    ebpo_posed_node part[2] = { node[0], node[1] };
    *apart = true;
    for (unsigned octant = 0; octant < 8 && *apart && status == EBPO_OK; octant++) {
        part[divided] = ebpo_posed_deep_child(f->side[divided], &node[divided], octant);
        if (ebpo_entry_kind_of(part[divided].entry) != EBPO_ENTRY_UNIFORM)
            status = deep_apart(f, part, apart);
    }
    return status;
}

/* Sets *apart to true if a subtree of the pair is pruned, or the faces or envelopes of the
 * subtrees, whose roots are the two nodes, are certainly apart. */
static ebpo_status envelopes_apart(const subtree_pair_search *f, const ebpo_posed_node node[2],
                                   bool *apart)
{
    ebpo_convex convex[2];
    double slack = slack_of(f, node);
    *apart = is_pruned(f->side[0], ebpo_entry_value(node[0].entry)) ||
             is_pruned(f->side[1], ebpo_entry_value(node[1].entry)) || faces_apart(f, node);
    if (*apart)
        return EBPO_OK;
    ebpo_status status = ebpo_posed_envelope(f->side[0], node[0].cell, &convex[0], f->error);
    if (status == EBPO_OK)
        status = ebpo_posed_envelope(f->side[1], node[1].cell, &convex[1], f->error);
    *apart = status == EBPO_OK && ebpo_convex_gap(&convex[0], &convex[1], slack) > slack;
    const ebpo_model *const m[2] = { f->side[0]->model, f->side[1]->model };
    if (status == EBPO_OK && !*apart && !m[0]->whole && !m[1]->whole &&
        (m[0]->deep || m[1]->deep)) {
        ebpo_posed_node deep[2] = { ebpo_posed_deep_node(f->side[0], node[0].cell),
                                    ebpo_posed_deep_node(f->side[1], node[1].cell) };
        status = deep_apart(f, deep, apart);
    }
    return status;
}

/* Adds the pair of subtrees whose roots are the two nodes, unless their envelopes are certainly
 * apart. */
static ebpo_status add_subtree_pair(const subtree_pair_search *f, const ebpo_posed_node node[2])
{
    subtree_pair pair = pair_of(f, node);
    bool apart;
    if (f->self && pair.rank_a > pair.rank_b)
        return EBPO_OK;
    if (ebpo_collision_is_late(f->collision))
        return fail_late(f->error);
    ebpo_status status = envelopes_apart(f, node, &apart);
    if (status != EBPO_OK || apart)
        return status;
    subtree_pairs *out = f->out;
    if (!ebpo_grow(&out->pair, &out->capacity, out->count + 1, sizeof *out->pair))
        return ebpo_fail_memory(f->error, (out->count + 1) * sizeof *out->pair);
    out->pair[out->count++] = pair;
    return EBPO_OK;
}

/* --- the descent --- */

/* Finds the pairs of subtrees below two nodes whose envelopes may have a common point. */
static ebpo_status descend_pair(const subtree_pair_search *f, const ebpo_posed_node node[2])
{
    bool is_root[2]; /* the node is the root of a subtree */
    for (int i = 0; i < 2; i++) {
        if (ebpo_entry_kind_of(node[i].entry) == EBPO_ENTRY_UNIFORM)
            return EBPO_OK;
        is_root[i] = ebpo_entry_kind_of(node[i].entry) == EBPO_ENTRY_SUBTREE_ROOT;
    }
    if (cells_apart(f, node))
        return EBPO_OK;
    if (is_root[0] && is_root[1])
        return add_subtree_pair(f, node);
    int divided = divided_of(f, node, is_root);
    ebpo_posed_node part[2] = { node[0], node[1] };
    ebpo_status status = EBPO_OK;
    for (unsigned octant = 0; octant < 8 && status == EBPO_OK; octant++) {
        part[divided] = ebpo_posed_child(f->side[divided], &node[divided], octant);
        status = descend_pair(f, part);
    }
    return status;
}

/* --- order of pairs --- */

/* Compares two pairs by their ranks for qsort. */
static int by_rank(const void *x, const void *y)
{
    const subtree_pair *p = x, *q = y;
    if (p->rank_a != q->rank_a)
        return p->rank_a < q->rank_a ? -1 : 1;
    return (p->rank_b > q->rank_b) - (p->rank_b < q->rank_b);
}

/* Reverses the order of pairs. */
static void reverse_pairs(subtree_pair *pair, uint64_t count)
{
    for (uint64_t i = 0; i < count / 2; i++) {
        subtree_pair first = pair[i];
        pair[i] = pair[count - 1 - i];
        pair[count - 1 - i] = first;
    }
}

/* Sorts pairs by the rank of the first subtree. Pairs with the same first subtree are a group. In
 * the groups, the rank of the second subtree ascends and descends alternately. */
static void sort_back_and_forth(subtree_pairs *p)
{
    uint64_t groups = 0;
    if (p->count)
        qsort(p->pair, p->count, sizeof *p->pair, by_rank);
    for (uint64_t begin = 0, end; begin < p->count; begin = end) {
        for (end = begin + 1; end < p->count && p->pair[end].a == p->pair[begin].a;)
            end++;
        if (groups++ % 2)
            reverse_pairs(p->pair + begin, end - begin);
    }
}

/* Sets subtrees[side] to the number of different subtrees of a model in the pairs. *added: set to
 * the number of them that were never loaded. */
static ebpo_status count_subtrees(subtree_pairs *p, int side, const ebpo_posed_subtrees *all,
                                  uint64_t *added, ebpo_error *error)
{
    bool *visited = ebpo_alloc_zero(all->count, sizeof *visited);
    p->subtrees[side] = *added = 0;
    if (!visited)
        return ebpo_fail_memory(error, all->count);
    for (uint64_t i = 0; i < p->count; i++) {
        uint32_t number = side == 0 ? p->pair[i].a : p->pair[i].b;
        if (visited[number])
            continue;
        visited[number] = true;
        p->subtrees[side]++;
        *added += !ebpo_skeletons_find(all->model->skeletons, number);
    }
    free(visited);
    return EBPO_OK;
}

/* Counts the subtrees of both models. If both models are partly loaded, reads the deep bounds of a
 * model that has many subtrees in the pairs that were never loaded. Sets *more to true if deep
 * bounds were read. */
static ebpo_status count_both(const subtree_pair_search *f, bool *more)
{
    *more = false;
    for (int i = 0; i < 2; i++) {
        ebpo_model *m = f->collision->model[i];
        const ebpo_model *other = f->collision->model[1 - i];
        uint64_t added;
        ebpo_status status = count_subtrees(f->out, i, f->side[i], &added, f->error);
        if (status != EBPO_OK)
            return status;
        if (m->whole || m->deep || other->whole)
            continue;
        ebpo_deep_bounds_report(m, added < UINT_MAX ? (unsigned)added : UINT_MAX);
        *more = *more || m->deep;
    }
    return EBPO_OK;
}

/* Finds the pairs of subtrees that may have intersecting faces, sorted by sort_back_and_forth, so
 * that loaded subtrees are used again soon. Two intersecting faces have a common point. Each model
 * has a subtree that lists the model's face and whose cell contains the point. These two subtrees
 * are a pair of the result. self: both models are the same model at the same pose; each pair is
 * found once, with rank_a <= rank_b. The caller frees out->pair, even after a failure. */
static ebpo_status find_subtree_pairs(const subtree_pair_search *f)
{
    ebpo_posed_node root[2] = { ebpo_posed_subtree_root(f->side[0]),
                                ebpo_posed_subtree_root(f->side[1]) };
    ebpo_status status = EBPO_OK;
    for (bool more = true; more && status == EBPO_OK;) { /* again if deep bounds were read */
        f->out->count = 0;
        status = descend_pair(f, root);
        if (status == EBPO_OK)
            status = count_both(f, &more);
    }
    if (status == EBPO_OK)
        sort_back_and_forth(f->out);
    return status;
}

/* --- the nearest pairs --- */

/* A pair of nodes. */
typedef struct waiting_nodes {
    double bound; /* lower bound of subtree_pair.apart of all pairs of subtrees below the nodes */
    ebpo_posed_node node[2];
    uint32_t rank[2]; /* if both nodes are roots of subtrees: ranks of the subtrees */
    bool ends;        /* both nodes are roots of subtrees */
} waiting_nodes;

/* Returns true if x leaves the heap before y. Pairs of subtrees leave it by `apart`, then by their
 * ranks. */
static bool comes_before(const waiting_nodes *x, const waiting_nodes *y)
{
    if (x->bound != y->bound)
        return x->bound < y->bound;
    if (!x->ends || !y->ends)
        return !x->ends && y->ends;
    return x->rank[0] != y->rank[0] ? x->rank[0] < y->rank[0] : x->rank[1] < y->rank[1];
}

EBPO_HEAP(nearest, waiting_nodes, comes_before)

/* The pairs of subtrees that may have intersecting faces, which are found one by one in the order
 * of `apart`, then of their ranks. Most pairs are never needed, and their envelopes are not
 * computed. */
typedef struct nearest_pairs {
    subtree_pair_search search;
    double least; /* as in apart_bound */
    waiting_nodes *heap;
    uint64_t count, capacity;
    uint64_t steps; /* number of pairs that have left the heap */
    uint64_t found; /* number of pairs of subtrees found so far */
    bool late;      /* the deadline passed before the next pair was found */
} nearest_pairs;

/* Number of steps after which the deadline and the progress function are tested. */
enum { STEPS_AT_A_TIME = 4096 };

/* Returns the length of the diagonal of a model's smallest subtrees. */
static double least_diagonal(const ebpo_posed_subtrees *s)
{
    int level = s->model->whole ? 0 : s->model->top->cut_level;
    return ebpo_posed_diagonal(s, (ebpo_cell){ .level = level });
}

/* Adds a pair of nodes to the heap, unless their cells are in balls that are certainly apart.
 * bound: bound of the nodes that contain them. */
static ebpo_status push_nodes(nearest_pairs *p, const ebpo_posed_node node[2], double bound)
{
    const subtree_pair_search *f = &p->search;
    waiting_nodes added = { .ends = true, .node = { node[0], node[1] } };
    for (int i = 0; i < 2; i++) {
        if (ebpo_entry_kind_of(node[i].entry) == EBPO_ENTRY_UNIFORM)
            return EBPO_OK;
        added.ends = added.ends && ebpo_entry_kind_of(node[i].entry) == EBPO_ENTRY_SUBTREE_ROOT;
    }
    double sum = diagonals_of(f, node), apart = apart_of(f, node);
    if ((apart - 1) * sum > 0x1p-40 * sum + 4 * slack_of(f, node))
        return EBPO_OK;
    for (int i = 0; added.ends && i < 2; i++)
        added.rank[i] = f->side[i]->rank[ebpo_entry_value(node[i].entry)];
    added.bound = added.ends ? apart : fmax(bound, apart_bound(f, apart, sum, p->least));
    if (!ebpo_grow(&p->heap, &p->capacity, p->count + 1, sizeof *p->heap))
        return ebpo_fail_memory(f->error, (p->count + 1) * sizeof *p->heap);
    nearest_add(p->heap, p->count++, &added);
    return EBPO_OK;
}

/* Begins with the roots of both trees. The caller frees p->heap, even after a failure. */
static ebpo_status begin_nearest(nearest_pairs *p, const subtree_pair_search *search)
{
    ebpo_posed_subtrees *const *side = search->side;
    ebpo_posed_node root[2] = { ebpo_posed_subtree_root(side[0]),
                                ebpo_posed_subtree_root(side[1]) };
    *p = (nearest_pairs){ .search = *search,
                          .least = least_diagonal(side[0]) + least_diagonal(side[1]) };
    return push_nodes(p, root, 0);
}

/* Divides a node of a pair, and adds the new pairs to the heap. */
static ebpo_status divide_nodes(nearest_pairs *p, const waiting_nodes *pair)
{
    const subtree_pair_search *f = &p->search;
    ebpo_status status = EBPO_OK;
    bool is_root[2];
    for (int i = 0; i < 2; i++)
        is_root[i] = ebpo_entry_kind_of(pair->node[i].entry) == EBPO_ENTRY_SUBTREE_ROOT;
    int divided = divided_of(f, pair->node, is_root);
    ebpo_posed_node part[2] = { pair->node[0], pair->node[1] };
    for (unsigned octant = 0; octant < 8 && status == EBPO_OK; octant++) {
        part[divided] = ebpo_posed_child(f->side[divided], &pair->node[divided], octant);
        status = push_nodes(p, part, pair->bound);
    }
    return status;
}

/* Tests the deadline and the progress function after some steps. Sets p->late. */
static ebpo_status count_step(nearest_pairs *p)
{
    if (++p->steps % STEPS_AT_A_TIME)
        return EBPO_OK;
    p->late = ebpo_collision_is_late(p->search.collision);
    return ebpo_progress_step(&p->search.collision->options.progress, stage, p->found, 0,
                              p->search.error)
               ? EBPO_OK
               : EBPO_E_CANCELLED;
}

/* Finds the next pair of subtrees. *more: false if there are no more pairs, or after the deadline
 * (p->late). */
static ebpo_status next_nearest(nearest_pairs *p, subtree_pair *out, bool *more)
{
    ebpo_status status = EBPO_OK;
    *more = false;
    while (status == EBPO_OK && p->count && !p->late) {
        waiting_nodes next = nearest_take(p->heap, p->count--);
        bool apart = cells_apart(&p->search, next.node);
        if (!apart && next.ends) {
            status = envelopes_apart(&p->search, next.node, &apart);
            p->late = ebpo_collision_is_late(p->search.collision);
        } else if (!apart) {
            status = divide_nodes(p, &next);
        }
        if (status == EBPO_OK && !apart && next.ends) {
            *out = pair_of(&p->search, next.node);
            *more = true;
            p->found++;
            return EBPO_OK;
        }
        if (status == EBPO_OK)
            status = count_step(p);
    }
    return status;
}

/* --- the walk of a thread --- */

/* Prepares the walk of a thread. */
static ebpo_status subtree_walk_begin(subtree_walk *w, const ebpo_collision *collision, bool self,
                                      ebpo_error *error)
{
    w->collision = collision;
    w->self = self;
    for (int i = 0; i < 2; i++)
        if (!collision->model[i]->whole && !w->context[i]) {
            ebpo_status status = ebpo_context_new(collision->model[i], &w->context[i], error);
            if (status != EBPO_OK)
                return status;
            w->context[i]->content = EBPO_ACCEL_FACES;
        }
    return EBPO_OK;
}

/* Returns the number of subtrees that the walk has loaded. */
static uint64_t subtree_walk_loads(const subtree_walk *w)
{
    uint64_t loads = 0;
    for (int i = 0; i < 2; i++)
        loads += w->context[i] ? w->context[i]->loaded : 0;
    return loads;
}

/* Releases the subtrees that the walk holds, so that their memory can be used for other subtrees.
 */
static void subtree_walk_let_go(subtree_walk *w)
{
    for (int i = 0; i < 2; i++)
        ebpo_context_let_go(w->context[i]);
}

static void subtree_walk_free(subtree_walk *w)
{
    for (int i = 0; i < 2; i++)
        ebpo_context_free(w->context[i]);
    ebpo_pair_walk_free(&w->walk);
    free(w->stored);
}

/* Compares two pairs by the indices of their faces in the file, for qsort. */
static int compare_stored_pairs(const void *x, const void *y)
{
    const stored_pair *p = x, *q = y;
    if (p->file[0] != q->file[0])
        return p->file[0] < q->file[0] ? -1 : 1;
    return (p->file[1] > q->file[1]) - (p->file[1] < q->file[1]);
}

/* Converts a pair to the pair that the caller receives, without the indices in the sources. */
static ebpo_face_pair face_pair_of(const ebpo_collision *q, const stored_pair *p)
{
    int a = q->swapped, b = !q->swapped;
    return (ebpo_face_pair){ EBPO_NO_FACE, EBPO_NO_FACE, p->file[a], p->file[b], p->kind, 0 };
}

/* --- one pair of subtrees --- */

/* Gets a subtree. Loads the subtree if its model is only partly loaded. */
static ebpo_status load_subtree(subtree_walk *w, int side, uint32_t number, const ebpo_accel **out,
                                ebpo_error *error)
{
    ebpo_accel *loaded = w->collision->model[side]->whole;
    ebpo_status status =
        loaded ? EBPO_OK : ebpo_context_subtree(w->context[side], number, &loaded, error);
    *out = loaded;
    return status;
}

/* Stores the pairs of faces that the walk has found. If w->self, stores the face with the lesser
 * index first, and omits pairs of a face with itself. */
static ebpo_status store_pairs(subtree_walk *w, const ebpo_accel *const accel[2], ebpo_error *error)
{
    const ebpo_pair_walk *found = &w->walk;
    if (!ebpo_grow(&w->stored, &w->capacity, found->found_count, sizeof *w->stored))
        return ebpo_fail_memory(error, found->found_count * sizeof *w->stored);
    for (uint64_t i = 0; i < found->found_count; i++) {
        uint32_t local[2] = { found->found_pairs[i].a, found->found_pairs[i].b };
        stored_pair p = { .kind = found->found_pairs[i].kind };
        for (int side = 0; side < 2; side++)
            p.file[side] = (uint32_t)ebpo_accel_file_face(accel[side], local[side]);
        if (w->self && p.file[0] == p.file[1])
            continue;
        if (w->self && p.file[0] > p.file[1])
            p = (stored_pair){ { p.file[1], p.file[0] }, p.kind };
        w->stored[w->count++] = p;
    }
    return EBPO_OK;
}

/* Fails because the stack of a walk cannot grow by the 64 pairs of children of two nodes. */
static ebpo_status no_memory(const ebpo_pair_walk *w, ebpo_error *error)
{
    return ebpo_fail_memory(error, (w->capacity + 64) * sizeof *w->stack);
}

/* Finds the pairs of intersecting faces of two hierarchies. */
static ebpo_status walk_hierarchies(subtree_walk *w, const ebpo_accel *const accel[2],
                                    ebpo_error *error)
{
    const ebpo_collision *q = w->collision;
    const ebpo_block_posing *posing[2] = { &q->posing[0], &q->posing[1] };
    ebpo_accel_pair pair;
    ebpo_pair_walk *walk = &w->walk;
    ebpo_accel_pair_make(&pair, accel, posing, q->max_coordinate);
    if (pair.apart)
        return EBPO_OK;
    ebpo_pair_walk_begin(walk, &pair);
    walk->first = false;
    walk->neighbours = w->self;
    walk->self = w->self && accel[0] == accel[1];
    if (!walk->kernels->start(walk))
        return no_memory(walk, error);
    while (walk->top > 0) {
        if (!walk->kernels->run(walk, EBPO_WALK_PAIRS))
            return no_memory(walk, error);
        if ((w->late = ebpo_collision_is_late(q)))
            return EBPO_OK;
    }
    return store_pairs(w, accel, error);
}

/* Returns true if a subtree can be used without loading it. */
static bool is_in_memory(const subtree_walk *w, int side, uint32_t number)
{
    const ebpo_context *c = w->context[side];
    return !c || ebpo_context_has_pinned(c, number) ||
           ebpo_cache_has(c->model->cache, ebpo_context_key(c, number));
}

/* Returns the side of a pair whose subtree is loaded next: a subtree in memory, otherwise a subtree
 * that was never loaded. accel[side]: NULL if the subtree has not been loaded for this pair.
 * known[side]: NULL if the subtree was never loaded. */
static int next_side(const subtree_walk *w, const uint32_t number[2],
                     const ebpo_accel *const accel[2], const ebpo_accel *const known[2])
{
    for (int side = 0; side < 2; side++)
        if (!accel[side] && is_in_memory(w, side, number[side]))
            return side;
    return accel[0] || (!accel[1] && known[0] && !known[1]);
}

/* Loads a pair of subtrees. Sets *apart to true if the faces of both subtrees are certainly apart;
 * then one or both subtrees may not have been loaded. Before each load, this is tested with the
 * bounds of the faces of both subtrees. Bounds of a subtree that is not in memory come from its
 * skeleton, which an earlier pair of this query may have made. */
static ebpo_status load_pair(subtree_walk *w, const uint32_t number[2], const ebpo_accel *accel[2],
                             bool *apart, ebpo_error *error)
{
    ebpo_status status = EBPO_OK;
    accel[0] = accel[1] = NULL;
    *apart = false;
    while (status == EBPO_OK && !(accel[0] && accel[1])) {
        const ebpo_accel *known[2];
        for (int i = 0; i < 2; i++)
            known[i] = accel[i] ? accel[i]
                                : hierarchy_of(w->collision->model[i], number[i], &w->skeleton[i]);
        int side = next_side(w, number, accel, known);
        *apart = known[0] && known[1] && !is_in_memory(w, side, number[side]) &&
                 hierarchies_apart(w, known);
        if (*apart)
            return EBPO_OK;
        status = load_subtree(w, side, number[side], &accel[side], error);
        if (status == EBPO_OK && accel[side]->bound_count == 0) { /* it has no faces */
            *apart = true;
            return EBPO_OK;
        }
    }
    return status;
}

/* Finds the pairs of intersecting faces of a pair of subtrees, which are loaded if necessary. */
static ebpo_status subtree_walk_pair(subtree_walk *w, const subtree_pair *pair, ebpo_error *error)
{
    const uint32_t number[2] = { pair->a, pair->b };
    const ebpo_accel *accel[2];
    bool apart = false;
    ebpo_status status;
    w->count = 0;
    w->first_end = 0;
    if (w->self && pair->a == pair->b) {
        status = load_subtree(w, 0, pair->a, &accel[0], error);
        accel[1] = accel[0];
    } else {
        status = load_pair(w, number, accel, &apart, error);
    }
    if (status != EBPO_OK || apart)
        return status;
    w->first_end = accel[0]->first_face + (accel[0]->face_count - accel[0]->shared_count);
    if (accel[0]->bound_count == 0)
        return EBPO_OK;
    return walk_hierarchies(w, accel, error);
}

/* --- state of all threads --- */

/* Number of consecutive pairs of subtrees that a thread searches at a time. In most cases these
 * pairs have the same first subtree, which the thread loads once. */
enum { PAIRS_IN_A_ROW = 4 };

typedef struct gathering_parts {
    const ebpo_collision *collision;
    bool self;                       /* as in subtree_walk */
    ebpo_posed_subtrees subtrees[2]; /* subtrees of both models */
    subtree_pairs pairs;             /* pairs of subtrees to be searched */
    uint64_t *end;      /* [subtree of the first model] first_end (subtree_walk) of this subtree; 0:
                         * not known yet */
    subtree_walk *walk; /* [threads] */
    unsigned threads;
    uint64_t read_before; /* bytes that had been read from both files before the search */
    pthread_mutex_t lock; /* protects `end` and the members below */
    uint64_t from, to;    /* range of faces of the first model in this round */
    stored_pair *stored;  /* [count] pairs of faces that wait to be passed to the caller */
    uint64_t count, capacity;
    uint64_t most; /* greatest allowed `count` */
} gathering_parts;

/* Adds the counts of a walk to the collider's counts. */
static void count_walk(const gathering_parts *g, subtree_walk *w)
{
    g->collision->collider->loads += subtree_walk_loads(w);
    ebpo_collider_count(g->collision->collider, &w->walk);
}

/* --- waiting pairs --- */

/* Sorts the waiting pairs, and removes duplicates. */
static void sort_unique(gathering_parts *g)
{
    uint64_t kept = 0;
    if (g->count)
        qsort(g->stored, g->count, sizeof *g->stored, compare_stored_pairs);
    for (uint64_t i = 0; i < g->count; i++)
        if (kept == 0 || compare_stored_pairs(&g->stored[kept - 1], &g->stored[i]) != 0)
            g->stored[kept++] = g->stored[i];
    g->count = kept;
}

/* Drops the last waiting pairs, so that at most half of the allowed number remains, but keeps all
 * pairs of the first face. Ends this round's range of faces before the faces of the dropped pairs.
 */
static void drop_last_pairs(gathering_parts *g)
{
    sort_unique(g);
    uint64_t half = g->most / 2;
    if (g->count <= half)
        return;
    uint64_t cut = g->stored[half].file[0];
    if (cut == g->stored[0].file[0])
        cut++;
    g->to = cut;
    while (g->count > 0 && g->stored[g->count - 1].file[0] >= cut)
        g->count--;
    if (g->most < 2 * g->count)
        g->most = 2 * g->count;
}

/* Adds the pairs of a walk that are in this round's range to the waiting pairs. */
static ebpo_status add_waiting_pairs(gathering_parts *g, const subtree_walk *w, ebpo_error *error)
{
    for (uint64_t i = 0; i < w->count; i++) {
        if (w->stored[i].file[0] < g->from || w->stored[i].file[0] >= g->to)
            continue;
        if (g->count >= g->most)
            drop_last_pairs(g);
        if (w->stored[i].file[0] >= g->to)
            continue;
        if (!ebpo_grow(&g->stored, &g->capacity, g->count + 1, sizeof *g->stored))
            return ebpo_fail_memory(error, (g->count + 1) * sizeof *g->stored);
        g->stored[g->count++] = w->stored[i];
    }
    return EBPO_OK;
}

/* --- searching --- */

/* Returns true if earlier rounds have returned all pairs of faces of the pair's first subtree. */
static bool is_done(gathering_parts *g, const subtree_pair *pair)
{
    (void)pthread_mutex_lock(&g->lock);
    uint64_t end = g->end[pair->a];
    (void)pthread_mutex_unlock(&g->lock);
    return end && end <= g->from;
}

/* Adds the result of a walk to the state of all threads. */
static ebpo_status keep_pairs(gathering_parts *g, const subtree_pair *pair, const subtree_walk *w,
                              ebpo_error *error)
{
    (void)pthread_mutex_lock(&g->lock);
    if (w->first_end)
        g->end[pair->a] = w->first_end;
    ebpo_status status = add_waiting_pairs(g, w, error);
    (void)pthread_mutex_unlock(&g->lock);
    return status;
}

/* Searches the pairs of subtrees [begin, end) in a thread. */
static ebpo_status run_pairs(void *user, uint64_t begin, uint64_t end, unsigned worker,
                             ebpo_error *error)
{
    gathering_parts *g = user;
    subtree_walk *w = &g->walk[worker];
    for (uint64_t i = begin; i < end; i++) {
        const subtree_pair *pair = &g->pairs.pair[i];
        if (is_done(g, pair))
            continue;
        ebpo_status status = subtree_walk_pair(w, pair, error);
        if (status == EBPO_OK)
            status = keep_pairs(g, pair, w, error);
        if (status != EBPO_OK)
            return status;
        if (w->late || ebpo_collision_is_late(g->collision))
            return fail_late(error);
    }
    return EBPO_OK;
}

/* Runs all threads. Each thread holds two subtrees. If the memory budget is too small for the
 * subtrees of all threads, one thread searches again from the beginning. */
static ebpo_status run_all(gathering_parts *g, ebpo_error *error)
{
    const ebpo_progress *progress = &g->collision->options.progress;
    ebpo_error first_error = EBPO_ERROR_INIT; /* of the search with several threads */
    ebpo_status status = EBPO_E_LIMIT;
    if (g->threads > 1)
        status = ebpo_parallel_for(g->threads, NULL, g->pairs.count, PAIRS_IN_A_ROW, run_pairs, g,
                                   progress, stage, &first_error);
    if (status != EBPO_E_LIMIT) {
        if (status != EBPO_OK && error)
            *error = first_error;
        return status;
    }
    for (unsigned i = 1; i < g->threads; i++) {
        count_walk(g, &g->walk[i]);
        subtree_walk_free(&g->walk[i]);
    }
    g->threads = 1;
    g->count = 0;
    g->to = UINT64_MAX;
    return ebpo_parallel_for(1, NULL, g->pairs.count, PAIRS_IN_A_ROW, run_pairs, g, progress, stage,
                             error);
}

enum { PASSED_AT_ONCE = 1024 }; /* greatest number of pairs in a call of the caller's function */

/* Passes the waiting pairs to the caller. Sets *more to false if the caller needs no more pairs. */
static ebpo_status pass_waiting(const gathering_parts *g, ebpo_pairs_fn take, void *user,
                                bool *more, ebpo_error *error)
{
    ebpo_face_pair out[PASSED_AT_ONCE];
    ebpo_status status = EBPO_OK;
    *more = true;
    for (unsigned i = 0; i < g->threads; i++) /* `take` may need the memory of subtrees */
        subtree_walk_let_go(&g->walk[i]);
    for (uint64_t at = 0; at < g->count && *more && status == EBPO_OK; at += PASSED_AT_ONCE) {
        uint64_t n = g->count - at < PASSED_AT_ONCE ? g->count - at : PASSED_AT_ONCE;
        for (uint64_t i = 0; i < n; i++)
            out[i] = face_pair_of(g->collision, &g->stored[at + i]);
        status = ebpo_collision_find_sources(g->collision, out, n, error);
        *more = status == EBPO_OK && take(user, out, n);
    }
    return status;
}

/* Searches in rounds, each of which finds all pairs of a range of faces of the first model. */
static ebpo_status search_in_rounds(gathering_parts *g, ebpo_pairs_fn take, void *user,
                                    ebpo_error *error)
{
    uint64_t most = g->collision->collider->options.memory / (2 * sizeof *g->stored) + 2;
    for (g->from = 0; g->from < UINT64_MAX; g->from = g->to) {
        g->to = UINT64_MAX;
        g->count = 0;
        g->most = most;
        ebpo_status status = run_all(g, error);
        if (status != EBPO_OK)
            return status;
        sort_unique(g);
        bool more;
        status = pass_waiting(g, take, user, &more, error);
        if (status != EBPO_OK || !more)
            return status;
    }
    return EBPO_OK;
}

/* --- both queries --- */

/* Prepares the search of `threads` threads. */
static ebpo_status begin_threads(gathering_parts *g, unsigned threads, ebpo_error *error)
{
    const ebpo_collision *q = g->collision;
    ebpo_status status = EBPO_OK;
    g->walk = ebpo_alloc_lines(threads, sizeof *g->walk);
    if (!g->walk)
        return ebpo_fail_memory(error, threads * sizeof *g->walk);
    g->threads = threads;
    g->read_before = ebpo_collision_bytes_read(q);
    for (int i = 0; i < 2 && status == EBPO_OK; i++)
        status =
            ebpo_posed_subtrees_make(&g->subtrees[i], q->model[i], &q->posing[i].posing, error);
    for (unsigned i = 0; i < threads && status == EBPO_OK; i++)
        status = subtree_walk_begin(&g->walk[i], q, g->self, error);
    return status;
}

/* Returns a search for pairs of subtrees, for one thread, after begin_threads. */
static subtree_pair_search pair_search_of(gathering_parts *g, ebpo_error *error)
{
    ebpo_posed_subtrees *s = g->subtrees; /* if g->self, both models share the envelopes */
    return (subtree_pair_search){ &g->pairs,    { s, s + !g->self },
                                  g->collision, &g->walk[0],
                                  g->self,      error };
}

/* Prepares the search of `threads` threads, and finds the pairs of subtrees. */
static ebpo_status begin_gathering(gathering_parts *g, unsigned threads, ebpo_error *error)
{
    const ebpo_collision *q = g->collision;
    ebpo_status status = begin_threads(g, threads, error);
    if (status == EBPO_OK) {
        subtree_pair_search search = pair_search_of(g, error);
        status = find_subtree_pairs(&search);
    }
    if (status != EBPO_OK)
        return status;
    if (q->collider->backward)
        reverse_pairs(g->pairs.pair, g->pairs.count);
    q->collider->backward = !q->collider->backward;
    q->collider->subtree_pairs += g->pairs.count;
    q->collider->subtrees += g->pairs.subtrees[0] + g->pairs.subtrees[1];
    g->end = ebpo_alloc_zero(g->subtrees[0].count, sizeof *g->end);
    return g->end ? EBPO_OK : ebpo_fail_memory(error, g->subtrees[0].count * sizeof *g->end);
}

/* Adds the counts of the search to the collider's counts, and frees the memory. */
static void end_gathering(gathering_parts *g)
{
    g->collision->collider->bytes_read += ebpo_collision_bytes_read(g->collision) - g->read_before;
    for (unsigned i = 0; i < g->threads; i++) {
        count_walk(g, &g->walk[i]);
        subtree_walk_free(&g->walk[i]);
    }
    for (int i = 0; i < 2; i++)
        ebpo_posed_subtrees_free(&g->subtrees[i]);
    free(g->walk);
    free(g->pairs.pair);
    free(g->end);
    free(g->stored);
    (void)pthread_mutex_destroy(&g->lock);
}

ebpo_status ebpo_gather_parts(const ebpo_collision *q, bool self, ebpo_pairs_fn take, void *user,
                              ebpo_error *error)
{
    gathering_parts g = { .collision = q, .self = self };
    (void)pthread_mutex_init(&g.lock, NULL);
    ebpo_status status =
        begin_gathering(&g, ebpo_thread_count(q->collider->options.threads), error);
    if (status == EBPO_OK)
        status = search_in_rounds(&g, take, user, error);
    end_gathering(&g);
    return status;
}

/* Counts a pair of subtrees, and the subtrees that are in no earlier pair. */
static void count_pair(const gathering_parts *g, const subtree_pair *pair, bool *visited[2])
{
    ebpo_collider *c = g->collision->collider;
    c->subtree_pairs++;
    c->subtrees += !visited[0][pair->a] + !visited[1][pair->b];
    visited[0][pair->a] = visited[1][pair->b] = true;
}

/* Finds the first pair of subtrees that has intersecting faces. Sets *out to the first intersecting
 * pair of its faces, in the order of the files. *found: as for ebpo_collide_first. */
static ebpo_status search_first_parts(gathering_parts *g, nearest_pairs *pairs, bool *visited[2],
                                      ebpo_face_pair *out, int32_t *found, ebpo_error *error)
{
    const ebpo_collision *q = g->collision;
    subtree_walk *w = &g->walk[0];
    for (;;) {
        subtree_pair pair;
        bool more;
        ebpo_status status = next_nearest(pairs, &pair, &more);
        if (pairs->late)
            *found = -1;
        if (status != EBPO_OK || !more)
            return status;
        count_pair(g, &pair, visited);
        status = subtree_walk_pair(w, &pair, error);
        if (status != EBPO_OK)
            return status;
        *found = w->late || ebpo_collision_is_late(q) ? -1 : w->count > 0;
        if (*found < 0)
            return EBPO_OK;
        if (*found) {
            qsort(w->stored, w->count, sizeof *w->stored, compare_stored_pairs);
            *out = face_pair_of(q, &w->stored[0]);
            return ebpo_collision_find_sources(q, out, 1, error);
        }
        if (!ebpo_progress_step(&q->options.progress, stage, pairs->found - 1, 0, error))
            return EBPO_E_CANCELLED;
    }
}

ebpo_status ebpo_first_of_parts(const ebpo_collision *q, ebpo_face_pair *out, int32_t *found,
                                ebpo_error *error)
{
    gathering_parts g = { .collision = q };
    nearest_pairs pairs = { .count = 0 };
    bool *visited[2] = { NULL, NULL };
    (void)pthread_mutex_init(&g.lock, NULL);
    ebpo_status status = begin_threads(&g, 1, error);
    for (int i = 0; i < 2 && status == EBPO_OK; i++) {
        visited[i] = ebpo_alloc_zero(g.subtrees[i].count, sizeof *visited[i]);
        if (!visited[i])
            status = ebpo_fail_memory(error, g.subtrees[i].count);
    }
    if (status == EBPO_OK) {
        subtree_pair_search search = pair_search_of(&g, error);
        status = begin_nearest(&pairs, &search);
    }
    if (status == EBPO_OK)
        status = search_first_parts(&g, &pairs, visited, out, found, error);
    free(pairs.heap);
    free(visited[0]);
    free(visited[1]);
    end_gathering(&g);
    return status;
}
