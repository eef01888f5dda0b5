/* SPDX-License-Identifier: MIT
 * Random numbers of mutators: the same for the same seed. */
#ifndef MUTATE_H
#define MUTATE_H

#include <stdint.h>

static inline uint64_t fuzz_next(uint64_t *state)
{
    *state += UINT64_C(0x9e3779b97f4a7c15);
    uint64_t z = *state;
    z = (z ^ (z >> 30)) * UINT64_C(0xbf58476d1ce4e5b9);
    z = (z ^ (z >> 27)) * UINT64_C(0x94d049bb133111eb);
    return z ^ (z >> 31);
}

/* Returns 0 .. below - 1; 0 when there is none. */
static inline uint32_t fuzz_below(uint64_t *state, uint32_t below)
{
    uint64_t n = fuzz_next(state);
    return below ? (uint32_t)(n % below) : 0;
}

#endif
