/* Locates subtrees and nodes in every array. The first part reads the file's table of subtrees: for
 * each subtree the sums of all counts before it, from sums stored for some rows and counts in
 * between; recently used rows are cached. The second part computes ranks: the planes, faces and
 * nodes of each type before a node. Levels below the roots of subtrees begin at the subtree's row;
 * other levels have an index row for every 4,096 items, from which counting continues. Results are
 * checked against the counts in the head. The last part sends prefetch hints for subtrees. Source:
 * format-spec/subtrees.md. */
#include <stdlib.h>
#include <string.h>

#include "core/alloc.h"
#include "core/endian.h"
#include "core/error.h"
#include "format/chunks.h"
#include "format/subtree_index.h"
#include "geometry/level_nodes.h"

static ebpo_status table_fails(const ebpo_chunks *chunks, ebpo_array_id id, const char *what,
                               ebpo_error *error)
{
    return ebpo_chunks_fail(chunks, -1, id, what, error);
}

/* Returns the maximum sum of a column; *exact is true if it must be reached. */
static uint64_t column_total(const ebpo_file *file, unsigned column, bool *exact)
{
    const ebpo_info *info = &file->info;
    bool mesh = info->parts & EBPO_PART_MESH, planes = info->parts & EBPO_PART_PLANES,
         leaf_planes = info->parts & EBPO_PART_LEAF_PLANES;
    *exact = column >= EBPO_SUBTREE_LEVELS;
    if (column <= EBPO_S_FACES)
        return mesh ? info->face_count : 0;
    if (column <= EBPO_S_VERTICES)
        return mesh ? info->vertex_count : 0;
    if (column < EBPO_SUBTREE_LEVELS)
        return file->root_array[EBPO_A_SUBTREE_SHARED].shape.rows;
    unsigned k = column - EBPO_SUBTREE_LEVELS;
    const ebpo_level_summary *s =
        &info->level[info->subtree_level + 1 + (int)(k / EBPO_SUBTREE_LEVEL_COLS)];
    switch (k % EBPO_SUBTREE_LEVEL_COLS) {
    case EBPO_S_GRAY: return s->gray_count;
    case EBPO_S_LEAF: return s->leaf_count;
    case EBPO_S_BLACK: return s->black_count;
    case EBPO_S_PLANES: return planes ? s->plane_count : 0;
    case EBPO_S_LEAF_PLANES: return leaf_planes ? s->leaf_plane_count : 0;
    case EBPO_S_REFS: return mesh ? s->ref_count : 0;
    default: *exact = false; return mesh ? info->face_count : 0;
    }
}

/* Reads the sums before a chunk of rows; after the last chunk, the head's counts. */
static ebpo_status checksums_before(ebpo_chunks *chunks, uint64_t chunk, uint32_t cols,
                                    uint64_t *checksums, ebpo_error *error)
{
    const ebpo_array_in *index = ebpo_reader_array(chunks->file, EBPO_A_SUBTREE_INDEX, 0);
    bool exact;
    ebpo_status status = EBPO_OK;
    if (chunk == index->shape.rows) {
        for (uint32_t k = 0; k < cols; k++)
            checksums[k] = column_total(chunks->file, k, &exact);
        return EBPO_OK;
    }
    ebpo_held_chunk view = { .array = index };
    status = ebpo_held_chunk_move(chunks, &view, chunk, error);
    for (uint32_t k = 0; k < cols && status == EBPO_OK; k++) {
        checksums[k] = ebpo_load64(view.rows + ((chunk - view.begin) * cols + k) * 8);
        if (checksums[k] > column_total(chunks->file, k, &exact) || (chunk == 0 && checksums[k]))
            status = table_fails(chunks, EBPO_A_SUBTREE_INDEX,
                                 "the sums contradict the counts in the head", error);
    }
    ebpo_held_chunk_release(chunks, &view);
    return status;
}

typedef struct subtree_counts {
    ebpo_held_chunk view;
    uint32_t cols;
    uint64_t begin[EBPO_SUBTREE_COLS], end[EBPO_SUBTREE_COLS]; /* sums before and after the chunk */
} subtree_counts;

static uint32_t count_at(const subtree_counts *c, uint64_t subtree, uint32_t column)
{
    return ebpo_load32(c->view.rows + ((subtree - c->view.begin) * c->cols + column) * 4);
}

static void add_row(const subtree_counts *c, uint64_t subtree, uint64_t *checksums)
{
    for (uint32_t k = 0; k < c->cols; k++)
        checksums[k] += count_at(c, subtree, k);
}

/* Opens the chunk of rows that contains a subtree, and checks that it adds up to the sums after it.
 */
static ebpo_status open_counts(ebpo_chunks *chunks, uint64_t subtree, subtree_counts *c,
                               ebpo_error *error)
{
    const ebpo_array_in *array = ebpo_reader_array(chunks->file, EBPO_A_SUBTREE_COUNTS, 0);
    uint64_t rows = array->shape.chunk_rows, chunk = subtree / rows, checksums[EBPO_SUBTREE_COLS];
    c->view = (ebpo_held_chunk){ .array = array };
    c->cols = array->shape.cols;
    ebpo_status status = checksums_before(chunks, chunk, c->cols, c->begin, error);
    if (status == EBPO_OK)
        status = checksums_before(chunks, chunk + 1, c->cols, c->end, error);
    if (status == EBPO_OK)
        status = ebpo_held_chunk_move(chunks, &c->view, subtree, error);
    if (status != EBPO_OK)
        return status;
    memcpy(checksums, c->begin, sizeof checksums);
    for (uint64_t i = c->view.begin; i < c->view.end; i++)
        add_row(c, i, checksums);
    bool last = c->view.end == array->shape.rows, exact;
    if (last && checksums[EBPO_S_SHARED_FACES] + checksums[EBPO_S_SHARED_VERTICES] !=
                    c->end[EBPO_S_SHARED_FACES]) /* they share its rows */
        status = table_fails(chunks, EBPO_A_SUBTREE_SHARED,
                             "its rows do not match the table's counts", error);
    for (uint32_t k = 0; k < c->cols && status == EBPO_OK; k++) {
        (void)column_total(chunks->file, k, &exact);
        if (last && !exact ? checksums[k] > c->end[k] : checksums[k] != c->end[k])
            status = table_fails(chunks, EBPO_A_SUBTREE_COUNTS,
                                 "the rows do not add up to the sums in the index", error);
    }
    if (status != EBPO_OK)
        ebpo_held_chunk_release(chunks, &c->view);
    return status;
}

static void take_row(const subtree_counts *c, uint64_t subtree, ebpo_subtree_row *out)
{
    out->subtree = subtree;
    memcpy(out->before, c->begin, sizeof out->before);
    for (uint64_t i = c->view.begin; i < subtree; i++)
        add_row(c, i, out->before);
    memcpy(out->after, out->before, sizeof out->after);
    add_row(c, subtree, out->after);
    out->face = out->after[EBPO_S_FACES_BEFORE] + out->before[EBPO_S_FACES];
    out->vertex = out->after[EBPO_S_VERTICES_BEFORE] + out->before[EBPO_S_VERTICES];
}

/* Checks a row. Faces and vertices of other leaves count as well. */
static ebpo_status check_row(const ebpo_chunks *chunks, const ebpo_subtree_row *row,
                             ebpo_error *error)
{
    const ebpo_info *info = &chunks->file->info;
    if (info->parts & EBPO_PART_MESH &&
        (row->after[EBPO_S_FACES_BEFORE] + row->after[EBPO_S_FACES] > info->face_count ||
         row->after[EBPO_S_VERTICES_BEFORE] + row->after[EBPO_S_VERTICES] > info->vertex_count))
        return table_fails(chunks, EBPO_A_SUBTREE_COUNTS,
                           "a subtree's faces are beyond the last face", error);
    for (int level = info->subtree_level + 1; level < info->level_count; level++)
        for (int end = 0; end < 2; end++) {
            const uint64_t *checksums = end ? row->after : row->before;
            unsigned column = ebpo_subtree_column(info, level, 0);
            if (checksums[column + EBPO_S_GRAY] + checksums[column + EBPO_S_LEAF] +
                    checksums[column + EBPO_S_BLACK] >
                8 * ebpo_subtree_groups(info, row, level, end))
                return table_fails(chunks, EBPO_A_SUBTREE_COUNTS,
                                   "a subtree has more nodes than its groups hold", error);
        }
    return EBPO_OK;
}

uint64_t ebpo_subtree_groups(const ebpo_info *info, const ebpo_subtree_row *row, int level,
                             bool after)
{
    const uint64_t *checksums = after ? row->after : row->before;
    return level == info->subtree_level + 1
               ? row->subtree + after
               : checksums[ebpo_subtree_column(info, level - 1, EBPO_S_GRAY)];
}

/* --- cache of rows: one subtree is requested repeatedly while it is read, and summing a chunk of
 * rows takes longer than the rest of a request --- */

enum {
    KEPT = 4 /* threads that read at once, typically two */,
    FACES_KNOWN = 64,
    BY_NUMBER = EBPO_SUBTREE_COLS
};

struct ebpo_kept_rows {
    ebpo_subtree_row row[KEPT];
    unsigned count, next;
    uint64_t faces_known[FACES_KNOWN]; /* numbers of subtrees, plus 1 */
};

static bool row_holds(const ebpo_subtree_row *row, unsigned column, uint64_t item)
{
    return column == BY_NUMBER ? row->subtree == item
                               : row->before[column] <= item && item < row->after[column];
}

/* Finds a cached row of a subtree, or (by a column) of the subtree that contains an item. */
static bool find_kept(ebpo_chunks *chunks, unsigned column, uint64_t item, ebpo_subtree_row *out)
{
    bool found = false;
    pthread_mutex_lock(&chunks->lock);
    const struct ebpo_kept_rows *kept = chunks->rows;
    for (unsigned i = 0; kept && i < kept->count && !found; i++)
        if ((found = row_holds(&kept->row[i], column, item)))
            *out = kept->row[i];
    pthread_mutex_unlock(&chunks->lock);
    return found;
}

/* Checks a row, and caches it; not for counted chunks, where each read counts. */
static ebpo_status keep_row(ebpo_chunks *chunks, const ebpo_subtree_row *row, ebpo_error *error)
{
    ebpo_status status = check_row(chunks, row, error);
    if (status != EBPO_OK || chunks->counted)
        return status;
    pthread_mutex_lock(&chunks->lock);
    if (!chunks->rows)
        chunks->rows = ebpo_alloc_zero(1, sizeof *chunks->rows); /* without memory, rows are not
                                                                  * cached */
    if (chunks->rows) {
        chunks->rows->row[chunks->rows->next] = *row;
        chunks->rows->next = (chunks->rows->next + 1) % KEPT;
        chunks->rows->count += chunks->rows->count < KEPT;
    }
    pthread_mutex_unlock(&chunks->lock);
    return EBPO_OK;
}

bool ebpo_subtree_faces_known(ebpo_chunks *chunks, uint64_t subtree)
{
    pthread_mutex_lock(&chunks->lock);
    bool known = chunks->rows && chunks->rows->faces_known[subtree % FACES_KNOWN] == subtree + 1;
    pthread_mutex_unlock(&chunks->lock);
    return known;
}

void ebpo_subtree_faces_note(ebpo_chunks *chunks, uint64_t subtree)
{
    pthread_mutex_lock(&chunks->lock);
    if (chunks->rows)
        chunks->rows->faces_known[subtree % FACES_KNOWN] = subtree + 1;
    pthread_mutex_unlock(&chunks->lock);
}

ebpo_status ebpo_subtree_table_row(ebpo_chunks *chunks, uint64_t subtree, ebpo_subtree_row *out,
                                   ebpo_error *error)
{
    subtree_counts c;
    if (find_kept(chunks, BY_NUMBER, subtree, out))
        return EBPO_OK;
    ebpo_status status = open_counts(chunks, subtree, &c, error);
    if (status != EBPO_OK)
        return status;
    take_row(&c, subtree, out);
    ebpo_held_chunk_release(chunks, &c.view);
    return keep_row(chunks, out, error);
}

/* Finds the last chunk of rows with at most `item` items before it. */
static ebpo_status find_chunk(ebpo_chunks *chunks, unsigned column, uint64_t item, uint64_t *out,
                              ebpo_error *error)
{
    const ebpo_array_in *index = ebpo_reader_array(chunks->file, EBPO_A_SUBTREE_INDEX, 0);
    uint64_t low = 0, high = index->shape.rows - 1, checksums[EBPO_SUBTREE_COLS];
    ebpo_status status = EBPO_OK;
    while (low < high && status == EBPO_OK) {
        uint64_t middle = low + (high - low + 1) / 2;
        status = checksums_before(chunks, middle, index->shape.cols, checksums, error);
        if (status == EBPO_OK && checksums[column] <= item)
            low = middle;
        else
            high = middle - 1;
    }
    *out = low;
    return status;
}

ebpo_status ebpo_subtree_table_find(ebpo_chunks *chunks, unsigned column, uint64_t item,
                                    ebpo_subtree_row *out, ebpo_error *error)
{
    const ebpo_array_in *array = ebpo_reader_array(chunks->file, EBPO_A_SUBTREE_COUNTS, 0);
    uint64_t chunk = 0;
    subtree_counts c;
    if (find_kept(chunks, column, item, out))
        return EBPO_OK;
    ebpo_status status = find_chunk(chunks, column, item, &chunk, error);
    if (status == EBPO_OK)
        status = open_counts(chunks, chunk * array->shape.chunk_rows, &c, error);
    if (status != EBPO_OK)
        return status;
    uint64_t found = c.view.begin, sum = c.begin[column];
    for (uint64_t i = c.view.begin; i + 1 < c.view.end; i++) {
        sum += count_at(&c, i, column);
        found = sum <= item ? i + 1 : found;
    }
    take_row(&c, found, out);
    ebpo_held_chunk_release(chunks, &c.view);
    return keep_row(chunks, out, error);
}

/* Groups of the first level below the roots correspond to subtrees. */
static bool is_direct(const ebpo_info *info, int level, ebpo_per per)
{
    return per == EBPO_PER_GROUP && level == info->subtree_level + 1;
}

static unsigned column_of(const ebpo_info *info, int level, ebpo_per per)
{
    return per == EBPO_PER_GROUP  ? ebpo_subtree_column(info, level - 1, EBPO_S_GRAY)
           : per == EBPO_PER_GRAY ? ebpo_subtree_column(info, level, EBPO_S_GRAY)
                                  : ebpo_subtree_column(info, level, EBPO_S_LEAF);
}

bool ebpo_subtree_table_missing(ebpo_chunks *chunks, int level, ebpo_per per, uint64_t item,
                                ebpo_chunk_keys *keys, uint64_t *first)
{
    const ebpo_file *file = chunks->file;
    const ebpo_array_in *index = ebpo_reader_array(file, EBPO_A_SUBTREE_INDEX, 0),
                        *rows = ebpo_reader_array(file, EBPO_A_SUBTREE_COUNTS, 0);
    bool direct = is_direct(&file->info, level, per);
    unsigned column = direct ? 0 : column_of(&file->info, level, per);
    uint64_t chunk = item / rows->shape.chunk_rows;
    ebpo_subtree_row row;
    *first = item;
    if (ebpo_chunks_missing(chunks, EBPO_A_SUBTREE_INDEX, 0, 0, index->shape.rows, keys))
        return true;
    if (!direct && find_chunk(chunks, column, item, &chunk, NULL) != EBPO_OK)
        return true;
    if (ebpo_chunks_missing(chunks, EBPO_A_SUBTREE_COUNTS, 0, chunk * rows->shape.chunk_rows, 1,
                            keys))
        return true;
    if (direct)
        return false;
    if (ebpo_subtree_table_find(chunks, column, item, &row, NULL) != EBPO_OK)
        return true;
    *first = row.before[column];
    return false;
}

/* Collects a chunk of the table, and the corresponding rows of `outer`. */
static void expect_rows_at(ebpo_chunks *chunks, ebpo_hints *e, uint64_t chunk)
{
    const ebpo_shape *shape = &ebpo_reader_array(chunks->file, EBPO_A_SUBTREE_COUNTS, 0)->shape;
    uint64_t checksums[EBPO_SUBTREE_COLS], outer[2];
    for (int k = 0; k < 2; k++) {
        if (!ebpo_input_expects(&chunks->file->in) ||
            checksums_before(chunks, chunk + (uint64_t)k, shape->cols, checksums, NULL) != EBPO_OK)
            return; /* the actual read reports errors */
        outer[k] = checksums[EBPO_S_SHARED_FACES] + checksums[EBPO_S_SHARED_VERTICES];
    }
    ebpo_chunks_hint(chunks, e, EBPO_A_SUBTREE_COUNTS, 0, chunk * shape->chunk_rows, 1);
    if (outer[1] > outer[0])
        ebpo_chunks_hint(chunks, e, EBPO_A_SUBTREE_SHARED, 0, outer[0], outer[1] - outer[0]);
}

void ebpo_subtree_table_hint_run(ebpo_chunks *chunks, uint64_t first, uint64_t count)
{
    uint64_t rows = ebpo_reader_array(chunks->file, EBPO_A_SUBTREE_COUNTS, 0)->shape.chunk_rows,
             all = ebpo_reader_array(chunks->file, EBPO_A_SUBTREE_COUNTS, 0)->shape.rows;
    ebpo_hints e = EBPO_HINTS_INIT(chunks->file);
    for (uint64_t at = first / rows * rows; at < first + count && at < all; at += rows)
        expect_rows_at(chunks, &e, at / rows);
    ebpo_hint_all(&e);
}

void ebpo_subtree_table_hint(ebpo_chunks *chunks, const uint64_t *subtrees, uint64_t count)
{
    uint64_t rows = ebpo_reader_array(chunks->file, EBPO_A_SUBTREE_COUNTS, 0)->shape.chunk_rows;
    ebpo_hints e = EBPO_HINTS_INIT(chunks->file);
    for (uint64_t i = 0; i < count; i++)
        if (i == 0 || subtrees[i] / rows != subtrees[i - 1] / rows)
            expect_rows_at(chunks, &e, subtrees[i] / rows);
    ebpo_hint_all(&e);
}

/* --- ranks --- */

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

/* Sums numbers of up to 32 bits, which cannot overflow; checks larger ones. */
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

/* Reads the row of an index array for an item; row 0 is all zeros, whatever the file contains. */
static ebpo_status index_row(ebpo_chunks *chunks, ebpo_array_id id, int level, uint64_t item,
                             unsigned cols, uint64_t *row, ebpo_error *error)
{
    memset(row, 0, cols * sizeof *row);
    return item < EBPO_INDEX_ROWS ? EBPO_OK
                                  : ebpo_chunks_integers(chunks, id, level, item / EBPO_INDEX_ROWS,
                                                         1, row, sizeof *row, error);
}

/* Finds the subtree that contains an item of a level, if the table covers it. */
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

/* Returns the row's count for the subtree. */
static uint64_t level_has(const ebpo_chunks *chunks, const ebpo_subtree_row *row, int level,
                          unsigned what)
{
    return row->after[ebpo_subtree_column(&chunks->file->info, level, what)] -
           level_sum(chunks, row, level, what);
}

static const char *const contradicts = "the index contradicts the counts in the head";

/* Reports a row that assigns nodes to the wrong subtree; sums alone do not detect this, so nodes
 * are counted. */
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

/* Checks a list: `id` has the counts of the nodes that `nodes` counts. */
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

/* Checks the end of the leaves' faces, and that the faces of the leaves are within the range of the
 * subtree's faces. */
static ebpo_status check_ends(ebpo_chunks *chunks, int level, const ebpo_subtree_row *row,
                              ebpo_error *error)
{
    uint64_t first = level_sum(chunks, row, level, EBPO_S_LEAF),
             leaves = level_has(chunks, row, level, EBPO_S_LEAF),
             growth = level_has(chunks, row, level, EBPO_S_ENDS),
             begin = level_sum(chunks, row, level, EBPO_S_ENDS), gap = 0, skip = 0, fresh = 0;
    if (leaves == 0)
        return growth ? row_lies(chunks, error) : EBPO_OK;
    ebpo_status status = ebpo_chunks_sum(chunks, EBPO_A_LEAF_SKIP, level, first, 1, &gap, error);
    if (status == EBPO_OK)
        status = ebpo_chunks_sum(chunks, EBPO_A_LEAF_SKIP, level, first, leaves, &skip, error);
    if (status == EBPO_OK)
        status = ebpo_chunks_sum(chunks, EBPO_A_LEAF_NEW, level, first, leaves, &fresh, error);
    if (status != EBPO_OK)
        return status;
    uint64_t has = row->after[EBPO_S_FACES] - row->before[EBPO_S_FACES];
    return skip + fresh == growth && begin + gap >= row->face && begin + growth <= row->face + has
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

/* Computes the ranks at which a subtree's groups of a level begin, and the first of these groups.
 */
static ebpo_status ranks_of_subtree(ebpo_chunks *chunks, int level, uint64_t group,
                                    uint64_t ranks[4], uint64_t *from, ebpo_error *error)
{
    const ebpo_info *info = &chunks->file->info;
    ebpo_subtree_row row;
    bool roots = level == info->subtree_level + 1; /* one group for each subtree */
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

/* Reads the row of leaf_index, or of the table, for leaf `*from`. `faces`: the sums of faces,
 * otherwise of planes. */
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
                                "a leaf's new faces are beyond the last face", error);
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

typedef struct reporting {
    ebpo_chunks *chunks;
    ebpo_hints *expected;
    const ebpo_subtree_row *first, *last;
    uint32_t needs;
    int last_level;
} reporting;

static void expect_rows(const reporting *t, ebpo_array_id id, int level, uint64_t begin,
                        uint64_t end)
{
    if (end > begin)
        ebpo_chunks_hint(t->chunks, t->expected, id, level, begin, end - begin);
}

/* Returns the level's sums of a column before or after the subtrees. */
static uint64_t subtree_sum(const reporting *t, int level, unsigned what, bool after)
{
    unsigned column = ebpo_subtree_column(&t->chunks->file->info, level, what);
    return after ? t->last->after[column] : t->first->before[column];
}

static uint64_t sum_of(const reporting *t, ebpo_per per, int level, bool after)
{
    const ebpo_info *info = &t->chunks->file->info;
    uint64_t groups = ebpo_subtree_groups(info, after ? t->last : t->first, level, after);
    switch (per) {
    case EBPO_PER_GROUP: return groups;
    case EBPO_PER_GRAY: return subtree_sum(t, level, EBPO_S_GRAY, after);
    case EBPO_PER_LEAF: return subtree_sum(t, level, EBPO_S_LEAF, after);
    case EBPO_PER_BLACK: return subtree_sum(t, level, EBPO_S_BLACK, after);
    case EBPO_PER_WHITE:
        return 8 * groups - subtree_sum(t, level, EBPO_S_GRAY, after) -
               subtree_sum(t, level, EBPO_S_LEAF, after) -
               subtree_sum(t, level, EBPO_S_BLACK, after);
    case EBPO_PER_PLANE: return subtree_sum(t, level, EBPO_S_PLANES, after);
    case EBPO_PER_LEAF_PLANE: return subtree_sum(t, level, EBPO_S_LEAF_PLANES, after);
    case EBPO_PER_REF: return subtree_sum(t, level, EBPO_S_REFS, after);
    default: return 0; /* index arrays, which the table replaces */
    }
}

static void report_nodes(const reporting *t)
{
    const ebpo_info *info = &t->chunks->file->info;
    for (int level = info->subtree_level + 1; level < info->level_count && level <= t->last_level;
         level++)
        for (int id = 0; id < EBPO_LEVEL_ARRAYS; id++)
            if (ebpo_schema[id].needs & t->needs)
                expect_rows(t, (ebpo_array_id)id, level,
                            sum_of(t, ebpo_schema[id].per, level, false),
                            sum_of(t, ebpo_schema[id].per, level, true));
}

/* Collects a chunk of faces or vertices, `distance` blocks before `from`. */
static void report_block(const reporting *t, ebpo_array_id id, uint64_t from, uint64_t block_rows,
                         uint32_t distance)
{
    uint64_t block = from / block_rows;
    if (distance > block)
        return;
    expect_rows(t, id, 0, (block - distance) * block_rows, (block - distance) * block_rows + 1);
    if (id == EBPO_A_FACES && t->needs & EBPO_NEEDS_MAPS)
        expect_rows(t, EBPO_A_FACE_SOURCE, 0, (block - distance) * block_rows,
                    (block - distance) * block_rows + block_rows);
}

static void report_owned_faces(const reporting *t)
{
    uint64_t faces = t->last->after[EBPO_S_FACES_BEFORE] + t->last->after[EBPO_S_FACES],
             vertices = t->last->after[EBPO_S_VERTICES_BEFORE] + t->last->after[EBPO_S_VERTICES];
    expect_rows(t, EBPO_A_FACES, 0, t->first->face, faces);
    expect_rows(t, EBPO_A_VERTICES, 0, t->first->vertex, vertices);
    if (t->needs & EBPO_NEEDS_MAPS)
        expect_rows(t, EBPO_A_FACE_SOURCE, 0, t->first->face, faces);
}

/* Collects chunks from rows of `outer`. They are hints, with unchecked values and count. */
static void report_shared(const reporting *t, const ebpo_subtree_row *row)
{
    enum { OUTER_MAX = 1 << 16 };
    uint64_t first = row->before[EBPO_S_SHARED_FACES] + row->before[EBPO_S_SHARED_VERTICES],
             faces = row->after[EBPO_S_SHARED_FACES] - row->before[EBPO_S_SHARED_FACES],
             vertices = row->after[EBPO_S_SHARED_VERTICES] - row->before[EBPO_S_SHARED_VERTICES],
             count = faces + vertices;
    const ebpo_array_in *array = ebpo_reader_array(t->chunks->file, EBPO_A_SUBTREE_SHARED, 0);
    uint32_t *outer;
    if (!array->present || count == 0 || count > OUTER_MAX || first > array->shape.rows ||
        count > array->shape.rows - first ||
        ebpo_chunks_take(t->chunks, EBPO_A_SUBTREE_SHARED, 0, first, count, sizeof *outer, &outer,
                         NULL) != EBPO_OK)
        return;
    for (uint64_t i = 0; i < count; i++)
        report_block(t, i < faces ? EBPO_A_FACES : EBPO_A_VERTICES,
                     i < faces ? row->face : row->vertex,
                     i < faces ? EBPO_FACE_BLOCK : EBPO_VERTEX_BLOCK, outer[i]);
    free(outer);
}

void ebpo_subtrees_hint(ebpo_chunks *chunks, ebpo_hints *expected, uint64_t first, uint64_t count,
                        uint32_t needs, int last_level, bool faces)
{
    const ebpo_info *info = &chunks->file->info;
    bool mesh = faces && info->parts & EBPO_PART_MESH, alone = count == 1; /* one row is then
                                                                            * sufficient */
    ebpo_subtree_row *row = ebpo_alloc(3, sizeof *row);
    reporting t = { chunks,  expected,
                    &row[0], alone ? &row[0] : &row[1],
                    needs,   faces ? EBPO_LEVELS_MAX : last_level };
    if (row && count && ebpo_hints_wanted(expected) &&
        ebpo_subtree_table_row(chunks, first, &row[0], NULL) == EBPO_OK &&
        (alone || ebpo_subtree_table_row(chunks, first + count - 1, &row[1], NULL) == EBPO_OK)) {
        report_nodes(&t);
        if (mesh)
            report_owned_faces(&t);
        if (mesh && alone)
            report_shared(&t, &row[0]);
        for (uint64_t i = 0; i < count && mesh && !alone; i++)
            if (ebpo_subtree_table_row(chunks, first + i, &row[2], NULL) == EBPO_OK)
                report_shared(&t, &row[2]);
    }
    free(row);
}
