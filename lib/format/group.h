/* The children of one gray node, read by themselves: what a stream in any other order than that of
 * the file takes. */
#ifndef EBPO_FORMAT_GROUP_H
#define EBPO_FORMAT_GROUP_H

#include "format/slice.h"

enum { EBPO_GROUP_CODES = 8 * 255, EBPO_GROUP_BLOCK = EBPO_INDEX_ROWS };

/* What of them is wanted beside the types; what the file does not have is left out. */
enum { EBPO_GROUP_PLANES = 1, EBPO_GROUP_WINDINGS = 2 };

typedef struct ebpo_group {
    uint16_t types;
    uint64_t rank[4]; /* of the group's first node of each type, in its level */
    /* by octant: planes that gray nodes add, stored planes of leaves */
    uint8_t plane_count[8];
    uint32_t codes[EBPO_GROUP_CODES]; /* node after node, valid */
    unsigned code_count;
    int32_t winding[8]; /* by octant; 0 for gray nodes, and in a surface */
} ebpo_group;

/* Group number `group` of a level, that is, of the gray node with that rank in the level before;
 * level 0 has group 0, of which only octant 0 exists. `chunks` are counted ones
 * (ebpo_chunks_make_counted): EBPO_E_LIMIT when that stops the reading; what was read until then
 * stays in memory for another try. Checked as ebpo_chunks_children and ebpo_chunks_planes do. */
EBPO_MUST_USE ebpo_status ebpo_group_read(ebpo_chunks *chunks, int level, uint64_t group,
                                          unsigned wanted, ebpo_group *out, ebpo_error *error);

/* A group of a level, by its number. */
typedef struct ebpo_group_number {
    int level;
    uint64_t group;
} ebpo_group_number;

/* True when the file is far away (its source wants to know what will be read) and the group is not
 * in memory as a whole. */
bool ebpo_group_is_far(ebpo_chunks *chunks, const ebpo_group_number *group, unsigned wanted);

/* For files far away: fetches what the first of these groups takes and is not in memory, and
 * announces with it what the others take, as far as that can be told. Of groups that stand close
 * together (in one block of EBPO_GROUP_BLOCK) one is enough. EBPO_E_LIMIT as ebpo_group_read. */
EBPO_MUST_USE ebpo_status ebpo_group_fetch(ebpo_chunks *chunks, const ebpo_group_number *groups,
                                           unsigned count, unsigned wanted, ebpo_error *error);

#endif
