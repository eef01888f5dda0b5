/* Verifies a file: runs all checks in order, and makes the report. The folder `verify` checks the
 * results of other folders, so it uses no code of `construct`, of the writer or of `query`, and has
 * its own vector functions. It tests faces against cells and half-spaces, and clips faces, by other
 * methods than the builder. The verifier and the builder share only the exact predicates
 * (tests/lint/test_layers.py checks this).
 *
 * The order of the checks:
 * 1. chunk directory and chunk checksums (verify_chunks.c)
 * 2. content checksum
 * 3. consistency of the arrays, which the checks of item 4 require
 * 4. structure, nesting, colours, patches, all nodes with their faces (containment, lists, labels),
 *    subtrees, chunks of faces
 * 5. source mesh
 * 6. unused bytes
 * Damage that is found while reading is a violation, not an error of the call.
 *
 * This file also checks the colours of gray nodes, from the root down. The colour of a gray node is
 * the mean of the colours of the faces below it. The check does not compute the mean: comparisons
 * of integers decide if the stored byte is nearest to the mean. */
#include "core/strict_fp.h"

#include <inttypes.h>
#include <math.h>
#include <string.h>

#include <ebpo/colours.h>

#include "core/error.h"
#include "core/parallel.h"
#include "core/fp_env.h"
#include "core/wide.h"
#include "core/workspace.h"
#include "mesh/mesh_parts.h"
#include "verify/tally.h"
#include "verify/verify_parts.h"
#include "verify/verify_tree.h"

/* --- colours of gray nodes --- */

/* Number of leaves after which pages of the workspace are released. */
enum { NODES_A_TIME = 128 };

/* Weighted sums over the corners of faces. The weight of a corner is the weight of its face
 * (add_face). */
typedef struct colour_sums {
    ebpo_wide of[4]; /* 0 to 2: weight times red, green, blue; 3: weight */
} colour_sums;

/* The check of all colours. */
typedef struct colour_check {
    ebpo_tally *tally;
    const ebpo_reference_tree *view;
    ebpo_colours colours;
    bool by_face;    /* true: the colours of faces are used; false: the colours of vertices */
    double longest;  /* longest side of the root cell */
    uint64_t leaves; /* number of visited leaves */
} colour_check;

/* Adds the colour of a corner to *sum. */
static void add_corner(uint64_t weight, const uint8_t *rgba, colour_sums *sum)
{
    for (int k = 0; k < 3; k++)
        sum->of[k] = ebpo_wide_plus(sum->of[k], ebpo_wide_product(weight, rgba[k]));
    sum->of[3] = ebpo_wide_plus(sum->of[3], (ebpo_wide){ 0, weight });
}

/* Adds the corners of a face to *sum. The weight of the face is 1 + floor(2^32 A / L^2), where A is
 * twice the face's area, and L is the longest side of the root cell. */
static void add_face(const colour_check *j, uint64_t face, colour_sums *sum)
{
    const ebpo_mesh *mesh = &j->view->tree->mesh;
    double at[3][3], edge[2][3], across[3];
    for (uint64_t i = 0; i < 3; i++)
        ebpo_mesh_position(mesh, mesh->faces[3 * face + i], at[i]);
    for (int k = 0; k < 3; k++) {
        edge[0][k] = (at[1][k] - at[0][k]) / j->longest;
        edge[1][k] = (at[2][k] - at[0][k]) / j->longest;
    }
    for (int k = 0; k < 3; k++) {
        int next = (k + 1) % 3, last = (k + 2) % 3;
        double left = edge[0][next] * edge[1][last], right = edge[0][last] * edge[1][next];
        across[k] = left - right;
    }
    double squares = across[0] * across[0] + across[1] * across[1];
    double area = ldexp(sqrt(squares + across[2] * across[2]), 32);
    /* a face with a larger weight extends beyond the root cell; check_vertices (verify_tree.c)
     * reports it */
    uint64_t weight = area < 0x1p40 ? (uint64_t)area + 1 : 1;
    for (uint64_t i = 0; i < 3; i++)
        add_corner(weight,
                   j->by_face ? j->colours.face + 4 * face
                              : j->colours.vertex + 4 * (uint64_t)mesh->faces[3 * face + i],
                   sum);
}

static void add_leaf(colour_check *j, const ebpo_reference_node *leaf, colour_sums *sum)
{
    const ebpo_level *level = &j->view->tree->level[leaf->cell.level];
    uint32_t count;
    const uint32_t *refs = ebpo_reference_refs(j->view, leaf, &count);
    for (uint32_t i = 0; i < count; i++)
        add_face(j, refs[i], sum);
    for (uint64_t i = 0; i < level->leaf_new[leaf->rank]; i++)
        add_face(j, level->leaf_first[leaf->rank] + i, sum);
    if (++j->leaves % NODES_A_TIME == 0)
        ebpo_release_pages(j->view->workspace);
}

/* Returns true if the stored byte of a channel is nearest to the mean: byte - 1/2 <= mean < byte +
 * 1/2. */
static bool is_nearest(const colour_sums *sum, int channel, uint32_t byte)
{
    /* the same condition, multiplied by 2 * weight and with `weight` added: 2 * byte * weight <=
     * doubled < 2 * (byte + 1) * weight */
    ebpo_wide weight = sum->of[3],
              doubled = ebpo_wide_plus(ebpo_wide_left(sum->of[channel], 1), weight);
    return !ebpo_wide_less(doubled, ebpo_wide_times(weight, 2 * (uint64_t)byte)) &&
           ebpo_wide_less(doubled, ebpo_wide_times(weight, 2 * (uint64_t)byte + 2));
}

static void check_node(const colour_check *j, const ebpo_reference_node *node,
                       const colour_sums *sum)
{
    uint32_t colour = j->view->tree->level[node->cell.level].gray_colours[node->rank];
    bool correct = true;
    for (int k = 0; k < 3 && (sum->of[3].high || sum->of[3].low); k++)
        correct = correct && is_nearest(sum, k, colour >> 8 * k & 255);
    j->tally->checks[EBPO_VERIFY_STRUCTURE]++;
    if (!correct)
        ebpo_tally_violation(j->tally, EBPO_VERIFY_STRUCTURE,
                             &(ebpo_verify_place){ node->code, EBPO_NO_FACE, EBPO_NO_PLANE },
                             "its colour %06" PRIx32 " is not the mean of the faces below", colour);
}

/* Checks the colours of a node and of all nodes below, and adds the sums over the faces below this
 * node to *above. */
static void check_subtree_colours(colour_check *j, const ebpo_reference_node *node,
                                  colour_sums *above)
{
    colour_sums sum = { { { 0, 0 } } };
    if (node->type == EBPO_LEAF)
        add_leaf(j, node, &sum);
    for (unsigned octant = 0; octant < 8 && node->type == EBPO_GRAY; octant++) {
        ebpo_reference_node child = ebpo_reference_child(j->view, node, octant);
        check_subtree_colours(j, &child, &sum);
    }
    if (node->type == EBPO_GRAY)
        check_node(j, node, &sum);
    for (int i = 0; i < 4; i++)
        above->of[i] = ebpo_wide_plus(above->of[i], sum.of[i]);
}

/* Returns true if the vertices have colours that are not all equal. */
static bool vertices_differ(const colour_check *j)
{
    const uint8_t *rgba = j->colours.vertex;
    for (uint64_t i = 1; rgba && i < j->view->tree->mesh.vertex_count; i++)
        if (memcmp(rgba, rgba + 4 * i, 3) != 0)
            return true;
    return false;
}

/* Checks the colours of a tree that has passed ebpo_check_shape. Does nothing if the tree is a
 * subset or has no mesh, or if the mesh has no colours. Fails with EBPO_E_MEMORY. */
static ebpo_status check_colours(ebpo_tally *tally, const ebpo_reference_tree *view,
                                 ebpo_error *error)
{
    const ebpo_tree *tree = view->tree;
    colour_check j = { .tally = tally, .view = view };
    if (!(tree->info.parts & EBPO_PART_COLOURS) || !view->has_mesh || tree->info.pruned)
        return EBPO_OK;
    ebpo_status status = ebpo_mesh_colours(&tree->mesh, &j.colours, error);
    if (status != EBPO_OK || (!j.colours.vertex && !j.colours.face))
        return status;
    j.by_face = j.colours.face && !vertices_differ(&j);
    for (int k = 0; k < 3; k++)
        j.longest = fmax(j.longest, view->box.size[k]);
    colour_sums all = { { { 0, 0 } } };
    ebpo_reference_node root = ebpo_reference_root(view);
    check_subtree_colours(&j, &root, &all);
    ebpo_colours_free(&j.colours);
    return EBPO_OK;
}

/* --- the checks in order --- */

/* Runs all checks of a tree. `file`: the file of the tree, or NULL. */
static ebpo_status verify_tree_of(ebpo_tally *tally, const ebpo_file *file, const ebpo_tree *tree,
                                  const ebpo_verify_options *options, ebpo_error *error)
{
    if (!ebpo_check_shape(tally, tree))
        return EBPO_OK;
    if (tree->info.parts & EBPO_PART_BORDER && !ebpo_check_border_loops(tally, tree))
        return EBPO_OK;
    ebpo_reference_tree view;
    ebpo_status status = ebpo_reference_make(&view, tree, options->workspace, error);
    if (status != EBPO_OK)
        return status;
    ebpo_check_structure(tally, &view);
    ebpo_check_nesting(tally, &view);
    status = check_colours(tally, &view, error);
    if (status == EBPO_OK)
        status = ebpo_check_patches(tally, tree, options->workspace, error);
    if (status == EBPO_OK)
        status = ebpo_verify_walk(tally, &view, options, error);
    if (status == EBPO_OK)
        status = ebpo_check_inside(tally, &view, ebpo_thread_count(options->threads),
                                   &options->progress, error);
    if (status == EBPO_OK && file)
        status = ebpo_check_subtrees(tally, file, &view, options, error);
    if (status == EBPO_OK && file)
        status = ebpo_check_gates(tally, file, tree, error);
    ebpo_reference_free(&view);
    return status;
}

ebpo_status ebpo_verify_tree(ebpo_tally *tally, const ebpo_tree *tree,
                             const ebpo_verify_options *options, ebpo_error *error)
{
    return verify_tree_of(tally, NULL, tree, options, error);
}

/* Returns true if the file is the cause of the failure, not this machine or the call. */
static bool is_damage(ebpo_status status)
{
    return status == EBPO_E_FORMAT || status == EBPO_E_VERSION || status == EBPO_E_LIMIT;
}

static ebpo_read_options read_options_of(const ebpo_verify_options *options)
{
    ebpo_read_options read = EBPO_READ_OPTIONS_INIT;
    read.threads = options->threads;
    read.workspace = options->workspace;
    return read;
}

static ebpo_status check_content(const ebpo_file *file, const ebpo_verify_options *options,
                                 ebpo_tally *tally, ebpo_error *error)
{
    ebpo_error failure = EBPO_ERROR_INIT;
    ebpo_read_options read = read_options_of(options);
    ebpo_status status = ebpo_file_check_content(file, &read, &failure);
    if (status == EBPO_OK || is_damage(status)) {
        ebpo_tally_check(tally, EBPO_VERIFY_CONTENT, status == EBPO_OK, "%s", failure.message);
        return EBPO_OK;
    }
    return ebpo_fail_with(error, &failure);
}

/* Reads the tree and runs all its checks. */
static ebpo_status check_tree(const ebpo_file *file, const ebpo_verify_options *options,
                              ebpo_tally *tally, ebpo_error *error)
{
    ebpo_error failure = EBPO_ERROR_INIT;
    ebpo_read_options read = read_options_of(options);
    ebpo_tree tree = { 0 };
    ebpo_status status = ebpo_file_read_tree(file, &read, &tree, &failure);
    if (status == EBPO_OK || is_damage(status))
        ebpo_tally_check(tally, EBPO_VERIFY_STRUCTURE, status == EBPO_OK, "%s", failure.message);
    if (status == EBPO_OK) {
        status = verify_tree_of(tally, file, &tree, options, error);
        ebpo_tree_free(&tree);
        return status;
    }
    return is_damage(status) ? EBPO_OK : ebpo_fail_with(error, &failure);
}

static ebpo_status check_source(const ebpo_file *file, const ebpo_verify_options *options,
                                ebpo_tally *tally, ebpo_error *error)
{
    ebpo_error failure = EBPO_ERROR_INIT;
    ebpo_read_options read = read_options_of(options);
    read.attributes = options->source->attributes != NULL;
    ebpo_mesh stored;
    bool ordered = false;
    if (ebpo_file_info(file)->pruned)
        return ebpo_check_source(tally, file, NULL, false, options->source, &read, error);
    ebpo_status status = ebpo_file_read_source_mesh(file, &read, &stored, &ordered, &failure);
    if (is_damage(status)) {
        ebpo_tally_check(tally, EBPO_VERIFY_SOURCE, false, "%s", failure.message);
        return EBPO_OK;
    }
    if (status != EBPO_OK)
        return ebpo_fail_with(error, &failure);
    status = ebpo_check_source(tally, file, &stored, ordered, options->source, &read, error);
    ebpo_mesh_free(&stored);
    return status;
}

ebpo_status ebpo_verify(const ebpo_file *file, const ebpo_verify_options *options,
                        ebpo_verify_report *report, ebpo_error *error)
{
    EBPO_DEFAULT_FP;
    ebpo_verify_options wanted = EBPO_VERIFY_OPTIONS_INIT;
    ebpo_verify_report found = EBPO_VERIFY_REPORT_INIT;
    ebpo_status status = EBPO_CHECK_SIZED(ebpo_verify_report, report, error);
    if (status == EBPO_OK)
        status = EBPO_TAKE(ebpo_verify_options, &wanted, options, error);
    if (status != EBPO_OK)
        return status;
    EBPO_GIVE(ebpo_verify_report, report, &found);
    options = &wanted;
    if (!file)
        return ebpo_fail(error, EBPO_E_ARGUMENT, "verify: no file; open a file with ebpo_open");
    if (options->source) {
        ebpo_status shape = ebpo_mesh_check_shape(options->source, error);
        if (shape != EBPO_OK)
            return shape;
        if (options->source->arrangement)
            return ebpo_fail(
                error, EBPO_E_ARGUMENT,
                "verify: the source has been arranged (ebpo_mesh_arrange); pass it as it was read");
    }
    ebpo_tally tally = { 0 };
    status = ebpo_check_chunk_offsets(&tally, file, options, error);
    /* checksums are not meaningful if chunks are not at the listed offsets */
    if (status == EBPO_OK && tally.violations[EBPO_VERIFY_STRUCTURE] == 0)
        status = ebpo_check_checksums(&tally, file, error);
    if (status == EBPO_OK)
        status = check_content(file, options, &tally, error);
    if (status == EBPO_OK)
        status = check_tree(file, options, &tally, error);
    if (status == EBPO_OK && options->source)
        status = check_source(file, options, &tally, error);
    if (status == EBPO_OK)
        status = ebpo_count_spare(file, &options->progress, &found.spare_bytes, &found.spare_filled,
                                  error);
    if (status == EBPO_OK)
        ebpo_tally_report(&tally, &found);
    EBPO_GIVE(ebpo_verify_report, report, &found);
    return status;
}
