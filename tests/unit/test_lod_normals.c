/* Tests normals for the lighting of polygons of a level. They are compared with the definition,
 * computed node by node without tables, and with the known normals of spheres. */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include <ebpo/ebpo.h>

#include "check_main.h"
#include "model_file.h"
#include "scratch.h"
#include "solids.h"

/* A level, and for each polygon its node, its first triangle, and its normal times twice its area.
 */
typedef struct level {
    ebpo_file *file;
    const ebpo_info *info;
    ebpo_mesh mesh;
    ebpo_lod_nodes nodes;
    float *normals;
    uint64_t *node, *first;
    double (*area)[3];
} level;

static void make_folder(void) { scratch_enter(); }

static void *space(uint64_t count, size_t size)
{
    void *p = calloc(count + 1, size);
    ck_assert_ptr_nonnull(p);
    return p;
}

static const double *corner_of(const level *l, uint64_t polygon, unsigned i)
{
    const uint32_t *f = l->mesh.faces + 3 * l->first[polygon];
    return l->mesh.xyz64 + 3 * (uint64_t)(i < 2 ? f[i] : f[3 * (i - 2) + 2]);
}

static void find_polygons(level *l)
{
    uint64_t polygon = 0, triangle = 0;
    for (uint64_t i = 0; i < l->nodes.node_count; i++)
        for (uint32_t k = 0; k < l->nodes.nodes[i].polygon_count; k++, polygon++) {
            l->node[polygon] = i;
            l->first[polygon] = triangle;
            for (unsigned c = 0; c < l->nodes.corners[polygon]; c++) {
                const double *a = corner_of(l, polygon, c),
                             *b = corner_of(l, polygon, (c + 1) % l->nodes.corners[polygon]);
                for (int j = 0; j < 3; j++) /* Newell's method */
                    l->area[polygon][j] +=
                        (a[(j + 1) % 3] - b[(j + 1) % 3]) * (a[(j + 2) % 3] + b[(j + 2) % 3]);
            }
            triangle += l->nodes.corners[polygon] - 2u;
        }
    ck_assert_uint_eq(triangle, l->mesh.face_count);
}

static level take(ebpo_mesh mesh, uint32_t leaf_faces, int number)
{
    level l = { .file = NULL };
    ebpo_error error = EBPO_ERROR_INIT;
    ebpo_tree tree =
        model_build_parts(mesh, leaf_faces, EBPO_PART_PLANES | EBPO_PART_MESH | EBPO_PART_MAPS);
    model_write(&tree, scratch("x.ebpo.h5"), NULL);
    l.file = model_open(scratch("x.ebpo.h5"));
    l.info = ebpo_file_info(l.file);
    ck_assert_int_lt(number, l.info->level_count);
    ck_assert_int_eq(ebpo_lod_level_nodes(l.file, number, NULL, &l.mesh, &l.nodes, NULL, &error),
                     EBPO_OK);
    uint64_t count = l.nodes.polygon_count;
    l.normals = space(count, 3 * sizeof *l.normals);
    l.node = space(count, sizeof *l.node);
    l.first = space(count, sizeof *l.first);
    l.area = space(count, sizeof *l.area);
    ck_assert_int_eq(ebpo_lod_normals(l.info, &l.mesh, &l.nodes, l.normals, &error), EBPO_OK);
    find_polygons(&l);
    return l;
}

static void release(level *l)
{
    free(l->normals);
    free(l->node);
    free(l->first);
    free(l->area);
    ebpo_lod_nodes_free(&l->nodes);
    ebpo_mesh_free(&l->mesh);
    ebpo_close(l->file);
}

/* --- the definition --- */

static double length_of(const double v[3]) { return sqrt(v[0] * v[0] + v[1] * v[1] + v[2] * v[2]); }

/* Computes the low corner of a node's cell and its side, in units of the side of the root cell. */
static void cell_of(uint64_t octcode, double low[3], double *side)
{
    int bits = 0;
    while (octcode >> bits > 1)
        bits++;
    *side = ldexp(1, -bits / 3);
    for (int k = 0; k < 3; k++) {
        low[k] = 0;
        for (int at = bits - 3, depth = 1; at >= 0; at -= 3, depth++)
            low[k] += (double)(octcode >> (at + k) & 1) * ldexp(1, -depth);
    }
}

static void in_box(const level *l, const double at[3], double out[3])
{
    for (int k = 0; k < 3; k++)
        out[k] = (at[k] - l->info->box_origin[k]) / l->info->box_size[k];
}

/* Returns 2 * axis, or 2 * axis + 1 for the upper side; 6 for polygons on a plane or a side of the
 * root cell. */
static int side_of(const level *l, uint64_t polygon)
{
    double low[3], side, at[3];
    cell_of(l->nodes.nodes[l->node[polygon]].octcode, low, &side);
    for (int s = 0; s < 6; s++) {
        double cell_face = low[s / 2] + s % 2 * side;
        bool on = cell_face > 0 && cell_face < 1;
        for (unsigned c = 0; c < l->nodes.corners[polygon]; c++) {
            in_box(l, corner_of(l, polygon, c), at);
            on = on && fabs(at[s / 2] - cell_face) < 1e-13;
        }
        if (on)
            return s;
    }
    return 6;
}

static bool is_corner(const level *l, uint64_t node, const double at[3])
{
    double low[3], side;
    cell_of(l->nodes.nodes[node].octcode, low, &side);
    for (int k = 0; k < 3; k++)
        if (at[k] != low[k] && at[k] != low[k] + side)
            return false;
    return true;
}

/* Computes the mean, by area, of planes of nodes with this corner. */
static void mean_at(const level *l, const int *sides, int side, const double at[3], double out[3])
{
    double all = 0;
    memset(out, 0, 3 * sizeof *out);
    for (uint64_t i = 0; i < l->nodes.polygon_count; i++) {
        double length = length_of(l->area[i]),
               towards = (side % 2 ? 1 : -1) * l->area[i][side / 2] / length;
        if (sides[i] != 6 || !(towards > -0.3) || !is_corner(l, l->node[i], at))
            continue;
        for (int k = 0; k < 3; k++)
            out[k] += l->area[i][k];
        all += length;
    }
    for (int k = 0; k < 3 && all > 0; k++)
        out[k] /= all;
}

static void expect(const level *l, const int *sides, uint64_t polygon, double out[3])
{
    double low[3], side, middle[3] = { 0, 0, 0 }, at[3];
    unsigned corners = l->nodes.corners[polygon];
    cell_of(l->nodes.nodes[l->node[polygon]].octcode, low, &side);
    for (unsigned c = 0; c < corners; c++) {
        in_box(l, corner_of(l, polygon, c), at);
        for (int k = 0; k < 3; k++)
            middle[k] += (at[k] - low[k]) / side / corners;
    }
    memset(out, 0, 3 * sizeof *out);
    for (int c = 0; c < 8 && sides[polygon] < 6; c++) {
        double corner[3], mean[3], share = 1;
        for (int k = 0; k < 3; k++) {
            corner[k] = low[k] + (c >> k & 1) * side;
            share *= c >> k & 1 ? middle[k] : 1 - middle[k];
        }
        mean_at(l, sides, sides[polygon], corner, mean);
        for (int k = 0; k < 3; k++)
            out[k] += share * mean[k];
    }
    if (!(length_of(out) > 0))
        memcpy(out, l->area[polygon], 3 * sizeof *out);
    double length = length_of(out);
    for (int k = 0; k < 3 && length > 0; k++)
        out[k] /= length;
}

START_TEST(test_lod_normals_match_definition)
{
    static const char *const solids[] = { "torus", "blob", "cube" };
    level l = take(ebpo_test_make(solids[_i]), 4, _i == 2 ? 1 : 3);
    int *sides = space(l.nodes.polygon_count, sizeof *sides);
    uint64_t cell_faces = 0, lent = 0;
    for (uint64_t i = 0; i < l.nodes.polygon_count; i++)
        sides[i] = side_of(&l, i);
    for (uint64_t i = 0; i < l.nodes.polygon_count; i++) {
        double n[3],
            scale = fmax(fmax(l.info->box_size[0], l.info->box_size[1]), l.info->box_size[2]);
        if ((sides[i] < 6 && i % 3) || length_of(l.area[i]) < 1e-7 * scale * scale)
            /* omits polygons because the definition is slow, and slivers, whose normals are only
             * rounding errors */
            continue;
        expect(&l, sides, i, n);
        for (int k = 0; k < 3; k++)
            ck_assert_msg(fabs((double)l.normals[3 * i + (uint64_t)k] - n[k]) < 1e-4,
                          "%s, polygon %d of side %d: %g, expected %g", solids[_i], (int)i,
                          sides[i], (double)l.normals[3 * i + (uint64_t)k], n[k]);
        cell_faces += sides[i] < 6;
        lent += sides[i] < 6 && fabs(n[sides[i] / 2]) < 0.99;
    }
    ck_assert(_i == 2 ? cell_faces > 0 : cell_faces > 8 && lent > cell_faces / 4);
    free(sides);
    release(&l);
}
END_TEST

/* Nearly all cell faces by area, visible and hidden, have outward normals. */
START_TEST(test_lod_normals_of_sphere_cell_faces)
{
    level l = take(ebpo_test_make("sphere"), 4, 3);
    double right = 0, all = 0;
    for (uint64_t i = 0; i < l.nodes.polygon_count; i++) {
        double at[3] = { 0, 0, 0 }, cosine = 0;
        int side = side_of(&l, i);
        for (unsigned c = 0; c < l.nodes.corners[i]; c++)
            for (int k = 0; k < 3; k++)
                at[k] += corner_of(&l, i, c)[k] - l.info->box_origin[k] - l.info->box_size[k] / 2;
        if (side == 6 || (side % 2 ? 1 : -1) * at[side / 2] < 0.2 * length_of(at))
            continue;
        for (int k = 0; k < 3; k++)
            cosine += at[k] / length_of(at) * (double)l.normals[3 * i + (uint64_t)k];
        all += length_of(l.area[i]);
        right += cosine > 0.9 ? length_of(l.area[i]) : 0;
    }
    ck_assert_msg(right > 0.95 * all, "%g of %g", right, all);
    release(&l);
}
END_TEST

/* Normals do not depend on the unit of length, however small or large the model is. */
START_TEST(test_lod_normals_of_extreme_sizes)
{
    level l = take(ebpo_test_make("torus"), 4, 3);
    ebpo_error error = EBPO_ERROR_INIT;
    ebpo_info info = *l.info;
    float *normals = space(3 * l.nodes.polygon_count, sizeof *normals);
    for (int power = -900; power <= 900; power += 1800) {
        double *xyz = l.mesh.xyz64;
        l.mesh.xyz64 = space(3 * l.mesh.vertex_count, sizeof *xyz);
        for (uint64_t i = 0; i < 3 * l.mesh.vertex_count; i++)
            l.mesh.xyz64[i] = ldexp(xyz[i], power);
        for (int k = 0; k < 3; k++) {
            info.box_origin[k] = ldexp(l.info->box_origin[k], power);
            info.box_size[k] = ldexp(l.info->box_size[k], power);
        }
        ck_assert_int_eq(ebpo_lod_normals(&info, &l.mesh, &l.nodes, normals, &error), EBPO_OK);
        ck_assert(memcmp(normals, l.normals, 3 * l.nodes.polygon_count * sizeof *normals) == 0);
        free(l.mesh.xyz64);
        l.mesh.xyz64 = xyz;
    }
    free(normals);
    release(&l);
}
END_TEST

START_TEST(test_lod_normals_refuse_other_level)
{
    level l = take(ebpo_test_make("sphere"), 4, 2);
    ebpo_error error = EBPO_ERROR_INIT;
    l.mesh.face_count--;
    ck_assert_int_eq(ebpo_lod_normals(l.info, &l.mesh, &l.nodes, l.normals, &error),
                     EBPO_E_ARGUMENT);
    ck_assert_ptr_nonnull(strstr(error.message, "pass nodes and mesh of one level"));
    l.mesh.face_count++;
    double *corners = l.mesh.xyz64;
    l.mesh.xyz64 = NULL;
    ck_assert_int_eq(ebpo_lod_normals(l.info, &l.mesh, &l.nodes, l.normals, &error),
                     EBPO_E_ARGUMENT);
    ck_assert_ptr_nonnull(strstr(error.message, "float coordinates"));
    l.mesh.xyz64 = corners;
    release(&l);
}
END_TEST

TEST_SUITE(lod_normals)
{
    Suite *suite = suite_create("lod_normals");
    TCase *cases = tcase_create("lod_normals");
    tcase_set_timeout(cases, 120);
    tcase_add_checked_fixture(cases, make_folder, scratch_leave);
    tcase_add_loop_test(cases, test_lod_normals_match_definition, 0, 3);
    tcase_add_test(cases, test_lod_normals_of_sphere_cell_faces);
    tcase_add_test(cases, test_lod_normals_of_extreme_sizes);
    tcase_add_test(cases, test_lod_normals_refuse_other_level);
    suite_add_tcase(suite, cases);
    return suite;
}
