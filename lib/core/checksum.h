/* Checksums: SHA-256 (nettle) for sources and content, Jenkins' lookup3 for HDF5's metadata, and
 * the comparison of any of them with what a file states. */
#ifndef EBPO_CORE_CHECKSUM_H
#define EBPO_CORE_CHECKSUM_H

#include <nettle/sha2.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include <string.h>

#include <ebpo/base.h>

typedef struct sha256_ctx ebpo_sha256;

void ebpo_sha256_begin(ebpo_sha256 *state);
void ebpo_sha256_add(ebpo_sha256 *state, const void *data, size_t size);
void ebpo_sha256_end(ebpo_sha256 *state, uint8_t digest[32]);
/* Lower-case hexadecimal with a closing zero byte. */
void ebpo_sha256_hex(const uint8_t digest[32], char hex[65]);

/* Checksums that files state. Everything that reads one compares it here, so that a fuzzing build
 * (`-Dfuzzing=true`, never installed) can leave all comparisons out: damage would else end at the
 * checksum, and the code behind it would never see any. */

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

/* Jenkins' lookup3 ("hashlittle", from 0), which guards HDF5's metadata. */

uint32_t ebpo_lookup3(const uint8_t *bytes, size_t size);

#endif
