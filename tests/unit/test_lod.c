/* Tests levels as polygons. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include <ebpo/ebpo.h>

#include "check_main.h"
#include "model_file.h"
#include "scratch.h"
#include "solids.h"

static const char *path;

static void make_folder(void)
{
    scratch_enter();
    path = scratch("x.ebpo.h5");
}

static ebpo_file *build(ebpo_mesh mesh, uint32_t parts, uint32_t leaf_faces)
{
    ebpo_tree tree = model_build_parts(mesh, leaf_faces, parts);
    model_write(&tree, path, NULL);
    return model_open(path);
}

enum { DEFAULT = EBPO_PART_PLANES | EBPO_PART_MESH | EBPO_PART_MAPS };

static double stored_volume(const ebpo_info *info, int level)
{
    double cell = info->box_size[0] * info->box_size[1] * info->box_size[2],
           sum = info->level[level].gray_volume;
    for (int i = 0; i <= level; i++)
        sum +=
            info->level[i].leaf_volume + (double)info->level[i].black_count * ldexp(cell, -3 * i);
    return sum;
}

static double take(ebpo_file *file, int level, bool cell_faces, unsigned threads, ebpo_mesh *out)
{
    ebpo_error error = EBPO_ERROR_INIT;
    ebpo_lod_options options = EBPO_LOD_OPTIONS_INIT;
    double volume = -1;
    options.cell_faces = cell_faces;
    options.threads = threads;
    ck_assert_msg(ebpo_lod_level(file, level, &options, out, &volume, &error) == EBPO_OK, "%s",
                  error.message);
    return volume;
}

/* Returns the signed volume of a closed mesh. */
static double mesh_volume(const ebpo_mesh *mesh)
{
    double sum = 0;
    for (uint64_t f = 0; f < mesh->face_count; f++) {
        const double *a = mesh->xyz64 + 3 * (uint64_t)mesh->faces[3 * f],
                     *b = mesh->xyz64 + 3 * (uint64_t)mesh->faces[3 * f + 1],
                     *c = mesh->xyz64 + 3 * (uint64_t)mesh->faces[3 * f + 2];
        sum += a[0] * (b[1] * c[2] - b[2] * c[1]) + a[1] * (b[2] * c[0] - b[0] * c[2]) +
               a[2] * (b[0] * c[1] - b[1] * c[0]);
    }
    return sum / 6;
}

static double largest_volume(const ebpo_info *info)
{
    return info->box_size[0] * info->box_size[1] * info->box_size[2];
}

/* The volumes of leaves in the file are computed by stored or inherited planes. Derived planes cut
 * off more. */
START_TEST(test_lod_volumes_match_stored_volumes)
{
    if (!ebpo_test_wanted(_i))
        return;
    for (int variant = 0; variant < 2; variant++) {
        ebpo_file *file = build(ebpo_test_solids[_i].make(),
                                variant ? DEFAULT | EBPO_PART_LEAF_PLANES : DEFAULT, 4);
        const ebpo_info *info = ebpo_file_info(file);
        for (int level = 0; level < info->level_count; level++) {
            double volume = take(file, level, true, 0, NULL), stored = stored_volume(info, level);
            double less = variant ? 0 : fmax(0, stored - volume);
            ck_assert_msg(fabs(volume + less - stored) <=
                              1e-6 * stored + 1e-12 * largest_volume(info),
                          "%s level %d: %.17g, stored %.17g", ebpo_test_solids[_i].name, level,
                          volume, stored);
        }
        ebpo_close(file);
    }
}
END_TEST

START_TEST(test_lod_volumes_of_real_model)
{
    const char *models = getenv("EBPO_MODELS");
    ebpo_mesh mesh;
    char name[4096];
    snprintf(name, sizeof name, "%s/%s.ply", models ? models : "",
             ebpo_test_scale() < 1 ? "bunny_closed" : "armadillo");
    if (!models || ebpo_mesh_read(name, NULL, &mesh, NULL) != EBPO_OK)
        return;
    ebpo_file *file = build(mesh, DEFAULT | EBPO_PART_LEAF_PLANES, 16);
    const ebpo_info *info = ebpo_file_info(file);
    for (int level = 0; level < info->level_count; level++) {
        double volume = take(file, level, true, 0, NULL), stored = stored_volume(info, level);
        ck_assert_msg(fabs(volume - stored) <= 1e-7 * stored, "level %d: %.17g, stored %.17g",
                      level, volume, stored);
    }
    ebpo_close(file);
}
END_TEST

START_TEST(test_lod_envelopes_are_closed)
{
    if (!ebpo_test_wanted(_i))
        return;
    ebpo_file *file = build(ebpo_test_solids[_i].make(), DEFAULT, 4);
    const ebpo_info *info = ebpo_file_info(file);
    for (int level = 0; level < info->level_count; level++) {
        ebpo_mesh mesh;
        ebpo_mesh_report report;
        double volume = take(file, level, true, 0, &mesh);
        ck_assert_uint_gt(mesh.face_count, 0);
        ck_assert(ebpo_mesh_check(&mesh, 0, (ebpo_progress){ NULL, NULL }, &report, NULL) ==
                  EBPO_OK);
        ck_assert_msg(report.balanced && report.unreferenced_vertices.count == 0, "%s level %d",
                      ebpo_test_solids[_i].name, level);
        double own = mesh_volume(&mesh), offset = 1e-9 * largest_volume(info);
        for (int k = 0; k < 3; k++) /* far from the origin, rounding affects the sum */
            offset *= 1 + fabs(info->box_origin[k]) / info->box_size[k];
        ck_assert_msg(fabs(own - volume) <= 1e-7 * volume + offset, "%s level %d: %.17g, %.17g",
                      ebpo_test_solids[_i].name, level, own, volume);
        ebpo_mesh_free(&mesh);
    }
    ebpo_close(file);
}
END_TEST

START_TEST(test_lod_volume_decreases_with_level)
{
    if (!ebpo_test_wanted(_i))
        return;
    ebpo_file *file = build(ebpo_test_solids[_i].make(), DEFAULT, 0);
    double before = INFINITY;
    for (int level = 0; level < ebpo_file_info(file)->level_count; level++) {
        double volume = take(file, level, true, 0, NULL);
        ck_assert_msg(volume <= before * (1 + 1e-9), "%s level %d", ebpo_test_solids[_i].name,
                      level);
        before = volume;
    }
    ebpo_close(file);
}
END_TEST

static bool same_mesh(const ebpo_mesh *a, const ebpo_mesh *b)
{
    return a->vertex_count == b->vertex_count && a->face_count == b->face_count &&
           memcmp(a->xyz64, b->xyz64, a->vertex_count * 24) == 0 &&
           memcmp(a->faces, b->faces, a->face_count * 12) == 0;
}

START_TEST(test_lod_same_for_any_threads)
{
    ebpo_file *file = build(ebpo_test_torus(2, 0.7, 60, 40), DEFAULT, 2);
    int last = ebpo_file_info(file)->level_count - 1;
    ck_assert_int_ge(last, 4);
    for (int level = 0; level <= last; level++) {
        ebpo_mesh one, seven;
        double a = take(file, level, true, 1, &one), b = take(file, level, true, 7, &seven);
        ck_assert(memcmp(&a, &b, sizeof a) == 0 && same_mesh(&one, &seven));
        ebpo_mesh_free(&one);
        ebpo_mesh_free(&seven);
    }
    ebpo_close(file);
}
END_TEST

/* Returns true when all three corners are in one cell face of `level`. */
static bool on_cell_face(const ebpo_info *info, const ebpo_mesh *mesh, uint64_t face, int level)
{
    for (int k = 0; k < 3; k++) {
        const double *x = mesh->xyz64 + k;
        const uint32_t *f = mesh->faces + 3 * face;
        double a = x[3 * (uint64_t)f[0]],
               at = (a - info->box_origin[k]) / info->box_size[k] * ldexp(1, level);
        if (a == x[3 * (uint64_t)f[1]] && a == x[3 * (uint64_t)f[2]] && at == round(at))
            return true;
    }
    return false;
}

START_TEST(test_cell_faces_are_omitted)
{
    ebpo_file *file = build(ebpo_test_make("sphere"), DEFAULT, 4);
    const ebpo_info *info = ebpo_file_info(file);
    for (int level = 0; level < info->level_count; level++) {
        ebpo_mesh with, without;
        double a = take(file, level, true, 0, &with), b = take(file, level, false, 0, &without);
        uint64_t cell_faces = 0;
        for (uint64_t f = 0; f < with.face_count; f++)
            cell_faces += on_cell_face(info, &with, f, level);
        ck_assert(a == b);
        ck_assert_uint_eq(with.face_count, without.face_count + cell_faces);
        for (uint64_t f = 0; f < without.face_count; f++)
            ck_assert(!on_cell_face(info, &without, f, level));
        ebpo_mesh_free(&with);
        ebpo_mesh_free(&without);
    }
    ebpo_close(file);
}
END_TEST

START_TEST(test_lod_envelopes_are_in_octcode_order)
{
    /* Without planes and mesh each envelope is its cell: twelve triangles, whose middle identifies
     * the cell. */
    ebpo_file *file = build(ebpo_test_make("blob"), 0, 4);
    const ebpo_info *info = ebpo_file_info(file);
    ebpo_mesh mesh;
    take(file, info->level_count - 1, true, 0, &mesh);
    ck_assert_uint_eq(mesh.vertex_count % 8, 0);
    uint64_t before = 0;
    for (uint64_t i = 0; i < mesh.vertex_count; i += 8) {
        double low[3] = { INFINITY, INFINITY, INFINITY }, high = -INFINITY;
        for (uint64_t v = i; v < i + 8; v++) {
            for (uint64_t k = 0; k < 3; k++)
                low[k] = fmin(low[k], mesh.xyz64[3 * v + k]);
            high = fmax(high, mesh.xyz64[3 * v]);
        }
        int level = (int)lround(log2(info->box_size[0] / (high - low[0])));
        uint64_t code = 1;
        for (int bit = level - 1; bit >= 0; bit--)
            for (int k = 2; k >= 0; k--) {
                uint64_t at = (uint64_t)llround((low[k] - info->box_origin[k]) / info->box_size[k] *
                                                ldexp(1, level));
                code = code << 1 | (at >> bit & 1);
            }
        ck_assert_uint_gt(code, before);
        before = code;
    }
    ebpo_mesh_free(&mesh);
    ebpo_close(file);
}
END_TEST

START_TEST(test_lod_leaves_without_faces_inherit_planes)
{
    ebpo_file *file = build(ebpo_test_make("torus"), EBPO_PART_PLANES, 4);
    int last = ebpo_file_info(file)->level_count - 1;
    double bare = take(file, last, true, 0, NULL);
    ck_assert_double_eq_tol(bare, stored_volume(ebpo_file_info(file), last), 1e-6 * bare);
    ck_assert(bare <= take(file, last - 1, true, 0, NULL) * (1 + 1e-9));
    ebpo_close(file);
    ebpo_file *full = build(ebpo_test_make("torus"), DEFAULT, 4);
    ck_assert(bare > take(full, last, true, 0, NULL));
    ebpo_close(full);
}
END_TEST

/* The hull of a convex solid in a cell is the solid there, so the sum over any level's cells is the
 * volume of the solid. */
START_TEST(test_limit_of_convex_solid_is_its_volume)
{
    static const double low[3] = { 0, 0, 0 }, high[3] = { 3, 2, 1 };
    ebpo_mesh mesh = _i ? ebpo_test_sphere(low, 1, 2) : ebpo_test_box(low, high, 4);
    double right = mesh_volume(&mesh);
    ebpo_error error = EBPO_ERROR_INIT;
    ebpo_limit limit = EBPO_LIMIT_INIT;
    ebpo_file *file = build(mesh, DEFAULT, 4);
    for (int level = 0; level < ebpo_file_info(file)->level_count; level++) {
        ebpo_status status = ebpo_limit_level(file, level, NULL, &limit, &error);
        if (status == EBPO_E_ABSENT) /* without qhull */
            break;
        ck_assert_msg(status == EBPO_OK, "%s", error.message);
        ck_assert_msg(fabs(limit.volume - right) <= 1e-6 * right, "level %d: %.17g, not %.17g",
                      level, limit.volume, right);
        ck_assert(limit.hulls > 0 && limit.gray_volume <= limit.volume);
    }
    ebpo_close(file);
}
END_TEST

START_TEST(test_lod_missing_level_is_refused)
{
    ebpo_file *file = build(ebpo_test_make("cube"), DEFAULT, 4);
    ebpo_error error = EBPO_ERROR_INIT;
    ebpo_mesh mesh;
    int count = ebpo_file_info(file)->level_count;
    ck_assert_int_eq(ebpo_lod_level(file, count, NULL, &mesh, NULL, &error), EBPO_E_ARGUMENT);
    ck_assert_ptr_nonnull(strstr(error.message, "this file has levels 0 to"));
    ck_assert_int_eq(ebpo_lod_level(file, -1, NULL, &mesh, NULL, NULL), EBPO_E_ARGUMENT);
    ck_assert_ptr_null(mesh.xyz64);
    ebpo_close(file);
}
END_TEST

static bool stop_at_once(void *user, const char *stage, uint64_t done, uint64_t total)
{
    (void)stage;
    (void)done;
    (void)total;
    return *(bool *)user;
}

START_TEST(test_lod_cancel_leaves_nothing)
{
    const uint32_t around = ebpo_test_scale() < 1 ? 120 : 300;
    ebpo_file *file = build(ebpo_test_torus(2, 0.7, around, around / 2), DEFAULT, 0);
    bool go_on = false;
    ebpo_lod_options options = EBPO_LOD_OPTIONS_INIT;
    options.threads = 1;
    options.progress = (ebpo_progress){ stop_at_once, &go_on };
    ebpo_mesh mesh;
    ebpo_status status =
        ebpo_lod_level(file, ebpo_file_info(file)->level_count - 1, &options, &mesh, NULL, NULL);
    /* The call may also finish before the first report. */
    ck_assert(status == EBPO_E_CANCELLED || status == EBPO_OK);
    ck_assert(status == EBPO_OK || mesh.xyz64 == NULL);
    ebpo_mesh_free(&mesh);
    ebpo_close(file);
}
END_TEST

TEST_SUITE(lod)
{
    Suite *suite = suite_create("lod");
    TCase *cases = tcase_create("lod");
    tcase_set_timeout(cases, 120);
    tcase_add_checked_fixture(cases, make_folder, scratch_leave);
    tcase_add_loop_test(cases, test_lod_volumes_match_stored_volumes, 0, ebpo_test_solid_count);
    tcase_add_loop_test(cases, test_lod_envelopes_are_closed, 0, ebpo_test_solid_count);
    tcase_add_loop_test(cases, test_lod_volume_decreases_with_level, 0, ebpo_test_solid_count);
    tcase_add_test(cases, test_lod_volumes_of_real_model);
    tcase_add_test(cases, test_lod_same_for_any_threads);
    tcase_add_test(cases, test_cell_faces_are_omitted);
    tcase_add_test(cases, test_lod_envelopes_are_in_octcode_order);
    tcase_add_test(cases, test_lod_leaves_without_faces_inherit_planes);
    tcase_add_loop_test(cases, test_limit_of_convex_solid_is_its_volume, 0, 2);
    tcase_add_test(cases, test_lod_missing_level_is_refused);
    tcase_add_test(cases, test_lod_cancel_leaves_nothing);
    suite_add_tcase(suite, cases);
    return suite;
}
