/* What the levels of two trees tell of models at poses: by envelopes and black cells, without
 * faces. One thread each. */
#ifndef EBPO_COLLIDE_LEVEL_SEARCH_H
#define EBPO_COLLIDE_LEVEL_SEARCH_H

#include "collide/collider.h"
#include "collide/posed_subtrees.h"

/* Two nodes with something of each model in them; `gap`: they are not nearer to each other. */
typedef struct ebpo_level_pair {
    ebpo_posed_node node[2];
    double gap;
} ebpo_level_pair;

/* Zero at first. */
typedef struct ebpo_level_search {
    const ebpo_collision *question;
    ebpo_posed_subtrees side[2];
    ebpo_level_pair *heap; /* those of the least gaps first */
    uint64_t count, capacity;
    /* out */
    double lo, hi;       /* of the distance of faces */
    uint64_t open_pairs; /* that may have faces that meet */
    bool meets;          /* a point is of both, of solids or of faces: certain */
    bool may_meet;       /* a pair is left that may have such a point */
} ebpo_level_search;

EBPO_MUST_USE ebpo_status ebpo_level_search_run(ebpo_level_search *g,
                                                const ebpo_collision *question, ebpo_error *error);
void ebpo_level_search_free(ebpo_level_search *g);

#endif
