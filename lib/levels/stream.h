/* Declares the functions that fill in an ebpo_stream_node, which a stream returns (stream.c): its
 * half-spaces and polygons in model coordinates. lib/query/subtree.c also returns such nodes. */
#ifndef EBPO_LEVELS_STREAM_H
#define EBPO_LEVELS_STREAM_H

#include <stdint.h>

#include <ebpo/file.h>
#include <ebpo/stream.h>

#include "geometry/cells.h"
#include "geometry/polytope.h"

/* --- half-spaces --- */

/* Converts the half-space 4096 (n . x) <= d of a plane code, where x is a point in cell coordinates
 * (0 to 1), to the half-space out[0..2] . p <= out[3] in the model's coordinates. The length of
 * out[0..2] is 1, except for an error of 4 ulps. Every real point p of the cell that is in the
 * first half-space is also in the second one. If the coordinates of p are doubles, the second
 * inequality is also true when its left side is evaluated in doubles, in any order. out[3] is
 * greater than necessary by about 1e-14 times the coordinates of the cell. */
void ebpo_plane_to_world(const ebpo_box *box, ebpo_cell cell, const int32_t n[3], int32_t d,
                         double out[4]);

/* --- filling in an ebpo_stream_node: cell, planes, polygons --- */

enum { EBPO_NODE_CODES = 255 }; /* maximum number of plane codes of a node */

/* Buffers to which the pointers in an ebpo_stream_node refer. */
typedef struct ebpo_node_buffers {
    double planes[EBPO_NODE_CODES][4];
    double vertices[EBPO_POLYTOPE_VERTICES][3];
    uint32_t polygon_first[EBPO_POLYTOPE_FACES + 1], corners[EBPO_POLYTOPE_CORNERS];
} ebpo_node_buffers;

/* Begins a node: sets the octcode (locational code), the type, the cell, and the volume if the node
 * is black. All other members are cleared. */
void ebpo_node_begin(ebpo_stream_node *out, const ebpo_box *box, uint64_t octcode,
                     ebpo_node_type type);
/* Decodes `count` plane codes, at most EBPO_NODE_CODES, and adds their planes to the node. */
void ebpo_node_add_planes(ebpo_stream_node *out, const ebpo_box *box, const uint32_t *codes,
                          unsigned count, ebpo_node_buffers *buffers);
/* Adds the polygons and the volume of the node's envelope to the node. `envelope`: in cell
 * coordinates. */
void ebpo_node_add_polygons(ebpo_stream_node *out, const ebpo_box *box,
                            const ebpo_polytope *envelope, ebpo_node_buffers *buffers);

#endif
