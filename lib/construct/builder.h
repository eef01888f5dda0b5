/* The builder's state, shared by its stages. Before them, vertices and faces are arranged along the
 * curve. Then:
 *   1. the top: faces to the pieces that the tree is cut into (partition), winding numbers
 *      (corner_windings), planes that are chosen from the leaves up (propose), the envelopes above
 *      the pieces (envelopes);
 *   2. piece by piece, on all cores: faces to cells (partition), their numbers (face_numbers),
 *      envelopes and the piece's part of each level (emit_levels), moved to the store (pieces);
 *   3. the levels' arrays (emit_levels), final vertex numbers (face_numbers). A piece is a subtree.
 *     Its only input about others comes from the top; its only results are its part of the levels
 *     and its faces' numbers. */
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

/* A node of a subtree under construction. Empty nodes get their colour after the winding numbers.
 */
typedef struct ebpo_build_node {
    uint8_t type;   /* ebpo_node_type; empty nodes are EBPO_WHITE */
    uint32_t child; /* gray: index of the first of eight children */
    /* gray and leaf: index into details; a subtree below the top: its number */
    uint32_t detail;
} ebpo_build_node;

typedef struct ebpo_build_detail {
    int32_t delta[8]; /* winding numbers of the corners minus that of corner 0 */
    /* the leaf's list, or those of all leaves below a gray node, in `entries` */
    uint64_t entry_begin, entry_end;
    uint64_t cross_begin, cross_end; /* gray: faces that are not entirely inside, in `crossing` */
    uint32_t first, new_count;       /* leaf: final number of its first new face */
} ebpo_build_detail;

/* A subtree: its nodes, depth first. nodes[0] is its root. */
typedef struct ebpo_branch {
    ebpo_cell cell;
    /* faces that touch the cell, ascending; NULL for the top, whose entries are face numbers */
    uint32_t *list;
    uint64_t list_count;
    uint8_t *fresh;              /* bit i: no piece before this one lists face list[i] */
    uint64_t fresh_count, first; /* their number; the final number of the first */
    ebpo_build_node *nodes;
    uint64_t node_count, node_capacity;
    ebpo_build_detail *details;
    uint64_t detail_count, detail_capacity;
    uint32_t *entries; /* indices in `list` */
    uint64_t entry_count, entry_capacity;
    uint32_t *crossing; /* indices in `list` */
    uint64_t cross_count, cross_capacity;
    int32_t winding; /* winding number at the lowest corner */
    uint8_t
        root_type; /* type of nodes[0], and its corner differences: kept longer than the nodes */
    int32_t root_delta[8];
    struct ebpo_proposals *proposals; /* NULL: planes are chosen on the way down */
    struct ebpo_piece_level *out;     /* [EBPO_LEVELS_MAX] results of emit */
    ebpo_polytope *above;             /* the parent's envelope cut to this cell */
    ebpo_workspace *workspace;        /* the builder's workspace, for all arrays */
} ebpo_branch;

/* Bounds of runs of vertices, 16 to a block, 16 blocks to a block above, and so on. */
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
    uint32_t *number; /* final number of each face; a piece sets those of its fresh ones */
    /* gray nodes above the subtrees; its leaves refer to subtrees in `detail` */
    ebpo_branch top;
    ebpo_branch *sub;
    uint64_t sub_count, sub_capacity;
    _Atomic uint64_t leaf_count, entry_count; /* in all subtrees so far */
    struct ebpo_top_envelope *top_envelope;   /* envelopes of the top's gray nodes, by detail */
    struct ebpo_store *store;
} ebpo_builder;

static inline void ebpo_build_triangle(const ebpo_builder *b, uint32_t face, ebpo_triangle *out)
{
    for (int i = 0; i < 3; i++)
        ebpo_mesh_position(b->mesh, b->face[face][i], out->corner[i]);
}

/* Returns the face of an entry of a branch. */
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
