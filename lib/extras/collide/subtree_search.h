/* Pairs of nodes of two models, some in parts, best first, down to subtrees that are loaded for
 * what may be in them. Used by distances and by the way out; what is best, and when it is enough,
 * is theirs to say. One thread. */
#ifndef EBPO_COLLIDE_SUBTREE_SEARCH_H
#define EBPO_COLLIDE_SUBTREE_SEARCH_H

#include "extras/collide/collider.h"
#include "extras/collide/node_gaps.h"

/* Zero at first. */
typedef struct ebpo_subtree_search {
    const ebpo_collision *question;
    ebpo_node_gaps nodes;
    ebpo_context *context[2]; /* of models that are in parts */
    bool *seen[2];            /* subtrees that have been looked at */
    uint64_t read_before;
} ebpo_subtree_search;

/* Ended also after a failure. */
EBPO_MUST_USE ebpo_status ebpo_subtree_search_begin(ebpo_subtree_search *s,
                                                    const ebpo_collision *question,
                                                    ebpo_error *error);
/* Adds what has been loaded and read to the collider's counts. */
void ebpo_subtree_search_end(ebpo_subtree_search *s);

/* Which of two nodes is to be divided; -1: neither, they are to be looked at. */
int ebpo_subtree_search_side(const ebpo_subtree_search *s, const ebpo_posed_node node[2]);

/* What is to be looked at of two nodes that are not divided, loaded if need be: until the next
 * call. *there: false if nothing is, or it has been looked at. */
EBPO_MUST_USE ebpo_status ebpo_subtree_search_load(ebpo_subtree_search *s,
                                                   const ebpo_posed_node node[2],
                                                   const ebpo_accel *accel[2], bool *there,
                                                   ebpo_error *error);

#endif
