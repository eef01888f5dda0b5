/* Loads and stores little-endian numbers, because files are little-endian on every machine. */
#ifndef EBPO_CORE_ENDIAN_H
#define EBPO_CORE_ENDIAN_H

#include <stdint.h>
#include <string.h>

/* Convert a number between the machine's and little-endian byte order. */
#if __BYTE_ORDER__ == __ORDER_LITTLE_ENDIAN__
static inline uint16_t ebpo_little16(uint16_t v) { return v; }
static inline uint32_t ebpo_little32(uint32_t v) { return v; }
static inline uint64_t ebpo_little64(uint64_t v) { return v; }
#else
static inline uint16_t ebpo_little16(uint16_t v) { return __builtin_bswap16(v); }
static inline uint32_t ebpo_little32(uint32_t v) { return __builtin_bswap32(v); }
static inline uint64_t ebpo_little64(uint64_t v) { return __builtin_bswap64(v); }
#endif

static inline uint16_t ebpo_load16(const void *p)
{
    uint16_t v;
    memcpy(&v, p, 2);
    return ebpo_little16(v);
}
static inline uint32_t ebpo_load32(const void *p)
{
    uint32_t v;
    memcpy(&v, p, 4);
    return ebpo_little32(v);
}
static inline uint64_t ebpo_load64(const void *p)
{
    uint64_t v;
    memcpy(&v, p, 8);
    return ebpo_little64(v);
}
static inline void ebpo_store16(void *p, uint16_t v)
{
    v = ebpo_little16(v);
    memcpy(p, &v, 2);
}
static inline void ebpo_store32(void *p, uint32_t v)
{
    v = ebpo_little32(v);
    memcpy(p, &v, 4);
}
static inline void ebpo_store64(void *p, uint64_t v)
{
    v = ebpo_little64(v);
    memcpy(p, &v, 8);
}

#endif
