/* Tests the verifier with files: with and without optional parts, against their source and against
 * another mesh, intact and damaged. */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

#include <ebpo/build.h>
#include <ebpo/verify.h>

#include "check_main.h"
#include "scratch.h"
#include "solids.h"

static const char *path;
static ebpo_verify_report report = EBPO_VERIFY_REPORT_INIT;

static void enter(void)
{
    scratch_enter();
    path = scratch("model.ebpo.h5");
}

static void leave(void)
{
    unlink(path);
    ck_assert_int_eq(scratch_entries(), 0);
    scratch_leave();
}

/* Makes a mesh with repeated vertices, a hole and reversed faces, so that every repair changes
 * something. */
static ebpo_mesh worn_mesh(void)
{
    ebpo_mesh mesh = ebpo_test_make("sphere");
    ebpo_test_turn_face(&mesh, 5);
    ebpo_test_split_vertices(&mesh);
    mesh.face_count--;
    ebpo_test_shuffle(&mesh, 7);
    return mesh;
}

/* Builds and writes a file of an equal second mesh (makers are deterministic), repaired on request.
 */
static void write_file(ebpo_mesh mesh, bool was_repaired, uint32_t parts)
{
    ebpo_error error = EBPO_ERROR_INIT;
    ebpo_repair_record repair_record = { 0 };
    if (was_repaired) {
        repair_record.weld = repair_record.orient = repair_record.fill_holes = true;
        ck_assert(ebpo_mesh_weld(&mesh, &repair_record, &error) == EBPO_OK);
        ck_assert(ebpo_mesh_orient(&mesh, &repair_record, &error) == EBPO_OK);
        ck_assert(ebpo_mesh_fill_holes(&mesh, &repair_record, &error) == EBPO_OK);
    }
    ebpo_mesh_report facts;
    ck_assert(ebpo_mesh_check(&mesh, 1, (ebpo_progress){ 0 }, &facts, &error) == EBPO_OK);
    ebpo_build_options options = EBPO_BUILD_OPTIONS_INIT;
    options.leaf_faces = 8;
    options.threads = 1;
    options.parts |= EBPO_PART_LEAF_PLANES;
    ebpo_tree tree;
    ck_assert_msg(ebpo_build(&mesh, &facts, &repair_record, &options, &tree, &error) == EBPO_OK,
                  "%s", error.message);
    ebpo_write_options write = EBPO_WRITE_OPTIONS_INIT;
    write.parts = parts;
    ck_assert_msg(ebpo_tree_write(&tree, path, &write, &error) == EBPO_OK, "%s", error.message);
    ebpo_tree_free(&tree);
}

/* Returns false when the file cannot even be opened. */
static bool verify_against(const ebpo_mesh *source)
{
    ebpo_error error = EBPO_ERROR_INIT;
    ebpo_file *file;
    if (ebpo_open(path, &file, &error) != EBPO_OK)
        return false;
    ebpo_verify_options options = EBPO_VERIFY_OPTIONS_INIT;
    options.source = source;
    options.threads = 2;
    ck_assert_msg(ebpo_verify(file, &options, &report, &error) == EBPO_OK, "%s", error.message);
    ebpo_close(file);
    return true;
}

static void expect_fine(const ebpo_mesh *source)
{
    ck_assert(verify_against(source));
    ck_assert_msg(report.violations == 0, "%s%s%s%s%s%s%s", report.structure.first,
                  report.content.first, report.containment.first, report.nesting.first,
                  report.labels.first, report.lists.first, report.source.first);
    ck_assert_uint_gt(report.content.checks, 0);
}

START_TEST(test_verify_file_against_repaired_source)
{
    ebpo_mesh source = worn_mesh();
    write_file(worn_mesh(), true, ~0u);
    expect_fine(&source);
    ck_assert_uint_gt(report.source.checks, 1000);
    ebpo_mesh_free(&source);
}
END_TEST

START_TEST(test_verify_file_without_maps_as_set)
{
    ebpo_mesh source = worn_mesh();
    write_file(worn_mesh(), true, EBPO_PART_MESH | EBPO_PART_PLANES);
    expect_fine(&source);
    ck_assert_uint_gt(report.source.checks, 1000);
    ebpo_mesh_free(&source);
}
END_TEST

START_TEST(test_verify_files_without_parts)
{
    static const uint32_t parts[] = { EBPO_PART_PLANES, EBPO_PART_MESH,
                                      EBPO_PART_MESH | EBPO_PART_LEAF_PLANES, 0 };
    for (size_t i = 0; i < sizeof parts / sizeof *parts; i++) {
        write_file(ebpo_test_make("torus"), false, parts[i]);
        expect_fine(NULL);
    }
}
END_TEST

START_TEST(test_verify_detects_other_source)
{
    static const uint32_t parts[] = { ~0u, EBPO_PART_MESH | EBPO_PART_PLANES };
    for (int i = 0; i < 2; i++) {
        write_file(ebpo_test_make("box_subdivided"), false, parts[i]);
        ebpo_mesh source = ebpo_test_make("box_subdivided");
        expect_fine(&source);
        ebpo_mesh other = ebpo_test_make("box_subdivided");
        uint64_t *bits = (uint64_t *)(void *)other.xyz64;
        bits[0] ^= 1;
        ck_assert(verify_against(&other));
        ck_assert_uint_gt(report.source.violations, 0);
        bits[0] ^= 1;
        uint32_t first = other.faces[0];
        other.faces[0] = other.faces[1], other.faces[1] = other.faces[2], other.faces[2] = first;
        ck_assert(verify_against(&other));
        ck_assert_uint_gt(report.source.violations, 0);
        other.face_count--;
        ck_assert(verify_against(&other));
        ck_assert_uint_gt(report.source.violations, 0);
        ebpo_mesh_free(&other);
        ebpo_mesh_free(&source);
    }
    ebpo_mesh zero = ebpo_test_make("box_subdivided"), minus = ebpo_test_make("box_subdivided");
    uint64_t at = 0;
    while (zero.xyz64[at] != 0)
        at++;
    minus.xyz64[at] = -0.0;
    write_file(ebpo_test_make("box_subdivided"), false, ~0u);
    expect_fine(&zero);
    ck_assert(verify_against(&minus));
    ck_assert_uint_gt(report.source.violations, 0);
    ebpo_mesh_free(&zero);
    ebpo_mesh_free(&minus);
}
END_TEST

/* Tests a file whose coordinates an earlier version rounded. This is not damage. */
START_TEST(test_verify_names_coordinates_of_old_version)
{
    ebpo_mesh source = ebpo_test_make("box_subdivided"), rounded = ebpo_test_make("box_subdivided");
    rounded.xyz32 = malloc(rounded.vertex_count * 3 * sizeof *rounded.xyz32);
    for (uint64_t i = 0; i < 3 * rounded.vertex_count; i++)
        rounded.xyz32[i] = (float)rounded.xyz64[i];
    free(rounded.xyz64);
    rounded.xyz64 = NULL;
    strcpy(source.source_format, "obj");
    write_file(rounded, false, ~0u);
    ck_assert(verify_against(&source));
    ck_assert(report.source.violations == 1 && report.violations == 1);
    ck_assert_str_eq(report.source.first, "coordinates were rounded to single precision by an "
                                          "earlier version; convert again");
    strcpy(source.source_format, "ply-ascii"); /* this version stored the text of the header */
    ck_assert(verify_against(&source));
    ck_assert(strstr(report.source.first, "different kinds of coordinates") != NULL);
    ebpo_mesh_free(&source);
}
END_TEST

/* Flips bits of the arrays. Bits of the header are not flipped, because libhdf5 leaks memory when
 * the header is damaged. The result is a finding, or the byte is unused; there is never a crash or
 * a failed call. */
START_TEST(test_verify_reports_damage_as_findings)
{
    write_file(ebpo_test_make("sphere"), false, ~0u);
    ebpo_file *file;
    ck_assert(ebpo_open(path, &file, NULL) == EBPO_OK);
    uint64_t head = ebpo_file_info(file)->head_bytes;
    ebpo_close(file);
    FILE *f = fopen(path, "r+b");
    fseek(f, 0, SEEK_END);
    long size = ftell(f);
    uint64_t state = 11;
    int found = 0, rounds = 150;
    for (int i = 0; i < rounds; i++) {
        long at = (long)(head + ebpo_test_random(&state) % ((uint64_t)size - head));
        fseek(f, at, SEEK_SET);
        int byte = fgetc(f), flipped = byte ^ 1 << i % 8;
        fseek(f, at, SEEK_SET);
        fputc(flipped, f);
        fflush(f);
        found += !verify_against(NULL) || report.violations > 0;
        fseek(f, at, SEEK_SET);
        fputc(byte, f);
        fflush(f);
    }
    fclose(f);
    ck_assert_int_gt(found, rounds / 2);
    expect_fine(NULL);
}
END_TEST

static bool stop_at_once(void *user, const char *stage, uint64_t done, uint64_t total)
{
    (void)user, (void)stage, (void)done, (void)total;
    return false;
}

START_TEST(test_verify_validation_and_cancel)
{
    ebpo_error error = EBPO_ERROR_INIT;
    ck_assert(ebpo_verify(NULL, NULL, &report, &error) == EBPO_E_ARGUMENT);
    write_file(ebpo_test_make("torus"), false, ~0u);
    ebpo_file *file;
    ck_assert(ebpo_open(path, &file, &error) == EBPO_OK);
    ebpo_verify_options options = EBPO_VERIFY_OPTIONS_INIT;
    options.progress.report = stop_at_once;
    ebpo_status status = ebpo_verify(file, &options, &report, &error);
    /* a small file is finished before the first report */
    ck_assert(status == EBPO_OK || status == EBPO_E_CANCELLED);
    ck_assert(ebpo_verify(file, NULL, &report, &error) == EBPO_OK);
    ck_assert_uint_eq(report.violations, 0);
    ebpo_close(file);
}
END_TEST

static bool stop_at_unused(void *user, const char *stage, uint64_t done, uint64_t total)
{
    (void)user, (void)done, (void)total;
    return strcmp(stage, "checking unused bytes") != 0;
}

/* Tests unused bytes in a sparse file, which take no space. */
START_TEST(test_verify_unused_bytes_and_cancel)
{
    enum { UNUSED = 1 << 20 };
    ebpo_error error = EBPO_ERROR_INIT;
    struct stat st;
    ebpo_file *file;
    ebpo_verify_options options = EBPO_VERIFY_OPTIONS_INIT;
    write_file(ebpo_test_make("torus"), false, ~0u);
    ck_assert(stat(path, &st) == 0 && truncate(path, st.st_size + UNUSED) == 0);
    ck_assert_msg(ebpo_open(path, &file, &error) == EBPO_OK, "%s", error.message);
    ck_assert(ebpo_verify(file, NULL, &report, &error) == EBPO_OK);
    ck_assert(report.spare_bytes >= UNUSED && report.spare_filled == 0 && !report.violations);
    options.progress.report = stop_at_unused;
    ck_assert(ebpo_verify(file, &options, &report, &error) == EBPO_E_CANCELLED);
    ck_assert_str_eq(error.message, "stopped on request during checking unused bytes");
    ebpo_close(file);
}
END_TEST

TEST_SUITE(verify_file)
{
    TCase *tests = tcase_create("verify file");
    tcase_set_timeout(tests, 300);
    tcase_add_checked_fixture(tests, enter, leave);
    tcase_add_test(tests, test_verify_file_against_repaired_source);
    tcase_add_test(tests, test_verify_file_without_maps_as_set);
    tcase_add_test(tests, test_verify_files_without_parts);
    tcase_add_test(tests, test_verify_detects_other_source);
    tcase_add_test(tests, test_verify_names_coordinates_of_old_version);
    tcase_add_test(tests, test_verify_reports_damage_as_findings);
    tcase_add_test(tests, test_verify_validation_and_cancel);
    tcase_add_test(tests, test_verify_unused_bytes_and_cancel);
    Suite *suite = suite_create("verify file");
    suite_add_tcase(suite, tests);
    return suite;
}
