/* Tests selections: those of the theses against reference implementations; the hull for candidate
 * directions; files of every selection, which keep the guarantees; and the lower limit of all
 * envelopes. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include <ebpo/build.h>
#include <ebpo/limit.h>
#include <ebpo/lod.h>
#include <ebpo/verify.h>

#include "core/workspace.h"
#include "check_main.h"
#include "geometry/polytope.h"
#include "construct/planes.h"
#include "scratch.h"
#include "solids.h"

enum { LIMIT = 48 };
static const double unit_cell[3] = { 1, 1, 1 };

/* --- candidates on a sphere inside the cell: each plane cuts something, so that codes identify the
 * chosen ones --- */

static int make_candidates(ebpo_candidate *c, int count, uint64_t *seed)
{
    int made = 0;
    while (made < count) {
        double n[3];
        int32_t v[3], d;
        for (int k = 0; k < 3; k++)
            n[k] = ebpo_test_random_unit(seed) - 0.5;
        if (!ebpo_plane_code_normal(n, &c[made].normal))
            continue;
        ebpo_plane_code_decode(c[made].normal, v, &d);
        bool far = true;
        for (int i = 0; i < made && far; i++) {
            int32_t w[3];
            ebpo_plane_code_decode(c[i].normal, w, &d);
            double dot = (double)v[0] * w[0] + (double)v[1] * w[1] + (double)v[2] * w[2];
            double a = (double)v[0] * v[0] + (double)v[1] * v[1] + (double)v[2] * v[2],
                   b = (double)w[0] * w[0] + (double)w[1] * w[1] + (double)w[2] * w[2];
            far = dot < 0.96 * sqrt(a * b);
        }
        if (!far)
            continue;
        double length = sqrt((double)v[0] * v[0] + (double)v[1] * v[1] + (double)v[2] * v[2]);
        c[made].support = 0.5 * (v[0] + v[1] + v[2]) + 0.3 * length;
        c[made].moved = ebpo_test_random_unit(seed);
        made++;
    }
    return made;
}

static int choose(ebpo_selection selection, const ebpo_choice *choice, bool *chosen)
{
    uint32_t codes[EBPO_PLANES_STORED];
    ebpo_polytope p;
    ebpo_polytope_cube(&p);
    int count = ebpo_selection_function(selection)(&p, choice, codes);
    ck_assert_int_ge(count, 0);
    for (int i = 0; i < choice->count; i++) {
        chosen[i] = false;
        for (int j = 0; j < count; j++)
            chosen[i] = chosen[i] || (codes[j] & 0xfffff) == choice->candidates[i].normal;
    }
    return count;
}

static void angles(uint32_t normal, double *around, double *down)
{
    int32_t v[3], d;
    ebpo_plane_code_decode(normal, v, &d);
    *around = atan2(v[1], v[0]);
    *down = atan2(hypot(v[0], v[1]), v[2]);
}

static double difference(const ebpo_choice *choice, int a, int b)
{
    double aa, ad, ba, bd;
    angles(choice->candidates[a].normal, &aa, &ad);
    angles(choice->candidates[b].normal, &ba, &bd);
    if (choice->normals == EBPO_NORMALS_SPHERICAL)
        return (aa - ba) * (aa - ba) + (ad - bd) * (ad - bd);
    double dot = sin(ad) * sin(bd) * cos(aa - ba) + cos(ad) * cos(bd);
    return 2 - 2 * dot;
}

static double cost(const ebpo_choice *choice, const bool *chosen)
{
    double sum = 0;
    for (int i = 0; i < choice->count; i++) {
        double least = INFINITY;
        for (int m = 0; m < choice->count; m++)
            if (chosen[m])
                least = fmin(least, difference(choice, i, m));
        sum += least;
    }
    return sum;
}

START_TEST(test_kmedoids_swap_is_not_cheaper)
{
    uint64_t seed = 11;
    for (int round = 0; round < 60; round++) {
        ebpo_candidate c[LIMIT];
        bool chosen[LIMIT];
        int count = 3 + (int)(ebpo_test_random(&seed) % 30);
        ebpo_choice choice = { .candidates = c,
                               .count = make_candidates(c, count, &seed),
                               .codes_max = EBPO_PLANES_STORED,
                               .cell_size = unit_cell,
                               .seed = ebpo_test_random(&seed),
                               .wanted = 1 + (int)(ebpo_test_random(&seed) % (uint64_t)count),
                               .normals = round % 2 ? EBPO_NORMALS_ANGLE : EBPO_NORMALS_SPHERICAL };
        ck_assert_int_eq(choose(EBPO_SELECT_KMEDOIDS, &choice, chosen), choice.wanted);
        double reached = cost(&choice, chosen);
        for (int out = 0; out < count; out++)
            for (int in = 0; in < count; in++) {
                if (!chosen[out] || chosen[in])
                    continue;
                chosen[out] = false, chosen[in] = true;
                ck_assert_double_ge(cost(&choice, chosen), reached - 1e-5);
                chosen[out] = true, chosen[in] = false;
            }
    }
}
END_TEST

START_TEST(test_least_offset_selects_least_moved)
{
    uint64_t seed = 12;
    for (int round = 0; round < 50; round++) {
        ebpo_candidate c[LIMIT];
        bool chosen[LIMIT];
        ebpo_choice choice = { .candidates = c,
                               .count = make_candidates(c, 25, &seed),
                               .codes_max = EBPO_PLANES_STORED,
                               .cell_size = unit_cell,
                               .wanted = 1 + round % 25 };
        ck_assert_int_eq(choose(EBPO_SELECT_OFFSET, &choice, chosen), choice.wanted);
        double max_taken = 0, least_left = INFINITY;
        for (int i = 0; i < choice.count; i++)
            if (chosen[i])
                max_taken = fmax(max_taken, c[i].moved);
            else
                least_left = fmin(least_left, c[i].moved);
        ck_assert_double_le(max_taken, least_left);
    }
}
END_TEST

START_TEST(test_random_selection_starts_at_seed_position)
{
    uint64_t seed = 13;
    uint32_t starts = 0;
    ebpo_candidate c[LIMIT];
    ebpo_choice choice = { .candidates = c,
                           .count = make_candidates(c, 20, &seed),
                           .codes_max = EBPO_PLANES_STORED,
                           .cell_size = unit_cell,
                           .wanted = 7 };
    for (int round = 0; round < 200; round++) {
        bool chosen[LIMIT], again[LIMIT];
        choice.seed = ebpo_test_random(&seed);
        ck_assert_int_eq(choose(EBPO_SELECT_RANDOM, &choice, chosen), 7);
        ck_assert_int_eq(choose(EBPO_SELECT_RANDOM, &choice, again), 7);
        ck_assert_mem_eq(chosen, again, sizeof(bool) * 20);
        int begins = 0;
        for (int i = 0; i < 20; i++)
            if (chosen[i] && !chosen[(i + 19) % 20]) {
                begins++;
                starts |= 1u << i;
            }
        ck_assert_int_eq(begins, 1);
    }
    ck_assert_uint_eq(starts, (1u << 20) - 1);
}
END_TEST

/* The run follows the node's order of candidates, not the order in which they are sorted. */
START_TEST(test_random_selection_follows_order_of_node)
{
    uint64_t seed = 17;
    ebpo_candidate c[LIMIT];
    int order[20], place[20];
    ebpo_choice choice = { .candidates = c,
                           .count = make_candidates(c, 20, &seed),
                           .codes_max = EBPO_PLANES_STORED,
                           .order = order,
                           .cell_size = unit_cell,
                           .wanted = 6 };
    for (int i = 0; i < 20; i++) {
        order[i] = 7 * i % 20;
        place[order[i]] = i;
    }
    for (int round = 0; round < 100; round++) {
        bool chosen[LIMIT], at[20] = { false };
        int begins = 0;
        choice.seed = ebpo_test_random(&seed);
        ck_assert_int_eq(choose(EBPO_SELECT_RANDOM, &choice, chosen), 6);
        for (int i = 0; i < 20; i++)
            at[place[i]] = chosen[i];
        for (int i = 0; i < 20; i++)
            begins += at[i] && !at[(i + 19) % 20];
        ck_assert_int_eq(begins, 1);
    }
}
END_TEST

START_TEST(test_plane_counts_match_theses)
{
    ck_assert_int_eq(ebpo_selection_wanted(10, 3, 40, 0), 4);
    ck_assert_int_eq(ebpo_selection_wanted(11, 3, 40, 0), 5); /* rounded up */
    ck_assert_int_eq(ebpo_selection_wanted(1, 0, 10, 0), 1);
    ck_assert_int_eq(ebpo_selection_wanted(0, 0, 40, 0), 0);
    ck_assert_int_eq(ebpo_selection_wanted(1000, 0, 40, 250), 250);
    ck_assert_int_eq(ebpo_selection_wanted(1000, 2, 40, 694), 173);
    ck_assert_int_eq(ebpo_selection_wanted(100, 1, 40, 694), 86);   /* 347, 173.5, 86.75 */
    ck_assert_int_eq(ebpo_selection_wanted(100, 10, 40, 694), 100); /* K below 1 selects all */
    ck_assert_int_eq(ebpo_selection_wanted(1, 0, 40, 694), 1);
    /* the number never exceeds the maximum of the format */
    ck_assert_int_eq(ebpo_selection_wanted(1000, 0, 40, 694), EBPO_PLANES_STORED);
    ck_assert_int_eq(ebpo_selection_wanted(1000, 0, 40, 0), EBPO_PLANES_STORED);
    ck_assert_int_eq(ebpo_selection_wanted(1000, 30, 40, 694), EBPO_PLANES_STORED);
    /* without files there is no limit */
    ck_assert_int_eq(ebpo_selection_requested(10000, 0, 40, 8714), 8714);
    ck_assert_int_eq(ebpo_selection_requested(7287, 0, 40, 8714), 4357);
    ck_assert_int_eq(ebpo_selection_requested(10000, 0, 40, 0), 4000);
}
END_TEST

/* --- the hull --- */

/* Returns true when all points are on one side of the triple, which is then a facet. */
static bool is_facet(const double (*p)[3], int count, int a, int b, int c)
{
    double u[3], v[3];
    for (int k = 0; k < 3; k++) {
        u[k] = p[b][k] - p[a][k];
        v[k] = p[c][k] - p[a][k];
    }
    double n[3] = { u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2],
                    u[0] * v[1] - u[1] * v[0] };
    for (int i = 0; i < count; i++) {
        double height = 0;
        for (int k = 0; k < 3; k++)
            height += n[k] * (p[i][k] - p[a][k]);
        if (height > 1e-12)
            return false;
    }
    return true;
}

START_TEST(test_hull_facets_match_triple_search)
{
    uint64_t seed = 14;
    static ebpo_hull_facet facets[EBPO_HULL_FACETS];
    for (int round = 0; round < 200; round++) {
        double p[24][3];
        int count = 4 + (int)(ebpo_test_random(&seed) % 21), expected = 0;
        for (int i = 0; i < count; i++)
            for (int k = 0; k < 3; k++)
                p[i][k] = ebpo_test_random_unit(&seed);
        for (int a = 0; a < count; a++)
            for (int b = a + 1; b < count; b++)
                for (int c = b + 1; c < count; c++)
                    expected += is_facet((const double(*)[3])p, count, a, b, c) ||
                                is_facet((const double(*)[3])p, count, a, c, b);
        int found = ebpo_hull_facets((const double(*)[3])p, count, 1e-9, facets, EBPO_HULL_FACETS);
        ck_assert_int_eq(found, expected);
        for (int i = 0; i < found; i++)
            ck_assert(is_facet((const double(*)[3])p, count, facets[i].corner[0],
                               facets[i].corner[1], facets[i].corner[2]));
    }
}
END_TEST

START_TEST(test_hull_of_nearly_flat_points)
{
    uint64_t seed = 15;
    for (int round = 0; round < 2000; round++) {
        ebpo_hull_facet facets[2 * 40 + 1];
        double p[40][3], thin = ldexp(1, -(round % 60));
        int space = 4 + round % 77;
        memset(&facets[space], 0x5a, sizeof *facets);
        for (int i = 0; i < 40;
             i++) { /* points on a cylinder, a grid or a plane: inputs with unstable signs */
            double a = 0.1 * (double)(ebpo_test_random(&seed) % 63);
            p[i][0] = round % 3 ? cos(a) : ebpo_test_random_unit(&seed),
            p[i][1] = round % 3 ? sin(a) : ebpo_test_random_unit(&seed),
            p[i][2] = thin * ebpo_test_random_unit(&seed);
        }
        ck_assert_int_le(ebpo_hull_facets((const double(*)[3])p, 40, 1e-9, facets, space), space);
        for (size_t i = 0; i < sizeof *facets; i++)
            ck_assert_int_eq(((const unsigned char *)&facets[space])[i], 0x5a);
    }
}
END_TEST

START_TEST(test_hull_of_flat_points_and_grid)
{
    static ebpo_hull_facet facets[EBPO_HULL_FACETS];
    static double p[EBPO_HULL_POINTS][3];
    ck_assert_int_eq(ebpo_hull_facets((const double(*)[3])p, 3, 1e-9, facets, EBPO_HULL_FACETS), 0);
    /* all points are equal */
    ck_assert_int_eq(ebpo_hull_facets((const double(*)[3])p, 100, 1e-9, facets, EBPO_HULL_FACETS),
                     0);
    for (int i = 0; i < 100; i++)
        p[i][0] = i % 10, p[i][1] = i / 10;
    /* all points are in a plane */
    ck_assert_int_eq(ebpo_hull_facets((const double(*)[3])p, 100, 1e-9, facets, EBPO_HULL_FACETS),
                     0);
    for (int i = 0; i < 512; i++)
        p[i][0] = i % 8, p[i][1] = i / 8 % 8, p[i][2] = i / 64;
    int count = ebpo_hull_facets((const double(*)[3])p, 512, 1e-9, facets, EBPO_HULL_FACETS);
    double area = 0;
    for (int i = 0; i < count; i++) {
        area += facets[i].area;
        int axes = 0;
        for (int k = 0; k < 3; k++)
            axes += fabs(fabs(facets[i].n[k]) - 1) < 1e-12;
        ck_assert_int_eq(axes, 1);
    }
    ck_assert_double_eq_tol(area, 6 * 49, 1e-9);
}
END_TEST

/* --- files --- */

static const char *path;

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

static void write_file(ebpo_mesh mesh, const ebpo_build_options *options)
{
    ebpo_error error = EBPO_ERROR_INIT;
    ebpo_mesh_report facts;
    ebpo_tree tree;
    ck_assert(ebpo_mesh_check(&mesh, 1, (ebpo_progress){ 0 }, &facts, &error) == EBPO_OK);
    ck_assert_msg(ebpo_build(&mesh, &facts, NULL, options, &tree, &error) == EBPO_OK, "%s",
                  error.message);
    ck_assert_msg(ebpo_tree_write(&tree, path, NULL, &error) == EBPO_OK, "%s", error.message);
    ebpo_tree_free(&tree);
}

static ebpo_file *open_file(void)
{
    ebpo_error error = EBPO_ERROR_INIT;
    ebpo_file *file;
    ck_assert_msg(ebpo_open(path, &file, &error) == EBPO_OK, "%s", error.message);
    return file;
}

/* With EBPO_TEST_SCALE below 0.2 only every fourth solid is tested: other compilers and sanitizers
 * check other properties. */
static bool omitted(int solid) { return ebpo_test_scale() < 0.2 && solid % 4; }

START_TEST(test_selections_make_valid_files)
{
    const ebpo_test_solid *solid = &ebpo_test_solids[_i];
    if (omitted(_i))
        return;
    for (int s = _i % 2; s < 2 * EBPO_SELECTION_COUNT;
         s += 2) { /* each solid is tested with every second selection, which halves the time */
        ebpo_build_options options = EBPO_BUILD_OPTIONS_INIT;
        ebpo_error error = EBPO_ERROR_INIT;
        ebpo_verify_report report = EBPO_VERIFY_REPORT_INIT;
        ebpo_mesh mesh = solid->make();
        if (mesh.face_count > 20000) {
            ebpo_mesh_free(&mesh);
            return;
        }
        options.select = (ebpo_selection)(s / 2);
        options.leaf_faces = s % 2 ? 0 : 4;
        options.k_root = s % 2 ? 100 : 0;
        options.normals = s % 2 ? EBPO_NORMALS_ANGLE : EBPO_NORMALS_SPHERICAL;
        options.parts |= EBPO_PART_LEAF_PLANES;
        options.max_level = 5;
        write_file(mesh, &options);
        ebpo_file *file = open_file();
        ck_assert_int_eq(ebpo_file_info(file)->selection, (int)options.select);
        ck_assert_msg(ebpo_verify(file, NULL, &report, &error) == EBPO_OK, "%s", error.message);
        ck_assert_msg(report.violations == 0, "%s, selection %d: %llu violations", solid->name, s,
                      (unsigned long long)report.violations);
        ebpo_close(file);
    }
}
END_TEST

static void digest_of(ebpo_selection select, uint64_t seed, unsigned threads,
                      ebpo_workspace *workspace, uint8_t digest[32])
{
    ebpo_build_options options = EBPO_BUILD_OPTIONS_INIT;
    options.select = select;
    options.seed = seed;
    options.threads = threads;
    options.parts |= EBPO_PART_LEAF_PLANES;
    ebpo_mesh mesh = ebpo_test_torus(2, 0.7, 160, 80); /* more than one subtree */
    mesh.workspace = workspace;
    write_file(mesh, &options);
    ebpo_file *file = open_file();
    memcpy(digest, ebpo_file_info(file)->content_sha256, 32);
    ebpo_close(file);
}

/* Neither the number of threads nor a small memory budget changes a file. */
START_TEST(test_equal_seeds_give_equal_files)
{
    for (int s = 0; s < EBPO_SELECTION_COUNT; s++) {
        uint8_t a[32], b[32], c[32];
        ebpo_workspace *w;
        ebpo_error error = EBPO_ERROR_INIT;
        ebpo_workspace_stats f = EBPO_WORKSPACE_STATS_INIT;
        ck_assert_msg(ebpo_workspace_make_any(&w, 1 << 20, NULL, &error) == EBPO_OK, "%s",
                      error.message);
        digest_of((ebpo_selection)s, 5, 1, NULL, a);
        digest_of((ebpo_selection)s, 5, 3, w, b);
        digest_of((ebpo_selection)s, 6, 2, NULL, c);
        ck_assert_mem_eq(a, b, 32);
        ck_assert(!memcmp(a, c, 32) == !ebpo_selection_describe((ebpo_selection)s)->uses_seed);
        ebpo_workspace_get_stats(w, &f);
        ck_assert(f.filed_total > 0 && f.filed == 0);
        ebpo_workspace_free(w);
    }
}
END_TEST

START_TEST(test_invalid_selection_options_are_refused)
{
    struct {
        ebpo_selection select;
        double percent, k_root;
        int normals;
    } wrong[] = { { EBPO_SELECTION_COUNT, 40, 0, 0 },        { EBPO_SELECT_RANDOM, 0, 0, 0 },
                  { EBPO_SELECT_RANDOM, 101, 0, 0 },         { EBPO_SELECT_RANDOM, NAN, 0, 0 },
                  { EBPO_SELECT_KMEDOIDS, 40, -1, 0 },       { EBPO_SELECT_KMEDOIDS, 40, 0.5, 0 },
                  { EBPO_SELECT_KMEDOIDS, 40, INFINITY, 0 }, { EBPO_SELECT_KMEDOIDS, 40, 0, 2 } };
    for (size_t i = 0; i < sizeof wrong / sizeof *wrong; i++) {
        ebpo_build_options options = EBPO_BUILD_OPTIONS_INIT;
        ebpo_error error = EBPO_ERROR_INIT;
        ebpo_mesh mesh = ebpo_test_tetrahedron(1);
        ebpo_mesh_report facts;
        ebpo_tree tree;
        ck_assert(ebpo_mesh_check(&mesh, 1, (ebpo_progress){ 0 }, &facts, &error) == EBPO_OK);
        options.select = wrong[i].select;
        options.percent = wrong[i].percent;
        options.k_root = wrong[i].k_root;
        options.normals = (ebpo_normal_distance)wrong[i].normals;
        ck_assert_int_eq(ebpo_build(&mesh, &facts, NULL, &options, &tree, &error), EBPO_E_ARGUMENT);
    }
}
END_TEST

/* --- more planes --- */

/* Returns the excess volume at the root, relative to the volume of the solid. */
static double root_excess(const ebpo_build_options *options)
{
    ebpo_error error = EBPO_ERROR_INIT;
    double volume;
    write_file(ebpo_test_torus(2, 0.7, 40, 20), options);
    ebpo_file *file = open_file();
    double solid = ebpo_file_info(file)->report.volume;
    ck_assert(ebpo_lod_level(file, 0, NULL, NULL, &volume, &error) == EBPO_OK);
    ck_assert_uint_le(ebpo_file_info(file)->level[0].plane_count, EBPO_PLANES_STORED);
    ebpo_close(file);
    return volume / solid - 1;
}

/* Greatest share by which a greater number of planes may increase the excess, because clusters of
 * normals are not nested. */
static const double step_may_lose = 0.02;

static void falls(ebpo_build_options *o, double *option, const double *value, int count)
{
    double first = 0, before = INFINITY, now = 0;
    for (int i = 0; i < count; i++) {
        *option = value[i];
        now = root_excess(o);
        ck_assert_msg(now <= before * (1 + step_may_lose),
                      "%s: excess %g with %g, %g with the number before",
                      ebpo_selection_describe(o->select)->name, now, value[i], before);
        before = now;
        first = i ? first : now;
    }
    ck_assert_msg(now < 0.9 * first, "%s: excess %g, then %g",
                  ebpo_selection_describe(o->select)->name, first, now);
}

/* Uses the settings of the theses (BP 2008, tables 3.6 to 3.8; EBP 2017, table 20). The last
 * settings request more planes than a node stores. */
START_TEST(test_more_planes_tighten_root)
{
    static const double percent[] = { 5, 10, 20, 40, 80 }, k_root[] = { 20, 60, 200, 400, 1200 };
    for (int s = 0; s < EBPO_SELECTION_COUNT; s++) {
        ebpo_build_options o = EBPO_BUILD_OPTIONS_INIT;
        if (!ebpo_selection_describe((ebpo_selection)s)->from_leaves)
            continue;
        o.select = (ebpo_selection)s;
        o.max_level = 1;
        o.leaf_faces = 0;
        o.parts |= EBPO_PART_LEAF_PLANES;
        falls(&o, &o.percent, percent, 5);
        if (o.select != EBPO_SELECT_KMEDOIDS)
            continue;
        falls(&o, &o.k_root, k_root, 5);
    }
}
END_TEST

/* --- the limit --- */

static bool has_hulls(ebpo_file *file)
{
    ebpo_limit limit = EBPO_LIMIT_INIT;
    ebpo_error error = EBPO_ERROR_INIT;
    ebpo_status status =
        ebpo_limit_level(file, 0,
                         &(ebpo_limit_options){ sizeof(ebpo_limit_options), 1, { NULL, NULL }, 0 },
                         &limit, &error);
    ck_assert(status == EBPO_OK || status == EBPO_E_ABSENT);
    if (status == EBPO_E_ABSENT)
        fprintf(stderr, "without qhull: the limit is not tested\n");
    return status == EBPO_OK;
}

START_TEST(test_hull_of_convex_solid_fills_levels)
{
    ebpo_mesh meshes[] = { ebpo_test_tetrahedron(2),
                           ebpo_test_sphere((double[3]){ 3, -1, 1e3 }, 0.5, 3),
                           ebpo_test_box((double[3]){ 0, 0, 0 }, (double[3]){ 1, 2, 0.001 }, 4) };
    for (size_t i = 0; i < sizeof meshes / sizeof *meshes; i++) {
        ebpo_build_options options = EBPO_BUILD_OPTIONS_INIT;
        options.leaf_faces = 2;
        write_file(meshes[i], &options);
        ebpo_file *file = open_file();
        const ebpo_info *info = ebpo_file_info(file);
        for (int level = 0; level < info->level_count && has_hulls(file); level++) {
            ebpo_limit limit = EBPO_LIMIT_INIT;
            ebpo_error error = EBPO_ERROR_INIT;
            ck_assert(ebpo_limit_level(file, level,
                                       &(ebpo_limit_options){
                                           sizeof(ebpo_limit_options), 2, { NULL, NULL }, 0 },
                                       &limit, &error) == EBPO_OK);
            ck_assert_msg(fabs(limit.volume / info->report.volume - 1) < 1e-7,
                          "solid %zu, level %d: hulls fill %.9f", i, level,
                          limit.volume / info->report.volume);
        }
        ebpo_close(file);
    }
}
END_TEST

/* Returns the sum of the limits of all levels, which the envelopes must not undercut. */
static double sum_limits(ebpo_file *file)
{
    const ebpo_info *info = ebpo_file_info(file);
    double sum = 0;
    for (int level = 0; level < info->level_count; level++) {
        ebpo_limit_options options = EBPO_LIMIT_OPTIONS_INIT;
        ebpo_limit limit = EBPO_LIMIT_INIT;
        ebpo_error error = EBPO_ERROR_INIT;
        double volume;
        ck_assert(ebpo_limit_level(file, level, &options, &limit, &error) == EBPO_OK);
        ck_assert(ebpo_lod_level(file, level, NULL, NULL, &volume, &error) == EBPO_OK);
        ck_assert_msg(volume >= limit.volume * (1 - 1e-9), "level %d: %g below the limit %g", level,
                      volume, limit.volume);
        sum += limit.volume;
    }
    return sum;
}

/* The limit of a surface with holes is that of a solid but for cells near the holes, if envelopes
 * contain the inside. The border is needed for this limit only. */
START_TEST(test_limit_of_surface_contains_inside)
{
    double sum[3] = { 0, 0, 0 };
    ebpo_error error = EBPO_ERROR_INIT;
    ebpo_limit limit = EBPO_LIMIT_INIT;
    enum { CLOSED, HOLED, FACES_ONLY };
    for (int i = CLOSED; i <= FACES_ONLY; i++) {
        ebpo_build_options options = EBPO_BUILD_OPTIONS_INIT;
        ebpo_mesh mesh = ebpo_test_sphere((double[3]){ 3, -1, 2 }, 0.5, 3);
        options.leaf_faces = 2;
        options.parts &= ~(uint32_t)(i == FACES_ONLY ? EBPO_PART_BORDER : 0);
        mesh.face_count -= i == CLOSED ? 0 : 3;
        write_file(mesh, &options);
        ebpo_file *file = open_file();
        if (!has_hulls(file)) {
            ebpo_close(file);
            return;
        }
        sum[i] = sum_limits(file);
        ebpo_close(file);
    }
    ck_assert_msg(sum[HOLED] > 0.97 * sum[CLOSED] && sum[HOLED] < sum[CLOSED] &&
                      sum[FACES_ONLY] < 0.9 * sum[CLOSED],
                  "closed %g, with a hole %g, faces only %g", sum[CLOSED], sum[HOLED],
                  sum[FACES_ONLY]);

    /* a file without the border still has envelopes that contain the inside */
    ebpo_mesh mesh = ebpo_test_sphere((double[3]){ 3, -1, 2 }, 0.5, 3);
    ebpo_mesh_report facts;
    ebpo_tree tree;
    ebpo_write_options write = EBPO_WRITE_OPTIONS_INIT;
    mesh.face_count -= 3;
    write.parts &= ~(uint32_t)EBPO_PART_BORDER;
    ck_assert(ebpo_mesh_check(&mesh, 1, (ebpo_progress){ 0 }, &facts, &error) == EBPO_OK);
    ck_assert(ebpo_build(&mesh, &facts, NULL, NULL, &tree, &error) == EBPO_OK);
    ck_assert(ebpo_tree_write(&tree, path, &write, &error) == EBPO_OK);
    ebpo_tree_free(&tree);
    ebpo_file *file = open_file();
    ck_assert(ebpo_file_info(file)->border_inside);
    ck_assert_int_eq(ebpo_limit_level(file, 0, NULL, &limit, &error), EBPO_E_ABSENT);
    ck_assert_ptr_nonnull(strstr(error.message, "part border"));
    ebpo_close(file);
}
END_TEST

START_TEST(test_envelope_sizes_are_close_to_limit)
{
    const ebpo_test_solid *solid = &ebpo_test_solids[_i];
    if (!solid->balanced || omitted(_i))
        return;
    for (int s = 0; s < EBPO_SELECTION_COUNT; s += 1 + _i % 3) {
        ebpo_build_options options = EBPO_BUILD_OPTIONS_INIT;
        ebpo_mesh mesh = solid->make();
        if (mesh.face_count > 20000) {
            ebpo_mesh_free(&mesh);
            return;
        }
        options.select = (ebpo_selection)s;
        options.parts |= EBPO_PART_LEAF_PLANES;
        options.max_level = 5;
        write_file(mesh, &options);
        ebpo_file *file = open_file();
        const ebpo_info *info = ebpo_file_info(file);
        double before = INFINITY, root = info->box_size[0] * info->box_size[1] * info->box_size[2];
        for (int level = 0; level < info->level_count && has_hulls(file); level++) {
            ebpo_limit limit = EBPO_LIMIT_INIT;
            ebpo_error error = EBPO_ERROR_INIT;
            double volume;
            ck_assert(ebpo_limit_level(file, level,
                                       &(ebpo_limit_options){
                                           sizeof(ebpo_limit_options), 2, { NULL, NULL }, 0 },
                                       &limit, &error) == EBPO_OK);
            ck_assert(ebpo_lod_level(file, level, NULL, NULL, &volume, &error) == EBPO_OK);
            ck_assert_msg(volume >= limit.volume - 1e-9 * root,
                          "%s, level %d: %g below the limit %g", solid->name, level, volume,
                          limit.volume);
            ck_assert_double_le(volume, before * (1 + 1e-9) + 1e-12 * root);
            /* rounding of offsets to 1/4096 of a cell increases the volume */
            if (s == 0 && level <= 3)
                ck_assert_msg(volume - limit.volume <= 0.03 * root,
                              "%s, level %d: %g where %g is possible", solid->name, level, volume,
                              limit.volume);
            before = volume;
        }
        ebpo_close(file);
    }
}
END_TEST

TEST_SUITE(selections)
{
    Suite *suite = suite_create("selections");
    TCase *tests = tcase_create("choosing"), *files = tcase_create("files"),
          *more = tcase_create("more planes");
    tcase_set_timeout(tests, 300);
    tcase_add_test(tests, test_kmedoids_swap_is_not_cheaper);
    tcase_add_test(tests, test_least_offset_selects_least_moved);
    tcase_add_test(tests, test_random_selection_starts_at_seed_position);
    tcase_add_test(tests, test_random_selection_follows_order_of_node);
    tcase_add_test(tests, test_plane_counts_match_theses);
    tcase_add_test(tests, test_hull_facets_match_triple_search);
    tcase_add_test(tests, test_hull_of_nearly_flat_points);
    tcase_add_test(tests, test_hull_of_flat_points_and_grid);
    tcase_add_test(tests, test_invalid_selection_options_are_refused);
    suite_add_tcase(suite, tests);
    tcase_set_timeout(files, 600);
    tcase_add_checked_fixture(files, enter, leave);
    tcase_add_loop_test(files, test_selections_make_valid_files, 0, ebpo_test_solid_count);
    tcase_add_test(files, test_equal_seeds_give_equal_files);
    tcase_add_test(files, test_hull_of_convex_solid_fills_levels);
    tcase_add_test(files, test_limit_of_surface_contains_inside);
    tcase_add_loop_test(files, test_envelope_sizes_are_close_to_limit, 0, ebpo_test_solid_count);
    suite_add_tcase(suite, files);
    tcase_set_timeout(more, 600);
    tcase_add_checked_fixture(more, enter, leave);
    tcase_add_test(more, test_more_planes_tighten_root);
    suite_add_tcase(suite, more);
    return suite;
}
