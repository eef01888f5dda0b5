/* Tests the verifier with the part `subtrees`: every number is changed, and the change is
 * reported. */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <ebpo/build.h>
#include <ebpo/subset.h>
#include <ebpo/verify.h>

#include "changed_array.h"
#include "check_main.h"
#include "model_file.h"
#include "scratch.h"
#include "solids.h"

static const char *path;
static ebpo_verify_report report = EBPO_VERIFY_REPORT_INIT;

static void enter(void)
{
    scratch_enter();
    path = scratch("x.ebpo.h5");
}

static void write_model(ebpo_mesh mesh, uint32_t parts, uint64_t subtree_faces)
{
    ebpo_build_options build = EBPO_BUILD_OPTIONS_INIT;
    ebpo_write_options write = EBPO_WRITE_OPTIONS_INIT;
    build.leaf_faces = 4;
    build.parts = ~0u;
    build.max_level = 5;
    write.codec = EBPO_CODEC_NONE;
    write.parts = parts;
    write.subtree_faces = subtree_faces;
    ebpo_tree tree = model_build(mesh, &build);
    model_write(&tree, path, &write);
}

/* Returns false when the file cannot be opened. */
static bool verify_memory(const changeable *c)
{
    ebpo_error error = EBPO_ERROR_INIT;
    ebpo_file *file;
    ebpo_verify_options options = EBPO_VERIFY_OPTIONS_INIT;
    options.threads = 1;
    options.label_samples = 1;
    if (ebpo_open_memory(c->data, c->size, "x", &file, &error) != EBPO_OK)
        return false;
    ck_assert_msg(ebpo_verify(file, &options, &report, &error) == EBPO_OK, "%s", error.message);
    ebpo_close(file);
    return true;
}

static void expect_fine(const changeable *c)
{
    ck_assert(verify_memory(c));
    ck_assert_msg(report.violations == 0, "%s %s", report.structure.first, report.content.first);
}

static void expect_named(changeable *c, ebpo_array_id id, uint64_t item, uint64_t value)
{
    char name[EBPO_PATH_BYTES];
    uint64_t before = changeable_put(c, id, item, value);
    ebpo_schema_path(id, 0, name);
    if (before != value && verify_memory(c))
        ck_assert_msg(report.structure.violations > 0 && strstr(report.structure.first, name),
                      "%s, number %d: %s", name, (int)item, report.structure.first);
    changeable_put(c, id, item, before);
}

/* Changes every number of an array, or in large arrays some numbers of each column. */
static void change_array(changeable *c, ebpo_array_id id, uint64_t step)
{
    uint64_t count = changeable_count(c, id);
    ck_assert_uint_gt(count, 0);
    for (uint64_t i = 0; i < count; i += step) {
        uint64_t value = changeable_get(c, id, i);
        expect_named(c, id, i, value + 1);
        if (value && i % 3 == 0)
            expect_named(c, id, i, value - 1);
    }
}

/* Changes what the list of shared chunks names, which is a hint. */
static void change_hints(changeable *c, uint64_t step)
{
    uint64_t count = changeable_count(c, EBPO_A_SUBTREE_SHARED);
    ck_assert_uint_gt(count, 0);
    for (uint64_t i = 0; i < count; i += step) {
        uint64_t before = changeable_put(c, EBPO_A_SUBTREE_SHARED, i, i % 2 ? 0 : UINT32_MAX);
        expect_fine(c);
        changeable_put(c, EBPO_A_SUBTREE_SHARED, i, before);
    }
}

static uint64_t steps(uint64_t count) { return (uint64_t)((double)count / ebpo_test_scale()); }

START_TEST(test_verify_recounts_subtree_table)
{
    changeable c;
    write_model(ebpo_test_torus(2, 0.7, 60, 40), ~0u, _i ? 8 : 200);
    changeable_load(&c, path);
    expect_fine(&c);
    change_array(&c, EBPO_A_SUBTREE_INDEX, steps(1));
    change_array(&c, EBPO_A_SUBTREE_COUNTS, steps(53));
    change_hints(&c, steps(31));
    changeable_free(&c);
}
END_TEST

/* The reader itself refuses some of the changed offsets. */
START_TEST(test_verify_subtree_offsets_against_index)
{
    changeable c;
    write_model(ebpo_test_torus(2, 0.7, 60, 40), ~0u, 8);
    changeable_load(&c, path);
    uint64_t count = changeable_count(&c, EBPO_A_CHUNK_DIRECTORY);
    for (uint64_t i = 0; i < count; i += steps(23)) {
        uint64_t place = changeable_get(&c, EBPO_A_CHUNK_DIRECTORY, i);
        expect_named(&c, EBPO_A_CHUNK_DIRECTORY, i, place + 1);
        expect_named(&c, EBPO_A_CHUNK_DIRECTORY, i, place ^ UINT64_C(1) << 32);
        expect_named(&c, EBPO_A_CHUNK_DIRECTORY, i, (place & UINT32_MAX) | UINT64_C(4097) << 32);
    }
    changeable_free(&c);
}
END_TEST

START_TEST(test_verify_chunk_checksums)
{
    changeable c;
    write_model(ebpo_test_torus(2, 0.7, 60, 40), ~0u, 8);
    changeable_load(&c, path);
    expect_fine(&c);
    uint64_t count = changeable_count(&c, EBPO_A_CHUNK_CHECKSUMS);
    for (uint64_t i = 0; i < count; i += steps(23)) {
        uint64_t sum = changeable_get(&c, EBPO_A_CHUNK_CHECKSUMS, i);
        expect_named(&c, EBPO_A_CHUNK_CHECKSUMS, i, sum + 1);
        expect_named(&c, EBPO_A_CHUNK_CHECKSUMS, i, sum ^ UINT64_C(1) << 32);
        expect_named(&c, EBPO_A_CHUNK_CHECKSUMS, i, UINT64_C(63) << 32);
    }
    changeable_free(&c);
}
END_TEST

/* The same, for a file with pages of checksums. */
START_TEST(test_verify_pages_of_checksums)
{
    static const ebpo_array_id ids[] = { EBPO_A_CHECKSUM_PAGES, EBPO_A_CHECKSUM_INDEX };
    changeable c;
    write_model(ebpo_test_torus(1, 0.03125, 160, 16), ~0u, 10);
    changeable_load(&c, path);
    expect_fine(&c);
    for (int k = 0; k < 2; k++) {
        uint64_t count = changeable_count(&c, ids[k]);
        ck_assert_uint_gt(count, 3);
        for (uint64_t i = 0; i < count; i += steps(7))
            expect_named(&c, ids[k], i, changeable_get(&c, ids[k], i) ^ 1);
    }
    changeable_free(&c);
}
END_TEST

/* Exchanges two rows of the list with equal sizes. */
START_TEST(test_verify_detects_swapped_chunks)
{
    changeable c;
    unsigned found = 0;
    write_model(ebpo_test_torus(2, 0.7, 60, 40), ~0u, 8);
    changeable_load(&c, path);
    for (uint64_t i = 1; i < changeable_count(&c, EBPO_A_CHUNK_DIRECTORY); i++) {
        uint64_t a = changeable_get(&c, EBPO_A_CHUNK_DIRECTORY, i - 1),
                 b = changeable_get(&c, EBPO_A_CHUNK_DIRECTORY, i);
        if (a == b || (uint32_t)a != (uint32_t)b)
            continue;
        if (found++ >= ebpo_test_scaled(40))
            break;
        changeable_put(&c, EBPO_A_CHUNK_DIRECTORY, i - 1, b);
        expect_named(&c, EBPO_A_CHUNK_DIRECTORY, i, a);
        changeable_put(&c, EBPO_A_CHUNK_DIRECTORY, i - 1, a);
    }
    ck_assert_uint_gt(found, 0);
    changeable_free(&c);
}
END_TEST

START_TEST(test_verify_subtree_table_without_parts)
{
    static const uint32_t parts[] = { EBPO_PART_PLANES, EBPO_PART_MESH,
                                      EBPO_PART_MESH | EBPO_PART_LEAF_PLANES,
                                      EBPO_PART_LEAF_PLANES };
    changeable c;
    write_model(_i % 2 ? ebpo_test_make("sphere") : ebpo_test_sheet(3, 30), parts[_i], 20);
    changeable_load(&c, path);
    expect_fine(&c);
    change_array(&c, EBPO_A_SUBTREE_COUNTS, steps(41));
    changeable_free(&c);
}
END_TEST

START_TEST(test_verify_subset_rows_of_pruned_nodes)
{
    ebpo_error error = EBPO_ERROR_INIT;
    ebpo_subset_options subset = EBPO_SUBSET_OPTIONS_INIT;
    ebpo_file *whole;
    changeable c;
    subset.codec = EBPO_CODEC_NONE;
    subset.subtree_faces = 8;
    subset.last_level = _i ? 4 : -1;
    subset.boxed = true;
    for (int k = 0; k < 3; k++)
        subset.max[k] = 1.5;
    write_model(ebpo_test_torus(2, 0.7, 60, 40), ~0u, EBPO_NO_SUBTREES);
    ck_assert(ebpo_open(path, &whole, &error) == EBPO_OK);
    path = scratch("part.ebpo.h5");
    ck_assert_msg(ebpo_subset(whole, path, &subset, &error) == EBPO_OK, "%s", error.message);
    ebpo_close(whole);
    changeable_load(&c, path);
    ck_assert(ebpo_file_info(c.file)->subtree_level > 0 && ebpo_file_info(c.file)->pruned);
    expect_fine(&c);
    change_array(&c, EBPO_A_SUBTREE_COUNTS, steps(41));
    changeable_free(&c);
}
END_TEST

TEST_SUITE(verify_subtrees)
{
    Suite *suite = suite_create("verify_subtrees");
    TCase *tests = tcase_create("verify_subtrees");
    tcase_set_timeout(tests, 600);
    tcase_add_checked_fixture(tests, enter, scratch_leave);
    tcase_add_loop_test(tests, test_verify_recounts_subtree_table, 0, 2);
    tcase_add_test(tests, test_verify_subtree_offsets_against_index);
    tcase_add_test(tests, test_verify_chunk_checksums);
    tcase_add_test(tests, test_verify_pages_of_checksums);
    tcase_add_test(tests, test_verify_detects_swapped_chunks);
    tcase_add_loop_test(tests, test_verify_subtree_table_without_parts, 0, 4);
    tcase_add_loop_test(tests, test_verify_subset_rows_of_pruned_nodes, 0, 2);
    suite_add_tcase(suite, tests);
    return suite;
}
