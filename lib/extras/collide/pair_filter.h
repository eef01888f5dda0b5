/* Pairs of faces eight at a time, in floats: what is certain of how they lie to each other, proved
 * in docs/develop/collision.md. Compiled twice on x86-64, for any processor and for those with
 * AVX2, with the same results. Pure functions, any thread. */
#ifndef EBPO_COLLIDE_PAIR_FILTER_H
#define EBPO_COLLIDE_PAIR_FILTER_H

#include "core/cpu.h"
#include <stdint.h>

/* A bit for each pair; those in neither are open. */
typedef struct ebpo_pair_masks {
    uint8_t apart;    /* EBPO_PAIR_APART */
    uint8_t crossing; /* EBPO_PAIR_CROSSING */
} ebpo_pair_masks;

/* Pairs of two blocks that are not certainly apart: lane of a, then lane of b << 3, and
 * EBPO_CERTAINLY_CROSSING; by the lane of b, then of a. */
enum { EBPO_CERTAINLY_CROSSING = 64 };
typedef struct ebpo_block_pairs {
    uint8_t pair[64];
    unsigned count;
} ebpo_block_pairs;

/* Faces are [9][8] floats: x, y, z of corner 0, of corner 1, of corner 2, of eight faces each. Each
 * is within `error` (0 or more) of the exact coordinate less that of a point, the same one for both
 * faces of a pair, and at most 2^36 in size. Lanes without a face may hold anything, and their bits
 * mean nothing. */
typedef struct ebpo_pair_kernels {
    /* One face, [9], with each of eight. */
    ebpo_pair_masks (*one)(const float *a, const float *b, float error);
    /* Lane i of a with lane i of b. */
    ebpo_pair_masks (*eight)(const float *a, const float *b, float error);
    /* Each face of a with each of b, where they are among `lanes`. */
    void (*blocks)(const float *a, unsigned lanes_a, const float *b, unsigned lanes_b, float error,
                   ebpo_block_pairs *out);
} ebpo_pair_kernels;

EBPO_KERNELS(ebpo_pair_kernels, ebpo_pair_kernels)

#endif
