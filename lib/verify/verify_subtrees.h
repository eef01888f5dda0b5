/* The part `subtrees` (format-spec/README.md, section 9) against what it speaks of. */
#ifndef EBPO_VERIFY_VERIFY_SUBTREES_H
#define EBPO_VERIFY_VERIFY_SUBTREES_H

#include "verify/tally.h"
#include "verify/verify_tree.h"

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

#endif
