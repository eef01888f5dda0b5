/* Tests structs that begin with their size, for callers of other versions and callers that did not
 * set the size. */
#include <stdlib.h>
#include <string.h>

#include <ebpo/ebpo.h>

#include "core/error.h"
#include "check_main.h"
#include "query_support.h"

/* The struct of a caller of a later version. */
typedef struct later_options {
    ebpo_workspace_options now;
    uint64_t later;
} later_options;

typedef struct later_stats {
    ebpo_workspace_stats now;
    uint64_t later;
} later_stats;

static ebpo_workspace *made_with(const void *options, ebpo_status expected)
{
    ebpo_error error = EBPO_ERROR_INIT;
    ebpo_workspace *workspace = NULL;
    ck_assert_int_eq(ebpo_workspace_new(options, &workspace, &error), expected);
    if (expected != EBPO_OK)
        ck_assert_ptr_nonnull(strstr(error.message, "ebpo_workspace_options"));
    return workspace;
}

static ebpo_status no_bytes(void *user, uint64_t offset, uint64_t size, void *data,
                            ebpo_error *error)
{
    (void)user, (void)offset, (void)size, (void)data, (void)error;
    return EBPO_E_IO;
}

static void count_closes(void *user) { ++*(int *)user; }

/* The library owns a source once it is passed, also when it is refused. */
START_TEST(test_source_of_later_version_is_closed)
{
    int closes = 0;
    struct {
        ebpo_source now;
        uint64_t later;
    } source = { EBPO_SOURCE_INIT, 1 };
    ebpo_error error = EBPO_ERROR_INIT;
    ebpo_file *file;
    source.now.struct_size = sizeof source;
    source.now.user = &closes;
    source.now.read = no_bytes;
    source.now.close = count_closes;
    ck_assert_int_eq(ebpo_open_source(&source.now, "later", &file, &error), EBPO_E_UNSUPPORTED);
    ck_assert_ptr_null(file);
    ck_assert_int_eq(closes, 1);
}
END_TEST

START_TEST(test_options_of_other_versions)
{
    later_options later = { EBPO_WORKSPACE_OPTIONS_INIT, 0 };
    ebpo_workspace_stats stats = EBPO_WORKSPACE_STATS_INIT;
    later.now.memory = 256 << 20;
    later.now.temp_dir = "/no/such/folder";
    /* the size of an earlier version */
    later.now.struct_size = offsetof(ebpo_workspace_options, temp_dir);
    ebpo_workspace *workspace = made_with(&later, EBPO_OK);
    ck_assert_int_eq(ebpo_workspace_get_stats(workspace, &stats), EBPO_OK);
    ck_assert_uint_eq(stats.memory, 256 << 20);
    ebpo_workspace_free(workspace);
    later.now.temp_dir = NULL;
    later.now.struct_size = sizeof later;
    ebpo_workspace_free(made_with(&later, EBPO_OK));
    later.later = 1;
    made_with(&later, EBPO_E_UNSUPPORTED);
}
END_TEST

START_TEST(test_invalid_struct_sizes_are_refused)
{
    static const size_t sizes[] = { 0, 1, sizeof(size_t), 17, 8200, SIZE_MAX };
    ebpo_workspace_options options = EBPO_WORKSPACE_OPTIONS_INIT;
    options.struct_size = sizes[_i];
    made_with(&options, EBPO_E_ARGUMENT);
}
END_TEST

START_TEST(test_output_structs_are_filled_by_size)
{
    later_stats stats;
    ebpo_workspace *workspace = made_with(NULL, EBPO_OK);
    memset(&stats, 0xa5, sizeof stats);
    later_stats untouched = stats;
    stats.now.struct_size = untouched.now.struct_size = 0;
    ck_assert_int_eq(ebpo_workspace_get_stats(workspace, &stats.now), EBPO_E_ARGUMENT);
    ck_assert_int_eq(memcmp(&stats, &untouched, sizeof stats), 0);
    stats.now.struct_size = sizeof stats;
    ck_assert_int_eq(ebpo_workspace_get_stats(workspace, &stats.now), EBPO_OK);
    ck_assert_uint_eq(stats.now.struct_size, sizeof stats);
    ck_assert_uint_eq(stats.now.held, 0);
    ck_assert_uint_eq(stats.later, 0);
    memset(&stats.now.held, 0xa5, sizeof stats.now.held);
    stats.now.struct_size = offsetof(ebpo_workspace_stats, held);
    ck_assert_int_eq(ebpo_workspace_get_stats(workspace, &stats.now), EBPO_OK);
    ck_assert_uint_eq(stats.now.held, 0xa5a5a5a5a5a5a5a5u);
    ebpo_workspace_free(workspace);
}
END_TEST

/* Expects that a public call refuses an uninitialized struct with a message that names the struct,
 * and creates nothing. */
#define REFUSED(type, call)                                                                   \
    do {                                                                                      \
        ebpo_error error_ = EBPO_ERROR_INIT, *error = &error_;                                \
        ck_assert_int_eq((call), EBPO_E_ARGUMENT);                                            \
        ck_assert_msg(strstr(error_.message, #type ": invalid struct_size"), "%s: %s", #call, \
                      error_.message);                                                        \
    } while (0)

/* Returns a zeroed block for any type. */
static void *zeros(void)
{
    static uint64_t block[4096];
    memset(block, 0, sizeof block);
    return block;
}

START_TEST(test_uninitialized_structs_are_refused)
{
    static const query_variant standard = { "default", 4, 4, EBPO_RULE_NONZERO, 0 };
    query_model m;
    query_model_make(&m, "sphere", ebpo_test_sphere((double[3]){ 0, 0, 0 }, 1, 1), &standard);
    const char *path = "/no/such/folder/file";
    static const double p[3];
    void *made = NULL;
    ebpo_mesh mesh = { 0 };
    ebpo_tree tree;
    ebpo_inside_result inside;
    ebpo_distance_result distance;
    ebpo_source source = EBPO_SOURCE_INIT;
    ebpo_export_options one = EBPO_EXPORT_OPTIONS_INIT;
    ebpo_build_options build = EBPO_BUILD_OPTIONS_INIT;
    REFUSED(ebpo_mesh_read_options, ebpo_mesh_read(path, zeros(), &mesh, error));
    ebpo_prepared prepared = EBPO_PREPARED_INIT;
    REFUSED(ebpo_prepare_options, ebpo_mesh_prepare(&mesh, zeros(), &prepared, error));
    REFUSED(ebpo_prepared, ebpo_mesh_prepare(&mesh, NULL, zeros(), error));
    REFUSED(ebpo_build_options, ebpo_build(&mesh, zeros(), NULL, zeros(), &tree, error));
    build.times = zeros();
    REFUSED(ebpo_build_times, ebpo_build(&mesh, NULL, NULL, &build, &tree, error));
    REFUSED(ebpo_write_options, ebpo_tree_write(&tree, path, zeros(), error));
    REFUSED(ebpo_source, ebpo_open_source(zeros(), "zeros", (ebpo_file **)&made, error));
    REFUSED(ebpo_http_options, ebpo_source_of_url("http://a/b", zeros(), &source, error));
    REFUSED(ebpo_source, ebpo_source_of_url("http://a/b", NULL, zeros(), error));
    REFUSED(ebpo_http_options, ebpo_open_url("http://a/b", zeros(), (ebpo_file **)&made, error));
    REFUSED(ebpo_verify_options,
            ebpo_verify(m.file, zeros(), &(ebpo_verify_report)EBPO_VERIFY_REPORT_INIT, error));
    REFUSED(ebpo_verify_report, ebpo_verify(m.file, NULL, zeros(), error));
    REFUSED(ebpo_lod_options, ebpo_lod_level(m.file, 0, zeros(), &mesh, NULL, error));
    REFUSED(ebpo_export_options, ebpo_export(m.file, path, EBPO_EXPORT_STL, zeros(), NULL, error));
    REFUSED(ebpo_export_report, ebpo_export(m.file, path, EBPO_EXPORT_STL, &one, zeros(), error));
    REFUSED(ebpo_subset_options, ebpo_subset(m.file, path, zeros(), error));
    REFUSED(ebpo_limit, ebpo_limit_level(m.file, 0, NULL, zeros(), error));
    ebpo_limit limit = EBPO_LIMIT_INIT;
    REFUSED(ebpo_limit_options, ebpo_limit_level(m.file, 0, zeros(), &limit, error));
    ck_assert_int_eq(ebpo_file_get_stats(m.file, zeros()), EBPO_E_ARGUMENT);
    REFUSED(ebpo_stored_sizes, ebpo_file_locate(m.file, zeros(), error));
    ebpo_level level;
    REFUSED(ebpo_read_options, ebpo_file_read_level(m.file, 0, zeros(), &level, error));
    REFUSED(ebpo_mass, ebpo_measure(m.file, 1, zeros(), error));
    REFUSED(ebpo_solid_volume, ebpo_solid_volume_of(&ebpo_file_info(m.file)->report,
                                                    EBPO_RULE_NONZERO, NULL, NULL, zeros(), error));
    REFUSED(ebpo_shells,
            ebpo_solid_volume_of(&ebpo_file_info(m.file)->report, EBPO_RULE_NONZERO, zeros(), NULL,
                                 &(ebpo_solid_volume)EBPO_SOLID_VOLUME_INIT, error));
    REFUSED(ebpo_error_bound, ebpo_level_error_bound(m.model, m.file, 0, NULL, zeros(), error));
    REFUSED(ebpo_error_bound_options,
            ebpo_level_error_bound(m.model, m.file, 0, zeros(),
                                   &(ebpo_error_bound)EBPO_ERROR_BOUND_INIT, error));
    REFUSED(ebpo_model_options, ebpo_model_new(m.file, zeros(), (ebpo_model **)&made, error));
    REFUSED(ebpo_inside_options, ebpo_inside(m.context, p, zeros(), &inside, error));
    REFUSED(ebpo_distance_options, ebpo_distance(m.context, p, zeros(), &distance, error));
    REFUSED(ebpo_stream_options, ebpo_stream_new(m.file, zeros(), (ebpo_stream **)&made, error));
    REFUSED(ebpo_view_options,
            ebpo_view_stream_new(m.file, zeros(), (ebpo_view_stream **)&made, error));
    ebpo_view_options view = EBPO_VIEW_OPTIONS_INIT;
    view.observer = zeros();
    REFUSED(ebpo_observer, ebpo_view_stream_new(m.file, &view, (ebpo_view_stream **)&made, error));
    ck_assert_int_eq(ebpo_model_get_stats(m.model, zeros()), EBPO_E_ARGUMENT);
    ck_assert_int_eq(ebpo_file_get_http_stats(m.file, zeros()), EBPO_E_ARGUMENT);
    ck_assert_ptr_null(made);
    query_model_free(&m);
}
END_TEST

TEST_SUITE(sized)
{
    Suite *suite = suite_create("sized");
    TCase *tests = tcase_create("sized");
    tcase_set_timeout(tests, 120);
    tcase_add_test(tests, test_options_of_other_versions);
    tcase_add_test(tests, test_source_of_later_version_is_closed);
    tcase_add_loop_test(tests, test_invalid_struct_sizes_are_refused, 0, 6);
    tcase_add_test(tests, test_output_structs_are_filled_by_size);
    tcase_add_test(tests, test_uninitialized_structs_are_refused);
    suite_add_tcase(suite, tests);
    return suite;
}
