/* SHA-256 (nettle): source digests and content checksums. */
#ifndef EBPO_CORE_SHA256_H
#define EBPO_CORE_SHA256_H

#include <ebpo/base.h>
#include <nettle/sha2.h>

typedef struct sha256_ctx ebpo_sha256;

void ebpo_sha256_begin(ebpo_sha256 *state);
void ebpo_sha256_add(ebpo_sha256 *state, const void *data, size_t size);
void ebpo_sha256_end(ebpo_sha256 *state, uint8_t digest[32]);
/* Lower-case hexadecimal with a closing zero byte. */
void ebpo_sha256_hex(const uint8_t digest[32], char hex[65]);

#endif
