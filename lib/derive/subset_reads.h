/* What a subset would take of its file, told from heads and tables, without cutting it. */
#ifndef EBPO_DERIVE_SUBSET_READS_H
#define EBPO_DERIVE_SUBSET_READS_H

#include <ebpo/subset.h>

typedef struct ebpo_subset_reads {
    uint64_t subtrees, of_subtrees; /* that meet the box, and all; 0, 0: the file has none */
    uint64_t bytes;                 /* of the chunks that hold it, each counted once */
} ebpo_subset_reads;

/* Of the options the parts, the box and last_level count. Where the mesh goes, all levels do. */
EBPO_MUST_USE ebpo_status ebpo_subset_count_reads(const ebpo_file *file,
                                                  const ebpo_subset_options *options,
                                                  ebpo_subset_reads *out, ebpo_error *error);

#endif
