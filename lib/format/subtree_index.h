/* Where subtrees, groups, planes and faces begin in every array. Results fit the counts in the
 * head. Any thread. format-spec/README.md, sections 4 and 9. */
#ifndef EBPO_FORMAT_SUBTREE_INDEX_H
#define EBPO_FORMAT_SUBTREE_INDEX_H

#include "format/chunks.h"

enum { EBPO_SUBTREE_COLS = EBPO_SUBTREE_LEVELS + EBPO_SUBTREE_LEVEL_COLS * EBPO_LEVELS_MAX };

typedef struct ebpo_subtree_row {
    uint64_t subtree;
    uint64_t before[EBPO_SUBTREE_COLS]; /* sums of the columns before it, */
    uint64_t after[EBPO_SUBTREE_COLS];  /* and with it */
    uint64_t face, vertex;              /* its own first ones */
} ebpo_subtree_row;

/* Whether the table tells of a level's nodes: those below the subtrees' roots. */
static inline bool ebpo_subtree_table_has(const ebpo_file *file, int level)
{
    return file->info.subtree_level && level > file->info.subtree_level;
}

/* A subtree's row; it must be less than the number of subtrees. */
EBPO_MUST_USE ebpo_status ebpo_subtree_table_row(ebpo_chunks *chunks, uint64_t subtree,
                                                 ebpo_subtree_row *out, ebpo_error *error);
/* The last subtree that begins at or before an item, of those that column `column` counts. */
EBPO_MUST_USE ebpo_status ebpo_subtree_table_find(ebpo_chunks *chunks, unsigned column,
                                                  uint64_t item, ebpo_subtree_row *out,
                                                  ebpo_error *error);

/* Of a row, groups of a level before the subtree and after it. */
uint64_t ebpo_subtree_groups(const ebpo_info *info, const ebpo_subtree_row *row, int level,
                             bool after);

/* Adds the chunks of the table that are not in memory and that finding an item of a level takes (of
 * its groups, gray nodes or leaves, by EBPO_PER_...); true if there are any, else *first is where
 * its subtree begins. Errors are the reading's to tell: then true as well. */
bool ebpo_subtree_table_missing(ebpo_chunks *chunks, int level, ebpo_per per, uint64_t item,
                                ebpo_chunk_keys *keys, uint64_t *first);

/* Announces what reading rows of the table takes, of subtrees in any order. */
void ebpo_subtree_table_expect(ebpo_chunks *chunks, const uint64_t *subtrees, uint64_t count);
void ebpo_subtree_table_expect_run(ebpo_chunks *chunks, uint64_t first, uint64_t count);

/* --- ranks: from the nearest row of an index, and counting from there --- */

/* Sum of rows of an unsigned array; EBPO_E_FORMAT when it is beyond 2^62. */
EBPO_MUST_USE ebpo_status ebpo_chunks_sum(ebpo_chunks *chunks, ebpo_array_id id, int level,
                                          uint64_t row, uint64_t rows, uint64_t *sum,
                                          ebpo_error *error);

/* ebpo_groups_count for groups [group, group + groups) of the file. */
EBPO_MUST_USE ebpo_status ebpo_ranks_count_file(ebpo_chunks *chunks, int level, uint64_t group,
                                                uint64_t groups, uint64_t counts[4],
                                                ebpo_error *error);
/* Nodes of each type of a level before a group. */
EBPO_MUST_USE ebpo_status ebpo_ranks_before(ebpo_chunks *chunks, int level, uint64_t group,
                                            uint64_t ranks[4], ebpo_error *error);
/* [rank, rank + count) lies within the level, for each type. */
EBPO_MUST_USE ebpo_status ebpo_ranks_check(const ebpo_chunks *chunks, int level,
                                           const uint64_t ranks[4], const uint64_t counts[4],
                                           ebpo_error *error);
/* Planes of the gray nodes before one. */
EBPO_MUST_USE ebpo_status ebpo_ranks_planes(ebpo_chunks *chunks, int level, uint64_t gray,
                                            uint64_t *planes, ebpo_error *error);
/* End of the new faces of the leaf before one, and references of the leaves before it. */
EBPO_MUST_USE ebpo_status ebpo_ranks_leaf(ebpo_chunks *chunks, int level, uint64_t leaf,
                                          uint64_t *end, uint64_t *refs, ebpo_error *error);

/* Leaf planes of the leaves before one. */
EBPO_MUST_USE ebpo_status ebpo_ranks_leaf_planes(ebpo_chunks *chunks, int level, uint64_t leaf,
                                                 uint64_t *planes, ebpo_error *error);

/* --- prefetch hints --- */

/* All chunks of the subtrees [first, first + count) that are not in memory: nodes below their
 * roots, of the arrays that are there for `needs`; with EBPO_NEEDS_MESH the faces that their leaves
 * list, with EBPO_NEEDS_MAPS these faces' numbers in the source. Without `faces`, nodes
 * down to `last_level` only. Needs the table's rows, which it
 * reads. What cannot be announced is read without. Only files far away care. */
void ebpo_subtrees_expect(ebpo_chunks *chunks, ebpo_expected *expected, uint64_t first,
                          uint64_t count, uint32_t needs, int last_level, bool faces);

#endif
