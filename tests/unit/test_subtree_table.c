/* Compares the table of subtrees with simple counting, the order of chunks with the specification,
 * and the same model in both layouts. */
#include <hdf5.h>
#include <stdlib.h>
#include <string.h>

#include <ebpo/query.h>
#include <ebpo/subset.h>

#include "check_main.h"
#include "format/chunk_directory.h"
#include "format/chunk_layout.h"
#include "format/slice.h"
#include "format/subtree_index.h"
#include "counted_source.h"
#include "geometry/level_nodes.h"
#include "random_tree.h"
#include "read_by.h"
#include "scratch.h"
#include "solids.h"
#include "two_layouts.h"

enum { ALL = EBPO_PART_PLANES | EBPO_PART_MESH | EBPO_PART_MAPS | EBPO_PART_LEAF_PLANES };

/* --- the table, counted node by node --- */

typedef struct plain_table {
    ebpo_tree tree;
    int level;
    unsigned cols;
    uint64_t subtrees;
    uint64_t (*sum)[EBPO_SUBTREE_COLS]; /* [subtrees + 1], the sums before each subtree */
} plain_table;

/* Returns the subtree of each group of a level; the gray nodes of the level give the next one. */
static uint64_t *owners_below(const plain_table *t, int level, const uint64_t *group_owner)
{
    const ebpo_level *l = &t->tree.level[level];
    uint64_t *owner = malloc((l->gray_count + 1) * sizeof *owner), gray = 0;
    for (uint64_t g = 0; g < l->group_count; g++)
        for (unsigned octant = 0; octant < ebpo_group_octants(level); octant++)
            if (ebpo_group_type(l->types[g], octant) == EBPO_GRAY) {
                owner[gray] = group_owner ? group_owner[g] : gray;
                gray++;
            }
    return owner;
}

static void count_leaf(plain_table *t, const ebpo_level *l, uint64_t leaf, uint64_t *has)
{
    has[EBPO_S_LEAF]++;
    if (l->leaf_plane_counts)
        has[EBPO_S_LEAF_PLANES] += l->leaf_plane_counts[leaf];
    if (!l->leaf_first)
        return;
    has[EBPO_S_REFS] += l->leaf_ref_count[leaf];
    has[EBPO_S_ENDS] += l->leaf_first[leaf] + l->leaf_new[leaf] -
                        (leaf ? l->leaf_first[leaf - 1] + l->leaf_new[leaf - 1] : 0);
    (void)t;
}

static void count_groups(plain_table *t, int level, const uint64_t *owner)
{
    const ebpo_level *l = &t->tree.level[level];
    uint64_t leaf = 0, gray = 0;
    for (uint64_t g = 0; g < l->group_count; g++)
        for (unsigned octant = 0; octant < 8; octant++) {
            uint64_t *has = t->sum[owner[g] + 1] + ebpo_subtree_column(&t->tree.info, level, 0);
            switch (ebpo_group_type(l->types[g], octant)) {
            case EBPO_GRAY:
                has[EBPO_S_GRAY]++;
                has[EBPO_S_PLANES] += l->plane_counts ? l->plane_counts[gray] : 0;
                gray++;
                break;
            case EBPO_LEAF: count_leaf(t, l, leaf++, has); break;
            case EBPO_BLACK: has[EBPO_S_BLACK]++; break;
            default: break;
            }
        }
}

static void plain_make(plain_table *t, const ebpo_file *file)
{
    const ebpo_info *info = ebpo_file_info(file);
    ck_assert(ebpo_file_read_tree(file, READ_BY(1), &t->tree, NULL) == EBPO_OK);
    t->level = info->subtree_level;
    t->cols = ebpo_schema_cols(info, EBPO_A_SUBTREE_COUNTS);
    t->subtrees = info->level[t->level].gray_count;
    t->sum = calloc(t->subtrees + 1, sizeof *t->sum);
    uint64_t *owner = owners_below(t, t->level, NULL);
    for (int level = t->level + 1; level < info->level_count; level++) {
        uint64_t *next = owners_below(t, level, owner);
        count_groups(t, level, owner);
        free(owner);
        owner = next;
    }
    free(owner);
    for (uint64_t i = 0; i < t->subtrees; i++)
        for (unsigned k = 0; k < t->cols; k++)
            t->sum[i + 1][k] += t->sum[i][k];
}

static void plain_free(plain_table *t)
{
    ebpo_tree_free(&t->tree);
    free(t->sum);
}

/* Checks that faces and vertices are consecutive; the verifier checks the rest. */
static void check_faces(const plain_table *t, const ebpo_subtree_row *row, uint64_t *face,
                        uint64_t *vertex)
{
    ck_assert(row->face >= *face && row->vertex >= *vertex);
    *face = row->face + row->after[EBPO_S_FACES] - row->before[EBPO_S_FACES];
    *vertex = row->vertex + row->after[EBPO_S_VERTICES] - row->before[EBPO_S_VERTICES];
    ck_assert(*face <= t->tree.mesh.face_count && *vertex <= t->tree.mesh.vertex_count);
}

static void check_rows(const plain_table *t, ebpo_chunks *chunks)
{
    uint64_t face = 0, vertex = 0;
    for (uint64_t i = 0; i < t->subtrees; i++) {
        ebpo_subtree_row row;
        ck_assert(ebpo_subtree_table_row(chunks, i, &row, NULL) == EBPO_OK);
        ck_assert(row.subtree == i);
        for (unsigned k = EBPO_SUBTREE_LEVELS; k < t->cols; k++)
            ck_assert(row.before[k] == t->sum[i][k] && row.after[k] == t->sum[i + 1][k]);
        if (t->tree.mesh.faces)
            check_faces(t, &row, &face, &vertex);
    }
}

static void check_find(const plain_table *t, ebpo_chunks *chunks)
{
    uint64_t state = 1;
    for (unsigned k = EBPO_SUBTREE_LEVELS; k < t->cols; k++)
        for (int n = 0; n < 20 && t->sum[t->subtrees][k]; n++) {
            uint64_t item = ebpo_test_random(&state) % t->sum[t->subtrees][k], last = 0;
            ebpo_subtree_row row;
            for (uint64_t i = 0; i < t->subtrees; i++)
                last = t->sum[i][k] <= item ? i : last;
            ck_assert(ebpo_subtree_table_find(chunks, k, item, &row, NULL) == EBPO_OK);
            ck_assert(row.subtree == last);
        }
}

static void check_table(const ebpo_file *file)
{
    plain_table t;
    ebpo_chunks *chunks;
    ck_assert(ebpo_file_info(file)->subtree_level > 0);
    plain_make(&t, file);
    ck_assert(ebpo_chunks_make(&chunks, file, 0, NULL) == EBPO_OK);
    check_rows(&t, chunks);
    check_find(&t, chunks);
    ebpo_chunks_free(chunks);
    plain_free(&t);
}

/* --- both layouts --- */

static void check_same(const two_layouts *l, uint64_t step)
{
    const ebpo_info *a = ebpo_file_info(l->with), *b = ebpo_file_info(l->without);
    uint64_t turn = 0;
    ck_assert(memcmp(a->content_sha256, b->content_sha256, 32) == 0);
    ck_assert(b->subtree_level == 0);
    ck_assert(ebpo_file_check_content(l->with, READ_BY(1), NULL) == EBPO_OK);
    for (int level = 0; level < a->level_count; level++) {
        uint64_t count, *codes = octcodes_of_level(l->without, level, &count);
        for (uint64_t i = 0; i < count; i++) {
            ebpo_status with, without;
            if (turn++ % step)
                continue;
            uint64_t sum = subtree_sum(l->without, codes[i], &without);
            ck_assert(subtree_sum(l->with, codes[i], &with) == sum && with == without);
        }
        free(codes);
    }
}

static const uint64_t sizes[] = { 1, 8, 100 };

START_TEST(test_random_trees_same_in_both_layouts)
{
    bool solid = _i % 3 != 0;
    if (!ebpo_test_wanted(_i))
        return;
    random_tree_options options = {
        (uint64_t)_i + 40,    3 + _i % 5, 3 + (unsigned)_i % 6, 5, solid, _i % 2 != 0,
        solid && _i % 4 != 0, _i % 5 < 2
    };
    two_layouts l;
    ebpo_tree tree;
    random_tree_make(&tree, &options);
    two_layouts_write(&l, &tree, _i % 7 ? ~0u : EBPO_PART_PLANES, (ebpo_codec)(_i % 3),
                      sizes[_i / 3 % 3]);
    check_table(l.with);
    check_same(&l, 1 + (unsigned)_i % 5);
    two_layouts_close(&l);
}
END_TEST

static const uint32_t parts[] = { ALL, EBPO_PART_MESH, EBPO_PART_PLANES, EBPO_PART_LEAF_PLANES,
                                  EBPO_PART_PLANES | EBPO_PART_MESH | EBPO_PART_MAPS };

START_TEST(test_models_same_in_both_layouts)
{
    two_layouts l;
    if (!ebpo_test_wanted(_i))
        return;
    ebpo_mesh mesh = ebpo_test_torus(2, 0.7, 60, 40);
    if (_i % 2)
        ebpo_test_to_float(&mesh);
    two_layouts_build(&l, mesh, 6, parts[_i % 5], (ebpo_codec)(_i % 3), sizes[_i / 5 % 3]);
    check_table(l.with);
    check_same(&l, 7);
    two_layouts_close(&l);
}
END_TEST

/* Pruned nodes have rows; nodes above the roots of subtrees have none. */
START_TEST(test_subsets_same_in_both_layouts)
{
    two_layouts l;
    ebpo_subset_options subset = EBPO_SUBSET_OPTIONS_INIT;
    two_layouts_build(&l, ebpo_test_torus(2, 0.7, 60, 40), 6, ALL, EBPO_CODEC_ZSTD, 8);
    subset.boxed = true;
    for (int k = 0; k < 3; k++)
        subset.max[k] = 1.5;
    const char *with = scratch("a.ebpo.h5"), *without = scratch("b.ebpo.h5");
    subset.subtree_faces = sizes[_i];
    ck_assert(ebpo_subset(_i % 2 ? l.with : l.without, with, &subset, NULL) == EBPO_OK);
    subset.subtree_faces = EBPO_NO_SUBTREES;
    ck_assert(ebpo_subset(l.with, without, &subset, NULL) == EBPO_OK);
    two_layouts_close(&l);
    ck_assert(ebpo_open(with, &l.with, NULL) == EBPO_OK);
    ck_assert(ebpo_open(without, &l.without, NULL) == EBPO_OK);
    ck_assert(ebpo_file_info(l.with)->pruned);
    check_table(l.with);
    check_same(&l, 1);
    two_layouts_close(&l);
}
END_TEST

/* --- the order of chunks: section 9 --- */

typedef struct placed {
    uint64_t address;
    ebpo_array_id id;
    int level;
    uint64_t row;
} placed;

static int by_address(const void *a, const void *b)
{
    const placed *x = a, *y = b;
    return (x->address > y->address) - (x->address < y->address);
}

static uint64_t list_chunks(const ebpo_file *file, placed *out)
{
    uint64_t count = 0;
    for (int i = 0; i < EBPO_LEVELS_MAX * EBPO_LEVEL_ARRAYS + EBPO_ARRAYS; i++) {
        int of_levels = EBPO_LEVELS_MAX * EBPO_LEVEL_ARRAYS, level = i / EBPO_LEVEL_ARRAYS;
        if (i >= of_levels && i - of_levels < EBPO_LEVEL_ARRAYS)
            continue;
        const ebpo_array_in *a = i < of_levels ? &file->level_array[level][i % EBPO_LEVEL_ARRAYS]
                                               : &file->root_array[i - of_levels];
        for (uint64_t k = 0; a->present && k < ebpo_shape_chunks(&a->shape); k++)
            out[count++] =
                (placed){ a->chunks[k].address, a->id, a->level, k * a->shape.chunk_rows };
    }
    qsort(out, count, sizeof *out, by_address);
    return count;
}

/* Returns the position in the list of the specification: the step, and the level within the step,
 * if any. */
static unsigned step_of(const ebpo_info *info, const placed *p)
{
    int whole = info->subtree_level > 5 ? info->subtree_level : 5, deep = whole + 1;
    while (deep < info->level_count && info->level[deep].leaf_count < info->face_count / 64)
        deep++;
    bool of_level = p->id < EBPO_LEVEL_ARRAYS, middle = p->level < deep,
         list = p->id == EBPO_A_LEAF_SKIP || p->id == EBPO_A_LEAF_NEW ||
                p->id == EBPO_A_LEAF_REF_COUNT || p->id == EBPO_A_LEAF_REFS;
    if (of_level && p->level <= whole)
        return 0;
    if ((of_level && ebpo_schema_is_index(p->id)) || p->id == EBPO_A_SUBTREE_INDEX ||
        p->id == EBPO_A_FACES_INDEX)
        return 1;
    if (p->id == EBPO_A_SUBTREE_COUNTS || p->id == EBPO_A_SUBTREE_SHARED)
        return 2;
    if (of_level && middle)
        return list ? 200 : 100 + (unsigned)p->level;
    if (of_level)
        return list ? 400 : 300;
    return p->id == EBPO_A_CHUNK_DIRECTORY                                     ? 700
           : p->id == EBPO_A_CHUNK_CHECKSUMS || p->id == EBPO_A_CHECKSUM_INDEX ? 650
           : p->id == EBPO_A_CHECKSUM_PAGES                                    ? 640
           : p->id == EBPO_A_VERTEX_SOURCE                                     ? 600
                                                                               : 500;
}

static unsigned column_of(const ebpo_info *info, const placed *p)
{
    static const unsigned what[EBPO_COUNTS] = { EBPO_S_GRAY,   EBPO_S_LEAF,        0, EBPO_S_BLACK,
                                                EBPO_S_PLANES, EBPO_S_LEAF_PLANES, 0, EBPO_S_REFS };
    return ebpo_subtree_column(info, p->level, what[ebpo_schema[p->id].per]);
}

/* Returns the subtree of the first row of a chunk; -1: not known here. */
static int64_t subtree_of(ebpo_chunks *chunks, const placed *p)
{
    const ebpo_info *info = &chunks->file->info;
    ebpo_subtree_row row;
    if (p->id >= EBPO_LEVEL_ARRAYS || ebpo_schema[p->id].per == EBPO_PER_WHITE)
        return -1;
    if (p->id == EBPO_A_TYPES && p->level == info->subtree_level + 1)
        return (int64_t)p->row;
    placed gray = { 0, EBPO_A_PLANE_COUNTS, p->level - 1, p->row };
    ck_assert(ebpo_subtree_table_find(chunks, column_of(info, p->id == EBPO_A_TYPES ? &gray : p),
                                      p->row, &row, NULL) == EBPO_OK);
    return (int64_t)row.subtree;
}

START_TEST(test_chunk_order_follows_specification)
{
    two_layouts l;
    ebpo_tree tree;
    ebpo_chunks *chunks;
    random_tree_options options = { 21, 9, 6, 9, true, false, false, true };
    if (_i)
        two_layouts_build(&l, ebpo_test_torus(2, 0.7, 400, 200), 8, ALL, EBPO_CODEC_NONE, 0);
    else {
        random_tree_make(&tree, &options);
        two_layouts_write(&l, &tree, ~0u, EBPO_CODEC_ZSTD, 60);
    }
    const ebpo_info *info = ebpo_file_info(l.with);
    ck_assert(ebpo_file_locate(l.with, NULL, NULL) == EBPO_OK);
    ck_assert(ebpo_chunks_make(&chunks, l.with, 0, NULL) == EBPO_OK);
    placed *p = malloc(sizeof *p << 20);
    uint64_t count = list_chunks(l.with, p), sorted = 0;
    ck_assert(count > 100);
    for (uint64_t i = 1; i < count; i++) {
        unsigned before = step_of(info, &p[i - 1]), step = step_of(info, &p[i]);
        ck_assert_msg(step >= before, "%s of level %d, row %d, after %s of level %d, row %d",
                      ebpo_schema[p[i].id].name, p[i].level, (int)p[i].row,
                      ebpo_schema[p[i - 1].id].name, p[i - 1].level, (int)p[i - 1].row);
        if (step == 1 && info->top_bytes)
            ck_assert(p[i].address < info->top_bytes);
        if (step != before || step < 100 || step >= 600)
            continue;
        int64_t a = subtree_of(chunks, &p[i - 1]), b = subtree_of(chunks, &p[i]);
        ck_assert(a < 0 || b < 0 || a <= b);
        sorted++;
    }
    ck_assert(sorted > 20);
    free(p);
    ebpo_chunks_free(chunks);
    two_layouts_close(&l);
}
END_TEST

/* The default level of subtrees is the deepest level with at least 512 faces for each gray node, in
 * files of 131,072 faces and more. */
START_TEST(test_default_level_of_subtrees)
{
    ebpo_info info = { .face_count = 131072, .level_count = 6 };
    for (int level = 0; level < 6; level++)
        info.level[level].gray_count = UINT64_C(1) << 2 * level;
    ck_assert_int_eq(ebpo_subtree_level_for(&info, 0), 4);
    info.level[4].gray_count++;
    ck_assert_int_eq(ebpo_subtree_level_for(&info, 0), 3);
    ck_assert_int_eq(ebpo_subtree_level_for(&info, 300), 4);
    info.face_count--;
    ck_assert_int_eq(ebpo_subtree_level_for(&info, 0), 0);
}
END_TEST

/* The index of the faces is read as a whole, so it has as few chunks as possible. With a single
 * chunk, it precedes HDF5's chunk indexes, and the first request of most files contains it. */
START_TEST(test_faces_index_has_long_chunks)
{
    ebpo_info info = { .subtree_level = 5 };
    ck_assert_uint_eq(ebpo_rows_of_chunk(&info, EBPO_A_FACES_INDEX, 0, 8000, 0, 8), 8000);
    ck_assert_uint_eq(ebpo_rows_of_chunk(&info, EBPO_A_FACES_INDEX, 0, 9000, 0, 8), 8192);
}
END_TEST

/* --- refused files --- */

/* The items counted by the last columns are in a separate list. */
START_TEST(test_list_not_matching_table_is_refused)
{
    two_layouts l;
    ebpo_file *file;
    ebpo_status status;
    two_layouts_build(&l, ebpo_test_torus(2, 0.7, 60, 40), 6, ALL, EBPO_CODEC_NONE, 40);
    hid_t h5 = H5Fopen(l.packed, H5F_ACC_RDWR, H5P_DEFAULT);
    ck_assert(h5 >= 0 && H5Ldelete(h5, "/subtrees/shared_chunks", H5P_DEFAULT) >= 0 &&
              H5Fclose(h5) >= 0);
    ck_assert(ebpo_open(l.packed, &file, NULL) == EBPO_OK);
    uint64_t count, refused = 0,
                    *octcode = octcodes_of_level(file, ebpo_file_info(file)->subtree_level, &count);
    for (uint64_t i = 0; i < count; i++) {
        (void)subtree_sum(file, octcode[i], &status);
        ck_assert(status == EBPO_OK || status == EBPO_E_FORMAT);
        refused += status == EBPO_E_FORMAT;
    }
    ck_assert_uint_gt(refused, 0);
    free(octcode);
    ebpo_close(file);
    two_layouts_close(&l);
}
END_TEST

/* --- remote files --- */

/* With a failed connection, each attempt waits. The first failure among many points ends the
 * prefetching for the other points, and the query reports it. */
START_TEST(test_failed_connection_ends_batch)
{
    enum { POINTS = 200 };
    two_layouts l;
    counted_source c;
    ebpo_model_options options = EBPO_MODEL_OPTIONS_INIT;
    ebpo_model *model;
    ebpo_context *context;
    ebpo_error error = EBPO_ERROR_INIT;
    ebpo_distance_result *found = calloc(POINTS, sizeof *found);
    double(*p)[3] = calloc(POINTS, sizeof *p);
    two_layouts_build(&l, ebpo_test_torus(2, 0.7, 200, 120), 8, ALL, EBPO_CODEC_ZSTD, 400);
    for (uint32_t i = 0; i < POINTS; i++)
        ebpo_test_circle(i, POINTS, &p[i][0], &p[i][1]);
    ebpo_file *far = counted_open(&c, l.packed, true);
    options.cut_level = ebpo_file_info(far)->subtree_level;
    ck_assert(ebpo_model_new(far, &options, &model, NULL) == EBPO_OK);
    ck_assert(ebpo_context_new(model, &context, NULL) == EBPO_OK);
    c.failing = true;
    ck_assert(ebpo_distance_many(context, p[0], POINTS, NULL, found, &error) == EBPO_E_IO);
    ck_assert_msg(c.failed < 16, "%d tries", (int)c.failed);
    c.failing = false;
    ck_assert(ebpo_distance_many(context, p[0], POINTS, NULL, found, &error) == EBPO_OK);
    ebpo_context_free(context);
    ebpo_model_free(model);
    counted_close(&c, far);
    two_layouts_close(&l);
    free(found);
    free(p);
}
END_TEST

TEST_SUITE(subtree_table)
{
    Suite *suite = suite_create("subtree_table");
    TCase *tests = tcase_create("subtree_table");
    tcase_set_timeout(tests, 900);
    tcase_add_checked_fixture(tests, scratch_enter, scratch_leave);
    tcase_add_loop_test(tests, test_random_trees_same_in_both_layouts, 0, 30);
    tcase_add_loop_test(tests, test_models_same_in_both_layouts, 0, 15);
    tcase_add_loop_test(tests, test_subsets_same_in_both_layouts, 0, 3);
    tcase_add_loop_test(tests, test_chunk_order_follows_specification, 0, 2);
    tcase_add_test(tests, test_default_level_of_subtrees);
    tcase_add_test(tests, test_faces_index_has_long_chunks);
    tcase_add_test(tests, test_list_not_matching_table_is_refused);
    tcase_add_test(tests, test_failed_connection_ends_batch);
    suite_add_tcase(suite, tests);
    return suite;
}
