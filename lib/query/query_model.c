/* Makes models and contexts: opens a file for queries, loads subtrees, and checks the arguments of
 * all queries.
 *
 * A model is completely in memory if its budget allows that. If not, it has the top of the tree
 * (levels 0 to the cut level) and a cache of the subtrees below; budget.c makes this plan. Any
 * thread may use a model. A context has the buffers of queries and a pinned subtree, which stays in
 * memory. A context is used by one thread at a time. */
#include "core/strict_fp.h"

#include <inttypes.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "core/alloc.h"
#include "core/os.h"
#include "core/error.h"
#include "core/fp_env.h"
#include "core/hash.h"
#include "query/holes.h"
#include "query/model_parts.h"
#include "query/query_model.h"

/* --- common checks of all queries --- */

ebpo_status ebpo_check_query_level(int level, ebpo_error *error)
{
    if (level < -1 || level >= EBPO_LEVELS_MAX)
        return ebpo_fail(error, EBPO_E_ARGUMENT,
                         "level %d is out of range; give 0 to %d, or -1 "
                         "for all",
                         level, EBPO_LEVELS_MAX - 1);
    return EBPO_OK;
}

ebpo_status ebpo_fail_value(ebpo_error *error)
{
    return ebpo_fail(error, EBPO_E_ARGUMENT, "invalid enum value in the query options");
}

ebpo_status ebpo_check_points(const double *points, uint64_t count, ebpo_error *error)
{
    for (uint64_t i = 0; i < 3 * count; i++)
        if (!isfinite(points[i]))
            return ebpo_fail(error, EBPO_E_ARGUMENT,
                             "point %" PRIu64 " has a coordinate that is not a finite number",
                             i / 3);
    return EBPO_OK;
}

ebpo_status ebpo_check_mesh(const ebpo_model *model, ebpo_error *error)
{
    if (model->info->parts & EBPO_PART_MESH)
        return EBPO_OK;
    return ebpo_fail_file(error, EBPO_E_ABSENT, model->file->in.shown,
                          "the file was written without its mesh, which exact results need; query "
                          "with a level (--max-level), or use a file with its mesh (`ebpo subset`, "
                          "`ebpo fetch` or `ebpo convert` with --profile collision or full)");
}

ebpo_status ebpo_check_solid(const ebpo_model *model, ebpo_error *error)
{
    if (model->info->solid)
        return EBPO_OK;
    return ebpo_fail(
        error, EBPO_E_NOT_SOLID,
        "the model is a surface: %s; run 'ebpo check' on its source to see the repairs "
        "that make a solid, and 'ebpo convert --repair' to apply them",
        model->holes ? "its inside has no boundary faces in its holes, which this "
                       "function needs (points, distances, measures and maps do not)"
                     : "it has no inside");
}

/* --- envelopes that a context keeps --- */

/* Maximum bytes that ebpo_holes_mark adds to the top of a surface's tree. */
enum { TOP_MARKS = 1 << 17 };

/* Maximum number of kept envelopes; most of them take 1 to 3 KB. */
enum { SLOTS = 256 };

/* The head of a kept envelope. After the head follow the used parts of the arrays of ebpo_polytope,
 * in the order vertex, tag, first, corner. */
typedef struct kept {
    ebpo_cell cell;
    int vertices, faces, corners;
    double vertex[][3];
} kept;

struct ebpo_kept_envelopes {
    kept *slot[SLOTS];
};

static unsigned slot_of(ebpo_cell cell)
{
    uint64_t key[3] = { (uint64_t)cell.level << 32 | cell.at[0], cell.at[1], cell.at[2] };
    return (unsigned)(ebpo_hash_three(key) % SLOTS);
}

static bool same_cell(ebpo_cell a, ebpo_cell b)
{
    return a.level == b.level && a.at[0] == b.at[0] && a.at[1] == b.at[1] && a.at[2] == b.at[2];
}

bool ebpo_kept_envelopes_get(const ebpo_kept_envelopes *k, ebpo_cell cell, ebpo_polytope *out)
{
    const kept *from = k ? k->slot[slot_of(cell)] : NULL;
    if (!from || !same_cell(from->cell, cell))
        return false;
    const int32_t *tag = (const void *)(from->vertex + from->vertices);
    const uint16_t *first = (const void *)(tag + from->faces);
    out->vertex_count = from->vertices;
    out->face_count = from->faces;
    out->corner_count = from->corners;
    memcpy(out->vertex, from->vertex, (size_t)from->vertices * sizeof out->vertex[0]);
    memcpy(out->tag, tag, (size_t)from->faces * sizeof *tag);
    memcpy(out->first, first, (size_t)(from->faces + 1) * sizeof *first);
    memcpy(out->corner, first + from->faces + 1, (size_t)from->corners * sizeof *first);
    return true;
}

/* Returns a copy of an envelope; NULL when out of memory. */
static kept *copy_of(ebpo_cell cell, const ebpo_polytope *p)
{
    size_t vertices = (size_t)p->vertex_count, faces = (size_t)p->face_count,
           corners = (size_t)p->corner_count;
    kept *to =
        ebpo_alloc(1, sizeof *to + vertices * sizeof to->vertex[0] + faces * sizeof p->tag[0] +
                          (faces + 1 + corners) * sizeof p->first[0]);
    if (!to)
        return NULL;
    to->cell = cell;
    to->vertices = p->vertex_count;
    to->faces = p->face_count;
    to->corners = p->corner_count;
    int32_t *tag = (void *)(to->vertex + vertices);
    uint16_t *first = (void *)(tag + faces);
    memcpy(to->vertex, p->vertex, vertices * sizeof to->vertex[0]);
    memcpy(tag, p->tag, faces * sizeof *tag);
    memcpy(first, p->first, (faces + 1) * sizeof *first);
    memcpy(first + faces + 1, p->corner, corners * sizeof *first);
    return to;
}

void ebpo_kept_envelopes_put(ebpo_kept_envelopes **k, ebpo_cell cell, const ebpo_polytope *envelope)
{
    if (!*k)
        *k = ebpo_alloc_zero(1, sizeof **k);
    kept *made = *k ? copy_of(cell, envelope) : NULL;
    if (!made)
        return;
    kept **slot = &(*k)->slot[slot_of(cell)];
    free(*slot);
    *slot = made;
}

static void kept_envelopes_free(ebpo_kept_envelopes *k)
{
    for (int i = 0; k && i < SLOTS; i++)
        free(k->slot[i]);
    free(k);
}

/* --- subtrees for the cache --- */

/* Estimates the bytes of a subtree for the cache: the most bytes while it is loaded (*peak), and
 * the bytes that it keeps (*keep). Sends prefetch hints for all data of the subtree of a remote
 * file, and for the source indices of its faces, which may be in results. A subtree of the file is
 * measured first: its counts are in the table of subtrees, and if the connection fails, no hint
 * tries to read the table again. */
static ebpo_status estimate_subtree(void *user, uint64_t key, uint64_t *peak, uint64_t *keep,
                                    ebpo_error *error)
{
    ebpo_model *m = user;
    ebpo_slice_size size;
    uint32_t below = ebpo_subtree_of_key(key), needs = ebpo_subtree_needs(ebpo_content_of_key(key));
    uint32_t hinted = needs | (m->without_maps ? 0 : EBPO_NEEDS_MAPS);
    const ebpo_node *root = &m->top->below[below];
    bool is_of_file = root->type == EBPO_GRAY && root->cell.level == m->info->subtree_level;
    if (!is_of_file)
        ebpo_top_hint(m->top, m->chunks, &below, 1, hinted, EBPO_LEVELS_MAX);
    ebpo_status status =
        ebpo_slice_measure_nodes(m->chunks, root, needs, EBPO_SLICE_ALL, &size, error);
    if (status != EBPO_OK)
        return status;
    if (is_of_file)
        ebpo_top_hint(m->top, m->chunks, &below, 1, hinted, EBPO_LEVELS_MAX);
    ebpo_accel_estimate_subtree(&size, m->info, keep, peak);
    return EBPO_OK;
}

void ebpo_model_count_leaves(ebpo_model *m, const ebpo_accel *s, int sign)
{
    m->leaves += (uint64_t)sign * s->leaf_count;
    if (!s->kinds)
        return;
    m->leaves_one_cell_face += (uint64_t)sign * s->kinds->one_cell_face;
    for (int k = 0; k < 5; k++)
        m->leaves_of_kind[k] += (uint64_t)sign * s->kinds->of_kind[k];
}

void ebpo_model_count_kind(ebpo_model *m, const ebpo_accel_leaf *leaf)
{
    m->leaves_of_kind[ebpo_leaf_kind_of(leaf)]++;
    m->leaves_one_cell_face +=
        ebpo_leaf_kind_of(leaf) == EBPO_LEAF_GENERAL && leaf->cell_face != EBPO_NO_CELL_FACE;
}

/* Returns the deepest level of the cells into which ebpo_holes_mark splits nodes near the border.
 * At this level, the undecided cells at all edges of the border together fill a few percent of the
 * root cell. */
static int split_level(const ebpo_model *m)
{
    enum { CELLS_FOR_EDGE = 64, LEAST = 7 };
    int level = 0;
    while (level < m->locator.level &&
           (level < LEAST || UINT64_C(1) << 3 * level < CELLS_FOR_EDGE * m->info->border_points))
        level++;
    return level;
}

/* Marks the nodes of a surface near its border (ebpo_holes_mark), with at most `bytes` of
 * additional data. */
static ebpo_status mark_accel(const ebpo_model *m, ebpo_accel *s, uint64_t bytes, ebpo_error *error)
{
    if (!m->holes)
        return EBPO_OK;
    ebpo_marked_table marked = {
        &s->box, s->root.cell, &s->nodes, s, m->kernels.inside->cell_faces, split_level(m), bytes
    };
    ebpo_status status = ebpo_holes_mark(m->holes, &marked, error);
    s->bytes += ebpo_holes_marked_bytes(&s->nodes);
    return status;
}

/* Returns the bytes for the marks of a subtree that may take `quota` bytes in all. */
static uint64_t space_for_marks(const ebpo_model *m, const ebpo_accel *s, uint64_t quota)
{
    uint64_t unused = quota > s->bytes ? quota - s->bytes : 0,
             marks = ebpo_holes_marks_max(m->info);
    return unused < marks ? unused : marks;
}

/* Loads a subtree for the cache, within `quota` bytes. *bytes: bytes that the subtree keeps or,
 * after EBPO_E_LIMIT, bytes that it needs. */
static ebpo_status load_subtree(void *user, uint64_t key, uint64_t quota, void **item,
                                uint64_t *bytes, ebpo_error *error)
{
    ebpo_model *m = user;
    uint32_t below = ebpo_subtree_of_key(key);
    ebpo_accel_content content = ebpo_content_of_key(key);
    ebpo_quota space = { .most = quota };
    ebpo_slice slice;
    ebpo_accel *subtree = NULL;
    ebpo_status status = ebpo_slice_read_within(&slice, m->chunks, &m->top->below[below],
                                                ebpo_subtree_needs(content), &space, error);
    if (status == EBPO_OK)
        status = ebpo_accel_make_within(&subtree, &slice, m->info, &space, content, 1, error);
    if (status == EBPO_OK && content >= EBPO_ACCEL_NODES)
        status = mark_accel(m, subtree, space_for_marks(m, subtree, quota), error);
    if (status == EBPO_OK) {
        ebpo_model_count_leaves(m, subtree, 1);
        ebpo_skeletons_keep(m->skeletons, below, subtree);
    } else {
        ebpo_accel_free(subtree);
        subtree = NULL;
    }
    *item = subtree;
    *bytes = status == EBPO_OK ? subtree->bytes : space.needed;
    return status;
}

static void release_subtree(void *user, void *item)
{
    if (item)
        ebpo_model_count_leaves(user, item, -1);
    ebpo_accel_free(item);
}

/* --- opening --- */

ebpo_status ebpo_model_has_capacity(const ebpo_model *m, const ebpo_node *leaf, ebpo_error *error)
{
    ebpo_slice_size size;
    uint64_t keep, peak;
    ebpo_status status =
        m->options.memory ? ebpo_slice_measure(m->chunks, leaf, &size, error) : EBPO_OK;
    if (status != EBPO_OK || !m->options.memory)
        return status;
    ebpo_accel_estimate(&size, m->info, &keep, &peak);
    uint64_t taken = m->top->bytes + ebpo_bytes_besides_subtrees(&m->options, m->options.memory);
    if (taken + peak <= m->options.memory)
        return EBPO_OK;
    return ebpo_fail(error, EBPO_E_LIMIT,
                     "the memory budget of %" PRIu64
                     " bytes is too small for a leaf of level %d, which takes up to %" PRIu64
                     " bytes in addition to the %" PRIu64 " in use; give a larger budget",
                     m->options.memory, leaf->cell.level, peak, taken);
}

/* Loads the whole model. */
static ebpo_status open_whole(ebpo_model *m, ebpo_error *error)
{
    ebpo_slice slice;
    ebpo_quota space = { .most = m->options.memory };
    ebpo_status status = ebpo_slice_read_all(&slice, m->file, m->options.threads, error);
    if (status == EBPO_OK)
        status = ebpo_accel_make_within(&m->whole, &slice, m->info, space.most ? &space : NULL,
                                        EBPO_ACCEL_PLANES, m->options.threads, error);
    if (m->whole)
        ebpo_model_count_leaves(m, m->whole, 1);
    return status == EBPO_OK ? mark_accel(m, m->whole, ebpo_holes_marks_max(m->info), error)
                             : status;
}

/* Makes the caches of a model with a separate budget (options.memory; 0: no limit). */
static ebpo_status make_own_caches(ebpo_model *m, const ebpo_cache_source *source,
                                   ebpo_error *error)
{
    uint64_t budget = m->options.memory, chunks = budget ? ebpo_chunk_budget(budget) : 0;
    uint64_t taken = m->top->bytes + ebpo_bytes_besides_subtrees(&m->options, budget);
    if (budget && taken + EBPO_SUBTREES_LEAST > budget)
        return ebpo_fail(error, EBPO_E_LIMIT,
                         "levels 0 to %d and a cache take more than the budget of %" PRIu64
                         " bytes; give at least %" PRIu64 ", or a lower cut level",
                         m->top->cut_level, budget, taken + EBPO_SUBTREES_LEAST);
    ebpo_status status = ebpo_chunks_make(&m->chunks, m->file, chunks, error);
    if (status != EBPO_OK)
        return status;
    return ebpo_cache_make(&m->cache, source, "subtree",
                           budget ? budget - m->top->bytes - chunks : 0, error);
}

/* Makes the caches of a model whose budget several models share. */
static ebpo_status make_shared_caches(ebpo_model *m, const ebpo_cache_source *source,
                                      ebpo_error *error)
{
    ebpo_budget *shared = m->options.budget;
    ebpo_status status = ebpo_cache_pool_take(ebpo_budget_subtrees(shared), m->top->bytes, error);
    if (status != EBPO_OK)
        return status;
    m->shared_taken = m->top->bytes;
    status = ebpo_chunks_make_in(&m->chunks, m->file, ebpo_budget_chunks(shared), error);
    if (status != EBPO_OK)
        return status;
    return ebpo_cache_make_in(&m->cache, source, "subtree", ebpo_budget_subtrees(shared), error);
}

/* Returns the quota in bytes for the model's skeletons. */
static uint64_t skeleton_capacity(ebpo_model *m)
{
    uint64_t budget = m->options.memory;
    if (!budget || m->options.loading != EBPO_LOAD_CACHE)
        return budget ? 0 : UINT64_MAX;
    uint64_t space =
        ebpo_skeletons_capacity(m->top->below_count, ebpo_skeleton_budget(&m->options, budget));
    if (!m->options.budget)
        return space;
    m->shared_skeletons = ebpo_budget_take_skeletons(m->options.budget, space);
    return ebpo_skeletons_capacity(m->top->below_count, m->shared_skeletons);
}

/* Loads the top of the tree, and makes the caches and skeletons. */
static ebpo_status open_top(ebpo_model *m, int cut_level, ebpo_error *error)
{
    ebpo_cache_source source = { m, estimate_subtree, load_subtree, release_subtree };
    ebpo_status status = ebpo_top_read(&m->top, m->file, cut_level, m->options.threads, error);
    if (status == EBPO_OK && m->holes) {
        ebpo_box box = ebpo_root_box(m->info);
        m->top->bytes += ebpo_holes_bytes(m->holes);
        ebpo_marked_table marked = { &box, { 0, { 0, 0, 0 } }, &m->top->nodes, NULL,
                                     NULL, split_level(m),     TOP_MARKS };
        status = ebpo_holes_mark(m->holes, &marked, error);
        m->top->bytes += ebpo_holes_marked_bytes(&m->top->nodes);
    }
    if (status == EBPO_OK)
        status = m->options.budget ? make_shared_caches(m, &source, error)
                                   : make_own_caches(m, &source, error);
    uint64_t skeletons = status == EBPO_OK ? skeleton_capacity(m) : 0;
    if (status == EBPO_OK && m->options.loading == EBPO_LOAD_CACHE && skeletons) {
        m->skeletons = ebpo_skeletons_make(m->top->below_count, skeletons, m->cache);
        /* If other models have used up a shared budget, there are no skeletons. */
        if (!m->skeletons && m->options.budget)
            ebpo_cache_set_aside(m->cache, 0);
        else if (!m->skeletons)
            return ebpo_fail_memory(error, m->top->below_count * sizeof(void *));
    }
    return status;
}

/* Reads the border of a surface, if the file has the border. Fails if the budget is too small. */
static ebpo_status open_border(ebpo_model *m, ebpo_error *error)
{
    ebpo_model_plan plan;
    if (!(m->info->parts & EBPO_PART_BORDER))
        return EBPO_OK;
    ebpo_status status = ebpo_plan_model(m->file, &m->options, m->default_memory, &plan, error);
    return status == EBPO_OK ? ebpo_holes_read(&m->holes, m->file, m->options.threshold, error)
                             : status;
}

/* Loads the whole model under a shared budget. Returns EBPO_E_LIMIT if the budget is too small. */
static ebpo_status open_shared_whole(ebpo_model *m, uint64_t peak, ebpo_error *error)
{
    ebpo_budget *shared = m->options.budget;
    if (!ebpo_budget_take_whole(shared, peak))
        return EBPO_E_LIMIT;
    m->options.memory = peak;
    ebpo_status status = open_whole(m, error);
    uint64_t bytes =
        status == EBPO_OK ? ebpo_accel_bytes(m->whole) + ebpo_holes_bytes(m->holes) : 0;
    ebpo_budget_give_back_whole(shared, peak - bytes);
    m->shared_taken = bytes;
    return status;
}

/* Loads the whole model or its top, according to the plan. */
static ebpo_status open_planned(ebpo_model *m, ebpo_error *error)
{
    ebpo_model_plan plan;
    ebpo_status status = ebpo_plan_model(m->file, &m->options, m->default_memory, &plan, error);
    if (status == EBPO_OK && plan.resident) {
        uint64_t memory = m->options.memory;
        status = m->options.budget ? open_shared_whole(m, plan.whole, error) : open_whole(m, error);
        m->options.memory = memory;
        /* After EBPO_E_LIMIT, the model is loaded in parts, because the whole model takes more
         * memory than ordinary models with the same counts, for which the plan is made. */
        if (status != EBPO_E_LIMIT || !m->options.memory)
            return status;
        status = ebpo_plan_parts(m->file, &m->options, &plan, error);
    }
    return status == EBPO_OK ? open_top(m, plan.cut_level, error) : status;
}

static ebpo_status check_threshold(const ebpo_model_options *o, ebpo_error *error)
{
    if (o->threshold >= 0x1p-10 && o->threshold <= 1 - 0x1p-10)
        return EBPO_OK;
    return ebpo_fail(error, EBPO_E_ARGUMENT,
                     "threshold %g of the winding number is out of range; give a number from "
                     "1/1024 to 1023/1024",
                     o->threshold);
}

ebpo_status ebpo_model_new(const ebpo_file *file, const ebpo_model_options *options,
                           ebpo_model **out, ebpo_error *error)
{
    EBPO_DEFAULT_FP;
    ebpo_model_options wanted = EBPO_MODEL_OPTIONS_INIT;
    *out = NULL;
    ebpo_status status = EBPO_TAKE(ebpo_model_options, &wanted, options, error);
    if (status == EBPO_OK)
        status = check_threshold(&wanted, error);
    if (status != EBPO_OK)
        return status;
    ebpo_model *m = ebpo_alloc_zero(1, sizeof *m);
    if (!m)
        return ebpo_fail_memory(error, sizeof *m);
    uint64_t begin = ebpo_clock();
    m->file = file;
    m->info = ebpo_file_info(file);
    ebpo_box box = ebpo_root_box(m->info);
    m->locator = ebpo_locator_make(&box, m->info->level_count - 1);
    m->options = wanted;
    m->kernels = ebpo_query_kernels_best();
    m->default_memory = ebpo_default_memory(file, &m->options);
    status = open_border(m, error);
    if (status == EBPO_OK)
        status = open_planned(m, error);
    if (status != EBPO_OK) {
        ebpo_model_free(m);
        return status;
    }
    m->results_inside = m->whole && (m->info->solid || m->holes) && m->info->parts & EBPO_PART_MESH;
    m->open_seconds = (double)(ebpo_clock() - begin) * 1e-9;
    *out = m;
    return EBPO_OK;
}

static void give_back_shared(ebpo_model *m)
{
    ebpo_budget *shared = m->options.budget;
    if (!shared)
        return;
    ebpo_budget_give_back_skeletons(shared, m->shared_skeletons);
    if (m->whole)
        ebpo_budget_give_back_whole(shared, m->shared_taken);
    else
        ebpo_cache_pool_give_back(ebpo_budget_subtrees(shared), m->shared_taken);
}

void ebpo_model_free(ebpo_model *m)
{
    if (!m)
        return;
    ebpo_cache_free(m->cache);
    ebpo_skeletons_free(m->skeletons);
    ebpo_chunks_free(m->chunks);
    ebpo_top_free(m->top);
    ebpo_top_free(m->deep);
    give_back_shared(m);
    ebpo_accel_free(m->whole);
    ebpo_holes_free(m->holes);
    free(m);
}

static void gather_stats(const ebpo_model *m, ebpo_model_stats *out)
{
    out->resident = m->whole != NULL;
    out->cut_level = m->top ? m->top->cut_level : 0;
    out->budget = m->options.budget ? ebpo_budget_bytes(m->options.budget) : m->options.memory;
    out->open_seconds = m->open_seconds;
    ebpo_file_stats file = EBPO_FILE_STATS_INIT;
    ebpo_file_get_stats(m->file, &file);
    out->bytes_read = file.bytes_read;
    out->reads = file.reads;
    out->leaves = m->leaves;
    out->leaves_one_cell_face = m->leaves_one_cell_face;
    for (int k = 0; k < 5; k++)
        out->leaves_of_kind[k] = m->leaves_of_kind[k];
    out->ties = m->holes ? m->holes->ties : 0;
    if (m->whole) {
        out->memory = out->memory_peak = ebpo_accel_bytes(m->whole) + ebpo_holes_bytes(m->holes);
        return;
    }
    ebpo_cache_stats subtrees, chunks;
    ebpo_cache_get_stats(m->cache, &subtrees);
    ebpo_chunks_get_stats(m->chunks, &chunks);
    out->memory = m->top->bytes + subtrees.bytes + chunks.bytes;
    out->memory_peak = m->top->bytes + subtrees.peak_bytes + chunks.peak_bytes;
    out->hits = subtrees.hits;
    out->loads = subtrees.loads;
    out->prefetched = subtrees.prefetched;
    out->evicted = subtrees.evicted;
    out->load_seconds = subtrees.load_seconds;
    out->distances = m->distances;
    out->distance_subtrees = m->distance_subtrees;
    out->distance_loads = m->distance_loads;
    out->skeleton_bytes = ebpo_skeletons_bytes(m->skeletons);
}

ebpo_status ebpo_model_get_stats(const ebpo_model *m, ebpo_model_stats *out)
{
    ebpo_model_stats stats = EBPO_MODEL_STATS_INIT;
    gather_stats(m, &stats);
    return EBPO_GIVE(ebpo_model_stats, out, &stats);
}

/* --- contexts --- */

ebpo_status ebpo_context_new(ebpo_model *model, ebpo_context **out, ebpo_error *error)
{
    EBPO_DEFAULT_FP;
    *out = ebpo_alloc_zero(1, sizeof **out);
    if (!*out)
        return ebpo_fail_memory(error, sizeof **out);
    (*out)->model = model;
    (*out)->content = EBPO_ACCEL_NODES;
    return EBPO_OK;
}

void ebpo_context_let_go(ebpo_context *c)
{
    if (!c || !c->pinned)
        return;
    ebpo_cache_unpin(c->model->cache, c->pinned_key);
    c->pinned = NULL;
}

void ebpo_context_free(ebpo_context *c)
{
    if (!c)
        return;
    ebpo_context_let_go(c);
    free(c->open);
    free(c->hits);
    free(c->hit_begin);
    free(c->unsorted_hits);
    free(c->queue);
    free(c->marks);
    free(c->envelopes_of);
    free(c->faces);
    kept_envelopes_free(c->envelopes);
    free(c->cutting);
    free(c);
}

/* Called after EBPO_E_LIMIT. If the budget is smaller than the estimate for this subtree, replaces
 * the message by one that gives a sufficient budget. Otherwise keeps it: the limit is another one,
 * or the subtree exceeds its estimate, or other threads use the memory. */
static ebpo_status fail_limit(const ebpo_model *m, uint32_t below, ebpo_error *error)
{
    uint64_t peak, keep, least;
    if (estimate_subtree((ebpo_model *)m, ebpo_subtree_key(below, EBPO_ACCEL_PLANES), &peak, &keep,
                         NULL) != EBPO_OK)
        return EBPO_E_LIMIT;
    least = m->top->bytes + peak;
    while (m->top->bytes + ebpo_bytes_besides_subtrees(&m->options, least) + peak > least)
        least += least / 8 + 1;
    if (least <= m->options.memory)
        return EBPO_E_LIMIT;
    return ebpo_fail(error, EBPO_E_LIMIT,
                     "the memory budget of %" PRIu64
                     " bytes is too small for one subtree below level %d and the memory in use; "
                     "give at least %" PRIu64 ", or a deeper cut level",
                     m->options.memory, m->top->cut_level, least);
}

ebpo_status ebpo_model_read_source_face(const ebpo_model *m, uint64_t file_face, uint64_t *out,
                                        ebpo_error *error)
{
    ebpo_held_chunk view = { .array = ebpo_reader_array(m->file, EBPO_A_FACE_SOURCE, 0) };
    ebpo_status status = ebpo_held_chunk_move(m->chunks, &view, file_face, error);
    if (status == EBPO_OK)
        *out = ((const uint32_t *)(const void *)view.rows)[file_face - view.begin];
    ebpo_held_chunk_release(m->chunks, &view);
    return status;
}

ebpo_status ebpo_context_subtree(ebpo_context *c, uint32_t below, ebpo_accel **out,
                                 ebpo_error *error)
{
    const ebpo_model *m = c->model;
    void *item;
    if (ebpo_context_has_pinned(c, below)) {
        *out = c->pinned;
        return EBPO_OK;
    }
    ebpo_context_let_go(c);
    if (m->options.loading != EBPO_LOAD_CACHE)
        ebpo_cache_clear(m->cache);
    uint64_t key = ebpo_context_key(c, below);
    bool hit = true;
    ebpo_status status = ebpo_cache_get(m->cache, key, &item, &hit, error);
    c->loaded += !hit;
    if (status != EBPO_OK)
        return status == EBPO_E_LIMIT && m->options.memory && !m->options.budget
                   ? fail_limit(m, below, error)
                   : status;
    *out = c->pinned = item;
    c->pinned_key = key;
    return EBPO_OK;
}
