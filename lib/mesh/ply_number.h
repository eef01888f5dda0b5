/* The numbers of a binary body, of either byte order. */
#ifndef EBPO_MESH_PLY_NUMBER_H
#define EBPO_MESH_PLY_NUMBER_H

#include <ebpo/mesh.h>
#include <string.h>

#include "mesh/ply_header.h"

static inline uint64_t ebpo_ply_load(const uint8_t *at, unsigned bytes, bool swap)
{
    uint8_t b1;
    uint16_t b2;
    uint32_t b4;
    uint64_t b8;
    switch (bytes) {
    case 1: memcpy(&b1, at, 1); return b1;
    case 2: memcpy(&b2, at, 2); return swap ? __builtin_bswap16(b2) : b2;
    case 4: memcpy(&b4, at, 4); return swap ? __builtin_bswap32(b4) : b4;
    default: memcpy(&b8, at, 8); return swap ? __builtin_bswap64(b8) : b8;
    }
}

static inline int64_t ebpo_ply_load_integer(const uint8_t *at, ply_type type, bool swap)
{
    uint64_t raw = ebpo_ply_load(at, ebpo_ply_type_bytes(type), swap);
    switch (type) {
    case PLY_INT8: return (int8_t)raw;
    case PLY_INT16: return (int16_t)raw;
    case PLY_INT32: return (int32_t)raw;
    default: return (int64_t)raw;
    }
}

/* The value of an x, y or z at `at` becomes that of vertex `row`. */
void ebpo_ply_store_coordinate(ebpo_mesh *mesh, uint64_t row, const ply_property *property,
                               const uint8_t *at, bool swap);

#endif
