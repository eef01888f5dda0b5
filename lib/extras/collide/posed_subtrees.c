/* Finds the subtrees of a posed model and convex envelopes of their faces, and bounds the distance
 * of envelopes. A partly loaded model has subtrees that are loaded on demand; a model that is
 * entirely in memory (a whole model) is a single subtree.
 *
 * An envelope is computed from the cell of a node. The planes of the node and of its nearest
 * ancestors, which are in memory, cut the cell. The resulting polytope is posed. A hash table keeps
 * envelopes by octcode (locational code). A gap is a lower bound of the distance of two convex
 * sets. The iteration of Gilbert (1966) finds the gap. Each step tries a direction, which gives a
 * lower bound, so the iteration may stop after any step. */
#include "core/strict_fp.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "core/alloc.h"
#include "core/error.h"
#include "core/hash.h"
#include "extras/collide/posed_subtrees.h"
#include "geometry/vec3.h"
#include "geometry/cells.h"
#include "geometry/polytope.h"
#include "query/query_node.h"

/* Computes the mean of the points of a hull, which is a point of the hull. */
static void middle_of(const ebpo_convex *c, double out[3])
{
    for (int k = 0; k < 3; k++) {
        double sum = 0;
        for (int i = 0; i < c->count; i++)
            sum += c->point[i][k];
        out[k] = sum / c->count;
    }
}

/* Returns the point of a hull that is farthest in the direction sign * n. sign: 1 or -1. */
static const double *farthest_point(const ebpo_convex *c, const double n[3], double sign)
{
    int best = 0;
    double most = -INFINITY;
    for (int i = 0; i < c->count; i++) {
        double at = sign * ebpo_vec3_dot(c->point[i], n);
        if (at > most) {
            most = at;
            best = i;
        }
    }
    return c->point[best];
}

/* Maximum number of iterations. For sets that are nearly in contact, the gap after this number of
 * iterations is a valid bound, but is not accurate. */
enum { ITERATIONS = 32 };

/* Consider the set of all differences of a point of b and a point of a. This set is convex, and its
 * distance from the origin is the distance of both hulls. `v` is a point of this set. Each
 * iteration finds the point w of the set that is least along v. The component of w along v is a
 * lower bound of the distance. Then v becomes the point nearest to the origin on the segment from v
 * to w (Gilbert 1966). */
double ebpo_convex_gap(const ebpo_convex *a, const ebpo_convex *b, double enough)
{
    double v[3], w[3], middle[3], best = 0;
    middle_of(a, middle);
    middle_of(b, v);
    for (int k = 0; k < 3; k++)
        v[k] -= middle[k];
    for (int i = 0; i < ITERATIONS; i++) {
        double length2 = ebpo_vec3_dot(v, v), along, step2 = 0, back = 0;
        if (!(length2 > 0x1p-900 && length2 < 0x1p900)) /* the squares overflow, underflow or are
                                                         * not numbers */
            break;
        const double *p = farthest_point(a, v, 1), *q = farthest_point(b, v, -1);
        for (int k = 0; k < 3; k++)
            w[k] = q[k] - p[k];
        along = ebpo_vec3_dot(v, w) / sqrt(length2);
        best = along > best ? along : best;
        if (best > enough)
            break;
        for (int k = 0; k < 3; k++) {
            back += v[k] * (v[k] - w[k]);
            step2 += (v[k] - w[k]) * (v[k] - w[k]);
        }
        if (!(back > 0x1p-40 * length2)) /* v is nearest to the origin except for rounding */
            break;
        double share = back < step2 ? back / step2 : 1;
        for (int k = 0; k < 3; k++)
            v[k] += share * (w[k] - v[k]);
    }
    return best;
}

double ebpo_convex_span(const ebpo_convex *a, const ebpo_convex *b)
{
    double most = 0;
    for (int i = 0; i < a->count; i++)
        for (int j = 0; j < b->count; j++)
            most = fmax(most, ebpo_vec3_scaled_distance(a->point[i], b->point[j]));
    return most * (1 + 0x1p-40);
}

/* The posed envelope of a cell. */
typedef struct posed_hull {
    ebpo_octcode code; /* octcode of the cell */
    int count;         /* number of points */
    double point[][3];
} posed_hull;

/* Number of levels whose planes cut an envelope. This number is limited, because the rounding
 * errors of corners grow from level to level. */
enum { LEVELS_OF_PLANES = 10 };
/* Bound of the error of an envelope, as a share of the cell's side. Each level has at most 255
 * planes, and the error of each plane is at most 1e-10 of the level's cell. */
static const double cut_share = 0x1p-15;

/* Number of envelopes of nodes below the roots of subtrees that are kept. */
enum { DEEP_HULLS = 1 << 10 };

/* --- order of subtrees --- */

/* Sets the ranks of the subtrees at and below a node. next: rank of the first of them. Returns the
 * rank after the last of them. */
static uint32_t rank_subtrees(ebpo_posed_subtrees *s, const ebpo_posed_node *node, uint32_t next)
{
    ebpo_entry_kind kind = ebpo_entry_kind_of(node->entry);
    if (kind == EBPO_ENTRY_SUBTREE_ROOT)
        s->rank[ebpo_entry_value(node->entry)] = next++;
    for (unsigned octant = 0; kind == EBPO_ENTRY_GRAY && octant < 8; octant++) {
        ebpo_posed_node child = ebpo_posed_child(s, node, octant);
        next = rank_subtrees(s, &child, next);
    }
    return next;
}

ebpo_status ebpo_posed_subtrees_make(ebpo_posed_subtrees *out, const ebpo_model *model,
                                     const ebpo_posing *posing, ebpo_error *error)
{
    *out = (ebpo_posed_subtrees){ .model = model, .posing = *posing };
    out->count = model->whole ? 1 : model->top->below_count;
    out->rank = ebpo_alloc_zero(out->count, sizeof *out->rank);
    if (!out->rank)
        return ebpo_fail_memory(error, out->count * sizeof *out->rank);
    ebpo_posed_node root = ebpo_posed_root(out);
    if (!model->whole)
        (void)rank_subtrees(out, &root, 0);
    return EBPO_OK;
}

void ebpo_posed_subtrees_free(ebpo_posed_subtrees *s)
{
    for (uint64_t i = 0; i < s->slots; i++)
        free(s->hull[i]);
    for (int i = 0; s->deep_hull && i < DEEP_HULLS; i++)
        free(s->deep_hull[i]);
    free(s->hull);
    free(s->deep_hull);
    free(s->replaced);
    s->deep_hull = NULL;
    s->replaced = NULL;
    free(s->rank);
    free(s->chain);
    s->hull = NULL;
    s->rank = NULL;
    s->chain = NULL;
}

/* --- tables of nodes --- */

/* Returns the table of the nodes that are in memory. */
static const ebpo_node_table *nodes_of(const ebpo_posed_subtrees *s)
{
    return s->model->whole ? &s->model->whole->nodes : &s->model->top->nodes;
}

ebpo_posed_node ebpo_posed_root(const ebpo_posed_subtrees *s)
{
    return (ebpo_posed_node){ nodes_of(s)->root, { 0, { 0, 0, 0 } } };
}

ebpo_posed_node ebpo_posed_subtree_root(const ebpo_posed_subtrees *s)
{
    ebpo_posed_node root = ebpo_posed_root(s);
    if (s->model->whole)
        root.entry = ebpo_entry(EBPO_ENTRY_SUBTREE_ROOT, 0);
    return root;
}

ebpo_posed_node ebpo_posed_child(const ebpo_posed_subtrees *s, const ebpo_posed_node *gray,
                                 unsigned octant)
{
    return (ebpo_posed_node){ ebpo_table_child(nodes_of(s), gray->entry, octant),
                              ebpo_cell_child(gray->cell, octant) };
}

void ebpo_posed_cell(const ebpo_posed_subtrees *s, ebpo_cell cell, double out[8][3])
{
    ebpo_box box = ebpo_model_box(s->model);
    double bounds[2][3];
    ebpo_cell_bounds(&box, cell, bounds[0], bounds[1]);
    for (unsigned corner = 0; corner < 8; corner++) {
        double x[3];
        for (unsigned k = 0; k < 3; k++)
            x[k] = bounds[corner >> k & 1][k];
        ebpo_posing_apply(&s->posing, x, out[corner]);
    }
}

void ebpo_posed_ends(const ebpo_posed_subtrees *s, ebpo_cell cell, double out[3])
{
    ebpo_box box = ebpo_model_box(s->model);
    double low[3], high[3], end[2][3];
    ebpo_cell_bounds(&box, cell, low, high);
    ebpo_posing_apply(&s->posing, low, end[0]);
    ebpo_posing_apply(&s->posing, high, end[1]);
    for (int k = 0; k < 3; k++)
        out[k] = end[0][k] + end[1][k];
}

double ebpo_posed_slack(const ebpo_posed_subtrees *s, ebpo_cell cell, double max_coordinate)
{
    double side = 0;
    for (int k = 0; k < 3; k++)
        side = fmax(side, s->model->info->box_size[k]);
    side *= s->posing.scale / (double)(1u << cell.level);
    return 1.75 * cut_share * side + 0x1p-45 * max_coordinate;
}

double ebpo_posed_diagonal(const ebpo_posed_subtrees *s, ebpo_cell cell)
{
    return ebpo_vec3_scaled_length(s->model->info->box_size) * s->posing.scale /
           (double)(1u << cell.level);
}

/* --- envelopes --- */

/* Returns the nodes of a partly loaded model whose envelopes are in memory: the deep bounds, which
 * have some levels below the roots of subtrees, or the top. */
static const ebpo_top *known_nodes(const ebpo_posed_subtrees *s)
{
    const ebpo_top *deep = atomic_load_explicit(&s->model->deep, memory_order_acquire);
    return deep ? deep : s->model->top;
}

/* Returns a child of a gray node of `known`; NULL: of the whole model. A node of `known` that is
 * not gray has uniform children. */
static ebpo_posed_node known_child(const ebpo_posed_subtrees *s, const ebpo_top *known,
                                   const ebpo_posed_node *gray, unsigned octant)
{
    if (!known)
        return ebpo_posed_child(s, gray, octant);
    uint32_t entry = ebpo_entry_kind_of(gray->entry) == EBPO_ENTRY_GRAY
                         ? ebpo_table_child(&known->nodes, gray->entry, octant)
                         : ebpo_entry(EBPO_ENTRY_UNIFORM, EBPO_ENTRY_ZERO);
    return (ebpo_posed_node){ entry, ebpo_cell_child(gray->cell, octant) };
}

/* Cuts an envelope by the planes of a node of `known`; NULL: of the whole model. */
static void cut_node(const ebpo_posed_subtrees *s, const ebpo_top *known,
                     const ebpo_posed_node *node, ebpo_polytope *envelope)
{
    uint32_t count = 0, value = ebpo_entry_value(node->entry);
    const uint32_t *codes = NULL;
    if (known && ebpo_entry_kind_of(node->entry) != EBPO_ENTRY_UNIFORM) {
        ebpo_top_planes planes = ebpo_entry_kind_of(node->entry) == EBPO_ENTRY_GRAY
                                     ? known->gray[value]
                                     : known->below_planes[value];
        codes = known->planes + planes.first;
        count = planes.count;
    } else if (!known) {
        ebpo_node stored = ebpo_entry_node(node->entry, node->cell, s->model->info->rule);
        stored.subtree = s->model->whole;
        codes = ebpo_model_planes(s->model, &stored, &count);
    }
    ebpo_planes_cut(envelope, codes, count);
}

/* The envelopes of the last cell and of the cells that contain it, each in coordinates in which its
 * cell is a unit cube. Most cells have the same parent as the last cell, and need only the planes
 * of their own node. An envelope depends only on its index and on its cell. */
typedef struct envelope_chain {
    ebpo_octcode code[LEVELS_OF_PLANES]; /* octcode of each cell; 0: none */
    ebpo_polytope at[LEVELS_OF_PLANES];
} envelope_chain;

/* Returns the envelope of a cell, in the chain. */
static const ebpo_polytope *cut_envelope(const ebpo_posed_subtrees *s, ebpo_cell cell)
{
    envelope_chain *c = s->chain;
    const ebpo_top *known = s->model->whole ? NULL : known_nodes(s);
    ebpo_posed_node node = ebpo_posed_root(s);
    if (known)
        node.entry = known->nodes.root;
    ebpo_octcode last = ebpo_octcode_of_cell(cell);
    int first = cell.level < LEVELS_OF_PLANES ? 0 : cell.level - LEVELS_OF_PLANES + 1;
    for (int level = 0;; level++) {
        int i = level - first; /* levels before `first` do not cut the envelope */
        ebpo_octcode code = last >> 3 * (cell.level - level);
        if (i >= 0 && c->code[i] != code) {
            if (i == 0)
                ebpo_polytope_cube(&c->at[0]);
            else /* if this fails, the envelope is a box around the content */
                (void)ebpo_polytope_child(&c->at[i - 1], (unsigned)(code & 7), &c->at[i]);
            cut_node(s, known, &node, &c->at[i]);
            c->code[i] = code;
        }
        if (level == cell.level)
            return &c->at[i];
        node = known_child(s, known, &node, ebpo_cell_octant(cell, level));
    }
}

/* Returns the new posed envelope of a cell; NULL if memory is short. */
static posed_hull *make_hull(ebpo_posed_subtrees *s, ebpo_cell cell)
{
    ebpo_box box = ebpo_model_box(s->model);
    double low[3], high[3], x[3];
    if (!s->chain)
        s->chain = ebpo_alloc_zero(1, sizeof *s->chain);
    if (!s->chain)
        return NULL;
    const ebpo_polytope *p = cut_envelope(s, cell);
    posed_hull *out = malloc(sizeof *out + (size_t)p->vertex_count * sizeof *out->point);
    ebpo_cell_bounds(&box, cell, low, high);
    for (int i = 0; out && i < p->vertex_count; i++) {
        for (int k = 0; k < 3; k++)
            x[k] = low[k] + p->vertex[i][k] * (high[k] - low[k]);
        ebpo_posing_apply(&s->posing, x, out->point[i]);
    }
    if (out) {
        out->count = p->vertex_count;
        out->code = ebpo_octcode_of_cell(cell);
    }
    return out;
}

/* Returns the entry of the table that has an octcode, or, if no entry has it, the free entry for
 * the octcode. */
static posed_hull **find_hull(posed_hull **hull, uint64_t slots, ebpo_octcode code)
{
    uint64_t at;
    EBPO_HASH_FIND(at, ebpo_hash_number(code), slots - 1, !hull[at] || hull[at]->code == code);
    return &hull[at];
}

/* Makes space for one more entry of the table. Returns false if memory is short. */
static bool widen_table(ebpo_posed_subtrees *s)
{
    if (4 * (s->hulls + 1) <= 3 * s->slots)
        return true;
    uint64_t slots = ebpo_hash_slots(2 * s->slots);
    posed_hull **hull = ebpo_alloc_zero(slots, sizeof *hull);
    if (!hull)
        return false;
    for (uint64_t i = 0; i < s->slots; i++)
        if (s->hull[i])
            *find_hull(hull, slots, s->hull[i]->code) = s->hull[i];
    free(s->hull);
    s->hull = hull;
    s->bytes += (slots - s->slots) * sizeof *hull;
    s->slots = slots;
    return true;
}

ebpo_status ebpo_posed_envelope(ebpo_posed_subtrees *s, ebpo_cell cell, ebpo_convex *out,
                                ebpo_error *error)
{
    if (!widen_table(s))
        return ebpo_fail_memory(error, 2 * s->slots * sizeof *s->hull);
    posed_hull **hull = find_hull(s->hull, s->slots, ebpo_octcode_of_cell(cell));
    if (!*hull) {
        *hull = make_hull(s, cell);
        if (!*hull)
            return ebpo_fail_memory(error, sizeof *s->chain);
        s->hulls++;
        s->bytes += sizeof **hull + (uint64_t)(*hull)->count * sizeof *(*hull)->point;
    }
    *out = (ebpo_convex){ (*hull)->count, (const double(*)[3])(*hull)->point };
    return EBPO_OK;
}

/* --- below the roots of subtrees --- */

ebpo_posed_node ebpo_posed_deep_node(const ebpo_posed_subtrees *s, ebpo_cell cell)
{
    const ebpo_top *known = known_nodes(s);
    ebpo_posed_node node = { known->nodes.root, { 0, { 0, 0, 0 } } };
    for (int level = 0; level < cell.level; level++)
        node = known_child(s, known, &node, ebpo_cell_octant(cell, level));
    return node;
}

ebpo_posed_node ebpo_posed_deep_child(const ebpo_posed_subtrees *s, const ebpo_posed_node *gray,
                                      unsigned octant)
{
    return known_child(s, known_nodes(s), gray, octant);
}

ebpo_status ebpo_posed_deep_envelope(ebpo_posed_subtrees *s, ebpo_cell cell, ebpo_convex *out,
                                     ebpo_error *error)
{
    ebpo_octcode code = ebpo_octcode_of_cell(cell);
    if (!s->deep_hull)
        s->deep_hull = ebpo_alloc_zero(DEEP_HULLS, sizeof(posed_hull *));
    if (!s->deep_hull)
        return ebpo_fail_memory(error, DEEP_HULLS * sizeof(posed_hull *));
    posed_hull **hull = &s->deep_hull[ebpo_hash_number(code) % DEEP_HULLS];
    if (!*hull || (*hull)->code != code) {
        free(s->replaced); /* not *hull, which the last call may have returned */
        s->replaced = *hull;
        *hull = make_hull(s, cell);
    }
    if (!*hull)
        return ebpo_fail_memory(error, sizeof *s->chain);
    *out = (ebpo_convex){ (*hull)->count, (const double(*)[3])(*hull)->point };
    return EBPO_OK;
}
