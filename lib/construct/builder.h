/* The builder's working state, shared by its stages:
 *   (before: vertices and faces are arranged along the Morton curve)
 *   top      faces to the pieces that the tree is cut into, winding numbers, the envelopes above
 * the pieces pieces   piece by piece, on all cores: faces to cells, numbers, envelopes, stretches
 * of the levels' arrays join     the arrays of the levels, final vertex numbers A piece (a subtree)
 * needs nothing of another but what the top tells it, and gives back nothing but its stretches and
 * its faces' numbers. */
#ifndef EBPO_BUILD_BUILDER_H
#define EBPO_BUILD_BUILDER_H

#include <stdatomic.h>

#include <ebpo/build.h>

#include "base/arrays.h"
#include "geom/cell.h"
#include "mesh/mesh_parts.h"
#include "octree/cells.h"
#include "octree/rule.h"
#include "planes/planes.h"

#define EBPO_NO_NUMBER UINT32_MAX
#define EBPO_NO_VERTEX UINT64_MAX

/* A node of a subtree under construction. Empty nodes get their colour with the labels. */
typedef struct ebpo_build_node {
    uint8_t type;   /* ebpo_node_type; empty nodes are EBPO_WHITE */
    uint32_t child; /* gray: index of the first of eight children */
    /* gray and leaf: index into details; a subtree hanging from the top: its number */
    uint32_t detail;
} ebpo_build_node;

typedef struct ebpo_build_detail {
    int32_t delta[8]; /* winding numbers of the corners minus that of corner 0 */
    /* the leaf's list, or those of all leaves below a gray node, in `entries` */
    uint64_t entry_begin, entry_end;
    uint64_t cross_begin, cross_end; /* gray: faces that are not wholly inside, in `crossing` */
    uint32_t first, new_count;       /* leaf: final number of its first new face */
} ebpo_build_detail;

/* A stretch of one level's arrays under construction. */
typedef struct ebpo_out {
    ebpo_level level;
    ebpo_workspace *workspace; /* for large arrays */
    bool packed;               /* its arrays are in the builder's store */
    uint64_t group_capacity, gray_capacity, plane_capacity, leaf_capacity[6], ref_capacity,
        black_capacity, white_capacity, leaf_plane_capacity;
} ebpo_out;

/* A subtree: its nodes, depth first. nodes[0] is its root. */
typedef struct ebpo_branch {
    ebpo_cell cell;
    /* faces that touch the cell, ascending; NULL for the top, which goes by the faces' own numbers
     */
    uint32_t *list;
    uint64_t list_count;
    uint8_t *fresh;              /* bit i: no piece before this one lists face list[i] */
    uint64_t fresh_count, first; /* how many; the final number of the first */
    ebpo_build_node *nodes;
    uint64_t node_count, node_capacity;
    ebpo_build_detail *details;
    uint64_t detail_count, detail_capacity;
    uint32_t *entries; /* places in `list` */
    uint64_t entry_count, entry_capacity;
    uint32_t *crossing; /* likewise */
    uint64_t cross_count, cross_capacity;
    int32_t winding;   /* at the lowest corner */
    uint8_t root_type; /* of nodes[0], and its corner differences: they outlive the nodes */
    int32_t root_delta[8];
    struct ebpo_proposals *proposals; /* NULL: planes are chosen on the way down */
    ebpo_out *out;                    /* [EBPO_LEVELS_MAX] what envelopes makes */
    ebpo_polytope *above;             /* the parent's envelope cut to this cell */
} ebpo_branch;

/* Bounds of runs of vertices, 16 to a block, 16 blocks to a block above, and so on. */
enum { EBPO_BOUNDS_FAN = 16, EBPO_BOUNDS_LEVELS = 8 };
typedef struct ebpo_bounds {
    double (*box[EBPO_BOUNDS_LEVELS])[2][3]; /* box[k][i]: of vertices [i * 16^(k+1), ...) */
    uint64_t count[EBPO_BOUNDS_LEVELS];
    int levels;
} ebpo_bounds;

typedef struct ebpo_builder {
    const ebpo_build_options *options;
    ebpo_workspace *workspace;
    unsigned threads;
    bool solid;
    int max_level;
    ebpo_box box;
    const ebpo_mesh *mesh; /* arranged along the curve */
    uint64_t vertex_count; /* referenced ones, which come first */
    uint64_t face_count;
    const uint64_t *key; /* octcode of the vertex's cell at box.grid_level, ascending */
    const uint32_t (*face)[3];
    ebpo_bounds bounds;
    uint32_t *number; /* final number of each face; a piece sets those of its fresh ones */
    /* gray nodes above the subtrees; its leaves name subtrees in `detail` */
    ebpo_branch top;
    ebpo_branch *sub;
    uint64_t sub_count, sub_capacity;
    _Atomic uint64_t leaf_count, entry_count; /* in all subtrees so far */
    struct ebpo_top_envelope *top_envelope;   /* of the top's gray nodes, by detail */
    struct ebpo_store *store;
} ebpo_builder;

/* bounds.c */
void ebpo_build_vertex_range(const ebpo_builder *b, ebpo_cell cell, uint64_t *begin, uint64_t *end);

ebpo_status ebpo_bounds_make(ebpo_builder *b, ebpo_error *error);
/* Greatest n . xi over vertices [begin, end), in coordinates of the cell that holds them, and
 * `least`; `*at`: the vertex, or EBPO_NO_VERTEX when `least` is the greatest. */
double ebpo_bounds_support(const ebpo_builder *b, ebpo_cell cell, const double n[3], uint64_t begin,
                           uint64_t end, double least, uint64_t *at);
void ebpo_bounds_free(ebpo_bounds *bounds);

/* split.c: the top, and the pieces' lists */
ebpo_status ebpo_build_split(ebpo_builder *b, ebpo_error *error);

/* partition.c: a piece's nodes and leaf lists */
ebpo_status ebpo_build_partition(ebpo_builder *b, ebpo_branch *s, ebpo_error *error);
bool ebpo_branch_detail(const ebpo_builder *b, ebpo_branch *s, uint32_t *index);
bool ebpo_branch_children(const ebpo_builder *b, ebpo_branch *s, uint32_t *first);
bool ebpo_build_is_leaf(const ebpo_builder *b, int level, uint64_t count);
/* EBPO_E_LIMIT when a mesh of so many faces has more leaves, or more faces listed in them, than it
 * may. */
ebpo_status ebpo_build_check_lists(uint64_t face_count, uint64_t leaves, uint64_t entries,
                                   ebpo_error *error);
/* EBPO_E_LIMIT when the branch has as many nodes as 32 bits can number. */
ebpo_status ebpo_build_check_branch(const ebpo_branch *s, ebpo_error *error);
/* Notes which of the faces list[0 .. count) (places in the branch's list, or faces) are not wholly
 * inside. False: out of memory. */
bool ebpo_build_crossing(const ebpo_builder *b, ebpo_branch *s, ebpo_cell cell,
                         const uint32_t *list, uint64_t count, ebpo_build_detail *detail);
void ebpo_branch_free(ebpo_branch *s);
/* Frees what partition made of the piece's list: it can be made again. */
void ebpo_branch_forget(ebpo_branch *s);
/* Frees what only partition and envelopes need; `out` and the root's facts stay. */
void ebpo_subtree_release(ebpo_branch *s);

/* number.c */
/* a piece's fresh faces */
ebpo_status ebpo_build_number(ebpo_builder *b, ebpo_branch *s, ebpo_error *error);
ebpo_status ebpo_build_mesh(ebpo_builder *b, ebpo_mesh *mesh, ebpo_tree *out, ebpo_error *error);

/* labels.c */
ebpo_status ebpo_build_labels(ebpo_builder *b, ebpo_error *error);
/* Winding number at corner 0 of each child minus that of the parent's, from the children's corner
 * differences. */
void ebpo_child_windings(const ebpo_builder *b, const ebpo_branch *s, uint32_t child,
                         int32_t offset[8]);
/* The corner differences of a cell from the branch's faces that touch it: list[places[i]], or with
 * NULL the first `count` of the list. Long lists are gone through by parts of EBPO_CORNER_FACES,
 * the least of which and `count` is the room that is needed. */
enum { EBPO_CORNER_FACES = 1 << 14 };
void ebpo_branch_corners(const ebpo_builder *b, const ebpo_branch *s, ebpo_cell cell,
                         const uint32_t *places, uint64_t count, ebpo_triangle *room,
                         int32_t delta[8]);
/* A gray node's own corner differences from its children's. Crossings along any way between two
 * corners agree when the mesh balances: false when they do not. */
bool ebpo_gather_delta(const ebpo_builder *b, const ebpo_branch *s, uint32_t child,
                       int32_t delta[8]);

/* candidates.c */
int ebpo_build_candidates(const ebpo_builder *b, const ebpo_branch *s,
                          const ebpo_build_detail *detail, int most, ebpo_candidate *out);

/* envelopes.c */
typedef struct ebpo_envelope_scratch ebpo_envelope_scratch;
ebpo_status ebpo_scratch_make(ebpo_envelope_scratch **out, ebpo_error *error);
void ebpo_scratch_free(ebpo_envelope_scratch *scratch);
/* The own planes of a gray node, chosen now or proposed before; `envelope` is its parent's cut to
 * its cell, then its own. Returns their number, -1: out of memory. */
int ebpo_gray_planes(const ebpo_builder *b, ebpo_envelope_scratch *scratch, const ebpo_branch *s,
                     uint32_t detail, ebpo_cell cell, int32_t winding, ebpo_polytope *envelope,
                     uint32_t codes[EBPO_PLANES_STORED]);
unsigned ebpo_inside_corners(const ebpo_builder *b, int32_t winding, const int32_t delta[8]);

/* emit.c: a piece to stretches of level arrays. What leaves refer to (leaf_refs) is still told by
 * the faces' numbers along the curve. */
typedef struct ebpo_emit_scratch ebpo_emit_scratch;
ebpo_status ebpo_emit_scratch_make(ebpo_emit_scratch **out, ebpo_error *error);
void ebpo_emit_scratch_free(ebpo_emit_scratch *scratch);
ebpo_status ebpo_emit_piece(const ebpo_builder *b, ebpo_emit_scratch *scratch, ebpo_branch *s,
                            ebpo_error *error);
bool ebpo_emit_group(ebpo_out *out, uint16_t types);
bool ebpo_emit_gray(ebpo_out *out, const uint32_t *codes, int count, double volume);
bool ebpo_emit_empty(ebpo_out *out, bool black, int32_t winding);
void ebpo_out_free(ebpo_out *out);

/* top.c: the nodes above the subtrees */
ebpo_status ebpo_build_top(ebpo_builder *b, ebpo_error *error);

/* pack.c: moves what a piece gave to the builder's store, out of the way: to be read once, when the
 * levels are joined. Nothing to do without a workspace. */
ebpo_status ebpo_build_pack(ebpo_builder *b, ebpo_out *out, ebpo_error *error);
/* Room in it, aligned for 8 bytes, until it is freed; NULL: see ebpo_workspace_fail. Needs a
 * workspace. */
void *ebpo_store_reserve(ebpo_builder *b, uint64_t bytes);
void ebpo_store_free(struct ebpo_store *store);

/* join.c */
ebpo_status ebpo_build_levels(ebpo_builder *b, ebpo_tree *out, ebpo_error *error);

static inline void ebpo_build_triangle(const ebpo_builder *b, uint32_t face, ebpo_triangle *out)
{
    for (int i = 0; i < 3; i++)
        ebpo_mesh_position(b->mesh, b->face[face][i], out->corner[i]);
}

/* The face that an entry of a branch names. */
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
