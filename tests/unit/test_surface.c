/* The part `surface`: patches of a torus and of random surfaces, their errors, joined levels,
 * threads, files, and hostile codes. */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include <ebpo/build.h>
#include <ebpo/lod.h>
#include <ebpo/subset.h>
#include <ebpo/verify.h>

#include "check_main.h"
#include "construct/simplify.h"
#include "format/surface_patches.h"
#include "geometry/distance.h"
#include "scratch.h"
#include "solids.h"

static void must(ebpo_status status, const char *what, const ebpo_error *error)
{
    ck_assert_msg(status == EBPO_OK, "%s: %s", what, error->message);
}

/* A torus with waves, which simplification must not flatten. */
static ebpo_mesh waves(uint32_t around, uint32_t across)
{
    ebpo_mesh mesh = ebpo_test_torus(1, 0.375, around, across);
    for (uint64_t i = 0; i < mesh.vertex_count; i++)
        mesh.xyz64[3 * i + 2] += 0.03 * sin(9 * mesh.xyz64[3 * i]);
    return mesh;
}

static void build(ebpo_tree *tree, ebpo_mesh mesh, unsigned threads)
{
    ebpo_error error = EBPO_ERROR_INIT;
    ebpo_build_options options = EBPO_BUILD_OPTIONS_INIT;
    ebpo_mesh_report report;
    options.threads = threads;
    options.parts |= EBPO_PART_SURFACE;
    must(ebpo_mesh_check(&mesh, 1, (ebpo_progress){ NULL, NULL }, &report, &error), "check",
         &error);
    must(ebpo_build(&mesh, &report, NULL, &options, tree, &error), "build", &error);
}

static void get_triangle(const ebpo_patch *patch, uint64_t i, double out[3][3])
{
    for (uint64_t k = 0; k < 3; k++)
        memcpy(out[k], patch->xyz + 3 * (uint64_t)patch->triangles[3 * i + k], sizeof out[k]);
}

static void get_face(const ebpo_mesh *mesh, uint64_t i, double out[3][3])
{
    for (uint64_t k = 0; k < 3; k++)
        memcpy(out[k], mesh->xyz64 + 3 * (uint64_t)mesh->faces[3 * i + k], sizeof out[k]);
}

/* Returns the distance of a point from a patch or, without a patch, from the faces of one. */
static double distance(const double p[3], const ebpo_patch *patch, const ebpo_mesh *mesh)
{
    double least = INFINITY, t[3][3];
    for (uint64_t i = 0; i < (mesh ? patch->face_count : patch->triangle_count); i++) {
        ebpo_distance_bounds b;
        if (mesh)
            get_face(mesh, patch->first_face + i, t);
        else
            get_triangle(patch, i, t);
        ebpo_triangle_distance_bounds(p, (const double(*)[3])t, &b);
        least = fmin(least, b.lo);
    }
    return least;
}

/* The error holds at random points of both surfaces, and is not far above the greatest distance. */
START_TEST(test_errors_hold)
{
    ebpo_tree tree;
    ebpo_error error = EBPO_ERROR_INIT;
    uint64_t state = 1;
    build(&tree, waves(96, 56), 1);
    ck_assert_uint_gt(tree.surface.patch_count, 1);
    for (uint64_t i = 0; i < tree.surface.patch_count; i++) {
        ebpo_patch patch;
        double most = 0;
        must(ebpo_surface_decode(&tree.surface, &tree.info, i, &patch, &error), "decode", &error);
        for (uint64_t n = 0; n < ebpo_test_scaled(2000); n++) {
            double t[3][3], p[3], a = ebpo_test_random_unit(&state),
                                  b = ebpo_test_random_unit(&state);
            bool of_mesh = n & 1;
            if (of_mesh)
                get_face(&tree.mesh, patch.first_face + (uint64_t)(a * (double)patch.face_count),
                         t);
            else
                get_triangle(&patch, (uint64_t)(a * (double)patch.triangle_count), t);
            a = ebpo_test_random_unit(&state);
            for (int k = 0; k < 3; k++)
                p[k] = t[0][k] + b * (t[1][k] - t[0][k]) + (1 - b) * a * (t[2][k] - t[0][k]);
            most = fmax(most, distance(p, &patch, of_mesh ? NULL : &tree.mesh));
        }
        ck_assert_double_le(most, patch.error);
        ck_assert_double_le(patch.error, 8 * most + 0.01);
        ebpo_patch_free(&patch);
    }
    ebpo_tree_free(&tree);
}
END_TEST

static int by_edge(const void *a, const void *b)
{
    const uint32_t *x = a, *y = b;
    return x[0] != y[0] ? (x[0] > y[0]) - (x[0] < y[0]) : (x[1] > y[1]) - (x[1] < y[1]);
}

/* Returns true if each directed edge has an opposite one. */
static bool is_closed(const ebpo_mesh *mesh)
{
    uint64_t count = 3 * mesh->face_count;
    uint32_t(*edge)[2] = malloc(count * sizeof *edge), (*back)[2] = malloc(count * sizeof *back);
    for (uint64_t i = 0; i < count; i++) {
        edge[i][0] = back[i][1] = mesh->faces[i];
        edge[i][1] = back[i][0] = mesh->faces[i - i % 3 + (i + 1) % 3];
    }
    qsort(edge, count, sizeof *edge, by_edge);
    qsort(back, count, sizeof *back, by_edge);
    bool closed = memcmp(edge, back, count * sizeof *edge) == 0;
    free(edge);
    free(back);
    return closed;
}

static void check_join(const ebpo_tree *tree, const uint64_t *patches, uint64_t count)
{
    ebpo_surface_mesh joined;
    ebpo_error error = EBPO_ERROR_INIT;
    must(ebpo_surface_join(&tree->surface, &tree->info, patches, count, &joined, &error), "join",
         &error);
    ck_assert(is_closed(&joined.mesh));
    ck_assert_double_gt(joined.error, 0);
    ebpo_surface_mesh_free(&joined);
}

/* Each level of a closed mesh is closed, and so is each mixture of levels. */
START_TEST(test_joined_levels_are_closed)
{
    ebpo_tree tree;
    ebpo_error error = EBPO_ERROR_INIT;
    uint64_t state = 2;
    build(&tree, waves(300, 160), 2);
    const uint64_t *rows = tree.surface.patch;
    ck_assert_uint_gt(tree.surface.patch_count, 9);
    for (int level = 0; level < 4; level++) {
        uint64_t *patches, count;
        must(ebpo_surface_select(&tree.surface, level, &patches, &count, &error), "level", &error);
        check_join(&tree, patches, count);
        free(patches);
    }
    for (int round = 0; round < 20; round++) {
        uint64_t count = 0, *chosen = malloc(tree.surface.patch_count * sizeof *chosen);
        bool *open = calloc(tree.surface.patch_count, 1); /* the patch, or those below */
        open[0] = true;
        for (uint64_t i = 0; i < tree.surface.patch_count; i++) {
            bool below = false;
            uint64_t code = rows[EBPO_PATCH_COLUMNS * i + EBPO_PATCH_OCTCODE];
            bool divide = open[i] && ebpo_test_random_unit(&state) < 0.6;
            for (uint64_t k = i + 1; k < tree.surface.patch_count && divide; k++)
                if (rows[EBPO_PATCH_COLUMNS * k + EBPO_PATCH_OCTCODE] >> 3 == code)
                    below = open[k] = true;
            if (open[i] && !below)
                chosen[count++] = i;
        }
        check_join(&tree, chosen, count);
        free(chosen);
        free(open);
    }
    ebpo_tree_free(&tree);
}
END_TEST

/* The rows do not depend on the number of threads, and a file returns them. */
START_TEST(test_files_and_threads)
{
    ebpo_tree one, three, read;
    ebpo_file *file;
    ebpo_error error = EBPO_ERROR_INIT;
    ebpo_surface part;
    build(&one, waves(120, 60), 1);
    build(&three, waves(120, 60), 3);
    const ebpo_surface *a = &one.surface, *b = &three.surface;
    ck_assert_uint_eq(a->patch_count, b->patch_count);
    ck_assert_uint_eq(a->code_bytes, b->code_bytes);
    ck_assert_mem_eq(a->code, b->code, a->code_bytes);
    ck_assert_mem_eq(a->point, b->point, a->vertex_count * 6);
    must(ebpo_tree_write(&one, scratch("surface.ebpo.h5"), NULL, &error), "write", &error);
    must(ebpo_open(scratch("surface.ebpo.h5"), &file, &error), "open", &error);
    must(ebpo_file_read_tree(file, NULL, &read, &error), "read", &error);
    ck_assert_mem_eq(a->patch, read.surface.patch,
                     a->patch_count * EBPO_PATCH_COLUMNS * sizeof *a->patch);
    ck_assert_mem_eq(a->normal, read.surface.normal, a->vertex_count * 2);
    must(ebpo_file_read_surface(file, 1, 1, &part, &error), "level 1", &error);
    uint64_t first = a->patch[EBPO_PATCH_VERTICES];
    ck_assert_mem_eq(part.point, a->point + 3 * first, part.vertex_count * 6);
    ebpo_surface_free(&part);
    ebpo_close(file);
    ebpo_tree_free(&one);
    ebpo_tree_free(&three);
    ebpo_tree_free(&read);
}
END_TEST

/* A mesh with few faces has no patches, and no part. */
START_TEST(test_few_faces_have_none)
{
    ebpo_tree tree;
    build(&tree, waves(40, 20), 1);
    ck_assert_uint_eq(tree.surface.patch_count, 0);
    ck_assert_uint_eq(tree.info.parts & EBPO_PART_SURFACE, 0);
    ebpo_tree_free(&tree);
}
END_TEST

/* Changed codes are refused or decoded to vertices in range. */
START_TEST(test_hostile_codes)
{
    ebpo_tree tree;
    ebpo_error error = EBPO_ERROR_INIT;
    uint64_t state = 3, refused = 0;
    build(&tree, waves(60, 30), 1);
    ebpo_surface *s = &tree.surface;
    for (uint64_t n = 0; n < ebpo_test_scaled(4000); n++) {
        ebpo_patch patch;
        uint64_t at = (uint64_t)(ebpo_test_random_unit(&state) * (double)s->code_bytes);
        uint8_t former = s->code[at];
        s->code[at] = (uint8_t)(256 * ebpo_test_random_unit(&state));
        if (ebpo_surface_decode(s, &tree.info, 0, &patch, &error) == EBPO_OK)
            for (uint64_t i = 0; i < 3 * patch.triangle_count; i++)
                ck_assert_uint_lt(patch.triangles[i], patch.vertex_count);
        else
            refused++;
        ebpo_patch_free(&patch);
        s->code[at] = former;
    }
    ck_assert_uint_gt(refused, 0);
    ebpo_tree_free(&tree);
}
END_TEST

TEST_SUITE(surface)
{
    Suite *suite = suite_create("surface");
    TCase *tests = tcase_create("surface");
    tcase_set_timeout(tests, 120);
    tcase_add_checked_fixture(tests, scratch_enter, scratch_leave);
    tcase_add_test(tests, test_errors_hold);
    tcase_add_test(tests, test_joined_levels_are_closed);
    tcase_add_test(tests, test_files_and_threads);
    tcase_add_test(tests, test_few_faces_have_none);
    tcase_add_test(tests, test_hostile_codes);
    suite_add_tcase(suite, tests);
    return suite;
}
