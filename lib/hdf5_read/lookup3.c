#include "hdf5_read/lookup3.h"

#include "core/endian.h"

static uint32_t rotate(uint32_t x, int k) { return x << k | x >> (32 - k); }

static void mix(uint32_t s[3])
{
    static const uint8_t turn[6] = { 4, 6, 8, 16, 19, 4 };
    for (int i = 0; i < 6; i++) {
        uint32_t *a = &s[i % 3], *b = &s[(i + 1) % 3], *c = &s[(i + 2) % 3];
        *a = (*a - *c) ^ rotate(*c, turn[i]);
        *c += *b;
    }
}

static uint32_t finish(uint32_t s[3])
{
    static const uint8_t turn[7] = { 14, 11, 25, 16, 4, 14, 24 };
    for (int i = 0; i < 7; i++) {
        uint32_t *x = &s[(i + 2) % 3], y = s[(i + 1) % 3];
        *x = (*x ^ y) - rotate(y, turn[i]);
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
        mix(s);
    }
    if (size == 0)
        return s[2];
    memcpy(last, bytes, size);
    for (int i = 0; i < 3; i++)
        s[i] += ebpo_load32(last + 4 * (ptrdiff_t)i);
    return finish(s);
}
