/* Declares the parts of the verifier, which verify.c calls. */
#ifndef EBPO_VERIFY_VERIFY_PARTS_H
#define EBPO_VERIFY_VERIFY_PARTS_H

#include <stdbool.h>
#include <stdint.h>

#include "verify/tally.h"
#include "verify/verify_labels.h"
#include "verify/verify_tree.h"

/* --- verify.c --- */

/* Runs all checks of a tree in memory. If its arrays are not consistent, reports violations of the
 * structure and runs no further checks. */
EBPO_MUST_USE ebpo_status ebpo_verify_tree(ebpo_tally *tally, const ebpo_tree *tree,
                                           const ebpo_verify_options *options, ebpo_error *error);

/* --- verify_chunks.c: reference implementation of a reader of the coding `gates`
 * (format-spec/gates.md) --- */

/* Decodes a chunk of `rows` faces, 13 bytes for each face. `rows` must be above 0. On entry, *used
 * is the number of vertices that the faces before the chunk use; on return, it also counts the
 * vertices of the chunk's faces. Returns false if the specification requires that a reader rejects
 * the chunk; then the content of `faces` is undefined. */
bool ebpo_plain_gates_read(const uint8_t *in, uint32_t rows, uint64_t *used, uint32_t *faces);

/* --- verify_source.c: comparison of the file's mesh with its source --- */

/* Repeats the recorded repairs on a copy of `source`, and compares the result bit for bit with
 * `stored`, the file's mesh. If `ordered` is true, `stored` is in the order of the source, and
 * vertices and faces are compared one by one. Otherwise they are compared as multisets. `stored` is
 * NULL if the file is a subset. Faces and vertices of a subset, and of the file of one component,
 * are compared by their source indices. */
EBPO_MUST_USE ebpo_status ebpo_check_source(ebpo_tally *tally, const ebpo_file *file,
                                            const ebpo_mesh *stored, bool ordered,
                                            const ebpo_mesh *source, const ebpo_read_options *read,
                                            ebpo_error *error);

/* --- verify_subtrees.c, verify_chunks.c: subtrees and chunks --- */

/* Checks every column of the table of subtrees, by visiting the tree depth first. Does
 * nothing for files without subtrees. */
EBPO_MUST_USE ebpo_status ebpo_check_subtrees(ebpo_tally *tally, const ebpo_file *file,
                                              const ebpo_reference_tree *view,
                                              const ebpo_verify_options *options,
                                              ebpo_error *error);

/* Compares the list of chunk offsets with HDF5's indexes. Does nothing for files without the list,
 * or if another program has rewritten the file. */
EBPO_MUST_USE ebpo_status ebpo_check_chunk_offsets(ebpo_tally *tally, const ebpo_file *file,
                                                   const ebpo_verify_options *options,
                                                   ebpo_error *error);

/* Checks each row of the list of chunk checksums (format-spec, section 20). Also checks that each
 * chunk has a row. Does nothing for remote files, for files without the list, and for files that
 * another program has rewritten. */
EBPO_MUST_USE ebpo_status ebpo_check_checksums(ebpo_tally *tally, const ebpo_file *file,
                                               ebpo_error *error);

/* Counts the unused bytes of the file, which are outside the superblock, headers, indexes and
 * chunks. Sets *spare to the number of unused bytes, and *filled to the number of unused bytes that
 * are not zero. Does nothing for remote files. */
EBPO_MUST_USE ebpo_status ebpo_count_spare(const ebpo_file *file, const ebpo_progress *progress,
                                           uint64_t *spare, uint64_t *filled, ebpo_error *error);

/* Decodes every chunk of faces by ebpo_plain_gates_read, and compares the corners with the corners
 * in the tree. Does nothing if the file does not have the coding `gates`. */
EBPO_MUST_USE ebpo_status ebpo_check_gates(ebpo_tally *tally, const ebpo_file *file,
                                           const ebpo_tree *tree, ebpo_error *error);

/* --- verify_border.c: the border of a surface (format-spec/border.md) --- */

/* Checks that the loops agree with the header, and that they are the border of the faces. Returns
 * false after a violation. */
bool ebpo_check_border_loops(ebpo_tally *tally, const ebpo_tree *tree);
/* Checks the area of the caps (triangles that close the holes). Subtracts the winding number of the
 * caps from the stored winding number of each point, so that the difference must be the winding
 * number of the faces. Call ebpo_check_border_loops before. */
EBPO_MUST_USE ebpo_status ebpo_check_border_rays(ebpo_tally *tally, ebpo_ray_points *points,
                                                 const ebpo_reference_tree *view, unsigned threads,
                                                 const ebpo_progress *progress, ebpo_error *error);

/* --- verify_inside.c: envelopes of a surface with holes --- */

/* Checks, for a sample of points, that envelopes contain the inside of a surface with
 * border_inside. Does nothing for other trees, for subsets, and without a mesh. */
EBPO_MUST_USE ebpo_status ebpo_check_inside(ebpo_tally *tally, const ebpo_reference_tree *view,
                                            unsigned threads, const ebpo_progress *progress,
                                            ebpo_error *error);

/* --- verify_surface.c: the simplified surface (format-spec/surface.md) --- */

/* Checks the nodes and the errors of all patches. Does nothing if the tree is a subset or has no
 * mesh or no patches. */
EBPO_MUST_USE ebpo_status ebpo_check_patches(ebpo_tally *tally, const ebpo_tree *tree,
                                             ebpo_workspace *workspace, ebpo_error *error);

/* --- verify_lists.c: face lists of leaves --- */

/* Checks that a leaf lists all faces that touch its cell, and that no face touches a white or black
 * cell. `faces`: ascending indices of the `count` faces that touch the cell. */
void ebpo_check_terminal_lists(ebpo_tally *tally, const ebpo_reference_tree *view,
                               const ebpo_reference_node *node, const uint32_t *faces,
                               uint64_t count);

/* Returns true if the leaves below a gray node list more than `limit` different faces, or if there
 * is not enough memory to count them. */
bool ebpo_lists_more_faces(const ebpo_reference_tree *view, const ebpo_reference_node *node,
                           uint64_t limit);

/* --- verify_walk.c: the checks of each node with the faces that touch it --- */

/* Checks containment, lists and labels, and adds the counts to the tally. The result does not
 * depend on the number of threads. */
EBPO_MUST_USE ebpo_status ebpo_verify_walk(ebpo_tally *tally, const ebpo_reference_tree *view,
                                           const ebpo_verify_options *options, ebpo_error *error);

#endif
