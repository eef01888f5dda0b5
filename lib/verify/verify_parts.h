/* The parts of the verifier, which verify.c calls. */
#ifndef EBPO_VERIFY_VERIFY_PARTS_H
#define EBPO_VERIFY_VERIFY_PARTS_H

#include <stdbool.h>
#include <stdint.h>

#include "verify/tally.h"
#include "verify/verify_tree.h"

/* --- verify.c --- */

/* Runs all checks but content and source. A tree whose arrays do not fit together ends with
 * structure violations and is not checked further. */
EBPO_MUST_USE ebpo_status ebpo_verify_tree(ebpo_tally *tally, const ebpo_tree *tree,
                                           const ebpo_verify_options *options, ebpo_error *error);

/* --- verify_chunks.c: a second reader of the coding gates (format-spec/gates.md) ---
 */

/* Decodes a chunk of `rows` faces of 13 bytes each; rows > 0. On entry `seen` is the number of
 * vertices seen before the chunk, on return the number after it. Returns false, with `faces`
 * undefined, where the specification requires that a reader refuses the chunk. */
bool ebpo_plain_gates_read(const uint8_t *in, uint32_t rows, uint64_t *seen, uint32_t *faces);

/* --- verify_source.c: the mesh in the file against its source --- */

/* Repeats the recorded repairs on a copy of `source` and compares bit for bit. `stored` is the
 * file's mesh. `ordered`: `stored` is in the order of the source (otherwise vertices and faces are
 * compared as multisets). If `stored` is NULL, the file is a subset; its faces and vertices, like
 * those of a component's file, are compared by their numbers in the source. */
EBPO_MUST_USE ebpo_status ebpo_check_source(ebpo_tally *tally, const ebpo_file *file,
                                            const ebpo_mesh *stored, bool ordered,
                                            const ebpo_mesh *source, const ebpo_read_options *read,
                                            ebpo_error *error);

/* --- verify_subtrees.c, verify_chunks.c: the parts of the file --- */

/* Checks every column of the table of subtrees, by visiting the tree depth first. Also checks that
 * the listed blocks of other subtrees are exactly the needed ones. Does nothing for files without
 * subtrees.
 */
EBPO_MUST_USE ebpo_status ebpo_check_subtrees(ebpo_tally *tally, const ebpo_file *file,
                                              const ebpo_reference_tree *view,
                                              const ebpo_verify_options *options,
                                              ebpo_error *error);

/* Compares the list of chunks with HDF5's index. Does nothing if another program has rewritten the
 * file, which the list's attributes show. */
EBPO_MUST_USE ebpo_status ebpo_check_places(ebpo_tally *tally, const ebpo_file *file,
                                            const ebpo_verify_options *options, ebpo_error *error);

/* Checks each row of the list of chunk ends (section 20), and that each chunk has a row. Does
 * nothing for files without the list, or if another program has rewritten the file. */
EBPO_MUST_USE ebpo_status ebpo_check_checksums(ebpo_tally *tally, const ebpo_file *file,
                                               ebpo_error *error);

/* Counts the unused bytes of the file, outside superblock, headers, indexes and chunks, in `spare`,
 * and the unused bytes that are not zero in `filled`. Does nothing for remote files. */
EBPO_MUST_USE ebpo_status ebpo_count_spare(const ebpo_file *file, const ebpo_progress *progress,
                                           uint64_t *spare, uint64_t *filled, ebpo_error *error);

/* Checks every chunk of faces with the coding `gates`, by ebpo_plain_gates_read. Does nothing
 * without the coding. */
EBPO_MUST_USE ebpo_status ebpo_check_gates(ebpo_tally *tally, const ebpo_file *file,
                                           const ebpo_tree *tree, ebpo_error *error);

/* --- verify_lists.c: face lists of leaves against the faces that touch them --- */

/* Checks the lists. `faces`: numbers of the `count` faces that touch the cell, ascending. A leaf
 * must list all of them; no face may touch a white or black cell. */
void ebpo_check_terminal_lists(ebpo_tally *tally, const ebpo_reference_tree *view,
                               const ebpo_reference_node *node, const uint32_t *faces,
                               uint64_t count);

/* Returns true if the leaves below a gray node list more than `limit` different faces. */
bool ebpo_lists_more_faces(const ebpo_reference_tree *view, const ebpo_reference_node *node,
                           uint64_t limit);

/* --- verify_walk.c: containment, lists and labels, with the faces that touch each node --- */

/* Runs these checks and adds their counts to the tally. The result does not depend on the number of
 * threads. */
EBPO_MUST_USE ebpo_status ebpo_verify_walk(ebpo_tally *tally, const ebpo_reference_tree *view,
                                           const ebpo_verify_options *options, ebpo_error *error);

#endif
