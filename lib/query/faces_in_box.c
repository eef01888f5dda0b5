/* Finds the faces that intersect a box: their indices, or their triangles in batches.
 *
 * The walk visits the accels (acceleration structures of subtrees, accel.h) whose cells intersect
 * the box, depth first. In an accel, it skips the boxes of the bounding hierarchy that are
 * certainly outside the query's box, and tests the remaining triangles exactly. In remote files the
 * walk sends prefetch hints for the subtrees that it will enter. A face that several subtrees list
 * is returned once. In a subset, the query fails if a pruned node (whose children are not in the
 * file) intersects the box. */
#include "core/strict_fp.h"

#include <math.h>
#include <stdlib.h>

#include "core/alloc.h"
#include "core/simd.h"
#include "core/error.h"
#include "core/fp_env.h"
#include "geometry/ray.h"
#include "query/load_ahead.h"
#include "query/query_model.h"
#include "query/query_node.h"

typedef struct box_walk box_walk;
struct box_walk {
    ebpo_context *context;
    const double *min, *max; /* [3] corners of the query's box */
    /* [count] slots of the current accel's faces that intersect the box; sorted when `take` is
     * called */
    uint32_t *slot;
    uint64_t count, capacity;
    ebpo_node subtree_root; /* of the current subtree; not set if the accel is the whole tree */
    bool no_memory;
    bool enough; /* ends the walk; set by `take` */
    /* [ahead_count] for a remote file: the subtrees that the walk will enter, in order */
    uint32_t *ahead;
    uint64_t ahead_count, ahead_capacity;
    uint64_t entered; /* number of subtrees entered so far */
    /* called for each accel that the box intersects, depth first */
    ebpo_status (*take)(box_walk *walk, const ebpo_accel *s, ebpo_error *error);
};

/* Returns EBPO_E_ARGUMENT for an invalid box. */
static ebpo_status check_box(const double min[3], const double max[3], ebpo_error *error)
{
    for (int k = 0; k < 3; k++)
        if (!isfinite(min[k]) || !isfinite(max[k]) || !(min[k] <= max[k]))
            return ebpo_fail(error, EBPO_E_ARGUMENT,
                             "a box needs two finite corners, and the first corner must not be "
                             "above the second one on any axis");
    return EBPO_OK;
}

/* --- in one accel --- */

/* Adds the slots of those faces of a block that intersect the box. */
static void try_block(box_walk *w, const ebpo_accel *s, uint32_t block)
{
    for (uint32_t lane = 0; lane < EBPO_BLOCK && !w->no_memory; lane++) {
        uint32_t slot = block * EBPO_BLOCK + lane;
        double t[3][3];
        if (ebpo_accel_slot_face(s, slot) == EBPO_NO_SLOT)
            return;
        ebpo_accel_triangle(s, slot, t);
        if (!ebpo_triangle_intersects_box((const double(*)[3])t, w->min, w->max))
            continue;
        w->no_memory = !ebpo_grow(&w->slot, &w->capacity, w->count + 1, sizeof *w->slot);
        if (!w->no_memory)
            w->slot[w->count++] = slot;
    }
}

/* Adds the slots of the faces that intersect the box and are below `child`, a node of the hierarchy
 * or a block. low, high: the query's box in the subtree's frame. No slack is needed, because the
 * hierarchy's boxes were enlarged by more than the rounding errors here. */
static void gather_child(box_walk *w, const ebpo_accel *s, const float low[3], const float high[3],
                         uint32_t child)
{
    if (child & EBPO_IS_BLOCK) {
        try_block(w, s, child & ~EBPO_IS_BLOCK);
        return;
    }
    const ebpo_bound *b = &s->bound[child];
    f8 apart = f8_all(0);
    for (int k = 0; k < 3; k++) {
        f8 step = f8_all(b->step[k]), origin = f8_all(b->origin[k]);
        f8 from = f8_add(origin, f8_mul(f8_from_bytes(b->low[k]), step)),
           to = f8_add(origin, f8_mul(f8_from_bytes(b->high[k]), step));
        apart = f8_or(apart, f8_or(f8_less(f8_all(high[k]), from), f8_less(to, f8_all(low[k]))));
    }
    for (unsigned lanes = ~f8_bits(apart) & ((1u << b->count) - 1); lanes; lanes &= lanes - 1)
        gather_child(w, s, low, high, b->child[__builtin_ctz(lanes)]);
}

static int compare_slots(const void *a, const void *b)
{
    const uint32_t *x = a, *y = b;
    return (*x > *y) - (*x < *y);
}

/* Gathers the slots of one accel and passes them to w->take. Blocks are numbered in the order of
 * their faces, so sorted slots are in the order of the file. */
static ebpo_status gather_accel(box_walk *w, const ebpo_accel *s, ebpo_error *error)
{
    float low[3], high[3];
    w->count = 0;
    if (s->bound_count == 0)
        return EBPO_OK;
    for (int k = 0; k < 3; k++) {
        low[k] = (float)((w->min[k] - s->centre[k]) * s->scale);
        high[k] = (float)((w->max[k] - s->centre[k]) * s->scale);
    }
    gather_child(w, s, low, high, s->root_bound);
    if (w->no_memory)
        return ebpo_fail_memory(error, (w->count + 1) * sizeof *w->slot);
    if (w->count)
        qsort(w->slot, w->count, sizeof *w->slot, compare_slots);
    return w->take(w, s, error);
}

/* --- in all accels --- */

/* Returns true if the cell of the node intersects the box. */
static bool intersects_box(void *user, const ebpo_box *box, const ebpo_node *node)
{
    const box_walk *w = user;
    return ebpo_cell_intersects(box, node->cell, w->min, w->max);
}

/* Lists the subtrees that the walk will enter at or below a node. If there is not enough memory,
 * the list is shorter, and subtrees that are not listed get prefetch hints only when they are read.
 */
static void list_ahead(box_walk *w, const ebpo_box *box, ebpo_node node)
{
    if (ebpo_node_is_uniform(&node) || !intersects_box(w, box, &node) || w->no_memory)
        return;
    if (ebpo_node_is_subtree_root(&node)) {
        w->no_memory =
            !ebpo_grow(&w->ahead, &w->ahead_capacity, w->ahead_count + 1, sizeof *w->ahead);
        if (!w->no_memory)
            w->ahead[w->ahead_count++] = ebpo_entry_value(node.entry);
        return;
    }
    for (unsigned octant = 0; octant < 8; octant++)
        list_ahead(w, box, ebpo_model_child(w->context->model, &node, octant));
}

/* Must be called before a subtree is entered. At every EBPO_HINTED_MAX-th subtree, sends prefetch
 * hints for EBPO_HINTED_MAX subtrees: this subtree and the following subtrees. */
static void send_hints(box_walk *w)
{
    uint64_t at = w->entered++, remaining = at < w->ahead_count ? w->ahead_count - at : 0;
    if (at % EBPO_HINTED_MAX == 0 && remaining)
        ebpo_context_hint(w->context, w->ahead + at,
                          remaining < EBPO_HINTED_MAX ? remaining : EBPO_HINTED_MAX);
}

/* Gathers the slots of all subtrees at or below the node. */
static ebpo_status gather_node(box_walk *w, const ebpo_box *box, ebpo_node node, ebpo_error *error)
{
    if (ebpo_node_is_uniform(&node) || !intersects_box(w, box, &node))
        return EBPO_OK;
    ebpo_status status = EBPO_OK;
    if (ebpo_node_is_subtree_root(&node)) {
        w->subtree_root = node;
        send_hints(w);
        status = ebpo_model_enter(w->context, &node, error);
        return status == EBPO_OK ? gather_accel(w, node.subtree, error) : status;
    }
    for (unsigned octant = 0; octant < 8 && status == EBPO_OK && !w->enough; octant++)
        status = gather_node(w, box, ebpo_model_child(w->context->model, &node, octant), error);
    return status;
}

/* Returns EBPO_E_ABSENT if a pruned node of a subset intersects the box. */
static ebpo_status box_walk_check(box_walk *w, ebpo_error *error)
{
    return ebpo_check_pruned(w->context, intersects_box, w, error);
}

/* Runs the whole walk, and frees the lists of slots and of subtrees. */
static ebpo_status box_walk_run(box_walk *w, ebpo_error *error)
{
    const ebpo_model *m = w->context->model;
    ebpo_box box = ebpo_model_box(m);
    if (!m->whole && m->options.loading == EBPO_LOAD_CACHE && ebpo_input_prefetches(&m->file->in))
        list_ahead(w, &box, ebpo_model_root(m));
    w->no_memory = false;
    ebpo_status status = m->whole ? gather_accel(w, m->whole, error)
                                  : gather_node(w, &box, ebpo_model_root(m), error);
    free(w->slot);
    free(w->ahead);
    w->slot = w->ahead = NULL;
    return status;
}

/* --- each face once --- */

static bool intersects_cell(const ebpo_box *box, const ebpo_node *node, const double triangle[3][3])
{
    double low[3], high[3];
    ebpo_cell_bounds(box, node->cell, low, high);
    return ebpo_triangle_intersects_box(triangle, low, high);
}

/* Finds, depth first below `node`, the first accel whose cell intersects both the query's box and
 * the triangle. Returns false if there is none. *entry: entry of the accel's root (ebpo_node).
 * Several accels can list one face: all accels whose cells intersect the face, and some accels
 * whose cells are only near the face (format-spec, section 7). The query takes a face from this
 * first accel only, so it needs no list of the faces that it has already found. */
static bool find_first(const box_walk *w, const ebpo_box *box, ebpo_node node,
                       const double triangle[3][3], uint32_t *entry)
{
    if (ebpo_node_is_uniform(&node) || !ebpo_cell_intersects(box, node.cell, w->min, w->max) ||
        !intersects_cell(box, &node, triangle))
        return false;
    *entry = node.entry;
    bool found = ebpo_node_is_subtree_root(&node);
    for (unsigned octant = 0; octant < 8 && !ebpo_node_is_subtree_root(&node) && !found; octant++)
        found =
            find_first(w, box, ebpo_model_child(w->context->model, &node, octant), triangle, entry);
    return found;
}

/* Several accels may list a face that intersects the box. Returns true if the current accel is the
 * first one of these (find_first). `owned`: the current accel owns the face. */
static bool box_walk_is_first(const box_walk *w, bool owned, const double triangle[3][3])
{
    const ebpo_model *m = w->context->model;
    ebpo_box box = ebpo_model_box(m);
    uint32_t entry = 0;
    if (m->whole)
        return true;
    /* No earlier accel lists an owned face. So the current accel is the first one if its cell
     * intersects the face. Otherwise, the face is only near the cell. */
    if (owned)
        return intersects_cell(&box, &w->subtree_root, triangle);
    return find_first(w, &box, ebpo_model_root(m), triangle, &entry) &&
           entry == w->subtree_root.entry;
}

/* --- indices of faces --- */

typedef struct gathering {
    box_walk walk;  /* must be the first member */
    uint64_t *list; /* [count] indices in the file */
    uint64_t count, capacity;
} gathering;

/* Appends the indices of the faces that the walk found in an accel (box_walk.take). */
static ebpo_status receive_face_indices(box_walk *walk, const ebpo_accel *s, ebpo_error *error)
{
    gathering *g = (gathering *)walk;
    if (!ebpo_grow(&g->list, &g->capacity, g->count + walk->count, sizeof *g->list))
        return ebpo_fail_memory(error, (g->count + walk->count) * sizeof *g->list);
    for (uint64_t i = 0; i < walk->count; i++)
        g->list[g->count++] = ebpo_accel_file_face(s, ebpo_accel_slot_face(s, walk->slot[i]));
    return EBPO_OK;
}

static int compare_indices(const void *a, const void *b)
{
    uint64_t x = *(const uint64_t *)a, y = *(const uint64_t *)b;
    return (x > y) - (x < y);
}

/* Sorts the found faces, removes repetitions, and stores the source indices in the context. */
static ebpo_status finish_faces(gathering *g, const uint64_t **faces, uint64_t *count,
                                ebpo_error *error)
{
    ebpo_context *c = g->walk.context;
    if (!ebpo_grow(&c->faces, &c->face_capacity, g->count, sizeof *c->faces))
        return ebpo_fail_memory(error, g->count * sizeof *g->list);
    if (g->count)
        qsort(g->list, g->count, sizeof *g->list, compare_indices);
    ebpo_status status = EBPO_OK;
    for (uint64_t i = 0; i < g->count && status == EBPO_OK; i++)
        /* a face that several subtrees list occurs several times in g->list */
        if (i == 0 || g->list[i] != g->list[i - 1])
            status = ebpo_model_source_face(c->model, g->list[i], &c->faces[(*count)++], error);
    *faces = status == EBPO_OK ? c->faces : NULL;
    *count = status == EBPO_OK ? *count : 0;
    return status;
}

ebpo_status ebpo_faces_in_box(ebpo_context *context, const double min[3], const double max[3],
                              const uint64_t **faces, uint64_t *count, ebpo_error *error)
{
    EBPO_DEFAULT_FP;
    *faces = NULL;
    *count = 0;
    gathering g = {
        .walk = { .context = context, .min = min, .max = max, .take = receive_face_indices }
    };
    ebpo_status status = check_box(min, max, error);
    if (status == EBPO_OK)
        status = ebpo_check_mesh(context->model, error);
    if (status == EBPO_OK)
        status = box_walk_run(&g.walk, error);
    if (status == EBPO_OK)
        status = box_walk_check(&g.walk, error);
    if (status == EBPO_OK)
        status = finish_faces(&g, faces, count, error);
    free(g.list);
    return status;
}

/* --- triangles in batches --- */

/* Triangles that are passed to the caller together. */
typedef struct batch {
    double corners[EBPO_TRIANGLES_MAX][3][3];
    uint64_t faces[EBPO_TRIANGLES_MAX], file_faces[EBPO_TRIANGLES_MAX];
} batch;

typedef struct delivery {
    box_walk walk; /* must be the first member */
    batch *batch;
    uint64_t count;             /* triangles in the batch */
    ebpo_triangles_fn function; /* of the caller, called with `user` */
    void *user;
} delivery;

/* Passes the batch to the caller and empties it. */
static void pass_batch(delivery *d)
{
    ebpo_triangles all = { .count = d->count,
                           .corners = (const double(*)[3][3])d->batch->corners,
                           .faces = d->batch->faces,
                           .file_faces = d->batch->file_faces };
    if (d->count && !d->walk.enough)
        d->walk.enough = !d->function(d->user, &all);
    d->count = 0;
}

/* Appends the faces that the walk found in an accel to the batch (box_walk.take), except faces that
 * the query takes from another accel (find_first). */
static ebpo_status receive_triangles(box_walk *walk, const ebpo_accel *s, ebpo_error *error)
{
    delivery *d = (delivery *)walk;
    ebpo_status status = EBPO_OK;
    for (uint64_t i = 0; i < walk->count && !walk->enough && status == EBPO_OK; i++) {
        uint32_t local = ebpo_accel_slot_face(s, walk->slot[i]);
        double(*corners)[3] = d->batch->corners[d->count];
        ebpo_accel_triangle(s, walk->slot[i], corners);
        if (!box_walk_is_first(walk, local >= s->shared_count, (const double(*)[3])corners))
            continue;
        uint64_t file_face = ebpo_accel_file_face(s, local);
        status = ebpo_model_source_face(walk->context->model, file_face, &d->batch->faces[d->count],
                                        error);
        d->batch->file_faces[d->count++] = file_face;
        if (status == EBPO_OK && d->count == EBPO_TRIANGLES_MAX)
            pass_batch(d);
    }
    return status;
}

ebpo_status ebpo_triangles_in_box(ebpo_context *context, const double min[3], const double max[3],
                                  ebpo_triangles_fn function, void *user, ebpo_error *error)
{
    EBPO_DEFAULT_FP;
    delivery d = {
        .walk = { .context = context, .min = min, .max = max, .take = receive_triangles },
        .function = function,
        .user = user
    };
    ebpo_status status = check_box(min, max, error);
    if (status == EBPO_OK)
        status = ebpo_check_mesh(context->model, error);
    /* checked before the first triangle is passed to the caller */
    if (status == EBPO_OK)
        status = box_walk_check(&d.walk, error);
    if (status == EBPO_OK && !(d.batch = ebpo_alloc(1, sizeof *d.batch)))
        status = ebpo_fail_memory(error, sizeof *d.batch);
    if (status == EBPO_OK)
        status = box_walk_run(&d.walk, error);
    if (status == EBPO_OK)
        pass_batch(&d);
    free(d.batch);
    return status;
}
