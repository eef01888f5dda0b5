/* The nodes above the subtrees: their envelopes level by level, so that every subtree knows its
 * parent's. */
#include "construct/construct_top.h"

#include <stdlib.h>
#include <string.h>

#include "core/alloc.h"
#include "core/error.h"
#include "core/parallel.h"
#include "construct/corner_windings.h"
#include "construct/envelopes.h"

typedef struct pending {
    uint32_t node; /* gray, in the top */
    ebpo_cell cell;
    int32_t winding;
    ebpo_polytope *envelope; /* the parent's cut to the cell, then its own */
} pending;

typedef struct wave {
    ebpo_builder *b;
    pending *nodes;
    uint64_t count, capacity;
} wave;

static ebpo_status no_memory(const ebpo_builder *b, ebpo_error *error)
{
    return ebpo_workspace_fail_while(b->workspace, "while computing envelopes", error);
}

static ebpo_status wave_envelopes(void *context, uint64_t begin, uint64_t end, unsigned worker,
                                  ebpo_error *error)
{
    wave *w = context;
    ebpo_builder *b = w->b;
    (void)worker;
    ebpo_envelope_scratch *scratch = NULL;
    ebpo_status status = ebpo_scratch_make(&scratch, error);
    for (uint64_t i = begin; i < end && status == EBPO_OK; i++) {
        pending *p = &w->nodes[i];
        uint32_t detail = b->top.nodes[p->node].detail;
        ebpo_top_envelope *t = &b->top_envelope[detail];
        if (b->options->parts & EBPO_PART_PLANES)
            t->count = ebpo_gray_planes(b, scratch, &b->top, detail, p->cell, p->winding,
                                        p->envelope, t->codes);
        t->volume = ebpo_polytope_volume(p->envelope) * ebpo_cell_volume(&b->box, p->cell.level);
        if (t->count < 0)
            status = no_memory(b, error);
    }
    ebpo_scratch_free(scratch);
    return status;
}

/* The children of a finished node: gray ones wait for the next wave, subtrees get what they need.
 */
static bool hand_down(ebpo_builder *b, const pending *p, wave *next)
{
    const ebpo_build_node *node = &b->top.nodes[p->node];
    int32_t offset[8];
    ebpo_child_windings(b, &b->top, node->child, offset);
    for (uint32_t o = 0; o < 8; o++) {
        const ebpo_build_node *child = &b->top.nodes[node->child + o];
        if (child->type == EBPO_WHITE)
            continue;
        ebpo_polytope *envelope = ebpo_array_alloc(b->workspace, 1, sizeof *envelope);
        if (!envelope)
            return false;
        ebpo_polytope_child(p->envelope, o, envelope);
        if (child->type == EBPO_LEAF) {
            b->sub[child->detail].above = envelope;
            b->sub[child->detail].winding = p->winding + offset[o];
            continue;
        }
        if (!ebpo_grow(&next->nodes, &next->capacity, next->count + 1, sizeof *next->nodes)) {
            ebpo_array_free(b->workspace, envelope);
            return false;
        }
        next->nodes[next->count++] = (pending){ node->child + o, ebpo_cell_child(p->cell, o),
                                                p->winding + offset[o], envelope };
    }
    return true;
}

static void wave_free(wave *w)
{
    for (uint64_t i = 0; i < w->count; i++)
        ebpo_array_free(w->b->workspace, w->nodes[i].envelope);
    free(w->nodes);
    *w = (wave){ .b = w->b };
}

static ebpo_status start(ebpo_builder *b, wave *w, ebpo_error *error)
{
    ebpo_polytope *cube = ebpo_array_alloc(b->workspace, 1, sizeof *cube);
    if (!cube)
        return no_memory(b, error);
    ebpo_polytope_cube(cube);
    if (b->top.nodes[0].type == EBPO_LEAF) { /* a small model is one subtree */
        b->sub[0].above = cube;
        return EBPO_OK;
    }
    if (!ebpo_grow(&w->nodes, &w->capacity, 1, sizeof *w->nodes)) {
        ebpo_array_free(b->workspace, cube);
        return no_memory(b, error);
    }
    w->nodes[w->count++] = (pending){ 0, b->top.cell, 0, cube };
    return EBPO_OK;
}

ebpo_status ebpo_build_top(ebpo_builder *b, ebpo_error *error)
{
    b->top_envelope = ebpo_alloc_zero(b->top.detail_count + 1, sizeof *b->top_envelope);
    if (!b->top_envelope)
        return no_memory(b, error);
    wave now = { .b = b }, next = { .b = b };
    ebpo_status status = start(b, &now, error);
    ebpo_pass pass = { &b->options->progress, 0, 0, b->top.detail_count };
    ebpo_progress progress = ebpo_pass_progress(&pass);
    while (status == EBPO_OK && now.count) {
        pass.begin = pass.end;
        pass.end += now.count;
        status = ebpo_parallel_for(b->threads, NULL, now.count, 1, wave_envelopes, &now, &progress,
                                   "top envelopes", error);
        for (uint64_t i = 0; i < now.count && status == EBPO_OK; i++)
            if (!hand_down(b, &now.nodes[i], &next))
                status = no_memory(b, error);
        wave_free(&now);
        now = next;
        next = (wave){ .b = b };
    }
    wave_free(&now);
    wave_free(&next);
    return status;
}
