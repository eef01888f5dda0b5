/* Defines the builder's state, which its stages share. Before the stages, vertices and faces are
 * arranged along the Morton curve. A piece is a subtree that one thread builds; the top is the
 * nodes above all pieces. The stages are:
 *   1. The top of the tree:
 *      - partition assigns faces to the pieces into which the tree is cut;
 *      - corner_windings computes winding numbers;
 *      - propose chooses planes, if the selection works from the leaves up;
 *      - envelopes computes the envelopes above the pieces.
 *   2. Piece by piece, on all cores:
 *      - partition assigns faces to cells;
 *      - face_numbers numbers the faces;
 *      - emit_levels computes envelopes and the piece's part of each level;
 *      - pieces moves these results to the store.
 *   3. The entire tree:
 *      - emit_levels joins the levels' arrays;
 *      - face_numbers computes the final numbers of the vertices.
 *
 * A piece gets data about other pieces only from the top. Its only results are its part of the
 * levels and the final indices of its faces. */
#ifndef EBPO_CONSTRUCT_BUILDER_H
#define EBPO_CONSTRUCT_BUILDER_H

#include <stdatomic.h>

#include <ebpo/build.h>

#include "core/workspace.h"
#include "geometry/cells.h"
#include "mesh/mesh_parts.h"
#include "geometry/level_nodes.h"
#include "construct/planes.h"

#define EBPO_NO_NUMBER UINT32_MAX
#define EBPO_NO_VERTEX UINT64_MAX

/* A node of a subtree under construction. An empty node becomes white or black after the winding
 * numbers are computed. */
typedef struct ebpo_build_node {
    uint8_t type;   /* ebpo_node_type; empty nodes are EBPO_WHITE */
    uint32_t child; /* gray: index of the first of eight children */
    /* gray node or leaf: index in `details`; leaf of the top: index of a piece in ebpo_builder.sub
     */
    uint32_t detail;
} ebpo_build_node;

typedef struct ebpo_build_detail {
    /* corner differences: winding numbers of the corners minus the winding number of corner 0 */
    int32_t delta[8];
    /* range in `entries`: list of the leaf, or lists of all leaves below the gray node; in the top:
     * range of the pieces below the gray node */
    uint64_t entry_begin, entry_end;
    /* gray: range in `crossing`: faces that are not entirely inside the cell */
    uint64_t cross_begin, cross_end;
    uint32_t first, new_count; /* leaf: final index of its first new face; number of new faces */
} ebpo_build_detail;

/* A piece, or the top of the tree. Its nodes are stored depth first; nodes[0] is the root. */
typedef struct ebpo_branch {
    ebpo_cell cell;
    /* [list_count] indices of the faces that touch the cell, ascending; NULL for the top, whose
     * `crossing` has indices of faces */
    uint32_t *list;
    uint64_t list_count;
    uint8_t *fresh;              /* bit i: no piece before this one lists face list[i] */
    uint64_t fresh_count, first; /* number of these fresh faces; final index of the first one */
    ebpo_build_node *nodes;
    uint64_t node_count, node_capacity;
    ebpo_build_detail *details;
    uint64_t detail_count, detail_capacity;
    uint32_t *entries; /* indices in `list` */
    uint64_t entry_count, entry_capacity;
    uint32_t *crossing; /* indices in `list` */
    uint64_t cross_count, cross_capacity;
    int32_t winding; /* winding number at the lowest corner */
    /* type and corner differences of nodes[0]: kept longer than the nodes */
    uint8_t root_type;
    int32_t root_delta[8];
    struct ebpo_proposals *proposals; /* NULL: planes are chosen on the way down */
    struct ebpo_piece_level *out;     /* [EBPO_LEVELS_MAX] results of ebpo_emit_piece */
    ebpo_polytope *above;             /* the parent's envelope cut to this cell */
    ebpo_workspace *workspace;        /* the builder's workspace, for all arrays */
} ebpo_branch;

/* Boxes around ranges of vertices, in a hierarchy: a block has 16 vertices, or 16 blocks of the
 * level below. */
enum { EBPO_BOUNDS_FAN = 16, EBPO_BOUNDS_LEVELS = 8 };
typedef struct ebpo_bounds {
    double (*box[EBPO_BOUNDS_LEVELS])[2][3]; /* box[k][i]: box of vertices [i * 16^(k+1), ...) */
    uint64_t count[EBPO_BOUNDS_LEVELS];
    int levels;
    ebpo_workspace *workspace; /* the builder's workspace */
} ebpo_bounds;

typedef struct ebpo_builder {
    const ebpo_build_options *options;
    ebpo_workspace *workspace;
    unsigned threads;
    bool solid;
    int max_level;
    ebpo_box box;
    const ebpo_mesh *mesh; /* arranged along the curve */
    uint64_t vertex_count; /* number of referenced vertices, which come first */
    uint64_t face_count;
    const uint64_t *key; /* octcode of the vertex's cell at box.grid_level, ascending */
    const uint32_t (*face)[3];
    ebpo_bounds bounds;
    uint32_t *number; /* [face] final index; a piece sets the indices of its fresh faces */
    /* the nodes above the pieces; `detail` of a leaf of the top is the index of a piece in `sub` */
    ebpo_branch top;
    ebpo_branch *sub; /* [sub_count] the pieces */
    uint64_t sub_count, sub_capacity;
    _Atomic uint64_t leaf_count, entry_count; /* in all pieces so far */
    struct ebpo_top_envelope *top_envelope;   /* envelopes of the top's gray nodes, by detail */
    struct ebpo_store *store;
    const struct ebpo_thesis_run *thesis; /* NULL: a tree for a file is built */
} ebpo_builder;

static inline void ebpo_build_triangle(const ebpo_builder *b, uint32_t face, ebpo_triangle *out)
{
    for (int i = 0; i < 3; i++)
        ebpo_mesh_position(b->mesh, b->face[face][i], out->corner[i]);
}

/* Returns the index of a face from an entry of a piece, or from `crossing` of the top. */
static inline uint32_t ebpo_branch_face(const ebpo_branch *s, uint32_t entry)
{
    return s->list ? s->list[entry] : entry;
}

static inline void ebpo_branch_triangle(const ebpo_builder *b, const ebpo_branch *s, uint32_t entry,
                                        ebpo_triangle *out)
{
    ebpo_build_triangle(b, ebpo_branch_face(s, entry), out);
}

#endif
