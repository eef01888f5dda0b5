/* Compares the faces in the leaves of a view with the lists of the leaves in the whole file. */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include <ebpo/ebpo.h>

#include "check_main.h"
#include "counted_source.h"
#include "model_file.h"
#include "random_tree.h"
#include "scratch.h"
#include "solids.h"

static const char *path;

static void make_folder(void)
{
    scratch_enter();
    path = scratch("x.ebpo.h5");
}

/* --- files --- */

static void write_tree(ebpo_tree *tree, uint64_t subtree_faces)
{
    ebpo_write_options write = EBPO_WRITE_OPTIONS_INIT;
    write.subtree_faces = subtree_faces;
    model_write(tree, path, &write);
}

static void write_solid(ebpo_mesh mesh, uint32_t parts, uint64_t subtree_faces)
{
    ebpo_tree tree = model_build_parts(mesh, 6, parts);
    write_tree(&tree, subtree_faces);
}

/* Writes model i: a solid with floats for even i, and a tree of random nodes for odd i; with
 * subtrees for i >= 2. */
static void write_model(int i)
{
    uint64_t subtree_faces = i < 2 ? EBPO_NO_SUBTREES : 100;
    if (i % 2) {
        random_tree_options options = { 5 + (uint64_t)i, 6, 12, 4, true, i % 4 == 1, true, false };
        ebpo_tree tree;
        random_tree_make(&tree, &options);
        write_tree(&tree, subtree_faces);
        return;
    }
    ebpo_mesh mesh = ebpo_test_torus(2, 0.7, 120, 80);
    ebpo_test_to_float(&mesh);
    write_solid(mesh, EBPO_PART_PLANES | EBPO_PART_MESH | EBPO_PART_MAPS, subtree_faces);
}

static ebpo_view_options viewing(const ebpo_info *info, int priority, ebpo_observer *observer)
{
    ebpo_view_options options = EBPO_VIEW_OPTIONS_INIT;
    *observer = (ebpo_observer)EBPO_OBSERVER_INIT;
    for (int k = 0; k < 3; k++) {
        observer->eye[k] = info->box_origin[k] + 0.1 * (k + 1) * info->box_size[k];
        observer->direction[k] = 1 + 0.1 * k;
    }
    options.priority = (ebpo_priority)priority;
    options.observer = observer;
    options.faces = true;
    return options;
}

/* --- the reference implementation --- */

typedef struct reference {
    ebpo_mesh mesh;
    uint8_t *given;
    uint64_t leaves, repeated, fresh;
} reference;

static void check_corners(const reference *t, const ebpo_view_faces *f)
{
    for (uint64_t i = 0; i < f->face_count; i++)
        for (int k = 0; k < 3; k++) {
            double corner[3];
            ebpo_test_point(&t->mesh, t->mesh.faces[3 * (uint64_t)f->file_faces[i] + (uint64_t)k],
                            corner);
            ck_assert(memcmp(corner, f->corners[i][k], sizeof corner) == 0);
        }
}

/* Checks that the list equals the list in the subtree of this leaf. */
static void check_leaf(reference *t, const ebpo_file *file, uint64_t octcode,
                       const ebpo_view_faces *f)
{
    ebpo_subtree *subtree = NULL;
    ebpo_subtree_faces own = EBPO_SUBTREE_FACES_INIT;
    uint64_t fresh = 0;
    if (t->leaves++ % 97 == 0) {
        ck_assert(ebpo_subtree_open(file, octcode, NULL, &subtree, NULL) == EBPO_OK);
        ck_assert(ebpo_subtree_get_faces(subtree, &own, NULL) == EBPO_OK);
        ck_assert(own.face_count == f->face_count);
        for (uint64_t i = 0; i < own.face_count; i++)
            ck_assert(own.file_faces[i] == f->file_faces[i]);
        ebpo_subtree_close(subtree);
    }
    for (uint64_t i = 0; i < f->face_count; i++) {
        ck_assert(f->file_faces[i] < t->mesh.face_count);
        ck_assert(f->repeated[i] == t->given[f->file_faces[i]]);
        fresh += !f->repeated[i];
        t->given[f->file_faces[i]] = 1;
    }
    ck_assert(fresh == f->new_count);
    t->fresh += fresh;
    t->repeated += f->face_count - fresh;
    check_corners(t, f);
}

/* Reads the stream to its end, or to the end of a budget. */
static ebpo_view_end take_all(ebpo_view_stream *stream, const ebpo_file *whole, reference *t)
{
    ebpo_view_node node;
    ebpo_view_end end;
    for (;;) {
        ebpo_error error = EBPO_ERROR_INIT;
        ebpo_view_faces faces = EBPO_VIEW_FACES_INIT;
        ck_assert_msg(ebpo_view_stream_next(stream, &node, &end, &error) == EBPO_OK, "%s",
                      error.message);
        ck_assert(ebpo_view_stream_get_faces(stream, &faces) == EBPO_OK);
        if (end != EBPO_VIEW_NODE || node.node.type != EBPO_LEAF)
            ck_assert(faces.face_count == 0 && faces.new_count == 0);
        else
            check_leaf(t, whole, node.node.octcode, &faces);
        if (end != EBPO_VIEW_NODE)
            return end;
    }
}

static reference reference_make(ebpo_file **whole)
{
    reference t = { .leaves = 0 };
    ck_assert(ebpo_open(path, whole, NULL) == EBPO_OK);
    ck_assert(ebpo_file_read_mesh(*whole, NULL, &t.mesh, NULL) == EBPO_OK);
    t.given = calloc(t.mesh.face_count, 1);
    return t;
}

static void reference_free(reference *t, ebpo_file *whole)
{
    free(t->given);
    ebpo_mesh_free(&t->mesh);
    ebpo_close(whole);
}

/* --- tests --- */

START_TEST(test_view_faces_are_new_once)
{
    ebpo_file *whole = NULL;
    ebpo_observer observer;
    write_model(_i);
    for (int far = 0; far < 2; far++) {
        counted_source c;
        ebpo_file *file = counted_open(&c, path, far);
        reference t = reference_make(&whole);
        ebpo_view_options options = viewing(ebpo_file_info(file), (_i + far) % 4, &observer);
        ebpo_view_stream *stream = NULL;
        options.memory = far ? 0 : 2 << 20;
        ck_assert(ebpo_view_stream_new(file, &options, &stream, NULL) == EBPO_OK);
        ck_assert_int_eq(take_all(stream, whole, &t), EBPO_VIEW_DONE);
        ck_assert_uint_eq(t.fresh, t.mesh.face_count);
        ck_assert_uint_gt(t.repeated, 0);
        if (far) /* few reads are for a single item */
            ck_assert_msg(c.alone < 16 && c.batches > 0, "%llu reads, %llu batches",
                          (unsigned long long)c.alone, (unsigned long long)c.batches);
        ebpo_view_stream_free(stream);
        counted_close(&c, file);
        reference_free(&t, whole);
    }
}
END_TEST

START_TEST(test_view_faces_count_in_byte_budget)
{
    ebpo_file *whole = NULL;
    ebpo_observer observer;
    write_model(_i);
    counted_source c;
    ebpo_file *file = counted_open(&c, path, _i > 0);
    reference t = reference_make(&whole);
    ebpo_view_options options = viewing(ebpo_file_info(file), _i % 4, &observer);
    ebpo_view_stream *stream = NULL;
    ebpo_view_end end = EBPO_VIEW_BYTES;
    uint64_t stops = 0;
    options.bytes = ebpo_test_file_stats(file).bytes_read;
    ck_assert(ebpo_view_stream_new(file, &options, &stream, NULL) == EBPO_OK);
    while ((end = take_all(stream, whole, &t)) == EBPO_VIEW_BYTES) {
        uint64_t bytes = ebpo_test_file_stats(file).bytes_read;
        ck_assert_msg(bytes <= options.bytes && c.requested <= options.bytes,
                      "%llu read, %llu requested, %llu allowed", (unsigned long long)bytes,
                      (unsigned long long)c.requested, (unsigned long long)options.bytes);
        options.bytes += c.size / 24;
        ck_assert(ebpo_view_stream_change(stream, &options, NULL) == EBPO_OK);
        ck_assert_uint_lt(stops++, 500);
    }
    ck_assert_uint_gt(stops, 4);
    ck_assert_int_eq(end, EBPO_VIEW_DONE);
    ck_assert_uint_eq(t.fresh, t.mesh.face_count);
    ebpo_view_stream_free(stream);
    counted_close(&c, file);
    reference_free(&t, whole);
}
END_TEST

START_TEST(test_view_faces_retry_after_failure)
{
    ebpo_file *whole = NULL;
    ebpo_observer observer;
    write_model(_i & 2);
    counted_source c;
    ebpo_file *file = counted_open(&c, path, _i % 2);
    reference t = reference_make(&whole);
    ebpo_view_options options = viewing(ebpo_file_info(file), 1, &observer);
    ebpo_view_stream *stream = NULL;
    uint64_t state = 5, failed = 0;
    ck_assert(ebpo_view_stream_new(file, &options, &stream, NULL) == EBPO_OK);
    for (;;) {
        ebpo_view_node node;
        ebpo_view_end end;
        ebpo_view_faces faces = EBPO_VIEW_FACES_INIT;
        c.failing = ebpo_test_random(&state) % 2;
        ebpo_status status = ebpo_view_stream_next(stream, &node, &end, NULL);
        c.failing = false;
        failed += status == EBPO_E_IO;
        ck_assert(status == EBPO_OK || status == EBPO_E_IO);
        ck_assert(ebpo_view_stream_get_faces(stream, &faces) == EBPO_OK);
        if (status != EBPO_OK)
            ck_assert(faces.face_count == 0);
        else if (end != EBPO_VIEW_NODE)
            break;
        else if (node.node.type == EBPO_LEAF)
            check_leaf(&t, whole, node.node.octcode, &faces);
    }
    ck_assert_uint_gt(failed, 3);
    ck_assert_uint_eq(t.fresh, t.mesh.face_count);
    ebpo_view_stream_free(stream);
    counted_close(&c, file);
    reference_free(&t, whole);
}
END_TEST

START_TEST(test_view_faces_need_option_and_mesh)
{
    ebpo_file *file = NULL;
    ebpo_error error = EBPO_ERROR_INIT;
    ebpo_view_stream *stream = NULL;
    ebpo_view_options options = EBPO_VIEW_OPTIONS_INIT;
    ebpo_view_node node;
    ebpo_view_end end;
    ebpo_view_faces faces = EBPO_VIEW_FACES_INIT, unsized = { 0 };
    write_solid(ebpo_test_make("torus"), EBPO_PART_PLANES, 0);
    ck_assert(ebpo_open(path, &file, NULL) == EBPO_OK);
    ck_assert(ebpo_view_stream_new(file, &options, &stream, NULL) == EBPO_OK);
    ck_assert(ebpo_view_stream_next(stream, &node, &end, NULL) == EBPO_OK);
    ck_assert_int_eq(ebpo_view_stream_get_faces(stream, &unsized), EBPO_E_ARGUMENT);
    ck_assert_int_eq(ebpo_view_stream_get_faces(stream, &faces), EBPO_OK);
    ck_assert(faces.face_count == 0 && !faces.corners);
    options.faces = true;
    ck_assert_int_eq(ebpo_view_stream_change(stream, &options, NULL), EBPO_E_ARGUMENT);
    ebpo_view_stream_free(stream);
    ck_assert_int_eq(ebpo_view_stream_new(file, &options, &stream, &error), EBPO_E_ABSENT);
    ck_assert_ptr_nonnull(strstr(error.message, "without its mesh"));
    ebpo_close(file);
}
END_TEST

TEST_SUITE(view_faces)
{
    Suite *suite = suite_create("view_faces");
    TCase *tests = tcase_create("view_faces");
    tcase_set_timeout(tests, 600);
    tcase_add_checked_fixture(tests, make_folder, scratch_leave);
    tcase_add_loop_test(tests, test_view_faces_are_new_once, 0, 4);
    tcase_add_loop_test(tests, test_view_faces_count_in_byte_budget, 0, 4);
    tcase_add_loop_test(tests, test_view_faces_retry_after_failure, 0, 4);
    tcase_add_test(tests, test_view_faces_need_option_and_mesh);
    suite_add_tcase(suite, tests);
    return suite;
}
