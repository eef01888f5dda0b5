/* Nodes of the tree over a box's faces, the one with the least key first. A heap in an array that
 * its owner gives. */
#ifndef EBPO_HAPTIC_NEAR_QUEUE_H
#define EBPO_HAPTIC_NEAR_QUEUE_H

#include <stdint.h>

typedef struct ebpo_near_node {
    double key; /* not NAN */
    uint64_t node;
} ebpo_near_node;

typedef struct ebpo_near_queue {
    ebpo_near_node *item; /* there is room for all that are pushed */
    uint64_t count;
} ebpo_near_queue;

void ebpo_near_push(ebpo_near_queue *queue, double key, uint64_t node);
/* item[0] is the first; this takes it out. */
ebpo_near_node ebpo_near_pop(ebpo_near_queue *queue);

#endif
