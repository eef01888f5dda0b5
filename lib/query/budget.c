/* Divides the memory budget of a model.
 *
 * A model is held completely in memory ("whole model") if the budget allows that. If not, the
 * budget is divided between four parts: the top of the tree, a cache of decoded chunks, skeletons,
 * and a cache of subtrees. The top is levels 0 to the cut level (query_top.c). The roots of
 * subtrees are at the cut level. A skeleton has the upper nodes of a subtree's hierarchy over faces
 * (skeleton.c). The cut level is chosen so that subtrees are small enough. The plan uses only the
 * counts in the file header; no chunks are read.
 *
 * Several models may share a budget: the bytes that each model takes permanently are subtracted,
 * and the caches of all models share the remaining bytes. Any thread may use a shared budget. */
#include "core/strict_fp.h"

#include <inttypes.h>
#include <pthread.h>
#include <stdlib.h>

#include "core/alloc.h"
#include "core/error.h"
#include "core/fp_env.h"
#include "format/reader.h"
#include "query/holes.h"
#include "query/accel.h"
#include "query/model_parts.h"

/* Maximum bytes of the cache of decoded chunks, which gets an eighth of the budget up to this
 * maximum. */
enum { CHUNKS_MAX = 128 << 20 };

uint64_t ebpo_chunk_budget(uint64_t budget)
{
    return budget / 8 < EBPO_CHUNKS_LEAST ? EBPO_CHUNKS_LEAST
           : budget / 8 > CHUNKS_MAX      ? CHUNKS_MAX
                                          : budget / 8;
}

/* Returns the maximum bytes of skeletons: a quarter of the bytes above the minimum budget. (With
 * the minimum budget there are no skeletons, so they do not increase the minimum.) Searches over
 * the whole model gain more from skeletons than from a few more subtrees in memory. */
uint64_t ebpo_skeleton_budget(const ebpo_model_options *o, uint64_t budget)
{
    const uint64_t least = EBPO_CHUNKS_LEAST + EBPO_SUBTREES_LEAST;
    return o->loading == EBPO_LOAD_CACHE && budget > least ? (budget - least) / 4 : 0;
}

uint64_t ebpo_bytes_besides_subtrees(const ebpo_model_options *o, uint64_t budget)
{
    return ebpo_chunk_budget(budget) + ebpo_skeleton_budget(o, budget);
}

struct ebpo_budget {
    uint64_t bytes;                     /* of the budget */
    ebpo_cache_pool *subtrees, *chunks; /* for the caches of all models that share the budget */
    pthread_mutex_t lock;               /* protects the following fields */
    uint64_t whole, skeletons; /* bytes still available for whole models and for skeletons */
};

ebpo_status ebpo_budget_new(uint64_t bytes, ebpo_budget **out, ebpo_error *error)
{
    *out = NULL;
    ebpo_model_options default_options = EBPO_MODEL_OPTIONS_INIT;
    uint64_t chunks = ebpo_chunk_budget(bytes), least = EBPO_CHUNKS_LEAST + EBPO_SUBTREES_LEAST;
    if (bytes == 0)
        return ebpo_fail(error, EBPO_E_ARGUMENT, "the budget is 0 bytes; give at least %" PRIu64,
                         least);
    if (bytes < least)
        return ebpo_fail(error, EBPO_E_LIMIT,
                         "a budget of %" PRIu64
                         " bytes is too small for any model; give at least %" PRIu64,
                         bytes, least);
    ebpo_budget *b = ebpo_alloc_zero(1, sizeof *b);
    if (!b)
        return ebpo_fail_memory(error, sizeof *b);
    (void)pthread_mutex_init(&b->lock, NULL);
    b->bytes = bytes;
    b->whole = bytes / 2;
    b->skeletons = ebpo_skeleton_budget(&default_options, bytes);
    ebpo_status status = ebpo_cache_pool_make(&b->subtrees, bytes - chunks, error);
    if (status == EBPO_OK)
        status = ebpo_cache_pool_make(&b->chunks, chunks, error);
    if (status == EBPO_OK)
        *out = b;
    else
        ebpo_budget_free(b);
    return status;
}

void ebpo_budget_free(ebpo_budget *b)
{
    if (!b)
        return;
    ebpo_cache_pool_free(b->subtrees);
    ebpo_cache_pool_free(b->chunks);
    (void)pthread_mutex_destroy(&b->lock);
    free(b);
}

ebpo_status ebpo_budget_get_stats(const ebpo_budget *b, ebpo_budget_stats *out)
{
    ebpo_budget_stats stats = EBPO_BUDGET_STATS_INIT;
    uint64_t now, peak, taken;
    ebpo_cache_pool_get_bytes(b->subtrees, &stats.memory, &stats.memory_peak, &taken);
    ebpo_cache_pool_get_bytes(b->chunks, &now, &peak, &taken);
    stats.budget = b->bytes;
    stats.memory += now;
    stats.memory_peak += peak;
    return EBPO_GIVE(ebpo_budget_stats, out, &stats);
}

ebpo_cache_pool *ebpo_budget_subtrees(const ebpo_budget *b) { return b->subtrees; }

ebpo_cache_pool *ebpo_budget_chunks(const ebpo_budget *b) { return b->chunks; }

uint64_t ebpo_budget_bytes(const ebpo_budget *b) { return b->bytes; }

/* Returns the bytes of the budget that no model has taken permanently. */
static uint64_t budget_left(const ebpo_budget *b)
{
    uint64_t now, peak, taken;
    ebpo_cache_pool_get_bytes(b->subtrees, &now, &peak, &taken);
    return b->bytes - taken;
}

bool ebpo_budget_take_whole(ebpo_budget *b, uint64_t bytes)
{
    (void)pthread_mutex_lock(&b->lock);
    bool fits = bytes <= b->whole;
    b->whole -= fits ? bytes : 0;
    (void)pthread_mutex_unlock(&b->lock);
    if (!fits || ebpo_cache_pool_take(b->subtrees, bytes, NULL) == EBPO_OK)
        return fits;
    (void)pthread_mutex_lock(&b->lock);
    b->whole += bytes;
    (void)pthread_mutex_unlock(&b->lock);
    return false;
}

void ebpo_budget_give_back_whole(ebpo_budget *b, uint64_t bytes)
{
    ebpo_cache_pool_give_back(b->subtrees, bytes);
    (void)pthread_mutex_lock(&b->lock);
    b->whole += bytes;
    (void)pthread_mutex_unlock(&b->lock);
}

uint64_t ebpo_budget_take_skeletons(ebpo_budget *b, uint64_t wanted)
{
    (void)pthread_mutex_lock(&b->lock);
    uint64_t taken = wanted < b->skeletons ? wanted : b->skeletons;
    b->skeletons -= taken;
    (void)pthread_mutex_unlock(&b->lock);
    return taken;
}

void ebpo_budget_give_back_skeletons(ebpo_budget *b, uint64_t bytes)
{
    (void)pthread_mutex_lock(&b->lock);
    b->skeletons += bytes;
    (void)pthread_mutex_unlock(&b->lock);
}

/* --- the plan of a model --- */

/* SUBTREES_NEEDED: number of subtrees for which the cache must have space. Queries along a path
 * need the current subtree, its neighbours, and memory to load the next one. SUBTREES_WANTED:
 * number of subtrees for which the cache has space if the budget allows this. The cut level is then
 * deeper, and subtrees are smaller and load faster. */
enum { SUBTREES_NEEDED = 64, SUBTREES_WANTED = 320 };

/* Returns the counts of the whole model. */
static ebpo_slice_size whole_size(const ebpo_info *info)
{
    ebpo_slice_size size = { .new_faces = info->face_count };
    for (int i = 0; i < info->level_count; i++) {
        size.groups += info->level[i].gray_count;
        size.leaves += info->level[i].leaf_count;
        size.refs += info->level[i].ref_count;
        size.planes += info->level[i].plane_count;
    }
    return size;
}

/* Returns true if the budget is sufficient for the top of the tree, which takes `top` bytes. The
 * levels of the top may take a quarter of the budget, and the top's data about a surface's holes
 * (holes.h) may take half of the budget. */
static bool top_fits(const ebpo_info *info, const ebpo_model_options *o, uint64_t budget,
                     uint64_t top)
{
    uint64_t holes = ebpo_holes_estimate(info);
    return top - holes <= budget / 4 && holes <= budget / 2 &&
           top + ebpo_bytes_besides_subtrees(o, budget) + EBPO_SUBTREES_LEAST <= budget;
}

/* Returns the first cut level for which half the budget holds `subtrees` subtrees of average size,
 * or -1 if the budget is too small. If there is no such level, returns the deepest level: its
 * subtrees are single leaves, for which less memory is sufficient. */
static int cut_for(const ebpo_info *info, const ebpo_model_options *o, uint64_t budget,
                   uint64_t subtrees)
{
    ebpo_slice_size size = whole_size(info);
    for (int level = 1; level < info->level_count; level++) {
        uint64_t grays = info->level[level].gray_count;
        if (!top_fits(info, o, budget, ebpo_top_estimate(info, level)))
            return -1;
        if (grays == 0 || ebpo_accel_mean_bytes(&size, info, grays) * subtrees <= budget / 2)
            return level;
    }
    return budget < ebpo_bytes_besides_subtrees(o, budget) + 2 * EBPO_SUBTREES_LEAST ||
                   ebpo_holes_estimate(info) > budget / 2
               ? -1
               : info->level_count - 1;
}

/* Returns the cut level for a budget, or -1 if the budget is too small. */
static int choose_cut(const ebpo_info *info, const ebpo_model_options *o, uint64_t budget)
{
    int cut = cut_for(info, o, budget, SUBTREES_WANTED);
    return cut < 0 ? cut_for(info, o, budget, SUBTREES_NEEDED) : cut;
}

/* Returns a budget that choose_cut accepts, at most an eighth above the least such budget. */
static uint64_t least_budget(const ebpo_info *info, const ebpo_model_options *o)
{
    uint64_t budget = EBPO_CHUNKS_LEAST + EBPO_SUBTREES_LEAST;
    while (choose_cut(info, o, budget) < 0 && budget < UINT64_C(1) << 60)
        budget += budget / 8;
    return budget;
}

/* Remote files are read in parts, because queries rarely need a whole file. REMOTE_MEMORY: the
 * default budget in bytes. REMOTE_WHOLE_BYTES: smaller files may be read completely. */
enum { REMOTE_MEMORY = 256 << 20, REMOTE_WHOLE_BYTES = 2 << 20 };

/* Returns true if the file is remote and must be read in parts, even if the budget holds the whole
 * model. */
static bool reads_parts(const ebpo_file *file, bool default_memory)
{
    const ebpo_info *info = ebpo_file_info(file);
    bool small = info->file_bytes <= REMOTE_WHOLE_BYTES;
    return ebpo_input_is_remote(&file->in) && !small && (info->subtree_level || default_memory);
}

bool ebpo_default_memory(const ebpo_file *file, ebpo_model_options *o)
{
    if (o->budget)
        o->memory = budget_left(o->budget);
    bool is_default = !o->memory && ebpo_input_is_remote(&file->in);
    if (is_default && o->cut_level < 0)
        o->memory = REMOTE_MEMORY;
    return is_default;
}

/* Returns the better cut level: `cut`, or the level at which the file is divided into subtrees. The
 * file's level is better if it is deeper and the budget allows it, because the file stores the data
 * of each subtree together. */
static int prefer_subtrees(const ebpo_info *info, const ebpo_model_options *o, int cut)
{
    int level = info->subtree_level;
    return level > cut && top_fits(info, o, o->memory, ebpo_top_estimate(info, level)) ? level
                                                                                       : cut;
}

/* --- applying the plan --- */

/* Chooses the cut level of a model that is not held completely in memory. */
static ebpo_status choose_parts(const ebpo_info *info, const ebpo_model_options *o,
                                ebpo_model_plan *out, ebpo_error *error)
{
    out->cut_level = choose_cut(info, o, o->memory);
    if (out->cut_level < 0)
        return ebpo_fail(error, EBPO_E_LIMIT,
                         "a budget of %" PRIu64
                         " bytes is too small for this model; give at least %" PRIu64,
                         o->memory, out->least);
    out->cut_level = prefer_subtrees(info, o, out->cut_level);
    return EBPO_OK;
}

/* Decides if the model is held completely in memory (out->resident), and otherwise chooses the cut
 * level. */
static ebpo_status choose_plan(const ebpo_file *file, const ebpo_model_options *o,
                               bool default_memory, ebpo_model_plan *out, ebpo_error *error)
{
    const ebpo_info *info = ebpo_file_info(file);
    int deepest = info->level_count - 1;
    if (!(info->parts &
          EBPO_PART_MESH)) /* without a mesh nothing can be loaded below a cut level */
        out->cut_level = deepest;
    else if (o->cut_level >= 0)
        out->cut_level = o->cut_level < deepest ? o->cut_level : deepest;
    else if ((o->memory == 0 || out->whole <= o->memory) && !reads_parts(file, default_memory))
        out->resident = true;
    else
        return choose_parts(info, o, out, error);
    return EBPO_OK;
}

/* Sets the plan's number of subtrees and the bytes of each part of the budget. */
static void share_budget(const ebpo_info *info, const ebpo_model_options *o, ebpo_model_plan *out)
{
    ebpo_slice_size size = whole_size(info);
    uint64_t taken;
    for (int level = 0; level <= out->cut_level; level++)
        out->subtrees += info->level[level].leaf_count;
    out->subtrees += info->level[out->cut_level].gray_count;
    out->subtree_bytes = out->subtrees ? ebpo_accel_mean_bytes(&size, info, out->subtrees) : 0;
    out->top = ebpo_top_estimate(info, out->cut_level);
    out->chunks = o->memory ? ebpo_chunk_budget(o->memory) : 0;
    out->skeletons =
        ebpo_skeletons_capacity(out->subtrees,
                                ebpo_skeleton_budget(o, o->memory ? o->memory : UINT64_MAX));
    taken = out->top + out->chunks + out->skeletons;
    out->subtrees_held = out->subtrees;
    if (o->memory && out->subtree_bytes) {
        uint64_t space = o->memory > taken ? (o->memory - taken) / out->subtree_bytes : 0;
        out->subtrees_held = space < out->subtrees ? space : out->subtrees;
    }
}

ebpo_status ebpo_plan_model(const ebpo_file *file, const ebpo_model_options *o, bool default_memory,
                            ebpo_model_plan *out, ebpo_error *error)
{
    const ebpo_info *info = ebpo_file_info(file);
    uint64_t keep, least;
    *out = (ebpo_model_plan)EBPO_MODEL_PLAN_INIT;
    if (o->loading > EBPO_LOAD_NODES)
        return ebpo_fail(error, EBPO_E_ARGUMENT, "model options: load mode %d does not exist",
                         (int)o->loading);
    if (o->budget && o->loading != EBPO_LOAD_CACHE)
        return ebpo_fail(error, EBPO_E_ARGUMENT,
                         "model options: models that share a budget need load mode "
                         "EBPO_LOAD_CACHE");
    ebpo_accel_estimate_whole(info, &keep, &out->whole);
    out->whole += ebpo_holes_estimate(info) + ebpo_holes_marks_max(info);
    least = least_budget(info, o);
    out->least = least < out->whole ? least : out->whole;
    out->budget = o->memory;
    ebpo_status status = choose_plan(file, o, default_memory, out, error);
    if (status == EBPO_OK && !out->resident)
        share_budget(info, o, out);
    return status;
}

ebpo_status ebpo_plan_parts(const ebpo_file *file, const ebpo_model_options *o,
                            ebpo_model_plan *out, ebpo_error *error)
{
    const ebpo_info *info = ebpo_file_info(file);
    *out = (ebpo_model_plan)EBPO_MODEL_PLAN_INIT;
    out->least = least_budget(info, o);
    return choose_parts(info, o, out, error);
}

ebpo_status ebpo_model_memory(const ebpo_file *file, const ebpo_model_options *options,
                              ebpo_model_plan *out, ebpo_error *error)
{
    EBPO_DEFAULT_FP;
    ebpo_model_options wanted = EBPO_MODEL_OPTIONS_INIT;
    ebpo_model_plan plan;
    ebpo_status status = EBPO_TAKE(ebpo_model_options, &wanted, options, error);
    if (status == EBPO_OK)
        status = EBPO_CHECK_SIZED(ebpo_model_plan, out, error);
    if (status != EBPO_OK)
        return status;
    bool default_memory = ebpo_default_memory(file, &wanted);
    status = ebpo_plan_model(file, &wanted, default_memory, &plan, error);
    return status == EBPO_OK ? EBPO_GIVE(ebpo_model_plan, out, &plan) : status;
}
