/* What the levels of two trees tell of models at poses: by envelopes and black cells, without
 * faces. One thread each. */
#ifndef EBPO_COLLIDE_LEVEL_SEARCH_H
#define EBPO_COLLIDE_LEVEL_SEARCH_H

#include "extras/collide/node_gaps.h"

/* Zero at first. */
typedef struct ebpo_level_search {
    const ebpo_collision *question;
    ebpo_node_gaps nodes;
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
