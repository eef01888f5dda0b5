/* Which subtrees of two models may have faces that meet, before any of them is loaded. */
#ifndef EBPO_COLLIDE_SUBTREE_PAIRS_H
#define EBPO_COLLIDE_SUBTREE_PAIRS_H

#include "extras/collide/posed_subtrees.h"

typedef struct ebpo_subtree_pair {
    uint32_t a, b;
    uint32_t rank_a, rank_b; /* in the order of the files' faces */
    double apart;            /* distance of their middles over the sum of their sizes */
} ebpo_subtree_pair;

typedef struct ebpo_subtree_pairs {
    ebpo_subtree_pair *pair;
    uint64_t count, capacity;
    uint64_t subtrees[2]; /* different ones of each model */
} ebpo_subtree_pairs;

/* Two faces that meet have a common point, and that is in a cell of each model that lists its face:
 * so they are listed by the subtrees of one of these pairs. They come sorted by the first's place,
 * back and forth in the second's, so that what was loaded is used again soon. `self`: both are one
 * model at one pose; each pair once, the first's place not behind the second's. Freed by the
 * caller (`pair`), also after a failure. */
EBPO_MUST_USE ebpo_status ebpo_subtree_pairs_find(ebpo_subtree_pairs *out, ebpo_posed_subtrees *a,
                                                  ebpo_posed_subtrees *b, double reach, bool self,
                                                  ebpo_error *error);

/* By `apart`, the least first. */
void ebpo_subtree_pairs_nearest_first(ebpo_subtree_pairs *pairs);

#endif
