/* Declares the stages of building, which construct.c runs. builder.h lists them in order and
 * explains the terms. A function processes one branch `s` (a piece, which is a subtree, or the top)
 * or all of them. Functions that allocate can return EBPO_E_MEMORY and EBPO_E_IO; functions that
 * take long can return EBPO_E_CANCELLED. */
#ifndef EBPO_CONSTRUCT_CONSTRUCT_STAGES_H
#define EBPO_CONSTRUCT_CONSTRUCT_STAGES_H

#include "construct/builder.h"
#include "construct/planes.h"
#include "construct/sweep.h"

/* --- partition.c: the nodes of a piece and the face lists of its leaves --- */

/* Makes the piece's nodes, and assigns its faces to leaves. Can return EBPO_E_LIMIT. */
ebpo_status ebpo_build_partition(ebpo_builder *b, ebpo_branch *s, ebpo_error *error);
/* Returns EBPO_E_LIMIT if `leaves` leaves, or `entries` entries of their face lists, are too many
 * for a mesh with `face_count` faces. */
ebpo_status ebpo_build_check_lists(uint64_t face_count, uint64_t leaves, uint64_t entries,
                                   ebpo_error *error);

/* Makes the nodes of the top, and lists the faces of the pieces below the top. */
ebpo_status ebpo_build_split(ebpo_builder *b, ebpo_error *error);

/* --- propose.c: the theses' selections of planes, from the leaves up --- */

/* Chooses the planes of all nodes in the pieces and in the top. Call ebpo_build_corner_windings
 * before. The function makes the nodes of each piece, and frees them again. It does nothing if the
 * selection works from the root down. */
EBPO_MUST_USE ebpo_status ebpo_build_propose(ebpo_builder *b, ebpo_error *error);

/* --- emit_levels.c: envelopes, and the arrays of the levels --- */

typedef struct ebpo_emit_scratch ebpo_emit_scratch; /* work space of one thread */
ebpo_status ebpo_emit_scratch_make(ebpo_emit_scratch **out, ebpo_workspace *workspace,
                                   ebpo_error *error);
void ebpo_emit_scratch_free(ebpo_emit_scratch *scratch);

/* Computes the envelopes of a piece, and writes its part of the levels' arrays. The array leaf_refs
 * gets the faces' indices along the curve; ebpo_build_levels replaces them by final indices. */
ebpo_status ebpo_emit_piece(const ebpo_builder *b, ebpo_emit_scratch *scratch, ebpo_branch *s,
                            ebpo_error *error);

/* Joins the pieces' parts of the levels' arrays to the arrays of `out`. */
ebpo_status ebpo_build_levels(ebpo_builder *b, ebpo_tree *out, ebpo_error *error);

/* --- triangle_cell.c: a face and a cell --- */

/* Returns a cell for ebpo_octants_visited. */
ebpo_sweep_cell ebpo_octants_prepare(const ebpo_box *box, ebpo_cell cell);

/* Returns a mask for a face that touches the cell: bit i is set if the face touches octant i of the
 * cell. Bit i may also be set if the face misses octant i by a rounding error. */
unsigned ebpo_octants_visited(const ebpo_sweep_cell *cell, const ebpo_triangle *face);

/* --- face_numbers.c: final indices of faces, in the order of the leaves that list them first ---
 */

/* Assigns final indices to a piece's fresh faces (faces that no earlier piece lists). */
ebpo_status ebpo_build_number(ebpo_builder *b, ebpo_branch *s, ebpo_error *error);
/* Moves the mesh's vertices, faces and attributes to `out`, in the final order. */
ebpo_status ebpo_build_mesh(ebpo_builder *b, ebpo_mesh *mesh, ebpo_tree *out, ebpo_error *error);

/* --- gray_colours.c (format-spec/colours.md) --- */

/* Computes the colours of gray nodes for a tree with levels, mesh and attributes that contain
 * colours. Returns EBPO_E_MEMORY, EBPO_E_IO, EBPO_E_CANCELLED. */
EBPO_MUST_USE ebpo_status ebpo_build_gray_colours(const ebpo_builder *b, ebpo_tree *out,
                                                  ebpo_error *error);

/* --- border_windings.c (format-spec/border.md) --- */

/* Finds the border of a mesh, and copies the positions of its points. Returns EBPO_E_MEMORY,
 * EBPO_E_IO, EBPO_E_LIMIT. `out` must be freed, also on failure. */
EBPO_MUST_USE ebpo_status ebpo_build_find_border(ebpo_border_loops *out, const ebpo_mesh *mesh,
                                                 unsigned threads, ebpo_error *error);
/* Adds the part EBPO_PART_BORDER to a surface with levels and mesh. Reports progress as the stage
 * "border"; `progress` may be NULL. Returns EBPO_E_MEMORY, EBPO_E_IO, EBPO_E_LIMIT,
 * EBPO_E_CANCELLED. */
EBPO_MUST_USE ebpo_status ebpo_build_border(ebpo_tree *tree, unsigned threads,
                                            const ebpo_progress *progress, ebpo_error *error);

/* --- surface.c (format-spec/surface.md) --- */

/* Adds the part EBPO_PART_SURFACE to a tree with levels and mesh. Does nothing if the mesh has too
 * few faces. Returns EBPO_E_MEMORY, EBPO_E_IO, EBPO_E_CANCELLED. */
EBPO_MUST_USE ebpo_status ebpo_build_surface(ebpo_tree *tree, unsigned threads,
                                             const ebpo_progress *progress, ebpo_error *error);

/* --- corner_windings.c: winding numbers at the corners of cells. `delta`: corner differences, the
 * winding numbers at the eight corners minus the winding number at corner 0 --- */

/* Computes the corner differences of the top's gray nodes from the corner differences of the
 * pieces' roots. Does nothing for a surface. Returns EBPO_E_NOT_SOLID if two paths to a corner give
 * different winding numbers. */
ebpo_status ebpo_build_corner_windings(ebpo_builder *b, ebpo_error *error);
/* Computes, from the children's corner differences, the offset of each child: the winding number at
 * the child's corner 0 minus the winding number at the parent's corner 0. `cell`: the parent's
 * cell; `child`: index of the first child's node. */
void ebpo_child_windings(const ebpo_builder *b, const ebpo_branch *s, ebpo_cell cell,
                         uint32_t child, int32_t offset[8]);
/* Computes the corner differences of a cell from the piece's faces that touch the cell. The faces
 * are list[entries[0]] to list[entries[count - 1]] of the branch. If `entries` is NULL, they are
 * the first `count` faces of the list. Long lists are processed EBPO_CORNER_FACES faces at a time,
 * so `buffer` must have space for the lesser of EBPO_CORNER_FACES and `count` triangles. */
enum { EBPO_CORNER_FACES = 1 << 9 };
void ebpo_branch_corners(const ebpo_builder *b, const ebpo_branch *s, ebpo_cell cell,
                         const uint32_t *entries, uint64_t count, ebpo_triangle *buffer,
                         int32_t delta[8]);
/* Computes a gray node's corner differences from those of its children. Returns false if two paths
 * along the children's edges give different winding numbers for a corner; then the mesh does not
 * balance. */
bool ebpo_gather_delta(const ebpo_builder *b, const ebpo_branch *s, ebpo_cell cell, uint32_t child,
                       int32_t delta[8]);
/* Returns a mask: bit i is set if corner i of a cell is inside by the builder's rule. `winding`:
 * winding number at corner 0; `delta`: corner differences (ebpo_build_detail). */
unsigned ebpo_inside_corners(const ebpo_builder *b, int32_t winding, const int32_t delta[8]);
/* Returns the same mask for a leaf; all corners if points near caps may be inside (capped.h). */
unsigned ebpo_leaf_corners(const ebpo_builder *b, ebpo_cell cell, int32_t winding,
                           const int32_t delta[8]);
/* Returns the type that the file has for a node without faces. `winding`: as above. The type is
 * EBPO_LEAF if the node may hold a part of the inside of a surface with holes. */
ebpo_node_type ebpo_empty_type(const ebpo_builder *b, ebpo_cell cell, int32_t winding);

/* --- envelopes.c --- */

typedef struct ebpo_envelope_scratch ebpo_envelope_scratch; /* work space of one thread */
ebpo_status ebpo_scratch_make(ebpo_envelope_scratch **out, ebpo_error *error);
void ebpo_scratch_free(ebpo_envelope_scratch *scratch);

/* Sets `codes` to the planes that a gray node adds to its parent's planes. If the branch has
 * proposals, they are the planes that were chosen from the leaves up. Otherwise they are chosen
 * now. On entry, `envelope` is the parent's envelope cut to the node's cell; on return, it is the
 * node's envelope. Returns the number of planes, or -1 when out of memory. */
int ebpo_gray_planes(const ebpo_builder *b, ebpo_envelope_scratch *scratch, const ebpo_branch *s,
                     uint32_t detail, ebpo_cell cell, int32_t winding, ebpo_polytope *envelope,
                     uint32_t codes[EBPO_PLANES_STORED]);

/* The planes of a gray node of the top, kept until the levels are joined. */
typedef struct ebpo_top_envelope {
    uint32_t codes[EBPO_PLANES_STORED];
    int count;
    double volume;
    double empty_volume[8]; /* volume of the envelope of each child that is a leaf without faces */
} ebpo_top_envelope;

/* Computes the envelopes of the top's nodes, and passes them to the pieces (ebpo_branch.above). */
ebpo_status ebpo_build_top(ebpo_builder *b, ebpo_error *error);

#endif
