/* Where pieces put what they made until the levels are joined. */
#include "construct/pack.h"

#include <pthread.h>
#include <stdlib.h>
#include <string.h>

#include "core/alloc.h"
#include "core/error.h"
#include "construct/piece_levels.h"

enum { STORE_BYTES = 16 << 20, ALIGNMENT = 8 };

/* Blocks of the workspace, filled one after the other. */
struct ebpo_store {
    ebpo_workspace *workspace;
    pthread_mutex_t lock;
    char **blocks;
    uint64_t block_count, block_capacity;
    size_t left; /* in the last one, at its end */
    size_t last_bytes;
};

static size_t reserve_for(uint64_t count, size_t size)
{
    return (count * size + ALIGNMENT - 1) / ALIGNMENT * ALIGNMENT;
}

static char *take_capacity(ebpo_builder *b, struct ebpo_store *s, size_t bytes)
{
    if (!s->block_count || bytes > s->left) {
        size_t block = bytes > STORE_BYTES ? bytes : STORE_BYTES;
        char *made =
            ebpo_grow(&s->blocks, &s->block_capacity, s->block_count + 1, sizeof *s->blocks)
                ? ebpo_array_alloc(b->workspace, block, 1)
                : NULL;
        if (!made)
            return NULL;
        s->blocks[s->block_count++] = made;
        s->left = s->last_bytes = block;
    }
    char *at = s->blocks[s->block_count - 1] + (s->last_bytes - s->left);
    s->left -= bytes;
    return at;
}

static bool make_store(ebpo_builder *b)
{
    static pthread_mutex_t making = PTHREAD_MUTEX_INITIALIZER;
    pthread_mutex_lock(&making);
    if (!b->store && (b->store = ebpo_alloc_zero(1, sizeof *b->store))) {
        pthread_mutex_init(&b->store->lock, NULL);
        b->store->workspace = b->workspace;
    }
    pthread_mutex_unlock(&making);
    return b->store != NULL;
}

static char *reserve(ebpo_builder *b, size_t bytes)
{
    pthread_mutex_lock(&b->store->lock);
    char *at = take_capacity(b, b->store, bytes);
    pthread_mutex_unlock(&b->store->lock);
    return at;
}

void *ebpo_store_reserve(ebpo_builder *b, uint64_t bytes)
{
    return make_store(b) ? reserve(b, reserve_for(bytes, 1)) : NULL;
}

static size_t capacity_of(const ebpo_level *level, int id)
{
    return ebpo_schema_is_held(id) && ebpo_level_array(level, id)
               ? reserve_for(ebpo_level_rows(level, id), ebpo_schema[id].held_size)
               : 0;
}

static void pack_array(const ebpo_builder *b, ebpo_level *level, int id, char *to)
{
    void *array = ebpo_level_array(level, id);
    uint64_t bytes = ebpo_level_rows(level, id) * ebpo_schema[id].held_size;
    if (array && bytes)
        ebpo_array_copy(b->workspace, to, array, bytes);
    ebpo_array_free(b->workspace, array);
    ebpo_level_set_array(level, id, array && bytes ? to : NULL);
}

ebpo_status ebpo_build_pack(ebpo_builder *b, ebpo_piece_level *out, ebpo_error *error)
{
    size_t bytes = 0;
    if (!b->workspace)
        return EBPO_OK;
    for (int level = 0; level < EBPO_LEVELS_MAX; level++)
        for (int id = 0; id < EBPO_LEVEL_ARRAYS; id++)
            bytes += capacity_of(&out[level].level, id);
    char *to = ebpo_store_reserve(b, bytes);
    if (!to)
        return ebpo_workspace_fail(b->workspace, bytes, error);
    for (int level = 0; level < EBPO_LEVELS_MAX; level++) {
        for (int id = 0; id < EBPO_LEVEL_ARRAYS; id++)
            if (ebpo_schema_is_held(id)) {
                pack_array(b, &out[level].level, id, to);
                to += capacity_of(&out[level].level, id);
            }
        out[level].packed = true;
    }
    return EBPO_OK;
}

void ebpo_store_free(struct ebpo_store *store)
{
    if (!store)
        return;
    for (uint64_t i = 0; i < store->block_count; i++)
        ebpo_array_free(store->workspace, store->blocks[i]);
    free(store->blocks);
    pthread_mutex_destroy(&store->lock);
    free(store);
}
