/* Provides hash tables with open addressing, and random numbers. A table is an array whose number
 * of slots is a power of two; entries are never removed. The user of a table decides what a slot
 * holds: a key, an index, a count. */
#ifndef EBPO_CORE_HASH_H
#define EBPO_CORE_HASH_H

#include <stddef.h>
#include <stdint.h>

/* Returns the hash of a key: mixes all bits of the key into the low bits, which choose the slot. */
static inline uint64_t ebpo_hash_number(uint64_t key)
{
    key = (key ^ key >> 31) * UINT64_C(0x9e3779b97f4a7c15);
    return key ^ key >> 32;
}

/* Returns the hash of a key of three numbers. */
static inline uint64_t ebpo_hash_three(const uint64_t key[3])
{
    return ebpo_hash_number(ebpo_hash_number(ebpo_hash_number(key[0]) + key[1]) + key[2]);
}

/* Extends the FNV-1a hash `hash` of earlier bytes by these bytes, and returns the result. For the
 * first bytes, `hash` is EBPO_HASH_BYTES_BEGIN. */
#define EBPO_HASH_BYTES_BEGIN UINT64_C(0xcbf29ce484222325)
static inline uint64_t ebpo_hash_bytes(uint64_t hash, const void *bytes, size_t size)
{
    for (size_t i = 0; i < size; i++)
        hash = (hash ^ ((const uint8_t *)bytes)[i]) * UINT64_C(0x100000001b3);
    return hash;
}

/* Returns the number of slots of a table: the smallest power of two that is at least `least` and at
 * least 16. A table becomes slow if more than three quarters of the slots are in use. */
static inline uint64_t ebpo_hash_slots(uint64_t least)
{
    uint64_t slots = 16;
    while (slots < least)
        slots *= 2;
    return slots;
}

/* Sets `at` to the slot of a key with this hash, or to the free slot for a new key. The table has
 * mask + 1 slots. `found`: an expression with `at` that is true if slot `at` is free or holds the
 * key. At least one slot must be free. */
#define EBPO_HASH_FIND(at, hash, mask, found)                          \
    for ((at) = (hash) & (mask); !(found); (at) = ((at) + 1) & (mask)) \
    continue

/* Random numbers that are the same on all machines: SplitMix64 (Steele, Lea, Flood 2014). */

#define EBPO_RANDOM_STEP UINT64_C(0x9e3779b97f4a7c15)

/* Maps a number to a number that looks random; different numbers have different results. */
static inline uint64_t ebpo_random_mix(uint64_t x)
{
    x = (x ^ x >> 30) * UINT64_C(0xbf58476d1ce4e5b9);
    x = (x ^ x >> 27) * UINT64_C(0x94d049bb133111eb);
    return x ^ x >> 31;
}

/* Returns the next number of a stream; any initial state is suitable. */
static inline uint64_t ebpo_random_next(uint64_t *state)
{
    return ebpo_random_mix(*state += EBPO_RANDOM_STEP);
}

/* Converts a random number to a double in [0, 1): its upper 53 bits. */
static inline double ebpo_random_unit(uint64_t number) { return (double)(number >> 11) * 0x1p-53; }

#endif
