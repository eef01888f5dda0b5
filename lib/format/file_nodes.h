/* Reads single nodes and groups of a file through a cache of chunks. A group is the eight children
 * of a gray node (a node with children). The rank of a node is its position among the nodes of its
 * type (gray, leaf, white, black) in its level. */
#ifndef EBPO_FORMAT_FILE_NODES_H
#define EBPO_FORMAT_FILE_NODES_H

#include "format/chunks.h"
#include "geometry/level_nodes.h"

/* Returns EBPO_OK if the node can exist according to the file's header; otherwise EBPO_E_ARGUMENT.
 */
EBPO_MUST_USE ebpo_status ebpo_chunks_check_node(const ebpo_chunks *chunks, const ebpo_node *node,
                                                 ebpo_error *error);

/* Reads the children of a gray node: the group's types, and the rank of the group's first node of
 * each type (indexed by ebpo_node_type) in the next level. If the node is pruned, the types are 0;
 * only files with info.pruned have pruned nodes. */
EBPO_MUST_USE ebpo_status ebpo_chunks_children(ebpo_chunks *chunks, const ebpo_node *gray,
                                               uint16_t *types, uint64_t ranks[4],
                                               ebpo_error *error);

/* Reads the codes of the envelope planes that a gray node adds to those of its ancestors, or that
 * are stored for a leaf. *count is 0 if the file lacks these planes (EBPO_PART_PLANES,
 * EBPO_PART_LEAF_PLANES). */
EBPO_MUST_USE ebpo_status ebpo_chunks_planes(ebpo_chunks *chunks, const ebpo_node *node,
                                             uint32_t codes[EBPO_NODE_PLANES], unsigned *count,
                                             ebpo_error *error);

/* Reads the winding number of a white, black or leaf node (leaf: at the lowest corner). Returns
 * EBPO_E_NOT_SOLID for a surface without EBPO_PART_BORDER. */
EBPO_MUST_USE ebpo_status ebpo_chunks_winding(ebpo_chunks *chunks, const ebpo_node *node,
                                              int32_t *winding, ebpo_error *error);

/* Sets *empty to true if a leaf lists no face, which is possible in files with border_inside. */
EBPO_MUST_USE ebpo_status ebpo_chunks_leaf_empty(ebpo_chunks *chunks, const ebpo_node *leaf,
                                                 bool *empty, ebpo_error *error);

/* Reads the root. Cursors (geometry/cursor.h) whose holder is an ebpo_chunks begin with this node
 * and read other nodes with ebpo_chunks_source. */
EBPO_MUST_USE ebpo_status ebpo_chunks_root(ebpo_chunks *chunks, ebpo_node *root, ebpo_error *error);

extern const ebpo_node_source ebpo_chunks_source;

/* --- groups: the children of one gray node, for streams in any order --- */

enum {
    EBPO_GROUP_CODES = 8 * 255,        /* maximum number of planes of a group */
    EBPO_GROUP_BLOCK = EBPO_INDEX_ROWS /* adjacent groups whose chunks are fetched together */
};

/* Bits of `wanted`: data that a caller requests in addition to the types. Data that the file lacks
 * are omitted. */
enum { EBPO_GROUP_PLANES = 1, EBPO_GROUP_WINDINGS = 2 };

typedef struct ebpo_group {
    uint16_t types;
    uint64_t rank[4]; /* rank of the group's first node of each type */
    /* by octant: number of planes that a gray node adds, or that are stored for a leaf */
    uint8_t plane_count[8];
    uint32_t codes[EBPO_GROUP_CODES]; /* [code_count] valid plane codes, by octant */
    unsigned code_count;
    int32_t winding[8]; /* by octant; 0 for gray nodes and in surfaces */
} ebpo_group;

/* Reads group number `group` of a level: the children of the gray node with that rank in the
 * previous level. Level 0 has group 0, with octant 0 only. `chunks` must be counted
 * (ebpo_chunks_make_counted). Returns EBPO_E_LIMIT when the limit of bytes is reached; chunks read
 * so far stay in memory for the next attempt. Values are checked as in ebpo_chunks_children and
 * ebpo_chunks_planes. */
EBPO_MUST_USE ebpo_status ebpo_group_read(ebpo_chunks *chunks, int level, uint64_t group,
                                          unsigned wanted, ebpo_group *out, ebpo_error *error);

/* A group of a level, by its index. */
typedef struct ebpo_group_number {
    int level;
    uint64_t group;
} ebpo_group_number;

/* Returns true if the file's source uses prefetch hints (remote files) and memory lacks wanted data
 * of the group. */
bool ebpo_group_is_far(ebpo_chunks *chunks, const ebpo_group_number *group, unsigned wanted);

/* Fetches the missing chunks of the first group from a remote file. Prefetches the missing chunks
 * of the other groups at the same time, if memory already has the data that locate these chunks.
 * The chunks of EBPO_GROUP_BLOCK adjacent groups are fetched together, so one of these groups in
 * `groups` is sufficient. Returns EBPO_E_LIMIT like ebpo_group_read. */
EBPO_MUST_USE ebpo_status ebpo_group_fetch(ebpo_chunks *chunks, const ebpo_group_number *groups,
                                           unsigned count, unsigned wanted, ebpo_error *error);

#endif
