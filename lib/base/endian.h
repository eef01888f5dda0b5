/* Little-endian loads and stores: files are little-endian on every machine. */
#ifndef EBPO_BASE_ENDIAN_H
#define EBPO_BASE_ENDIAN_H

#include <endian.h>
#include <stdint.h>
#include <string.h>

static inline uint16_t ebpo_load16(const void *p)
{
    uint16_t v;
    memcpy(&v, p, 2);
    return le16toh(v);
}
static inline uint32_t ebpo_load32(const void *p)
{
    uint32_t v;
    memcpy(&v, p, 4);
    return le32toh(v);
}
static inline uint64_t ebpo_load64(const void *p)
{
    uint64_t v;
    memcpy(&v, p, 8);
    return le64toh(v);
}
static inline void ebpo_store16(void *p, uint16_t v)
{
    v = htole16(v);
    memcpy(p, &v, 2);
}
static inline void ebpo_store32(void *p, uint32_t v)
{
    v = htole32(v);
    memcpy(p, &v, 4);
}
static inline void ebpo_store64(void *p, uint64_t v)
{
    v = htole64(v);
    memcpy(p, &v, 8);
}

#endif
