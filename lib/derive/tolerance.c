#include "core/strict_fp.h"

#include "derive/tolerance.h"

#include <float.h>
#include <math.h>
#include <stdlib.h>

#include "core/alloc.h"
#include "core/error.h"
#include "core/parallel.h"
#include "derive/bound.h"

/* a node that takes more is refined: its children's envelopes are smaller and closer */
enum { QUESTIONS = 4096 };

/* The least max_error that was found to be enough, the largest one that was not, and a certain
 * lower bound. A search for a larger max_error asks no more and accepts no more (bound.h), so
 * these tell what it would find; an upper bound from another search would not, as this one might
 * run out of questions just above it. */
typedef struct memory {
    double enough, failed, lo;
} memory;

struct ebpo_tolerance {
    ebpo_model *model;
    ebpo_lod_model tree;
    bool planes;
    unsigned threads;
    ebpo_progress progress;
    memory *gray[EBPO_LEVELS_MAX], *leaf[EBPO_LEVELS_MAX];
    ebpo_bounder *bounders;     /* [threads] */
    ebpo_tolerance_node *nodes; /* of the call at hand */
    double max_error;
};

static memory *new_memory(uint64_t count)
{
    memory *out = ebpo_alloc(count, sizeof *out);
    for (uint64_t i = 0; out && i < count; i++)
        out[i] = (memory){ INFINITY, -1, 0 };
    return out;
}

ebpo_status ebpo_tolerance_open(ebpo_tolerance **out, const ebpo_file *file, bool planes,
                                unsigned threads, ebpo_progress progress, ebpo_error *error)
{
    ebpo_model_options options = EBPO_MODEL_OPTIONS_INIT;
    ebpo_tolerance *n = *out = ebpo_alloc_zero(1, sizeof *n);
    if (!n)
        return ebpo_fail_memory(error, sizeof *n);
    n->planes = planes;
    n->threads = ebpo_thread_count(threads);
    n->progress = progress;
    options.threads = threads;
    options.progress = progress;
    ebpo_status status = ebpo_tree_read_whole(&n->tree, file, threads, error);
    if (status == EBPO_OK)
        status = ebpo_model_new(file, &options, &n->model, error);
    if (status == EBPO_OK && !(n->bounders = ebpo_alloc_zero(n->threads, sizeof *n->bounders)))
        status = ebpo_fail_memory(error, n->threads * sizeof *n->bounders);
    for (unsigned i = 0; i < n->threads && status == EBPO_OK; i++)
        status = ebpo_bounder_make(&n->bounders[i], &n->tree, n->model, error);
    for (int i = 0; i <= n->tree.target && status == EBPO_OK; i++) {
        n->gray[i] = new_memory(n->tree.level[i].gray_count);
        n->leaf[i] = new_memory(n->tree.level[i].leaf_count);
        if (!n->gray[i] || !n->leaf[i])
            status = ebpo_fail_memory(error,
                                      (n->tree.level[i].gray_count + n->tree.level[i].leaf_count) *
                                          sizeof(memory));
    }
    if (status != EBPO_OK) {
        ebpo_tolerance_close(n);
        *out = NULL;
    }
    return status;
}

void ebpo_tolerance_close(ebpo_tolerance *n)
{
    if (!n)
        return;
    for (unsigned i = 0; n->bounders && i < n->threads; i++)
        ebpo_bounder_free(&n->bounders[i]);
    for (int i = 0; i < EBPO_LEVELS_MAX; i++) {
        free(n->gray[i]);
        free(n->leaf[i]);
    }
    free(n->bounders);
    ebpo_model_free(n->model);
    ebpo_lod_model_free(&n->tree);
    free(n);
}

static ebpo_status judge_node(ebpo_tolerance *n, ebpo_bounder *b, ebpo_tolerance_node *node,
                         ebpo_error *error)
{
    ebpo_node own;
    ebpo_reach_bound found;
    ebpo_bound_goal goal = { n->max_error, n->max_error, 0, QUESTIONS };
    node->enough = false;
    if (!node->asked)
        return EBPO_OK;
    if (!ebpo_tree_find(&n->tree, node->cell, &own) ||
        (own.type != EBPO_GRAY && own.type != EBPO_LEAF))
        return ebpo_fail(error, EBPO_E_FORMAT,
                         "level %d: a node is missing in its tree; run ebpo verify",
                         node->cell.level);
    memory *m = own.type == EBPO_GRAY ? &n->gray[node->cell.level][own.rank]
                                      : &n->leaf[node->cell.level][own.rank];
    node->enough = n->max_error >= m->enough;
    if (node->enough || n->max_error <= m->failed || n->max_error < m->lo)
        return EBPO_OK;
    if (n->planes)
        (void)ebpo_tree_bounds(&n->tree, node->cell, own.type == EBPO_GRAY, &own, &b->halves);
    else
        b->halves.count = 0;
    ebpo_status status = ebpo_bound_envelope(b, node->cell, &goal, &found, error);
    if (status != EBPO_OK)
        return status;
    node->enough = found.hi <= n->max_error;
    m->lo = fmax(m->lo, found.lo);
    if (node->enough)
        m->enough = fmin(m->enough, n->max_error);
    else
        m->failed = fmax(m->failed, n->max_error);
    return EBPO_OK;
}

static ebpo_status judge_some(void *context, uint64_t begin, uint64_t end, unsigned worker,
                              ebpo_error *error)
{
    ebpo_tolerance *n = context;
    ebpo_status status = EBPO_OK;
    for (uint64_t i = begin; i < end && status == EBPO_OK; i++)
        status = judge_node(n, &n->bounders[worker], &n->nodes[i], error);
    return status;
}

ebpo_status ebpo_tolerance_judge(ebpo_tolerance *n, ebpo_tolerance_node *nodes, uint64_t count,
                                 double max_error, ebpo_error *error)
{
    n->nodes = nodes;
    n->max_error = max_error;
    return ebpo_parallel_for(n->threads, NULL, count, 8, judge_some, n, &n->progress,
                             "judging envelopes", error);
}

ebpo_status ebpo_tolerance_most(ebpo_tolerance *n, double *out, ebpo_error *error)
{
    ebpo_node own;
    ebpo_reach_bound found = { 0, INFINITY, { 0, 0, 0 }, 0 };
    ebpo_cell root = { 0, { 0, 0, 0 } };
    ebpo_bound_goal goal = { 0, INFINITY, 1.02, QUESTIONS };
    (void)ebpo_tree_bounds(&n->tree, root, true, &own, &n->bounders[0].halves);
    if (own.type == EBPO_LEAF || !n->planes)
        n->bounders[0].halves.count = 0;
    ebpo_status status = ebpo_bound_closely(&n->bounders[0], root, &goal, &found, error);
    /* A search of its own may need a little more; with the root cell's diagonal none is left. */
    ebpo_tolerance_node node = { root, true, false };
    double most = found.hi > 0 ? found.hi : DBL_MIN;
    *out = most;
    for (double more = 0x1p-30; status == EBPO_OK && !node.enough; more *= 2) {
        n->max_error = *out;
        status = judge_node(n, &n->bounders[0], &node, error);
        if (!node.enough)
            *out = most * (1 + more);
    }
    return status;
}
