/* Calls every public function, with and without a small workspace, and with each allocation and
 * each file system call failing once. A call must return a status, hold no resource afterwards,
 * leave no file behind, and succeed when it is repeated. Check forks for each call, so that
 * AddressSanitizer and LeakSanitizer see the calls separately.
 *
 *     test_every_call [FAULTY_SERVER], with faults.so preloaded */
#include <errno.h>
#include <dirent.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "mesh/attributes.h"
#include "core/workspace.h"
#include "check_main.h"
#include "ebpo_config.h"
#include "every_call.h"
#include "faults.h"
#include "pending_source.h"
#include "scratch.h"
#include "solids.h"
#include "web.h"

static ebpo_error error;
static bool served;

static void fine(ebpo_status status) { ck_assert_msg(status == EBPO_OK, "%s", error.message); }

const char *every_call_url(void)
{
    every_call_pause();
    const char *url = served ? web_url("good") : NULL;
    every_call_resume();
    return url;
}

void every_call_pause(void) { faults_pause(); }
void every_call_resume(void) { faults_resume(); }

/* --- inputs --- */

/* Gives vertices a colour, and faces lists of 0 to 2 items. */
static void colour(ebpo_mesh *mesh)
{
    ebpo_attribute red = { .element = "vertex", .names = "red", .columns = 1 },
                   tags = { .element = "face", .names = "tags", .columns = 1 };
    red.type = EBPO_ATTRIBUTE_UINT8;
    red.list = EBPO_ATTRIBUTE_NO_LIST;
    tags.type = EBPO_ATTRIBUTE_INT16;
    tags.list = EBPO_ATTRIBUTE_UINT8;
    red.rows = mesh->vertex_count;
    tags.rows = mesh->face_count;
    ebpo_attributes *made = mesh->attributes = ebpo_attributes_make(NULL);
    ck_assert(made && ebpo_attributes_add(made, &red) && ebpo_attributes_add(made, &tags));
    ebpo_attribute *a = made->array;
    ck_assert(ebpo_attribute_reserve(NULL, &a[0], a[0].rows, 0) &&
              ebpo_attribute_reserve(NULL, &a[1], a[1].rows, 2 * a[1].rows));
    for (uint64_t i = 0; i < a[0].rows; i++)
        a[0].values[i] = (uint8_t)i;
    for (uint64_t i = 0, end = 0; i < a[1].rows; i++)
        a[1].ends[i] = end += i % 3;
    memset(a[1].values, 7, 2 * sizeof(int16_t) * a[1].rows);
}

static void write_mesh(ebpo_mesh *mesh, const char *name)
{
    colour(mesh);
    fine(ebpo_mesh_write_ply(mesh, scratch(name), &error));
    ebpo_mesh_free(mesh);
}

static void write_faulty_meshes(uint32_t n)
{
    ebpo_mesh mesh = ebpo_test_torus(3, 1, n, n), other = ebpo_test_torus(3, 1, n, n);
    ebpo_test_split_vertices(&mesh);
    write_mesh(&mesh, EVERY_CALL_SPLIT);
    for (uint64_t face = 0; face < other.face_count; face += 9)
        ebpo_test_turn_face(&other, face);
    write_mesh(&other, EVERY_CALL_TURNED);
    mesh = ebpo_test_torus(3, 1, n, n);
    for (uint64_t face = 0; face < 20; face++) {
        const uint32_t *c = mesh.faces + 3 * face;
        ebpo_test_append_face(&mesh, c[1], c[2], c[0]);
    }
    write_mesh(&mesh, EVERY_CALL_DOUBLE);
    mesh = ebpo_test_torus(3, 1, n, n);
    mesh.face_count -= 5;
    write_mesh(&mesh, EVERY_CALL_HOLED);
    mesh = ebpo_test_torus(3, 1, n, n);
    other = ebpo_test_tetrahedron(4);
    ebpo_test_append(&mesh, &other);
    ebpo_mesh_free(&other);
    write_mesh(&mesh, EVERY_CALL_CROSSING);
}

static void write_obj(void)
{
    static const char text[] = "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\n"
                               "f 1 3 2\nf 1 2 4\nf 2 3 4\nf 3 1 4\n";
    fine(ebpo_write_file(scratch(EVERY_CALL_OBJ), text, sizeof text - 1, &error));
}

/* Writes an HDF5 file with rows of coordinates. */
static void write_rows(void)
{
    ebpo_file *file;
    ebpo_export_report report = { .struct_size = sizeof report };
    fine(ebpo_open(scratch(EVERY_CALL_MODEL), &file, &error));
    fine(ebpo_export(file, scratch(EVERY_CALL_ROWS), EBPO_EXPORT_VTKHDF, NULL, &report, &error));
    ebpo_close(file);
}

static void write_surface(uint32_t n)
{
    ebpo_mesh mesh = ebpo_test_torus(3, 1, n, n);
    ebpo_prepared prepared = EBPO_PREPARED_INIT;
    ebpo_build_options options = EBPO_BUILD_OPTIONS_INIT;
    ebpo_tree tree;
    mesh.face_count -= 5;
    options.leaf_faces = 8;
    options.parts &= ~(uint32_t)EBPO_PART_BORDER;
    fine(ebpo_mesh_prepare(&mesh, NULL, &prepared, &error));
    fine(ebpo_build(&mesh, &prepared.report, NULL, &options, &tree, &error));
    fine(ebpo_tree_write(&tree, scratch(EVERY_CALL_SURFACE), NULL, &error));
    ebpo_tree_free(&tree);
}

static void write_model(uint32_t n)
{
    ebpo_mesh mesh = ebpo_test_torus(3, 1, n, n);
    ebpo_prepared prepared = EBPO_PREPARED_INIT;
    ebpo_build_options options = EBPO_BUILD_OPTIONS_INIT;
    ebpo_tree tree;
    colour(&mesh);
    fine(ebpo_mesh_write_ply(&mesh, scratch(EVERY_CALL_PLY), &error));
    fine(ebpo_mesh_prepare(&mesh, NULL, &prepared, &error));
    options.leaf_faces = 8;
    fine(ebpo_build(&mesh, &prepared.report, NULL, &options, &tree, &error));
    fine(ebpo_tree_write(&tree, scratch(EVERY_CALL_MODEL), NULL, &error));
    ebpo_tree_free(&tree);
    write_surface(n);
    write_rows();
}

static void serve(void)
{
    enum { LIMIT = 8 << 20 };
    FILE *f = test_arguments[0] ? fopen(scratch(EVERY_CALL_MODEL), "rb") : NULL;
    char *data = f ? malloc(LIMIT) : NULL;
    size_t size = data ? fread(data, 1, LIMIT, f) : 0;
    served = size && web_start(test_arguments[0], data, size);
    if (f)
        fclose(f);
    free(data);
}

/* Runs once for all calls, which run in child processes. */
static void write_all(uint32_t n)
{
    scratch_enter();
    write_faulty_meshes(n);
    write_obj();
    write_model(n);
    serve();
}

static void write_large(void) { write_all(ebpo_test_scale() < 1 ? 36 : 48); }
static void write_small(void) { write_all(10); }

static void remove_all(void)
{
    web_stop();
    scratch_leave();
}

static void begin(every_call_env *e, bool in_files)
{
    *e = (every_call_env){ .error = &error };
    fine(ebpo_open(scratch(EVERY_CALL_MODEL), &e->file, &error));
    if (in_files)
        fine(ebpo_workspace_make_any(&e->workspace, 1 << 16, scratch(NULL), &error));
}

/* --- leaks --- */

static int open_files(void)
{
    int count = 0;
    DIR *folder = opendir("/proc/self/fd");
    while (folder && readdir(folder))
        count++;
    if (folder)
        closedir(folder);
    return count;
}

static void expect_workspace_empty(const every_call_env *e, const char *name)
{
    ebpo_workspace_stats stats = EBPO_WORKSPACE_STATS_INIT;
    if (!e->workspace)
        return;
    ebpo_workspace_get_stats(e->workspace, &stats);
    ck_assert_msg(stats.held + stats.filed == 0, "%s leaves %llu bytes in the workspace", name,
                  (unsigned long long)(stats.held + stats.filed));
}

static void finish(every_call_env *e)
{
    ebpo_close(e->file);
    ebpo_workspace_free(e->workspace);
}

static const every_call *call_number(int i)
{
    static const every_call *const tables[] = {
        every_call_meshes,
        every_call_files,
        every_call_results,
#if EBPO_HAVE_EXTRAS
        every_call_extras
#endif
    };
    for (size_t table = 0; table < sizeof tables / sizeof *tables; table++)
        for (const every_call *c = tables[table]; c->name; c++)
            if (i-- == 0)
                return c;
    return NULL;
}

static int call_count(void)
{
    int count = 0;
    while (call_number(count))
        count++;
    return count;
}

/* --- the tests: each call without a workspace and with one --- */

START_TEST(test_call_releases_workspace)
{
    const every_call *c = call_number(_i / 2);
    every_call_env e;
    begin(&e, _i % 2);
    for (int turn = 0; turn < 2; turn++) {
        ebpo_status status = c->call(&e);
        ck_assert_msg(status == EBPO_OK, "%s: %s", c->name, error.message);
        expect_workspace_empty(&e, c->name);
    }
    finish(&e);
}
END_TEST

enum {
    MEMORY = FAULT_MALLOC | FAULT_MMAP | FAULT_THREAD,
    /* faults that are not failures; the call continues */
    IN_PART = FAULT_SHORT_READ | FAULT_SHORT_WRITE
};

/* Makes the n-th system call of these kinds fail, or all calls from the n-th on. Returns true if a
 * call has failed. */
static bool call_with_failure(const every_call *c, every_call_env *e, unsigned kinds, uint64_t n,
                              bool onward)
{
    int files = open_files(), entries = scratch_entries();
    error = (ebpo_error)EBPO_ERROR_INIT;
    faults_begin(kinds, n, onward, kinds == MEMORY ? ENOMEM : EIO);
    ebpo_status status = c->call(e);
    unsigned long long number = faults_end();
    ck_assert_msg(number || status == EBPO_OK, "%s: %s", c->name, error.message);
    ck_assert_msg(status == EBPO_OK || !(kinds & IN_PART), "%s: %#x, %llu: %s", c->name, kinds,
                  number, error.message);
    ck_assert_msg(status == EBPO_OK || error.message[0], "%s: %#x, %llu: no message", c->name,
                  kinds, number);
    ck_assert_msg(status != EBPO_E_FORMAT, "%s: %#x, %llu: reported as damage: %s", c->name, kinds,
                  number, error.message);
    ck_assert_msg(status == EBPO_OK || status == EBPO_E_MEMORY || status == EBPO_E_IO ||
                      kinds != MEMORY,
                  "%s: %llu: without memory the status is %s: %s", c->name, number,
                  ebpo_status_name(status), error.message);
    expect_workspace_empty(e, c->name);
    ck_assert_msg(open_files() <= files, "%s: %#x, %llu: a file stays open", c->name, kinds,
                  number);
    ck_assert_msg(status == EBPO_OK || scratch_entries() <= entries,
                  "%s: %#x, %llu: leaves a file behind: %s", c->name, kinds, number, error.message);
    return number;
}

/* Makes calls of each of the kinds fail. `kinds` ends with 0. With few inputs, each place fails in
 * the first call that comes to it, and every second call meets only failures from there on. */
static void survive(int call, bool with_workspace, const unsigned *kinds)
{
    const every_call *c = call_number(call);
    const uint64_t dense = 200;
    every_call_env e;
    begin(&e, with_workspace);
    fine(c->call(&e));
    for (; *kinds; kinds++) {
        if (ebpo_test_scale() < 1)
            while (call_with_failure(c, &e, *kinds, FAULTS_NEW_PLACE, call % 2))
                ;
        for (int onward = 0; onward < 2 && ebpo_test_scale() >= 1; onward++)
            for (uint64_t n = 1; call_with_failure(c, &e, *kinds, n, onward); n += 1 + n / dense)
                ;
        fine(c->call(&e));
    }
    finish(&e);
}

START_TEST(test_call_survives_allocation_failure)
{
    survive(_i / 2, _i % 2, (const unsigned[]){ MEMORY, 0 });
}
END_TEST

START_TEST(test_call_survives_file_failure)
{
    static const unsigned kinds[] = { FAULT_READ,     FAULT_WRITE, FAULT_SYNC, FAULT_RENAME,
                                      FAULT_TRUNCATE, FAULT_OPEN,  0 };
    survive(_i, false, kinds);
}
END_TEST

/* All reads and writes are split into halves. */
START_TEST(test_call_handles_partial_reads_and_writes)
{
    every_call_env e;
    begin(&e, false);
    (void)call_with_failure(call_number(_i), &e, FAULT_SHORT_READ, 1, true);
    (void)call_with_failure(call_number(_i), &e, FAULT_SHORT_WRITE, 1, true);
    finish(&e);
    survive(_i, false, (const unsigned[]){ FAULT_CLOSE, FAULT_ALLOCATE, 0 });
}
END_TEST

/* Each call is repeated while bytes of its file are pending, and leaves nothing in the workspace.
 */
START_TEST(test_call_resumes)
{
    enum { HEAD = 1024 };
    const every_call *c = call_number(_i);
    every_call_env e;
    pending_source p;
    ebpo_status status;
    begin(&e, true);
    ebpo_close(e.file);
    pending_begin(&p, scratch(EVERY_CALL_MODEL), 0);
    e.file = pending_open(&p, HEAD);
    do {
        status = c->call(&e);
        expect_workspace_empty(&e, c->name);
    } while (pending_again(&p, status));
    ck_assert_msg(status == EBPO_OK, "%s: %s", c->name, error.message);
    finish(&e);
    pending_end(&p);
}
END_TEST

/* --- welding with attributes: complete, or unchanged --- */

static const char split_ply[] =
    "ply\nformat ascii 1.0\nelement vertex 6\nproperty float x\nproperty float y\n"
    "property float z\nproperty uchar red\nproperty list uchar short words\nproperty double q\n"
    "element face 2\nproperty list uchar int vertex_indices\nend_header\n"
    "0 0 0 1 0 1\n1 0 0 2 2 21 22 2\n0 1 0 3 1 31 3\n"
    "1 0 0 4 3 41 42 43 4\n1 1 0 5 2 51 52 5\n0 1 0 6 0 6\n3 0 1 2\n3 3 4 5\n";

static ebpo_mesh read_split(bool arranged, ebpo_workspace *workspace)
{
    ebpo_mesh_read_options options = EBPO_MESH_READ_OPTIONS_INIT;
    ebpo_progress nobody = { NULL, NULL };
    ebpo_mesh mesh;
    options.attributes = 1;
    options.workspace = workspace;
    fine(ebpo_mesh_read(scratch("split.ply"), &options, &mesh, &error));
    if (arranged)
        fine(ebpo_mesh_arrange(&mesh, 1, nobody, &error));
    return mesh;
}

/* Expects rows of the three arrays with these bytes and ends. */
static void expect_rows(const ebpo_mesh *mesh, uint64_t rows, const uint8_t *red,
                        const uint64_t *ends, const int16_t *words)
{
    const ebpo_attribute *a = mesh->attributes->array;
    ck_assert(mesh->vertex_count == rows && mesh->attributes->count == 3);
    for (int i = 0; i < 3; i++)
        ck_assert_uint_eq(a[i].rows, rows);
    ck_assert(memcmp(a[0].values, red, rows) == 0);
    ck_assert(memcmp(a[1].ends, ends, rows * sizeof *ends) == 0);
    ck_assert(memcmp(a[1].values, words, ends[rows - 1] * sizeof *words) == 0);
    for (uint64_t i = 0; i < rows; i++) {
        double q;
        memcpy(&q, a[2].values + i * sizeof q, sizeof q);
        ck_assert_double_eq(q, red[i]);
    }
}

START_TEST(test_failed_weld_changes_nothing)
{
    static const uint64_t ends[] = { 0, 2, 3, 6, 8, 8 }, kept[] = { 0, 2, 3, 5 };
    static const int16_t words[] = { 21, 22, 31, 41, 42, 43, 51, 52 },
                         kept_words[] = { 21, 22, 31, 51, 52 };
    bool arranged = _i % 2, more = true;
    every_call_env e;
    begin(&e, _i / 2);
    fine(ebpo_write_file(scratch("split.ply"), split_ply, sizeof split_ply - 1, &error));
    for (uint64_t n = 1; more; n++) {
        ebpo_mesh mesh = read_split(arranged, e.workspace);
        faults_begin(MEMORY, n, false, ENOMEM);
        ebpo_status status = ebpo_mesh_weld(&mesh, NULL, &error);
        more = faults_end() > 0;
        if (status == EBPO_OK) {
            expect_rows(&mesh, 4, (const uint8_t *)"\1\2\3\5", kept, kept_words);
            ck_assert_ptr_nonnull(ebpo_mesh_attributes_lost(&mesh));
        } else {
            expect_rows(&mesh, 6, (const uint8_t *)"\1\2\3\4\5\6", ends, words);
            ck_assert_ptr_null(ebpo_mesh_attributes_lost(&mesh));
        }
        ebpo_mesh_free(&mesh);
    }
    finish(&e);
}
END_TEST

/* --- a subtree of a surface, without memory for the marks of its nodes --- */

/* Returns the status of a query whose n-th allocation fails. *more: there are more allocations. */
static ebpo_status query_with_failure(const ebpo_file *file, uint64_t n, bool *more)
{
    static const double corner[3] = { 4, 0, 0 };
    ebpo_model_options options = EBPO_MODEL_OPTIONS_INIT;
    ebpo_model *model;
    ebpo_context *context;
    ebpo_inside_result result;
    options.threads = 1;
    options.cut_level = 2;
    options.memory = 8 << 20;
    fine(ebpo_model_new(file, &options, &model, &error));
    fine(ebpo_context_new(model, &context, &error));
    faults_begin(MEMORY, n, false, ENOMEM);
    ebpo_status status = ebpo_inside(context, corner, NULL, &result, &error);
    *more = faults_end() > 0;
    ebpo_context_free(context);
    ebpo_model_free(model);
    return status;
}

START_TEST(test_failed_marks_report_memory)
{
    ebpo_file *file, *surface;
    bool more = true;
    fine(ebpo_open(scratch(EVERY_CALL_SURFACE), &file, &error));
    fine(ebpo_file_add_border(file, scratch("part.ebpo.h5"), NULL, NULL, &error));
    fine(ebpo_open(scratch("part.ebpo.h5"), &surface, &error));
    for (uint64_t n = 1; more; n++) {
        ebpo_status status = query_with_failure(surface, n, &more);
        ck_assert_msg(status == EBPO_OK || status == EBPO_E_MEMORY, "allocation %llu: %s: %s",
                      (unsigned long long)n, ebpo_status_name(status), error.message);
    }
    ebpo_close(surface);
    ebpo_close(file);
}
END_TEST

Suite *test_suite(void)
{
    enum { SECONDS = 600 };
    Suite *suite = suite_create("every_call");
    TCase *all = tcase_create("all"), *failing = tcase_create("failing"),
          *in_part = tcase_create("in_part"), *marks = tcase_create("marks");
    tcase_set_timeout(all, SECONDS);
    tcase_add_unchecked_fixture(all, write_large, remove_all);
    tcase_add_loop_test(all, test_call_releases_workspace, 0, 2 * call_count());
    tcase_add_loop_test(all, test_call_resumes, 0, call_count());
    suite_add_tcase(suite, all);
    tcase_set_timeout(failing, SECONDS);
    tcase_add_unchecked_fixture(failing, write_small, remove_all);
    tcase_add_loop_test(failing, test_call_survives_allocation_failure, 0, 2 * call_count());
    tcase_add_loop_test(failing, test_call_survives_file_failure, 0, call_count());
    tcase_set_timeout(in_part, SECONDS);
    tcase_add_unchecked_fixture(in_part, write_small, remove_all);
    tcase_add_loop_test(in_part, test_call_handles_partial_reads_and_writes, 0, call_count());
    suite_add_tcase(suite, in_part);
    tcase_add_loop_test(failing, test_failed_weld_changes_nothing, 0, 4);
    suite_add_tcase(suite, failing);
    tcase_add_unchecked_fixture(marks, write_small, remove_all);
    tcase_add_test(marks, test_failed_marks_report_memory);
    suite_add_tcase(suite, marks);
    return suite;
}
