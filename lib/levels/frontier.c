#include "levels/frontier.h"

#include <stdlib.h>
#include <string.h>

#include "core/alloc.h"
#include "core/error.h"
#include "core/hash.h"

static bool before(const ebpo_waiting *a, const ebpo_waiting *b)
{
    if (a->turn != b->turn)
        return a->turn < b->turn;
    return a->key != b->key ? a->key < b->key : a->octcode < b->octcode;
}

void ebpo_frontier_free(ebpo_frontier *f)
{
    free(f->at);
    memset(f, 0, sizeof *f);
}

ebpo_status ebpo_frontier_reserve(ebpo_frontier *f, uint64_t more, ebpo_error *error)
{
    return ebpo_grow(&f->at, &f->capacity, f->count + more, sizeof *f->at)
               ? EBPO_OK
               : ebpo_fail_memory(error, (f->count + more) * sizeof *f->at);
}

static void sink(ebpo_frontier *f, uint64_t i)
{
    ebpo_waiting node = f->at[i];
    for (uint64_t below = 2 * i + 1; below < f->count; below = 2 * i + 1) {
        if (below + 1 < f->count && before(&f->at[below + 1], &f->at[below]))
            below++;
        if (!before(&f->at[below], &node))
            break;
        f->at[i] = f->at[below];
        i = below;
    }
    f->at[i] = node;
}

void ebpo_frontier_push(ebpo_frontier *f, ebpo_waiting node)
{
    uint64_t i = f->count++;
    for (; i > 0 && before(&node, &f->at[(i - 1) / 2]); i = (i - 1) / 2)
        f->at[i] = f->at[(i - 1) / 2];
    f->at[i] = node;
}

ebpo_waiting ebpo_frontier_pop(ebpo_frontier *f)
{
    ebpo_waiting top = f->at[0];
    f->at[0] = f->at[--f->count];
    if (f->count)
        sink(f, 0);
    return top;
}

void ebpo_frontier_sort(ebpo_frontier *f)
{
    for (uint64_t i = f->count / 2; i-- > 0;)
        sink(f, i);
}

/* A table of blocks by hash; those for which there is no room are left out. */
unsigned ebpo_frontier_blocks(const ebpo_frontier *f, uint64_t span,
                              uint64_t places[EBPO_FRONTIER_BLOCKS])
{
    enum { SLOTS = 4 * EBPO_FRONTIER_BLOCKS };
    struct {
        uint64_t block, place;
    } slot[SLOTS]; /* block 0: free */
    unsigned count = 0;
    memset(slot, 0, sizeof slot);
    for (uint64_t i = 0; i < f->count; i++) {
        const ebpo_waiting *w = &f->at[i];
        if (w->turn == EBPO_TURN_NEVER)
            continue;
        /* with the level; not 0 */
        uint64_t block = (w->below / span) << 6 | (uint64_t)(64 - __builtin_clzll(w->octcode));
        uint64_t at;
        EBPO_HASH_FIND(at, ebpo_hash_number(block), SLOTS - 1,
                       !slot[at].block || slot[at].block == block);
        if (!slot[at].block && count == EBPO_FRONTIER_BLOCKS)
            continue;
        count += !slot[at].block;
        if (!slot[at].block || before(w, &f->at[slot[at].place]))
            slot[at].place = i;
        slot[at].block = block;
    }
    count = 0;
    for (unsigned at = 0; at < SLOTS; at++)
        if (slot[at].block) {
            unsigned i = count++;
            for (; i > 0 && before(&f->at[slot[at].place], &f->at[places[i - 1]]); i--)
                places[i] = places[i - 1];
            places[i] = slot[at].place;
        }
    return count;
}
