/* Declares what the source files subset*.c share, which make subsets. A subset is a smaller file
 * that is made from another file: some gray nodes (nodes with children) lose their children and
 * become pruned nodes, or parts are omitted. */
#ifndef EBPO_DERIVE_SUBSET_PARTS_H
#define EBPO_DERIVE_SUBSET_PARTS_H

#include <ebpo/subset.h>

#include "derive/error_bound.h"
#include "format/pick_rows.h"
#include "geometry/cells.h"

/* The work of making the tree of a subset. */
typedef struct ebpo_cutting {
    const ebpo_file *file;
    const ebpo_info *from; /* the header of `file` */
    const ebpo_subset_options *options;
    ebpo_chunks *chunks; /* reads rows of `file` */
    /* decides which envelopes are close enough to the model; NULL without max_error */
    ebpo_tolerance *tolerance;
    ebpo_box box;   /* the root cell */
    int last_level; /* deepest level that the subset may have */
    uint32_t parts; /* parts of the file that the subset has (EBPO_PART_...) */
    ebpo_tree *out; /* the subset */
    ebpo_error *error;
} ebpo_cutting;

/* Makes the levels of the subset (subset_levels.c). The lists of faces still have the indices of
 * the original file. */
EBPO_MUST_USE ebpo_status ebpo_cut_levels(ebpo_cutting *c);

/* Copies the faces that the remaining leaves list, with their vertices, maps and attributes, and
 * gives them new indices, also in the lists of the leaves (subset_faces.c). If no faces remain,
 * removes these parts. */
EBPO_MUST_USE ebpo_status ebpo_cut_faces(ebpo_cutting *c);

/* Makes the tree of the subset that ebpo_subset would write. Tests call this function, too. */
EBPO_MUST_USE ebpo_status ebpo_subset_tree(ebpo_tree *out, const ebpo_file *file,
                                           const ebpo_subset_options *options, ebpo_error *error);

/* --- counting the bytes of a file that a subset needs, from headers and tables alone --- */

typedef struct ebpo_subset_reads {
    uint64_t subtrees;       /* subtrees that intersect the box; 0 if the file has none */
    uint64_t total_subtrees; /* all subtrees of the file; 0 if the file has none */
    uint64_t bytes;          /* bytes of the chunks that the subset needs, each counted once */
} ebpo_subset_reads;

/* Counts the subtrees and bytes of a file that a subset with these options must read. Only the
 * options parts, box and last_level are used. If the parts include the mesh, all levels are
 * counted. */
EBPO_MUST_USE ebpo_status ebpo_subset_count_reads(const ebpo_file *file,
                                                  const ebpo_subset_options *options,
                                                  ebpo_subset_reads *out, ebpo_error *error);

#endif
