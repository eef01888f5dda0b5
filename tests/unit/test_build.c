/* Tests the builder: trees keep the guarantees for readers, for solids of every kind. test_verify
 * checks envelopes and labels. */
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <sys/resource.h>

#include <ebpo/build.h>

#include "check_main.h"
#include "core/workspace.h"
#include "scratch.h"
#include "solids.h"

static ebpo_status build_with(ebpo_tree *tree, ebpo_mesh mesh, const ebpo_build_options *options)
{
    ebpo_mesh_report report;
    ebpo_error error = EBPO_ERROR_INIT;
    ebpo_status status = ebpo_mesh_check(&mesh, 1, (ebpo_progress){ NULL, NULL }, &report, &error);
    ck_assert_msg(status == EBPO_OK, "%s", error.message);
    return ebpo_build(&mesh, &report, NULL, options, tree, &error);
}

static ebpo_tree build(ebpo_mesh mesh, const ebpo_build_options *options)
{
    ebpo_tree tree;
    ck_assert_int_eq(build_with(&tree, mesh, options), EBPO_OK);
    return tree;
}

static unsigned type_at(const ebpo_level *level, uint64_t node)
{
    return level->types[node / 8] >> 2 * (node % 8) & 3;
}

static void assert_counts(const ebpo_tree *tree)
{
    for (int i = 0; i < tree->info.level_count; i++) {
        const ebpo_level *l = &tree->level[i];
        uint64_t count[4] = { 0 }, nodes = i ? 8 * l->group_count : 1;
        for (uint64_t n = 0; n < nodes; n++)
            count[type_at(l, n)]++;
        ck_assert_uint_eq(count[EBPO_WHITE], l->white_count);
        ck_assert_uint_eq(count[EBPO_BLACK], l->black_count);
        ck_assert_uint_eq(count[EBPO_LEAF], l->leaf_count);
        ck_assert_uint_eq(count[EBPO_GRAY], l->gray_count);
        ck_assert_uint_eq(l->group_count, i ? tree->level[i - 1].gray_count : 1);
    }
    ck_assert_uint_eq(tree->level[tree->info.level_count - 1].gray_count, 0);
}

/* Checks that each face is new exactly once, in the first leaf that lists the face, and that no
 * list repeats a face. */
static void assert_lists(const ebpo_tree *tree)
{
    uint8_t *seen = calloc(tree->mesh.face_count + 1, 1);
    ck_assert_ptr_nonnull(seen);
    for (int i = 0; i < tree->info.level_count; i++) {
        const ebpo_level *l = &tree->level[i];
        uint64_t ref = 0, last = 0;
        for (uint64_t n = 0; n < l->leaf_count; n++) {
            ck_assert_uint_ge(l->leaf_first[n], last);
            last = l->leaf_first[n] + l->leaf_new[n];
            for (uint64_t f = l->leaf_first[n]; f < last; f++)
                ck_assert_uint_eq(seen[f]++, 0);
            for (uint32_t r = 0; r < l->leaf_ref_count[n]; r++, ref++) {
                ck_assert_uint_lt(l->leaf_refs[ref], l->leaf_first[n]);
                ck_assert(r == 0 || l->leaf_refs[ref] > l->leaf_refs[ref - 1]);
            }
            ck_assert(tree->info.border_inside || l->leaf_new[n] + l->leaf_ref_count[n] > 0);
            if (i < tree->info.max_level)
                ck_assert_uint_le(l->leaf_new[n] + l->leaf_ref_count[n], tree->info.leaf_faces);
        }
    }
    for (uint64_t f = 0; f < tree->mesh.face_count; f++)
        ck_assert_uint_eq(seen[f], 1);
    free(seen);
}

/* Checks that the mesh of the tree is the source, renumbered. */
static void assert_same_mesh(const ebpo_tree *tree, const ebpo_mesh *source)
{
    ck_assert_uint_eq(tree->mesh.vertex_count, source->vertex_count);
    ck_assert_uint_eq(tree->mesh.face_count, source->face_count);
    for (uint64_t v = 0; v < source->vertex_count; v++)
        ck_assert_mem_eq(tree->mesh.xyz64 + 3 * v,
                         source->xyz64 + 3 * (uint64_t)tree->vertex_source[v], 24);
    for (uint64_t f = 0; f < source->face_count; f++)
        for (uint64_t k = 0; k < 3; k++)
            ck_assert_uint_eq(tree->vertex_source[tree->mesh.faces[3 * f + k]],
                              source->faces[3 * (uint64_t)tree->face_source[f] + k]);
}

static double level_volume(const ebpo_tree *tree, int level)
{
    double cell = tree->info.box_size[0] * tree->info.box_size[1] * tree->info.box_size[2], sum = 0;
    for (int i = 0; i <= level; i++, cell /= 8)
        sum += tree->level[i].leaf_volume + (double)tree->level[i].black_count * cell;
    return sum + tree->level[level].gray_volume;
}

/* Returns true when all winding numbers are below 2: then the integral of the winding number is the
 * volume of the solid. */
static bool single_shell_everywhere(const ebpo_tree *tree)
{
    for (int i = 0; i < tree->info.level_count; i++) {
        const ebpo_level *l = &tree->level[i];
        if (l->black_winding)
            return false;
        for (uint64_t n = 0; n < l->leaf_count; n++)
            if (l->leaf_winding[n] > 1)
                return false;
    }
    return true;
}

START_TEST(test_trees_of_all_solids_are_consistent)
{
    const ebpo_test_solid *solid = &ebpo_test_solids[_i];
    for (uint32_t leaf_faces = 0; leaf_faces <= 16; leaf_faces += 8) {
        ebpo_build_options options = EBPO_BUILD_OPTIONS_INIT;
        options.leaf_faces = leaf_faces;
        options.max_level = leaf_faces ? -1 : 4;
        ebpo_mesh source = solid->make();
        ebpo_tree tree = build(solid->make(), &options);
        ck_assert_int_eq(tree.info.solid, solid->balanced);
        assert_counts(&tree);
        assert_lists(&tree);
        if (source.xyz64)
            assert_same_mesh(&tree, &source);
        for (int i = 1; i < tree.info.level_count; i++)
            ck_assert_double_le(level_volume(&tree, i), level_volume(&tree, i - 1) * (1 + 1e-9));
        if (solid->balanced && isfinite(solid->volume) && solid->volume > 0 &&
            single_shell_everywhere(&tree))
            ck_assert_double_ge(level_volume(&tree, tree.info.level_count - 1),
                                solid->volume * (1 - 1e-9));
        ebpo_tree_free(&tree);
        ebpo_mesh_free(&source);
    }
}
END_TEST

static void assert_equal_trees(const ebpo_tree *a, const ebpo_tree *b)
{
    ck_assert_int_eq(a->info.level_count, b->info.level_count);
    for (int i = 0; i < a->info.level_count; i++) {
        const ebpo_level *x = &a->level[i], *y = &b->level[i];
        ck_assert_uint_eq(x->group_count, y->group_count);
        ck_assert_mem_eq(x->types, y->types, x->group_count * 2);
        ck_assert_uint_eq(x->plane_count, y->plane_count);
        if (x->plane_count)
            ck_assert_mem_eq(x->planes, y->planes, x->plane_count * 4);
        ck_assert_uint_eq(x->ref_count, y->ref_count);
        if (x->ref_count)
            ck_assert_mem_eq(x->leaf_refs, y->leaf_refs, x->ref_count * 4);
        ck_assert(x->gray_volume == y->gray_volume && x->leaf_volume == y->leaf_volume);
    }
    ck_assert_mem_eq(a->mesh.faces, b->mesh.faces, a->mesh.face_count * 12);
    ck_assert_mem_eq(a->face_source, b->face_source, a->mesh.face_count * 4);
}

START_TEST(test_build_same_for_any_threads)
{
    double centre[3] = { 0, 0, 0 };
    ebpo_build_options options = EBPO_BUILD_OPTIONS_INIT;
    options.threads = 1;
    ebpo_tree one = build(ebpo_test_sphere(centre, 1, 5), &options);
    options.threads = 7;
    ebpo_tree seven = build(ebpo_test_sphere(centre, 1, 5), &options);
    assert_equal_trees(&one, &seven);
    ebpo_tree_free(&one);
    ebpo_tree_free(&seven);
}
END_TEST

START_TEST(test_maximum_level_follows_equation_3)
{
    /* The sides of a cube of side 1 are cut into n x n squares with edges of 1/n and diagonals. At
     * some level L / 2^i is less than their mean. */
    double low[3] = { 0, 0, 0 }, high[3] = { 1, 1, 1 };
    for (uint32_t n = 1; n <= 32; n *= 2) {
        ebpo_mesh mesh = ebpo_test_box(low, high, n);
        ebpo_mesh_report report;
        ck_assert_int_eq(ebpo_mesh_check(&mesh, 1, (ebpo_progress){ NULL, NULL }, &report, NULL),
                         EBPO_OK);
        int expected = 1;
        while (ldexp(1, -expected) >= report.mean_edge)
            expected++;
        ebpo_tree tree = build(mesh, NULL);
        ck_assert_int_eq(tree.info.max_level, expected);
        ebpo_tree_free(&tree);
    }
}
END_TEST

START_TEST(test_build_levels_zero_and_twenty)
{
    ebpo_build_options options = EBPO_BUILD_OPTIONS_INIT;
    options.max_level = 0;
    ebpo_tree tree = build(ebpo_test_make("tetrahedron"), &options);
    ck_assert_int_eq(tree.info.level_count, 1);
    ck_assert_uint_eq(tree.level[0].leaf_count, 1);
    ebpo_tree_free(&tree);
    options.max_level = 20;
    options.leaf_faces = 2; /* three faces meet at a corner: the tree reaches its maximum depth
                             * there */
    tree = build(ebpo_test_make("tetrahedron"), &options);
    ck_assert_int_eq(tree.info.level_count, 21);
    assert_counts(&tree);
    assert_lists(&tree);
    ebpo_tree_free(&tree);
}
END_TEST

START_TEST(test_build_refuses_too_many_cells)
{
    ebpo_build_options options = EBPO_BUILD_OPTIONS_INIT;
    options.max_level = 20;
    options.leaf_faces = 0;
    ebpo_tree tree;
    ck_assert_int_eq(build_with(&tree, ebpo_test_make("tetrahedron"), &options), EBPO_E_LIMIT);
}
END_TEST

START_TEST(test_require_solid_refuses_surface)
{
    ebpo_build_options options = EBPO_BUILD_OPTIONS_INIT;
    options.require_solid = true;
    ebpo_tree tree;
    ck_assert_int_eq(build_with(&tree, ebpo_test_sheet(1, 4), &options), EBPO_E_NOT_SOLID);
    options.require_solid = false;
    ck_assert_int_eq(build_with(&tree, ebpo_test_sheet(1, 4), &options), EBPO_OK);
    ck_assert(!tree.info.solid);
    for (int i = 0; i < tree.info.level_count; i++)
        ck_assert_uint_eq(tree.level[i].black_count, 0);
    ebpo_tree_free(&tree);
}
END_TEST

static ebpo_mesh two_spheres(double shift)
{
    double a[3] = { 0, 0, 0 }, b[3] = { shift, 0, 0 };
    ebpo_mesh mesh = ebpo_test_sphere(a, 1, 3), other = ebpo_test_sphere(b, 1, 3);
    ebpo_test_append(&mesh, &other);
    ebpo_mesh_free(&other);
    return mesh;
}

static double black_volume(const ebpo_tree *tree)
{
    double cell = tree->info.box_size[0] * tree->info.box_size[1] * tree->info.box_size[2], sum = 0;
    for (int i = 0; i < tree->info.level_count; i++, cell /= 8)
        sum += (double)tree->level[i].black_count * cell;
    return sum;
}

START_TEST(test_gray_nodes_near_cell_corners)
{
    /* Found by trial: faces of this tetrahedron are so close to cell corners that they are listed
     * at a node but not below it. */
    static const double corners[4][3] = {
        { 0x1.67aea7c6db494p-2, 0x1.32011afef3792p-1, 0x1.919bdc2a4022fp-1 },
        { 0x1.f842fe606bc34p-2, -0x1.856424e430e74p-2, 0x1.b45abf9f65a79p-1 },
        { 0x1.b7f319f3fdce0p-2, 0x1.b3d56d74263ebp-5, 0x1.a4cb893fcf7c9p-1 },
        { 0x1.678f38ecc0a48p-2, 0x1.3210eb60a9d0fp-1, 0x1.919b1b66b5d7cp-1 }
    };
    static const uint32_t faces[4][3] = { { 0, 2, 1 }, { 0, 1, 3 }, { 0, 3, 2 }, { 1, 2, 3 } };
    ebpo_mesh mesh = { .vertex_count = 4,
                       .face_count = 4,
                       .xyz64 = malloc(sizeof corners),
                       .faces = malloc(sizeof faces) };
    memcpy(mesh.xyz64, corners, sizeof corners);
    memcpy(mesh.faces, faces, sizeof faces);
    ebpo_build_options options = EBPO_BUILD_OPTIONS_INIT;
    options.max_level = 3;
    options.leaf_faces = 1;
    ebpo_tree tree = build(mesh, &options);
    assert_counts(&tree);
    assert_lists(&tree);
    for (int i = 1; i < tree.info.level_count; i++)
        for (uint64_t g = 0; g < tree.level[i].group_count; g++) {
            unsigned filled = 0;
            for (uint64_t o = 0; o < 8; o++)
                filled += type_at(&tree.level[i], 8 * g + o) >= EBPO_LEAF;
            ck_assert_uint_gt(filled, 0);
        }
    ebpo_tree_free(&tree);
}
END_TEST

START_TEST(test_build_rules_differ_in_overlapping_shells)
{
    double volume[3];
    for (int rule = 0; rule < 3; rule++) {
        ebpo_build_options options = EBPO_BUILD_OPTIONS_INIT;
        options.rule = (ebpo_rule)rule;
        options.max_level = 6;
        ebpo_tree tree = build(two_spheres(0.7), &options);
        volume[rule] = black_volume(&tree);
        ebpo_tree_free(&tree);
    }
    ck_assert_double_eq(volume[EBPO_RULE_NONZERO], volume[EBPO_RULE_POSITIVE]);
    ck_assert_double_lt(volume[EBPO_RULE_EVENODD], 0.8 * volume[EBPO_RULE_NONZERO]);
}
END_TEST

START_TEST(test_build_bad_options_leave_nothing)
{
    ebpo_build_options options = EBPO_BUILD_OPTIONS_INIT;
    options.max_level = 21;
    ebpo_tree tree;
    ck_assert_int_eq(build_with(&tree, ebpo_test_make("tetrahedron"), &options), EBPO_E_ARGUMENT);
    ck_assert_ptr_null(tree.mesh.faces);
}
END_TEST

/* Page faults of this process before and after a stage. */
typedef struct stage_faults {
    long before, after;
} stage_faults;

static bool count_faults(void *user, const char *stage, uint64_t done, uint64_t total)
{
    stage_faults *t = user;
    struct rusage usage;
    (void)done, (void)total;
    ck_assert_int_eq(getrusage(RUSAGE_SELF, &usage), 0);
    if (strcmp(stage, "joining levels") == 0 && !t->before)
        t->before = usage.ru_minflt;
    if (strcmp(stage, "numbering vertices") == 0 && !t->after)
        t->after = usage.ru_minflt;
    return true;
}

/* The pieces are in files here, and are joined in one pass with 8,500 to 10,400 page faults. A
 * pass for each array of each level would have 38,500. */
START_TEST(test_joining_levels_reads_pieces_once)
{
#if defined __SANITIZE_ADDRESS__ || defined __SANITIZE_THREAD__
    return; /* their own memory has faults, too */
#endif
    ebpo_build_options options = EBPO_BUILD_OPTIONS_INIT;
    ebpo_error error = EBPO_ERROR_INIT;
    ebpo_mesh mesh = ebpo_test_torus(2, 0.7, 400, 300);
    ebpo_tree tree;
    stage_faults faults = { 0, 0 };
    ck_assert(ebpo_workspace_make_any(&mesh.workspace, 1 << 20, scratch(NULL), &error) == EBPO_OK);
    ebpo_workspace *w = mesh.workspace;
    options.threads = 1;
    options.progress = (ebpo_progress){ count_faults, &faults };
    ck_assert_int_eq(build_with(&tree, mesh, &options), EBPO_OK);
    ck_assert_int_lt(faults.after - faults.before, 16000);
    ebpo_tree_free(&tree);
    ebpo_workspace_free(w);
}
END_TEST

TEST_SUITE(build)
{
    Suite *suite = suite_create("build");
    TCase *tests = tcase_create("build");
    tcase_set_timeout(tests, 600);
    tcase_add_loop_test(tests, test_trees_of_all_solids_are_consistent, 0, ebpo_test_solid_count);
    tcase_add_test(tests, test_build_same_for_any_threads);
    tcase_add_test(tests, test_maximum_level_follows_equation_3);
    tcase_add_test(tests, test_build_levels_zero_and_twenty);
    tcase_add_test(tests, test_build_refuses_too_many_cells);
    tcase_add_test(tests, test_require_solid_refuses_surface);
    tcase_add_test(tests, test_gray_nodes_near_cell_corners);
    tcase_add_test(tests, test_build_rules_differ_in_overlapping_shells);
    tcase_add_test(tests, test_build_bad_options_leave_nothing);
    tcase_add_test(tests, test_joining_levels_reads_pieces_once);
    suite_add_tcase(suite, tests);
    return suite;
}
