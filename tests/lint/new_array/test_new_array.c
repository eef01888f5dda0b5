/* Arrays that nothing but a pointer in ebpo_level and a row of the table speaks of, one for each
 * leaf and one for each plane of a leaf: written, read, listed, picked, sliced, cut, digested and
 * checked. Built with a copy of both that has them (add_rows.py). */
#include <hdf5.h>
#include <stdio.h>

#include <ebpo/subset.h>
#include <ebpo/verify.h>

#include "check_main.h"
#include "format/pick_rows.h"
#include "format/slice.h"
#include "geometry/level_nodes.h"
#include "random_tree.h"
#include "scratch.h"
#include "verify/verify_tree.h"

static const char *path, *other;
static ebpo_tree tree;
static ebpo_error error = EBPO_ERROR_INIT;

static void mark(ebpo_tree *t)
{
    uint32_t state = 1;
    for (int i = 0; i < t->info.level_count; i++) {
        ebpo_level *l = &t->level[i];
        l->leaf_mark = malloc(l->leaf_count + 1);
        for (uint64_t k = 0; k < l->leaf_count; k++)
            l->leaf_mark[k] = (uint8_t)((state = state * 1664525 + 1013904223) >> 24);
        l->plane_share = malloc((l->leaf_plane_count + 1) * sizeof *l->plane_share);
        for (uint64_t k = 0; k < l->leaf_plane_count; k++)
            l->plane_share[k] = (state = state * 1664525 + 1013904223) >> 20;
    }
}

static void set_up(void)
{
    random_tree_options options = {
        .seed = 6, .levels = 8, .gray_share = 9, .new_faces = 5, .solid = true, .leaf_planes = true
    };
    scratch_enter();
    path = scratch("a.ebpo.h5");
    other = scratch("b.ebpo.h5");
    random_tree_make(&tree, &options);
    mark(&tree);
}

static void tear_down(void)
{
    ebpo_tree_free(&tree);
    scratch_leave();
}

static void good(ebpo_status status) { ck_assert_msg(status == EBPO_OK, "%s", error.message); }

static ebpo_file *write_and_open(ebpo_codec codec)
{
    ebpo_write_options options = EBPO_WRITE_OPTIONS_INIT;
    ebpo_file *file;
    options.codec = codec;
    good(ebpo_tree_write(&tree, path, &options, &error));
    good(ebpo_open(path, &file, &error));
    return file;
}

static void same_bytes(const void *a, const void *b, uint64_t bytes)
{
    ck_assert(bytes == 0 || (a && b && memcmp(a, b, bytes) == 0));
}

static void same_level(const ebpo_level *a, const ebpo_level *b)
{
    ck_assert_uint_eq(a->leaf_count, b->leaf_count);
    ck_assert_uint_eq(a->leaf_plane_count, b->leaf_plane_count);
    same_bytes(a->leaf_mark, b->leaf_mark, a->leaf_count);
    same_bytes(a->plane_share, b->plane_share, a->leaf_plane_count * sizeof *a->plane_share);
}

static bool is_listed(const ebpo_file *file, const char *name, uint64_t rows)
{
    ebpo_array_facts facts = EBPO_ARRAY_FACTS_INIT;
    for (unsigned n = 0; ebpo_file_array(file, n, &facts); n++)
        if (strcmp(facts.path, name) == 0) {
            ck_assert_uint_eq(facts.rows, rows);
            ck_assert(facts.columns == 1 && !facts.is_signed && facts.stored_bytes > 0);
            return true;
        }
    return false;
}

START_TEST(test_new_array_round_trip_and_listing)
{
    ebpo_tree back;
    ebpo_file *file = write_and_open((ebpo_codec)_i);
    good(ebpo_file_read_tree(file, NULL, &back, &error));
    good(ebpo_file_check_content(file, NULL, &error));
    for (int i = 0; i < tree.info.level_count; i++) {
        char name[48];
        same_level(&tree.level[i], &back.level[i]);
        snprintf(name, sizeof name, "/levels/%02d/leaf_mark", i);
        ck_assert(is_listed(file, name, tree.level[i].leaf_count) == !!tree.level[i].leaf_count);
        snprintf(name, sizeof name, "/levels/%02d/plane_share", i);
        ck_assert(is_listed(file, name, tree.level[i].leaf_plane_count) ==
                  !!tree.level[i].leaf_plane_count);
    }
    ebpo_tree_free(&back);
    ebpo_close(file);
}
END_TEST

START_TEST(test_new_array_changes_content_checksum)
{
    uint8_t digest[32];
    ebpo_file *file = write_and_open(EBPO_CODEC_ZSTD);
    memcpy(digest, ebpo_file_info(file)->content_sha256, sizeof digest);
    ebpo_close(file);
    tree.level[5].leaf_mark[0] ^= 1;
    file = write_and_open(EBPO_CODEC_ZSTD);
    ck_assert_int_ne(memcmp(digest, ebpo_file_info(file)->content_sha256, sizeof digest), 0);
    ebpo_close(file);
}
END_TEST

START_TEST(test_new_array_default_values_are_omitted)
{
    ebpo_level back;
    memset(tree.level[6].leaf_mark, 0, tree.level[6].leaf_count);
    ebpo_file *file = write_and_open(EBPO_CODEC_ZSTD);
    ck_assert(!is_listed(file, "/levels/06/leaf_mark", 0));
    good(ebpo_file_read_level(file, 6, NULL, &back, &error));
    ck_assert_ptr_null(back.leaf_mark);
    ebpo_level_free(&back);
    ebpo_close(file);
}
END_TEST

START_TEST(test_new_array_required_by_part)
{
    char vector[1024];
    ebpo_file *file;
    uint32_t *share = tree.level[7].plane_share;
    ebpo_tally tally = { .checks = { 0 } };
    tree.level[7].plane_share = NULL;
    ck_assert_int_eq(ebpo_tree_write(&tree, path, NULL, &error), EBPO_E_ARGUMENT);
    ck_assert_ptr_nonnull(strstr(error.message, "/levels/07/plane_share: the array is missing"));
    ck_assert(!ebpo_check_shape(&tally, &tree));
    ck_assert_str_eq(tally.first[EBPO_VERIFY_STRUCTURE], "level 7: plane_share is missing");
    tree.level[7].plane_share = share;
    ck_assert(ebpo_check_shape(&tally, &tree));
    /* one that was written when there was no such array */
    snprintf(vector, sizeof vector, "%s/passed/06_four_levels_leaf_planes.ebpo.h5",
             getenv("EBPO_VECTORS"));
    ck_assert_int_eq(ebpo_open(vector, &file, &error), EBPO_E_FORMAT);
    ck_assert_ptr_nonnull(strstr(error.message, "plane_share"));
}
END_TEST

/* Every second group, so that runs have gaps. */
START_TEST(test_new_array_pick_of_runs)
{
    ebpo_file *file = write_and_open(EBPO_CODEC_ZSTD);
    const ebpo_level *all = &tree.level[6];
    uint64_t count = all->group_count / 2, at = 0, planes_at = 0, planes = 0, leaf = 0;
    ebpo_run *runs = calloc(count, sizeof *runs);
    ebpo_chunks *chunks;
    ebpo_level picked;
    good(ebpo_chunks_make(&chunks, file, 0, &error));
    for (uint64_t i = 0; i < count; i++)
        runs[i] = (ebpo_run){ .group = 2 * i + 1, .groups = 1 };
    good(ebpo_pick_level(chunks, 6, runs, count, ~0u, &picked, &error));
    for (uint64_t i = 0; i < count; i++)
        for (uint64_t k = 0; k < runs[i].count[EBPO_LEAF]; k++, at++) {
            for (; leaf < runs[i].rank[EBPO_LEAF] + k; leaf++)
                planes += all->leaf_plane_counts[leaf];
            ck_assert_uint_eq(picked.leaf_mark[at], all->leaf_mark[leaf]);
            for (unsigned n = 0; n < all->leaf_plane_counts[leaf]; n++)
                ck_assert_uint_eq(picked.plane_share[planes_at++], all->plane_share[planes + n]);
        }
    ck_assert_uint_eq(at, picked.leaf_count);
    ck_assert(at > 100 && planes_at > 100);
    ebpo_level_free(&picked);
    ebpo_chunks_free(chunks);
    free(runs);
    ebpo_close(file);
}
END_TEST

/* The children of the root, one after the other: each has the next stretch of every level. */
START_TEST(test_new_array_slices)
{
    ebpo_file *file = write_and_open(EBPO_CODEC_ZSTD);
    ebpo_chunks *chunks;
    uint64_t before[EBPO_LEVELS_MAX] = { 0 }, rank[4] = { 0 };
    good(ebpo_chunks_make(&chunks, file, 0, &error));
    for (unsigned octant = 0; octant < 8; octant++) {
        ebpo_node_type type = ebpo_group_type(tree.level[1].types[0], octant);
        ebpo_node root = { .cell = { .level = 1 }, .type = type, .rank = rank[type]++ };
        ebpo_slice slice;
        if (type != EBPO_GRAY && type != EBPO_LEAF)
            continue;
        good(ebpo_slice_read(&slice, chunks, &root, &error));
        for (int i = 0; i < slice.level_count; i++) {
            const ebpo_level *l = &slice.level[i];
            same_bytes(l->leaf_mark, tree.level[1 + i].leaf_mark + before[1 + i], l->leaf_count);
            before[1 + i] += l->leaf_count;
            ck_assert_ptr_null(l->plane_share); /* slices have no planes of leaves */
        }
        ebpo_slice_free(&slice);
    }
    for (int i = 1; i < tree.info.level_count; i++)
        ck_assert_uint_eq(before[i], tree.level[i].leaf_count);
    ebpo_chunks_free(chunks);
    ebpo_close(file);
}
END_TEST

/* Both trees depth first, of the whole also what the subset lacks. */
typedef struct side {
    const ebpo_tree *tree;
    uint64_t group[EBPO_LEVELS_MAX], leaf[EBPO_LEVELS_MAX], plane[EBPO_LEVELS_MAX];
} side;

static uint64_t leaves_compared;

static void compare_leaf(const side *a, const side *b, int i)
{
    const ebpo_level *l = &a->tree->level[i], *m = &b->tree->level[i];
    ck_assert_uint_eq(l->leaf_mark[a->leaf[i]], m->leaf_mark[b->leaf[i]]);
    ck_assert_uint_eq(l->leaf_plane_counts[a->leaf[i]], m->leaf_plane_counts[b->leaf[i]]);
    same_bytes(l->plane_share + a->plane[i], m->plane_share + b->plane[i],
               l->leaf_plane_counts[a->leaf[i]] * sizeof *l->plane_share);
    leaves_compared++;
}

static void pass_leaf(side *s, int i)
{
    s->plane[i] += s->tree->level[i].leaf_plane_counts[s->leaf[i]++];
}

static void walk(side *a, side *b, int i)
{
    uint16_t types = a->tree->level[i].types[a->group[i]++],
             kept = b ? b->tree->level[i].types[b->group[i]++] : 0;
    for (unsigned octant = 0; octant < ebpo_group_octants(i); octant++) {
        ebpo_node_type type = ebpo_group_type(types, octant);
        bool stays = kept && ebpo_group_type(kept, octant) == type;
        if (type == EBPO_LEAF) {
            if (stays)
                compare_leaf(a, b, i);
            pass_leaf(a, i);
            if (stays)
                pass_leaf(b, i);
            else if (kept && i + 1 < b->tree->info.level_count)
                b->group[i + 1]++; /* it has become a pruned node, with an empty group */
        } else if (type == EBPO_GRAY) {
            walk(a, stays && i + 1 < b->tree->info.level_count ? b : NULL, i + 1);
        }
    }
}

START_TEST(test_new_array_in_subsets)
{
    ebpo_subset_options options = EBPO_SUBSET_OPTIONS_INIT;
    ebpo_file *file = write_and_open(EBPO_CODEC_ZSTD), *cut;
    ebpo_tree back;
    if (_i == 0)
        options.last_level = 6;
    options.boxed = _i == 1;
    for (int k = 0; k < 3; k++) {
        options.min[k] = -0.4;
        options.max[k] = 0.1;
    }
    good(ebpo_subset(file, other, &options, &error));
    good(ebpo_open(other, &cut, &error));
    good(ebpo_file_read_tree(cut, NULL, &back, &error));
    ck_assert(back.info.pruned);
    side a = { .tree = &tree }, b = { .tree = &back };
    leaves_compared = 0;
    walk(&a, &b, 0);
    ck_assert_uint_gt(leaves_compared, 100);
    for (int i = 0; i < back.info.level_count; i++)
        ck_assert_uint_eq(b.leaf[i], back.level[i].leaf_count);
    ebpo_tree_free(&back);
    ebpo_close(cut);
    ebpo_close(file);
}
END_TEST

/* Without the part, the arrays that need it go too, and the others stay. */
START_TEST(test_new_array_is_cut_with_part)
{
    ebpo_subset_options options = EBPO_SUBSET_OPTIONS_INIT;
    ebpo_file *file = write_and_open(EBPO_CODEC_ZSTD), *cut;
    options.parts = EBPO_PART_PLANES;
    good(ebpo_subset(file, other, &options, &error));
    good(ebpo_open(other, &cut, &error));
    ck_assert(is_listed(cut, "/levels/06/leaf_mark", tree.level[6].leaf_count));
    ck_assert(!is_listed(cut, "/levels/06/plane_share", 0));
    ebpo_close(cut);
    ebpo_close(file);
}
END_TEST

static void say_plain(hid_t array)
{
    hid_t type = H5Tcopy(H5T_C_S1), scalar = H5Screate(H5S_SCALAR);
    H5Tset_size(type, strlen("plain"));
    hid_t coding = H5Acreate2(array, "coding", type, scalar, H5P_DEFAULT, H5P_DEFAULT);
    ck_assert_int_ge(H5Awrite(coding, type, "plain"), 0);
    H5Aclose(coding);
    H5Sclose(scalar);
    H5Tclose(type);
}

static void replace_marks(int level, hid_t type, hsize_t rows)
{
    char name[48];
    snprintf(name, sizeof name, "/levels/%02d/leaf_mark", level);
    hid_t file = H5Fopen(path, H5F_ACC_RDWR, H5P_DEFAULT), space = H5Screate_simple(1, &rows, NULL),
          how = H5Pcreate(H5P_DATASET_CREATE);
    H5Pset_chunk(how, 1, &rows);
    H5Pset_fletcher32(how);
    ck_assert_int_ge(H5Ldelete(file, name, H5P_DEFAULT), 0);
    hid_t made = H5Dcreate2(file, name, type, space, H5P_DEFAULT, how, H5P_DEFAULT);
    uint16_t *zeros = calloc(rows, sizeof *zeros);
    ck_assert_int_ge(H5Dwrite(made, H5T_NATIVE_UINT16, H5S_ALL, H5S_ALL, H5P_DEFAULT, zeros), 0);
    free(zeros);
    say_plain(made);
    H5Dclose(made);
    H5Pclose(how);
    H5Sclose(space);
    H5Fclose(file);
}

START_TEST(test_new_array_length_and_type)
{
    static const char *const wrong[] = { "the array's length contradicts the counts in the header",
                                         "the array has the wrong type" };
    ebpo_file *file;
    ebpo_close(write_and_open(EBPO_CODEC_NONE));
    replace_marks(6, _i ? H5T_STD_U16LE : H5T_STD_U8LE, tree.level[6].leaf_count + (_i ? 0 : 1));
    ck_assert_int_eq(ebpo_open(path, &file, &error), EBPO_E_FORMAT);
    ck_assert_ptr_nonnull(strstr(error.message, "/levels/06/leaf_mark"));
    ck_assert_msg(strstr(error.message, wrong[_i]) != NULL, "%s", error.message);
}
END_TEST

/* A real model, whose file says nothing of the array: with marks it verifies; with changed ones its
 * content is not what it says. */
START_TEST(test_new_array_is_verified)
{
    char vector[1024];
    ebpo_file *file;
    ebpo_verify_report report = EBPO_VERIFY_REPORT_INIT;
    ebpo_tree_free(&tree);
    snprintf(vector, sizeof vector, "%s/passed/05_two_levels.ebpo.h5", getenv("EBPO_VECTORS"));
    good(ebpo_open(vector, &file, &error));
    good(ebpo_file_read_tree(file, NULL, &tree, &error));
    ebpo_close(file);
    ck_assert_ptr_null(tree.level[1].leaf_mark);
    mark(&tree);
    file = write_and_open(EBPO_CODEC_NONE);
    good(ebpo_verify(file, NULL, &report, &error));
    ck_assert_uint_eq(report.violations, 0);
    ebpo_close(file);
    replace_marks(1, H5T_STD_U8LE, tree.level[1].leaf_count);
    good(ebpo_open(path, &file, &error));
    good(ebpo_verify(file, NULL, &report, &error));
    ck_assert_uint_eq(report.content.violations, 1);
    ck_assert_uint_eq(report.violations, 1);
    ebpo_close(file);
}
END_TEST

Suite *test_suite(void)
{
    Suite *suite = suite_create("new array");
    TCase *c = tcase_create("all");
    tcase_set_timeout(c, 0);
    tcase_add_checked_fixture(c, set_up, tear_down);
    tcase_add_loop_test(c, test_new_array_round_trip_and_listing, EBPO_CODEC_ZSTD,
                        EBPO_CODEC_NONE + 1);
    tcase_add_test(c, test_new_array_changes_content_checksum);
    tcase_add_test(c, test_new_array_default_values_are_omitted);
    tcase_add_test(c, test_new_array_required_by_part);
    tcase_add_test(c, test_new_array_pick_of_runs);
    tcase_add_test(c, test_new_array_slices);
    tcase_add_loop_test(c, test_new_array_in_subsets, 0, 2);
    tcase_add_test(c, test_new_array_is_cut_with_part);
    tcase_add_loop_test(c, test_new_array_length_and_type, 0, 2);
    tcase_add_test(c, test_new_array_is_verified);
    suite_add_tcase(suite, c);
    return suite;
}
