/* Nodes that wait to be searched, the nearest first. */
#include "query/nearest.h"

#include "core/alloc.h"
#include "core/error.h"

/* A heap. */
static bool before(const ebpo_ranked *a, const ebpo_ranked *b)
{
    return a->lower != b->lower ? a->lower < b->lower : a->node.entry < b->node.entry;
}

ebpo_status ebpo_queue_push(ebpo_context *c, const ebpo_ranked *r, ebpo_error *error)
{
    if (!ebpo_grow(&c->queue, &c->queue_capacity, c->queue_count + 1, sizeof *c->queue))
        return ebpo_fail_memory(error, (c->queue_count + 1) * sizeof *c->queue);
    uint64_t at = c->queue_count++;
    for (; at > 0 && before(r, &c->queue[(at - 1) / 2]); at = (at - 1) / 2)
        c->queue[at] = c->queue[(at - 1) / 2];
    c->queue[at] = *r;
    return EBPO_OK;
}

ebpo_ranked ebpo_queue_pop(ebpo_context *c)
{
    ebpo_ranked first = c->queue[0], last = c->queue[--c->queue_count];
    uint64_t at = 0, count = c->queue_count;
    for (uint64_t child = 1; child < count; child = 2 * at + 1) {
        if (child + 1 < count && before(&c->queue[child + 1], &c->queue[child]))
            child++;
        if (!before(&c->queue[child], &last))
            break;
        c->queue[at] = c->queue[child];
        at = child;
    }
    c->queue[at] = last;
    return first;
}
