/* All pairs of faces of two accels that meet, for a run of the first's faces: parts of the descent
 * on several threads, then one order. */
#ifndef EBPO_COLLIDE_GATHERING_H
#define EBPO_COLLIDE_GATHERING_H

#include "extras/collide/collider.h"

/* Zero at first. */
typedef struct ebpo_gathering {
    const ebpo_collision *question;
    bool self;
    ebpo_node_pair *part; /* of the descent, from which threads go on */
    uint64_t parts, part_capacity;
    ebpo_pair_walk *walk; /* one for each thread */
    unsigned threads;
    uint64_t most; /* pairs */
    _Atomic uint64_t found;
    _Atomic bool full; /* there are more than so many */
    ebpo_met_pair *met;
    uint64_t met_count, met_capacity;
} ebpo_gathering;

/* Of faces `begin` to `end` of the pair's first accel: fills in `met`, sorted; or `full`. */
EBPO_MUST_USE ebpo_status ebpo_gather(ebpo_gathering *g, const ebpo_accel_pair *pair,
                                      uint32_t begin, uint32_t end, ebpo_error *error);
void ebpo_gathering_free(ebpo_gathering *g);

#endif
