/* The parts of verifying a file, as verify.c calls them. */
#ifndef EBPO_VERIFY_VERIFY_PARTS_H
#define EBPO_VERIFY_VERIFY_PARTS_H

#include <stdbool.h>
#include <stdint.h>

#include "verify/tally.h"
#include "verify/verify_tree.h"

/* --- verify.c --- */

/* All checks but content and source. A tree whose arrays do not fit together ends with structure
 * violations and is not looked at further. */
EBPO_MUST_USE ebpo_status ebpo_verify_tree(ebpo_tally *tally, const ebpo_tree *tree,
                                           const ebpo_verify_options *options, ebpo_error *error);

/* --- verify_chunks.c: a second reader of the coding gates (format-spec/README.md, section 7) ---
 */

/* A chunk of `rows` faces, of 13 bytes each; rows > 0. `seen`: vertices seen before it, and then
 * after it. False, with nothing told of `faces`, where the page says to refuse. */
bool ebpo_plain_gates_read(const uint8_t *in, uint32_t rows, uint64_t *seen, uint32_t *faces);

/* --- verify_source.c: the mesh in the file against its source --- */

/* Does the recorded mending again on a copy of `source` and compares bit for bit. `stored`: the
 * file's mesh; `ordered`: it is in the source's order (else vertices and faces are compared as
 * multisets). NULL: the file is a subset; its faces and vertices, as those of a component's file,
 * are compared with those of their numbers in the source. Of a file whose coordinates an earlier
 * version rounded, that is the only violation. */
EBPO_MUST_USE ebpo_status ebpo_check_source(ebpo_tally *tally, const ebpo_file *file,
                                            const ebpo_mesh *stored, bool ordered,
                                            const ebpo_mesh *source, const ebpo_read_options *read,
                                            ebpo_error *error);

/* --- verify_subtrees.c, verify_chunks.c: the parts of the file --- */

/* Every column of the table, by visiting the tree depth first; and the blocks from elsewhere, each
 * listed that is needed, and no other. Nothing to do in files without subtrees. */
EBPO_MUST_USE ebpo_status ebpo_check_subtrees(ebpo_tally *tally, const ebpo_file *file,
                                              const ebpo_twin_tree *view,
                                              const ebpo_verify_options *options,
                                              ebpo_error *error);

/* The list of chunks against HDF5's index. Nothing to do where another program has rewritten the
 * file, which the list's attributes tell. */
EBPO_MUST_USE ebpo_status ebpo_check_places(ebpo_tally *tally, const ebpo_file *file,
                                            const ebpo_verify_options *options, ebpo_error *error);

/* Each row of the list of how chunks end (section 20), and whether each chunk has one. Nothing to
 * do in files without, or where another program has rewritten the file. */
EBPO_MUST_USE ebpo_status ebpo_check_sums(ebpo_tally *tally, const ebpo_file *file,
                                          ebpo_error *error);

/* Which bytes of the file belong to nothing: neither to superblock, headers and indexes nor to a
 * chunk; and how many of them are not zero. Nothing to do in files far away. */
EBPO_MUST_USE ebpo_status ebpo_count_spare(const ebpo_file *file, const ebpo_progress *progress,
                                           uint64_t *spare, uint64_t *filled, ebpo_error *error);

/* Every chunk of faces with the coding `gates`, by ebpo_plain_gates_read. Nothing to do without. */
EBPO_MUST_USE ebpo_status ebpo_check_gates(ebpo_tally *tally, const ebpo_file *file,
                                           const ebpo_tree *tree, ebpo_error *error);

/* --- verify_lists.c: face lists of leaves against the faces that touch them --- */

/* `faces`: numbers of the `count` faces that touch the cell, ascending. A leaf must list them all,
 * a white or black cell has none. */
void ebpo_check_terminal_lists(ebpo_tally *tally, const ebpo_twin_tree *view,
                               const ebpo_twin_node *node, const uint32_t *faces, uint64_t count);

/* Whether the leaves below a gray node list more than `limit` different faces. */
bool ebpo_lists_more_faces(const ebpo_twin_tree *view, const ebpo_twin_node *node, uint64_t limit);

/* --- verify_walk.c: containment, lists and labels, with the faces that touch each node --- */

/* Adds to the tally. The result does not depend on the number of threads. */
EBPO_MUST_USE ebpo_status ebpo_verify_walk(ebpo_tally *tally, const ebpo_twin_tree *view,
                                           const ebpo_verify_options *options, ebpo_error *error);

#endif
