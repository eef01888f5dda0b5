/* Locates subtrees and nodes in every array. The root of a subtree is a gray node (a node with
 * children) of a fixed level. The first part reads the file's table of subtrees, /subtrees/counts,
 * which has a row of counts for each subtree. It computes the sums of all counts before a subtree.
 * /subtrees/index has a row of sums for each chunk of the table; the rows of the chunk before the
 * subtree are added to this row. It caches recently used rows.
 *
 * The second part computes ranks: the numbers of planes, faces and nodes of each type before a
 * node. In levels below the subtrees' roots, counting begins at the row of the node's subtree. In
 * other levels, counting begins at a row of an index array, which has a row for every 4,096 items.
 * Results are checked against the counts in the header.
 *
 * The last part sends prefetch hints for subtrees. Source: format-spec/subtrees.md. */
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

/* Returns an upper bound of the sum of a column over all subtrees: a count from the header, or the
 * number of rows of /subtrees/shared_chunks. Sets *exact to true if the sum must equal this bound.
 */
static uint64_t column_maximum(const ebpo_file *file, unsigned column, bool *exact)
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

/* Reads the sums before a chunk of the table. If `chunk` is one past the last chunk, sets the sums
 * to the upper bounds (column_maximum). */
static ebpo_status sums_before(ebpo_chunks *chunks, uint64_t chunk, uint32_t cols, uint64_t *sums,
                               ebpo_error *error)
{
    const ebpo_array_in *index = ebpo_reader_array(chunks->file, EBPO_A_SUBTREE_INDEX, 0);
    bool exact;
    ebpo_status status = EBPO_OK;
    if (chunk == index->shape.rows) {
        for (uint32_t k = 0; k < cols; k++)
            sums[k] = column_maximum(chunks->file, k, &exact);
        return EBPO_OK;
    }
    ebpo_held_chunk view = { .array = index };
    status = ebpo_held_chunk_move(chunks, &view, chunk, error);
    for (uint32_t k = 0; k < cols && status == EBPO_OK; k++) {
        sums[k] = ebpo_load64(view.rows + ((chunk - view.begin) * cols + k) * 8);
        if (sums[k] > column_maximum(chunks->file, k, &exact) || (chunk == 0 && sums[k]))
            status = table_fails(chunks, EBPO_A_SUBTREE_INDEX,
                                 "the sums contradict the counts in the header", error);
    }
    ebpo_held_chunk_release(chunks, &view);
    return status;
}

/* A chunk of the table. */
typedef struct subtree_counts {
    ebpo_held_chunk view;
    uint32_t cols;
    uint64_t begin[EBPO_SUBTREE_COLS], end[EBPO_SUBTREE_COLS]; /* sums before and after the chunk */
} subtree_counts;

/* Returns one count of a subtree in the chunk. */
static uint32_t count_at(const subtree_counts *c, uint64_t subtree, uint32_t column)
{
    return ebpo_load32(c->view.rows + ((subtree - c->view.begin) * c->cols + column) * 4);
}

/* Adds the counts of a subtree to the sums. */
static void add_row(const subtree_counts *c, uint64_t subtree, uint64_t *sums)
{
    for (uint32_t k = 0; k < c->cols; k++)
        sums[k] += count_at(c, subtree, k);
}

/* Opens the chunk of the table that contains a subtree's row. Checks that the sums before the
 * chunk, plus the counts in the chunk, are the sums after the chunk. After the last chunk, some
 * sums have only an upper bound (column_maximum). */
static ebpo_status open_counts(ebpo_chunks *chunks, uint64_t subtree, subtree_counts *c,
                               ebpo_error *error)
{
    const ebpo_array_in *array = ebpo_reader_array(chunks->file, EBPO_A_SUBTREE_COUNTS, 0);
    uint64_t rows = array->shape.chunk_rows, chunk = subtree / rows, sums[EBPO_SUBTREE_COLS];
    c->view = (ebpo_held_chunk){ .array = array };
    c->cols = array->shape.cols;
    /* the pages of checksums depend on the same sums */
    ebpo_status status = ebpo_checksum_pages_prepare(chunks->file, error);
    if (status == EBPO_OK)
        status = sums_before(chunks, chunk, c->cols, c->begin, error);
    if (status == EBPO_OK)
        status = sums_before(chunks, chunk + 1, c->cols, c->end, error);
    if (status == EBPO_OK)
        status = ebpo_held_chunk_move(chunks, &c->view, subtree, error);
    if (status != EBPO_OK)
        return status;
    memcpy(sums, c->begin, sizeof sums);
    for (uint64_t i = c->view.begin; i < c->view.end; i++)
        add_row(c, i, sums);
    bool last = c->view.end == array->shape.rows, exact;
    /* The sums of the columns EBPO_S_SHARED_FACES and EBPO_S_SHARED_VERTICES must add up to the
     * number of rows of /subtrees/shared_chunks. For the last chunk, sums_before sets c->end of
     * both columns to this number. */
    if (last &&
        sums[EBPO_S_SHARED_FACES] + sums[EBPO_S_SHARED_VERTICES] != c->end[EBPO_S_SHARED_FACES])
        status = table_fails(chunks, EBPO_A_SUBTREE_SHARED,
                             "the array's rows do not match the table's counts", error);
    for (uint32_t k = 0; k < c->cols && status == EBPO_OK; k++) {
        (void)column_maximum(chunks->file, k, &exact);
        if (last && !exact ? sums[k] > c->end[k] : sums[k] != c->end[k])
            status = table_fails(chunks, EBPO_A_SUBTREE_COUNTS,
                                 "the rows do not add up to the sums in the index", error);
    }
    if (status != EBPO_OK)
        ebpo_held_chunk_release(chunks, &c->view);
    return status;
}

/* Computes the row of a subtree whose counts are in the chunk. */
static void sum_row(const subtree_counts *c, uint64_t subtree, ebpo_subtree_row *out)
{
    out->subtree = subtree;
    memcpy(out->before, c->begin, sizeof out->before);
    for (uint64_t i = c->view.begin; i < subtree; i++)
        add_row(c, i, out->before);
    memcpy(out->after, out->before, sizeof out->after);
    add_row(c, subtree, out->after);
    /* EBPO_S_FACES_BEFORE of this row counts the faces between the previous subtree and this
     * subtree. So the first owned face comes after all faces that this column counts up to this
     * row, and after the owned faces of all previous subtrees. The same is true for vertices. */
    out->face = out->after[EBPO_S_FACES_BEFORE] + out->before[EBPO_S_FACES];
    out->vertex = out->after[EBPO_S_VERTICES_BEFORE] + out->before[EBPO_S_VERTICES];
}

/* Checks a row: the sums of faces and vertices against the header, and the numbers of nodes against
 * the numbers of groups. */
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
            const uint64_t *sums = end ? row->after : row->before;
            unsigned column = ebpo_subtree_column(info, level, 0);
            if (sums[column + EBPO_S_GRAY] + sums[column + EBPO_S_LEAF] +
                    sums[column + EBPO_S_BLACK] >
                8 * ebpo_subtree_groups(info, row, level, end))
                return table_fails(chunks, EBPO_A_SUBTREE_COUNTS,
                                   "a subtree has more than eight nodes for each of its groups",
                                   error);
        }
    return EBPO_OK;
}

uint64_t ebpo_subtree_groups(const ebpo_info *info, const ebpo_subtree_row *row, int level,
                             bool after)
{
    const uint64_t *sums = after ? row->after : row->before;
    return level == info->subtree_level + 1
               ? row->subtree + after
               : sums[ebpo_subtree_column(info, level - 1, EBPO_S_GRAY)];
}

/* --- cache of rows --- */

/* The row of a subtree is needed repeatedly while the subtree is read. Computing a row takes long,
 * because all rows of a chunk are added up. Typically two threads read at once, so a few rows are
 * sufficient. */
enum {
    KEPT = 4,                     /* number of rows in the cache */
    FACES_KNOWN_MAX = 1 << 20,    /* subtrees from this index on are not in faces_known */
    BY_NUMBER = EBPO_SUBTREE_COLS /* in place of a column: find a row by the subtree's index */
};

struct ebpo_kept_rows {
    ebpo_subtree_row row[KEPT];
    unsigned count, next;  /* number of rows; index of the row that is replaced next */
    uint8_t faces_known[]; /* a bit for each subtree: its faces were checked */
};

/* Returns the number of subtrees that have a bit in faces_known. */
static uint64_t remembered_subtrees(const ebpo_info *info)
{
    uint64_t subtrees = info->level[info->subtree_level].gray_count;
    return subtrees < FACES_KNOWN_MAX ? subtrees : FACES_KNOWN_MAX;
}

/* Returns true if find_kept searches for this row. */
static bool row_holds(const ebpo_subtree_row *row, unsigned column, uint64_t item)
{
    return column == BY_NUMBER ? row->subtree == item
                               : row->before[column] <= item && item < row->after[column];
}

/* Finds a cached row. If `column` is BY_NUMBER, finds the row of subtree `item`. Otherwise finds
 * the row of the subtree that contains item `item` of the column. */
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

/* Checks a row, and adds it to the cache of rows. Counted chunks (ebpo_chunks_make_counted) have no
 * cache of rows, so that every read is counted. */
static ebpo_status keep_row(ebpo_chunks *chunks, const ebpo_subtree_row *row, ebpo_error *error)
{
    ebpo_status status = check_row(chunks, row, error);
    if (status != EBPO_OK || chunks->counted)
        return status;
    pthread_mutex_lock(&chunks->lock);
    if (!chunks->rows)
        chunks->rows =
            ebpo_alloc_zero(1, sizeof *chunks->rows + remembered_subtrees(&chunks->file->info) / 8 +
                                   1); /* if memory is short, rows are not cached */
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
    bool known = chunks->rows && subtree < remembered_subtrees(&chunks->file->info) &&
                 chunks->rows->faces_known[subtree / 8] >> subtree % 8 & 1;
    pthread_mutex_unlock(&chunks->lock);
    return known;
}

void ebpo_subtree_faces_note(ebpo_chunks *chunks, uint64_t subtree)
{
    pthread_mutex_lock(&chunks->lock);
    if (chunks->rows && subtree < remembered_subtrees(&chunks->file->info))
        chunks->rows->faces_known[subtree / 8] |= (uint8_t)(1u << subtree % 8);
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
    sum_row(&c, subtree, out);
    ebpo_held_chunk_release(chunks, &c.view);
    return keep_row(chunks, out, error);
}

/* Finds the chunk of the table with the subtree that contains item `item` of the column: the last
 * chunk before which the sum of the column is at most `item`. */
static ebpo_status find_chunk(ebpo_chunks *chunks, unsigned column, uint64_t item, uint64_t *out,
                              ebpo_error *error)
{
    const ebpo_array_in *index = ebpo_reader_array(chunks->file, EBPO_A_SUBTREE_INDEX, 0);
    uint64_t low = 0, high = index->shape.rows - 1, sums[EBPO_SUBTREE_COLS];
    ebpo_status status = EBPO_OK;
    while (low < high && status == EBPO_OK) {
        uint64_t middle = low + (high - low + 1) / 2;
        status = sums_before(chunks, middle, index->shape.cols, sums, error);
        if (status == EBPO_OK && sums[column] <= item)
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
    sum_row(&c, found, out);
    ebpo_held_chunk_release(chunks, &c.view);
    return keep_row(chunks, out, error);
}

/* Returns true for groups of the first level below the subtrees' roots. Group i of this level
 * belongs to subtree i, so the table is not searched. */
static bool is_direct(const ebpo_info *info, int level, ebpo_per per)
{
    return per == EBPO_PER_GROUP && level == info->subtree_level + 1;
}

/* Returns the column that counts the items of kind `per` of a level. The groups of a level are
 * counted by the gray nodes of the level above. */
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

/* Adds to the hints a chunk of the table, and the rows of /subtrees/shared_chunks for the subtrees
 * in this chunk. These rows list the chunks with the subtrees' shared faces and vertices. */
static void hint_table_chunk(ebpo_chunks *chunks, ebpo_hints *hints, uint64_t chunk)
{
    const ebpo_shape *shape = &ebpo_reader_array(chunks->file, EBPO_A_SUBTREE_COUNTS, 0)->shape;
    uint64_t sums[EBPO_SUBTREE_COLS], shared[2]; /* rows before and after the chunk's subtrees */
    for (int k = 0; k < 2; k++) {
        if (!ebpo_input_prefetches(&chunks->file->in) ||
            sums_before(chunks, chunk + (uint64_t)k, shape->cols, sums, NULL) != EBPO_OK)
            return; /* the later read reports errors */
        shared[k] = sums[EBPO_S_SHARED_FACES] + sums[EBPO_S_SHARED_VERTICES];
    }
    ebpo_chunks_hint(chunks, hints, EBPO_A_SUBTREE_COUNTS, 0, chunk * shape->chunk_rows, 1);
    if (shared[1] > shared[0])
        ebpo_chunks_hint(chunks, hints, EBPO_A_SUBTREE_SHARED, 0, shared[0], shared[1] - shared[0]);
}

void ebpo_subtree_table_hint_run(ebpo_chunks *chunks, uint64_t first, uint64_t count)
{
    uint64_t rows = ebpo_reader_array(chunks->file, EBPO_A_SUBTREE_COUNTS, 0)->shape.chunk_rows,
             all = ebpo_reader_array(chunks->file, EBPO_A_SUBTREE_COUNTS, 0)->shape.rows;
    ebpo_hints hints = EBPO_HINTS_INIT(chunks->file);
    for (uint64_t at = first / rows * rows; at < first + count && at < all; at += rows)
        hint_table_chunk(chunks, &hints, at / rows);
    ebpo_hint_all(&hints);
}

void ebpo_subtree_table_hint(ebpo_chunks *chunks, const uint64_t *subtrees, uint64_t count)
{
    uint64_t rows = ebpo_reader_array(chunks->file, EBPO_A_SUBTREE_COUNTS, 0)->shape.chunk_rows;
    ebpo_hints hints = EBPO_HINTS_INIT(chunks->file);
    for (uint64_t i = 0; i < count; i++)
        if (i == 0 || subtrees[i] / rows != subtrees[i - 1] / rows)
            hint_table_chunk(chunks, &hints, subtrees[i] / rows);
    ebpo_hint_all(&hints);
}

/* --- ranks --- */

ebpo_status ebpo_ranks_count_file(ebpo_chunks *chunks, int level, uint64_t group, uint64_t groups,
                                  uint64_t counts[4], ebpo_error *error)
{
    ebpo_held_chunk view = { .array = ebpo_reader_array(chunks->file, EBPO_A_TYPES, level) };
    ebpo_status status = EBPO_OK;
    memset(counts, 0, 4 * sizeof *counts);
    while (groups && (status = ebpo_held_chunk_move(chunks, &view, group, error)) == EBPO_OK) {
        uint64_t step = view.end - group < groups ? view.end - group : groups, part[4];
        ebpo_groups_count(view.rows + 2 * (group - view.begin), step, part);
        for (int k = 0; k < 4; k++)
            counts[k] += part[k];
        group += step;
        groups -= step;
    }
    ebpo_held_chunk_release(chunks, &view);
    return status;
}

/* Adds values to *sum. Returns false if a value is 2^40 or more, or if the sum is 2^62 or more. A
 * value can be 2^40 or more only if it has 64 bits. */
static bool sum_rows(const uint8_t *rows, unsigned element_size, uint64_t count, uint64_t *sum)
{
    uint64_t total = 0, all = 0; /* all: bits that are set in any value */
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
        uint64_t step = view.end - row < rows ? view.end - row : rows;
        if (!sum_rows(view.rows + (row - view.begin) * size, size, step, sum)) {
            status = ebpo_chunks_fail(chunks, level, id, "the values are too large", error);
            break;
        }
        row += step;
        rows -= step;
    }
    ebpo_held_chunk_release(chunks, &view);
    return status;
}

/* Reads the row of an index array that precedes an item. Row 0 is all zeros and is not read from
 * the file. */
static ebpo_status index_row(ebpo_chunks *chunks, ebpo_array_id id, int level, uint64_t item,
                             unsigned cols, uint64_t *row, ebpo_error *error)
{
    memset(row, 0, cols * sizeof *row);
    return item < EBPO_INDEX_ROWS ? EBPO_OK
                                  : ebpo_chunks_integers(chunks, id, level, item / EBPO_INDEX_ROWS,
                                                         1, row, sizeof *row, error);
}

/* Finds the subtree that contains an item of a level below the subtrees' roots. `kind`: the kind of
 * the item, EBPO_S_GRAY and so on (also in the functions below). */
static ebpo_status find_subtree(ebpo_chunks *chunks, int level, unsigned kind, uint64_t item,
                                ebpo_subtree_row *row, ebpo_error *error)
{
    return ebpo_subtree_table_find(chunks, ebpo_subtree_column(&chunks->file->info, level, kind),
                                   item, row, error);
}

/* Returns the number of items of a level before the row's subtree. */
static uint64_t items_before(const ebpo_chunks *chunks, const ebpo_subtree_row *row, int level,
                             unsigned kind)
{
    return row->before[ebpo_subtree_column(&chunks->file->info, level, kind)];
}

/* Returns the number of items of a level in the row's subtree. */
static uint64_t items_in(const ebpo_chunks *chunks, const ebpo_subtree_row *row, int level,
                         unsigned kind)
{
    return row->after[ebpo_subtree_column(&chunks->file->info, level, kind)] -
           items_before(chunks, row, level, kind);
}

static const char *const contradicts = "the index contradicts the counts in the header";

/* Reports a row of the table that assigns nodes to the wrong subtree. The sums of the table do not
 * show this error, so the functions check_types, check_list and check_ends count the nodes. */
static ebpo_status row_contradicts(const ebpo_chunks *chunks, ebpo_error *error)
{
    return ebpo_chunks_fail(chunks, -1, EBPO_A_SUBTREE_COUNTS,
                            "a row contradicts the nodes of its subtree", error);
}

/* Checks the row's numbers of nodes of a level by counting the nodes of the row's subtree. */
static ebpo_status check_types(ebpo_chunks *chunks, int level, const ebpo_subtree_row *row,
                               ebpo_error *error)
{
    const ebpo_info *info = &chunks->file->info;
    uint64_t from = ebpo_subtree_groups(info, row, level, false),
             to = ebpo_subtree_groups(info, row, level, true), counts[4];
    ebpo_status status = ebpo_ranks_count_file(chunks, level, from, to - from, counts, error);
    if (status != EBPO_OK)
        return status;
    return counts[EBPO_GRAY] == items_in(chunks, row, level, EBPO_S_GRAY) &&
                   counts[EBPO_LEAF] == items_in(chunks, row, level, EBPO_S_LEAF) &&
                   counts[EBPO_BLACK] == items_in(chunks, row, level, EBPO_S_BLACK)
               ? EBPO_OK
               : row_contradicts(chunks, error);
}

/* Checks column `kind` of a row: it must be the sum of array `id` over the subtree's nodes of the
 * level. `nodes`: the column that counts these nodes. */
static ebpo_status check_list(ebpo_chunks *chunks, int level, const ebpo_subtree_row *row,
                              ebpo_array_id id, unsigned nodes, unsigned kind, ebpo_error *error)
{
    uint64_t sum = 0;
    ebpo_status status = ebpo_chunks_sum(chunks, id, level, items_before(chunks, row, level, nodes),
                                         items_in(chunks, row, level, nodes), &sum, error);
    return status != EBPO_OK || sum == items_in(chunks, row, level, kind)
               ? status
               : row_contradicts(chunks, error);
}

/* Checks column EBPO_S_ENDS of a row. The *end* of a leaf is one past its last new face. The column
 * has the end of the subtree's last leaf in the level, minus the end of the last leaf of the level
 * before the subtree. The column must be the sum of leaf_new and leaf_skip over the subtree's
 * leaves in the level. leaf_new is the number of new faces of a leaf. leaf_skip of a leaf is the
 * number of new faces that leaves of other levels have between the previous leaf of the level and
 * this leaf. Also checks that the new faces of the subtree's leaves are owned faces of the subtree.
 */
static ebpo_status check_ends(ebpo_chunks *chunks, int level, const ebpo_subtree_row *row,
                              ebpo_error *error)
{
    uint64_t first = items_before(chunks, row, level, EBPO_S_LEAF),
             leaves = items_in(chunks, row, level, EBPO_S_LEAF),
             growth = items_in(chunks, row, level, EBPO_S_ENDS),
             begin = items_before(chunks, row, level, EBPO_S_ENDS), first_skip = 0, skipped = 0,
             new_faces = 0;
    if (leaves == 0)
        return growth ? row_contradicts(chunks, error) : EBPO_OK;
    ebpo_status status =
        ebpo_chunks_sum(chunks, EBPO_A_LEAF_SKIP, level, first, 1, &first_skip, error);
    if (status == EBPO_OK)
        status = ebpo_chunks_sum(chunks, EBPO_A_LEAF_SKIP, level, first, leaves, &skipped, error);
    if (status == EBPO_OK)
        status = ebpo_chunks_sum(chunks, EBPO_A_LEAF_NEW, level, first, leaves, &new_faces, error);
    if (status != EBPO_OK)
        return status;
    uint64_t owned = row->after[EBPO_S_FACES] - row->before[EBPO_S_FACES];
    return skipped + new_faces == growth && begin + first_skip >= row->face &&
                   begin + growth <= row->face + owned
               ? EBPO_OK
               : row_contradicts(chunks, error);
}

ebpo_status ebpo_ranks_check(const ebpo_chunks *chunks, int level, const uint64_t ranks[4],
                             const uint64_t counts[4], ebpo_error *error)
{
    const ebpo_level_summary *s = &chunks->file->info.level[level];
    const uint64_t all[4] = { s->white_count, s->black_count, s->leaf_count, s->gray_count };
    for (int k = 0; k < 4; k++)
        if (ranks[k] > all[k] || counts[k] > all[k] - ranks[k])
            return ebpo_chunks_fail(chunks, level, EBPO_A_TYPES,
                                    "the types contradict the counts in the header or the index",
                                    error);
    return EBPO_OK;
}

/* Finds the subtree that contains a group of a level. Sets *from to the subtree's first group of
 * the level, and `ranks` to the ranks at which the subtree's nodes of the level begin. */
static ebpo_status ranks_of_subtree(ebpo_chunks *chunks, int level, uint64_t group,
                                    uint64_t ranks[4], uint64_t *from, ebpo_error *error)
{
    const ebpo_info *info = &chunks->file->info;
    ebpo_subtree_row row;
    bool roots =
        level == info->subtree_level + 1; /* true: the level has one group for each subtree */
    uint64_t last = info->level[info->subtree_level].gray_count - 1;
    ebpo_status status =
        roots ? ebpo_subtree_table_row(chunks, group < last ? group : last, &row, error)
              : find_subtree(chunks, level - 1, EBPO_S_GRAY, group, &row, error);
    if (status != EBPO_OK)
        return status;
    status = check_types(chunks, level, &row, error);
    *from = ebpo_subtree_groups(info, &row, level, false);
    ranks[EBPO_GRAY] = items_before(chunks, &row, level, EBPO_S_GRAY);
    ranks[EBPO_LEAF] = items_before(chunks, &row, level, EBPO_S_LEAF);
    ranks[EBPO_BLACK] = items_before(chunks, &row, level, EBPO_S_BLACK);
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
        from = items_before(chunks, &row, level, EBPO_S_GRAY);
        *planes = items_before(chunks, &row, level, EBPO_S_PLANES);
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

/* Reads the row of leaf_index, or of the table, that precedes a leaf. The row describes all leaves
 * of the level before the row: row[0] is the end of their new faces (one past the last), row[1] is
 * the number of their references, and row[2] is the number of their planes. If the row is of the
 * table, sets *from to the subtree's first leaf of the level, and checks the row's sums: of faces
 * if `faces` is true, of planes if `faces` is false. */
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
    *from = items_before(chunks, &subtree, level, EBPO_S_LEAF);
    row[0] = items_before(chunks, &subtree, level, EBPO_S_ENDS);
    row[1] = items_before(chunks, &subtree, level, EBPO_S_REFS);
    row[2] = items_before(chunks, &subtree, level, EBPO_S_LEAF_PLANES);
    return EBPO_OK;
}

ebpo_status ebpo_ranks_leaf(ebpo_chunks *chunks, int level, uint64_t leaf, uint64_t *end,
                            uint64_t *refs, ebpo_error *error)
{
    const ebpo_info *info = &chunks->file->info;
    uint64_t row[3], skipped = 0, new_faces = 0, listed = 0,
                     from = leaf / EBPO_INDEX_ROWS * EBPO_INDEX_ROWS;
    ebpo_status status = leaf_row(chunks, level, leaf, true, row, &from, error);
    if (status == EBPO_OK)
        status =
            ebpo_chunks_sum(chunks, EBPO_A_LEAF_SKIP, level, from, leaf - from, &skipped, error);
    if (status == EBPO_OK)
        status =
            ebpo_chunks_sum(chunks, EBPO_A_LEAF_NEW, level, from, leaf - from, &new_faces, error);
    if (status == EBPO_OK)
        status = ebpo_chunks_sum(chunks, EBPO_A_LEAF_REF_COUNT, level, from, leaf - from, &listed,
                                 error);
    if (status != EBPO_OK)
        return status;
    if (row[0] > info->face_count || skipped > info->face_count - row[0] ||
        new_faces > info->face_count - row[0] - skipped)
        return ebpo_chunks_fail(chunks, level, EBPO_A_LEAF_SKIP,
                                "a leaf's new faces are beyond the last face", error);
    if (row[1] > info->level[level].ref_count || listed > info->level[level].ref_count - row[1])
        return ebpo_chunks_fail(chunks, level, EBPO_A_LEAF_INDEX, contradicts, error);
    *end = row[0] + skipped + new_faces;
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

/* --- prefetch hints for subtrees --- */

/* The hints for consecutive subtrees. */
typedef struct hinting {
    ebpo_chunks *chunks;
    ebpo_hints *hints;
    const ebpo_subtree_row *first, *last; /* rows of the first and the last subtree */
    uint32_t needs;                       /* EBPO_NEEDS_... (schema.h): arrays that will be read */
    int last_level;                       /* the deepest level that will be read */
} hinting;

static void hint_rows(const hinting *t, ebpo_array_id id, int level, uint64_t begin, uint64_t end)
{
    if (end > begin)
        ebpo_chunks_hint(t->chunks, t->hints, id, level, begin, end - begin);
}

/* Returns the number of items of a level before the first subtree; if `after` is true, up to the
 * end of the last subtree. */
static uint64_t subtree_sum(const hinting *t, int level, unsigned kind, bool after)
{
    unsigned column = ebpo_subtree_column(&t->chunks->file->info, level, kind);
    return after ? t->last->after[column] : t->first->before[column];
}

/* Returns the number of rows of an array before the first subtree; if `after` is true, up to the
 * end of the last subtree. `per`: the array has one row for each item of this kind. */
static uint64_t rows_before(const hinting *t, ebpo_per per, int level, bool after)
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

/* Adds to the hints the subtrees' rows of the arrays of levels. */
static void hint_nodes(const hinting *t)
{
    const ebpo_info *info = &t->chunks->file->info;
    for (int level = info->subtree_level + 1; level < info->level_count && level <= t->last_level;
         level++)
        for (int id = 0; id < EBPO_LEVEL_ARRAYS; id++)
            if (ebpo_schema[id].needs & t->needs)
                hint_rows(t, (ebpo_array_id)id, level,
                          rows_before(t, ebpo_schema[id].per, level, false),
                          rows_before(t, ebpo_schema[id].per, level, true));
}

/* Adds to the hints the chunk of faces or vertices that is `distance` chunks before the chunk of
 * row `from`. */
static void hint_chunk(const hinting *t, ebpo_array_id id, uint64_t from, uint64_t chunk_rows,
                       uint32_t distance)
{
    uint64_t chunk = from / chunk_rows;
    if (distance > chunk)
        return;
    uint64_t row = (chunk - distance) * chunk_rows;
    hint_rows(t, id, 0, row, row + 1);
    if (id == EBPO_A_FACES && t->needs & EBPO_NEEDS_MAPS)
        hint_rows(t, EBPO_A_FACE_SOURCE, 0, row, row + chunk_rows);
}

/* Adds the owned faces and vertices to the hints. */
static void hint_owned_faces(const hinting *t)
{
    uint64_t faces = t->last->after[EBPO_S_FACES_BEFORE] + t->last->after[EBPO_S_FACES],
             vertices = t->last->after[EBPO_S_VERTICES_BEFORE] + t->last->after[EBPO_S_VERTICES];
    hint_rows(t, EBPO_A_FACES, 0, t->first->face, faces);
    hint_rows(t, EBPO_A_VERTICES, 0, t->first->vertex, vertices);
    if (t->needs & EBPO_NEEDS_MAPS)
        hint_rows(t, EBPO_A_FACE_SOURCE, 0, t->first->face, faces);
}

/* Adds to the hints the chunks with a subtree's shared faces and vertices. The subtree's rows of
 * /subtrees/shared_chunks list these chunks. The values are not checked, because only hints depend
 * on them. */
static void hint_shared(const hinting *t, const ebpo_subtree_row *row)
{
    enum { SHARED_MAX = 1 << 16 }; /* maximum number of chunks for which hints are sent */
    uint64_t first = row->before[EBPO_S_SHARED_FACES] + row->before[EBPO_S_SHARED_VERTICES],
             faces = row->after[EBPO_S_SHARED_FACES] - row->before[EBPO_S_SHARED_FACES],
             vertices = row->after[EBPO_S_SHARED_VERTICES] - row->before[EBPO_S_SHARED_VERTICES],
             count = faces + vertices;
    const ebpo_array_in *array = ebpo_reader_array(t->chunks->file, EBPO_A_SUBTREE_SHARED, 0);
    uint32_t *shared;
    if (!array->present || count == 0 || count > SHARED_MAX || first > array->shape.rows ||
        count > array->shape.rows - first ||
        ebpo_chunks_take(t->chunks, EBPO_A_SUBTREE_SHARED, 0, first, count, sizeof *shared, &shared,
                         NULL) != EBPO_OK)
        return;
    for (uint64_t i = 0; i < count; i++)
        hint_chunk(t, i < faces ? EBPO_A_FACES : EBPO_A_VERTICES,
                   i < faces ? row->face : row->vertex,
                   i < faces ? EBPO_FACE_BLOCK : EBPO_VERTEX_BLOCK, shared[i]);
    free(shared);
}

void ebpo_subtrees_hint(ebpo_chunks *chunks, ebpo_hints *hints, uint64_t first, uint64_t count,
                        uint32_t needs, int last_level, bool faces)
{
    const ebpo_info *info = &chunks->file->info;
    bool mesh = faces && info->parts & EBPO_PART_MESH, single = count == 1;
    if (!count || !ebpo_hints_wanted(hints))
        return;
    ebpo_subtree_row *row = ebpo_alloc(3, sizeof *row);
    hinting t = { chunks,  hints,
                  &row[0], single ? &row[0] : &row[1],
                  needs,   faces ? EBPO_LEVELS_MAX : last_level };
    if (row && ebpo_subtree_table_row(chunks, first, &row[0], NULL) == EBPO_OK &&
        (single || ebpo_subtree_table_row(chunks, first + count - 1, &row[1], NULL) == EBPO_OK)) {
        hint_nodes(&t);
        if (mesh)
            hint_owned_faces(&t);
        if (mesh && single)
            hint_shared(&t, &row[0]);
        for (uint64_t i = 0; i < count && mesh && !single; i++)
            if (ebpo_subtree_table_row(chunks, first + i, &row[2], NULL) == EBPO_OK)
                hint_shared(&t, &row[2]);
    }
    free(row);
}

void ebpo_subtrees_hint_before(ebpo_chunks *chunks, ebpo_hints *hints, uint64_t subtree,
                               uint32_t needs)
{
    const ebpo_info *info = &chunks->file->info;
    uint64_t subtrees = info->level[info->subtree_level].gray_count;
    ebpo_subtree_row row;
    bool is_last = subtree == subtrees;
    hinting t = { .chunks = chunks, .hints = hints, .needs = needs };
    if (ebpo_subtree_table_row(chunks, subtree - is_last, &row, NULL) != EBPO_OK)
        return;
    const uint64_t *sums = is_last ? row.after : row.before;
    uint64_t face = sums[EBPO_S_FACES_BEFORE] + sums[EBPO_S_FACES],
             vertex = sums[EBPO_S_VERTICES_BEFORE] + sums[EBPO_S_VERTICES],
             face_end = is_last ? info->face_count : row.face,
             vertex_end = is_last ? info->vertex_count : row.vertex;
    face_end = face_end > face + EBPO_FACE_BLOCK ? face + EBPO_FACE_BLOCK : face_end;
    vertex_end = vertex_end > vertex + EBPO_FACE_BLOCK ? vertex + EBPO_FACE_BLOCK : vertex_end;
    hint_rows(&t, EBPO_A_FACES, 0, face, face_end);
    hint_rows(&t, EBPO_A_VERTICES, 0, vertex, vertex_end);
    if (needs & EBPO_NEEDS_MAPS)
        hint_rows(&t, EBPO_A_FACE_SOURCE, 0, face, face_end);
}
