/* Checksums that files state. Everything that reads one compares it here, so that a fuzzing build
 * (`-Dfuzzing=true`, never installed) can leave all comparisons out: damage would else end at the
 * checksum, and the code behind it would never see any. */
#ifndef EBPO_CORE_SUMS_H
#define EBPO_CORE_SUMS_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include <string.h>

#ifdef EBPO_FUZZING
enum { EBPO_SUMS_COMPARED = 0 };
#else
enum { EBPO_SUMS_COMPARED = 1 };
#endif

static inline bool ebpo_sum_differs(uint32_t stated, uint32_t computed)
{
    return EBPO_SUMS_COMPARED && stated != computed;
}

static inline bool ebpo_digest_differs(const uint8_t stated[32], const uint8_t computed[32])
{
    return EBPO_SUMS_COMPARED && memcmp(stated, computed, 32) != 0;
}

#endif
