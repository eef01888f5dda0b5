#include "format/subtree_table.h"

#include <string.h>

#include "core/alloc.h"
#include "core/endian.h"
#include "core/error.h"

static ebpo_status table_fails(const ebpo_chunks *chunks, ebpo_array_id id, const char *what,
                               ebpo_error *error)
{
    return ebpo_chunks_fail(chunks, -1, id, what, error);
}

/* What a column adds up to at most; whether it must be all of it. */
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
        return file->root_array[EBPO_A_SUBTREE_OUTER].shape.rows;
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

/* Sums before a chunk of rows; behind the last chunk, the head's counts. */
static ebpo_status sums_before(ebpo_chunks *chunks, uint64_t chunk, uint32_t cols, uint64_t *sums,
                               ebpo_error *error)
{
    const ebpo_array_in *index = ebpo_reader_array(chunks->file, EBPO_A_SUBTREE_INDEX, 0);
    bool exact;
    ebpo_status status = EBPO_OK;
    if (chunk == index->shape.rows) {
        for (uint32_t k = 0; k < cols; k++)
            sums[k] = column_total(chunks->file, k, &exact);
        return EBPO_OK;
    }
    ebpo_held_chunk view = { .array = index };
    status = ebpo_held_chunk_move(chunks, &view, chunk, error);
    for (uint32_t k = 0; k < cols && status == EBPO_OK; k++) {
        sums[k] = ebpo_load64(view.rows + ((chunk - view.begin) * cols + k) * 8);
        if (sums[k] > column_total(chunks->file, k, &exact) || (chunk == 0 && sums[k]))
            status = table_fails(chunks, EBPO_A_SUBTREE_INDEX,
                                 "the sums contradict the counts in the head", error);
    }
    ebpo_held_chunk_release(chunks, &view);
    return status;
}

typedef struct counts {
    ebpo_held_chunk view;
    uint32_t cols;
    uint64_t begin[EBPO_SUBTREE_COLS], end[EBPO_SUBTREE_COLS]; /* before and after the chunk */
} counts;

static uint32_t count_at(const counts *c, uint64_t subtree, uint32_t column)
{
    return ebpo_load32(c->view.rows + ((subtree - c->view.begin) * c->cols + column) * 4);
}

static void add_row(const counts *c, uint64_t subtree, uint64_t *sums)
{
    for (uint32_t k = 0; k < c->cols; k++)
        sums[k] += count_at(c, subtree, k);
}

/* The chunk of rows that holds a subtree; it adds up to what comes after it. */
static ebpo_status open_counts(ebpo_chunks *chunks, uint64_t subtree, counts *c, ebpo_error *error)
{
    const ebpo_array_in *array = ebpo_reader_array(chunks->file, EBPO_A_SUBTREE_COUNTS, 0);
    uint64_t rows = array->shape.chunk_rows, chunk = subtree / rows, sums[EBPO_SUBTREE_COLS];
    c->view = (ebpo_held_chunk){ .array = array };
    c->cols = array->shape.cols;
    ebpo_status status = sums_before(chunks, chunk, c->cols, c->begin, error);
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
    if (last && sums[EBPO_S_OUTER_FACES] + sums[EBPO_S_OUTER_VERTICES] !=
                    c->end[EBPO_S_OUTER_FACES]) /* they share its rows */
        status = table_fails(chunks, EBPO_A_SUBTREE_OUTER,
                             "it has not the rows that the table's counts add up to", error);
    for (uint32_t k = 0; k < c->cols && status == EBPO_OK; k++) {
        (void)column_total(chunks->file, k, &exact);
        if (last && !exact ? sums[k] > c->end[k] : sums[k] != c->end[k])
            status = table_fails(chunks, EBPO_A_SUBTREE_COUNTS,
                                 "the rows do not add up to the sums in the index", error);
    }
    if (status != EBPO_OK)
        ebpo_held_chunk_release(chunks, &c->view);
    return status;
}

static void take_row(const counts *c, uint64_t subtree, ebpo_subtree_row *out)
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

/* Faces and vertices of other leaves count as well. */
static ebpo_status check_row(const ebpo_chunks *chunks, const ebpo_subtree_row *row,
                             ebpo_error *error)
{
    const ebpo_info *info = &chunks->file->info;
    if (info->parts & EBPO_PART_MESH &&
        (row->after[EBPO_S_FACES_BEFORE] + row->after[EBPO_S_FACES] > info->face_count ||
         row->after[EBPO_S_VERTICES_BEFORE] + row->after[EBPO_S_VERTICES] > info->vertex_count))
        return table_fails(chunks, EBPO_A_SUBTREE_COUNTS,
                           "a subtree's faces lie beyond the last face", error);
    for (int level = info->subtree_level + 1; level < info->level_count; level++)
        for (int end = 0; end < 2; end++) {
            const uint64_t *sums = end ? row->after : row->before;
            unsigned column = ebpo_subtree_column(info, level, 0);
            if (sums[column + EBPO_S_GRAY] + sums[column + EBPO_S_LEAF] +
                    sums[column + EBPO_S_BLACK] >
                8 * ebpo_subtree_groups(info, row, level, end))
                return table_fails(chunks, EBPO_A_SUBTREE_COUNTS,
                                   "a subtree has more nodes than its groups hold", error);
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

/* --- rows kept: one subtree is asked for again and again while it is read, and adding up a chunk
 * of rows takes longer than all else that is asked --- */

enum { KEPT = 4 /* threads that read at once, mostly two */, BY_NUMBER = EBPO_SUBTREE_COLS };

struct ebpo_kept_rows {
    ebpo_subtree_row row[KEPT];
    unsigned count, next;
};

static bool row_holds(const ebpo_subtree_row *row, unsigned column, uint64_t item)
{
    return column == BY_NUMBER ? row->subtree == item
                               : row->before[column] <= item && item < row->after[column];
}

/* The row of a subtree, or (by a column) of the one that has an item, if it is kept. */
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

/* Checks a row, and keeps it; not of counted chunks, where each reading counts. */
static ebpo_status keep_row(ebpo_chunks *chunks, const ebpo_subtree_row *row, ebpo_error *error)
{
    ebpo_status status = check_row(chunks, row, error);
    if (status != EBPO_OK || chunks->counted)
        return status;
    pthread_mutex_lock(&chunks->lock);
    if (!chunks->rows)
        chunks->rows = ebpo_alloc_zero(1, sizeof *chunks->rows); /* without memory none is kept */
    if (chunks->rows) {
        chunks->rows->row[chunks->rows->next] = *row;
        chunks->rows->next = (chunks->rows->next + 1) % KEPT;
        chunks->rows->count += chunks->rows->count < KEPT;
    }
    pthread_mutex_unlock(&chunks->lock);
    return EBPO_OK;
}

ebpo_status ebpo_subtree_table_row(ebpo_chunks *chunks, uint64_t subtree, ebpo_subtree_row *out,
                                   ebpo_error *error)
{
    counts c;
    if (find_kept(chunks, BY_NUMBER, subtree, out))
        return EBPO_OK;
    ebpo_status status = open_counts(chunks, subtree, &c, error);
    if (status != EBPO_OK)
        return status;
    take_row(&c, subtree, out);
    ebpo_held_chunk_release(chunks, &c.view);
    return keep_row(chunks, out, error);
}

/* The last chunk of rows before which there are at most so many items. */
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
    counts c;
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

/* Groups of the first level below the roots are the subtrees themselves. */
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

/* A chunk of the table, and what of `outer` goes with it. */
static void expect_rows_at(ebpo_chunks *chunks, ebpo_expected *e, uint64_t chunk)
{
    const ebpo_shape *shape = &ebpo_reader_array(chunks->file, EBPO_A_SUBTREE_COUNTS, 0)->shape;
    uint64_t sums[EBPO_SUBTREE_COLS], outer[2];
    for (int k = 0; k < 2; k++) {
        if (!ebpo_input_expects(&chunks->file->in) ||
            sums_before(chunks, chunk + (uint64_t)k, shape->cols, sums, NULL) != EBPO_OK)
            return; /* reading will tell */
        outer[k] = sums[EBPO_S_OUTER_FACES] + sums[EBPO_S_OUTER_VERTICES];
    }
    ebpo_chunks_expect(chunks, e, EBPO_A_SUBTREE_COUNTS, 0, chunk * shape->chunk_rows, 1);
    if (outer[1] > outer[0])
        ebpo_chunks_expect(chunks, e, EBPO_A_SUBTREE_OUTER, 0, outer[0], outer[1] - outer[0]);
}

void ebpo_subtree_table_expect_run(ebpo_chunks *chunks, uint64_t first, uint64_t count)
{
    uint64_t rows = ebpo_reader_array(chunks->file, EBPO_A_SUBTREE_COUNTS, 0)->shape.chunk_rows,
             all = ebpo_reader_array(chunks->file, EBPO_A_SUBTREE_COUNTS, 0)->shape.rows;
    ebpo_expected e = EBPO_EXPECTED_INIT(chunks->file);
    for (uint64_t at = first / rows * rows; at < first + count && at < all; at += rows)
        expect_rows_at(chunks, &e, at / rows);
    ebpo_expect_all(&e);
}

void ebpo_subtree_table_expect(ebpo_chunks *chunks, const uint64_t *subtrees, uint64_t count)
{
    uint64_t rows = ebpo_reader_array(chunks->file, EBPO_A_SUBTREE_COUNTS, 0)->shape.chunk_rows;
    ebpo_expected e = EBPO_EXPECTED_INIT(chunks->file);
    for (uint64_t i = 0; i < count; i++)
        if (i == 0 || subtrees[i] / rows != subtrees[i - 1] / rows)
            expect_rows_at(chunks, &e, subtrees[i] / rows);
    ebpo_expect_all(&e);
}
