/* From a cell's coordinates to the model's: half-spaces and polygons. */
#ifndef EBPO_LEVELS_STREAM_H
#define EBPO_LEVELS_STREAM_H

#include <stdint.h>

#include <ebpo/file.h>
#include <ebpo/stream.h>

#include "geometry/cells.h"
#include "geometry/polytope.h"

/* The code's half-space 4096 (n . xi) <= d as out[0..2] . p <= out[3] with a unit normal (to 4
 * ulps): every real point p of the cell that satisfies the code satisfies this, and also when the
 * left side is evaluated in doubles in any order, for double p. The offset is larger than need be
 * by about 1e-14 of the cell's coordinates. */
void ebpo_plane_to_world(const ebpo_box *box, ebpo_cell cell, const int32_t n[3], int32_t d,
                         double out[4]);

/* Vertices of the polytope, rounded; those on the cell's walls get the walls' own coordinates, so
 * that neighbours agree to the last bit. */
void ebpo_polytope_to_world(const ebpo_polytope *p, const ebpo_box *box, ebpo_cell cell,
                            double (*out)[3]);

/* Filling in an ebpo_stream_node: cell, planes, polygons. */

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

/* Walking the nodes of one level in octcode order, down from the root through the levels kept.
 * Within a level, depth-first order visits groups, nodes of each type, and planes in the order in
 * which they are stored: so running counts do, and no table of sums is needed. */

typedef struct ebpo_level_walk_node {
    ebpo_octcode octcode;
    ebpo_node_type type;
    uint64_t rank;         /* among the nodes of its type in the level */
    const uint32_t *codes; /* its own planes */
    unsigned code_count;
} ebpo_level_walk_node;

typedef struct ebpo_level_walk {
    /* [target + 1] lent; of those above the target only types, plane counts and planes are used */
    const ebpo_level *level;
    int target, depth;
    bool pruned; /* the file is a subset: empty groups hold no nodes */
    struct {
        uint64_t group, rank[4], plane, leaf_plane; /* so many were passed in this level */
        unsigned octant;                            /* next one of the group */
        /* the node last passed: in levels above `depth` the ancestor */
        ebpo_level_walk_node node;
    } at[EBPO_LEVELS_MAX];
} ebpo_level_walk;

void ebpo_level_walk_begin(ebpo_level_walk *walk, const ebpo_level *level, int target, bool pruned);
/* The next node of the target level; false after the last. */
bool ebpo_level_walk_next(ebpo_level_walk *walk, ebpo_level_walk_node *out);

/* Envelope of the node that ebpo_level_walk_next gave last, in coordinates of its cell; gray nodes
 * and leaves: from the cube down, cut by the planes of all ancestors and its own. Black nodes: the
 * cube. Lent until the next call with these envelopes. */
const ebpo_polytope *ebpo_level_walk_envelope(const ebpo_level_walk *walk,
                                              const ebpo_level_walk_node *node,
                                              ebpo_envelope_stack *envelopes);

#endif
