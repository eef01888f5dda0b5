#include "geometry/octcode.h"

/* Spreads the low 21 bits of x to every third bit, by halves, quarters and so on. */
static inline uint64_t spread(uint64_t x)
{
    x &= 0x1fffff;
    x = (x | x << 32) & 0x001f00000000ffff;
    x = (x | x << 16) & 0x001f0000ff0000ff;
    x = (x | x << 8) & 0x100f00f00f00f00f;
    x = (x | x << 4) & 0x10c30c30c30c30c3;
    x = (x | x << 2) & 0x1249249249249249;
    return x;
}

/* Gathers every third bit; the inverse of spread. */
static inline uint32_t gather(uint64_t x)
{
    x &= 0x1249249249249249;
    x = (x | x >> 2) & 0x10c30c30c30c30c3;
    x = (x | x >> 4) & 0x100f00f00f00f00f;
    x = (x | x >> 8) & 0x001f0000ff0000ff;
    x = (x | x >> 16) & 0x001f00000000ffff;
    x = (x | x >> 32) & 0x1fffff;
    return (uint32_t)x;
}

ebpo_octcode ebpo_octcode_of_cell(ebpo_cell cell)
{
    return (uint64_t)1 << 3 * cell.level | spread(cell.at[0]) | spread(cell.at[1]) << 1 |
           spread(cell.at[2]) << 2;
}

ebpo_cell ebpo_cell_of_octcode(ebpo_octcode code)
{
    int level = ebpo_octcode_level(code);
    uint64_t path = code ^ (uint64_t)1 << 3 * level;
    return (ebpo_cell){ level, { gather(path), gather(path >> 1), gather(path >> 2) } };
}
