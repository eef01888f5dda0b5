/* Tests faked counts near and beyond 32 bits: the arithmetic is correct for allowed counts, and
 * other counts give EBPO_E_LIMIT before any access. */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/resource.h>
#include <unistd.h>

#include "check_main.h"
#include "hdf5_read/coding.h"
#include "construct/pieces.h"
#include "construct/construct_stages.h"
#include "format/head_facts.h"
#include "format/write_plan.h"
#include "format/slice.h"
#include "derive/export_job.h"
#include "core/strict_fp.h"
#include "levels/lod.h"
#include "mesh/mesh_parts.h"
#include "geometry/cells.h"
#include "random_tree.h"
#include "read_by.h"
#include "scratch.h"
#include "levels/view_cut.h"
#include "query/accel_parts.h"

static const uint64_t TWO32 = UINT64_C(1) << 32;
static const char *path;

/* --- meshes --- */

START_TEST(test_mesh_size_limit_is_checked_first)
{
    static const ebpo_progress silent = { NULL, NULL };
    uint32_t face[3] = { 0, 1, 2 };
    float xyz[9] = { 0, 0, 0, 1, 0, 0, 0, 1, 0 };
    for (int faces = 0; faces < 2; faces++) {
        ebpo_mesh mesh = { .vertex_count = faces ? 3 : TWO32 - 1,
                           .face_count = faces ? TWO32 - 1 : 1,
                           .xyz32 = xyz,
                           .faces = face };
        ebpo_mesh_report report;
        ebpo_error error = EBPO_ERROR_INIT;
        ck_assert_int_eq(ebpo_mesh_check(&mesh, 1, silent, &report, &error), EBPO_E_LIMIT);
        ck_assert_msg(strstr(error.message, "split") != NULL, "%s", error.message);
        ck_assert_int_eq(ebpo_mesh_arrange(&mesh, 1, silent, &error), EBPO_E_LIMIT);
        ck_assert_int_eq(ebpo_mesh_weld(&mesh, NULL, &error), EBPO_E_LIMIT);
        ck_assert_int_eq(ebpo_mesh_orient(&mesh, NULL, &error), EBPO_E_LIMIT);
        ck_assert_int_eq(ebpo_mesh_fill_holes(&mesh, NULL, &error), EBPO_E_LIMIT);
        ck_assert_int_eq(ebpo_mesh_write_ply(&mesh, path, &error), EBPO_E_LIMIT);
        ck_assert_msg(strstr(error.message, "split") != NULL, "%s", error.message);
    }
}
END_TEST

START_TEST(test_octcodes_are_limited_to_level_20)
{
    uint32_t last = (1u << EBPO_MAX_LEVEL) - 1;
    ck_assert_int_eq(EBPO_MAX_LEVEL, 20);
    for (unsigned corner = 0; corner < 8; corner++) {
        ebpo_cell cell = {
            EBPO_MAX_LEVEL, { corner & 1 ? last : 0, corner & 2 ? last : 0, corner & 4 ? last : 0 }
        };
        ebpo_octcode code = ebpo_octcode_of_cell(cell), up = code;
        ck_assert(ebpo_octcode_valid(code));
        ck_assert_int_eq(ebpo_octcode_level(code), EBPO_MAX_LEVEL);
        ebpo_cell back = ebpo_cell_of_octcode(code);
        ck_assert_mem_eq(back.at, cell.at, sizeof cell.at);
        for (int level = EBPO_MAX_LEVEL; level > 0; level--, up = ebpo_octcode_parent(up))
            ck_assert_uint_eq(up & 7, corner);
        ck_assert_uint_eq(up, 1);
        ck_assert(!ebpo_octcode_valid(ebpo_octcode_child(code, 0)));
    }
    ck_assert_uint_eq(ebpo_octcode_first_descendant(1, EBPO_MAX_LEVEL), UINT64_C(1) << 60);
}
END_TEST

START_TEST(test_build_list_limit_does_not_wrap)
{
    ebpo_error error = EBPO_ERROR_INIT;
    uint64_t faces = TWO32 - 2, leaves = (UINT64_C(1) << 22) + 64 * faces,
             entries = (UINT64_C(1) << 26) + 512 * faces;
    ck_assert_int_eq(ebpo_build_check_lists(faces, leaves, entries, &error), EBPO_OK);
    ck_assert_int_eq(ebpo_build_check_lists(faces, leaves + 1, entries, &error), EBPO_E_LIMIT);
    ck_assert_int_eq(ebpo_build_check_lists(faces, leaves, entries + 1, &error), EBPO_E_LIMIT);
    ck_assert_msg(strstr(error.message, "--max-level") != NULL, "%s", error.message);
    ck_assert_int_eq(ebpo_build_check_lists(1, 1, (1 << 26) + 513, &error), EBPO_E_LIMIT);
    ebpo_branch branch = { .node_count = UINT32_MAX - 8, .detail_count = UINT32_MAX - 1 };
    ck_assert_int_eq(ebpo_build_check_branch(&branch, &error), EBPO_OK);
    branch.node_count++;
    ck_assert_int_eq(ebpo_build_check_branch(&branch, &error), EBPO_E_LIMIT);
    branch = (ebpo_branch){ .detail_count = UINT32_MAX };
    ck_assert_int_eq(ebpo_build_check_branch(&branch, &error), EBPO_E_LIMIT);
}
END_TEST

/* --- the container's arithmetic --- */

START_TEST(test_chunk_count_beyond_32_bit_rows)
{
    static const uint64_t counts[] = { (UINT64_C(1) << 32) - 1, UINT64_C(1) << 32,
                                       (UINT64_C(1) << 32) + 1, (UINT64_C(1) << 33) + 5,
                                       UINT64_C(255) << 40,     UINT64_MAX };
    for (size_t i = 0; i < sizeof counts / sizeof *counts; i++) {
        ebpo_shape faces = { .rows = counts[i], .cols = 3, .element_size = 4 },
                   codes = { .rows = counts[i], .element_size = 4 };
        faces.chunk_rows = ebpo_full_chunk_rows(faces.rows, 3, 4);
        codes.chunk_rows = ebpo_full_chunk_rows(codes.rows, 0, 4);
        ck_assert_uint_eq(faces.chunk_rows, 4096);
        ck_assert_uint_eq(codes.chunk_rows, 16384);
        ck_assert_uint_eq(ebpo_shape_chunks(&faces), (counts[i] - 1) / 4096 + 1);
        ck_assert_uint_eq(ebpo_shape_chunks(&codes), (counts[i] - 1) / 16384 + 1);
        ck_assert_uint_eq(ebpo_schema_index_rows(counts[i]), (counts[i] - 1) / EBPO_INDEX_ROWS + 1);
    }
}
END_TEST

/* Makes the header of a solid with so many faces, in a root with one leaf. */
static ebpo_info *head_of(uint64_t vertices, uint64_t faces)
{
    ebpo_info *info = calloc(1, sizeof *info);
    info->parts = EBPO_PART_MESH | EBPO_PART_MAPS | EBPO_PART_PLANES;
    info->vertex_count = info->source_vertex_count = vertices;
    info->face_count = info->source_face_count = faces;
    info->level_count = 1;
    for (int k = 0; k < 3; k++)
        info->box_size[k] = 1;
    info->level[0] = (ebpo_level_summary){ .leaf_count = 1, .new_count = faces };
    return info;
}

static ebpo_status check_head(const ebpo_info *info, ebpo_error *error)
{
    return ebpo_facts_check(info, "head", EBPO_E_FORMAT, error);
}

START_TEST(test_header_counts_limited_to_32_bits)
{
    ebpo_error error = EBPO_ERROR_INIT;
    ebpo_info *info = head_of(TWO32 - 2, TWO32 - 2);
    ck_assert_msg(check_head(info, &error) == EBPO_OK, "%s", error.message);
    ck_assert_uint_eq(ebpo_schema_rows(info, EBPO_A_FACES, 0), TWO32 - 2);
    ck_assert_uint_eq(ebpo_schema_rows(info, EBPO_A_FACES_INDEX, 0), TWO32 / 4096);
    ck_assert_uint_eq(ebpo_schema_rows(info, EBPO_A_VERTEX_SOURCE, 0), TWO32 - 2);
    uint64_t *const limited[] = { &info->vertex_count, &info->source_vertex_count,
                                  &info->source_face_count, &info->repair_record.added_faces,
                                  &info->face_count };
    for (size_t i = 0; i < sizeof limited / sizeof *limited; i++) {
        uint64_t right = *limited[i];
        for (uint64_t wrong = TWO32 - 1; wrong <= TWO32 + 4; wrong++) {
            *limited[i] = wrong;
            ck_assert_int_eq(check_head(info, &error), EBPO_E_FORMAT);
            ck_assert_msg(strstr(error.message, "2^32 - 2") != NULL, "%s", error.message);
        }
        *limited[i] = right;
    }
    free(info);
}
END_TEST

START_TEST(test_header_level_counts_use_64_bits)
{
    ebpo_error error = EBPO_ERROR_INIT;
    ebpo_info *info = head_of(TWO32 - 2, TWO32 - 2);
    /* More than 2^33 leaves and 2^35 references below 2^31 gray nodes: valid counts beyond 32
     * bits. */
    info->max_level = info->grid_level = 20;
    info->level_count = 13;
    info->level[0] = (ebpo_level_summary){ .gray_count = 1 };
    uint64_t grays = 1;
    for (int level = 1; level < 12; level++, grays = info->level[level - 1].gray_count)
        info->level[level] = (ebpo_level_summary){ .gray_count = grays * 7, .white_count = grays };
    info->level[12] = (ebpo_level_summary){ .leaf_count = grays * 8,
                                            .new_count = TWO32 - 2,
                                            .ref_count = UINT64_C(1) << 35 };
    info->level[11].plane_count = grays * 255;
    ck_assert_uint_gt(info->level[12].leaf_count, UINT64_C(1) << 33);
    ck_assert_uint_gt(info->level[11].plane_count, UINT64_C(1) << 38);
    ck_assert_msg(check_head(info, &error) == EBPO_OK, "%s", error.message);
    ck_assert_uint_eq(ebpo_schema_rows(info, EBPO_A_LEAF_REFS, 12), UINT64_C(1) << 35);
    ck_assert_uint_eq(ebpo_schema_rows(info, EBPO_A_PLANES, 11), grays * 255);
    ck_assert_uint_eq(ebpo_schema_rows(info, EBPO_A_LEAF_INDEX, 12), (grays * 8 - 1) / 4096 + 1);
    info->level[11].plane_count++;
    ck_assert_int_eq(check_head(info, &error), EBPO_E_FORMAT);
    info->level[11].plane_count--;
    info->level[12].leaf_count += TWO32; /* in 32 bits the count would be the same */
    ck_assert_int_eq(check_head(info, &error), EBPO_E_FORMAT);
    free(info);
}
END_TEST

START_TEST(test_index_rows_sum_beyond_32_bits)
{
    enum { LEAVES = 2 * EBPO_INDEX_ROWS + 1, EACH = 1 << 20 };
    uint64_t *first = calloc(LEAVES, sizeof *first);
    uint32_t *news = calloc(LEAVES, sizeof *news), *refs = calloc(LEAVES, sizeof *refs);
    for (int i = 0; i < LEAVES; i++) {
        refs[i] = EACH;
        first[i] = (uint64_t)i * EACH / 4;
        news[i] = EACH / 4;
    }
    ebpo_level level = {
        .leaf_count = LEAVES, .leaf_first = first, .leaf_new = news, .leaf_ref_count = refs
    };
    uint64_t *index = ebpo_index_leaves(&level);
    ck_assert_uint_eq(index[3 * 1 + 1], TWO32);
    ck_assert_uint_eq(index[3 * 2 + 1], 2 * TWO32);
    ck_assert_uint_eq(index[3 * 2], TWO32 / 2);
    free(index);
    free(first);
    free(news);
    free(refs);
}
END_TEST

START_TEST(test_index_encodings_near_32_bit_limit)
{
    uint32_t faces[6] = { UINT32_MAX - 3, 0, UINT32_MAX - 2, 1u << 31, 7, UINT32_MAX - 4 }, back[6];
    uint64_t seen = TWO32 - 4;
    uint8_t file[24];
    ck_assert(ebpo_corners_encode(faces, 2, &seen, file));
    ck_assert_uint_eq(seen, TWO32 - 2);
    seen = TWO32 - 4;
    ck_assert(ebpo_corners_decode(file, 2, &seen, back));
    ck_assert_mem_eq(faces, back, sizeof faces);
    ebpo_numbers_encode(faces, 6, file);
    ebpo_numbers_decode(file, 6, back);
    ck_assert_mem_eq(faces, back, sizeof faces);
    uint32_t refs[3] = { 0, 0, 4294967290u }; /* gaps: first - 1, first - 2, 1 */
    ck_assert(ebpo_refs_decode(refs, 3, TWO32 - 2));
    ck_assert_uint_eq(refs[2], UINT32_MAX - 2);
    ck_assert_uint_eq(refs[0], 1);
    refs[0] = UINT32_MAX - 1;
    ck_assert(!ebpo_refs_decode(refs, 1, TWO32 - 2));
}
END_TEST

/* A header that states 2^32 - 2 source vertices and faces for a small mesh must not make a reader
 * allocate memory for them. */
START_TEST(test_huge_source_counts_take_no_memory)
{
    random_tree_options options = { 5, 5, 8, 9, true, false, false, false };
    ebpo_error error = EBPO_ERROR_INIT;
    struct rusage before, after;
    ebpo_tree tree;
    ebpo_file *file;
    ebpo_mesh mesh;
    bool ordered;
    random_tree_make(&tree, &options);
    tree.info.source_vertex_count = tree.info.source_face_count = TWO32 - 2;
    tree.vertex_source[tree.info.vertex_count - 1] = UINT32_MAX - 2; /* the greatest source index */
    ck_assert_msg(ebpo_tree_write(&tree, path, NULL, &error) == EBPO_OK, "%s", error.message);
    ck_assert_msg(ebpo_open(path, &file, &error) == EBPO_OK, "%s", error.message);
    getrusage(RUSAGE_SELF, &before);
    ck_assert_msg(ebpo_file_read_source_mesh(file, READ_BY(1), &mesh, &ordered, &error) == EBPO_OK,
                  "%s", error.message);
    getrusage(RUSAGE_SELF, &after);
    ck_assert(ordered);
    /* in KiB; a number for each vertex and face would take 16 GiB; sanitizers also need memory */
    ck_assert_int_lt(after.ru_maxrss - before.ru_maxrss, 1 << 20);
    uint64_t last = mesh.vertex_count - 1;
    size_t size = tree.mesh.xyz32 ? 3 * sizeof(float) : 3 * sizeof(double);
    ck_assert_mem_eq(tree.mesh.xyz32 ? (void *)(mesh.xyz32 + 3 * last)
                                     : (void *)(mesh.xyz64 + 3 * last),
                     tree.mesh.xyz32 ? (void *)(tree.mesh.xyz32 + 3 * last)
                                     : (void *)(tree.mesh.xyz64 + 3 * last),
                     size);
    ebpo_mesh_free(&mesh);
    ebpo_close(file);
    ebpo_tree_free(&tree);
}
END_TEST

START_TEST(test_slice_reference_limit)
{
    ebpo_compact compact;
    ebpo_error error = EBPO_ERROR_INIT;
    ck_assert_int_eq(ebpo_compact_make(&compact, (UINT64_C(1) << 31) + 1, &error), EBPO_E_LIMIT);
    ck_assert_int_eq(ebpo_compact_make(&compact, TWO32 + 4, &error), EBPO_E_LIMIT);
}
END_TEST

/* --- subtrees --- */

/* Returns a slice of one leaf whose faces are in no array. */
static ebpo_slice leaf_slice(uint16_t *types, uint64_t *first, uint32_t *news, uint32_t *refs)
{
    ebpo_slice slice = { .root = { .type = EBPO_LEAF }, .level_count = 1, .face_count = *news };
    *types = EBPO_LEAF;
    slice.level[0] = (ebpo_level){ .types = types,
                                   .group_count = 1,
                                   .leaf_count = 1,
                                   .leaf_first = first,
                                   .leaf_new = news,
                                   .leaf_ref_count = refs };
    slice.mesh.face_count = *news;
    return slice;
}

START_TEST(test_subtree_block_limit)
{
    uint16_t types;
    uint64_t first = 0;
    uint32_t news = 4096, refs = 0;
    ebpo_layout layout;
    ebpo_error error = EBPO_ERROR_INIT;
    ebpo_slice slice = leaf_slice(&types, &first, &news, &refs);
    ck_assert_uint_eq((uint64_t)EBPO_BLOCKS_MAX * EBPO_BLOCK, TWO32);
    ck_assert_int_eq(ebpo_layout_make(&layout, &slice, 512, &error), EBPO_OK);
    ck_assert_uint_eq(layout.block_count, 512);
    ebpo_layout_free(&layout);
    ck_assert_int_eq(ebpo_layout_make(&layout, &slice, 511, &error), EBPO_E_LIMIT);
    ck_assert_msg(strstr(error.message, "budget") != NULL, "%s", error.message);
}
END_TEST

/* Returns a slice with separately allocated arrays, as these are freed. */
static ebpo_slice fake_slice(void)
{
    uint16_t *types = malloc(sizeof *types);
    uint64_t *first = calloc(1, sizeof *first);
    uint32_t *news = calloc(1, sizeof *news), *refs = calloc(1, sizeof *refs);
    *news = 1;
    ebpo_slice slice = leaf_slice(types, first, news, refs);
    slice.mesh.vertex_count = 3;
    slice.mesh.xyz32 = calloc(9, sizeof *slice.mesh.xyz32);
    slice.mesh.faces = malloc(3 * sizeof *slice.mesh.faces);
    memcpy(slice.mesh.faces, (uint32_t[3]){ 0, 1, 2 }, 12);
    return slice;
}

START_TEST(test_subtree_count_limit)
{
    ebpo_error error = EBPO_ERROR_INIT;
    ebpo_accel *subtree;
    ebpo_info *info = head_of(3, 1);
    info->solid = false;
    ebpo_slice slice = fake_slice();
    ck_assert_msg(ebpo_accel_make(&subtree, &slice, info, EBPO_ACCEL_PLANES, 1, &error) == EBPO_OK,
                  "%s", error.message);
    ebpo_accel_free(subtree);
    slice = fake_slice();
    slice.mesh.face_count = UINT64_C(1) << 31; /* faces are numbered in 31 bits */
    ck_assert_int_eq(ebpo_accel_make(&subtree, &slice, info, EBPO_ACCEL_PLANES, 1, &error),
                     EBPO_E_LIMIT);
    slice = fake_slice();
    slice.level[0].plane_count = TWO32; /* planes are numbered in 32 bits */
    ck_assert_int_eq(ebpo_accel_make(&subtree, &slice, info, EBPO_ACCEL_PLANES, 1, &error),
                     EBPO_E_LIMIT);
    ck_assert_msg(strstr(error.message, "planes") != NULL, "%s", error.message);
    slice = fake_slice();
    slice.level[1].leaf_count = slice.level[1].group_count =
        EBPO_ENTRY_ZERO; /* nodes are numbered in 29 bits */
    slice.level_count = 2;
    ck_assert_int_eq(ebpo_accel_make(&subtree, &slice, info, EBPO_ACCEL_PLANES, 1, &error),
                     EBPO_E_LIMIT);
    ck_assert_msg(strstr(error.message, "nodes") != NULL, "%s", error.message);
    free(info);
}
END_TEST

START_TEST(test_huge_memory_estimates_do_not_wrap)
{
    uint64_t keep, peak;
    ebpo_info *info = head_of(TWO32 - 2, TWO32 - 2);
    ebpo_slice_size size = { .groups = UINT64_C(1) << 33,
                             .leaves = UINT64_C(1) << 34,
                             .refs = UINT64_C(1) << 36,
                             .new_faces = TWO32 - 2,
                             .shared = UINT64_C(1) << 36 };
    ebpo_accel_estimate(&size, info, &keep, &peak);
    ck_assert_uint_gt(keep, size.refs * sizeof(ebpo_listed_block) + size.shared * 72);
    ck_assert_uint_gt(peak, keep);
    free(info);
}
END_TEST

/* --- levels and views --- */

START_TEST(test_lod_vertex_limit_is_checked_first)
{
    ebpo_polyhedra half = { .vertex_count = UINT64_C(1) << 31, .face_count = 5 },
                   faces = { .face_count = UINT64_C(1) << 31 };
    ebpo_polyhedra *vertex_heavy[2] = { &half, &half }, *face_heavy[2] = { &faces, &faces };
    ebpo_mesh mesh;
    ebpo_error error = EBPO_ERROR_INIT;
    ck_assert_int_eq(ebpo_polyhedra_join(&mesh, NULL, vertex_heavy, 2, &error), EBPO_E_LIMIT);
    ck_assert_int_eq(ebpo_polyhedra_join(&mesh, NULL, face_heavy, 2, &error), EBPO_E_LIMIT);
    ck_assert_msg(strstr(error.message, "coarser") != NULL, "%s", error.message);
    ebpo_polytope cube;
    ebpo_polytope_cube(&cube);
    ebpo_polyhedra full = { .vertex_count = TWO32 - 8 };
    ck_assert_int_eq(ebpo_polyhedra_add(&full, &cube, &(ebpo_box){ { 0, 0, 0 }, { 1, 1, 1 }, 0 },
                                        (ebpo_cell){ 0, { 0, 0, 0 } }, EBPO_GRAY, true, &error),
                     EBPO_E_LIMIT);
}
END_TEST

START_TEST(test_view_groups_beyond_32_bits)
{
    enum { NODES = 4 };
    ebpo_frontier frontier = { .at = NULL };
    ebpo_error error = EBPO_ERROR_INIT;
    uint64_t places[EBPO_FRONTIER_BLOCKS];
    ck_assert_int_eq(ebpo_frontier_reserve(&frontier, NODES, &error), EBPO_OK);
    for (uint64_t i = 0; i < NODES; i++) /* in 32 bits the number of blocks would be the same */
        ebpo_frontier_push(&frontier, (ebpo_waiting){ .key = i,
                                                      .octcode = UINT64_C(1) << 48,
                                                      .child_group = i << 38,
                                                      .turn = EBPO_TURN_SEEN });
    ck_assert_uint_eq(ebpo_frontier_blocks(&frontier, EBPO_GROUP_BLOCK, places), NODES);
    ebpo_frontier_free(&frontier);
    ebpo_info *info = head_of(4, 4);
    info->level[0].gray_count = 1;
    ebpo_partial grown = { .group_count = UINT32_MAX };
    ebpo_group *group = calloc(1, sizeof *group);
    group->types = EBPO_GRAY;
    ck_assert_int_eq(ebpo_partial_add(&grown, info, 0, group, &error), EBPO_E_LIMIT);
    ck_assert_msg(strstr(error.message, "more nodes than a view can hold") != NULL, "%s",
                  error.message);
    free(group);
    free(info);
}
END_TEST

/* --- export --- */

START_TEST(test_export_count_limits)
{
    ebpo_error error = EBPO_ERROR_INIT;
    ck_assert_int_eq(ebpo_export_check_glb("a.glb", 1000, TWO32 - 1 - EBPO_GLB_HEADS - 1000,
                                           &error),
                     EBPO_OK);
    ck_assert_int_eq(ebpo_export_check_glb("a.glb", 1001, TWO32 - 1 - EBPO_GLB_HEADS - 1001,
                                           &error),
                     EBPO_E_LIMIT); /* the text is filled up to 1004 */
    ck_assert_int_eq(ebpo_export_check_glb("a.glb", 0, TWO32 + 100, &error), EBPO_E_LIMIT);
    ck_assert_int_eq(ebpo_export_check_glb("a.glb", 0, 12 * (TWO32 - 2) * 2, &error), EBPO_E_LIMIT);
    ck_assert_msg(strstr(error.message, "a.glb") && strstr(error.message, "gltf"), "%s",
                  error.message);
    ck_assert_int_eq(ebpo_export_check_assimp("a.stl", TWO32 - 2, 1431655765, &error), EBPO_OK);
    ck_assert_int_eq(ebpo_export_check_assimp("a.stl", TWO32 - 2, 1431655766, &error),
                     EBPO_E_LIMIT);
    ck_assert_int_eq(ebpo_export_check_assimp("a.stl", TWO32, 5, &error), EBPO_E_LIMIT);
    ck_assert_msg(strstr(error.message, "a.stl") && strstr(error.message, "coarser"), "%s",
                  error.message);
}
END_TEST

static void enter(void)
{
    scratch_enter();
    path = scratch("limits");
}

TEST_SUITE(limits)
{
    Suite *suite = suite_create("limits");
    TCase *tests = tcase_create("limits");
    tcase_set_timeout(tests, 120);
    tcase_add_checked_fixture(tests, enter, scratch_leave);
    tcase_add_test(tests, test_mesh_size_limit_is_checked_first);
    tcase_add_test(tests, test_octcodes_are_limited_to_level_20);
    tcase_add_test(tests, test_build_list_limit_does_not_wrap);
    tcase_add_test(tests, test_chunk_count_beyond_32_bit_rows);
    tcase_add_test(tests, test_header_counts_limited_to_32_bits);
    tcase_add_test(tests, test_header_level_counts_use_64_bits);
    tcase_add_test(tests, test_index_rows_sum_beyond_32_bits);
    tcase_add_test(tests, test_index_encodings_near_32_bit_limit);
    tcase_add_test(tests, test_huge_source_counts_take_no_memory);
    tcase_add_test(tests, test_slice_reference_limit);
    tcase_add_test(tests, test_subtree_block_limit);
    tcase_add_test(tests, test_subtree_count_limit);
    tcase_add_test(tests, test_huge_memory_estimates_do_not_wrap);
    tcase_add_test(tests, test_lod_vertex_limit_is_checked_first);
    tcase_add_test(tests, test_view_groups_beyond_32_bits);
    tcase_add_test(tests, test_export_count_limits);
    suite_add_tcase(suite, tests);
    return suite;
}
