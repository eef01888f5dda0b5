/* Cursors visit the same nodes in every representation: the nodes that a simple traversal of the
 * levels lists. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include <ebpo/build.h>
#include <ebpo/subset.h>

#include "check_main.h"
#include "model_file.h"
#include "geometry/cursor.h"
#include "geometry/level_nodes.h"
#include "query/query_node.h"
#include "random_tree.h"
#include "solids.h"

static char folder[] = "/tmp/ebpo-cursor-XXXXXX", path[64], part_path[64];

static void make_folder(void)
{
    ck_assert_ptr_nonnull(mkdtemp(folder));
    snprintf(path, sizeof path, "%s/x.ebpo.h5", folder);
    snprintf(part_path, sizeof part_path, "%s/part.ebpo.h5", folder);
}

static void remove_folder(void)
{
    unlink(path);
    unlink(part_path);
    rmdir(folder);
    strcpy(folder + strlen(folder) - 6, "XXXXXX");
}

static void fine(ebpo_status status, const ebpo_error *error)
{
    ck_assert_msg(status == EBPO_OK, "%s: %s", ebpo_status_name(status), error->message);
}

/* --- the reference implementation: all nodes, depth first, counted in order --- */

typedef struct reference_node {
    ebpo_octcode octcode;
    ebpo_node_type type;
    bool pruned;
    int32_t winding;
    uint64_t rank;
    const uint32_t *codes;
    unsigned count;
} reference_node;

typedef struct reference {
    const ebpo_tree *tree;
    uint64_t group[EBPO_LEVELS_MAX], seen[EBPO_LEVELS_MAX][4], plane[EBPO_LEVELS_MAX],
        leaf_plane[EBPO_LEVELS_MAX];
    reference_node *node;
    uint64_t count, capacity;
} reference;

static void reference_add(reference *t, int level, ebpo_octcode code, unsigned type)
{
    const ebpo_level *l = &t->tree->level[level];
    uint64_t rank = t->seen[level][type]++;
    reference_node n = { .octcode = code, .type = (ebpo_node_type)type, .rank = rank };
    if (type == EBPO_GRAY && l->plane_counts) {
        n.count = l->plane_counts[rank];
        n.codes = l->planes ? l->planes + t->plane[level] : NULL;
        t->plane[level] += n.count;
    }
    if (type == EBPO_LEAF && l->leaf_plane_counts) {
        n.count = l->leaf_plane_counts[rank];
        n.codes = l->leaf_planes + t->leaf_plane[level];
        t->leaf_plane[level] += n.count;
    }
    if (type == EBPO_WHITE)
        n.winding = l->white_winding ? l->white_winding[rank] : 0;
    if (type == EBPO_BLACK)
        n.winding = l->black_winding ? l->black_winding[rank] : 1;
    uint64_t at = t->count;
    ck_assert(ebpo_grow(&t->node, &t->capacity, at + 1, sizeof *t->node));
    t->node[t->count++] = n;
    if (type != EBPO_GRAY)
        return;
    bool last = level + 1 == t->tree->info.level_count;
    unsigned types = last ? 0 : t->tree->level[level + 1].types[t->group[level + 1]++];
    if (types == 0) {
        t->node[at].pruned = true;
        if (!last)
            t->seen[level + 1][EBPO_WHITE] += 8;
        return;
    }
    for (unsigned octant = 0; octant < 8; octant++)
        reference_add(t, level + 1, code * 8 + octant, types / (1u << 2 * octant) % 4);
}

/* Returns the node of a cell in the list, or the deepest one around it. */
static const reference_node *reference_find(const reference *t, ebpo_octcode code)
{
    const reference_node *found = NULL;
    for (uint64_t i = 0; i < t->count; i++) {
        int up = ebpo_octcode_level(code) - ebpo_octcode_level(t->node[i].octcode);
        if (up >= 0 && code >> 3 * up == t->node[i].octcode &&
            (!found || t->node[i].octcode > found->octcode))
            found = &t->node[i];
    }
    return found;
}

/* --- representations --- */

typedef enum holder { LEVELS, CHUNKS, SUBTREE, MODEL, HOLDERS } holder;

typedef struct whole {
    ebpo_file *file;
    ebpo_tree tree;
    ebpo_level_ranks ranks[EBPO_LEVELS_MAX];
    ebpo_level_nodes nodes;
    ebpo_chunks *chunks;
    ebpo_accel *subtree;
    ebpo_model *model;
    ebpo_context *context;
    reference reference;
} whole;

/* `shape`: false when the faces form no surface, so that subtrees cannot be made. */
static void whole_open(whole *w, const char *name, int cut_level, bool shape)
{
    ebpo_error error = EBPO_ERROR_INIT;
    ebpo_model_options options = EBPO_MODEL_OPTIONS_INIT;
    ebpo_slice slice;
    memset(w, 0, sizeof *w);
    fine(ebpo_open(name, &w->file, &error), &error);
    fine(ebpo_file_read_tree(w->file, NULL, &w->tree, &error), &error);
    for (int i = 0; i < w->tree.info.level_count; i++)
        fine(ebpo_level_ranks_make(&w->ranks[i], &w->tree.level[i], i, &error), &error);
    w->nodes = (ebpo_level_nodes){ w->tree.level, w->ranks, w->tree.info.level_count };
    fine(ebpo_chunks_make(&w->chunks, w->file, 0, &error), &error);
    w->reference.tree = &w->tree;
    reference_add(&w->reference, 0, 1, w->tree.level[0].types[0]);
    if (!shape)
        return;
    if (ebpo_file_info(w->file)->parts & EBPO_PART_MESH) {
        fine(ebpo_slice_read_all(&slice, w->file, 1, &error), &error);
        fine(ebpo_accel_make(&w->subtree, &slice, ebpo_file_info(w->file), EBPO_ACCEL_PLANES, 1,
                             &error),
             &error);
    }
    options.cut_level = cut_level;
    options.threads = 1;
    fine(ebpo_model_new(w->file, &options, &w->model, &error), &error);
    fine(ebpo_context_new(w->model, &w->context, &error), &error);
}

static void whole_close(whole *w)
{
    ebpo_context_free(w->context);
    ebpo_model_free(w->model);
    ebpo_accel_free(w->subtree);
    ebpo_chunks_free(w->chunks);
    for (int i = 0; i < EBPO_LEVELS_MAX; i++)
        ebpo_level_ranks_free(&w->ranks[i]);
    ebpo_tree_free(&w->tree);
    ebpo_close(w->file);
    free(w->reference.node);
}

static bool has(const whole *w, holder which)
{
    return (which != SUBTREE || w->subtree) && (which != MODEL || w->model);
}

static void begin(whole *w, holder which, ebpo_cursor *c)
{
    ebpo_error error = EBPO_ERROR_INIT;
    ebpo_node root;
    switch (which) {
    case LEVELS:
        ebpo_cursor_begin(c, &ebpo_level_source, &w->nodes, ebpo_level_root(&w->nodes));
        break;
    case CHUNKS:
        fine(ebpo_chunks_root(w->chunks, &root, &error), &error);
        ebpo_cursor_begin(c, &ebpo_chunks_source, w->chunks, root);
        break;
    case SUBTREE:
        ebpo_cursor_begin(c, &ebpo_accel_source, w->subtree, ebpo_accel_root(w->subtree));
        break;
    default:
        ebpo_cursor_begin(c, &ebpo_context_source, w->context, ebpo_model_root(w->model));
        break;
    }
}

/* --- the current node against the reference --- */

static void same_node(const whole *w, holder which, ebpo_cursor *c, const reference_node *t)
{
    ebpo_error error = EBPO_ERROR_INIT;
    const ebpo_node *child;
    uint32_t codes[EBPO_NODE_PLANES];
    unsigned count;
    int32_t winding;
    bool stored = which == LEVELS || which == CHUNKS, solid = w->tree.info.solid;
    ck_assert_uint_eq(ebpo_cursor_octcode(c), t->octcode);
    fine(ebpo_cursor_planes(c, codes, &count, &error), &error);
    if (t->type != EBPO_LEAF || stored) {
        ck_assert_uint_eq(count, t->count);
        ck_assert_int_eq(count && memcmp(codes, t->codes, count * sizeof *codes), 0);
    }
    fine(ebpo_cursor_children(c, &child, &error), &error);
    const ebpo_node *node = ebpo_cursor_node(c);
    ck_assert_int_eq(node->type, t->type);
    ck_assert_int_eq(node->pruned, t->pruned);
    ck_assert_int_eq(child != NULL, t->type == EBPO_GRAY && !t->pruned);
    if (which == CHUNKS || (which == LEVELS && !ebpo_node_is_uniform(node)))
        ck_assert_uint_eq(node->rank, t->rank);
    if (ebpo_node_is_uniform(node) && solid) {
        fine(ebpo_cursor_winding(c, &winding, &error), &error);
        ck_assert_int_eq(winding, t->winding);
    }
}

static void walk_all(whole *w, holder which)
{
    ebpo_error error = EBPO_ERROR_INIT;
    ebpo_cursor c;
    bool more = true;
    uint64_t i = 0;
    begin(w, which, &c);
    for (; more; i++) {
        ck_assert_uint_lt(i, w->reference.count);
        same_node(w, which, &c, &w->reference.node[i]);
        fine(ebpo_cursor_next(&c, false, &more, &error), &error);
    }
    ck_assert_uint_eq(i, w->reference.count);
    ck_assert_uint_eq(ebpo_cursor_octcode(&c), 1);
    /* from here on the cursor skips the subtrees of the root's children */
    fine(ebpo_cursor_next(&c, false, &more, &error), &error);
    for (ebpo_octcode code = 8; more; code++) {
        ck_assert_uint_eq(ebpo_cursor_octcode(&c), code);
        fine(ebpo_cursor_next(&c, true, &more, &error), &error);
        ck_assert_int_eq(more, code < 15);
    }
}

/* Jumps at random to cells of any level, to points, and back up; checks each time that the cursor
 * is at the deepest node around the target. */
static void jump_about(whole *w, holder which, uint64_t seed, uint64_t jumps)
{
    ebpo_error error = EBPO_ERROR_INIT;
    ebpo_cursor c;
    ebpo_box box = { .grid_level = w->tree.info.grid_level };
    memcpy(box.origin, w->tree.info.box_origin, sizeof box.origin);
    memcpy(box.size, w->tree.info.box_size, sizeof box.size);
    begin(w, which, &c);
    for (uint64_t i = 0; i < jumps; i++) {
        /* near existing nodes, and some levels above or below them */
        ebpo_octcode code = w->reference.node[ebpo_test_random(&seed) % w->reference.count].octcode;
        int deepest = w->tree.info.level_count, level = (int)(ebpo_test_random(&seed) % 3);
        while (level-- > 0 && ebpo_octcode_level(code) < deepest)
            code = code << 3 | ebpo_test_random(&seed) % 8;
        ebpo_cell cell = ebpo_cell_of_octcode(code);
        if (i % 2) {
            double p[3];
            bool within;
            for (int k = 0; k < 3; k++)
                p[k] = ebpo_cell_face(&box, k, cell.level,
                                      cell.at[k]); /* this point belongs to the cell */
            fine(ebpo_cursor_to_point(&c, &box, p, cell.level, &within, &error), &error);
            ck_assert(within);
        } else {
            fine(ebpo_cursor_to_cell(&c, cell, &error), &error);
        }
        same_node(w, which, &c, reference_find(&w->reference, code));
        for (uint64_t up = ebpo_test_random(&seed) % 3; up > 0; up--) {
            ebpo_octcode parent = ebpo_octcode_parent(ebpo_cursor_octcode(&c));
            ck_assert_int_eq(ebpo_cursor_up(&c), parent != 0);
            if (parent)
                same_node(w, which, &c, reference_find(&w->reference, parent));
        }
    }
    const double outside[3] = { INFINITY, 0, 0 };
    bool within = true;
    ebpo_octcode before = ebpo_cursor_octcode(&c);
    fine(ebpo_cursor_to_point(&c, &box, outside, 0, &within, &error), &error);
    ck_assert(!within && ebpo_cursor_octcode(&c) == before);
}

static void compare_all(whole *w, uint64_t seed)
{
    for (holder which = LEVELS; which < HOLDERS; which++)
        if (has(w, which)) {
            walk_all(w, which);
            jump_about(w, which, seed, ebpo_test_scaled(400));
        }
}

/* --- half-spaces and envelopes: from any start as by the direct path down --- */

/* Collects all planes above and at the node, in coordinates of its cell. */
static void plain_half_spaces(const reference *t, ebpo_octcode code, ebpo_half_spaces *out)
{
    out->count = 0;
    for (int up = ebpo_octcode_level(code); up >= 0; up--) {
        const reference_node *n = reference_find(t, code >> 3 * up);
        for (unsigned i = 0; i < n->count; i++) {
            ebpo_half_space h;
            int32_t d;
            bool keeps = true;
            ck_assert(ebpo_plane_code_decode(n->codes[i], h.n, &d));
            h.d = d;
            for (int k = up; k > 0 && keeps; k--) {
                unsigned octant = code >> 3 * (k - 1) & 7;
                int64_t most = 0;
                h.d *= 2;
                for (int axis = 0; axis < 3; axis++) {
                    h.d -= octant >> axis & 1 ? 4096 * h.n[axis] : 0;
                    most += h.n[axis] > 0 ? h.n[axis] : 0;
                }
                keeps = h.d < 4096 * most;
            }
            if (keeps)
                out->at[out->count++] = h;
        }
    }
}

static void compare_envelopes(whole *w, holder which, uint64_t seed, uint64_t jumps)
{
    ebpo_error error = EBPO_ERROR_INIT;
    static ebpo_half_spaces expected, found;
    static ebpo_envelope_stack kept, fresh;
    static ebpo_polytope cut;
    ebpo_cursor c;
    memset(&kept, 0, sizeof kept);
    begin(w, which, &c);
    for (uint64_t i = 0; i < jumps; i++) {
        const reference_node *n = &w->reference.node[ebpo_test_random(&seed) % w->reference.count];
        const ebpo_polytope *a, *b;
        if (n->type == EBPO_LEAF && which > CHUNKS)
            continue;
        fine(ebpo_cursor_to_cell(&c, ebpo_cell_of_octcode(n->octcode), &error), &error);
        plain_half_spaces(&w->reference, n->octcode, &expected);
        fine(ebpo_cursor_half_spaces(&c, true, &found, &error), &error);
        ck_assert_int_eq(found.count, expected.count);
        for (int k = 0; k < found.count; k++)
            ck_assert(found.at[k].d == expected.at[k].d &&
                      !memcmp(found.at[k].n, expected.at[k].n, sizeof found.at[k].n));
        memset(&fresh, 0, sizeof fresh);
        fine(ebpo_cursor_envelope(&c, &kept, &a, &error), &error);
        fine(ebpo_cursor_envelope(&c, &fresh, &b, &error), &error);
        ck_assert_int_eq(a->vertex_count, b->vertex_count);
        ck_assert_mem_eq(a->vertex, b->vertex, (size_t)a->vertex_count * sizeof a->vertex[0]);
        if (n->type == EBPO_BLACK) {
            ck_assert_double_eq(ebpo_polytope_volume(a), 1);
        } else if (w->model &&
                   n->type != EBPO_WHITE) { /* only for shapes, whose envelopes are never empty */
            ebpo_half_spaces_cut(&expected, 0, &cut);
            ck_assert_double_eq_tol(ebpo_polytope_volume(a), ebpo_polytope_volume(&cut), 1e-6);
        }
    }
}

/* --- trees --- */

START_TEST(test_cursor_nodes_match_plain_traversal)
{
    bool solid = _i % 4 != 3;
    random_tree_options options = { (uint64_t)_i + 1,     2 + _i % 6, 6, 4, solid, false,
                                    solid && _i % 2 == 1, _i % 3 == 0 };
    ebpo_error error = EBPO_ERROR_INIT;
    ebpo_write_options write = EBPO_WRITE_OPTIONS_INIT;
    ebpo_tree tree;
    whole w;
    random_tree_make(&tree, &options);
    fine(ebpo_tree_write(&tree, path, &write, &error), &error);
    ebpo_tree_free(&tree);
    whole_open(&w, path, 0, false);
    compare_all(&w, (uint64_t)_i);
    compare_envelopes(&w, LEVELS, (uint64_t)_i, 50);
    whole_close(&w);
}
END_TEST

static void build(ebpo_mesh mesh, uint32_t leaf_faces, uint32_t parts)
{
    ebpo_tree tree = model_build_parts(mesh, leaf_faces, parts);
    model_write(&tree, path, NULL);
}

static void cut_file(double low, double high, int last_level)
{
    ebpo_error error = EBPO_ERROR_INIT;
    ebpo_subset_options options = EBPO_SUBSET_OPTIONS_INIT;
    ebpo_file *file;
    fine(ebpo_open(path, &file, &error), &error);
    const ebpo_info *info = ebpo_file_info(file);
    options.boxed = high > low;
    for (int k = 0; k < 3; k++) {
        options.min[k] = info->box_origin[k] + low * info->box_size[k];
        options.max[k] = info->box_origin[k] + high * info->box_size[k];
    }
    options.last_level = last_level;
    fine(ebpo_subset(file, part_path, &options, &error), &error);
    ebpo_close(file);
}

static void compare_file(const char *name, uint64_t seed, bool pruned)
{
    whole w;
    for (int cut_level = 1; cut_level < 4; cut_level += 2) {
        whole_open(&w, name, cut_level, true);
        ck_assert_int_eq(w.tree.info.pruned, pruned);
        compare_all(&w, seed);
        for (holder which = LEVELS; which < HOLDERS; which++)
            if (has(&w, which))
                compare_envelopes(&w, which, seed, ebpo_test_scaled(60));
        whole_close(&w);
    }
}

enum { DEFAULT = EBPO_PART_PLANES | EBPO_PART_MESH | EBPO_PART_MAPS };

static void compare_model(ebpo_mesh mesh, uint32_t leaf_faces, uint32_t parts, uint64_t seed)
{
    build(mesh, leaf_faces, parts);
    compare_file(path, seed, false);
    cut_file(0.4, 0.55, -1);
    compare_file(part_path, seed, true);
    unlink(part_path);
    cut_file(0, 0, 2);
    compare_file(part_path, seed, true);
}

START_TEST(test_cursor_nodes_same_in_all_layouts)
{
    switch (_i) {
    case 0: compare_model(ebpo_test_torus(3, 1, 40, 30), 6, DEFAULT, 1); break;
    case 1: compare_model(ebpo_test_blob(9, 40, 3), 4, DEFAULT | EBPO_PART_LEAF_PLANES, 2); break;
    case 2: compare_model(ebpo_test_sheet(2, 24), 5, DEFAULT, 3); break;
    default: compare_model(ebpo_test_blob(8, 30, 5), 3, EBPO_PART_MESH, 4); break;
    }
}
END_TEST

START_TEST(test_cursor_nodes_of_real_model)
{
    const char *models = getenv("EBPO_MODELS");
    char name[4096];
    ebpo_mesh mesh;
    snprintf(name, sizeof name, "%s/conrod.ply", models ? models : "");
    if (models && ebpo_mesh_read(name, NULL, &mesh, NULL) == EBPO_OK)
        compare_model(mesh, 16, DEFAULT, 5);
}
END_TEST

TEST_SUITE(cursor)
{
    TCase *tests = tcase_create("cursor");
    tcase_set_timeout(tests, 600);
    tcase_add_checked_fixture(tests, make_folder, remove_folder);
    tcase_add_loop_test(tests, test_cursor_nodes_match_plain_traversal, 0, 24);
    tcase_add_loop_test(tests, test_cursor_nodes_same_in_all_layouts, 0, 4);
    tcase_add_test(tests, test_cursor_nodes_of_real_model);
    Suite *suite = suite_create("cursor");
    suite_add_tcase(suite, tests);
    return suite;
}
