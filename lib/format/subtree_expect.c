#include "format/subtree_expect.h"

#include <stdlib.h>

#include "core/alloc.h"
#include "format/subtree_table.h"

typedef struct telling {
    ebpo_chunks *chunks;
    ebpo_expected *expected;
    const ebpo_subtree_row *first, *last;
    uint32_t needs;
    int last_level;
} telling;

static void expect_rows(const telling *t, ebpo_array_id id, int level, uint64_t begin, uint64_t end)
{
    if (end > begin)
        ebpo_chunks_expect(t->chunks, t->expected, id, level, begin, end - begin);
}

/* The level's sums of a column before the subtrees and behind them. */
static uint64_t subtree_sum(const telling *t, int level, unsigned what, bool after)
{
    unsigned column = ebpo_subtree_column(&t->chunks->file->info, level, what);
    return after ? t->last->after[column] : t->first->before[column];
}

static uint64_t sum_of(const telling *t, ebpo_per per, int level, bool after)
{
    const ebpo_info *info = &t->chunks->file->info;
    uint64_t groups = ebpo_subtree_groups(info, after ? t->last : t->first, level, after);
    switch (per) {
    case EBPO_PER_GROUP: return groups;
    case EBPO_PER_GRAY: return subtree_sum(t, level, EBPO_S_GRAY, after);
    case EBPO_PER_LEAF: return subtree_sum(t, level, EBPO_S_LEAF, after);
    case EBPO_PER_BLACK: return subtree_sum(t, level, EBPO_S_BLACK, after);
    case EBPO_PER_WHITE:
        return 8 * groups - subtree_sum(t, level, EBPO_S_GRAY, after) - subtree_sum(t, level, EBPO_S_LEAF, after) -
               subtree_sum(t, level, EBPO_S_BLACK, after);
    case EBPO_PER_PLANE: return subtree_sum(t, level, EBPO_S_PLANES, after);
    case EBPO_PER_LEAF_PLANE: return subtree_sum(t, level, EBPO_S_LEAF_PLANES, after);
    case EBPO_PER_REF: return subtree_sum(t, level, EBPO_S_REFS, after);
    default: return 0; /* index arrays, which the table stands for */
    }
}

static void tell_nodes(const telling *t)
{
    const ebpo_info *info = &t->chunks->file->info;
    for (int level = info->subtree_level + 1; level < info->level_count && level <= t->last_level;
         level++)
        for (int id = 0; id < EBPO_LEVEL_ARRAYS; id++)
            if (ebpo_schema[id].needs & t->needs)
                expect_rows(t, (ebpo_array_id)id, level, sum_of(t, ebpo_schema[id].per, level, false),
                     sum_of(t, ebpo_schema[id].per, level, true));
}

/* A chunk of faces or vertices, `distance` blocks before `from`. */
static void tell_block(const telling *t, ebpo_array_id id, uint64_t from, uint64_t block_rows,
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

static void tell_own_faces(const telling *t)
{
    uint64_t faces = t->last->after[EBPO_S_FACES_BEFORE] + t->last->after[EBPO_S_FACES],
             vertices = t->last->after[EBPO_S_VERTICES_BEFORE] + t->last->after[EBPO_S_VERTICES];
    expect_rows(t, EBPO_A_FACES, 0, t->first->face, faces);
    expect_rows(t, EBPO_A_VERTICES, 0, t->first->vertex, vertices);
    if (t->needs & EBPO_NEEDS_MAPS)
        expect_rows(t, EBPO_A_FACE_SOURCE, 0, t->first->face, faces);
}

/* The rows of `outer` are hints: of any value, and of any number. */
static void tell_outer(const telling *t, const ebpo_subtree_row *row)
{
    enum { OUTER_MOST = 1 << 16 };
    uint64_t first = row->before[EBPO_S_OUTER_FACES] + row->before[EBPO_S_OUTER_VERTICES],
             faces = row->after[EBPO_S_OUTER_FACES] - row->before[EBPO_S_OUTER_FACES],
             vertices = row->after[EBPO_S_OUTER_VERTICES] - row->before[EBPO_S_OUTER_VERTICES],
             count = faces + vertices;
    const ebpo_array_in *array = ebpo_reader_array(t->chunks->file, EBPO_A_SUBTREE_OUTER, 0);
    uint32_t *outer;
    if (!array->present || count == 0 || count > OUTER_MOST || first > array->shape.rows ||
        count > array->shape.rows - first ||
        ebpo_chunks_take(t->chunks, EBPO_A_SUBTREE_OUTER, 0, first, count, sizeof *outer, &outer,
                         NULL) != EBPO_OK)
        return;
    for (uint64_t i = 0; i < count; i++)
        tell_block(t, i < faces ? EBPO_A_FACES : EBPO_A_VERTICES,
                   i < faces ? row->face : row->vertex,
                   i < faces ? EBPO_FACE_BLOCK : EBPO_VERTEX_BLOCK, outer[i]);
    free(outer);
}

void ebpo_subtrees_expect(ebpo_chunks *chunks, ebpo_expected *expected, uint64_t first,
                          uint64_t count, uint32_t needs, int last_level, bool faces)
{
    const ebpo_info *info = &chunks->file->info;
    bool mesh = faces && info->parts & EBPO_PART_MESH, alone = count == 1; /* then one row is all */
    ebpo_subtree_row *row = ebpo_alloc(3, sizeof *row);
    telling t = { chunks,  expected,
                  &row[0], alone ? &row[0] : &row[1],
                  needs,   faces ? EBPO_LEVELS_MAX : last_level };
    if (row && count && ebpo_expected_wanted(expected) &&
        ebpo_subtree_table_row(chunks, first, &row[0], NULL) == EBPO_OK &&
        (alone || ebpo_subtree_table_row(chunks, first + count - 1, &row[1], NULL) == EBPO_OK)) {
        tell_nodes(&t);
        if (mesh)
            tell_own_faces(&t);
        if (mesh && alone)
            tell_outer(&t, &row[0]);
        for (uint64_t i = 0; i < count && mesh && !alone; i++)
            if (ebpo_subtree_table_row(chunks, first + i, &row[2], NULL) == EBPO_OK)
                tell_outer(&t, &row[2]);
    }
    free(row);
}
