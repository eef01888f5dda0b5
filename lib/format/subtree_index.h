/* Locates subtrees, groups, planes and faces in every array. Results are consistent with the counts
 * in the head. Any thread. format-spec/subtrees.md. */
#ifndef EBPO_FORMAT_SUBTREE_INDEX_H
#define EBPO_FORMAT_SUBTREE_INDEX_H

#include "format/chunks.h"

enum { EBPO_SUBTREE_COLS = EBPO_SUBTREE_LEVELS + EBPO_SUBTREE_LEVEL_COLS * EBPO_LEVELS_MAX };

typedef struct ebpo_subtree_row {
    uint64_t subtree;
    uint64_t before[EBPO_SUBTREE_COLS]; /* sums of the columns before it */
    uint64_t after[EBPO_SUBTREE_COLS];  /* sums including it */
    uint64_t face, vertex;              /* its first owned face and vertex */
} ebpo_subtree_row;

/* Returns true if the table covers a level's nodes: those below the subtrees' roots. */
static inline bool ebpo_subtree_table_has(const ebpo_file *file, int level)
{
    return file->info.subtree_level && level > file->info.subtree_level;
}

/* Reads a subtree's row; the index must be less than the number of subtrees. */
EBPO_MUST_USE ebpo_status ebpo_subtree_table_row(ebpo_chunks *chunks, uint64_t subtree,
                                                 ebpo_subtree_row *out, ebpo_error *error);
/* Finds the last subtree that begins at or before an item that column `column` counts. */
EBPO_MUST_USE ebpo_status ebpo_subtree_table_find(ebpo_chunks *chunks, unsigned column,
                                                  uint64_t item, ebpo_subtree_row *out,
                                                  ebpo_error *error);

/* Remember that the faces of a subtree were checked (subtree_faces.h); some are forgotten. */
bool ebpo_subtree_faces_known(ebpo_chunks *chunks, uint64_t subtree);
void ebpo_subtree_faces_note(ebpo_chunks *chunks, uint64_t subtree);

/* Returns the groups of a level before or after the row's subtree. */
uint64_t ebpo_subtree_groups(const ebpo_info *info, const ebpo_subtree_row *row, int level,
                             bool after);

/* Adds the missing chunks of the table that are needed to find an item of a level (groups, gray
 * nodes or leaves, by EBPO_PER_...). Returns true if there are any; otherwise *first is the start
 * of its subtree. Returns true for errors as well, which the actual read reports. */
bool ebpo_subtree_table_missing(ebpo_chunks *chunks, int level, ebpo_per per, uint64_t item,
                                ebpo_chunk_keys *keys, uint64_t *first);

/* Sends prefetch hints for reading rows of the table, for subtrees in any order. */
void ebpo_subtree_table_hint(ebpo_chunks *chunks, const uint64_t *subtrees, uint64_t count);
void ebpo_subtree_table_hint_run(ebpo_chunks *chunks, uint64_t first, uint64_t count);

/* --- ranks: counted from the preceding row of an index --- */

/* Sums rows of an unsigned array; EBPO_E_FORMAT when the sum exceeds 2^62. */
EBPO_MUST_USE ebpo_status ebpo_chunks_sum(ebpo_chunks *chunks, ebpo_array_id id, int level,
                                          uint64_t row, uint64_t rows, uint64_t *sum,
                                          ebpo_error *error);

/* Does the same as ebpo_groups_count for groups [group, group + groups) of the file. */
EBPO_MUST_USE ebpo_status ebpo_ranks_count_file(ebpo_chunks *chunks, int level, uint64_t group,
                                                uint64_t groups, uint64_t counts[4],
                                                ebpo_error *error);
/* Counts the nodes of each type of a level before a group. */
EBPO_MUST_USE ebpo_status ebpo_ranks_before(ebpo_chunks *chunks, int level, uint64_t group,
                                            uint64_t ranks[4], ebpo_error *error);
/* Checks that [rank, rank + count) is within the level for each type. */
EBPO_MUST_USE ebpo_status ebpo_ranks_check(const ebpo_chunks *chunks, int level,
                                           const uint64_t ranks[4], const uint64_t counts[4],
                                           ebpo_error *error);
/* Counts the planes of the gray nodes before one. */
EBPO_MUST_USE ebpo_status ebpo_ranks_planes(ebpo_chunks *chunks, int level, uint64_t gray,
                                            uint64_t *planes, ebpo_error *error);
/* Finds the end of the new faces of the leaf before one, and counts the references of the leaves
 * before it. */
EBPO_MUST_USE ebpo_status ebpo_ranks_leaf(ebpo_chunks *chunks, int level, uint64_t leaf,
                                          uint64_t *end, uint64_t *refs, ebpo_error *error);

/* Counts the leaf planes of the leaves before one. */
EBPO_MUST_USE ebpo_status ebpo_ranks_leaf_planes(ebpo_chunks *chunks, int level, uint64_t leaf,
                                                 uint64_t *planes, ebpo_error *error);

/* --- prefetch hints --- */

/* Sends prefetch hints for all missing chunks of the subtrees [first, first + count): nodes below
 * their roots, in arrays for `needs`; with EBPO_NEEDS_MESH the faces that their leaves list, with
 * EBPO_NEEDS_MAPS the source indices of these faces. Without `faces`, only nodes down to
 * `last_level`. Reads the table's rows. Chunks without hints are read normally. For remote files
 * only. */
void ebpo_subtrees_hint(ebpo_chunks *chunks, ebpo_hints *expected, uint64_t first, uint64_t count,
                        uint32_t needs, int last_level, bool faces);

#endif
