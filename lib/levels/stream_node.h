/* Filling in an ebpo_stream_node: cell, planes, polygons. */
#ifndef EBPO_LEVELS_STREAM_NODE_H
#define EBPO_LEVELS_STREAM_NODE_H

#include <ebpo/stream.h>

#include "geometry/cell.h"
#include "geometry/polytope.h"

enum { EBPO_NODE_CODES = 255 };

/* What a node lends. */
typedef struct ebpo_node_buffers {
    double planes[EBPO_NODE_CODES][4];
    double vertices[EBPO_POLYTOPE_VERTICES][3];
    uint32_t polygon_first[EBPO_POLYTOPE_FACES + 1], corners[EBPO_POLYTOPE_CORNERS];
} ebpo_node_buffers;

/* Octcode, type, cell; a black node's volume. */
void ebpo_node_begin(ebpo_stream_node *out, const ebpo_box *box, uint64_t octcode,
                     ebpo_node_type type);
/* At most EBPO_NODE_CODES codes. */
void ebpo_node_add_planes(ebpo_stream_node *out, const ebpo_box *box, const uint32_t *codes,
                          unsigned count, ebpo_node_buffers *capacity);
void ebpo_node_add_polygons(ebpo_stream_node *out, const ebpo_box *box,
                            const ebpo_polytope *envelope, ebpo_node_buffers *capacity);

#endif
