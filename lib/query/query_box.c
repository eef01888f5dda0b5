/* The faces in a box. */
#include "geom/strict_fp.h"

#include <inttypes.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "base/alloc.h"
#include "base/error.h"
#include "base/fp_env.h"
#include "geom/ray_triangle.h"
#include "query/options.h"
#include "query/pruned.h"
#include "query/query_node.h"

/* Number in the file, and the one that is told. */
typedef struct pair {
    uint64_t file_face, source_face;
} pair;

typedef struct gathering {
    ebpo_context *context;
    const double *min, *max;
    pair *list;
    uint64_t count, capacity;
    bool no_memory;
} gathering;

static void try_block(gathering *g, const ebpo_accel *s, uint32_t block)
{
    for (uint32_t lane = 0; lane < EBPO_BLOCK && !g->no_memory; lane++) {
        uint32_t slot = block * EBPO_BLOCK + lane, local = s->slot_face[slot];
        double t[3][3];
        if (local == EBPO_NO_SLOT)
            return;
        ebpo_accel_triangle(s, slot, t);
        if (!ebpo_triangle_meets_box((const double(*)[3])t, g->min, g->max))
            continue;
        g->no_memory = !ebpo_grow(&g->list, &g->capacity, g->count + 1, sizeof *g->list);
        if (!g->no_memory)
            g->list[g->count++] =
                (pair){ ebpo_accel_file_face(s, local), ebpo_accel_source_face(s, local) };
    }
}

static void gather_bound(gathering *g, const ebpo_accel *s, const double low[3],
                         const double high[3], uint32_t child)
{
    if (child & EBPO_IS_BLOCK) {
        try_block(g, s, child & ~EBPO_IS_BLOCK);
        return;
    }
    const ebpo_bound *b = &s->bound[child];
    for (int lane = 0; lane < 8; lane++) {
        bool meets = b->child[lane] != EBPO_NO_CHILD;
        for (int k = 0; k < 3; k++)
            meets =
                meets && (double)b->low[k][lane] <= high[k] && (double)b->high[k][lane] >= low[k];
        if (meets)
            gather_bound(g, s, low, high, b->child[lane]);
    }
}

static void gather_subtree(gathering *g, const ebpo_accel *s)
{
    double low[3], high[3];
    if (s->bound_count == 0)
        return;
    for (int k = 0; k < 3; k++) {
        low[k] = (g->min[k] - s->centre[k]) * s->scale;
        high[k] = (g->max[k] - s->centre[k]) * s->scale;
        low[k] -= (fabs(low[k]) + 2) * 0x1p-48;
        high[k] += (fabs(high[k]) + 2) * 0x1p-48;
    }
    gather_bound(g, s, low, high, s->top);
}

static bool box_matters(void *user, const ebpo_box *box, const ebpo_node *node)
{
    const gathering *g = user;
    return ebpo_cell_meets(box, node->cell, g->min, g->max);
}

static ebpo_status gather_node(gathering *g, const ebpo_box *box, ebpo_node node, ebpo_error *error)
{
    if (ebpo_node_is_uniform(&node) || !box_matters(g, box, &node))
        return EBPO_OK;
    ebpo_status status = EBPO_OK;
    if (ebpo_node_is_below(&node)) {
        status = ebpo_model_enter(g->context, &node, error);
        if (status == EBPO_OK)
            gather_subtree(g, node.subtree);
        return status;
    }
    for (unsigned octant = 0; octant < 8 && status == EBPO_OK; octant++)
        status = gather_node(g, box, ebpo_model_child(g->context->model, &node, octant), error);
    return status;
}

static int compare_pairs(const void *a, const void *b)
{
    const pair *x = a, *y = b;
    return (x->file_face > y->file_face) - (x->file_face < y->file_face);
}

static ebpo_status finish(gathering *g, const uint64_t **faces, uint64_t *count, ebpo_error *error)
{
    ebpo_context *c = g->context;
    if (g->no_memory || !ebpo_grow(&c->faces, &c->face_capacity, g->count, sizeof *c->faces))
        return ebpo_fail_memory(error, g->count * sizeof *g->list);
    if (g->count)
        qsort(g->list, g->count, sizeof *g->list, compare_pairs);
    for (uint64_t i = 0; i < g->count; i++)
        if (i == 0 || g->list[i].file_face != g->list[i - 1].file_face) /* subtrees share faces */
            c->faces[(*count)++] = g->list[i].source_face;
    *faces = c->faces;
    return EBPO_OK;
}

ebpo_status ebpo_faces_in_box(ebpo_context *context, const double min[3], const double max[3],
                              const uint64_t **faces, uint64_t *count, ebpo_error *error)
{
    EBPO_DEFAULT_FP;
    *faces = NULL;
    *count = 0;
    for (int k = 0; k < 3; k++)
        if (!isfinite(min[k]) || !isfinite(max[k]) || !(min[k] <= max[k]))
            return ebpo_fail(error, EBPO_E_ARGUMENT,
                             "a box needs finite corners, the lower one first on each axis");
    gathering g = { .context = context, .min = min, .max = max };
    ebpo_status status = ebpo_check_mesh(context->model, error);
    if (status == EBPO_OK && context->model->whole) {
        gather_subtree(&g, context->model->whole);
    } else if (status == EBPO_OK) {
        ebpo_box box = ebpo_model_box(context->model);
        status = gather_node(&g, &box, ebpo_model_root(context->model), error);
    }
    if (status == EBPO_OK && !g.no_memory)
        status = ebpo_check_pruned(context, box_matters, &g, error);
    if (status == EBPO_OK)
        status = finish(&g, faces, count, error);
    free(g.list);
    return status;
}
