/* Node types in groups of eight siblings: a 16-bit word each, two bits for each octant, octant 0
 * lowest. Level 0 has one group, of which only octant 0 exists. */
#ifndef EBPO_GEOMETRY_NODE_TYPES_H
#define EBPO_GEOMETRY_NODE_TYPES_H

#include <ebpo/file.h>

/* Octants that a group of this level has. */
static inline unsigned ebpo_group_octants(int level) { return level ? 8 : 1; }

static inline ebpo_node_type ebpo_group_type(uint16_t types, unsigned octant)
{
    return (ebpo_node_type)(types >> 2 * octant & 3);
}

/* The word of a group in which only this octant is not white. */
static inline uint16_t ebpo_group_of(ebpo_node_type type, unsigned octant)
{
    return (uint16_t)((unsigned)type << 2 * octant);
}

static inline uint16_t ebpo_group_set(uint16_t types, unsigned octant, ebpo_node_type type)
{
    return (uint16_t)((types & ~(3u << 2 * octant)) | ebpo_group_of(type, octant));
}

/* Bit 2i is set when octant i is a leaf or gray: when faces touch it. */
static inline unsigned ebpo_group_filled(uint16_t types) { return types >> 1 & 0x5555u; }

/* Octants below `octants` (at most 8) that are of this type: with an octant's own number, its rank
 * among its siblings of the type. */
static inline unsigned ebpo_group_count(uint16_t types, ebpo_node_type type, unsigned octants)
{
    unsigned differs = types ^ 0x5555u * (unsigned)type;
    unsigned bits = ~(differs | differs >> 1) & 0x5555u & ((1u << 2 * octants) - 1);
    bits = (bits & 0x3333) + (bits >> 2 & 0x3333);
    bits = (bits + (bits >> 4)) & 0x0f0f;
    return (bits + (bits >> 8)) & 0xf;
}

/* Nodes of each type in groups of eight, 16 bits each, little-endian, in any place of memory. */
void ebpo_groups_count(const void *types, uint64_t groups, uint64_t counts[4]);

/* The same for groups of one level; level 0 has only its root. */
static inline void ebpo_groups_count_at(int level, const uint16_t *types, uint64_t groups,
                                        uint64_t counts[4])
{
    if (level)
        ebpo_groups_count(types, groups, counts);
    else
        for (int type = 0; type < 4; type++)
            counts[type] = ebpo_group_count(types[0], (ebpo_node_type)type, 1);
}

#endif
