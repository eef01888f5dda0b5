/* Candidate normals of a gray node, from the faces below it. */
#ifndef EBPO_CONSTRUCT_CANDIDATES_H
#define EBPO_CONSTRUCT_CANDIDATES_H

#include "construct/builder.h"

enum { EBPO_CANDIDATES_SAMPLE = 4096, EBPO_CANDIDATES_BINS = 16384 };

/* A bin of the octahedral map, and the normals in it. */
typedef struct ebpo_normal_bin {
    uint32_t key; /* 0: free */
    uint32_t count;
    uint64_t sum_u, sum_v;
} ebpo_normal_bin;

/* Memory of one thread, which is too large for its stack; begins as zeros. */
typedef struct ebpo_candidates_scratch {
    ebpo_normal_bin table[EBPO_CANDIDATES_BINS]; /* by hash; all are free between calls */
    uint32_t sample[EBPO_CANDIDATES_SAMPLE];
    int slots[EBPO_PLANES_CANDIDATES]; /* the bins that are not free */
} ebpo_candidates_scratch;

/* At most `most` of them; returns how many. */
int ebpo_build_candidates(const ebpo_builder *b, ebpo_candidates_scratch *scratch,
                          const ebpo_branch *s, const ebpo_build_detail *detail, int most,
                          ebpo_candidate *out);

#endif
