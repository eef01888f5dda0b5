/* Defines the builder's state, which its stages share.
 *
 * Terms: a piece is a subtree that one thread builds. The top is the set of the nodes above all
 * pieces. A branch is the top or a piece. The fresh faces of a piece are the faces in its list that
 * no earlier piece lists. The index of a face or vertex along the curve is its index in the
 * arranged mesh. The final index of a face or vertex is its index in the result and in the file.
 * The corner differences of a cell are the winding numbers at its eight corners minus the winding
 * number at corner 0, the lowest corner. In the code, `b` is the builder and `s` is a branch.
 *
 * Before the stages, vertices and faces are arranged along the Morton curve (arrange.h). The stages
 * are:
 *   1. The top of the tree:
 *      - partition assigns faces to the pieces into which the tree is cut;
 *      - corner_windings computes winding numbers;
 *      - propose chooses planes, if the selection of planes works from the leaves up;
 *      - envelopes computes the envelopes above the pieces.
 *   2. Piece by piece, on all cores:
 *      - partition assigns faces to cells;
 *      - face_numbers assigns final indices to the piece's fresh faces;
 *      - emit_levels computes envelopes and the piece's part of each level;
 *      - pieces moves these results to the store, which holds them until stage 3.
 *   3. The entire tree:
 *      - emit_levels joins the levels' arrays;
 *      - face_numbers computes the final indices of the vertices.
 *
 * A piece gets data about other pieces only from the top. Its only results are its part of the
 * levels and the final indices of its fresh faces. */
#ifndef EBPO_CONSTRUCT_BUILDER_H
#define EBPO_CONSTRUCT_BUILDER_H

#include <stdatomic.h>

#include <ebpo/build.h>

#include "core/workspace.h"
#include "geometry/cells.h"
#include "mesh/mesh_parts.h"
#include "geometry/level_nodes.h"
#include "construct/planes.h"

#define EBPO_NO_VERTEX UINT64_MAX

/* A node of a subtree under construction. An empty node becomes white or black after the winding
 * numbers are computed. */
typedef struct ebpo_build_node {
    uint8_t type;   /* ebpo_node_type; empty nodes are EBPO_WHITE */
    uint32_t child; /* gray: index of the first of eight children */
    /* gray node or leaf: index in ebpo_branch.details; leaf of the top: index of a piece in
     * ebpo_builder.piece */
    uint32_t detail;
} ebpo_build_node;

/* Data of a node that is not empty. */
typedef struct ebpo_build_detail {
    int32_t delta[8]; /* corner differences */
    /* Leaf: its list of faces is entries[entry_begin .. entry_end - 1] of the branch. Gray node of
     * a piece: this range has the lists of all leaves below the node. Gray node of the top: the
     * pieces below the node are ebpo_builder.piece[entry_begin .. entry_end - 1]. */
    uint64_t entry_begin, entry_end;
    /* gray: crossing[cross_begin .. cross_end - 1] of the branch are the faces in the cell that are
     * not entirely inside the cell */
    uint64_t cross_begin, cross_end;
    /* leaf: final index of its first new face, and number of new faces (faces that no earlier leaf
     * lists) */
    uint32_t first, new_count;
} ebpo_build_detail;

/* A piece, or the top of the tree. Its nodes are stored depth first; nodes[0] is the root. */
typedef struct ebpo_branch {
    ebpo_cell cell; /* cell of the root */
    /* [list_count] indices along the curve of the faces that touch the cell, ascending; NULL for
     * the top */
    uint32_t *list;
    uint64_t list_count;
    uint8_t *fresh;              /* bit i: no piece before this one lists face list[i] */
    uint64_t fresh_count, first; /* number of fresh faces; final index of the first one */
    ebpo_build_node *nodes;
    uint64_t node_count, node_capacity;
    ebpo_build_detail *details;
    uint64_t detail_count, detail_capacity;
    uint32_t *entries; /* the lists of the leaves, one after the other: indices in `list` */
    uint64_t entry_count, entry_capacity;
    /* elements of all ranges of crossing faces (see ebpo_build_detail): indices in `list`; in the
     * top, indices along the curve */
    uint32_t *crossing;
    uint64_t cross_count, cross_capacity;
    int32_t winding; /* winding number at the lowest corner of the cell */
    /* type and corner differences of nodes[0]; they remain when the nodes are freed */
    uint8_t root_type;
    int32_t root_delta[8];
    /* planes that were chosen from the leaves up; NULL: planes are chosen from the root down,
     * together with the envelopes */
    struct ebpo_proposals *proposals;
    struct ebpo_piece_level *out; /* [EBPO_LEVELS_MAX] results of ebpo_emit_piece */
    ebpo_polytope *above;         /* the envelope of the root's parent, cut to this cell */
    ebpo_workspace *workspace;    /* the builder's workspace, for all arrays */
} ebpo_branch;

/* Boxes around blocks of consecutive vertices, in a hierarchy: a block of level 0 has 16 vertices,
 * and a block of a higher level has 16 blocks of the level below. */
enum { EBPO_BOUNDS_FAN = 16, EBPO_BOUNDS_LEVELS = 8 };
typedef struct ebpo_bounds {
    /* box[k][i]: least and greatest coordinates in block i of level k, whose first vertex is
     * i * 16^(k+1) */
    double (*box[EBPO_BOUNDS_LEVELS])[2][3];
    uint64_t count[EBPO_BOUNDS_LEVELS]; /* number of blocks of each level */
    int levels;
    ebpo_workspace *workspace; /* the builder's workspace */
} ebpo_bounds;

typedef struct ebpo_builder {
    const ebpo_build_options *options;
    ebpo_workspace *workspace;
    unsigned threads;
    bool solid;                 /* false: a surface */
    struct ebpo_capped *capped; /* a surface whose envelopes contain its inside; else NULL */
    int max_level;              /* deepest level */
    ebpo_box box;               /* root box */
    const ebpo_mesh *mesh;      /* arranged along the curve */
    uint64_t vertex_count;      /* number of referenced vertices, which come first */
    uint64_t face_count;
    const uint64_t *key;       /* octcode of the vertex's cell at box.grid_level, ascending */
    const uint32_t (*face)[3]; /* [face_count] vertices of each face */
    ebpo_bounds bounds;        /* boxes around ranges of vertices */
    /* [face] final index; EBPO_NO_INDEX until a piece assigns it */
    uint32_t *final_index;
    ebpo_branch top;    /* each of its leaves is a piece: `detail` is an index in `piece` */
    ebpo_branch *piece; /* [piece_count] the pieces */
    uint64_t piece_count, piece_capacity;
    /* number of leaves in all pieces so far; number of entries in the lists of these leaves */
    _Atomic uint64_t leaf_count, entry_count;
    struct ebpo_top_envelope *top_envelope; /* [detail] envelopes of the top's gray nodes */
    struct ebpo_store *store;               /* pieces.c; NULL: nothing is stored yet */
    /* request of ebpo_build_as_theses; NULL: a tree for a file is built */
    const struct ebpo_thesis_run *thesis;
} ebpo_builder;

/* Returns true if winding numbers are defined: of a solid, or of a surface with its caps. */
static inline bool ebpo_build_closed(const ebpo_builder *b) { return b->solid || b->capped; }

/* Sets `out` to the corners of a face. */
static inline void ebpo_build_triangle(const ebpo_builder *b, uint32_t face, ebpo_triangle *out)
{
    for (int i = 0; i < 3; i++)
        ebpo_mesh_position(b->mesh, b->face[face][i], out->corner[i]);
}

/* Returns the index of a face along the curve. `entry`: an element of `entries` or `crossing` of
 * the branch. */
static inline uint32_t ebpo_branch_face(const ebpo_branch *s, uint32_t entry)
{
    return s->list ? s->list[entry] : entry;
}

/* Sets `out` to the corners of the face ebpo_branch_face(s, entry). */
static inline void ebpo_branch_triangle(const ebpo_builder *b, const ebpo_branch *s, uint32_t entry,
                                        ebpo_triangle *out)
{
    ebpo_build_triangle(b, ebpo_branch_face(s, entry), out);
}

#endif
