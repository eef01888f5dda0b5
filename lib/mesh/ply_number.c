#include "core/strict_fp.h"

#include "mesh/ply_number.h"

static float load_float(const uint8_t *at, bool swap)
{
    uint32_t raw = (uint32_t)ebpo_ply_load(at, 4, swap);
    float value;
    memcpy(&value, &raw, sizeof value);
    return value;
}

static double load_number(const uint8_t *at, ply_type type, bool swap)
{
    if (type == PLY_FLOAT32)
        return (double)load_float(at, swap);
    if (type != PLY_FLOAT64)
        return (double)ebpo_ply_load_integer(at, type, swap);
    uint64_t raw = ebpo_ply_load(at, 8, swap);
    double value;
    memcpy(&value, &raw, sizeof value);
    return value;
}

/* Floats go through as bits: not even the payload of a NaN changes. */
void ebpo_ply_store_coordinate(ebpo_mesh *mesh, uint64_t row, const ply_property *property,
                               const uint8_t *at, bool swap)
{
    uint64_t place = 3 * row + (uint64_t)(property->role - PLY_ROLE_X);
    if (mesh->xyz64) {
        mesh->xyz64[place] = load_number(at, property->type, swap);
    } else {
        uint32_t raw = (uint32_t)ebpo_ply_load(at, 4, swap);
        memcpy(&mesh->xyz32[place], &raw, sizeof raw);
    }
}
