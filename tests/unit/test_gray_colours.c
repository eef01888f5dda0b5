/* Colours of envelopes: all builders and the verifier compute the same colours, subsets keep these,
 * and levels and streams return them. */
#include <stdlib.h>
#include <string.h>

#include <ebpo/build.h>
#include <ebpo/lod.h>
#include <ebpo/stream.h>
#include <ebpo/subset.h>
#include <ebpo/verify.h>

#include "mesh/attributes.h"
#include "core/workspace.h"
#include "check_main.h"
#include "scratch.h"
#include "solids.h"
#include "verify/verify_parts.h"

/* Fills an attribute with random bytes. `columns`: names such as "red green blue". */
static void paint(ebpo_mesh *mesh, const char *element, uint64_t rows, uint64_t seed, bool flat)
{
    ebpo_attribute like = { .type = EBPO_ATTRIBUTE_UINT8,
                            .list = EBPO_ATTRIBUTE_NO_LIST,
                            .columns = 3 };
    if (!mesh->attributes)
        mesh->attributes = ebpo_attributes_make(mesh->workspace);
    strcpy(like.element, element);
    strcpy(like.names, "red green blue");
    ebpo_attribute *a = ebpo_attributes_add(mesh->attributes, &like);
    ck_assert(a && ebpo_attribute_reserve(mesh->workspace, a, rows, 3 * rows));
    a->rows = rows;
    for (uint64_t i = 0; i < 3 * rows; i++)
        a->values[i] = flat ? 77 : (uint8_t)(ebpo_test_random(&seed) >> (i % 5 ? 3 : 11));
}

typedef enum what { VERTICES, FACES, BOTH, FACES_AND_FLAT, WHATS, NEITHER = WHATS } what;

static ebpo_mesh painted(const char *solid, what of, ebpo_workspace *workspace)
{
    ebpo_mesh mesh = ebpo_test_make(solid), out = mesh;
    if (workspace) {
        out = (ebpo_mesh){ .vertex_count = mesh.vertex_count,
                           .face_count = mesh.face_count,
                           .workspace = workspace };
        out.xyz64 = ebpo_array_alloc(workspace, mesh.vertex_count, 3 * sizeof(double));
        out.faces = ebpo_array_alloc(workspace, mesh.face_count, 3 * sizeof(uint32_t));
        memcpy(out.xyz64, mesh.xyz64, mesh.vertex_count * 3 * sizeof(double));
        memcpy(out.faces, mesh.faces, mesh.face_count * 3 * sizeof(uint32_t));
        ebpo_mesh_free(&mesh);
    }
    if (of == VERTICES || of == BOTH || of == FACES_AND_FLAT)
        paint(&out, "vertex", out.vertex_count, 5, of == FACES_AND_FLAT);
    if (of != VERTICES && of != NEITHER)
        paint(&out, "face", out.face_count, 9, false);
    return out;
}

static void build(ebpo_tree *tree, ebpo_mesh mesh, unsigned threads)
{
    ebpo_prepared prepared = EBPO_PREPARED_INIT;
    ebpo_prepare_options prepare = EBPO_PREPARE_OPTIONS_INIT;
    ebpo_build_options options = EBPO_BUILD_OPTIONS_INIT;
    ebpo_error error = EBPO_ERROR_INIT;
    prepare.threads = options.threads = threads;
    options.leaf_faces = 4;
    options.parts |= EBPO_PART_LEAF_PLANES;
    ck_assert_msg(ebpo_mesh_prepare(&mesh, &prepare, &prepared, &error) == EBPO_OK, "%s",
                  error.message);
    ck_assert_msg(ebpo_build(&mesh, &prepared.report, &prepared.record, &options, tree, &error) ==
                      EBPO_OK,
                  "%s", error.message);
}

static uint64_t violations(const ebpo_tree *tree)
{
    ebpo_tally tally = { 0 };
    ebpo_verify_options options = EBPO_VERIFY_OPTIONS_INIT;
    ebpo_error error = EBPO_ERROR_INIT;
    ck_assert_msg(ebpo_verify_tree(&tally, tree, &options, &error) == EBPO_OK, "%s", error.message);
    return tally.violations[EBPO_VERIFY_STRUCTURE];
}

START_TEST(test_gray_colours_pass_verification)
{
    ebpo_tree tree;
    build(&tree, painted("torus", (what)_i, NULL), 2);
    ck_assert(tree.info.parts & EBPO_PART_COLOURS);
    ck_assert_uint_eq(violations(&tree), 0);
    for (int level = 0; level < tree.info.level_count; level++)
        for (int bit = 0; tree.level[level].gray_count && bit < 24; bit += 7) {
            uint32_t *last = &tree.level[level].gray_colours[tree.level[level].gray_count - 1];
            *last ^= 1u << bit;
            ck_assert_uint_eq(violations(&tree), 1);
            *last ^= 1u << bit;
        }
    tree.level[1].gray_colours[0] |= 1 << 24;
    ck_assert_uint_ge(violations(&tree), 1);
    ebpo_tree_free(&tree);
}
END_TEST

START_TEST(test_gray_colours_absent_without_colours)
{
    ebpo_tree tree;
    build(&tree, painted("torus", NEITHER, NULL), 1);
    ck_assert(!(tree.info.parts & EBPO_PART_COLOURS) && !tree.level[0].gray_colours);
    ebpo_tree_free(&tree);
}
END_TEST

START_TEST(test_gray_colours_ignore_threads_and_memory)
{
    ebpo_tree one, other;
    ebpo_workspace *workspace = NULL;
    ebpo_workspace_options space = EBPO_WORKSPACE_OPTIONS_INIT;
    ebpo_error error = EBPO_ERROR_INIT;
    ck_assert_msg(ebpo_workspace_new(&space, &workspace, &error) == EBPO_OK, "%s", error.message);
    build(&one, painted("torus", BOTH, NULL), 1);
    build(&other, painted("torus", BOTH, workspace), 3);
    for (int level = 0; level < one.info.level_count; level++)
        if (one.level[level].gray_count)
            ck_assert_mem_eq(one.level[level].gray_colours, other.level[level].gray_colours,
                             one.level[level].gray_count * sizeof(uint32_t));
    ebpo_tree_free(&one);
    ebpo_tree_free(&other);
    ebpo_workspace_free(workspace);
}
END_TEST

static ebpo_file *write_and_open(const ebpo_tree *tree, uint64_t subtree_faces)
{
    ebpo_write_options write = EBPO_WRITE_OPTIONS_INIT;
    ebpo_file *file;
    ebpo_error error = EBPO_ERROR_INIT;
    write.subtree_faces = subtree_faces;
    ck_assert_msg(ebpo_tree_write(tree, scratch("g.ebpo.h5"), &write, &error) == EBPO_OK, "%s",
                  error.message);
    ck_assert_msg(ebpo_open(scratch("g.ebpo.h5"), &file, &error) == EBPO_OK, "%s", error.message);
    return file;
}

/* Returns the colour of a node of a tree, or of its parent if it is not gray. */
static uint32_t colour_of(const ebpo_tree *tree, uint64_t octcode)
{
    int depth = 0;
    uint64_t group = 0;
    uint32_t colour = 0x808080;
    while (octcode >> 3 * (depth + 1))
        depth++;
    for (int level = 0; level <= depth; level++) {
        const ebpo_level *l = &tree->level[level];
        unsigned octant = level ? octcode >> 3 * (depth - level) & 7 : 0;
        uint64_t rank = 0;
        if ((l->types[group] >> 2 * octant & 3) != EBPO_GRAY)
            break;
        for (uint64_t g = 0; g <= group; g++)
            for (unsigned o = 0; o < (g < group ? 8 : octant); o++)
                rank += (l->types[g] >> 2 * o & 3) == EBPO_GRAY;
        colour = l->gray_colours[rank];
        group = rank;
    }
    return colour;
}

START_TEST(test_gray_colours_in_levels_and_streams)
{
    ebpo_tree tree;
    ebpo_error error = EBPO_ERROR_INIT;
    ebpo_lod_options lod = EBPO_LOD_OPTIONS_INIT;
    ebpo_lod_nodes nodes;
    ebpo_mesh mesh;
    ebpo_colours colours;
    build(&tree, painted("torus", FACES, NULL), 1);
    ebpo_file *file = write_and_open(&tree, (uint64_t)_i);
    ck_assert_int_eq(ebpo_lod_level_nodes(file, 3, &lod, &mesh, &nodes, NULL, &error), EBPO_OK);
    ck_assert_int_eq(ebpo_lod_colours(&nodes, mesh.vertex_count, &colours, &error), EBPO_OK);
    uint64_t vertex = 0, different = 0;
    for (uint64_t i = 0; i < nodes.node_count; i++) {
        const ebpo_lod_node *n = &nodes.nodes[i];
        ck_assert_uint_eq(n->coloured, 1);
        ck_assert_uint_eq(n->colour, colour_of(&tree, n->octcode));
        for (uint32_t v = 0; v < n->vertex_count; v++, vertex++) {
            const uint8_t *c = colours.vertex + 4 * vertex;
            ck_assert_uint_eq(c[0] | c[1] << 8 | (uint32_t)c[2] << 16, n->colour);
            ck_assert_uint_eq(c[3], 255);
        }
        different += i && n->colour != n[-1].colour;
    }
    ck_assert(vertex == mesh.vertex_count && different > 4);
    ebpo_colours_free(&colours);
    ck_assert_int_eq(ebpo_lod_colours(&nodes, vertex + 1, &colours, &error), EBPO_E_ARGUMENT);
    ebpo_lod_nodes_free(&nodes);
    ebpo_mesh_free(&mesh);
    ebpo_stream *stream;
    ebpo_stream_options options = EBPO_STREAM_OPTIONS_INIT;
    ebpo_stream_level level;
    ebpo_stream_node node;
    bool more;
    ck_assert_int_eq(ebpo_stream_new(file, &options, &stream, &error), EBPO_OK);
    while (ebpo_stream_next_level(stream, &level, &more, &error) == EBPO_OK && more)
        while (ebpo_stream_next_node(stream, &node, &more, &error) == EBPO_OK && more) {
            ck_assert_uint_eq(node.coloured, 1);
            ck_assert_uint_eq(node.colour, colour_of(&tree, node.octcode));
        }
    ebpo_stream_free(stream);
    ebpo_close(file);
    ebpo_tree_free(&tree);
}
END_TEST

/* Subsets keep the rows. A leaf of the original file has the colour of its parent. */
START_TEST(test_gray_colours_in_subsets)
{
    ebpo_tree tree, part;
    ebpo_error error = EBPO_ERROR_INIT;
    ebpo_subset_options options = EBPO_SUBSET_OPTIONS_INIT;
    build(&tree, painted("torus", VERTICES, NULL), 1);
    ebpo_file *file = write_and_open(&tree, (uint64_t)_i);
    options.boxed = true;
    for (int k = 0; k < 3; k++)
        options.max[k] = 0.1 * tree.info.box_size[k];
    options.parts = EBPO_PART_PLANES | EBPO_PART_COLOURS;
    ck_assert_msg(ebpo_subset(file, scratch("part.ebpo.h5"), &options, &error) == EBPO_OK, "%s",
                  error.message);
    ebpo_close(file);
    ck_assert_int_eq(ebpo_open(scratch("part.ebpo.h5"), &file, &error), EBPO_OK);
    ck_assert_int_eq(ebpo_file_check_content(file, NULL, &error), EBPO_OK);
    ck_assert_int_eq(ebpo_file_read_tree(file, NULL, &part, &error), EBPO_OK);
    ebpo_close(file);
    ck_assert(part.info.pruned && part.info.parts & EBPO_PART_COLOURS);
    uint64_t codes[2][4096] = { { 1 } }, count = 1, former = 0;
    for (int level = 0; level < part.info.level_count && count; level++) {
        uint64_t gray = 0;
        for (uint64_t g = 0; g < part.level[level].group_count; g++)
            for (unsigned o = 0; o < (level ? 8 : 1); o++)
                if ((part.level[level].types[g] >> 2 * o & 3) == EBPO_GRAY) {
                    uint64_t code = level ? codes[level % 2 ^ 1][g] << 3 | o : 1;
                    ck_assert_uint_eq(part.level[level].gray_colours[gray], colour_of(&tree, code));
                    codes[level % 2][gray++] = code;
                }
        former += gray;
        ck_assert_uint_le(count = gray, 4096);
    }
    ck_assert_uint_gt(former, 20);
    ebpo_tree_free(&part);
    ebpo_tree_free(&tree);
}
END_TEST

TEST_SUITE(gray_colours)
{
    Suite *suite = suite_create("gray_colours");
    TCase *tests = tcase_create("gray_colours");
    tcase_set_timeout(tests, 120);
    tcase_add_checked_fixture(tests, scratch_enter, scratch_leave);
    tcase_add_loop_test(tests, test_gray_colours_pass_verification, 0, WHATS);
    tcase_add_test(tests, test_gray_colours_absent_without_colours);
    tcase_add_test(tests, test_gray_colours_ignore_threads_and_memory);
    tcase_add_loop_test(tests, test_gray_colours_in_levels_and_streams, 0, 2);
    tcase_add_loop_test(tests, test_gray_colours_in_subsets, 0, 2);
    suite_add_tcase(suite, tests);
    return suite;
}
