/* Computes checksums: SHA-256 (by the library nettle) of source meshes and of the content of files,
 * and Jenkins' lookup3 of HDF5 metadata. Compares checksums with the values that a file states. */
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
/* Writes lower-case hexadecimal digits and a terminating zero byte. */
void ebpo_sha256_hex(const uint8_t digest[32], char hex[65]);

/* ebpo_sum_differs and ebpo_digest_differs compare a computed checksum with the checksum that a
 * file states. All comparisons of checksums are in these two functions, so that a fuzzing build
 * (`-Dfuzzing=true`, never installed) can skip them. If the fuzzing build compared checksums, the
 * input of the fuzzer would be rejected by its checksum, and would never reach the code that the
 * fuzzer tests. */

#ifdef EBPO_FUZZING
enum { EBPO_CHECKSUMS_COMPARED = 0 };
#else
enum { EBPO_CHECKSUMS_COMPARED = 1 };
#endif

static inline bool ebpo_sum_differs(uint32_t stated, uint32_t computed)
{
    return EBPO_CHECKSUMS_COMPARED && stated != computed;
}

static inline bool ebpo_digest_differs(const uint8_t stated[32], const uint8_t computed[32])
{
    return EBPO_CHECKSUMS_COMPARED && memcmp(stated, computed, 32) != 0;
}

/* Returns Jenkins' lookup3 ("hashlittle" with the initial value 0), the checksum of HDF5 metadata.
 */
uint32_t ebpo_lookup3(const uint8_t *bytes, size_t size);

#endif
