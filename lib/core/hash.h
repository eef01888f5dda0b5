/* Hash tables, one way for all: open addressing in an array of a power of two of slots, nothing is
 * taken out. What a slot holds is its user's: a key, the number of what has the key, a count. And
 * random numbers. */
#ifndef EBPO_CORE_HASH_H
#define EBPO_CORE_HASH_H

#include <stddef.h>
#include <stdint.h>

/* All bits of the key show in the low bits, those that choose the slot. */
static inline uint64_t ebpo_hash_number(uint64_t key)
{
    key = (key ^ key >> 31) * UINT64_C(0x9e3779b97f4a7c15);
    return key ^ key >> 32;
}

static inline uint64_t ebpo_hash_three(const uint64_t key[3])
{
    return ebpo_hash_number(ebpo_hash_number(ebpo_hash_number(key[0]) + key[1]) + key[2]);
}

/* FNV-1a of bytes, continued from `hash`, which is EBPO_HASH_BYTES_BEGIN for the first ones. */
#define EBPO_HASH_BYTES_BEGIN UINT64_C(0xcbf29ce484222325)
static inline uint64_t ebpo_hash_bytes(uint64_t hash, const void *bytes, size_t size)
{
    for (size_t i = 0; i < size; i++)
        hash = (hash ^ ((const uint8_t *)bytes)[i]) * UINT64_C(0x100000001b3);
    return hash;
}

/* The number of slots: the least power of two that is not below `least`, and 16 at least. A table
 * that is fuller than three quarters gets slow. */
static inline uint64_t ebpo_hash_slots(uint64_t least)
{
    uint64_t slots = 16;
    while (slots < least)
        slots *= 2;
    return slots;
}

/* Sets `at` to the slot that a key of this hash has or would get, of mask + 1 slots. `found`, an
 * expression in `at`: the slot is free, or holds the key. One slot has to be free. */
#define EBPO_HASH_FIND(at, hash, mask, found)                          \
    for ((at) = (hash) & (mask); !(found); (at) = ((at) + 1) & (mask)) \
    continue

/* Random numbers that are the same everywhere: SplitMix64 (Steele, Lea, Flood 2014). */

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
