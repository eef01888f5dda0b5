/* The part `surface`: patches of a torus and of random surfaces, their errors, joined levels,
 * threads, files, and hostile codes. */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include <ebpo/build.h>
#include <ebpo/lod.h>
#include <ebpo/subset.h>
#include <ebpo/verify.h>
#include <ebpo/view.h>

#include "check_main.h"
#include "construct/surface_cover.h"
#include "format/chunk_directory.h"
#include "format/surface_patches.h"
#include "geometry/vec3.h"
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

/* A torus with waves and a long horn, so that most of it is in one octant of its box, and its
 * patches have more levels. */
static ebpo_mesh horned(uint32_t around, uint32_t across)
{
    static const double at[3] = { 0.97, 0.97, 0 }, horn[3] = { 2.1, 2.7, 2 };
    ebpo_mesh mesh = waves(around, across);
    for (uint64_t v = 0; v < mesh.vertex_count; v++) {
        double *p = mesh.xyz64 + 3 * v, square = 0;
        for (int k = 0; k < 3; k++)
            square += (p[k] - at[k]) * (p[k] - at[k]);
        for (int k = 0; k < 3; k++)
            p[k] += horn[k] * exp(-12 * square);
    }
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
    build(&tree, waves(182, 92), 1);
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

/* Makes long random triangles that overlap. Their corners are in a unit cube. */
static ebpo_patch_mesh overlapping(uint64_t count, uint64_t *state)
{
    ebpo_patch_mesh mesh = { .vertex_count = 3 * count, .triangle_count = count };
    mesh.vertex = calloc(3 * count, sizeof *mesh.vertex);
    mesh.triangle = malloc(3 * count * sizeof *mesh.triangle);
    for (uint32_t v = 0; v < 3 * count; v++) {
        mesh.triangle[v] = v;
        for (int k = 0; k < 3; k++)
            mesh.vertex[v].at[k] = ebpo_test_random_unit(state);
    }
    return mesh;
}

/* Checks that the bound of the distance from `a` to `b` holds at random points of `a`, and that it
 * is at most `times` the greatest distance of these points. */
static void check_bound(const ebpo_patch_mesh *a, const ebpo_patch_mesh *b, uint64_t points,
                        double times, uint64_t *state)
{
    ebpo_error error = EBPO_ERROR_INIT;
    double bound, most = 0;
    must(ebpo_bound_distance(a, b, 1e-6, 0, &bound, &error), "bound", &error);
    for (uint64_t i = 0; i < points; i++) {
        double p[3], least = INFINITY, u = ebpo_test_random_unit(state),
                     v = (1 - u) * ebpo_test_random_unit(state);
        const uint32_t *t = a->triangle + 3 * (i % a->triangle_count);
        const double *q[3] = { a->vertex[t[0]].at, a->vertex[t[1]].at, a->vertex[t[2]].at };
        for (int k = 0; k < 3; k++)
            p[k] = q[0][k] + u * (q[1][k] - q[0][k]) + v * (q[2][k] - q[0][k]);
        for (uint64_t n = 0; n < b->triangle_count; n++) {
            ebpo_distance_bounds d;
            double corner[3][3];
            for (uint64_t k = 0; k < 3; k++)
                memcpy(corner[k], b->vertex[b->triangle[3 * n + k]].at, sizeof corner[k]);
            ebpo_triangle_distance_bounds(p, (const double(*)[3])corner, &d);
            least = fmin(least, d.lo);
        }
        most = fmax(most, least);
    }
    ck_assert_double_le(most, bound);
    ck_assert_double_le(bound, times * most + 1e-6);
}

/* The bound is an upper bound, and is close to the greatest distance of a point. */
START_TEST(test_bound_of_overlapping_triangles)
{
    uint64_t state = 5;
    ebpo_patch_mesh a = overlapping(300, &state), b = overlapping(300, &state);
    check_bound(&a, &b, 4000, 1.05, &state);
    ebpo_patch_mesh_free(&a);
    ebpo_patch_mesh_free(&b);
}
END_TEST

/* Makes a square of n x n x 2 triangles with random heights. Omits each triangle with probability
 * `missing`, and adds triangles with the same corners, as many on average. */
static ebpo_patch_mesh sheet(uint32_t n, double height, double missing, uint64_t *state)
{
    ebpo_patch_mesh mesh = { .vertex_count = (n + 1) * (n + 1) };
    mesh.vertex = calloc(mesh.vertex_count, sizeof *mesh.vertex);
    mesh.triangle = malloc((uint64_t)n * n * 2 * 6 * sizeof *mesh.triangle);
    for (uint32_t v = 0; v < mesh.vertex_count; v++) {
        double *at = mesh.vertex[v].at, u = ebpo_test_random_unit(state);
        at[0] = (v % (n + 1) + 0.3 * ebpo_test_random_unit(state)) / n;
        at[1] = (v / (n + 1) + 0.3 * u) / n;
        at[2] = height * ebpo_test_random_unit(state);
    }
    for (uint32_t i = 0; i < 2 * n * n; i++) {
        uint32_t v = i / 2 % n + i / 2 / n * (n + 1), other = v + (i % 2 ? n + 1 : 1);
        uint32_t t[3] = { v, i % 2 ? v + n + 2 : other, i % 2 ? other : v + n + 2 };
        for (int copies = 0; copies < 2; copies++)
            if ((ebpo_test_random_unit(state) < missing) == (copies == 1))
                memcpy(mesh.triangle + 3 * mesh.triangle_count++, t, sizeof t);
    }
    return mesh;
}

/* Sheets with holes, double triangles and borders: bounds by triangles that cover a triangle. */
START_TEST(test_bound_of_sheets)
{
    uint64_t state = 7;
    for (int round = 0; round < 40; round++) {
        double height = ldexp(0.5, -round % 8), missing = round % 3 * 0.02;
        uint32_t n = 3 + (uint32_t)(8 * ebpo_test_random_unit(&state)),
                 m = 3 + (uint32_t)(8 * ebpo_test_random_unit(&state));
        ebpo_patch_mesh a = sheet(n, height, 0, &state), b = sheet(m, height, missing, &state);
        check_bound(&a, &b, 400, 4, &state);
        ebpo_patch_mesh_free(&a);
        ebpo_patch_mesh_free(&b);
    }
}
END_TEST

/* Returns ebpo_cover_bound of the triangle (0, 0, 0), (1, 0, 0), (0, 1, 0), for a surface of one or
 * two triangles with the corners 0, 1, 2 and 0, 2, 3. */
static double bound_of_half_square(const double corner[4][3], uint64_t triangles)
{
    static const double p[3][3] = { { 0, 0, 0 }, { 1, 0, 0 }, { 0, 1, 0 } };
    static const uint64_t guess[EBPO_COVER_GUESSES] = { UINT64_MAX, UINT64_MAX, UINT64_MAX, 0 };
    uint32_t index[6] = { 0, 1, 2, 0, 2, 3 };
    ebpo_patch_vertex vertex[4] = { 0 };
    ebpo_patch_mesh surface = {
        .vertex_count = 4, .triangle_count = triangles, .vertex = vertex, .triangle = index
    };
    ebpo_cover cover;
    uint64_t near = UINT64_MAX;
    double far[3];
    for (int k = 0; k < 4; k++)
        memcpy(vertex[k].at, corner[k], sizeof corner[k]);
    ck_assert(ebpo_cover_make(&cover, &surface));
    double bound = ebpo_cover_bound(&cover, p, guess, 0, &near, far);
    ck_assert(bound == INFINITY || near < triangles);
    ebpo_cover_free(&cover);
    return bound;
}

/* Surfaces that cover a triangle, in part or not at all. */
START_TEST(test_covers)
{
    const double above[4]
                      [3] = { { -1, -1, 0.25 }, { 2, -1, 0.25 }, { 2, 2, 0.25 }, { -1, 2, 0.25 } },
              slanted[4][3] = { { -1, -1, 0.5 }, { 3, -1, 0.5 }, { 3, 3, 0.5 }, { -1, 3, -1.5 } },
              narrow[4][3] = { { -1, -1, 0 }, { 1.5, -0.75, 0 }, { -0.75, 1.5, 0 }, { -1, 1, 0 } },
              beside[4][3] = { { 0.9, -0.1, 0 }, { 1.2, -1, 0 }, { 1.5, 0.2, 0 }, { 2, 2, 0 } },
              small[4][3] = { { 0.3, 0.3, 0 }, { 0.4, 0.3, 0 }, { 0.4, 0.4, 0 }, { 0.3, 0.4, 0 } };
    ck_assert_double_eq_tol(bound_of_half_square(above, 2), 0.25, 1e-9);
    /* the triangle 0, 2, 3 has the least height over (0, 1), and the triangle 0, 1, 2 has 0.5 */
    ck_assert_double_eq_tol(bound_of_half_square(slanted, 2), 0.5, 1e-9);
    /* the side x + y = 1 is beyond the border of the surface, at x + y = 0.75 */
    ck_assert_double_eq_tol(bound_of_half_square(narrow, 2), 0.25 * sqrt(0.5), 1e-9);
    ck_assert(bound_of_half_square(above, 1) >= 0.25); /* half is missing */
    ck_assert(bound_of_half_square(beside, 1) == INFINITY);
    ck_assert(bound_of_half_square(small, 2) == INFINITY);
}
END_TEST

static int by_edge(const void *a, const void *b)
{
    const uint32_t *x = a, *y = b;
    return x[0] != y[0] ? (x[0] > y[0]) - (x[0] < y[0]) : (x[1] > y[1]) - (x[1] < y[1]);
}

static const double *sorted_points;

static int by_point(const void *a, const void *b)
{
    const double *p = sorted_points + 3 * (uint64_t) * (const uint32_t *)a,
                 *q = sorted_points + 3 * (uint64_t) * (const uint32_t *)b;
    for (int k = 0; k < 3; k++)
        if (p[k] != q[k])
            return p[k] < q[k] ? -1 : 1;
    return 0;
}

/* Gives vertices at equal points the same index. */
static void weld(ebpo_mesh *mesh)
{
    uint32_t *order = malloc(mesh->vertex_count * sizeof *order),
             *number = malloc(mesh->vertex_count * sizeof *number);
    for (uint32_t v = 0; v < mesh->vertex_count; v++)
        order[v] = v;
    sorted_points = mesh->xyz64;
    qsort(order, mesh->vertex_count, sizeof *order, by_point);
    for (uint64_t i = 0; i < mesh->vertex_count; i++)
        number[order[i]] =
            i && by_point(&order[i - 1], &order[i]) == 0 ? number[order[i - 1]] : order[i];
    for (uint64_t i = 0; i < 3 * mesh->face_count; i++)
        mesh->faces[i] = number[mesh->faces[i]];
    free(order);
    free(number);
}

/* Returns true if each directed edge has an opposite one; vertices at equal points are one. */
static bool is_closed(ebpo_mesh *mesh)
{
    weld(mesh);
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
    build(&tree, horned(220, 120), 2);
    const uint64_t *rows = tree.surface.patch;
    ck_assert_uint_gt(tree.surface.patch_count, 9);
    for (int level = 0; level < 4; level++) {
        uint64_t *patches, count;
        must(ebpo_surface_select(&tree.surface, level, &patches, &count, &error), "level", &error);
        check_join(&tree, patches, count);
        free(patches);
    }
    for (int round = 0; round < (ebpo_test_scale() < 1 ? 4 : 20); round++) {
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
    build(&one, waves(182, 92), 1);
    build(&three, waves(182, 92), 3);
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
    ck_assert(ebpo_stored_check(file, &error) == EBPO_OK);
    file->root_array[EBPO_A_SURFACE_POINTS].stored_bytes = file->end;
    ck_assert(ebpo_stored_check(file, &error) == EBPO_E_FORMAT);
    ebpo_close(file);
    ebpo_tree_free(&one);
    ebpo_tree_free(&three);
    ebpo_tree_free(&read);
}
END_TEST

/* Vertices that patches of a level share have the same normal and colour in each of them. */
START_TEST(test_shared_vertices_are_equal)
{
    ebpo_tree tree;
    ebpo_error error = EBPO_ERROR_INIT;
    ebpo_patch patch[9];
    uint64_t shared = 0, count = 0;
    build(&tree, waves(182, 92), 1);
    ck_assert_uint_gt(tree.surface.patch_count, 2);
    for (uint64_t i = 1; i < tree.surface.patch_count && count < 9; i++)
        if (ebpo_octcode_level(tree.surface.patch[i * EBPO_PATCH_COLUMNS]) == 1)
            must(ebpo_surface_decode(&tree.surface, &tree.info, i, &patch[count++], &error),
                 "decode", &error);
    for (uint64_t a = 0; a < count; a++)
        for (uint64_t b = 0; b < a; b++)
            for (uint64_t v = 0; v < patch[a].vertex_count; v++)
                for (uint64_t w = 0; w < patch[b].vertex_count; w++)
                    if (memcmp(patch[a].xyz + 3 * v, patch[b].xyz + 3 * w, 3 * sizeof(double)) ==
                        0) {
                        ck_assert_mem_eq(patch[a].normals + 3 * v, patch[b].normals + 3 * w,
                                         3 * sizeof(float));
                        shared++;
                    }
    ck_assert_uint_gt(shared, 50);
    for (uint64_t i = 0; i < count; i++)
        ebpo_patch_free(&patch[i]);
    ebpo_tree_free(&tree);
}
END_TEST

/* Joins the patches of level 0. */
static ebpo_surface_mesh join_root(const ebpo_tree *tree)
{
    ebpo_surface_mesh joined;
    ebpo_error error = EBPO_ERROR_INIT;
    must(ebpo_surface_join(&tree->surface, &tree->info, (uint64_t[]){ 0 }, 1, &joined, &error),
         "join", &error);
    return joined;
}

/* The root's patch of a divided box has less than the sixteenth of its faces, 1,200, and each
 * vertex has a normal for each side of the box. */
START_TEST(test_boxes_stay_sharp)
{
    ebpo_tree tree;
    build(&tree, ebpo_test_box((double[3]){ 0.1, 0.2, 0.3 }, (double[3]){ 1.1, 1.2, 1.3 }, 40), 1);
    ebpo_surface_mesh joined = join_root(&tree);
    ck_assert_uint_le(joined.mesh.face_count, 800);
    for (uint64_t c = 0; c < 3 * joined.mesh.face_count; c++) {
        double t[3][3], u[3], w[3], n[3];
        const float *normal = joined.normals + 3 * (uint64_t)joined.mesh.faces[c];
        get_face(&joined.mesh, c / 3, t);
        ebpo_vec3_subtract(t[1], t[0], u);
        ebpo_vec3_subtract(t[2], t[0], w);
        ebpo_vec3_cross(u, w, n);
        for (int k = 0; k < 3; k++)
            ck_assert_double_eq_tol((double)normal[k], n[k] / ebpo_vec3_length(n), 0.01);
    }
    ebpo_surface_mesh_free(&joined);
    ebpo_tree_free(&tree);
}
END_TEST

/* Joining one patch moves none of its vertices, also near holes, where several vertices are in one
 * border cell. So the patch's error remains right, and it has the border of its neighbours. */
START_TEST(test_one_patch_keeps_its_points)
{
    ebpo_tree tree;
    ebpo_error error = EBPO_ERROR_INIT;
    ebpo_mesh mesh = waves(182, 92);
    uint64_t kept = 0;
    for (uint64_t i = 0; i < mesh.face_count; i++)
        if (i % 50 > 7)
            memmove(mesh.faces + 3 * kept++, mesh.faces + 3 * i, 3 * sizeof *mesh.faces);
    mesh.face_count = kept;
    build(&tree, mesh, 1);
    ck_assert_uint_gt(tree.surface.patch_count, 2);
    for (uint64_t i = 0; i < tree.surface.patch_count; i++) {
        ebpo_patch patch;
        ebpo_surface_mesh joined;
        must(ebpo_surface_decode(&tree.surface, &tree.info, i, &patch, &error), "decode", &error);
        must(ebpo_surface_join(&tree.surface, &tree.info, &i, 1, &joined, &error), "join", &error);
        ck_assert_uint_eq(joined.mesh.face_count, patch.triangle_count);
        for (uint64_t k = 0; k < patch.triangle_count; k++) {
            double a[3][3], b[3][3];
            get_triangle(&patch, k, a);
            get_face(&joined.mesh, k, b);
            ck_assert_mem_eq(a, b, sizeof a);
        }
        ebpo_patch_free(&patch);
        ebpo_surface_mesh_free(&joined);
    }
    ebpo_tree_free(&tree);
}
END_TEST

static double volume_of(const ebpo_mesh *mesh)
{
    double sum = 0;
    for (uint64_t i = 0; i < mesh->face_count; i++) {
        double t[3][3], n[3];
        get_face(mesh, i, t);
        ebpo_vec3_cross(t[0], t[1], n);
        sum += ebpo_vec3_dot(n, t[2]) / 6;
    }
    return sum;
}

/* Vertices of patches are beside the surface, so patches of a ball are not inscribed: the volume
 * stays. */
START_TEST(test_patches_keep_the_volume)
{
    ebpo_tree tree;
    build(&tree, ebpo_test_sphere((double[3]){ 0, 0, 0 }, 1, 5), 1);
    ebpo_surface_mesh joined = join_root(&tree);
    double least = volume_of(&joined.mesh) / volume_of(&tree.mesh);

    ck_assert_double_eq_tol(least, 1, 0.005);
    ebpo_surface_mesh_free(&joined);
    ebpo_tree_free(&tree);
}
END_TEST

/* Nearly all triangles of a closed patch need one byte, and readers compute normals that are on no
 * border; stored normals are the first rows of a patch. Differences from predictions are small. Few
 * normals are on the back of their triangles. */
START_TEST(test_codes_are_short)
{
    ebpo_tree tree;
    ebpo_error error = EBPO_ERROR_INIT;
    build(&tree, waves(182, 92), 1);
    const uint64_t *root = tree.surface.patch;
    ck_assert_uint_lt(20 * root[EBPO_PATCH_CODE_BYTES], 21 * root[EBPO_PATCH_TRIANGLES]);
    for (uint64_t i = 0; i < 2 * root[EBPO_PATCH_VERTICES]; i++)
        ck_assert_uint_eq(tree.surface.normal[i], 0);
    uint64_t sum = 0, row = 0;
    for (uint64_t i = 0; i < 3 * tree.surface.vertex_count; i++)
        sum += tree.surface.point[i];
    ck_assert_uint_lt(sum, 56 * tree.surface.vertex_count);
    for (uint64_t i = 0; i < tree.surface.patch_count; i++) {
        const uint64_t end = row + tree.surface.patch[EBPO_PATCH_COLUMNS * i + EBPO_PATCH_VERTICES];
        for (bool stored = true; row < end; row++) {
            bool here = tree.surface.normal[2 * row] || tree.surface.normal[2 * row + 1];
            ck_assert(stored || !here);
            stored = here;
        }
        ebpo_patch patch;
        must(ebpo_surface_decode(&tree.surface, &tree.info, i, &patch, &error), "decode", &error);
        uint64_t back = 0;
        for (uint64_t k = 0; k < patch.triangle_count; k++) {
            double t[3][3], u[3], w[3], n[3];
            get_triangle(&patch, k, t);
            ebpo_vec3_subtract(t[1], t[0], u);
            ebpo_vec3_subtract(t[2], t[0], w);
            ebpo_vec3_cross(u, w, n);
            for (int c = 0; c < 3; c++) {
                const float *at =
                    patch.normals + 3 * (uint64_t)patch.triangles[3 * k + (uint64_t)c];
                back += (double)at[0] * n[0] + (double)at[1] * n[1] + (double)at[2] * n[2] < 0;
            }
        }
        ck_assert_uint_lt(200 * back, patch.triangle_count);
        ebpo_patch_free(&patch);
    }
    ebpo_tree_free(&tree);
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

/* A model far from the origin has patches. Their errors include the rounding errors of coordinates,
 * and not much more. */
START_TEST(test_far_from_the_origin)
{
    ebpo_tree tree;
    ebpo_error error = EBPO_ERROR_INIT;
    ebpo_patch patch;
    ebpo_mesh mesh = waves(182, 92);
    for (uint64_t i = 0; i < 3 * mesh.vertex_count; i++)
        mesh.xyz64[i] = 1e15 + 1000 * mesh.xyz64[i];
    build(&tree, mesh, 1);
    ck_assert_uint_gt(tree.surface.patch_count, 1);
    must(ebpo_surface_decode(&tree.surface, &tree.info, 1, &patch, &error), "decode", &error);
    ck_assert_double_gt(patch.error, 0.125); /* the rounding error of the coordinates */
    ck_assert_double_le(patch.error, 20);
    ebpo_patch_free(&patch);
    ebpo_tree_free(&tree);
}
END_TEST

/* More triangles than 32-bit corners can number are refused before memory is used. */
START_TEST(test_too_many_triangles)
{
    ebpo_error error = EBPO_ERROR_INIT;
    ebpo_patch_mesh mesh = { .vertex_count = 3, .triangle_count = UINT32_MAX / 3 + 1 };
    ck_assert_int_eq(ebpo_simplify(&mesh, 100, 0, &error), EBPO_E_LIMIT);
}
END_TEST

/* Collapses that change the surface by much more than `fine` are not made, although more triangles
 * than the target remain: an octahedron does not become flat. */
START_TEST(test_shapes_remain)
{
    for (int flat = 0; flat < 2; flat++) {
        ebpo_error error = EBPO_ERROR_INIT;
        ebpo_patch_mesh mesh = { .vertex = calloc(6, sizeof *mesh.vertex),
                                 .triangle = malloc(8 * 3 * sizeof *mesh.triangle),
                                 .vertex_count = 6,
                                 .vertex_capacity = 6,
                                 .triangle_count = 8,
                                 .triangle_capacity = 8 };
        for (uint32_t v = 0; v < 6; v++)
            mesh.vertex[v].at[v / 2] = v % 2 ? 1 : -1;
        for (uint32_t i = 0; i < 8; i++) {
            uint32_t x = i & 1, y = 2 + (i >> 1 & 1), z = 4 + (i >> 2), odd = (x + y + z) % 2;
            uint32_t t[3] = { x, odd ? y : z, odd ? z : y };
            memcpy(mesh.triangle + 3 * (uint64_t)i, t, sizeof t);
        }
        must(ebpo_simplify(&mesh, 1, flat ? 1 : 0.01, &error), "simplify", &error);
        if (flat)
            ck_assert_uint_lt(mesh.triangle_count, 8);
        else
            ck_assert_uint_eq(mesh.triangle_count, 8);
        ebpo_patch_mesh_free(&mesh);
    }
}
END_TEST

/* Faces that are repeated with the other orientation, which are the sides of a wall without
 * thickness, are simplified like single faces. */
START_TEST(test_doubled_walls)
{
    ebpo_tree tree;
    ebpo_error error = EBPO_ERROR_INIT;
    ebpo_patch patch;
    ebpo_mesh mesh = waves(40, 40);
    uint64_t count = mesh.face_count;
    mesh.faces = realloc(mesh.faces, 6 * count * sizeof *mesh.faces);
    for (uint64_t i = 0; i < 3 * count; i++)
        mesh.faces[3 * count + i] = mesh.faces[i - i % 3 + (3 - i % 3) % 3];
    mesh.face_count = 2 * count;
    build(&tree, mesh, 1);
    must(ebpo_surface_decode(&tree.surface, &tree.info, 0, &patch, &error), "decode", &error);
    ck_assert_uint_eq(patch.face_count, 2 * count);
    ck_assert_uint_le(patch.triangle_count, count / 4);
    ck_assert_double_lt(patch.error, 0.05);
    ebpo_patch_free(&patch);
    ebpo_tree_free(&tree);
}
END_TEST

/* Strips of triangles whose corners are on a line, except for rounding errors: their planes have no
 * certain digits, but vertices stay near the line. */
START_TEST(test_thin_triangles_stay_in_place)
{
    enum { COUNT = 40 };
    uint64_t state = 1, fewer = 0;
    for (int run = 0; run < 500; run++) {
        ebpo_error error = EBPO_ERROR_INIT;
        ebpo_patch_mesh mesh = { .vertex = calloc(COUNT, sizeof *mesh.vertex),
                                 .triangle = malloc(COUNT * 3 * sizeof *mesh.triangle),
                                 .vertex_count = COUNT,
                                 .vertex_capacity = COUNT,
                                 .triangle_count = COUNT - 2,
                                 .triangle_capacity = COUNT };
        double from[3], step[3];
        for (int k = 0; k < 3; k++) {
            from[k] = ebpo_test_random_unit(&state);
            step[k] = (ebpo_test_random_unit(&state) - 0.5) / COUNT;
        }
        for (uint32_t v = 0; v < COUNT; v++) {
            for (int k = 0; k < 3; k++)
                mesh.vertex[v].at[k] = from[k] + v * step[k];
            mesh.vertex[v].key = UINT64_MAX;
            mesh.vertex[v].weight = 1;
            uint32_t t[3] = { v + v % 2, v + 1 - v % 2, v + 2 };
            if (v < COUNT - 2)
                memcpy(mesh.triangle + 3 * (uint64_t)v, t, sizeof t);
        }
        must(ebpo_simplify(&mesh, 8, 1e-3, &error), "simplify", &error);
        fewer += mesh.triangle_count < COUNT - 2;
        for (uint64_t v = 0; v < mesh.vertex_count; v++)
            for (int k = 0; k < 3; k++)
                ck_assert_double_le(fabs(mesh.vertex[v].at[k] - from[k] - COUNT / 2 * step[k]),
                                    0.51 * COUNT * fabs(step[k]) + 1e-6);
        ebpo_patch_mesh_free(&mesh);
    }
    ck_assert_uint_gt(fewer, 250);
}
END_TEST

/* The work of encoding does not grow with the square of the number of triangles that share an edge:
 * 2^39 steps would exceed the time limit of the test. */
START_TEST(test_triangles_that_share_an_edge)
{
    enum { COUNT = 1 << 20 };
    ebpo_error error = EBPO_ERROR_INIT;
    ebpo_patch_rows rows;
    ebpo_patch patch;
    uint32_t *triangle = malloc(COUNT * 3 * sizeof *triangle);
    uint64_t row[EBPO_PATCH_COLUMNS] = { 1, 0, COUNT, COUNT, COUNT + 2 }, corners = 0;
    ebpo_patch_source source = {
        COUNT + 2, COUNT, triangle, calloc(COUNT + 2, 6), calloc(COUNT + 2, 24), NULL
    };
    for (uint32_t i = 0; i < COUNT; i++)
        memcpy(triangle + 3 * (uint64_t)i, (uint32_t[3]){ 0, 1, i + 2 }, 3 * sizeof *triangle);
    must(ebpo_patch_encode(&source, &rows, &error), "encode", &error);
    row[EBPO_PATCH_CODE_BYTES] = rows.code_bytes;
    ebpo_surface s = { 1,           COUNT, COUNT + 2, rows.code_bytes,
                       0,           row,   rows.code, rows.point,
                       rows.normal, NULL,  NULL };
    ebpo_info info = { .box_size = { 1, 1, 1 } };
    must(ebpo_surface_decode(&s, &info, 0, &patch, &error), "decode", &error);
    for (uint64_t i = 0; i < 3 * patch.triangle_count; i++)
        corners += patch.triangles[i] < 2;
    ck_assert_uint_eq(corners, 2 * (uint64_t)COUNT);
    ebpo_patch_free(&patch);
    ebpo_patch_rows_free(&rows);
    free(triangle);
    free((void *)source.point);
    free((void *)source.normal);
}
END_TEST

/* Decoding a patch does not read the rows of the patches before, so the time of decoding all
 * patches is proportional to their number. */
START_TEST(test_decoding_reads_one_row)
{
    ebpo_tree tree;
    ebpo_surface read;
    ebpo_file *file;
    ebpo_error error = EBPO_ERROR_INIT;
    build(&tree, waves(182, 92), 1);
    must(ebpo_tree_write(&tree, scratch("rows.ebpo.h5"), NULL, &error), "write", &error);
    must(ebpo_open(scratch("rows.ebpo.h5"), &file, &error), "open", &error);
    must(ebpo_file_read_surface(file, 0, EBPO_LEVELS_MAX, &read, &error), "read", &error);
    for (int i = 0; i < 2; i++) {
        ebpo_surface *s = i ? &read : &tree.surface;
        ebpo_patch before, after;
        uint64_t last = s->patch_count - 1;
        ck_assert_uint_gt(last, 0);
        must(ebpo_surface_decode(s, &tree.info, last, &before, &error), "decode", &error);
        memset(s->patch, 0, last * EBPO_PATCH_COLUMNS * sizeof *s->patch);
        must(ebpo_surface_decode(s, &tree.info, last, &after, &error), "decode", &error);
        ck_assert_mem_eq(before.xyz, after.xyz, 3 * before.vertex_count * sizeof *before.xyz);
        ebpo_patch_free(&before);
        ebpo_patch_free(&after);
    }
    ebpo_surface_free(&read);
    ebpo_close(file);
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

/* --- views --- */

static void make_view(const char *name, uint32_t around, uint32_t across, ebpo_file **file)
{
    ebpo_tree tree;
    ebpo_error error = EBPO_ERROR_INIT;
    build(&tree, horned(around, across), 2);
    must(ebpo_tree_write(&tree, scratch(name), NULL, &error), "write", &error);
    ebpo_tree_free(&tree);
    must(ebpo_open(scratch(name), file, &error), "open", &error);
}

/* Returns the bytes read from the file. */
static uint64_t bytes_read(const ebpo_file *file)
{
    ebpo_file_stats stats = EBPO_FILE_STATS_INIT;
    ebpo_file_get_stats(file, &stats);
    return stats.bytes_read;
}

static ebpo_status take_view(const ebpo_file *file, const ebpo_view_options *options,
                             ebpo_surface_mesh *out, ebpo_error *error)
{
    ebpo_view_stream *stream;
    ebpo_status status = ebpo_view_stream_new(file, options, &stream, error);
    if (status == EBPO_OK)
        status = ebpo_view_stream_surface(stream, out, error);
    ebpo_view_stream_free(stream);
    return status;
}

/* Views of any error are closed, and no coarser than requested. The nearest patches are the finest.
 * The error in the image holds at random points of the model. */
START_TEST(test_views_are_closed)
{
    ebpo_file *file;
    ebpo_error error = EBPO_ERROR_INIT;
    ebpo_observer observer = EBPO_OBSERVER_INIT;
    ebpo_view_options options = EBPO_VIEW_OPTIONS_INIT;
    uint64_t before = 0;
    make_view("view.ebpo.h5", 220, 120, &file);
    for (int k = 0; k < 3; k++)
        observer.eye[k] = 0.9;
    options.observer = &observer;
    for (double pixels = 64; pixels > 0.01; pixels /= 4)
        for (int faces = 0; faces < 2; faces++) {
            ebpo_surface_mesh mesh;
            options.pixels = pixels;
            options.faces = faces;
            must(take_view(file, &options, &mesh, &error), "view", &error);
            ck_assert(faces || mesh.faces == 0);
            ck_assert(mesh.pixels <= pixels || (!faces && mesh.patches > 4));
            ck_assert(faces || mesh.mesh.face_count >= before);
            before = faces ? before : mesh.mesh.face_count;
            ck_assert(is_closed(&mesh.mesh));
            ebpo_surface_mesh_free(&mesh);
        }
    ebpo_close(file);
}
END_TEST

/* Normals of faces do not depend on the unit of length, however small or large the model is. */
START_TEST(test_faces_of_extreme_sizes)
{
    ebpo_error error = EBPO_ERROR_INIT;
    ebpo_surface_mesh mesh[3];
    for (int i = 0; i < 3; i++) {
        ebpo_view_options options = EBPO_VIEW_OPTIONS_INIT;
        ebpo_tree tree;
        ebpo_file *file;
        ebpo_mesh torus = waves(40, 30);
        for (uint64_t v = 0; v < 3 * torus.vertex_count; v++)
            torus.xyz64[v] = ldexp(torus.xyz64[v], i * 900 - 900);
        build(&tree, torus, 1);
        must(ebpo_tree_write(&tree, scratch("size.ebpo.h5"), NULL, &error), "write", &error);
        ebpo_tree_free(&tree);
        must(ebpo_open(scratch("size.ebpo.h5"), &file, &error), "open", &error);
        options.faces = true;
        must(take_view(file, &options, &mesh[i], &error), "view", &error);
        ck_assert_uint_eq(mesh[i].faces, 2400);
        ebpo_close(file);
    }
    for (int i = 0; i < 3; i += 2) {
        ck_assert_uint_eq(mesh[i].mesh.vertex_count, mesh[1].mesh.vertex_count);
        ck_assert(memcmp(mesh[i].normals, mesh[1].normals,
                         3 * mesh[1].mesh.vertex_count * sizeof(float)) == 0);
    }
    for (int i = 0; i < 3; i++)
        ebpo_surface_mesh_free(&mesh[i]);
}
END_TEST

/* Without a limit of the error, all faces of the model are drawn, each once. */
START_TEST(test_views_end_at_faces)
{
    ebpo_file *file;
    ebpo_error error = EBPO_ERROR_INIT;
    ebpo_view_options options = EBPO_VIEW_OPTIONS_INIT;
    ebpo_surface_mesh mesh;
    make_view("faces.ebpo.h5", 120, 70, &file);
    options.faces = true;
    must(take_view(file, &options, &mesh, &error), "view", &error);
    ck_assert_uint_eq(mesh.patches, 0);
    ck_assert_uint_eq(mesh.faces, ebpo_file_info(file)->face_count);
    ck_assert_uint_eq(mesh.mesh.face_count, mesh.faces);
    ck_assert_double_eq(mesh.error, 0);
    ck_assert(is_closed(&mesh.mesh));
    ebpo_surface_mesh_free(&mesh);
    ebpo_close(file);
}
END_TEST

/* A limit of bytes is kept; a greater one gives a finer view. */
START_TEST(test_views_within_bytes)
{
    ebpo_error error = EBPO_ERROR_INIT;
    ebpo_view_options options = EBPO_VIEW_OPTIONS_INIT;
    uint64_t before = 0;
    ebpo_file *file;
    make_view("bytes.ebpo.h5", 220, 120, &file);
    uint64_t most = ebpo_file_info(file)->file_bytes;
    ebpo_close(file);
    for (uint64_t limit = 1000; limit <= most; limit += most / 9) {
        ebpo_surface_mesh mesh;
        must(ebpo_open(scratch("bytes.ebpo.h5"), &file, &error), "open", &error);
        options.bytes = limit;
        ebpo_status status = take_view(file, &options, &mesh, &error);
        ck_assert(status == EBPO_OK || status == EBPO_E_LIMIT);
        ck_assert(bytes_read(file) <= limit || status == EBPO_E_LIMIT);
        ck_assert_uint_ge(mesh.mesh.face_count, before);
        before = mesh.mesh.face_count;
        ebpo_surface_mesh_free(&mesh);
        ebpo_close(file);
    }
    ck_assert_uint_gt(before, 0);
}
END_TEST

/* A subset with a box keeps the patches in the box; the view of the subset is that of the file. */
START_TEST(test_boxes_keep_patches)
{
    ebpo_error error = EBPO_ERROR_INIT;
    ebpo_subset_options subset = EBPO_SUBSET_OPTIONS_INIT;
    ebpo_view_options options = EBPO_VIEW_OPTIONS_INIT;
    ebpo_observer observer = EBPO_OBSERVER_INIT;
    ebpo_verify_report report = EBPO_VERIFY_REPORT_INIT;
    ebpo_file *file, *part;
    ebpo_surface_mesh whole, kept;
    make_view("whole.ebpo.h5", 220, 120, &file);
    subset.boxed = true;
    for (int k = 0; k < 3; k++) {
        subset.min[k] = 1; /* not in the octant of most faces */
        subset.max[k] = 2;
    }
    must(ebpo_subset(file, scratch("part.ebpo.h5"), &subset, &error), "subset", &error);
    must(ebpo_open(scratch("part.ebpo.h5"), &part, &error), "open", &error);
    uint64_t patches = ebpo_file_info(part)->surface_patches;
    ck_assert_uint_gt(patches, 1);
    ck_assert_uint_lt(patches, ebpo_file_info(file)->surface_patches);
    must(ebpo_verify(part, NULL, &report, &error), "verify", &error);
    ck_assert_uint_eq(report.violations, 0);
    for (int k = 0; k < 3; k++)
        observer.eye[k] = 1.5; /* in the box */
    options.observer = &observer;
    options.pixels = 12;
    must(take_view(file, &options, &whole, &error), "view", &error);
    must(take_view(part, &options, &kept, &error), "view of the part", &error);
    ck_assert_uint_gt(kept.patches, 1);
    ck_assert_uint_le(kept.patches, whole.patches);
    ck_assert(is_closed(&kept.mesh));
    ebpo_surface_mesh_free(&whole);
    ebpo_surface_mesh_free(&kept);
    /* patches of a subset have the face numbers of the original file, so no face replaces them */
    ck_assert(ebpo_file_info(part)->parts & EBPO_PART_MESH);
    options.faces = true;
    options.pixels = 0;
    must(take_view(part, &options, &kept, &error), "finest view of the part", &error);
    ck_assert_uint_eq(kept.faces, 0);
    ck_assert(is_closed(&kept.mesh));
    ebpo_surface_mesh_free(&kept);
    ebpo_close(part);
    ebpo_close(file);
}
END_TEST

/* The boxes of long diagonal faces intersect all cells of the verifier's grid; verification still
 * needs little memory. */
START_TEST(test_long_faces_need_little_memory)
{
    static const double diagonal[3][3] = { { 0.70710678118654752, 0.40824829046386302, 0.57735 },
                                           { -0.70710678118654752, 0.40824829046386302, 0.57735 },
                                           { 0, -0.81649658092772603, 0.57735 } },
                        nowhere[3] = { 0, 0, 0 };
    ebpo_tree tree;
    ebpo_error error = EBPO_ERROR_INIT;
    ebpo_file *file;
    ebpo_workspace *workspace;
    ebpo_workspace_options limits = EBPO_WORKSPACE_OPTIONS_INIT;
    ebpo_workspace_stats stats = EBPO_WORKSPACE_STATS_INIT;
    ebpo_verify_options options = EBPO_VERIFY_OPTIONS_INIT;
    ebpo_verify_report report = EBPO_VERIFY_REPORT_INIT;
    ebpo_mesh needle = ebpo_test_cone(0.01, 1, 2000);
    ebpo_test_transform(&needle, diagonal, nowhere);
    build(&tree, needle, 1);
    must(ebpo_tree_write(&tree, scratch("needle.ebpo.h5"), NULL, &error), "write", &error);
    ebpo_tree_free(&tree);
    must(ebpo_open(scratch("needle.ebpo.h5"), &file, &error), "open", &error);
    ck_assert_uint_gt(ebpo_file_info(file)->surface_patches, 0);
    must(ebpo_workspace_new(&limits, &workspace, &error), "workspace", &error);
    options.workspace = workspace;
    must(ebpo_verify(file, &options, &report, &error), "verify", &error);
    ck_assert_uint_eq(report.violations, 0);
    must(ebpo_workspace_get_stats(workspace, &stats), "stats", NULL);
    ck_assert_uint_lt(stats.held_peak + stats.filed_peak, 32 << 20);
    ebpo_workspace_free(workspace);
    ebpo_close(file);
}
END_TEST

/* If patches do not have the faces of their nodes, errors are not tested: otherwise each patch
 * could name all faces, and the time would be that of all pairs of patches and faces. */
START_TEST(test_patches_that_name_all_faces)
{
    ebpo_tree tree;
    ebpo_file *file;
    ebpo_error error = EBPO_ERROR_INIT;
    ebpo_verify_options options = EBPO_VERIFY_OPTIONS_INIT;
    ebpo_verify_report report = EBPO_VERIFY_REPORT_INIT;
    build(&tree, waves(182, 92), 1);
    for (uint64_t i = 1; i < tree.surface.patch_count; i++) {
        uint64_t *row = tree.surface.patch + EBPO_PATCH_COLUMNS * i;
        row[EBPO_PATCH_FIRST_FACE] = 0;
        row[EBPO_PATCH_FACES] = tree.info.face_count;
        row[EBPO_PATCH_ERROR] = 1;
    }
    must(ebpo_tree_write(&tree, scratch("all.ebpo.h5"), NULL, &error), "write", &error);
    must(ebpo_open(scratch("all.ebpo.h5"), &file, &error), "open", &error);
    must(ebpo_verify(file, &options, &report, &error), "verify", &error);
    ck_assert_uint_eq(report.violations, tree.surface.patch_count - 1);
    ebpo_close(file);
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
    tcase_add_test(tests, test_bound_of_overlapping_triangles);
    tcase_add_test(tests, test_bound_of_sheets);
    tcase_add_test(tests, test_covers);
    tcase_add_test(tests, test_joined_levels_are_closed);
    tcase_add_test(tests, test_files_and_threads);
    tcase_add_test(tests, test_shared_vertices_are_equal);
    tcase_add_test(tests, test_boxes_stay_sharp);
    tcase_add_test(tests, test_one_patch_keeps_its_points);
    tcase_add_test(tests, test_patches_keep_the_volume);
    tcase_add_test(tests, test_codes_are_short);
    tcase_add_test(tests, test_few_faces_have_none);
    tcase_add_test(tests, test_far_from_the_origin);
    tcase_add_test(tests, test_too_many_triangles);
    tcase_add_test(tests, test_shapes_remain);
    tcase_add_test(tests, test_doubled_walls);
    tcase_add_test(tests, test_thin_triangles_stay_in_place);
    tcase_add_test(tests, test_triangles_that_share_an_edge);
    tcase_add_test(tests, test_decoding_reads_one_row);
    tcase_add_test(tests, test_hostile_codes);
    tcase_add_test(tests, test_views_are_closed);
    tcase_add_test(tests, test_faces_of_extreme_sizes);
    tcase_add_test(tests, test_views_end_at_faces);
    tcase_add_test(tests, test_views_within_bytes);
    tcase_add_test(tests, test_boxes_keep_patches);
    tcase_add_test(tests, test_long_faces_need_little_memory);
    tcase_add_test(tests, test_patches_that_name_all_faces);
    suite_add_tcase(suite, tests);
    return suite;
}
