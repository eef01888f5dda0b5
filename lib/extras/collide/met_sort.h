/* Pairs of faces in the order of the first's number, then the second's. */
#ifndef EBPO_COLLIDE_MET_SORT_H
#define EBPO_COLLIDE_MET_SORT_H

#include "extras/collide/pair_walk.h"

/* `spare` has room for as many; the result is in `met`. The numbers are below most_a and most_b. */
void ebpo_met_sort(ebpo_met_pair *met, ebpo_met_pair *spare, uint64_t count, uint32_t most_a,
                   uint32_t most_b);

#endif
