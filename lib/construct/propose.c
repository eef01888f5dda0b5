/* Planes from the leaves up, of the nodes above the pieces, and the order in which all are chosen.
 */
#include "construct/propose.h"

#include <stdlib.h>
#include <string.h>

#include "core/alloc.h"
#include "core/error.h"
#include "core/parallel.h"
#include "construct/corner_windings.h"
#include "construct/propose_nodes.h"

static ebpo_status no_memory(ebpo_error *error)
{
    return ebpo_fail(error, EBPO_E_MEMORY, "out of memory while choosing planes");
}

/* The top's gray nodes, deepest first; those of one level side by side. */
typedef struct top_node {
    uint32_t node;
    ebpo_cell cell;
    int32_t winding;
    ebpo_handover given, out;
    uint64_t parent; /* place in the list */
    unsigned octant;
    uint32_t codes[EBPO_PLANES_STORED];
    int count;
} top_node;

typedef struct top_list {
    ebpo_builder *b;
    top_node *nodes;
    uint64_t count, capacity, base;
} top_list;

/* Breadth first, so that a level's nodes are one stretch; windings come down on the way. */
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
        ebpo_child_windings(b, &b->top, node->child, offset);
        for (uint32_t o = 0; o < 8; o++) {
            const ebpo_build_node *child = &b->top.nodes[node->child + o];
            int32_t winding = t->nodes[i].winding + offset[o];
            if (child->type == EBPO_LEAF)
                b->sub[child->detail].winding = winding;
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
        ebpo_branch alone = b->top; /* with proposals of its own: neighbours are at work */
        uint32_t detail = node->detail;
        alone.proposals = NULL;
        bool good = ebpo_proposals_make(&alone);
        for (unsigned o = 0; o < 8 && good; o++) {
            const ebpo_build_node *child = &b->top.nodes[node->child + o];
            if (child->type != EBPO_LEAF)
                continue;
            ebpo_handover *root = &b->sub[child->detail].proposals->root;
            good = ebpo_handover_gather(&n->given, root, o);
            ebpo_handover_free(root);
        }
        good =
            good && ebpo_propose_alone(b, &alone, detail, n->cell, n->winding, &n->given, &n->out);
        if (good) {
            const uint32_t *codes = ebpo_proposed(&alone, detail, &n->count);
            memcpy(n->codes, codes, (size_t)n->count * sizeof *codes);
        } else
            status = no_memory(error);
        ebpo_handover_free(&n->given);
        ebpo_proposals_free(alone.proposals);
    }
    return status;
}

static bool note_top(top_list *t)
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

ebpo_status ebpo_build_propose(ebpo_builder *b, ebpo_error *error)
{
    if (!ebpo_selection_describe(b->options->select)->from_leaves ||
        !(b->options->parts & (EBPO_PART_PLANES | EBPO_PART_LEAF_PLANES)))
        return EBPO_OK;
    top_list t = { .b = b };
    ebpo_status status = list_top(&t) ? EBPO_OK : no_memory(error);
    ebpo_pass pass = { &b->options->progress, 0, b->sub_count, b->sub_count + t.count };
    ebpo_progress progress = ebpo_pass_progress(&pass);
    if (status == EBPO_OK)
        status = ebpo_parallel_for(b->threads, b->workspace, b->sub_count, 1, ebpo_propose_pieces,
                                   b, &progress, "choosing planes", error);
    atomic_store(&b->leaf_count, 0); /* the pieces are made once more */
    atomic_store(&b->entry_count, 0);
    if (status == EBPO_OK)
        status = propose_top(&t, &pass, error);
    if (status == EBPO_OK && !note_top(&t))
        status = no_memory(error);
    for (uint64_t i = 0; i < t.count; i++) {
        ebpo_handover_free(&t.nodes[i].given);
        ebpo_handover_free(&t.nodes[i].out);
    }
    free(t.nodes);
    return status;
}
