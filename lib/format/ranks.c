/* Ranks: where a node's group, planes and faces begin. Of levels below the roots of subtrees the
 * table tells where each subtree begins; of others an index has a row each 4,096 items. Counting
 * goes on from there. */
#include <string.h>

#include "core/endian.h"
#include "core/error.h"
#include "format/chunks.h"
#include "format/ranks.h"
#include "format/subtree_table.h"
#include "geometry/node_types.h"

ebpo_status ebpo_ranks_count_file(ebpo_chunks *chunks, int level, uint64_t group, uint64_t groups,
                                  uint64_t counts[4], ebpo_error *error)
{
    ebpo_held_chunk view = { .array = ebpo_reader_array(chunks->file, EBPO_A_TYPES, level) };
    ebpo_status status = EBPO_OK;
    memset(counts, 0, 4 * sizeof *counts);
    while (groups && (status = ebpo_held_chunk_move(chunks, &view, group, error)) == EBPO_OK) {
        uint64_t here = view.end - group < groups ? view.end - group : groups, part[4];
        ebpo_groups_count(view.rows + 2 * (group - view.begin), here, part);
        for (int k = 0; k < 4; k++)
            counts[k] += part[k];
        group += here;
        groups -= here;
    }
    ebpo_held_chunk_release(chunks, &view);
    return status;
}

/* Numbers of up to 32 bits cannot overflow the sum of an array; larger ones must not. */
static bool sum_rows(const uint8_t *rows, unsigned element_size, uint64_t count, uint64_t *sum)
{
    uint64_t total = 0, all = 0;
    switch (element_size) {
    case 1:
        for (uint64_t i = 0; i < count; i++)
            total += rows[i];
        break;
    case 2:
        for (uint64_t i = 0; i < count; i++)
            total += ebpo_load16(rows + 2 * i);
        break;
    case 4:
        for (uint64_t i = 0; i < count; i++)
            total += ebpo_load32(rows + 4 * i);
        break;
    default:
        for (uint64_t i = 0; i < count; i++) {
            total += ebpo_load64(rows + 8 * i);
            all |= ebpo_load64(rows + 8 * i);
        }
    }
    *sum += total;
    return all < UINT64_C(1) << 40 && *sum < UINT64_C(1) << 62;
}

ebpo_status ebpo_chunks_sum(ebpo_chunks *chunks, ebpo_array_id id, int level, uint64_t row,
                            uint64_t rows, uint64_t *sum, ebpo_error *error)
{
    ebpo_held_chunk view = { .array = ebpo_reader_array(chunks->file, id, level) };
    ebpo_status status = EBPO_OK;
    unsigned size = view.array->shape.element_size;
    *sum = 0;
    while (rows && (status = ebpo_held_chunk_move(chunks, &view, row, error)) == EBPO_OK) {
        uint64_t here = view.end - row < rows ? view.end - row : rows;
        if (!sum_rows(view.rows + (row - view.begin) * size, size, here, sum)) {
            status = ebpo_chunks_fail(chunks, level, id, "the numbers are too large", error);
            break;
        }
        row += here;
        rows -= here;
    }
    ebpo_held_chunk_release(chunks, &view);
    return status;
}

/* Row of an index array for an item; row 0 is all zeros, whatever the file says there. */
static ebpo_status index_row(ebpo_chunks *chunks, ebpo_array_id id, int level, uint64_t item,
                             unsigned cols, uint64_t *row, ebpo_error *error)
{
    memset(row, 0, cols * sizeof *row);
    return item < EBPO_INDEX_ROWS ? EBPO_OK
                                  : ebpo_chunks_integers(chunks, id, level, item / EBPO_INDEX_ROWS,
                                                         1, row, sizeof *row, error);
}

/* The subtree that holds an item of a level, if the table tells of it. */
static ebpo_status find_subtree(ebpo_chunks *chunks, int level, unsigned what, uint64_t item,
                                ebpo_subtree_row *row, ebpo_error *error)
{
    return ebpo_subtree_table_find(chunks, ebpo_subtree_column(&chunks->file->info, level, what),
                                   item, row, error);
}

static uint64_t level_sum(const ebpo_chunks *chunks, const ebpo_subtree_row *row, int level,
                          unsigned what)
{
    return row->before[ebpo_subtree_column(&chunks->file->info, level, what)];
}

/* What the row says that the subtree has. */
static uint64_t level_has(const ebpo_chunks *chunks, const ebpo_subtree_row *row, int level,
                          unsigned what)
{
    return row->after[ebpo_subtree_column(&chunks->file->info, level, what)] -
           level_sum(chunks, row, level, what);
}

static const char *const contradicts = "the index contradicts the counts in the head";

/* Rows that add up may still tell a subtree what is another's: its own nodes are counted. */
static ebpo_status row_lies(const ebpo_chunks *chunks, ebpo_error *error)
{
    return ebpo_chunks_fail(chunks, -1, EBPO_A_SUBTREE_COUNTS,
                            "a row contradicts the nodes of its subtree", error);
}

static ebpo_status check_types(ebpo_chunks *chunks, int level, const ebpo_subtree_row *row,
                               ebpo_error *error)
{
    const ebpo_info *info = &chunks->file->info;
    uint64_t from = ebpo_subtree_groups(info, row, level, false),
             to = ebpo_subtree_groups(info, row, level, true), counts[4];
    ebpo_status status = ebpo_ranks_count_file(chunks, level, from, to - from, counts, error);
    if (status != EBPO_OK)
        return status;
    return counts[EBPO_GRAY] == level_has(chunks, row, level, EBPO_S_GRAY) &&
                   counts[EBPO_LEAF] == level_has(chunks, row, level, EBPO_S_LEAF) &&
                   counts[EBPO_BLACK] == level_has(chunks, row, level, EBPO_S_BLACK)
               ? EBPO_OK
               : row_lies(chunks, error);
}

/* A list: `id` has the counts of the nodes that `nodes` counts. */
static ebpo_status check_list(ebpo_chunks *chunks, int level, const ebpo_subtree_row *row,
                              ebpo_array_id id, unsigned nodes, unsigned what, ebpo_error *error)
{
    uint64_t sum = 0;
    ebpo_status status = ebpo_chunks_sum(chunks, id, level, level_sum(chunks, row, level, nodes),
                                         level_has(chunks, row, level, nodes), &sum, error);
    return status != EBPO_OK || sum == level_has(chunks, row, level, what)
               ? status
               : row_lies(chunks, error);
}

/* The end of the leaves' faces, and whether these are among the subtree's. */
static ebpo_status check_ends(ebpo_chunks *chunks, int level, const ebpo_subtree_row *row,
                              ebpo_error *error)
{
    uint64_t first = level_sum(chunks, row, level, EBPO_S_LEAF),
             leaves = level_has(chunks, row, level, EBPO_S_LEAF),
             grown = level_has(chunks, row, level, EBPO_S_ENDS),
             begin = level_sum(chunks, row, level, EBPO_S_ENDS), gap = 0, skip = 0, fresh = 0;
    if (leaves == 0)
        return grown ? row_lies(chunks, error) : EBPO_OK;
    ebpo_status status = ebpo_chunks_sum(chunks, EBPO_A_LEAF_SKIP, level, first, 1, &gap, error);
    if (status == EBPO_OK)
        status = ebpo_chunks_sum(chunks, EBPO_A_LEAF_SKIP, level, first, leaves, &skip, error);
    if (status == EBPO_OK)
        status = ebpo_chunks_sum(chunks, EBPO_A_LEAF_NEW, level, first, leaves, &fresh, error);
    if (status != EBPO_OK)
        return status;
    uint64_t has = row->after[EBPO_S_FACES] - row->before[EBPO_S_FACES];
    return skip + fresh == grown && begin + gap >= row->face && begin + grown <= row->face + has
               ? EBPO_OK
               : row_lies(chunks, error);
}

ebpo_status ebpo_ranks_check(const ebpo_chunks *chunks, int level, const uint64_t ranks[4],
                             const uint64_t counts[4], ebpo_error *error)
{
    const ebpo_level_summary *s = &chunks->file->info.level[level];
    const uint64_t all[4] = { s->white_count, s->black_count, s->leaf_count, s->gray_count };
    for (int k = 0; k < 4; k++)
        if (ranks[k] > all[k] || counts[k] > all[k] - ranks[k])
            return ebpo_chunks_fail(chunks, level, EBPO_A_TYPES,
                                    "the types contradict the counts in the head or the index",
                                    error);
    return EBPO_OK;
}

/* Ranks at which a subtree's groups of a level begin, and the first of these. */
static ebpo_status ranks_of_subtree(ebpo_chunks *chunks, int level, uint64_t group,
                                    uint64_t ranks[4], uint64_t *from, ebpo_error *error)
{
    const ebpo_info *info = &chunks->file->info;
    ebpo_subtree_row row;
    bool roots = level == info->subtree_level + 1; /* a group for each subtree */
    uint64_t last = info->level[info->subtree_level].gray_count - 1;
    ebpo_status status =
        roots ? ebpo_subtree_table_row(chunks, group < last ? group : last, &row, error)
              : find_subtree(chunks, level - 1, EBPO_S_GRAY, group, &row, error);
    if (status != EBPO_OK)
        return status;
    status = check_types(chunks, level, &row, error);
    *from = ebpo_subtree_groups(info, &row, level, false);
    ranks[EBPO_GRAY] = level_sum(chunks, &row, level, EBPO_S_GRAY);
    ranks[EBPO_LEAF] = level_sum(chunks, &row, level, EBPO_S_LEAF);
    ranks[EBPO_BLACK] = level_sum(chunks, &row, level, EBPO_S_BLACK);
    ranks[EBPO_WHITE] = 8 * *from - ranks[EBPO_GRAY] - ranks[EBPO_LEAF] - ranks[EBPO_BLACK];
    return status;
}

ebpo_status ebpo_ranks_before(ebpo_chunks *chunks, int level, uint64_t group, uint64_t ranks[4],
                              ebpo_error *error)
{
    uint64_t counts[4], from = group / EBPO_INDEX_ROWS * EBPO_INDEX_ROWS;
    ebpo_status status = ebpo_subtree_table_has(chunks->file, level)
                             ? ranks_of_subtree(chunks, level, group, ranks, &from, error)
                             : index_row(chunks, EBPO_A_TYPES_INDEX, level, group, 4, ranks, error);
    if (status == EBPO_OK)
        status = ebpo_ranks_count_file(chunks, level, from, group - from, counts, error);
    if (status == EBPO_OK)
        status = ebpo_ranks_check(chunks, level, ranks, counts, error);
    for (int k = 0; k < 4 && status == EBPO_OK; k++)
        ranks[k] += counts[k];
    return status;
}

ebpo_status ebpo_ranks_planes(ebpo_chunks *chunks, int level, uint64_t gray, uint64_t *planes,
                              ebpo_error *error)
{
    uint64_t sum = 0, from = gray / EBPO_INDEX_ROWS * EBPO_INDEX_ROWS,
             all = chunks->file->info.level[level].plane_count;
    ebpo_subtree_row row;
    ebpo_status status;
    if (ebpo_subtree_table_has(chunks->file, level)) {
        status = find_subtree(chunks, level, EBPO_S_GRAY, gray, &row, error);
        if (status == EBPO_OK)
            status = check_list(chunks, level, &row, EBPO_A_PLANE_COUNTS, EBPO_S_GRAY,
                                EBPO_S_PLANES, error);
        if (status != EBPO_OK)
            return status;
        from = level_sum(chunks, &row, level, EBPO_S_GRAY);
        *planes = level_sum(chunks, &row, level, EBPO_S_PLANES);
    } else {
        status = index_row(chunks, EBPO_A_GRAY_INDEX, level, gray, 1, planes, error);
    }
    if (status == EBPO_OK)
        status =
            ebpo_chunks_sum(chunks, EBPO_A_PLANE_COUNTS, level, from, gray - from, &sum, error);
    if (status == EBPO_OK && (*planes > all || sum > all - *planes))
        status = ebpo_chunks_fail(chunks, level, EBPO_A_GRAY_INDEX, contradicts, error);
    *planes += sum;
    return status;
}

/* What leaf_index says, or the table; of the leaf `*from`. `faces`: of these, else of planes. */
static ebpo_status leaf_row(ebpo_chunks *chunks, int level, uint64_t leaf, bool faces,
                            uint64_t row[3], uint64_t *from, ebpo_error *error)
{
    ebpo_subtree_row subtree;
    if (!ebpo_subtree_table_has(chunks->file, level))
        return index_row(chunks, EBPO_A_LEAF_INDEX, level, leaf, 3, row, error);
    ebpo_status status = find_subtree(chunks, level, EBPO_S_LEAF, leaf, &subtree, error);
    if (status == EBPO_OK)
        status = faces ? check_list(chunks, level, &subtree, EBPO_A_LEAF_REF_COUNT, EBPO_S_LEAF,
                                    EBPO_S_REFS, error)
                       : check_list(chunks, level, &subtree, EBPO_A_LEAF_PLANE_COUNTS, EBPO_S_LEAF,
                                    EBPO_S_LEAF_PLANES, error);
    if (status == EBPO_OK && faces)
        status = check_ends(chunks, level, &subtree, error);
    if (status != EBPO_OK)
        return status;
    *from = level_sum(chunks, &subtree, level, EBPO_S_LEAF);
    row[0] = level_sum(chunks, &subtree, level, EBPO_S_ENDS);
    row[1] = level_sum(chunks, &subtree, level, EBPO_S_REFS);
    row[2] = level_sum(chunks, &subtree, level, EBPO_S_LEAF_PLANES);
    return EBPO_OK;
}

ebpo_status ebpo_ranks_leaf(ebpo_chunks *chunks, int level, uint64_t leaf, uint64_t *end,
                            uint64_t *refs, ebpo_error *error)
{
    const ebpo_info *info = &chunks->file->info;
    uint64_t row[3], skip = 0, fresh = 0, listed = 0,
                     from = leaf / EBPO_INDEX_ROWS * EBPO_INDEX_ROWS;
    ebpo_status status = leaf_row(chunks, level, leaf, true, row, &from, error);
    if (status == EBPO_OK)
        status = ebpo_chunks_sum(chunks, EBPO_A_LEAF_SKIP, level, from, leaf - from, &skip, error);
    if (status == EBPO_OK)
        status = ebpo_chunks_sum(chunks, EBPO_A_LEAF_NEW, level, from, leaf - from, &fresh, error);
    if (status == EBPO_OK)
        status = ebpo_chunks_sum(chunks, EBPO_A_LEAF_REF_COUNT, level, from, leaf - from, &listed,
                                 error);
    if (status != EBPO_OK)
        return status;
    if (row[0] > info->face_count || skip > info->face_count - row[0] ||
        fresh > info->face_count - row[0] - skip)
        return ebpo_chunks_fail(chunks, level, EBPO_A_LEAF_SKIP,
                                "a leaf's new faces lie beyond the last face", error);
    if (row[1] > info->level[level].ref_count || listed > info->level[level].ref_count - row[1])
        return ebpo_chunks_fail(chunks, level, EBPO_A_LEAF_INDEX, contradicts, error);
    *end = row[0] + skip + fresh;
    *refs = row[1] + listed;
    return EBPO_OK;
}

ebpo_status ebpo_ranks_leaf_planes(ebpo_chunks *chunks, int level, uint64_t leaf, uint64_t *planes,
                                   ebpo_error *error)
{
    uint64_t row[3], sum = 0, from = leaf / EBPO_INDEX_ROWS * EBPO_INDEX_ROWS,
                     all = chunks->file->info.level[level].leaf_plane_count;
    ebpo_status status = leaf_row(chunks, level, leaf, false, row, &from, error);
    if (status == EBPO_OK)
        status = ebpo_chunks_sum(chunks, EBPO_A_LEAF_PLANE_COUNTS, level, from, leaf - from, &sum,
                                 error);
    if (status == EBPO_OK && (row[2] > all || sum > all - row[2]))
        status = ebpo_chunks_fail(chunks, level, EBPO_A_LEAF_INDEX, contradicts, error);
    *planes = row[2] + sum;
    return status;
}
