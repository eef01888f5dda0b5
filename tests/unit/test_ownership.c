/* Tests ownership: arrays in a workspace beside other arrays of one file, and an open file shared
 * by threads. Intended for AddressSanitizer, LeakSanitizer and ThreadSanitizer. */
#include <pthread.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include <ebpo/ebpo.h>

#include "check_main.h"
#include "core/workspace.h"
#include "solids.h"

static char folder[64], path[128], other[128];
static ebpo_error error;

static void fine(ebpo_status status) { ck_assert_msg(status == EBPO_OK, "%s", error.message); }

static void write_model(void)
{
    ebpo_mesh mesh = ebpo_test_torus(3, 1, 160, 100);
    ebpo_prepared prepared = EBPO_PREPARED_INIT;
    ebpo_build_options options = EBPO_BUILD_OPTIONS_INIT;
    ebpo_tree tree;
    snprintf(folder, sizeof folder, "/tmp/ebpo-ownership-XXXXXX");
    ck_assert_ptr_nonnull(mkdtemp(folder));
    snprintf(path, sizeof path, "%s/x.ebpo.h5", folder);
    snprintf(other, sizeof other, "%s/x.glb", folder);
    fine(ebpo_mesh_prepare(&mesh, NULL, &prepared, &error));
    fine(ebpo_build(&mesh, &prepared.report, NULL, &options, &tree, &error));
    fine(ebpo_tree_write(&tree, path, NULL, &error));
    ebpo_tree_free(&tree);
}

static void remove_model(void)
{
    unlink(path);
    unlink(other);
    rmdir(folder);
}

/* --- one file, several owners --- */

static void stream_all(const ebpo_file *file)
{
    ebpo_stream *stream;
    ebpo_stream_level level = { 0 };
    bool more = true;
    ebpo_error own = EBPO_ERROR_INIT;
    ck_assert_int_eq(ebpo_stream_new(file, NULL, &stream, &own), EBPO_OK);
    while (more)
        ck_assert_int_eq(ebpo_stream_next_level(stream, &level, &more, &own), EBPO_OK);
    ebpo_stream_free(stream);
}

static void query_model(const ebpo_file *file)
{
    static const double point[3] = { 3, 0, 0 };
    ebpo_model *model;
    ebpo_context *context;
    ebpo_inside_result result;
    ebpo_error own = EBPO_ERROR_INIT;
    ck_assert_int_eq(ebpo_model_new(file, NULL, &model, &own), EBPO_OK);
    ck_assert_int_eq(ebpo_context_new(model, &context, &own), EBPO_OK);
    ck_assert_int_eq(ebpo_inside(context, point, NULL, &result, &own), EBPO_OK);
    ck_assert_int_eq(result.where, EBPO_IN);
    ebpo_context_free(context);
    ebpo_model_free(model);
}

static void export_all(const ebpo_file *file)
{
    ebpo_export_report report = { .struct_size = sizeof report };
    fine(ebpo_export(file, other, EBPO_EXPORT_GLB, NULL, &report, &error));
}

static ebpo_workspace *small_workspace(void)
{
    ebpo_workspace *w;
    fine(ebpo_workspace_make_any(&w, 1 << 20, folder, &error));
    return w;
}

/* Checks that no memory of the workspace is in use, and frees it. */
static void end_workspace(ebpo_workspace *w)
{
    ebpo_workspace_stats f = EBPO_WORKSPACE_STATS_INIT;
    ebpo_workspace_get_stats(w, &f);
    ck_assert_uint_gt(f.filed_peak, 0);
    ck_assert_uint_eq(f.held + f.filed, 0);
    ebpo_workspace_free(w);
}

START_TEST(test_workspace_read_leaves_file_unchanged)
{
    ebpo_file *file;
    ebpo_tree tree;
    ebpo_mesh mesh;
    ebpo_maps maps;
    ebpo_level level;
    write_model();
    fine(ebpo_open(path, &file, &error));
    ebpo_read_options read = EBPO_READ_OPTIONS_INIT;
    read.workspace = _i ? small_workspace() : NULL;
    int last = ebpo_file_info(file)->level_count - 1;
    fine(ebpo_file_read_tree(file, &read, &tree, &error));
    stream_all(file);
    fine(ebpo_file_read_source_mesh(file, &read, &mesh, NULL, &error));
    export_all(file);
    fine(ebpo_file_read_maps(file, &read, &maps, &error));
    query_model(file);
    fine(ebpo_file_read_level(file, last, &read, &level, &error));
    fine(ebpo_file_check_content(file, &read, &error));
    ebpo_tree_free(&tree);
    ebpo_mesh_free(&mesh);
    ebpo_maps_free(&maps);
    ebpo_level_free(&level);
    ebpo_close(file);
    if (read.workspace)
        end_workspace(read.workspace);
    remove_model();
}
END_TEST

START_TEST(test_verify_leaves_no_memory)
{
    ebpo_file *file;
    ebpo_verify_options options = EBPO_VERIFY_OPTIONS_INIT;
    ebpo_verify_report report = EBPO_VERIFY_REPORT_INIT;
    write_model();
    fine(ebpo_open(path, &file, &error));
    options.workspace = small_workspace();
    fine(ebpo_verify(file, &options, &report, &error));
    ck_assert_uint_eq(report.violations, 0);
    end_workspace(options.workspace);
    query_model(file);
    stream_all(file);
    export_all(file);
    ebpo_close(file);
    remove_model();
}
END_TEST

/* --- one file, several threads --- */

typedef struct memory {
    char *data;
    size_t size;
} memory;

static ebpo_status read_memory(void *user, uint64_t offset, uint64_t size, void *data,
                               ebpo_error *e)
{
    (void)e;
    memcpy(data, ((memory *)user)->data + offset, size);
    return EBPO_OK;
}

static void expect_nothing(void *user, const ebpo_range *ranges, size_t count)
{
    (void)user, (void)ranges, (void)count;
}

static void locate(const ebpo_file *file)
{
    ebpo_stored_sizes stored = EBPO_STORED_SIZES_INIT;
    uint64_t sum = 0;
    ck_assert_int_eq(ebpo_file_locate(file, &stored, NULL), EBPO_OK);
    for (int i = 0; i < ebpo_file_info(file)->level_count; i++)
        sum += stored.level_bytes[i];
    ck_assert_uint_gt(sum, 0);
    ck_assert_uint_gt(stored.mesh_face_bytes, 0);
}

static void *use_file(void *argument)
{
    const ebpo_file *file = argument;
    static _Atomic unsigned turn;
    unsigned own = turn++;
    for (unsigned i = 0; i < 3; i++)
        switch ((own + i) % 3) {
        case 0: query_model(file); break;
        case 1: stream_all(file); break;
        default: locate(file); break;
        }
    return NULL;
}

static memory load(void)
{
    memory m = { NULL, 0 };
    FILE *f = fopen(path, "rb");
    ck_assert(f && fseek(f, 0, SEEK_END) == 0);
    m.size = (size_t)ftell(f);
    m.data = malloc(m.size);
    rewind(f);
    ck_assert_uint_eq(fread(m.data, 1, m.size, f), m.size);
    fclose(f);
    return m;
}

/* Locates the chunks of a remote file while other threads read. */
START_TEST(test_threads_share_remote_file)
{
    enum { THREADS = 6 };
    pthread_t thread[THREADS];
    ebpo_file *file;
    write_model();
    memory m = load();
    ebpo_source source = EBPO_SOURCE_INIT;
    source.user = &m;
    source.size = m.size;
    source.read = read_memory;
    source.prefetch = expect_nothing;
    source.prefetched = 30000;
    fine(ebpo_open_source(&source, "far", &file, &error));
    ebpo_info before = *ebpo_file_info(file);
    for (int i = 0; i < THREADS; i++)
        ck_assert_int_eq(pthread_create(&thread[i], NULL, use_file, file), 0);
    for (int i = 0; i < THREADS; i++)
        pthread_join(thread[i], NULL);
    ck_assert_int_eq(memcmp(&before, ebpo_file_info(file), sizeof before), 0);
    ebpo_close(file);
    free(m.data);
    remove_model();
}
END_TEST

TEST_SUITE(ownership)
{
    Suite *suite = suite_create("ownership");
    TCase *tests = tcase_create("ownership");
    tcase_set_timeout(tests, 600);
    tcase_add_loop_test(tests, test_workspace_read_leaves_file_unchanged, 0, 2);
    tcase_add_test(tests, test_verify_leaves_no_memory);
    tcase_add_test(tests, test_threads_share_remote_file);
    suite_add_tcase(suite, tests);
    return suite;
}
