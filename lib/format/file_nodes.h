/* Single nodes and groups of siblings of a file, read through a cache of chunks. */
#ifndef EBPO_FORMAT_FILE_NODES_H
#define EBPO_FORMAT_FILE_NODES_H

#include "format/chunks.h"
#include "geometry/level_nodes.h"

/* A node that the file has, as far as the head tells; else EBPO_E_ARGUMENT. */
EBPO_MUST_USE ebpo_status ebpo_chunks_check_node(const ebpo_chunks *chunks, const ebpo_node *node,
                                                 ebpo_error *error);

/* The children of a gray node: the group's types, and the rank of the group's first node of each
 * type (indexed by ebpo_node_type) in level + 1. Of a pruned node the types are 0 (and the file's
 * info says `pruned`). */
EBPO_MUST_USE ebpo_status ebpo_chunks_children(ebpo_chunks *chunks, const ebpo_node *gray,
                                               uint16_t *types, uint64_t ranks[4],
                                               ebpo_error *error);

/* Codes of the planes that a gray node adds, or that are stored for a leaf; *count is 0 without the
 * part. */
EBPO_MUST_USE ebpo_status ebpo_chunks_planes(ebpo_chunks *chunks, const ebpo_node *node,
                                             uint32_t codes[EBPO_NODE_PLANES], unsigned *count,
                                             ebpo_error *error);

/* Winding number that the file gives for a white, black or leaf node (leaf: lowest corner). Solids
 * only. */
EBPO_MUST_USE ebpo_status ebpo_chunks_winding(ebpo_chunks *chunks, const ebpo_node *node,
                                              int32_t *winding, ebpo_error *error);

/* For cursors (geometry/cursor.h): the root; the holder is an ebpo_chunks. */
EBPO_MUST_USE ebpo_status ebpo_chunks_root(ebpo_chunks *chunks, ebpo_node *root, ebpo_error *error);

extern const ebpo_node_source ebpo_chunks_source;

/* --- groups: the children of one gray node, for streams that do not follow the file's order --- */

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
