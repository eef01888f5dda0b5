/* Compares parts of a file with the whole file: ranges, nodes, subtrees in one piece. */
#include <dirent.h>
#include <pthread.h>
#include <stdint.h>
#include <unistd.h>

#include <ebpo/build.h>

#include "check_main.h"
#include "model_file.h"
#include "read_by.h"
#include "format/chunks.h"
#include "format/file_nodes.h"
#include "format/slice.h"
#include "geometry/level_nodes.h"
#include "random_tree.h"
#include "scratch.h"
#include "solids.h"

static const char *path;

static void make_folder(void)
{
    scratch_enter();
    path = scratch("x.ebpo.h5");
}

/* A file, completely in memory, and the number of nodes of each type before each group, counted one
 * by one. */
typedef struct whole {
    ebpo_file *file;
    ebpo_tree tree;
    ebpo_chunks *chunks;
    uint64_t (*before[EBPO_LEVELS_MAX])[4];
    uint64_t *planes_before[EBPO_LEVELS_MAX], *refs_before[EBPO_LEVELS_MAX];
} whole;

static unsigned type_at(const ebpo_level *level, uint64_t group, int octant)
{
    return ebpo_group_type(level->types[group], octant);
}

static void count_level(whole *w, int i)
{
    const ebpo_level *l = &w->tree.level[i];
    w->before[i] = calloc(l->group_count + 1, sizeof *w->before[i]);
    w->planes_before[i] = calloc(l->gray_count + 1, sizeof(uint64_t));
    w->refs_before[i] = calloc(l->leaf_count + 1, sizeof(uint64_t));
    for (uint64_t g = 0; g < l->group_count; g++) {
        memcpy(w->before[i][g + 1], w->before[i][g], sizeof w->before[i][g]);
        for (int octant = 0; octant < (i ? 8 : 1); octant++)
            w->before[i][g + 1][type_at(l, g, octant)]++;
    }
    for (uint64_t g = 0; g < l->gray_count && l->plane_counts; g++)
        w->planes_before[i][g + 1] = w->planes_before[i][g] + l->plane_counts[g];
    for (uint64_t g = 0; g < l->leaf_count && l->leaf_ref_count; g++)
        w->refs_before[i][g + 1] = w->refs_before[i][g] + l->leaf_ref_count[g];
}

static void whole_open(whole *w, const char *name, uint64_t budget)
{
    ebpo_error error = EBPO_ERROR_INIT;
    memset(w, 0, sizeof *w);
    ck_assert_msg(ebpo_open(name, &w->file, &error) == EBPO_OK, "%s", error.message);
    ck_assert_msg(ebpo_file_read_tree(w->file, READ_BY(1), &w->tree, &error) == EBPO_OK, "%s",
                  error.message);
    ck_assert_msg(ebpo_chunks_make(&w->chunks, w->file, budget, &error) == EBPO_OK, "%s",
                  error.message);
    for (int i = 0; i < w->tree.info.level_count; i++)
        count_level(w, i);
}

static void whole_close(whole *w)
{
    for (int i = 0; i < EBPO_LEVELS_MAX; i++) {
        free(w->before[i]);
        free(w->planes_before[i]);
        free(w->refs_before[i]);
    }
    ebpo_chunks_free(w->chunks);
    ebpo_close(w->file);
    ebpo_tree_free(&w->tree);
}

static void write_tree(ebpo_tree *tree, uint32_t parts)
{
    ebpo_write_options options = EBPO_WRITE_OPTIONS_INIT;
    options.parts = parts;
    model_write(tree, path, &options);
}

enum { DEFAULT = EBPO_PART_PLANES | EBPO_PART_MESH | EBPO_PART_MAPS };

static void build(ebpo_mesh mesh, uint32_t leaf_faces, int max_level, uint32_t parts)
{
    ebpo_build_options options = EBPO_BUILD_OPTIONS_INIT;
    options.leaf_faces = leaf_faces;
    options.max_level = max_level;
    options.parts = parts;
    ebpo_tree tree = model_build(mesh, &options);
    write_tree(&tree, ~0u);
}

/* --- a slice against the tree --- */

typedef struct compare {
    const whole *w;
    const ebpo_slice *slice;
    /* counts in the slice */
    uint64_t next[EBPO_LEVELS_MAX][4], group[EBPO_LEVELS_MAX], plane[EBPO_LEVELS_MAX],
        ref[EBPO_LEVELS_MAX];
    uint8_t *listed; /* local faces */
} compare;

static void compare_leaf(compare *c, int i, uint64_t at, int level, uint64_t rank)
{
    const ebpo_level *a = &c->slice->level[i], *b = &c->w->tree.level[level];
    ck_assert_uint_eq(a->leaf_new[at], b->leaf_new[rank]);
    ck_assert_uint_eq(a->leaf_ref_count[at], b->leaf_ref_count[rank]);
    ck_assert_uint_ge(a->leaf_first[at], c->slice->shared_count);
    for (uint64_t k = 0; k < a->leaf_new[at]; k++) {
        ck_assert_uint_lt(a->leaf_first[at] + k, c->slice->mesh.face_count);
        ck_assert_uint_eq(ebpo_slice_file_face(c->slice, (uint32_t)(a->leaf_first[at] + k)),
                          b->leaf_first[rank] + k);
    }
    ck_assert_uint_eq(c->slice->first_face + (a->leaf_first[at] - c->slice->shared_count),
                      b->leaf_first[rank]);
    for (uint64_t k = 0; k < a->leaf_ref_count[at]; k++) {
        uint32_t local = a->leaf_refs[c->ref[i]++];
        ck_assert_uint_lt(local, c->slice->mesh.face_count);
        ck_assert_uint_eq(ebpo_slice_file_face(c->slice, local),
                          b->leaf_refs[c->w->refs_before[level][rank] + k]);
        c->listed[local] = 1;
    }
}

static void compare_node(compare *c, int i, unsigned type, uint64_t rank)
{
    int level = c->slice->root.cell.level + i;
    const ebpo_level *a = &c->slice->level[i], *b = &c->w->tree.level[level];
    uint64_t at = c->next[i][type]++;
    if (type == EBPO_LEAF) {
        ck_assert(!a->leaf_winding == !b->leaf_winding &&
                  (!a->leaf_winding || a->leaf_winding[at] == b->leaf_winding[rank]));
        compare_leaf(c, i, at, level, rank);
    } else if (type == EBPO_BLACK) {
        ck_assert(!a->black_winding == !b->black_winding &&
                  (!a->black_winding || a->black_winding[at] == b->black_winding[rank]));
    } else if (type == EBPO_WHITE) {
        ck_assert(!a->white_winding == !b->white_winding &&
                  (!a->white_winding || a->white_winding[at] == b->white_winding[rank]));
    } else {
        ck_assert(!a->plane_counts == !b->plane_counts &&
                  (!a->plane_counts || a->plane_counts[at] == b->plane_counts[rank]));
        for (unsigned k = 0; a->plane_counts && k < a->plane_counts[at]; k++)
            ck_assert_uint_eq(a->planes[c->plane[i]++],
                              b->planes[c->w->planes_before[level][rank] + k]);
        uint64_t group = c->group[i + 1]++, ranks[4];
        ck_assert_uint_eq(c->slice->level[i + 1].types[group],
                          c->w->tree.level[level + 1].types[rank]);
        memcpy(ranks, c->w->before[level + 1][rank], sizeof ranks);
        for (int octant = 0; octant < 8; octant++) {
            unsigned child = type_at(&c->w->tree.level[level + 1], rank, octant);
            compare_node(c, i + 1, child, ranks[child]++);
        }
    }
}

/* Checks that local faces have the corners of the file, bit by bit, and every vertex is used by one
 * of them. */
static void compare_faces(const ebpo_slice *s, const ebpo_tree *tree)
{
    uint8_t *used = calloc(s->mesh.vertex_count + 1, 1);
    ck_assert_uint_eq(s->mesh.face_count, s->shared_count + s->face_count);
    ck_assert(!s->mesh.xyz32 == !tree->mesh.xyz32 && !s->mesh.xyz64 == !tree->mesh.xyz64);
    for (uint64_t f = 0; f < s->mesh.face_count; f++) {
        uint64_t in_file = ebpo_slice_file_face(s, (uint32_t)f);
        for (int k = 0; k < 3; k++) {
            uint64_t a = s->mesh.faces[3 * f + (unsigned)k],
                     b = tree->mesh.faces[3 * in_file + (unsigned)k];
            ck_assert_uint_lt(a, s->mesh.vertex_count);
            used[a] = 1;
            if (s->mesh.xyz32)
                ck_assert_mem_eq(s->mesh.xyz32 + 3 * a, tree->mesh.xyz32 + 3 * b, 12);
            else
                ck_assert_mem_eq(s->mesh.xyz64 + 3 * a, tree->mesh.xyz64 + 3 * b, 24);
        }
        if (tree->face_source)
            ck_assert_uint_eq(s->face_source[f], tree->face_source[in_file]);
    }
    ck_assert(!s->face_source == !tree->face_source);
    for (uint64_t v = 0; v < s->mesh.vertex_count; v++)
        ck_assert(used[v]);
    free(used);
}

static void compare_counts(const compare *c, const ebpo_slice_size *size)
{
    ebpo_slice_size sum = { 0 };
    for (int i = 0; i < c->slice->level_count; i++) {
        const ebpo_level *l = &c->slice->level[i];
        ck_assert_uint_eq(l->white_count, c->next[i][EBPO_WHITE]);
        ck_assert_uint_eq(l->black_count, c->next[i][EBPO_BLACK]);
        ck_assert_uint_eq(l->leaf_count, c->next[i][EBPO_LEAF]);
        ck_assert_uint_eq(l->gray_count, c->next[i][EBPO_GRAY]);
        ck_assert_uint_eq(l->plane_count, c->plane[i]);
        ck_assert_uint_eq(l->ref_count, c->ref[i]);
        ck_assert_uint_gt(l->group_count, 0);
        ck_assert_uint_eq(l->group_count, i ? c->group[i] : 1);
        ck_assert(!l->leaf_planes && !l->leaf_plane_counts && l->leaf_plane_count == 0);
        sum.groups += l->group_count;
        sum.leaves += l->leaf_count;
        sum.refs += l->ref_count;
        sum.new_faces += l->new_count;
    }
    sum.shared = c->slice->root.cell.level == 0 ? 0 : sum.refs;
    ck_assert_uint_le(c->slice->shared_count, sum.shared);
    ck_assert_uint_eq(sum.new_faces, c->slice->face_count);
    ck_assert_mem_eq(&sum, size, sizeof sum);
}

static void compare_slice(const whole *w, const ebpo_slice *slice, const ebpo_slice_size *size)
{
    compare c = { .w = w, .slice = slice };
    c.listed = calloc(slice->mesh.face_count + 1, 1);
    ck_assert_uint_eq(slice->level[0].types[0], slice->root.type);
    compare_node(&c, 0, slice->root.type, slice->root.rank);
    compare_counts(&c, size);
    for (uint32_t k = 0; k < slice->shared_count; k++) {
        ck_assert(c.listed[k] && slice->shared[k] < slice->first_face);
        ck_assert(k == 0 || slice->shared[k] > slice->shared[k - 1]);
    }
    compare_faces(slice, &w->tree);
    free(c.listed);
}

static void check_slice(const whole *w, const ebpo_node *root)
{
    ebpo_error error = EBPO_ERROR_INIT;
    ebpo_slice slice;
    ebpo_slice_size size;
    ck_assert_msg(ebpo_slice_measure(w->chunks, root, &size, &error) == EBPO_OK, "%s",
                  error.message);
    ck_assert_msg(ebpo_slice_read(&slice, w->chunks, root, &error) == EBPO_OK, "%s", error.message);
    ck_assert_mem_eq(&slice.root, root, sizeof *root);
    compare_slice(w, &slice, &size);
    ebpo_slice_free(&slice);
}

static void check_node(const whole *w, const ebpo_node *node)
{
    ebpo_error error = EBPO_ERROR_INIT;
    const ebpo_level *l = &w->tree.level[node->cell.level];
    uint64_t ranks[4];
    uint32_t codes[255], count;
    uint16_t types;
    int32_t winding;
    if (node->type == EBPO_GRAY) {
        ck_assert_msg(ebpo_chunks_children(w->chunks, node, &types, ranks, &error) == EBPO_OK, "%s",
                      error.message);
        ck_assert_uint_eq(types, w->tree.level[node->cell.level + 1].types[node->rank]);
        ck_assert_mem_eq(ranks, w->before[node->cell.level + 1][node->rank], sizeof ranks);
        ck_assert_msg(ebpo_chunks_planes(w->chunks, node, codes, &count, &error) == EBPO_OK, "%s",
                      error.message);
        ck_assert_uint_eq(count, l->plane_counts ? l->plane_counts[node->rank] : 0);
        for (uint32_t k = 0; k < count; k++)
            ck_assert_uint_eq(codes[k],
                              l->planes[w->planes_before[node->cell.level][node->rank] + k]);
        ck_assert_int_eq(ebpo_chunks_winding(w->chunks, node, &winding, NULL),
                         w->tree.info.solid ? EBPO_E_ARGUMENT : EBPO_E_NOT_SOLID);
    } else if (w->tree.info.solid) {
        const int32_t *windings = node->type == EBPO_LEAF    ? l->leaf_winding
                                  : node->type == EBPO_BLACK ? l->black_winding
                                                             : l->white_winding;
        ck_assert_msg(ebpo_chunks_winding(w->chunks, node, &winding, &error) == EBPO_OK, "%s",
                      error.message);
        ck_assert_int_eq(winding, windings ? windings[node->rank] : node->type == EBPO_BLACK);
    } else {
        ck_assert_int_eq(ebpo_chunks_winding(w->chunks, node, &winding, NULL), EBPO_E_NOT_SOLID);
    }
}

/* Checks every node, and the subtree of every `step`th node. */
static void check_all(const whole *w, uint64_t step)
{
    uint64_t turn = 0;
    for (int level = 0; level < w->tree.info.level_count; level++) {
        const ebpo_level_summary *s = &w->tree.info.level[level];
        const uint64_t counts[4] = { s->white_count, s->black_count, s->leaf_count, s->gray_count };
        for (int type = 0; type < 4; type++)
            for (uint64_t rank = 0; rank < counts[type]; rank++, turn++) {
                ebpo_node node = { .cell.level = level,
                                   .type = (ebpo_node_type)type,
                                   .rank = rank };
                if (turn % 5 == 0 || counts[type] < 5000)
                    check_node(w, &node);
                if (type >= EBPO_LEAF && (turn % step == 0 || level == 0))
                    check_slice(w, &node);
            }
    }
}

START_TEST(test_slices_of_random_trees_match_file)
{
    if (!ebpo_test_wanted(_i))
        return;
    random_tree_options options = { (uint64_t)_i,         2 + _i % 4,  2 + (unsigned)_i % 5,
                                    1 + (unsigned)_i % 9, _i % 3 != 0, _i % 2 != 0,
                                    _i % 3 == 1,          _i % 5 == 0 };
    ebpo_tree tree;
    whole w;
    random_tree_make(&tree, &options);
    write_tree(&tree, ~0u);
    whole_open(&w, path, 0);
    check_all(&w, 1);
    whole_close(&w);
}
END_TEST

START_TEST(test_slices_of_solids_match_file)
{
    if (!ebpo_test_wanted(_i))
        return;
    whole w;
    build(ebpo_test_solids[_i].make(), 1, -1,
          _i % 2 ? DEFAULT : EBPO_PART_MESH | EBPO_PART_LEAF_PLANES);
    whole_open(&w, path, 0);
    check_all(&w, 7);
    whole_close(&w);
}
END_TEST

/* Uses more than 4,096 groups, gray nodes and leaves in a level, so that parts begin at rows of
 * the index arrays; and dozens of chunks. */
START_TEST(test_slices_by_index_with_little_memory)
{
    random_tree_options options = { 5, 7, 13, 2, true, _i == 1, true, _i == 1 };
    ebpo_tree tree;
    whole w;
    ebpo_cache_stats stats;
    random_tree_make(&tree, &options);
    ck_assert_uint_gt(tree.level[5].gray_count, EBPO_INDEX_ROWS);
    ck_assert_uint_gt(tree.level[6].leaf_count, 2 * EBPO_INDEX_ROWS);
    write_tree(&tree, ~0u);
    whole_open(&w, path, _i ? 0 : 400000);
    check_all(&w, _i ? 97 : 997);
    ebpo_chunks_get_stats(w.chunks, &stats);
    ck_assert(_i || (stats.evicted > 100 && stats.peak_bytes <= 400000));
    whole_close(&w);
}
END_TEST

START_TEST(test_slices_of_multi_chunk_mesh)
{
    whole w;
    ebpo_mesh mesh = ebpo_test_torus(2, 0.7, 160, 100);
    if (_i)
        ebpo_test_to_float(&mesh);
    build(mesh, 4, _i ? 4 : -1, DEFAULT);
    whole_open(&w, path, _i ? 500000 : 0);
    check_all(&w, 53);
    whole_close(&w);
}
END_TEST

static void same(const void *a, const void *b, uint64_t bytes)
{
    ck_assert(!a == !b);
    ck_assert(!a || memcmp(a, b, bytes) == 0);
}

static void same_level(const ebpo_level *a, const ebpo_level *b)
{
    ck_assert_uint_eq(a->group_count, b->group_count);
    ck_assert_uint_eq(a->new_count, b->new_count);
    same(a->types, b->types, a->group_count * 2);
    same(a->plane_counts, b->plane_counts, a->gray_count);
    same(a->planes, b->planes, a->plane_count * 4);
    same(a->leaf_winding, b->leaf_winding, a->leaf_count * 4);
    same(a->black_winding, b->black_winding, a->black_count * 4);
    same(a->white_winding, b->white_winding, a->white_count * 4);
    same(a->leaf_first, b->leaf_first, a->leaf_count * 8);
    same(a->leaf_new, b->leaf_new, a->leaf_count * 4);
    same(a->leaf_ref_count, b->leaf_ref_count, a->leaf_count * 4);
    same(a->leaf_refs, b->leaf_refs, a->ref_count * 4);
}

START_TEST(test_root_slice_is_whole_tree)
{
    random_tree_options options = {
        3 + (uint64_t)_i, 1 + _i, 6, 5, true, false, _i % 2 == 0, true
    };
    ebpo_tree tree;
    whole w;
    ebpo_slice all, root;
    ebpo_slice_size size;
    random_tree_make(&tree, &options);
    write_tree(&tree, ~0u);
    whole_open(&w, path, 0);
    ck_assert_int_eq(ebpo_slice_read_all(&all, w.file, 0, NULL), EBPO_OK);
    ck_assert_int_eq(ebpo_slice_read(&root, w.chunks, &all.root, NULL), EBPO_OK);
    ck_assert_int_eq(ebpo_slice_measure(w.chunks, &all.root, &size, NULL), EBPO_OK);
    ck_assert_int_eq(all.level_count, root.level_count);
    ck_assert(all.face_count == root.face_count && all.first_face == 0 && root.first_face == 0 &&
              !all.shared && !root.shared);
    same(all.face_source, root.face_source, all.face_count * 4);
    for (int i = 0; i < all.level_count; i++)
        same_level(&all.level[i], &root.level[i]);
    compare_slice(&w, &root, &size);
    ck_assert_uint_eq(all.mesh.vertex_count, w.tree.mesh.vertex_count);
    same(all.mesh.faces, w.tree.mesh.faces, all.face_count * 12);
    ebpo_slice_free(&all);
    ebpo_slice_free(&root);
    whole_close(&w);
}
END_TEST

START_TEST(test_slice_without_mesh_is_refused)
{
    random_tree_options options = { 8, 5, 6, 4, true, false, true, false };
    ebpo_tree tree;
    whole w;
    ebpo_slice slice;
    ebpo_node root = { .type = EBPO_GRAY };
    ebpo_error error = EBPO_ERROR_INIT;
    ebpo_slice_size size;
    random_tree_make(&tree, &options);
    write_tree(&tree, EBPO_PART_PLANES);
    whole_open(&w, path, 0);
    ck_assert_int_eq(ebpo_slice_read(&slice, w.chunks, &root, &error), EBPO_E_ABSENT);
    ck_assert_ptr_nonnull(strstr(error.message, "without its mesh"));
    ck_assert_int_eq(ebpo_slice_read_all(&slice, w.file, 1, NULL), EBPO_E_ABSENT);
    ck_assert_ptr_null(slice.level[0].types);
    ck_assert_int_eq(ebpo_slice_measure(w.chunks, &root, &size, &error), EBPO_OK);
    ck_assert(size.leaves > 0 && size.refs == 0 && size.new_faces == 0);
    for (int level = 0; level < w.tree.info.level_count; level++)
        for (uint64_t rank = 0; rank < w.tree.level[level].gray_count; rank++)
            check_node(&w, &(ebpo_node){ .cell.level = level, .type = EBPO_GRAY, .rank = rank });
    whole_close(&w);
}
END_TEST

START_TEST(test_slice_of_missing_node_is_refused)
{
    random_tree_options options = { 9, 3, 6, 4, true, false, true, false };
    ebpo_tree tree;
    whole w;
    ebpo_slice slice;
    ebpo_error error = EBPO_ERROR_INIT;
    random_tree_make(&tree, &options);
    write_tree(&tree, ~0u);
    whole_open(&w, path, 0);
    const ebpo_node wrong[] = {
        { .cell.level = -1, .type = EBPO_GRAY },
        { .cell.level = 3, .type = EBPO_LEAF },
        { .cell.level = 1, .type = EBPO_GRAY, .rank = w.tree.level[1].gray_count },
        { .cell.level = 2, .type = EBPO_LEAF, .rank = UINT64_MAX },
        { .cell.level = 2, .type = EBPO_WHITE },
        { .cell.level = 0, .type = EBPO_LEAF },
    };
    for (size_t i = 0; i < sizeof wrong / sizeof wrong[0]; i++) {
        uint16_t types;
        uint64_t ranks[4];
        uint32_t codes[255], count;
        ebpo_slice_size size;
        ck_assert_int_eq(ebpo_slice_read(&slice, w.chunks, &wrong[i], &error), EBPO_E_ARGUMENT);
        ck_assert_int_eq(ebpo_slice_measure(w.chunks, &wrong[i], &size, &error), EBPO_E_ARGUMENT);
        ck_assert_int_eq(ebpo_chunks_children(w.chunks, &wrong[i], &types, ranks, &error),
                         EBPO_E_ARGUMENT);
        ck_assert_int_eq(ebpo_chunks_planes(w.chunks, &wrong[i], codes, &count, &error),
                         EBPO_E_ARGUMENT);
    }
    whole_close(&w);
}
END_TEST

START_TEST(test_slice_integer_ranges_are_checked)
{
    random_tree_options options = { 21, 7, 13, 1, true, false, true, false };
    ebpo_tree tree;
    whole w;
    random_tree_make(&tree, &options);
    write_tree(&tree, ~0u);
    whole_open(&w, path, 0);
    const ebpo_level *l = &w.tree.level[6];
    ck_assert_uint_gt(l->leaf_count, 20000); /* two chunks of i32 at least */
    int64_t windings[3];
    uint64_t row = 16383, index[3];
    ck_assert_int_eq(ebpo_chunks_integers(w.chunks, EBPO_A_LEAF_WINDING, 6, row, 3, windings, 8,
                                          NULL),
                     EBPO_OK);
    for (int i = 0; i < 3; i++)
        ck_assert_int_eq(windings[i], l->leaf_winding[row + (unsigned)i]);
    ck_assert_int_eq(ebpo_chunks_integers(w.chunks, EBPO_A_LEAF_INDEX, 6, 2, 1, index, 8, NULL),
                     EBPO_OK);
    ck_assert_uint_eq(index[1], w.refs_before[6][2 * EBPO_INDEX_ROWS]);
    ck_assert_int_eq(ebpo_chunks_integers(w.chunks, EBPO_A_LEAF_NEW, 6, l->leaf_count, 0, windings,
                                          8, NULL),
                     EBPO_OK);
    ck_assert_int_eq(ebpo_chunks_integers(w.chunks, EBPO_A_LEAF_NEW, 6, l->leaf_count - 1, 2,
                                          windings, 8, NULL),
                     EBPO_E_ARGUMENT);
    ck_assert_int_eq(ebpo_chunks_integers(w.chunks, EBPO_A_LEAF_NEW, 6, 1, UINT64_MAX, windings, 8,
                                          NULL),
                     EBPO_E_ARGUMENT);
    ck_assert_int_eq(ebpo_chunks_integers(w.chunks, EBPO_A_LEAF_SKIP, 6, 0, 1, windings, 2, NULL),
                     EBPO_E_ARGUMENT);
    ck_assert_int_eq(ebpo_chunks_integers(w.chunks, EBPO_A_PLANES, 6, 0, 1, windings, 8, NULL),
                     EBPO_E_ARGUMENT);
    whole_close(&w);
}
END_TEST

/* --- untrusted files --- */

/* Checks that all references in a slice are within it. */
static void check_bounds(const ebpo_slice *s)
{
    uint64_t faces = s->mesh.face_count;
    for (int i = 0; i < s->level_count; i++) {
        uint64_t at = 0;
        for (uint64_t k = 0; k < s->level[i].leaf_count; k++) {
            const ebpo_level *l = &s->level[i];
            ck_assert(l->leaf_first[k] <= faces && l->leaf_new[k] <= faces - l->leaf_first[k]);
            for (uint32_t r = 0; r < l->leaf_ref_count[k]; r++)
                ck_assert_uint_lt(l->leaf_refs[at++], l->leaf_first[k]);
        }
        ck_assert_uint_eq(at, s->level[i].ref_count);
    }
    for (uint64_t i = 0; i < 3 * faces; i++)
        ck_assert_uint_lt(s->mesh.faces[i], s->mesh.vertex_count);
}

/* Reads parts of all data. Returns true when there was no error. */
static bool try_all(const ebpo_file *file, ebpo_chunks *chunks, uint64_t *state)
{
    const ebpo_info *info = ebpo_file_info(file);
    bool well = true;
    for (int n = 0; n < 12; n++) {
        /* small parts of large trees */
        int level = info->level_count > 5 ? 2 + n % (info->level_count - 2) : n % info->level_count;
        ebpo_node node = { .cell.level = level,
                           .type = info->level[level].gray_count && n % 3 ? EBPO_GRAY : EBPO_LEAF };
        uint64_t count =
            node.type == EBPO_GRAY ? info->level[level].gray_count : info->level[level].leaf_count;
        if (count == 0)
            continue;
        node.rank = n < 3 ? 0 : ebpo_test_random(state) % count;
        ebpo_slice slice;
        ebpo_slice_size size;
        ebpo_error error = EBPO_ERROR_INIT;
        uint16_t types;
        uint64_t ranks[4];
        uint32_t codes[255], planes;
        int32_t winding;
        ebpo_status status[5] = { ebpo_slice_measure(chunks, &node, &size, NULL),
                                  ebpo_slice_read(&slice, chunks, &node, &error), EBPO_OK, EBPO_OK,
                                  EBPO_OK };
        if (node.type == EBPO_GRAY) {
            status[2] = ebpo_chunks_children(chunks, &node, &types, ranks, NULL);
            status[3] = ebpo_chunks_planes(chunks, &node, codes, &planes, NULL);
        } else if (info->solid) {
            status[4] = ebpo_chunks_winding(chunks, &node, &winding, NULL);
        }
        if (status[1] == EBPO_OK)
            check_bounds(&slice);
        for (int k = 0; k < 5; k++) {
            ck_assert_msg(status[k] == EBPO_OK || status[k] == EBPO_E_FORMAT ||
                              status[k] == EBPO_E_ABSENT,
                          "%d: %s", k, error.message);
            well &= status[k] == EBPO_OK;
        }
        ebpo_slice_free(&slice);
    }
    return well;
}

/* Changes numbers of a chunk in the cache, as if the file had these numbers. */
static bool try_changed(whole *w, ebpo_array_id id, int level, uint64_t *state)
{
    ebpo_held_chunk view = { .array = ebpo_reader_array(w->file, id, level) };
    uint64_t row = ebpo_test_random(state) % view.array->shape.rows;
    ck_assert_int_eq(ebpo_held_chunk_move(w->chunks, &view, row, NULL), EBPO_OK);
    size_t size = ebpo_shape_row_bytes(&view.array->shape);
    uint8_t *bytes = (uint8_t *)(uintptr_t)view.rows + (row - view.begin) * size, kept[64];
    memcpy(kept, bytes, size);
    switch (ebpo_test_random(state) % 3) {
    case 0: memset(bytes, 0xff, size); break;
    case 1: memset(bytes, 0, size); break;
    default: bytes[ebpo_test_random(state) % size] ^= (uint8_t)(1u << ebpo_test_random(state) % 8);
    }
    bool well = try_all(w->file, w->chunks, state);
    memcpy(bytes, kept, size);
    ebpo_held_chunk_release(w->chunks, &view);
    return well;
}

START_TEST(test_slice_bad_values_stay_in_bounds)
{
    random_tree_options options = {
        31 + (uint64_t)_i, _i ? 7 : 4, _i ? 9 : 7, 4, true, false, true, true
    };
    ebpo_tree tree;
    whole w;
    uint64_t state = 4711;
    unsigned refused = 0;
    random_tree_make(&tree, &options);
    write_tree(&tree, ~0u);
    whole_open(&w, path, 0);
    ck_assert(try_all(w.file, w.chunks, &state));
    for (int level = 0; level < w.tree.info.level_count; level++)
        for (int id = 0; id < EBPO_LEVEL_ARRAYS; id++)
            for (int n = 0;
                 n < (_i ? 1 : 40) && ebpo_reader_array(w.file, (ebpo_array_id)id, level)->present;
                 n++)
                refused += !try_changed(&w, (ebpo_array_id)id, level, &state);
    ck_assert_uint_gt(refused, _i ? 5 : 100);
    whole_close(&w);
}
END_TEST

START_TEST(test_slice_counts_beyond_types_are_refused)
{
    random_tree_options options = { 31, 4, 7, 4, true, false, true, false };
    ebpo_tree tree;
    whole w;
    ebpo_slice slice;
    ebpo_error error = EBPO_ERROR_INIT;
    random_tree_make(&tree, &options);
    write_tree(&tree, ~0u);
    whole_open(&w, path, 0);
    ebpo_held_chunk view = { .array = ebpo_reader_array(w.file, EBPO_A_TYPES, 3) };
    ck_assert_int_eq(ebpo_held_chunk_move(w.chunks, &view, 0, NULL), EBPO_OK);
    ((uint8_t *)(uintptr_t)view.rows)[0] |= 3; /* gray at the deepest level */
    ck_assert_int_eq(ebpo_slice_read(&slice, w.chunks, &(ebpo_node){ .type = EBPO_GRAY }, &error),
                     EBPO_E_FORMAT);
    ck_assert_ptr_nonnull(
        strstr(error.message, "/levels/03/types: the types contradict the counts"));
    ck_assert(slice.level[0].types == NULL && slice.level_count == 0);
    ebpo_held_chunk_release(w.chunks, &view);
    whole_close(&w);
}
END_TEST

/* Errors in these vectors are also detected when a part is read. Other vectors are refused at
 * opening, or only when the whole file is checked. */
START_TEST(test_slice_of_invalid_vectors_fails)
{
    static const char *const sure[] = { "vertex_nan",
                                        "face_vertex_below_zero",
                                        "faces_index_wrong",
                                        "chunk_bit_flipped",
                                        "plane_code_of_no_plane",
                                        "leaf_ref_not_before_first",
                                        "leaves_out_of_depth_first_order",
                                        "white_node_inside" };
    const char *vectors = getenv("EBPO_VECTORS");
    unsigned opened = 0, found = 0;
    char name[4096];
    if (!vectors)
        return;
    snprintf(name, sizeof name, "%s/failed", vectors);
    DIR *directory = opendir(name);
    ck_assert_ptr_nonnull(directory);
    for (struct dirent *entry; (entry = readdir(directory)) != NULL;) {
        ebpo_file *file;
        ebpo_chunks *chunks;
        uint64_t state = 1;
        snprintf(name, sizeof name, "%s/failed/%s", vectors, entry->d_name);
        if (!strstr(entry->d_name, ".ebpo.h5") || ebpo_open(name, &file, NULL) != EBPO_OK)
            continue;
        opened++;
        bool well = false;
        if (ebpo_chunks_make(&chunks, file, 0, NULL) == EBPO_OK) {
            well = try_all(file, chunks, &state);
            ebpo_chunks_free(chunks);
        }
        for (size_t i = 0; i < sizeof sure / sizeof sure[0]; i++)
            if (strncmp(entry->d_name, sure[i], strlen(sure[i])) == 0) {
                found++;
                ck_assert_msg(!well, "%s is read without an error", entry->d_name);
            }
        ebpo_close(file);
    }
    closedir(directory);
    ck_assert_uint_ge(opened, 10);
    ck_assert_uint_eq(found, sizeof sure / sizeof sure[0]);
}
END_TEST

/* --- threads --- */

static uint64_t slice_hash(const ebpo_slice *s)
{
    uint64_t hash = s->first_face * 31 + s->shared_count;
    for (int i = 0; i < s->level_count; i++)
        for (uint64_t k = 0; k < s->level[i].ref_count; k++)
            hash = hash * 1099511628211u + s->level[i].leaf_refs[k];
    for (uint64_t i = 0; i < 3 * s->mesh.face_count; i++)
        hash = hash * 1099511628211u + s->mesh.faces[i];
    for (uint64_t i = 0; i < 3 * s->mesh.vertex_count; i++) {
        uint64_t bits;
        memcpy(&bits, &s->mesh.xyz64[i], sizeof bits);
        hash = hash * 1099511628211u + bits;
    }
    return hash;
}

typedef struct reader {
    whole *w;
    uint64_t state, *hash; /* hash of each gray node of the level; set by the first reader */
    int level;
    bool fill;
    unsigned wrong;
} reader;

static void *read_random(void *context)
{
    reader *r = context;
    uint64_t count = r->w->tree.level[r->level].gray_count;
    for (uint64_t n = 0; n < (r->fill ? count : 60); n++) {
        ebpo_node node = { .cell.level = r->level,
                           .type = EBPO_GRAY,
                           .rank = r->fill ? n : ebpo_test_random(&r->state) % count };
        ebpo_slice slice;
        if (ebpo_slice_read(&slice, r->w->chunks, &node, NULL) != EBPO_OK) {
            r->wrong++;
            continue;
        }
        uint64_t hash = slice_hash(&slice);
        if (r->fill)
            r->hash[n] = hash;
        r->wrong += hash != r->hash[node.rank];
        ebpo_slice_free(&slice);
    }
    return NULL;
}

START_TEST(test_slice_threads_share_cache)
{
    whole w;
    enum { THREADS = 4 };
    pthread_t threads[THREADS];
    reader readers[THREADS];
    build(ebpo_test_torus(2, 0.7, 120, 80), 4, -1, DEFAULT);
    whole_open(&w, path, 1200000);
    reader first = { .w = &w, .level = 2, .fill = true };
    first.hash = calloc(w.tree.level[2].gray_count, sizeof *first.hash);
    read_random(&first);
    ck_assert_uint_eq(first.wrong, 0);
    for (unsigned i = 0; i < THREADS; i++) {
        readers[i] = (reader){ .w = &w, .level = 2, .hash = first.hash, .state = i };
        ck_assert_int_eq(pthread_create(&threads[i], NULL, read_random, &readers[i]), 0);
    }
    for (unsigned i = 0; i < THREADS; i++) {
        pthread_join(threads[i], NULL);
        ck_assert_uint_eq(readers[i].wrong, 0);
    }
    free(first.hash);
    whole_close(&w);
}
END_TEST

/* --- a real model --- */

START_TEST(test_slices_of_real_model_are_complete)
{
    const char *models = getenv("EBPO_MODELS");
    char name[4096];
    ebpo_mesh mesh;
    whole w;
    enum { CUT = 3 };
    uint64_t faces = 0, leaves = 0;
    snprintf(name, sizeof name, "%s/dragon100k.ply", models ? models : "");
    if (!models || ebpo_mesh_read(name, NULL, &mesh, NULL) != EBPO_OK)
        return;
    build(mesh, 16, -1, DEFAULT);
    whole_open(&w, path, 3 << 20);
    for (int level = 0; level <= CUT; level++)
        for (int type = EBPO_LEAF; type <= (level == CUT ? EBPO_GRAY : EBPO_LEAF); type++)
            for (uint64_t rank = 0; rank < (type == EBPO_GRAY ? w.tree.level[level].gray_count
                                                              : w.tree.level[level].leaf_count);
                 rank++) {
                ebpo_node node = { .cell.level = level,
                                   .type = (ebpo_node_type)type,
                                   .rank = rank };
                ebpo_slice_size size;
                check_slice(&w, &node);
                ck_assert_int_eq(ebpo_slice_measure(w.chunks, &node, &size, NULL), EBPO_OK);
                faces += size.new_faces;
                leaves += size.leaves;
            }
    ck_assert_uint_eq(faces, w.tree.mesh.face_count);
    for (int level = 0; level < w.tree.info.level_count; level++)
        leaves -= w.tree.level[level].leaf_count;
    ck_assert_uint_eq(leaves, 0);
    whole_close(&w);
}
END_TEST

TEST_SUITE(slice)
{
    Suite *suite = suite_create("slice");
    TCase *cases = tcase_create("slice");
    tcase_set_timeout(cases, 300);
    tcase_add_checked_fixture(cases, make_folder, scratch_leave);
    tcase_add_loop_test(cases, test_slices_of_random_trees_match_file, 0, 20);
    tcase_add_loop_test(cases, test_slices_of_solids_match_file, 0, ebpo_test_solid_count);
    tcase_add_loop_test(cases, test_slices_by_index_with_little_memory, 0, 2);
    tcase_add_loop_test(cases, test_slices_of_multi_chunk_mesh, 0, 2);
    tcase_add_loop_test(cases, test_root_slice_is_whole_tree, 0, 5);
    tcase_add_test(cases, test_slice_without_mesh_is_refused);
    tcase_add_test(cases, test_slice_of_missing_node_is_refused);
    tcase_add_test(cases, test_slice_integer_ranges_are_checked);
    tcase_add_loop_test(cases, test_slice_bad_values_stay_in_bounds, 0, 2);
    tcase_add_test(cases, test_slice_counts_beyond_types_are_refused);
    tcase_add_test(cases, test_slice_of_invalid_vectors_fails);
    tcase_add_test(cases, test_slices_of_real_model_are_complete);
    suite_add_tcase(suite, cases);
    /* a separate case, for CK_RUN_CASE=threads with a thread sanitizer */
    cases = tcase_create("threads");
    tcase_set_timeout(cases, 300);
    tcase_add_checked_fixture(cases, make_folder, scratch_leave);
    tcase_add_test(cases, test_slice_threads_share_cache);
    suite_add_tcase(suite, cases);
    return suite;
}
