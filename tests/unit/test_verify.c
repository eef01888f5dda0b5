/* Tests the verifier with correct trees, and with trees that have one error each. Each error is
 * detected by the correct kind of check. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <ebpo/build.h>

#include "check_main.h"
#include "solids.h"
#include "verify/verify_parts.h"

static ebpo_tree tree; /* the tree of the current test */
static ebpo_tally tally;

static void build_mesh(ebpo_mesh *mesh, uint32_t leaf_faces, ebpo_rule rule,
                       ebpo_repair_record repair_record)
{
    ebpo_error error = EBPO_ERROR_INIT;
    ebpo_mesh_report report;
    ck_assert_msg(ebpo_mesh_check(mesh, 1, (ebpo_progress){ 0 }, &report, &error) == EBPO_OK, "%s",
                  error.message);
    ebpo_build_options options = EBPO_BUILD_OPTIONS_INIT;
    options.leaf_faces = leaf_faces;
    options.rule = rule;
    options.threads = 1;
    options.parts |= EBPO_PART_LEAF_PLANES;
    ck_assert_msg(ebpo_build(mesh, &report, &repair_record, &options, &tree, &error) == EBPO_OK,
                  "%s", error.message);
}

static void build(const char *name, uint32_t leaf_faces, ebpo_rule rule)
{
    ebpo_mesh mesh = ebpo_test_make(name);
    build_mesh(&mesh, leaf_faces, rule, (ebpo_repair_record){ 0 });
}

static void verify_with(unsigned threads)
{
    ebpo_error error = EBPO_ERROR_INIT;
    ebpo_verify_options options = EBPO_VERIFY_OPTIONS_INIT;
    options.threads = threads;
    memset(&tally, 0, sizeof tally);
    ck_assert_msg(ebpo_verify_tree(&tally, &tree, &options, &error) == EBPO_OK, "%s",
                  error.message);
}

static void expect_fine(const char *what)
{
    verify_with(2);
    for (int kind = 0; kind < EBPO_VERIFY_KINDS; kind++)
        ck_assert_msg(tally.violations[kind] == 0, "%s: kind %d: %llu violations, first: %s", what,
                      kind, (unsigned long long)tally.violations[kind], tally.first[kind]);
}

/* Expects that a mutation is detected in this kind, at the same position for any number of threads,
 * and frees the tree. */
static void expect_caught(ebpo_verify_kind kind, const char *text)
{
    static ebpo_verify_report one = EBPO_VERIFY_REPORT_INIT, three = EBPO_VERIFY_REPORT_INIT;
    verify_with(1);
    ebpo_tally_report(&tally, &one);
    verify_with(3);
    ebpo_tally_report(&tally, &three);
    ck_assert(memcmp(&one, &three, sizeof one) == 0);
    ck_assert_msg(tally.violations[kind] > 0, "not caught: %s", text);
    ck_assert_uint_le(tally.violations[kind], tally.checks[kind]);
    ck_assert_msg(strstr(tally.first[kind], text) != NULL, "'%s' is not in '%s'", text,
                  tally.first[kind]);
    ebpo_tree_free(&tree);
}

static int type_of(int l, uint64_t group, unsigned octant)
{
    return tree.level[l].types[group] >> 2 * octant & 3;
}

static void set_type(int l, uint64_t group, unsigned octant, int type)
{
    uint16_t *types = &tree.level[l].types[group];
    *types = (uint16_t)((*types & ~(3u << 2 * octant)) | (unsigned)type << 2 * octant);
}

/* A level with a node of this type, its index, and its rank. */
typedef struct position {
    int level;
    uint64_t group, rank;
    unsigned octant;
} position;

static position find_from(int first_level, int type)
{
    for (int l = first_level; l < tree.info.level_count; l++)
        for (uint64_t group = 0; group < tree.level[l].group_count; group++)
            for (unsigned octant = 0; octant < (l ? 8u : 1u); octant++)
                if (type_of(l, group, octant) == type)
                    return (position){ l, group, 0, octant };
    ck_abort_msg("no node of type %d", type);
    return (position){ 0 };
}

static void recount(int l)
{
    uint64_t count[4] = { 0 };
    for (uint64_t group = 0; group < tree.level[l].group_count; group++)
        for (unsigned octant = 0; octant < (l ? 8u : 1u); octant++)
            count[type_of(l, group, octant)]++;
    tree.info.level[l].white_count = tree.level[l].white_count = count[EBPO_WHITE];
    tree.info.level[l].black_count = tree.level[l].black_count = count[EBPO_BLACK];
    ck_assert_uint_eq(count[EBPO_LEAF], tree.level[l].leaf_count);
    ck_assert_uint_eq(count[EBPO_GRAY], tree.level[l].gray_count);
}

START_TEST(test_verify_built_solids)
{
    static const uint32_t limits[] = { 0, 1, 16, 1000000 };
    for (int i = 0; i < ebpo_test_solid_count; i++)
        for (int j = 0; j < 4; j++) {
            if (ebpo_test_scale() < 1 && (i + j) % 2)
                continue; /* two of the four trees of each solid */
            build(ebpo_test_solids[i].name, limits[j], (ebpo_rule)(j % 3));
            expect_fine(ebpo_test_solids[i].name);
            ebpo_tree_free(&tree);
        }
}
END_TEST

START_TEST(test_verify_runs_every_check)
{
    build("sphere", 8, EBPO_RULE_NONZERO);
    expect_fine("sphere");
    ck_assert_uint_gt(tally.checks[EBPO_VERIFY_STRUCTURE], 1000);
    ck_assert_uint_gt(tally.checks[EBPO_VERIFY_CONTAINMENT], 10000);
    ck_assert_uint_gt(tally.checks[EBPO_VERIFY_NESTING], 1000);
    ck_assert_uint_gt(tally.checks[EBPO_VERIFY_LABELS], 1000);
    ck_assert_uint_gt(tally.checks[EBPO_VERIFY_LISTS], 1000);
    ebpo_tree_free(&tree);
}
END_TEST

/* Lowers the offset by `steps`: the half-space shrinks. */
static void shrink(uint32_t *code, uint32_t steps)
{
    uint32_t q = *code >> 20;
    *code = (*code & 0xfffff) | (q > steps ? q - steps : 0) << 20;
}

START_TEST(test_verify_detects_gray_plane_cutting_faces)
{
    for (int l = 0; l < 3; l++) {
        build("sphere", 8, EBPO_RULE_NONZERO);
        ck_assert_uint_gt(tree.level[l].plane_count, 0);
        shrink(&tree.level[l].planes[0], 4);
        char place[48];
        snprintf(place, sizeof place, "level %d, octcode 0o1", l);
        expect_caught(EBPO_VERIFY_CONTAINMENT, place);
    }
}
END_TEST

START_TEST(test_verify_detects_leaf_plane_cutting_faces)
{
    build("torus", 8, EBPO_RULE_NONZERO);
    int l = 0;
    while (tree.level[l].leaf_plane_count == 0)
        ck_assert_int_lt(++l, tree.info.level_count);
    shrink(&tree.level[l].leaf_planes[0], 100);
    expect_caught(EBPO_VERIFY_CONTAINMENT, "plane 0");
}
END_TEST

/* Gives the first gray node of a level one more plane. */
static void add_plane(int l, uint32_t code)
{
    ebpo_level *level = &tree.level[l];
    level->planes = realloc(level->planes, (level->plane_count + 1) * sizeof *level->planes);
    memmove(level->planes + 1, level->planes, level->plane_count * sizeof *level->planes);
    level->planes[0] = code;
    level->plane_counts[0]++;
    tree.info.level[l].plane_count = ++level->plane_count;
}

START_TEST(test_verify_detects_plane_cutting_corner)
{
    /* The middle of the box is inside and far from faces. It is corner 7 of the lowest cell of
     * level 1. The normal is (170, 170, 171). */
    build("box_subdivided", 8, EBPO_RULE_NONZERO);
    ck_assert_int_eq(type_of(1, 0, 0), EBPO_GRAY);
    add_plane(1, 681u | 681u << 10 | 4094u << 20);
    verify_with(1);
    ck_assert_uint_eq(tally.violations[EBPO_VERIFY_CONTAINMENT], 1);
    expect_caught(EBPO_VERIFY_CONTAINMENT,
                  "level 1, octcode 0o10, plane 0: the plane cuts off corner 7");
}
END_TEST

START_TEST(test_verify_detects_code_without_plane)
{
    build("sphere", 8, EBPO_RULE_NONZERO);
    tree.level[1].planes[0] |= 4095u << 20;
    expect_caught(EBPO_VERIFY_NESTING, "plane 0");
    build("sphere", 8, EBPO_RULE_NONZERO);
    tree.level[0].planes[0] = 1023;
    expect_caught(EBPO_VERIFY_NESTING, "level 0, octcode 0o1, plane 0");
}
END_TEST

START_TEST(test_verify_detects_swapped_black_and_white)
{
    build("sphere", 8, EBPO_RULE_NONZERO);
    position white = find_from(1, EBPO_WHITE);
    set_type(white.level, white.group, white.octant, EBPO_BLACK);
    recount(white.level);
    expect_caught(EBPO_VERIFY_LABELS, "octcode 0o1");
    build("sphere", 8, EBPO_RULE_NONZERO);
    position black = find_from(1, EBPO_BLACK);
    set_type(black.level, black.group, black.octant, EBPO_WHITE);
    recount(black.level);
    expect_caught(EBPO_VERIFY_LABELS, "octcode 0o1");
}
END_TEST

START_TEST(test_verify_detects_wrong_winding_numbers)
{
    build("sphere", 8, EBPO_RULE_NONZERO);
    position leaf = find_from(0, EBPO_LEAF);
    tree.level[leaf.level].leaf_winding[0] += 1;
    expect_caught(EBPO_VERIFY_LABELS, "winding number");
    build("sphere", 8, EBPO_RULE_NONZERO);
    position black = find_from(0, EBPO_BLACK);
    ebpo_level *level = &tree.level[black.level];
    ck_assert(level->black_winding == NULL);
    level->black_winding = malloc(level->black_count * sizeof(int32_t));
    for (uint64_t i = 0; i < level->black_count; i++)
        level->black_winding[i] = i == 0 ? 2 : 1;
    expect_caught(EBPO_VERIFY_LABELS, "winding number");
    build("sphere", 8, EBPO_RULE_NONZERO);
    position white = find_from(0, EBPO_WHITE);
    level = &tree.level[white.level];
    level->white_winding = calloc(level->white_count, sizeof(int32_t));
    level->white_winding[0] = INT32_MIN;
    expect_caught(EBPO_VERIFY_LABELS, "winding number -2147483648");
}
END_TEST

START_TEST(test_verify_detects_wrong_inside_rule)
{
    ebpo_mesh mesh = ebpo_test_sphere((double[3]){ 0, 0, 0 }, 2, 3),
              inner = ebpo_test_sphere((double[3]){ 0, 0, 0 }, 1, 3);
    ebpo_test_append(&mesh, &inner);
    ebpo_mesh_free(&inner);
    build_mesh(&mesh, 8, EBPO_RULE_NONZERO, (ebpo_repair_record){ 0 });
    tree.info.rule = EBPO_RULE_EVENODD;
    expect_caught(EBPO_VERIFY_LABELS, "outside by the file's rule");
}
END_TEST

/* Removes the last reference from the first leaf that has one. */
static void drop_reference(void)
{
    for (int l = 0; l < tree.info.level_count; l++) {
        ebpo_level *level = &tree.level[l];
        uint64_t end = 0;
        for (uint64_t leaf = 0; leaf < level->leaf_count; leaf++) {
            end += level->leaf_ref_count[leaf];
            if (level->leaf_ref_count[leaf] == 0)
                continue;
            memmove(level->leaf_refs + end - 1, level->leaf_refs + end,
                    (level->ref_count - end) * sizeof *level->leaf_refs);
            level->leaf_ref_count[leaf]--;
            tree.info.level[l].ref_count = --level->ref_count;
            return;
        }
    }
}

START_TEST(test_verify_detects_missing_list_face)
{
    build("sphere", 8, EBPO_RULE_NONZERO);
    drop_reference();
    expect_caught(EBPO_VERIFY_LISTS, "the face touches the leaf, which does not list it");
}
END_TEST

START_TEST(test_verify_detects_swapped_leaf_and_white)
{
    build("sphere", 8, EBPO_RULE_NONZERO);
    for (int l = 1; l < tree.info.level_count; l++)
        for (uint64_t group = 0; group < tree.level[l].group_count; group++)
            for (unsigned i = 0; i < 8; i++)
                for (unsigned j = 0; j < 8; j++)
                    if (type_of(l, group, i) == EBPO_LEAF && type_of(l, group, j) == EBPO_WHITE) {
                        set_type(l, group, i, EBPO_WHITE);
                        set_type(l, group, j, EBPO_LEAF);
                        expect_caught(EBPO_VERIFY_LISTS, "face");
                        return;
                    }
    ck_abort_msg("no such siblings");
}
END_TEST

START_TEST(test_verify_detects_misplaced_subtrees)
{
    build("torus", 8, EBPO_RULE_NONZERO);
    ebpo_level *level = &tree.level[tree.info.level_count - 1];
    uint64_t other = 1;
    while (level->types[other] == level->types[0])
        ck_assert_uint_lt(++other, level->group_count);
    uint16_t first = level->types[0];
    level->types[0] = level->types[other];
    level->types[other] = first;
    expect_caught(EBPO_VERIFY_LISTS, "level");
}
END_TEST

START_TEST(test_verify_detects_unsorted_references)
{
    build("sphere", 8, EBPO_RULE_NONZERO);
    for (int l = 0; l < tree.info.level_count; l++)
        if (tree.level[l].ref_count && tree.level[l].leaf_ref_count[0] >= 2) {
            tree.level[l].leaf_refs[1] = tree.level[l].leaf_refs[0];
            expect_caught(EBPO_VERIFY_STRUCTURE, "are not ascending");
            return;
        }
    position leaf = find_from(0, EBPO_LEAF);
    tree.level[leaf.level].leaf_refs[0] = UINT32_MAX;
    expect_caught(EBPO_VERIFY_STRUCTURE, "are not ascending");
}
END_TEST

START_TEST(test_verify_detects_new_faces_in_wrong_leaf)
{
    build("sphere", 8, EBPO_RULE_NONZERO);
    for (int l = 0; l < tree.info.level_count; l++)
        for (uint64_t leaf = 0; leaf < tree.level[l].leaf_count; leaf++)
            if (tree.level[l].leaf_new[leaf] > 1) {
                tree.level[l].leaf_new[leaf]--;
                tree.info.level[l].new_count = --tree.level[l].new_count;
                verify_with(1);
                ck_assert_uint_gt(tally.violations[EBPO_VERIFY_LISTS], 0);
                expect_caught(EBPO_VERIFY_STRUCTURE, "new faces do not follow");
                return;
            }
    ck_abort_msg("no such leaf");
}
END_TEST

START_TEST(test_verify_detects_shifted_box)
{
    build("sphere", 8, EBPO_RULE_NONZERO);
    tree.info.box_origin[1] += tree.info.box_size[1] / 16;
    expect_caught(EBPO_VERIFY_STRUCTURE, "not strictly inside the root box");
    build("sphere", 8, EBPO_RULE_NONZERO);
    tree.info.box_origin[0] -= tree.info.box_size[0];
    tree.info.box_size[0] *= 2;
    expect_caught(EBPO_VERIFY_LISTS, "face");
    build("sphere", 8, EBPO_RULE_NONZERO);
    tree.info.box_size[2] = NAN;
    expect_caught(EBPO_VERIFY_STRUCTURE, "dyadic");
}
END_TEST

static void move_vertex(uint64_t i, double by)
{
    for (int k = 0; k < 3; k++) {
        double middle = tree.info.box_origin[k] + tree.info.box_size[k] / 2;
        tree.mesh.xyz64[3 * i + (uint64_t)k] +=
            by * (middle - tree.mesh.xyz64[3 * i + (uint64_t)k]);
    }
}

START_TEST(test_verify_detects_moved_vertex)
{
    build("sphere", 8, EBPO_RULE_NONZERO);
    move_vertex(7, 0.5);
    expect_caught(EBPO_VERIFY_LISTS, "face");
    /* the tree has one leaf, so that only its planes are affected */
    build("sphere", 1000000, EBPO_RULE_NONZERO);
    shrink(&tree.level[0].leaf_planes[0], 2);
    expect_caught(EBPO_VERIFY_CONTAINMENT, "level 0");
    build("sphere", 8, EBPO_RULE_NONZERO);
    tree.mesh.xyz64[5] = INFINITY;
    expect_caught(EBPO_VERIFY_STRUCTURE, "not finite");
}
END_TEST

START_TEST(test_verify_detects_flipped_face)
{
    build("sphere", 8, EBPO_RULE_NONZERO);
    ebpo_test_turn_face(&tree.mesh, 3);
    verify_with(1);
    ck_assert_uint_gt(tally.violations[EBPO_VERIFY_LABELS], 0);
    expect_caught(EBPO_VERIFY_STRUCTURE, "do not cancel");
    build("sphere", 8, EBPO_RULE_NONZERO);
    ebpo_test_reverse(&tree.mesh);
    expect_caught(EBPO_VERIFY_LABELS, "winding number");
}
END_TEST

START_TEST(test_verify_detects_contradicting_header)
{
    static const struct {
        size_t offset;
        const char *text;
    } fields[] = { { offsetof(ebpo_level_summary, gray_count), "counts of nodes" },
                   { offsetof(ebpo_level_summary, leaf_count), "counts of nodes" },
                   { offsetof(ebpo_level_summary, plane_count), "counts of planes" },
                   { offsetof(ebpo_level_summary, new_count), "counts of faces" },
                   { offsetof(ebpo_level_summary, ref_count), "counts of faces" },
                   { offsetof(ebpo_level_summary, gray_volume), "volumes" } };
    for (size_t i = 0; i < sizeof fields / sizeof *fields; i++) {
        build("sphere", 8, EBPO_RULE_NONZERO);
        ((unsigned char *)&tree.info.level[1])[fields[i].offset] ^= 64;
        expect_caught(EBPO_VERIFY_STRUCTURE, fields[i].text);
    }
    build("sphere", 8, EBPO_RULE_NONZERO);
    tree.info.level[0].gray_volume = tree.level[0].gray_volume = 1e9;
    expect_caught(EBPO_VERIFY_STRUCTURE, "do not fit their cells");
    build("sphere", 8, EBPO_RULE_NONZERO);
    tree.info.face_count++;
    expect_caught(EBPO_VERIFY_STRUCTURE, "the header states");
}
END_TEST

START_TEST(test_verify_detects_wrong_node_sizes)
{
    build("sphere", 8, EBPO_RULE_NONZERO);
    tree.info.leaf_faces = 2;
    expect_caught(EBPO_VERIFY_STRUCTURE, "more faces than leaf_faces");
    build("sphere", 8, EBPO_RULE_NONZERO);
    tree.info.leaf_faces = 64;
    expect_caught(EBPO_VERIFY_STRUCTURE, "the node is gray");
    build("sphere", 8, EBPO_RULE_NONZERO);
    tree.info.max_level = 1;
    expect_caught(EBPO_VERIFY_STRUCTURE, "a node at the maximum level is gray");
}
END_TEST

START_TEST(test_verify_detects_surface_with_inside)
{
    build("sphere", 8, EBPO_RULE_NONZERO);
    tree.info.solid = false;
    expect_caught(EBPO_VERIFY_STRUCTURE, "a surface has no winding numbers");
    /* two triangles: cells away from both, and so from their caps, are white */
    ebpo_mesh far = ebpo_test_tetrahedron(1);
    far.face_count = 1;
    uint32_t a = ebpo_test_append_vertex(&far, 20, 20, 20),
             b = ebpo_test_append_vertex(&far, 19, 20, 20),
             c = ebpo_test_append_vertex(&far, 20, 19, 20);
    ebpo_test_append_face(&far, a, b, c);
    build_mesh(&far, 1, EBPO_RULE_NONZERO, (ebpo_repair_record){ 0 });
    position white = find_from(1, EBPO_WHITE);
    set_type(white.level, white.group, white.octant, EBPO_BLACK);
    recount(white.level);
    expect_caught(EBPO_VERIFY_STRUCTURE, "a surface has no inside");
}
END_TEST

START_TEST(test_verify_detects_inconsistent_arrays)
{
    build("sphere", 8, EBPO_RULE_NONZERO);
    tree.info.level_count--;
    expect_caught(EBPO_VERIFY_STRUCTURE, "the last one, has gray nodes");
    build("sphere", 8, EBPO_RULE_NONZERO);
    tree.level[1].plane_counts[0]++;
    expect_caught(EBPO_VERIFY_STRUCTURE, "counts of planes sum");
    build("sphere", 8, EBPO_RULE_NONZERO);
    tree.mesh.faces[4] = UINT32_MAX;
    expect_caught(EBPO_VERIFY_STRUCTURE, "vertices that do not exist");
    build("sphere", 8, EBPO_RULE_NONZERO);
    position leaf = find_from(0, EBPO_LEAF);
    tree.level[leaf.level].leaf_first[0] = UINT64_MAX - 1;
    expect_caught(EBPO_VERIFY_STRUCTURE, "it lists faces that the mesh lacks");
    build("sphere", 8, EBPO_RULE_NONZERO);
    position gray = find_from(1, EBPO_GRAY);
    set_type(gray.level, gray.group, gray.octant, EBPO_WHITE);
    expect_caught(EBPO_VERIFY_STRUCTURE, "do not add up");
}
END_TEST

START_TEST(test_verify_sampled_labels_cover_all_levels)
{
    build("sphere", 1, EBPO_RULE_NONZERO);
    verify_with(1);
    uint64_t all = tally.checks[EBPO_VERIFY_LABELS];
    ebpo_verify_options options = EBPO_VERIFY_OPTIONS_INIT;
    options.label_samples = 50;
    memset(&tally, 0, sizeof tally);
    ck_assert(ebpo_verify_tree(&tally, &tree, &options, NULL) == EBPO_OK);
    ck_assert_uint_lt(tally.checks[EBPO_VERIFY_LABELS], all);
    ck_assert_uint_eq(tally.violations[EBPO_VERIFY_LABELS], 0);
    ebpo_tree_free(&tree);
}
END_TEST

START_TEST(test_verify_real_models)
{
    const char *folder = getenv("EBPO_MODELS");
    static const char *names[] = { "fertility",     "selfint_A",   "twin7081_right",
                                   "cad_adis16480", "cheese_g133", "office_chair" };
    for (size_t i = 0; folder && i < sizeof names / sizeof *names; i++) {
        char path[4096];
        snprintf(path, sizeof path, "%s/%s.ply", folder, names[i]);
        ebpo_mesh mesh;
        if (ebpo_mesh_read(path, NULL, &mesh, NULL) != EBPO_OK)
            continue; /* the folder may contain only some of the models */
        build_mesh(&mesh, 16, EBPO_RULE_NONZERO, (ebpo_repair_record){ 0 });
        expect_fine(names[i]);
        ebpo_tree_free(&tree);
    }
}
END_TEST

TEST_SUITE(verify)
{
    TCase *tests = tcase_create("verify");
    tcase_set_timeout(tests, 300);
    tcase_add_test(tests, test_verify_built_solids);
    tcase_add_test(tests, test_verify_runs_every_check);
    tcase_add_test(tests, test_verify_detects_gray_plane_cutting_faces);
    tcase_add_test(tests, test_verify_detects_leaf_plane_cutting_faces);
    tcase_add_test(tests, test_verify_detects_plane_cutting_corner);
    tcase_add_test(tests, test_verify_detects_code_without_plane);
    tcase_add_test(tests, test_verify_detects_swapped_black_and_white);
    tcase_add_test(tests, test_verify_detects_wrong_winding_numbers);
    tcase_add_test(tests, test_verify_detects_wrong_inside_rule);
    tcase_add_test(tests, test_verify_detects_missing_list_face);
    tcase_add_test(tests, test_verify_detects_swapped_leaf_and_white);
    tcase_add_test(tests, test_verify_detects_misplaced_subtrees);
    tcase_add_test(tests, test_verify_detects_unsorted_references);
    tcase_add_test(tests, test_verify_detects_new_faces_in_wrong_leaf);
    tcase_add_test(tests, test_verify_detects_shifted_box);
    tcase_add_test(tests, test_verify_detects_moved_vertex);
    tcase_add_test(tests, test_verify_detects_flipped_face);
    tcase_add_test(tests, test_verify_detects_contradicting_header);
    tcase_add_test(tests, test_verify_detects_wrong_node_sizes);
    tcase_add_test(tests, test_verify_detects_surface_with_inside);
    tcase_add_test(tests, test_verify_detects_inconsistent_arrays);
    tcase_add_test(tests, test_verify_sampled_labels_cover_all_levels);
    tcase_add_test(tests, test_verify_real_models);
    Suite *suite = suite_create("verify");
    suite_add_tcase(suite, tests);
    return suite;
}
