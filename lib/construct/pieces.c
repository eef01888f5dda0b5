/* Manages the data of the pieces of the tree during the build: nodes, details, lists, proposed
 * planes, the piece's part ("stretch") of each level's arrays, and the store of results.
 *
 * A piece is a subtree that one thread builds. Its arrays grow in memory or in the builder's
 * workspace. When a piece is done, its results move to the store. The store consists of blocks of
 * the workspace, which are filled one after the other and read once, when the levels are joined.
 * Without a workspace, results stay in memory. */
#include "core/strict_fp.h"

#include <pthread.h>
#include <stdlib.h>
#include <string.h>

#include "construct/pieces.h"
#include "core/alloc.h"
#include "core/error.h"
#include "core/workspace.h"
#include "geometry/polytope.h"

/* --- stretches of the levels' arrays --- */

void ebpo_piece_levels_free(ebpo_piece_level *out)
{
    ebpo_workspace *workspace = out ? out[0].level.workspace : NULL;
    for (int i = 0; out && i < EBPO_LEVELS_MAX; i++)
        if (!out[i].packed)
            ebpo_level_free(&out[i].level);
    ebpo_array_free(workspace, out);
}

bool ebpo_piece_level_add_group(ebpo_piece_level *out, uint16_t types)
{
    ebpo_level *l = &out->level;
    if (!ebpo_array_grow_late(l->workspace, &l->types, &out->capacity[EBPO_A_TYPES],
                              l->group_count + 1, sizeof *l->types))
        return false;
    l->types[l->group_count++] = types;
    return true;
}

bool ebpo_piece_level_add_gray(ebpo_piece_level *out, const uint32_t *codes, int count,
                               double volume)
{
    ebpo_level *l = &out->level;
    if (!ebpo_array_grow_late(l->workspace, &l->plane_counts, &out->capacity[EBPO_A_PLANE_COUNTS],
                              l->gray_count + 1, 1) ||
        !ebpo_array_grow_late(l->workspace, &l->planes, &out->capacity[EBPO_A_PLANES],
                              l->plane_count + (uint64_t)count, sizeof *l->planes))
        return false;
    l->plane_counts[l->gray_count++] = (uint8_t)count;
    if (count) /* the array may not exist yet */
        memcpy(l->planes + l->plane_count, codes, (size_t)count * sizeof *codes);
    l->plane_count += (uint64_t)count;
    l->gray_volume += volume;
    return true;
}

bool ebpo_piece_level_add_empty(ebpo_piece_level *out, bool black, int32_t winding)
{
    ebpo_level *l = &out->level;
    int32_t **array = black ? &l->black_winding : &l->white_winding;
    uint64_t *count = black ? &l->black_count : &l->white_count;
    if (!ebpo_array_grow_late(l->workspace, array,
                              &out->capacity[black ? EBPO_A_BLACK_WINDING : EBPO_A_WHITE_WINDING],
                              *count + 1, sizeof **array))
        return false;
    (*array)[(*count)++] = winding;
    return true;
}

/* --- proposed planes --- */

void ebpo_handover_free(ebpo_handover *h)
{
    free(h->offers);
    free(h->corner);
    memset(h, 0, sizeof *h);
}

void ebpo_proposals_free(ebpo_proposals *p)
{
    if (!p)
        return;
    if (!p->packed) {
        free(p->first);
        free(p->count);
        free(p->codes);
    }
    free(p->thesis);
    ebpo_handover_free(&p->root);
    free(p);
}

const uint32_t *ebpo_proposed(const ebpo_branch *s, uint32_t detail, int *count)
{
    static const uint32_t none[1];
    const ebpo_proposals *p = s->proposals;
    *count = 0;
    if (!p)
        return NULL;
    *count = p->count[detail];
    return *count ? p->codes + p->first[detail] : none;
}

bool ebpo_handover_add(ebpo_handover *h, uint32_t normal, double origin)
{
    if (!ebpo_grow(&h->offers, &h->offer_capacity, h->offer_count + 1, sizeof *h->offers))
        return false;
    h->offers[h->offer_count++] = (ebpo_offer){ normal, 0, origin };
    return true;
}

bool ebpo_handover_gather(ebpo_handover *given, const ebpo_handover *child, unsigned octant)
{
    if (!ebpo_grow(&given->corner, &given->corner_capacity,
                   given->corner_count + child->corner_count, sizeof *given->corner))
        return false;
    for (uint64_t i = 0; i < child->corner_count; i++, given->corner_count++)
        for (int k = 0; k < 3; k++)
            given->corner[given->corner_count][k] = (child->corner[i][k] + (octant >> k & 1)) / 2;
    for (uint64_t i = 0; i < child->offer_count; i++) {
        /* shift: n . x for the lowest corner x of the octant, if the side of a child's cell is 1 */
        int32_t n[3], d, shift = 0;
        ebpo_plane_code_decode(child->offers[i].normal, n, &d);
        for (int k = 0; k < 3; k++)
            shift += octant >> k & 1 ? n[k] : 0;
        if (!ebpo_handover_add(given, child->offers[i].normal,
                               (child->offers[i].origin + shift) / 2))
            return false;
    }
    return true;
}

bool ebpo_proposals_make(ebpo_branch *s)
{
    ebpo_proposals *p = s->proposals = ebpo_alloc_zero(1, sizeof *p);
    if (!p)
        return false;
    p->first = ebpo_alloc_zero(s->detail_count, sizeof *p->first);
    p->count = ebpo_alloc_zero(s->detail_count, 1);
    return p->first && p->count;
}

/* --- the store --- */

enum { BLOCK_BYTES = 16 << 20 /* least size of a block, in bytes */, ALIGNMENT = 8 };

/* Blocks of the workspace, filled one after the other. */
struct ebpo_store {
    ebpo_workspace *workspace;
    pthread_mutex_t lock; /* protects all fields except `workspace` */
    char **blocks;
    uint64_t block_count, block_capacity;
    size_t left;       /* free bytes at the end of the last block */
    size_t last_bytes; /* bytes of the last block */
};

/* Returns the bytes of `count` elements, rounded up to a multiple of ALIGNMENT. */
static size_t aligned_bytes(uint64_t count, size_t size)
{
    return (count * size + ALIGNMENT - 1) / ALIGNMENT * ALIGNMENT;
}

/* Reserves bytes in the last block, or in a new block. Returns NULL when out of memory. */
static char *store_take(ebpo_builder *b, struct ebpo_store *s, size_t bytes)
{
    if (!s->block_count || bytes > s->left) {
        size_t block = bytes > BLOCK_BYTES ? bytes : BLOCK_BYTES;
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

/* Makes the builder's store if there is none. Any thread may call this function. Returns false when
 * out of memory. */
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

/* Does the work of ebpo_store_reserve for a builder that has a store. */
static char *store_reserve(ebpo_builder *b, size_t bytes)
{
    pthread_mutex_lock(&b->store->lock);
    char *at = store_take(b, b->store, bytes);
    pthread_mutex_unlock(&b->store->lock);
    return at;
}

void *ebpo_store_reserve(ebpo_builder *b, uint64_t bytes)
{
    return make_store(b) ? store_reserve(b, aligned_bytes(bytes, 1)) : NULL;
}

/* Returns the bytes that an array takes in the store; 0 if the level does not have the array. */
static size_t packed_bytes(const ebpo_level *level, int id)
{
    return ebpo_schema_is_held(id) && ebpo_level_array(level, id)
               ? aligned_bytes(ebpo_level_rows(level, id), ebpo_schema[id].held_size)
               : 0;
}

/* Moves an array of a level to `to`. */
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
            bytes += packed_bytes(&out[level].level, id);
    char *to = ebpo_store_reserve(b, bytes);
    if (!to)
        return ebpo_workspace_fail(b->workspace, bytes, error);
    for (int level = 0; level < EBPO_LEVELS_MAX; level++) {
        for (int id = 0; id < EBPO_LEVEL_ARRAYS; id++)
            if (ebpo_schema_is_held(id)) {
                pack_array(b, &out[level].level, id, to);
                to += packed_bytes(&out[level].level, id);
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

/* --- nodes --- */

bool ebpo_branch_detail(const ebpo_builder *b, ebpo_branch *s, uint32_t *index)
{
    if (!ebpo_array_grow_late(b->workspace, &s->details, &s->detail_capacity, s->detail_count + 1,
                              sizeof *s->details))
        return false;
    memset(&s->details[s->detail_count], 0, sizeof s->details[0]);
    *index = (uint32_t)s->detail_count++;
    return true;
}

bool ebpo_branch_children(const ebpo_builder *b, ebpo_branch *s, uint32_t *first)
{
    if (!ebpo_array_grow_late(b->workspace, &s->nodes, &s->node_capacity, s->node_count + 8,
                              sizeof *s->nodes))
        return false;
    *first = (uint32_t)s->node_count;
    memset(&s->nodes[s->node_count], 0, 8 * sizeof s->nodes[0]);
    s->node_count += 8;
    return true;
}

ebpo_status ebpo_build_check_branch(const ebpo_branch *s, ebpo_error *error)
{
    if (s->node_count <= UINT32_MAX - 8 && s->detail_count < UINT32_MAX)
        return EBPO_OK;
    return ebpo_fail(
        error, EBPO_E_LIMIT,
        "more than 2^32 nodes in one piece of the tree: lower --max-level or raise --leaf-faces");
}

void ebpo_branch_forget(ebpo_branch *s)
{
    ebpo_array_free(s->workspace, s->nodes);
    ebpo_array_free(s->workspace, s->details);
    ebpo_array_free(s->workspace, s->entries);
    ebpo_array_free(s->workspace, s->crossing);
    s->nodes = NULL;
    s->details = NULL;
    s->entries = s->crossing = NULL;
    s->node_count = s->node_capacity = s->detail_count = s->detail_capacity = 0;
    s->entry_count = s->entry_capacity = s->cross_count = s->cross_capacity = 0;
}

void ebpo_branch_release(ebpo_branch *s)
{
    ebpo_branch_forget(s);
    ebpo_array_free(s->workspace, s->list);
    free(s->fresh);
    ebpo_array_free(s->workspace, s->above);
    ebpo_proposals_free(s->proposals);
    s->proposals = NULL;
    s->list = NULL;
    s->fresh = NULL;
    s->above = NULL;
}

void ebpo_branch_free(ebpo_branch *s)
{
    ebpo_branch_release(s);
    ebpo_piece_levels_free(s->out);
    memset(s, 0, sizeof *s);
}
