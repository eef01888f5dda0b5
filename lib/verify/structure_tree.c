/* What a tree must be beyond fitting its arrays. */
#include "core/strict_fp.h"

#include "verify/structure.h"

#include <inttypes.h>
#include <math.h>

#include "core/workspace.h"
#include "core/hash.h"
#include "mesh/mesh_parts.h"

#define CHECK(condition, ...) ebpo_tally_check(tally, EBPO_VERIFY_STRUCTURE, condition, __VA_ARGS__)

/* A volume cannot be more than that of the cells it lies in; the slack is for the rounding of sums.
 * Coordinates beyond about 1e102 or below 1e-102 have volumes that no double holds: the format
 * leaves those unspecified. */
static bool volume_possible(double volume, uint64_t cells, int l, const ebpo_info *info)
{
    double cell =
        ldexp(info->box_size[0], -l) * ldexp(info->box_size[1], -l) * ldexp(info->box_size[2], -l);
    if (!isnormal(cell))
        return true;
    return volume >= 0 && volume <= (double)cells * cell * (1 + 1e-6);
}

static void check_summary(ebpo_tally *tally, const ebpo_tree *tree, int l)
{
    const ebpo_level *level = &tree->level[l];
    const ebpo_level_summary *stored = &tree->info.level[l];
    CHECK(stored->gray_count == level->gray_count && stored->leaf_count == level->leaf_count &&
              stored->white_count == level->white_count &&
              stored->black_count == level->black_count,
          "level %d: the head's counts of nodes differ from the level's", l);
    CHECK(stored->plane_count == level->plane_count &&
              stored->leaf_plane_count == level->leaf_plane_count,
          "level %d: the head's counts of planes differ from the level's", l);
    CHECK(stored->new_count == level->new_count && stored->ref_count == level->ref_count,
          "level %d: the head's counts of faces differ from the level's", l);
    CHECK(stored->gray_volume == level->gray_volume && stored->leaf_volume == level->leaf_volume,
          "level %d: the head's volumes differ from the level's", l);
    CHECK(volume_possible(level->gray_volume, level->gray_count, l, &tree->info) &&
              volume_possible(level->leaf_volume, level->leaf_count, l, &tree->info),
          "level %d: envelopes of volume %g and %g do not fit their cells", l, level->gray_volume,
          level->leaf_volume);
}

typedef struct descent {
    ebpo_tally *tally;
    const ebpo_twin_tree *view;
    uint64_t next_face; /* first face that no leaf before has listed */
    uint64_t grays;
    uint64_t pruned[EBPO_LEVELS_MAX];
} descent;

static void node_check(descent *d, const ebpo_twin_node *node, bool holds, const char *text)
{
    d->tally->checks[EBPO_VERIFY_STRUCTURE]++;
    if (!holds)
        ebpo_tally_violation(d->tally, EBPO_VERIFY_STRUCTURE,
                             &(ebpo_verify_place){ node->code, EBPO_NO_FACE, EBPO_NO_PLANE }, "%s",
                             text);
}

static void check_leaf(descent *d, const ebpo_twin_node *leaf)
{
    const ebpo_info *info = &d->view->tree->info;
    const ebpo_level *level = &d->view->tree->level[leaf->cell.level];
    if (!d->view->has_mesh)
        return;
    uint64_t listed = (uint64_t)level->leaf_new[leaf->rank] + level->leaf_ref_count[leaf->rank];
    node_check(
        d, leaf, level->leaf_first[leaf->rank] == d->next_face,
        "the leaf's new faces do not follow those of the leaf before it in depth-first order");
    node_check(d, leaf, listed > 0, "the leaf lists no face");
    node_check(d, leaf, leaf->cell.level >= info->max_level || listed <= info->leaf_faces,
               "the leaf lists more faces than a leaf above the maximum level may");
    d->next_face = level->leaf_first[leaf->rank] + level->leaf_new[leaf->rank];
}

static void check_gray(descent *d, const ebpo_twin_node *node);

static void check_node(descent *d, const ebpo_twin_node *node)
{
    if (node->type == EBPO_LEAF)
        check_leaf(d, node);
    else if (node->type == EBPO_GRAY)
        check_gray(d, node);
    else if (node->type == EBPO_BLACK)
        node_check(d, node, d->view->tree->info.solid,
                   "a surface has no inside, but the node is black");
}

static void check_gray(descent *d, const ebpo_twin_node *node)
{
    if (ebpo_twin_is_pruned(d->view, node)) { /* may have been a leaf */
        d->pruned[node->cell.level]++;
        return;
    }
    node_check(d, node, node->cell.level < d->view->tree->info.max_level,
               "a node at the maximum level is gray");
    bool touched = false;
    if (d->grays++ % EBPO_ITEMS_IN_ORDER == 0)
        ebpo_release_pages(d->view->workspace);
    for (unsigned octant = 0; octant < 8; octant++) {
        ebpo_twin_node child = ebpo_twin_child(d->view, node, octant);
        touched |= child.type >= EBPO_LEAF;
        check_node(d, &child);
    }
    node_check(d, node, touched, "the node is gray, but no child of it is gray or a leaf");
}

static void check_vertices(ebpo_tally *tally, const ebpo_twin_tree *view)
{
    const ebpo_mesh *mesh = &view->tree->mesh;
    uint64_t outside = 0, first = 0;
    EBPO_FOR_ITEMS(mesh->workspace, i, 0, 3 * mesh->face_count) {
        double p[3];
        ebpo_mesh_position(mesh, mesh->faces[i], p);
        bool within = true;
        for (int k = 0; k < 3; k++)
            within &= p[k] > view->box.origin[k] && p[k] < view->box.origin[k] + view->box.size[k];
        first = within || outside ? first : i;
        outside += !within;
    }
    CHECK(outside == 0,
          "%" PRIu64 " corners of faces are not strictly inside the root box, face %" PRIu64
          " first",
          outside, first / 3);
}

/* A sum of signed random values, one for each undirected edge: it vanishes when directions cancel,
 * and else but for one case in 2^64. */
static bool edges_balance(const ebpo_mesh *mesh)
{
    uint64_t sum = 0;
    EBPO_FOR_ITEMS(mesh->workspace, f, 0, mesh->face_count)
        for (int i = 0; i < 3; i++) {
            uint64_t a = mesh->faces[3 * f + (uint64_t)i],
                     b = mesh->faces[3 * f + (uint64_t)(i + 1) % 3];
            uint64_t value = a < b ? ebpo_random_mix(a << 32 | b) : -ebpo_random_mix(b << 32 | a);
            sum += a == b ? 0 : value;
        }
    return sum == 0;
}

void ebpo_check_structure(ebpo_tally *tally, const ebpo_twin_tree *view)
{
    const ebpo_tree *tree = view->tree;
    for (int l = 0; l < tree->info.level_count; l++)
        check_summary(tally, tree, l);
    descent d = { .tally = tally, .view = view };
    ebpo_twin_node root = ebpo_twin_root(view);
    check_node(&d, &root);
    for (int l = 0; l < tree->info.level_count; l++)
        CHECK(d.pruned[l] == tree->info.level[l].pruned_count,
              "level %d: %" PRIu64 " nodes are pruned, the head says %" PRIu64, l, d.pruned[l],
              tree->info.level[l].pruned_count);
    if (!view->has_mesh)
        return;
    CHECK(d.next_face == tree->mesh.face_count, "leaves list %" PRIu64 " of %" PRIu64 " faces",
          d.next_face, tree->mesh.face_count);
    check_vertices(tally, view);
    if (tree->info.solid && !tree->info.pruned) /* a part of a mesh need not balance */
        CHECK(edges_balance(&tree->mesh),
              "the file says solid, but the directions of the mesh's edges do not cancel");
}
