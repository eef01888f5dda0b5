#include "core/strict_fp.h"

#include "extras/haptic/near_queue.h"

void ebpo_near_push(ebpo_near_queue *queue, double key, uint64_t node)
{
    uint64_t at = queue->count++;
    for (; at > 0 && queue->item[(at - 1) / 2].key > key; at = (at - 1) / 2)
        queue->item[at] = queue->item[(at - 1) / 2];
    queue->item[at] = (ebpo_near_node){ key, node };
}

ebpo_near_node ebpo_near_pop(ebpo_near_queue *queue)
{
    ebpo_near_node first = queue->item[0], last = queue->item[--queue->count];
    uint64_t at = 0;
    for (uint64_t child = 1; child < queue->count; child = 2 * at + 1) {
        if (child + 1 < queue->count && queue->item[child + 1].key < queue->item[child].key)
            child++;
        if (!(queue->item[child].key < last.key))
            break;
        queue->item[at] = queue->item[child];
        at = child;
    }
    if (queue->count > 0)
        queue->item[at] = last;
    return first;
}
