#include "core/sha256.h"

void ebpo_sha256_begin(ebpo_sha256 *state) { sha256_init(state); }

void ebpo_sha256_add(ebpo_sha256 *state, const void *data, size_t size)
{
    sha256_update(state, size, data);
}

void ebpo_sha256_end(ebpo_sha256 *state, uint8_t digest[32]) { sha256_digest(state, 32, digest); }

void ebpo_sha256_hex(const uint8_t digest[32], char hex[65])
{
    static const char digits[] = "0123456789abcdef";
    for (int i = 0; i < 32; i++) {
        hex[2 * i] = digits[digest[i] >> 4];
        hex[2 * i + 1] = digits[digest[i] & 15];
    }
    hex[64] = 0;
}
