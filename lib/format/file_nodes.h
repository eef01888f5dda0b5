/* Nodes of a file, read through its chunks. */
#ifndef EBPO_FORMAT_FILE_NODES_H
#define EBPO_FORMAT_FILE_NODES_H

#include "format/chunks.h"
#include "geometry/node_source.h"

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

#endif
