/* Computes checksums. SHA-256 (by the library nettle) is for source meshes and for the content of
 * files. lookup3 ("hashlittle" with the initial value 0, Bob Jenkins, 2006) is for HDF5 metadata.
 * Comparisons of checksums are in checksum.h, because a fuzzing build skips them. */
#include "core/checksum.h"
#include "core/endian.h"

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

static uint32_t rotate_left(uint32_t x, int k) { return x << k | x >> (32 - k); }

/* Mixes the state after 12 bytes. */
static void mix_state(uint32_t s[3])
{
    static const uint8_t rotation[6] = { 4, 6, 8, 16, 19, 4 };
    for (int i = 0; i < 6; i++) {
        uint32_t *a = &s[i % 3], *b = &s[(i + 1) % 3], *c = &s[(i + 2) % 3];
        *a = (*a - *c) ^ rotate_left(*c, rotation[i]);
        *c += *b;
    }
}

/* Mixes the state for the last time, and returns the hash. */
static uint32_t finish_state(uint32_t s[3])
{
    static const uint8_t rotation[7] = { 14, 11, 25, 16, 4, 14, 24 };
    for (int i = 0; i < 7; i++) {
        uint32_t *x = &s[(i + 2) % 3], y = s[(i + 1) % 3];
        *x = (*x ^ y) - rotate_left(y, rotation[i]);
    }
    return s[2];
}

uint32_t ebpo_lookup3(const uint8_t *bytes, size_t size)
{
    uint32_t start = 0xdeadbeef + (uint32_t)size, s[3] = { start, start, start };
    uint8_t last[12] = { 0 };
    for (; size > 12; bytes += 12, size -= 12) {
        for (int i = 0; i < 3; i++)
            s[i] += ebpo_load32(bytes + 4 * (ptrdiff_t)i);
        mix_state(s);
    }
    if (size == 0)
        return s[2];
    memcpy(last, bytes, size);
    for (int i = 0; i < 3; i++)
        s[i] += ebpo_load32(last + 4 * (ptrdiff_t)i);
    return finish_state(s);
}
