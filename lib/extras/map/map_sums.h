/* Inside lib/extras/map: statistics as values come, without percentiles. */
#ifndef EBPO_MAP_MAP_SUMS_H
#define EBPO_MAP_MAP_SUMS_H

#include <ebpo/map.h>

#include "mesh/sum.h"

enum { EBPO_MAP_BINS = 3, EBPO_MAP_BIN_UNIT = 600 };

typedef struct ebpo_map_sums {
    ebpo_map_stats stats; /* counts, min and max */
    /* of small, ordinary and large values: bin i counts 2^(EBPO_MAP_BIN_UNIT (i - 1)), squares its
     * square */
    ebpo_sum sum[EBPO_MAP_BINS], sum_unsigned[EBPO_MAP_BINS], squares[EBPO_MAP_BINS];
} ebpo_map_sums;

/* Freed by free(); NULL when memory is short. */
ebpo_map_sums *ebpo_map_sums_new(void);
void ebpo_map_sums_add(ebpo_map_sums *sums, const double *values, uint64_t count);
ebpo_map_stats ebpo_map_sums_stats(const ebpo_map_sums *sums);

#endif
