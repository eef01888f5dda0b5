/* The gray nodes of a cut: a heap, the next one to be refined on top. */
#ifndef EBPO_LEVELS_FRONTIER_H
#define EBPO_LEVELS_FRONTIER_H

#include <ebpo/base.h>

/* Whether a node's turn comes at all. */
typedef enum ebpo_turn { EBPO_TURN_SEEN, EBPO_TURN_UNSEEN, EBPO_TURN_NEVER } ebpo_turn;

typedef struct ebpo_waiting {
    uint64_t key, octcode; /* the least key first, then the least octcode */
    uint64_t below;        /* number of its children's group in their level */
    uint32_t group;
    uint8_t octant, turn;
} ebpo_waiting;

typedef struct ebpo_frontier {
    ebpo_waiting *at; /* [count], a binary heap */
    uint64_t count, capacity;
} ebpo_frontier;

void ebpo_frontier_free(ebpo_frontier *frontier);
/* After this, so many pushes cannot fail. */
EBPO_MUST_USE ebpo_status ebpo_frontier_reserve(ebpo_frontier *frontier, uint64_t more,
                                                ebpo_error *error);
void ebpo_frontier_push(ebpo_frontier *frontier, ebpo_waiting node);
/* Takes the top away. */
ebpo_waiting ebpo_frontier_pop(ebpo_frontier *frontier);
/* After keys or turns have been changed. */
void ebpo_frontier_sort(ebpo_frontier *frontier);
/* Of the nodes whose turn comes, the first one of each block of `span` children's groups of a
 * level: their places in `at`, in order. The top is the first. At most EBPO_FRONTIER_BLOCKS;
 * returns how many. */
enum { EBPO_FRONTIER_BLOCKS = 1024 };
unsigned ebpo_frontier_blocks(const ebpo_frontier *frontier, uint64_t span,
                              uint64_t places[EBPO_FRONTIER_BLOCKS]);

#endif
