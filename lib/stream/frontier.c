#include "stream/frontier.h"

#include <stdlib.h>
#include <string.h>

#include "base/alloc.h"
#include "base/error.h"

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
    return ebpo_grow(&f->at, &f->room, f->count + more, sizeof *f->at) ? EBPO_OK : ebpo_fail_memory(error, (f->count + more) * sizeof *f->at);
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

unsigned ebpo_frontier_best(const ebpo_frontier *f, unsigned most, uint64_t *places)
{
    uint64_t edge[EBPO_FRONTIER_BEST + 1]; /* the children of those found, and the top */
    unsigned count = 0, edges = 0;
    if (f->count)
        edge[edges++] = 0;
    while (count < most && count < EBPO_FRONTIER_BEST && edges) {
        unsigned first = 0;
        for (unsigned i = 1; i < edges; i++)
            if (before(&f->at[edge[i]], &f->at[edge[first]]))
                first = i;
        uint64_t place = edge[first];
        if (f->at[place].turn == EBPO_TURN_NEVER)
            break;
        places[count++] = place;
        edge[first] = edge[--edges];
        for (uint64_t below = 2 * place + 1; below <= 2 * place + 2 && below < f->count; below++)
            edge[edges++] = below;
    }
    return count;
}
