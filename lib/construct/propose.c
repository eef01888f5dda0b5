/* Chooses the planes of envelopes from the leaves up, for the selections of the theses (EBP 2017,
 * 3.4.1). Later, emit_levels.c and envelopes.c visit the nodes from the root down and compute the
 * envelopes from the chosen planes.
 *
 * A candidate is a plane that may be chosen. The candidates of a leaf are the planes of its faces;
 * the candidates of a gray node are the planes that its children have chosen ("offers"). The chosen
 * planes clip the node's cell. The offset of a plane with the normal n is its support: the greatest
 * n . x over the corners of the children's envelopes and over the solid itself. So the envelope
 * contains the solid even if the corners are rounded.
 *
 * A piece is a subtree that one thread processes. For each piece, the nodes are made, planes are
 * chosen, and the nodes are freed again. Then planes are chosen for the nodes of the top (the nodes
 * above all pieces), the deepest level first; nodes of the same level are processed in parallel. */
#include "core/strict_fp.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "construct/planes.h"
#include "construct/construct_stages.h"
#include "construct/pieces.h"
#include "construct/supports.h"
#include "construct/thesis_levels.h"
#include "core/alloc.h"
#include "core/error.h"
#include "core/parallel.h"
#include "geometry/cells.h"
#include "geometry/polytope.h"

/* Upper bound, in cells, of the rounding error of a corner of a child's envelope. */
static const double corner_error = 1e-9;

/* State of one thread. */
typedef struct proposer {
    const ebpo_builder *b;
    ebpo_branch *s;
    ebpo_select_fn select;
    ebpo_supports supports;     /* work space for the supports of gray nodes */
    ebpo_candidate *candidates; /* candidates of the node that is being processed */
    int *order;                 /* indices of candidates, as ebpo_choice.order */
    uint64_t candidate_capacity, order_capacity;
    ebpo_large_polytope thesis_envelope; /* work space of ebpo_thesis_choose */
} proposer;

/* --- choosing, for leaves and gray nodes alike --- */

/* Compares two offers by normal, then by origin. */
static int by_normal(const void *a, const void *b)
{
    const ebpo_offer *x = a, *y = b;
    if (x->normal != y->normal)
        return x->normal < y->normal ? -1 : 1;
    /* with equal normals, the offer comes first whose plane will be moved least to reach the
     * support */
    return x->origin > y->origin ? -1 : x->origin < y->origin;
}

static int by_normal_alone(const void *a, const void *b)
{
    const ebpo_offer *x = a, *y = b;
    return (x->normal > y->normal) - (x->normal < y->normal);
}

/* Approximate maximum number of candidates of a node. If there are more, only every n-th candidate
 * is kept, because k-medoids compares all pairs. Only leaves of the deepest level can have more. */
enum { CANDIDATES_MAX = 4096 };

static int by_rank(const void *a, const void *b)
{
    const uint64_t *x = a, *y = b;
    return (*x > *y) - (*x < *y);
}

/* Sets p->order: the candidates' indices in the order of the node's faces or children. Returns
 * false when out of memory. */
static bool sort_order(proposer *p, const ebpo_handover *given)
{
    uint64_t *pair = ebpo_alloc(given->offer_count, sizeof *pair);
    for (uint64_t i = 0; pair && i < given->offer_count; i++)
        pair[i] = (uint64_t)given->offers[i].rank << 32 | i;
    if (pair)
        qsort(pair, given->offer_count, sizeof *pair, by_rank);
    for (uint64_t i = 0; pair && i < given->offer_count; i++)
        p->order[i] = (int)(pair[i] & UINT32_MAX);
    free(pair);
    return pair != NULL;
}

/* Sets the ranks of the offers, sorts the offers by normal, and keeps one offer of each normal. If
 * more than about CANDIDATES_MAX offers remain, keeps every n-th of them. */
static void thin_offers(ebpo_handover *given)
{
    uint64_t kept = 0;
    for (uint64_t i = 0; i < given->offer_count; i++)
        given->offers[i].rank = (uint32_t)i;
    qsort(given->offers, given->offer_count, sizeof *given->offers, by_normal);
    for (uint64_t i = 0; i < given->offer_count; i++)
        if (i == 0 || given->offers[i].normal != given->offers[i - 1].normal)
            given->offers[kept++] = given->offers[i];
    uint64_t step = kept / CANDIDATES_MAX + 1;
    given->offer_count = 0;
    for (uint64_t i = 0; i < kept; i += step)
        given->offers[given->offer_count++] = given->offers[i];
}

/* Makes p->candidates from the offers. Supports are computed later. Returns false when out of
 * memory. */
static bool make_candidates(proposer *p, ebpo_handover *given)
{
    if (given->offer_count == 0)
        return true;
    if (!p->b->thesis)
        thin_offers(given);
    uint64_t kept = given->offer_count;
    if (!ebpo_grow(&p->candidates, &p->candidate_capacity, kept, sizeof *p->candidates) ||
        !ebpo_grow(&p->order, &p->order_capacity, kept, sizeof *p->order))
        return false;
    for (uint64_t i = 0; i < kept; i++) {
        p->candidates[i] = (ebpo_candidate){ .normal = given->offers[i].normal, .support = -1e300 };
        p->order[i] = (int)i;
    }
    return p->b->thesis || sort_order(p, given);
}

/* Raises the candidate's support, if needed, so that the half-space n . x <= support contains the
 * exact point, where n is the decoded normal. `slack`: upper bound of the rounding error of each
 * coordinate of `point`. */
static void raise_support(ebpo_candidate *c, const double point[3], double slack)
{
    int32_t n[3], d;
    ebpo_plane_code_decode(c->normal, n, &d);
    double s = n[0] * point[0] + n[1] * point[1] + n[2] * point[2] + EBPO_NORMAL_NORM * slack;
    c->support = s > c->support ? s : c->support;
}

/* Returns ebpo_candidate.moved for an offer: the distance between the offered plane and the plane
 * with this support, in the model's unit. `size`: [3] size of the cell, in the same unit. */
static double moved_by(const ebpo_offer *offer, double support, const double size[3])
{
    int32_t n[3], d;
    double square = 0, least = fmin(size[0], fmin(size[1], size[2]));
    ebpo_plane_code_decode(offer->normal, n, &d);
    for (int k = 0; k < 3; k++)
        square += (n[k] * (least / size[k])) * (n[k] * (least / size[k]));
    return (support - offer->origin) * least / sqrt(square);
}

/* Chooses planes of a node from p->candidates, which were made from the offers in `given`. Adds the
 * planes to the branch's proposals, and the data for the parent to `out`. `leaf_faces`: number of
 * faces in the list of a leaf; 0 for a gray node. Returns false when out of memory. */
static bool choose_planes(proposer *p, uint32_t detail, ebpo_cell cell, uint64_t leaf_faces,
                          const ebpo_handover *given, ebpo_handover *out)
{
    const ebpo_build_options *o = p->b->options;
    ebpo_proposals *all = p->s->proposals;
    uint32_t codes[EBPO_PLANES_STORED];
    double size[3];
    ebpo_polytope envelope;
    ebpo_polytope_cube(&envelope);
    for (int k = 0; k < 3; k++)
        size[k] = p->b->box.size[k] / (double)(1u << cell.level);
    for (uint64_t i = 0; i < given->offer_count; i++)
        p->candidates[i].moved = moved_by(&given->offers[i], p->candidates[i].support, size);
    ebpo_choice choice = { .candidates = p->candidates,
                           .count = (int)given->offer_count,
                           .codes_max = EBPO_PLANES_STORED,
                           .order = p->order,
                           .cell_size = size,
                           .normals = o->normals,
                           .wanted = ebpo_selection_wanted((int)given->offer_count, cell.level,
                                                           o->percent, o->k_root),
                           .seed = o->seed ^ ebpo_octcode_of_cell(cell) * 0x9e3779b97f4a7c15u };
    if (p->b->thesis)
        return ebpo_thesis_choose(p->b, &p->thesis_envelope, all->thesis, cell, leaf_faces, &choice,
                                  given, out);
    int count = p->select(&envelope, &choice, codes);
    if (count < 0 || !ebpo_grow(&all->codes, &all->code_capacity, all->code_count + (uint64_t)count,
                                sizeof *all->codes))
        return false;
    all->first[detail] = all->code_count;
    all->count[detail] = (uint8_t)count;
    for (int i = 0; i < count; i++) {
        ebpo_offer *offer = bsearch(&(ebpo_offer){ .normal = codes[i] & 0xfffff }, given->offers,
                                    given->offer_count, sizeof *offer, by_normal_alone);
        all->codes[all->code_count++] = codes[i];
        if (offer && !ebpo_handover_add(out, offer->normal, offer->origin))
            return false;
    }
    if (!ebpo_grow(&out->corner, &out->corner_capacity, (uint64_t)envelope.vertex_count,
                   sizeof *out->corner))
        return false;
    /* only corners of faces that planes made; faces of the cell have negative tags */
    bool used[EBPO_POLYTOPE_VERTICES] = { false };
    for (int f = 0; f < envelope.face_count; f++)
        for (int i = envelope.first[f]; i < envelope.first[f + 1] && envelope.tag[f] >= 0; i++)
            if (!used[envelope.corner[i]]) {
                used[envelope.corner[i]] = true;
                memcpy(out->corner[out->corner_count++], envelope.vertex[envelope.corner[i]],
                       sizeof *out->corner);
            }
    return true;
}

/* --- leaves: the candidates are planes of faces, moved until they contain the solid --- */

/* Adds the plane of each face of a leaf to the offers. Returns false when out of memory. */
static bool offer_faces(proposer *p, const ebpo_build_detail *d, ebpo_cell cell,
                        ebpo_handover *given)
{
    const ebpo_builder *b = p->b;
    for (uint64_t i = d->entry_begin; i < d->entry_end; i++) {
        ebpo_triangle t;
        uint32_t normal;
        int32_t n[3], e;
        double origin = 0;
        ebpo_branch_triangle(b, p->s, p->s->entries[i], &t);
        if (!ebpo_face_normal_code(&b->box, &t, &normal))
            continue;
        ebpo_plane_code_decode(normal, n, &e);
        for (int k = 0; k < 3; k++) {
            double corner = ebpo_cell_face(&b->box, k, cell.level, cell.at[k]),
                   size = b->box.size[k] / (double)(1u << cell.level);
            for (int c = 0; c < 3; c++)
                origin += n[k] * ((t.corner[c][k] - corner) / size) / 3;
        }
        if (!ebpo_handover_add(given, normal, origin))
            return false;
    }
    return true;
}

/* Computes the supports of a leaf's candidates: the maximum of n . x over the leaf's faces in the
 * cell and over the corners of the cell that are inside the solid. */
static void leaf_supports(proposer *p, const ebpo_build_detail *d, ebpo_cell cell, int32_t winding,
                          uint64_t count)
{
    const ebpo_builder *b = p->b;
    unsigned inside = ebpo_leaf_corners(b, cell, winding, d->delta);
    for (uint64_t i = d->entry_begin; i < d->entry_end; i++) {
        ebpo_triangle t;
        double points[9][3], slack;
        ebpo_branch_triangle(b, p->s, p->s->entries[i], &t);
        int corners = ebpo_clip_triangle(&b->box, cell, &t, points, &slack);
        for (int c = 0; c < corners; c++)
            for (uint64_t j = 0; j < count; j++)
                raise_support(&p->candidates[j], points[c], slack);
    }
    for (int i = 0; i < 8; i++)
        for (uint64_t j = 0; j < count && inside >> i & 1; j++)
            raise_support(&p->candidates[j], (const double[3]){ i & 1, i >> 1 & 1, i >> 2 & 1 }, 0);
}

/* Chooses planes for a leaf, and adds the data for its parent to `out`. Returns false when out of
 * memory. */
static bool propose_leaf(proposer *p, uint32_t detail, ebpo_cell cell, int32_t winding,
                         ebpo_handover *out)
{
    const ebpo_build_detail *d = &p->s->details[detail];
    ebpo_handover given = { 0 };
    bool good = offer_faces(p, d, cell, &given) && make_candidates(p, &given);
    if (good) {
        leaf_supports(p, d, cell, winding, given.offer_count);
        good = choose_planes(p, detail, cell, d->entry_end - d->entry_begin, &given, out);
    }
    ebpo_handover_free(&given);
    return good;
}

/* --- gray nodes: the candidates are the children's planes, moved until they contain the solid and
 * the children's envelopes --- */

/* Computes the supports of a gray node's candidates: the maximum of n . x over the solid in the
 * cell and over the corners of the children's envelopes. Returns false when out of memory. */
static bool gray_supports(proposer *p, const ebpo_build_detail *d, ebpo_cell cell, int32_t winding,
                          const ebpo_handover *given)
{
    if (!ebpo_supports_gather(&p->supports, p->b, p->s, d, cell, winding))
        return false;
    for (uint64_t i = 0; i < given->offer_count; i++) {
        ebpo_candidate *c = &p->candidates[i];
        int32_t n[3], e;
        double where[3];
        ebpo_plane_code_decode(c->normal, n, &e);
        c->support = ebpo_supports_find(&p->supports, n, 1e300, where);
        for (uint64_t j = 0; j < given->corner_count; j++)
            raise_support(c, given->corner[j], corner_error);
    }
    return true;
}

/* Chooses planes for a gray node, and adds the data for its parent to `out`. `given`: the data of
 * its children. Returns false when out of memory. */
static bool propose_gray(proposer *p, uint32_t detail, ebpo_cell cell, int32_t winding,
                         ebpo_handover *given, ebpo_handover *out)
{
    return make_candidates(p, given) &&
           gray_supports(p, &p->s->details[detail], cell, winding, given) &&
           choose_planes(p, detail, cell, 0, given, out);
}

/* Chooses planes for a node and all nodes below, and adds the data for its parent to `out`.
 * `winding`: winding number at the node's lowest corner. Returns false when out of memory. */
static bool propose_node(proposer *p, uint32_t index, ebpo_cell cell, int32_t winding,
                         ebpo_handover *out)
{
    ebpo_build_node node = p->s->nodes[index];
    if (node.type == EBPO_LEAF)
        return propose_leaf(p, node.detail, cell, winding, out);
    if (node.type != EBPO_GRAY && p->b->thesis)
        ebpo_thesis_add_empty(p->b, p->s->proposals->thesis, cell.level, winding);
    if (node.type != EBPO_GRAY)
        return true;
    int32_t offset[8];
    ebpo_handover given = { 0 };
    bool good = true;
    ebpo_child_windings(p->b, p->s, cell, node.child, offset);
    for (unsigned o = 0; o < 8 && good; o++) {
        ebpo_handover child = { 0 };
        good = propose_node(p, node.child + o, ebpo_cell_child(cell, o), winding + offset[o],
                            &child) &&
               ebpo_handover_gather(&given, &child, o);
        ebpo_handover_free(&child);
    }
    good = good && propose_gray(p, node.detail, cell, winding, &given, out);
    ebpo_handover_free(&given);
    return good;
}

static void proposer_free(proposer *p)
{
    ebpo_supports_free(&p->supports);
    free(p->candidates);
    free(p->order);
    ebpo_large_free(&p->thesis_envelope);
}

/* Chooses the planes of one gray node of the top from the data of its children. Returns false when
 * out of memory. */
static bool propose_one_gray(const ebpo_builder *b, ebpo_branch *s, uint32_t detail, ebpo_cell cell,
                             int32_t winding, ebpo_handover *given, ebpo_handover *out)
{
    proposer p = { .b = b, .s = s, .select = ebpo_selection_function(b->options->select) };
    bool good = propose_gray(&p, detail, cell, winding, given, out);
    proposer_free(&p);
    return good;
}

/* --- pieces --- */

static ebpo_status no_memory(ebpo_error *error)
{
    return ebpo_fail(error, EBPO_E_MEMORY, "out of memory while choosing planes");
}

/* Sets s->proposals to proposals without planes. Returns false when out of memory. */
static bool make_proposals(const ebpo_builder *b, ebpo_branch *s)
{
    return ebpo_proposals_make(s) &&
           (!b->thesis || (s->proposals->thesis =
                               ebpo_alloc_zero(EBPO_LEVELS_MAX, sizeof *s->proposals->thesis)));
}

/* Moves the proposals to the builder's store, where they stay until the envelopes are computed. */
static ebpo_status pack_proposals(ebpo_builder *b, ebpo_branch *s, ebpo_error *error)
{
    ebpo_proposals *p = s->proposals;
    uint64_t n = s->detail_count,
             bytes = n * (sizeof *p->first + 1) + p->code_count * sizeof *p->codes;
    if (!b->workspace)
        return EBPO_OK;
    uint64_t *first = ebpo_store_reserve(b, bytes);
    if (!first)
        return ebpo_workspace_fail(b->workspace, bytes, error);
    uint32_t *codes = (uint32_t *)(first + n);
    uint8_t *count = (uint8_t *)(codes + p->code_count);
    memcpy(first, p->first, (size_t)n * sizeof *first);
    memcpy(count, p->count, (size_t)n);
    if (p->code_count)
        memcpy(codes, p->codes, (size_t)p->code_count * sizeof *codes);
    free(p->first);
    free(p->count);
    free(p->codes);
    p->first = first;
    p->codes = codes;
    p->count = count;
    p->packed = true;
    return EBPO_OK;
}

/* Makes the nodes of pieces first .. last - 1, chooses their planes, and frees the nodes. */
static ebpo_status propose_pieces(void *context, uint64_t first, uint64_t last, unsigned worker,
                                  ebpo_error *error)
{
    ebpo_builder *b = context;
    proposer p = { .b = b, .select = ebpo_selection_function(b->options->select) };
    ebpo_status status = EBPO_OK;
    (void)worker;
    for (uint64_t i = first; i < last && status == EBPO_OK; i++) {
        p.s = &b->piece[i];
        status = ebpo_build_partition(b, p.s, error);
        if (status == EBPO_OK &&
            (!make_proposals(b, p.s) ||
             !propose_node(&p, 0, p.s->cell, p.s->winding, &p.s->proposals->root)))
            status = no_memory(error);
        if (status == EBPO_OK)
            status = pack_proposals(b, p.s, error);
        ebpo_branch_forget(p.s);
    }
    proposer_free(&p);
    return status;
}

/* --- the top --- */

/* A gray node of the top. */
typedef struct top_node {
    uint32_t node; /* index in the top's nodes */
    ebpo_cell cell;
    int32_t winding;          /* winding number at the lowest corner */
    ebpo_handover given, out; /* data from the children; data for the parent */
    uint64_t parent;          /* index of the parent in top_list.nodes; UINT64_MAX: the root */
    unsigned octant;          /* octant of this node in its parent */
    uint32_t codes[EBPO_PLANES_STORED];
    int count;                 /* number of codes */
    ebpo_thesis_level *thesis; /* as in ebpo_proposals */
} top_node;

typedef struct top_list {
    ebpo_builder *b;
    top_node *nodes; /* breadth first */
    uint64_t count, capacity;
    uint64_t base; /* index of the first node of the level that is being processed */
} top_list;

/* Lists the gray nodes of the top breadth first, so that the nodes of a level are consecutive. Also
 * computes the winding numbers at the lowest corners of these nodes and of the pieces. Returns
 * false when out of memory. */
static bool list_top(top_list *t)
{
    ebpo_builder *b = t->b;
    if (b->top.nodes[0].type == EBPO_LEAF)
        return true;
    if (!ebpo_grow(&t->nodes, &t->capacity, 1, sizeof *t->nodes))
        return false;
    t->nodes[t->count++] = (top_node){ .cell = b->top.cell, .parent = UINT64_MAX };
    for (uint64_t i = 0; i < t->count; i++) {
        const ebpo_build_node *node = &b->top.nodes[t->nodes[i].node];
        int32_t offset[8];
        ebpo_child_windings(b, &b->top, t->nodes[i].cell, node->child, offset);
        for (uint32_t o = 0; o < 8; o++) {
            const ebpo_build_node *child = &b->top.nodes[node->child + o];
            int32_t winding = t->nodes[i].winding + offset[o];
            if (child->type == EBPO_LEAF)
                b->piece[child->detail].winding = winding;
            if (child->type != EBPO_GRAY)
                continue;
            if (!ebpo_grow(&t->nodes, &t->capacity, t->count + 1, sizeof *t->nodes))
                return false;
            t->nodes[t->count++] = (top_node){ .node = node->child + o,
                                               .cell = ebpo_cell_child(t->nodes[i].cell, o),
                                               .winding = winding,
                                               .parent = i,
                                               .octant = o };
        }
    }
    return true;
}

/* Chooses planes for nodes of one level of the top. The data of gray children are in top_node.given
 * already. The function adds the data of children that are pieces. */
static ebpo_status propose_top_nodes(void *context, uint64_t first, uint64_t last, unsigned worker,
                                     ebpo_error *error)
{
    top_list *t = context;
    ebpo_builder *b = t->b;
    (void)worker;
    ebpo_status status = EBPO_OK;
    for (uint64_t i = first; i < last && status == EBPO_OK; i++) {
        top_node *n = &t->nodes[t->base + i];
        const ebpo_build_node *node = &b->top.nodes[n->node];
        /* a copy with separate proposals, because other threads also make proposals for the top */
        ebpo_branch alone = b->top;
        uint32_t detail = node->detail;
        int32_t offset[8];
        ebpo_child_windings(b, &b->top, n->cell, node->child, offset);
        alone.proposals = NULL;
        bool good = make_proposals(b, &alone);
        for (unsigned o = 0; o < 8 && good; o++) {
            const ebpo_build_node *child = &b->top.nodes[node->child + o];
            if (child->type == EBPO_WHITE && b->thesis)
                ebpo_thesis_add_empty(b, alone.proposals->thesis, n->cell.level + 1,
                                      n->winding + offset[o]);
            if (child->type != EBPO_LEAF)
                continue;
            ebpo_handover *root = &b->piece[child->detail].proposals->root;
            good = ebpo_handover_gather(&n->given, root, o);
            ebpo_handover_free(root);
        }
        good = good && propose_one_gray(b, &alone, detail, n->cell, n->winding, &n->given, &n->out);
        if (good) {
            const uint32_t *codes = ebpo_proposed(&alone, detail, &n->count);
            memcpy(n->codes, codes, (size_t)n->count * sizeof *codes);
            n->thesis = alone.proposals->thesis;
            alone.proposals->thesis = NULL;
        } else
            status = no_memory(error);
        ebpo_handover_free(&n->given);
        ebpo_proposals_free(alone.proposals);
    }
    return status;
}

/* Stores the chosen planes as the top's proposals. Returns false when out of memory. */
static bool store_top(top_list *t)
{
    ebpo_branch *s = &t->b->top;
    if (!ebpo_proposals_make(s))
        return false;
    ebpo_proposals *p = s->proposals;
    for (uint64_t i = 0; i < t->count; i++) {
        top_node *n = &t->nodes[i];
        uint32_t detail = s->nodes[n->node].detail;
        if (!ebpo_grow(&p->codes, &p->code_capacity, p->code_count + (uint64_t)n->count,
                       sizeof *p->codes))
            return false;
        p->first[detail] = p->code_count;
        p->count[detail] = (uint8_t)n->count;
        if (n->count)
            memcpy(p->codes + p->code_count, n->codes, (size_t)n->count * sizeof *n->codes);
        p->code_count += (uint64_t)n->count;
    }
    return true;
}

/* Chooses planes for the nodes of the top, the deepest level first. */
static ebpo_status propose_top(top_list *t, ebpo_pass *pass, ebpo_error *error)
{
    ebpo_builder *b = t->b;
    ebpo_progress progress = ebpo_pass_progress(pass);
    ebpo_status status = EBPO_OK;
    uint64_t end_of_level = t->count;
    while (end_of_level && status == EBPO_OK) {
        t->base = end_of_level - 1;
        while (t->base && t->nodes[t->base - 1].cell.level == t->nodes[end_of_level - 1].cell.level)
            t->base--;
        pass->begin = pass->end;
        pass->end += end_of_level - t->base;
        status = ebpo_parallel_for(b->threads, NULL, end_of_level - t->base, 1, propose_top_nodes,
                                   t, &progress, "choosing planes", error);
        for (uint64_t i = t->base; i < end_of_level && status == EBPO_OK; i++) {
            top_node *n = &t->nodes[i];
            if (n->parent != UINT64_MAX &&
                !ebpo_handover_gather(&t->nodes[n->parent].given, &n->out, n->octant))
                status = no_memory(error);
            ebpo_handover_free(&n->out);
        }
        end_of_level = t->base;
    }
    return status;
}

/* Adds up the sums of ebpo_build_as_theses over all pieces and nodes of the top. The order is
 * fixed, so that the results do not depend on the number of threads. */
static void add_up_levels(const top_list *t)
{
    ebpo_builder *b = t->b;
    for (uint64_t i = 0; i < b->piece_count; i++)
        ebpo_thesis_add_up(b->thesis->out, b->piece[i].proposals->thesis);
    for (uint64_t i = 0; i < t->count; i++)
        ebpo_thesis_add_up(b->thesis->out, t->nodes[i].thesis);
}

ebpo_status ebpo_build_propose(ebpo_builder *b, ebpo_error *error)
{
    if (!ebpo_selection_describe(b->options->select)->from_leaves ||
        !(b->options->parts & (EBPO_PART_PLANES | EBPO_PART_LEAF_PLANES)))
        return EBPO_OK;
    top_list t = { .b = b };
    ebpo_status status = list_top(&t) ? EBPO_OK : no_memory(error);
    ebpo_pass pass = { &b->options->progress, 0, b->piece_count, b->piece_count + t.count };
    ebpo_progress progress = ebpo_pass_progress(&pass);
    if (status == EBPO_OK)
        status = ebpo_parallel_for(b->threads, b->workspace, b->piece_count, 1, propose_pieces, b,
                                   &progress, "choosing planes", error);
    atomic_store(&b->leaf_count, 0); /* the leaves will be made and counted again */
    atomic_store(&b->entry_count, 0);
    if (status == EBPO_OK)
        status = propose_top(&t, &pass, error);
    if (status == EBPO_OK && !store_top(&t))
        status = no_memory(error);
    if (status == EBPO_OK && b->thesis)
        add_up_levels(&t);
    for (uint64_t i = 0; i < t.count; i++) {
        free(t.nodes[i].thesis);
        ebpo_handover_free(&t.nodes[i].given);
        ebpo_handover_free(&t.nodes[i].out);
    }
    free(t.nodes);
    return status;
}
