/* Random numbers that are the same everywhere: SplitMix64 (Steele, Lea, Flood 2014). */
#ifndef EBPO_CORE_RANDOM_H
#define EBPO_CORE_RANDOM_H

#include <stdint.h>

#define EBPO_RANDOM_STEP UINT64_C(0x9e3779b97f4a7c15)

/* Different numbers become numbers that look unrelated. */
static inline uint64_t ebpo_random_mix(uint64_t x)
{
    x = (x ^ x >> 30) * UINT64_C(0xbf58476d1ce4e5b9);
    x = (x ^ x >> 27) * UINT64_C(0x94d049bb133111eb);
    return x ^ x >> 31;
}

/* The next number of a stream; any state is a good one to begin with. */
static inline uint64_t ebpo_random_next(uint64_t *state)
{
    return ebpo_random_mix(*state += EBPO_RANDOM_STEP);
}

/* In [0, 1), from the upper 53 bits. */
static inline double ebpo_random_unit(uint64_t number) { return (double)(number >> 11) * 0x1p-53; }

#endif
