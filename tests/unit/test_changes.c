/* Tests files that other programs change while they are read. The result is an error that reports
 * the change, or the data of one version. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

#include <ebpo/build.h>
#include <ebpo/file.h>
#include <ebpo/mesh.h>

#include "check_main.h"
#include "scratch.h"
#include "solids.h"

static const char *path, *other;

static void enter(void)
{
    scratch_enter();
    path = scratch("model");
    other = scratch("other");
}

/* --- meshes --- */

enum { VERTICES = 20000 }; /* vertices of a fan around an axis: 240 kB and more */

static void write_obj(const char *name, double height)
{
    FILE *f = fopen(name, "wb");
    ck_assert_ptr_nonnull(f);
    for (int i = 0; i < VERTICES; i++)
        fprintf(f, "v %d %.6f %d\n", i, height, i % 7);
    for (int i = 3; i <= VERTICES; i++)
        fprintf(f, "f 1 %d %d\n", i - 1, i);
    ck_assert_int_eq(fclose(f), 0);
}

static void write_ply(const char *name, double height)
{
    FILE *f = fopen(name, "wb");
    ck_assert_ptr_nonnull(f);
    fprintf(f,
            "ply\nformat binary_little_endian 1.0\nelement vertex %d\nproperty float x\n"
            "property float y\nproperty float z\nelement face %d\n"
            "property list uchar int vertex_indices\nend_header\n",
            VERTICES, VERTICES - 2);
    for (int i = 0; i < VERTICES; i++)
        fwrite((float[3]){ (float)i, (float)height, (float)(i % 7) }, sizeof(float), 3, f);
    for (int i = 2; i < VERTICES; i++) {
        fputc(3, f);
        fwrite((int32_t[3]){ 0, i - 1, i }, sizeof(int32_t), 3, f);
    }
    ck_assert_int_eq(fclose(f), 0);
}

static void write_mesh(const char *name, double height, bool ply)
{
    (ply ? write_ply : write_obj)(name, height);
}

typedef enum change { SHORTENED, EMPTIED, LONGER, REWRITTEN, REPLACED, CHANGES } change;

/* Changes by another program at the `when`-th step of reading. */
typedef struct scheduled_change {
    change what;
    int when, step;
    bool ply, done;
} scheduled_change;

static void change_file(scheduled_change *m)
{
    struct stat st;
    m->done = true;
    ck_assert_int_eq(stat(path, &st), 0);
    if (m->what == SHORTENED)
        ck_assert_int_eq(truncate(path, st.st_size / 3), 0);
    else if (m->what == EMPTIED)
        ck_assert_int_eq(truncate(path, 0), 0);
    else if (m->what == LONGER)
        ck_assert_int_eq(truncate(path, st.st_size + 1), 0);
    else
        write_mesh(m->what == REWRITTEN ? path : other, 2, m->ply);
    if (m->what == REPLACED)
        ck_assert_int_eq(rename(other, path), 0);
}

static bool report(void *user, const char *stage, uint64_t done, uint64_t total)
{
    scheduled_change *m = user;
    (void)stage;
    (void)done;
    (void)total;
    if (m->step++ == m->when)
        change_file(m);
    return true;
}

static ebpo_status read_changed(scheduled_change *m, ebpo_mesh *mesh, ebpo_error *error)
{
    ebpo_mesh_read_options options = EBPO_MESH_READ_OPTIONS_INIT;
    write_mesh(path, 1, m->ply);
    options.threads = 2;
    options.progress = (ebpo_progress){ report, m };
    return ebpo_mesh_read(path, &options, mesh, error);
}

/* Expects the complete version that was opened. */
static void expect_old(const ebpo_mesh *mesh)
{
    ck_assert_uint_eq(mesh->face_count, VERTICES - 2);
    for (uint64_t i = 0; i < mesh->vertex_count; i++)
        ck_assert(mesh->xyz32 ? mesh->xyz32[3 * i + 1] == 1 : mesh->xyz64[3 * i + 1] == 1);
}

static void expect_reported(const scheduled_change *m, ebpo_status status, const char *message)
{
    bool reported = strstr(message, "while it was read") != NULL;
    ck_assert_msg(status == EBPO_E_IO && reported, "change %d at step %d: %s", m->what, m->when,
                  message);
}

START_TEST(test_mesh_changed_while_reading_is_reported)
{
    for (int ply = 0; ply < 2; ply++)
        for (change what = 0; what < CHANGES; what++)
            for (int when = 0; when < 4; when++) {
                scheduled_change m = { .what = what, .when = when, .ply = ply };
                ebpo_mesh mesh;
                ebpo_error error = EBPO_ERROR_INIT;
                ebpo_status status = read_changed(&m, &mesh, &error);
                if (status != EBPO_OK)
                    expect_reported(&m, status, error.message);
                else
                    expect_old(&mesh);
                ck_assert_int_eq(status == EBPO_OK, !m.done || what == REPLACED);
                ebpo_mesh_free(&mesh);
                ck_assert(when > 0 || m.done);
            }
    unlink(path);
}
END_TEST

/* --- files --- */

static void make_file(const char *name, double size)
{
    ebpo_error error = EBPO_ERROR_INIT;
    ebpo_mesh mesh = ebpo_test_make("sphere");
    ebpo_mesh_report found;
    ebpo_tree tree;
    for (uint64_t i = 0; i < 3 * mesh.vertex_count; i++)
        if (mesh.xyz32)
            mesh.xyz32[i] *= (float)size;
        else
            mesh.xyz64[i] *= size;
    ck_assert_int_eq(ebpo_mesh_check(&mesh, 1, (ebpo_progress){ 0 }, &found, &error), EBPO_OK);
    ebpo_repair_record repair_record = { 0 };
    ck_assert_int_eq(ebpo_build(&mesh, &found, &repair_record, NULL, &tree, &error), EBPO_OK);
    ck_assert_msg(ebpo_tree_write(&tree, name, NULL, &error) == EBPO_OK, "%s", error.message);
    ebpo_tree_free(&tree);
}

static void copy_into(const char *from, const char *to)
{
    static char bytes[1 << 20];
    FILE *in = fopen(from, "rb"), *out = fopen(to, "r+b");
    ck_assert(in && out);
    size_t size = fread(bytes, 1, sizeof bytes, in);
    ck_assert(size > 0 && size < sizeof bytes && fwrite(bytes, 1, size, out) == size);
    ck_assert(fclose(in) == 0 && fclose(out) == 0 && truncate(to, (off_t)size) == 0);
}

static double first_x(const ebpo_mesh *mesh)
{
    return mesh->xyz32 ? (double)mesh->xyz32[0] : mesh->xyz64[0];
}

/* Opens a file; then another version replaces or overwrites the file. */
static ebpo_status read_after(bool renamed, double *expected, double *x, ebpo_error *error)
{
    ebpo_file *file;
    ebpo_mesh mesh, before;
    make_file(path, 1);
    make_file(other, 1.25);
    ck_assert_int_eq(ebpo_open(path, &file, error), EBPO_OK);
    ck_assert_int_eq(ebpo_file_read_mesh(file, NULL, &before, error), EBPO_OK);
    *expected = first_x(&before);
    if (renamed)
        ck_assert_int_eq(rename(other, path), 0);
    else
        copy_into(other, path);
    ebpo_status status = ebpo_file_read_mesh(file, NULL, &mesh, error);
    *x = status == EBPO_OK ? first_x(&mesh) : NAN;
    ebpo_mesh_free(&before);
    ebpo_mesh_free(&mesh);
    ebpo_close(file);
    unlink(path);
    unlink(other);
    return status;
}

START_TEST(test_replaced_file_keeps_old_content)
{
    double expected, x;
    ebpo_error error = EBPO_ERROR_INIT;
    ck_assert_msg(read_after(true, &expected, &x, &error) == EBPO_OK, "%s", error.message);
    ck_assert(x == expected);
}
END_TEST

START_TEST(test_file_overwritten_in_place_is_detected)
{
    double expected, x;
    ebpo_error error = EBPO_ERROR_INIT;
    ck_assert_int_eq(read_after(false, &expected, &x, &error), EBPO_E_FORMAT);
    ck_assert_msg(strstr(error.message, "model") != NULL, "%s", error.message);
}
END_TEST

TEST_SUITE(changes)
{
    Suite *suite = suite_create("changes");
    TCase *tests = tcase_create("changes");
    tcase_add_checked_fixture(tests, enter, scratch_leave);
    tcase_set_timeout(tests, 120);
    tcase_add_test(tests, test_mesh_changed_while_reading_is_reported);
    tcase_add_test(tests, test_replaced_file_keeps_old_content);
    tcase_add_test(tests, test_file_overwritten_in_place_is_detected);
    suite_add_tcase(suite, tests);
    return suite;
}
