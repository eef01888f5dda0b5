/* Locates the rows of subtrees, groups, planes and faces in every array, by the table
 * /subtrees/counts or by the index arrays. Results are consistent with the counts in the header.
 * Any thread may call these functions. Source: format-spec/subtrees.md. */
#ifndef EBPO_FORMAT_SUBTREE_INDEX_H
#define EBPO_FORMAT_SUBTREE_INDEX_H

#include "format/chunks.h"

/* Maximum number of columns of /subtrees/counts. */
enum { EBPO_SUBTREE_COLS = EBPO_SUBTREE_LEVELS + EBPO_SUBTREE_LEVEL_COLS * EBPO_LEVELS_MAX };

/* Position of a subtree in the file's arrays, from the table /subtrees/counts (columns: EBPO_S_...
 * of schema.h). */
typedef struct ebpo_subtree_row {
    uint64_t subtree;                   /* index of the subtree */
    uint64_t before[EBPO_SUBTREE_COLS]; /* sums of the columns over the preceding subtrees */
    uint64_t after[EBPO_SUBTREE_COLS];  /* sums of the columns including this subtree */
    uint64_t face, vertex;              /* first owned face and vertex of the subtree */
} ebpo_subtree_row;

/* Returns true if the table has columns for a level: if the level is below the subtrees' roots. */
static inline bool ebpo_subtree_table_has(const ebpo_file *file, int level)
{
    return file->info.subtree_level && level > file->info.subtree_level;
}

/* Reads a subtree's row; the index must be less than the number of subtrees. */
EBPO_MUST_USE ebpo_status ebpo_subtree_table_row(ebpo_chunks *chunks, uint64_t subtree,
                                                 ebpo_subtree_row *out, ebpo_error *error);
/* Finds the subtree that contains item number `item` of the items that column `column` counts. This
 * is the last subtree before which there are at most `item` of these items. */
EBPO_MUST_USE ebpo_status ebpo_subtree_table_find(ebpo_chunks *chunks, unsigned column,
                                                  uint64_t item, ebpo_subtree_row *out,
                                                  ebpo_error *error);

/* ebpo_subtree_faces_note remembers that the faces of a subtree were checked (subtree_faces.h).
 * ebpo_subtree_faces_known returns true if this is remembered; not every checked subtree is
 * remembered. */
bool ebpo_subtree_faces_known(ebpo_chunks *chunks, uint64_t subtree);
void ebpo_subtree_faces_note(ebpo_chunks *chunks, uint64_t subtree);

/* Returns the number of groups of a level before the row's subtree. If `after` is true, returns the
 * number of groups before the next subtree. */
uint64_t ebpo_subtree_groups(const ebpo_info *info, const ebpo_subtree_row *row, int level,
                             bool after);

/* Adds to `keys` the chunks of the table that are not in memory and are needed to find an item of a
 * level. `per` is the kind of item: EBPO_PER_GROUP, EBPO_PER_GRAY or EBPO_PER_LEAF. Returns true if
 * there are such chunks. Also returns true on errors, which the later read reports. If the function
 * returns false, *first is the first item of this kind in the subtree of `item`. */
bool ebpo_subtree_table_missing(ebpo_chunks *chunks, int level, ebpo_per per, uint64_t item,
                                ebpo_chunk_keys *keys, uint64_t *first);

/* Send prefetch hints for the table's rows of `count` subtrees: a list in any order, or
 * [first, first + count). */
void ebpo_subtree_table_hint(ebpo_chunks *chunks, const uint64_t *subtrees, uint64_t count);
void ebpo_subtree_table_hint_run(ebpo_chunks *chunks, uint64_t first, uint64_t count);

/* --- ranks: a rank is the number of items before an item. It is a sum in the preceding row of an
 * index array or of the table, plus the number of items since this row --- */

/* Sums rows of an unsigned array. Returns EBPO_E_FORMAT when the sum is 2^62 or more. */
EBPO_MUST_USE ebpo_status ebpo_chunks_sum(ebpo_chunks *chunks, ebpo_array_id id, int level,
                                          uint64_t row, uint64_t rows, uint64_t *sum,
                                          ebpo_error *error);

/* Counts the nodes of each type in groups [group, group + groups), like ebpo_groups_count. */
EBPO_MUST_USE ebpo_status ebpo_ranks_count_file(ebpo_chunks *chunks, int level, uint64_t group,
                                                uint64_t groups, uint64_t counts[4],
                                                ebpo_error *error);
/* Counts the nodes of each type of a level before a group. */
EBPO_MUST_USE ebpo_status ebpo_ranks_before(ebpo_chunks *chunks, int level, uint64_t group,
                                            uint64_t ranks[4], ebpo_error *error);
/* Checks that, for each type of node, the ranks [rank, rank + count) are within the level. */
EBPO_MUST_USE ebpo_status ebpo_ranks_check(const ebpo_chunks *chunks, int level,
                                           const uint64_t ranks[4], const uint64_t counts[4],
                                           ebpo_error *error);
/* Counts the planes of the gray nodes before gray node `gray`. */
EBPO_MUST_USE ebpo_status ebpo_ranks_planes(ebpo_chunks *chunks, int level, uint64_t gray,
                                            uint64_t *planes, ebpo_error *error);
/* Finds the end of the new faces (one past the last) of the leaf before `leaf`, and counts the
 * references of all leaves before `leaf`. */
EBPO_MUST_USE ebpo_status ebpo_ranks_leaf(ebpo_chunks *chunks, int level, uint64_t leaf,
                                          uint64_t *end, uint64_t *refs, ebpo_error *error);

/* Counts the stored planes of the leaves before `leaf`. */
EBPO_MUST_USE ebpo_status ebpo_ranks_leaf_planes(ebpo_chunks *chunks, int level, uint64_t leaf,
                                                 uint64_t *planes, ebpo_error *error);

/* --- prefetch hints --- */

/* For remote files: adds to `hints` the chunks of the subtrees [first, first + count) that are not
 * in memory. These are the chunks with nodes below the subtrees' roots, of the arrays that `needs`
 * requires. With EBPO_NEEDS_MESH, also the chunks of the faces that the leaves list, and with
 * EBPO_NEEDS_MAPS the chunks of the source indices of these faces. If `faces` is false: no faces,
 * and nodes only down to `last_level`. Reads the table's rows. May omit chunks, which are then read
 * without a hint. */
void ebpo_subtrees_hint(ebpo_chunks *chunks, ebpo_hints *hints, uint64_t first, uint64_t count,
                        uint32_t needs, int last_level, bool faces);

/* For remote files: adds to `hints` the chunks, not in memory, of the faces and vertices that are
 * new in leaves in no subtree, after subtree - 1 and before `subtree`, depth first (the number of
 * subtrees, which must not be 0: after the last subtree). With EBPO_NEEDS_MAPS, also the chunks of
 * source indices. Reads the table's row. Adds at most the first EBPO_FACE_BLOCK faces and vertices.
 */
void ebpo_subtrees_hint_before(ebpo_chunks *chunks, ebpo_hints *hints, uint64_t subtree,
                               uint32_t needs);

#endif
