#include "query/model_parts.h"

#include <inttypes.h>
#include <pthread.h>
#include <stdlib.h>

#include "core/alloc.h"
#include "core/error.h"
#include "core/sized.h"

struct ebpo_budget {
    uint64_t bytes;
    ebpo_cache_pool *subtrees, *chunks;
    pthread_mutex_t lock;      /* of what follows */
    uint64_t whole, skeletons; /* that may still be taken */
};

ebpo_status ebpo_budget_new(uint64_t bytes, ebpo_budget **out, ebpo_error *error)
{
    *out = NULL;
    ebpo_model_options usual = EBPO_MODEL_OPTIONS_INIT;
    uint64_t chunks = ebpo_chunk_budget(bytes), least = EBPO_CHUNKS_LEAST + EBPO_SUBTREES_LEAST;
    if (bytes == 0)
        return ebpo_fail(error, EBPO_E_ARGUMENT, "a budget of 0 bytes");
    if (bytes < least)
        return ebpo_fail(error, EBPO_E_LIMIT,
                         "a budget of %" PRIu64 " bytes is too small for any model; give %" PRIu64
                         " at least",
                         bytes, least);
    ebpo_budget *b = ebpo_alloc_zero(1, sizeof *b);
    if (!b)
        return ebpo_fail_memory(error, sizeof *b);
    (void)pthread_mutex_init(&b->lock, NULL);
    b->bytes = bytes;
    b->whole = bytes / 2;
    b->skeletons = ebpo_skeleton_budget(&usual, bytes);
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

uint64_t ebpo_budget_left(const ebpo_budget *b)
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
    uint64_t got = wanted < b->skeletons ? wanted : b->skeletons;
    b->skeletons -= got;
    (void)pthread_mutex_unlock(&b->lock);
    return got;
}

void ebpo_budget_give_back_skeletons(ebpo_budget *b, uint64_t bytes)
{
    (void)pthread_mutex_lock(&b->lock);
    b->skeletons += bytes;
    (void)pthread_mutex_unlock(&b->lock);
}
