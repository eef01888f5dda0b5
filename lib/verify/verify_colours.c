/* From the root down, node by node; no byte is computed: whether it is the right one is a question
 * of two products. */
#include "core/strict_fp.h"

#include "verify/verify_colours.h"

#include <inttypes.h>
#include <math.h>
#include <string.h>

#include <ebpo/colours.h>

#include "core/workspace.h"
#include "core/wide.h"
#include "mesh/mesh_parts.h"

enum { NODES_A_TIME = 128 };

typedef struct totals {
    ebpo_wide of[4]; /* weights times colours, and weights; all three times */
} totals;

typedef struct judging {
    ebpo_tally *tally;
    const ebpo_twin_tree *view;
    ebpo_colours colours;
    bool by_face;
    double longest; /* side of the root cell */
    uint64_t leaves;
} judging;

static void add_corner(uint64_t weight, const uint8_t *rgba, totals *sum)
{
    for (int k = 0; k < 3; k++)
        sum->of[k] = ebpo_wide_plus(sum->of[k], ebpo_wide_product(weight, rgba[k]));
    sum->of[3] = ebpo_wide_plus(sum->of[3], (ebpo_wide){ 0, weight });
}

static void add_listed(const judging *j, uint64_t face, totals *sum)
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
    /* faces beyond the root cell are found elsewhere */
    uint64_t weight = area < 0x1p40 ? (uint64_t)area + 1 : 1;
    for (uint64_t i = 0; i < 3; i++)
        add_corner(weight,
                   j->by_face ? j->colours.face + 4 * face
                              : j->colours.vertex + 4 * (uint64_t)mesh->faces[3 * face + i],
                   sum);
}

static void add_list(judging *j, const ebpo_twin_node *leaf, totals *sum)
{
    const ebpo_level *level = &j->view->tree->level[leaf->cell.level];
    uint32_t count;
    const uint32_t *refs = ebpo_twin_refs(j->view, leaf, &count);
    for (uint32_t i = 0; i < count; i++)
        add_listed(j, refs[i], sum);
    for (uint64_t i = 0; i < level->leaf_new[leaf->rank]; i++)
        add_listed(j, level->leaf_first[leaf->rank] + i, sum);
    if (++j->leaves % NODES_A_TIME == 0)
        ebpo_release_pages(j->view->workspace);
}

/* byte - 1/2 <= mean < byte + 1/2 */
static bool is_nearest(const totals *sum, int channel, uint32_t byte)
{
    ebpo_wide one = sum->of[3], above = ebpo_wide_plus(ebpo_wide_left(sum->of[channel], 1), one);
    return !ebpo_wide_less(above, ebpo_wide_times(one, 2 * (uint64_t)byte)) &&
           ebpo_wide_less(above, ebpo_wide_times(one, 2 * (uint64_t)byte + 2));
}

static void check_node(const judging *j, const ebpo_twin_node *node, const totals *sum)
{
    uint32_t colour = j->view->tree->level[node->cell.level].gray_colours[node->rank];
    bool right = true;
    for (int k = 0; k < 3 && (sum->of[3].high || sum->of[3].low); k++)
        right = right && is_nearest(sum, k, colour >> 8 * k & 255);
    j->tally->checks[EBPO_VERIFY_STRUCTURE]++;
    if (!right)
        ebpo_tally_violation(j->tally, EBPO_VERIFY_STRUCTURE,
                             &(ebpo_verify_place){ node->code, EBPO_NO_FACE, EBPO_NO_PLANE },
                             "its colour %06" PRIx32 " is not the mean of the faces below", colour);
}

static void judge(judging *j, const ebpo_twin_node *node, totals *above)
{
    totals sum = { { { 0, 0 } } };
    if (node->type == EBPO_LEAF)
        add_list(j, node, &sum);
    for (unsigned octant = 0; octant < 8 && node->type == EBPO_GRAY; octant++) {
        ebpo_twin_node child = ebpo_twin_child(j->view, node, octant);
        judge(j, &child, &sum);
    }
    if (node->type == EBPO_GRAY)
        check_node(j, node, &sum);
    for (int i = 0; i < 4; i++)
        above->of[i] = ebpo_wide_plus(above->of[i], sum.of[i]);
}

static bool vertices_differ(const judging *j)
{
    const uint8_t *rgba = j->colours.vertex;
    for (uint64_t i = 1; rgba && i < j->view->tree->mesh.vertex_count; i++)
        if (memcmp(rgba, rgba + 4 * i, 3) != 0)
            return true;
    return false;
}

ebpo_status ebpo_check_colours(ebpo_tally *tally, const ebpo_twin_tree *view, ebpo_error *error)
{
    const ebpo_tree *tree = view->tree;
    judging j = { .tally = tally, .view = view };
    if (!(tree->info.parts & EBPO_PART_COLOURS) || !view->has_mesh || tree->info.pruned)
        return EBPO_OK;
    ebpo_status status = ebpo_mesh_colours(&tree->mesh, &j.colours, error);
    if (status != EBPO_OK || (!j.colours.vertex && !j.colours.face))
        return status;
    j.by_face = j.colours.face && !vertices_differ(&j);
    for (int k = 0; k < 3; k++)
        j.longest = fmax(j.longest, view->box.size[k]);
    totals all = { { { 0, 0 } } };
    ebpo_twin_node root = ebpo_twin_root(view);
    judge(&j, &root, &all);
    ebpo_colours_free(&j.colours);
    return EBPO_OK;
}
