/* Faces that meet in two subtrees, which are loaded for it. One thread each. */
#ifndef EBPO_COLLIDE_SUBTREE_WALK_H
#define EBPO_COLLIDE_SUBTREE_WALK_H

#include "extras/collide/collider.h"
#include "extras/collide/subtree_pairs.h"

/* Faces that meet, with their numbers: [0] of the question's first model. */
typedef struct ebpo_told_pair {
    uint32_t file[2], source[2];
    int32_t kind;
} ebpo_told_pair;

/* Zero at first. Its contexts hold the two subtrees that it has come to last. */
typedef struct ebpo_subtree_walk {
    const ebpo_collision *question;
    bool self;
    ebpo_context *context[2]; /* of models that are in parts */
    ebpo_pair_walk walk;
    ebpo_told_pair *told; /* of the last pair, in no order; no face with itself */
    uint64_t count, capacity;
    uint64_t first_end; /* faces that the first's subtree lists have lesser numbers */
    bool late;          /* the deadline has passed before all was found */
} ebpo_subtree_walk;

EBPO_MUST_USE ebpo_status ebpo_subtree_walk_begin(ebpo_subtree_walk *w,
                                                  const ebpo_collision *question, bool self,
                                                  ebpo_error *error);
/* Fills in what has been found. */
EBPO_MUST_USE ebpo_status ebpo_subtree_walk_pair(ebpo_subtree_walk *w,
                                                 const ebpo_subtree_pair *pair, ebpo_error *error);
/* Subtrees that it had to load. */
uint64_t ebpo_subtree_walk_loads(const ebpo_subtree_walk *w);
/* Others may have the room of its subtrees. */
void ebpo_subtree_walk_let_go(ebpo_subtree_walk *w);
void ebpo_subtree_walk_free(ebpo_subtree_walk *w);

int ebpo_told_pair_compare(const void *x, const void *y);
ebpo_face_pair ebpo_told_pair_tell(const ebpo_collision *question, const ebpo_told_pair *told);

#endif
