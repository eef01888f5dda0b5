/* Compares subtrees as plain arrays with a reference implementation that reads the whole file and
 * selects nodes. */
#include <limits.h>
#include <math.h>
#include <pthread.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#include <ebpo/ebpo.h>

#include "check_main.h"
#include "counted_source.h"
#include "model_file.h"
#include "geometry/level_nodes.h"
#include "geometry/cells.h"
#include "random_tree.h"
#include "read_by.h"
#include "scratch.h"
#include "solids.h"

static const char *path;

static void make_folder(void)
{
    scratch_enter();
    path = scratch("x.ebpo.h5");
}

enum { DEFAULT = EBPO_PART_PLANES | EBPO_PART_MESH | EBPO_PART_MAPS, FEW = 6 };

/* --- files --- */

/* Files of an even number of levels have separate subtrees, if there are enough faces. */
static ebpo_file *write_tree(ebpo_tree *tree, uint32_t parts, ebpo_codec codec)
{
    ebpo_write_options options = EBPO_WRITE_OPTIONS_INIT;
    options.parts = parts;
    options.codec = codec;
    options.subtree_faces = tree->info.level_count % 2 ? EBPO_NO_SUBTREES : 60;
    model_write(tree, path, &options);
    return model_open(path);
}

static ebpo_file *write_random(uint64_t seed, int levels, unsigned gray_share, bool leaf_planes)
{
    bool solid = seed % 3 != 0;
    random_tree_options options = {
        seed, levels, gray_share, 5, solid, seed % 2 != 0, solid && seed % 4 != 0, leaf_planes
    };
    ebpo_tree tree;
    random_tree_make(&tree, &options);
    return write_tree(&tree, ~0u, EBPO_CODEC_ZSTD);
}

static ebpo_file *write_solid(ebpo_mesh mesh, uint32_t parts, uint32_t leaf_faces, ebpo_codec codec)
{
    ebpo_tree tree = model_build_parts(mesh, leaf_faces, parts);
    return write_tree(&tree, parts, codec);
}

/* --- the reference implementation: every node of the file, level after level --- */

typedef struct reference_node {
    /* numbers of such nodes before the node in its level, and number of their references */
    uint64_t octcode, rank[4], refs;
    uint64_t plane; /* index of the node's first plane in the level */
    ebpo_node_type type;
} reference_node;

typedef struct reference {
    ebpo_tree tree;
    reference_node *node[EBPO_LEVELS_MAX];
    uint64_t count[EBPO_LEVELS_MAX];
} reference;

static void count_on(reference_node *at, const ebpo_level *l, reference_node *out,
                     uint64_t planes[2])
{
    *out = *at;
    out->plane = at->type == EBPO_LEAF ? planes[1] : planes[0];
    if (at->type == EBPO_GRAY && l->plane_counts)
        planes[0] += l->plane_counts[at->rank[EBPO_GRAY]];
    if (at->type == EBPO_LEAF && l->leaf_plane_counts)
        planes[1] += l->leaf_plane_counts[at->rank[EBPO_LEAF]];
    if (at->type == EBPO_LEAF && l->leaf_ref_count)
        at->refs += l->leaf_ref_count[at->rank[EBPO_LEAF]];
    at->rank[at->type]++;
}

static void list_level(reference *t, int i)
{
    const ebpo_level *l = &t->tree.level[i];
    uint64_t group = 0, planes[2] = { 0, 0 }, parents = i ? t->count[i - 1] : 1;
    reference_node at = { .octcode = 1 };
    t->node[i] = calloc(8 * l->group_count + 1, sizeof *t->node[i]);
    for (uint64_t p = 0; p < parents; p++) {
        if (i && t->node[i - 1][p].type != EBPO_GRAY)
            continue;
        uint16_t types = l->types[group++];
        if (i && t->tree.info.pruned && types == 0) {
            at.rank[EBPO_WHITE] += 8;
            continue;
        }
        for (unsigned octant = 0; octant < (i ? 8 : 1); octant++) {
            at.octcode = i ? t->node[i - 1][p].octcode << 3 | octant : 1;
            at.type = (ebpo_node_type)(types >> 2 * octant & 3);
            count_on(&at, l, &t->node[i][t->count[i]++], planes);
        }
    }
}

static void reference_make(reference *t, const ebpo_file *file)
{
    ebpo_error error = EBPO_ERROR_INIT;
    memset(t, 0, sizeof *t);
    ck_assert_msg(ebpo_file_read_tree(file, READ_BY(1), &t->tree, &error) == EBPO_OK, "%s",
                  error.message);
    for (int i = 0; i < t->tree.info.level_count; i++)
        list_level(t, i);
}

static void reference_free(reference *t)
{
    for (int i = 0; i < EBPO_LEVELS_MAX; i++)
        free(t->node[i]);
    ebpo_tree_free(&t->tree);
}

/* --- comparing --- */

typedef struct pair {
    const reference *t;
    ebpo_subtree *subtree;
    ebpo_subtree_nodes nodes;
    ebpo_subtree_faces faces;
    uint64_t octcode;
    int level;
    uint8_t *listed; /* flag by index in the file; 2: new in this subtree */
} pair;

static int32_t winding_of(const ebpo_level *l, const reference_node *n)
{
    const int32_t *of_type[4] = { l->white_winding, l->black_winding, l->leaf_winding, NULL };
    return of_type[n->type] ? of_type[n->type][n->rank[n->type]] : n->type == EBPO_BLACK;
}

static void compare_planes(const pair *p, const ebpo_level *l, const reference_node *n,
                           uint64_t number)
{
    uint64_t count = 0;
    const uint32_t *codes = n->type == EBPO_LEAF ? l->leaf_planes : l->planes;
    if (n->type == EBPO_GRAY && l->plane_counts)
        count = l->plane_counts[n->rank[EBPO_GRAY]];
    if (n->type == EBPO_LEAF && l->leaf_plane_counts)
        count = l->leaf_plane_counts[n->rank[EBPO_LEAF]];
    if (!p->nodes.plane_first) {
        ck_assert(count == 0);
        return;
    }
    uint32_t first = p->nodes.plane_first[number];
    ck_assert(p->nodes.plane_first[number + 1] - first == count);
    ck_assert(count == 0 || memcmp(p->nodes.planes + first, codes + n->plane, count * 4) == 0);
}

static void compare_list(pair *p, const ebpo_level *l, const reference_node *n, uint64_t number)
{
    uint32_t first = p->faces.list_first[number];
    uint64_t rank = n->rank[EBPO_LEAF];
    uint32_t refs = n->type == EBPO_LEAF ? l->leaf_ref_count[rank] : 0,
             fresh = n->type == EBPO_LEAF ? l->leaf_new[rank] : 0;
    ck_assert(p->faces.list_first[number + 1] - first == refs + fresh);
    for (uint32_t k = 0; k < refs + fresh; k++) {
        uint64_t face = k < refs ? l->leaf_refs[n->refs + k] : l->leaf_first[rank] + (k - refs);
        ck_assert(p->faces.list[first + k] < p->faces.face_count);
        ck_assert(p->faces.file_faces[p->faces.list[first + k]] == face);
        if (p->listed[face] < 2)
            p->listed[face] = k < refs ? 1 : 2;
    }
}

/* Compares nodes of level `level` of the tree; `links` counts the gray nodes of the previous level.
 */
static void compare_level(pair *p, int i, bool has_faces)
{
    int level = p->level + i;
    const ebpo_level *l = &p->t->tree.level[level];
    uint64_t number = p->nodes.level_first[i];
    for (uint64_t k = 0; k < p->t->count[level]; k++) {
        const reference_node *n = &p->t->node[level][k];
        if (n->octcode >> 3 * i != p->octcode)
            continue;
        ck_assert(number < p->nodes.level_first[i + 1]);
        ck_assert(p->nodes.octcodes[number] == n->octcode);
        ck_assert(p->nodes.types[number] == n->type);
        ck_assert(!p->nodes.windings == !p->t->tree.info.solid);
        if (p->nodes.windings)
            ck_assert(p->nodes.windings[number] == (n->type == EBPO_GRAY ? 0 : winding_of(l, n)));
        compare_planes(p, l, n, number);
        if (has_faces)
            compare_list(p, l, n, number);
        number++;
    }
    ck_assert(number == p->nodes.level_first[i + 1]);
}

/* Checks that children are at the position of their octcodes in the next level, or are missing. */
static void compare_children(const pair *p)
{
    uint64_t linked = 1;
    for (uint64_t i = 0; i < p->nodes.node_count; i++) {
        uint32_t first = p->nodes.children[i];
        if (first == EBPO_NO_CHILDREN)
            continue;
        ck_assert(p->nodes.types[i] == EBPO_GRAY);
        ck_assert((uint64_t)first + 8 <= p->nodes.node_count);
        for (unsigned octant = 0; octant < 8; octant++)
            ck_assert(p->nodes.octcodes[first + octant] == (p->nodes.octcodes[i] << 3 | octant));
        linked += 8;
    }
    ck_assert(linked == p->nodes.node_count); /* each node has its parent */
}

static void compare_corner(const pair *p, uint64_t face, int corner)
{
    const ebpo_mesh *mesh = &p->t->tree.mesh;
    uint64_t ours = p->faces.faces[3 * face + (uint64_t)corner],
             theirs = mesh->faces[3 * (uint64_t)p->faces.file_faces[face] + (uint64_t)corner];
    ck_assert(ours < p->faces.vertex_count);
    ck_assert(!p->faces.xyz32 == !mesh->xyz32 && !p->faces.xyz64 == !mesh->xyz64);
    if (mesh->xyz32) {
        ck_assert(memcmp(p->faces.xyz32 + 3 * ours, mesh->xyz32 + 3 * theirs, 12) == 0);
        ck_assert(memcmp(p->faces.corners32 + 9 * face + 3 * (uint64_t)corner,
                         mesh->xyz32 + 3 * theirs, 12) == 0);
    } else {
        ck_assert(memcmp(p->faces.xyz64 + 3 * ours, mesh->xyz64 + 3 * theirs, 24) == 0);
        ck_assert(memcmp(p->faces.corners64 + 9 * face + 3 * (uint64_t)corner,
                         mesh->xyz64 + 3 * theirs, 24) == 0);
    }
}

static void compare_faces(const pair *p)
{
    uint64_t listed = 0, fresh = 0;
    for (uint64_t i = 0; i < p->t->tree.mesh.face_count; i++) {
        listed += p->listed[i] > 0;
        fresh += p->listed[i] == 2;
    }
    ck_assert(p->faces.face_count == listed && p->faces.shared_count == listed - fresh);
    for (uint64_t i = 0; i < listed; i++) {
        ck_assert(i == 0 || p->faces.file_faces[i] > p->faces.file_faces[i - 1]);
        ck_assert(p->listed[p->faces.file_faces[i]] == (i < p->faces.shared_count ? 1 : 2));
        ck_assert(!p->faces.source == !p->t->tree.face_source);
        if (p->faces.source)
            ck_assert(p->faces.source[i] == p->t->tree.face_source[p->faces.file_faces[i]]);
        for (int corner = 0; corner < 3; corner++)
            compare_corner(p, i, corner);
    }
}

static void compare_above(const pair *p)
{
    for (int level = 0; level < p->level && p->nodes.above_first; level++) {
        uint64_t code = p->octcode >> 3 * (p->level - level), k = 0;
        const ebpo_level *l = &p->t->tree.level[level];
        while (p->t->node[level][k].octcode != code)
            k++;
        const reference_node *n = &p->t->node[level][k];
        uint64_t count = l->plane_counts ? l->plane_counts[n->rank[EBPO_GRAY]] : 0;
        ck_assert(p->nodes.above_first[level + 1] - p->nodes.above_first[level] == count);
        ck_assert(count == 0 || memcmp(p->nodes.above_planes + p->nodes.above_first[level],
                                       l->planes + n->plane, count * 4) == 0);
    }
}

static void check_subtree(const reference *t, const ebpo_file *file, const reference_node *root,
                          const ebpo_subtree_options *options)
{
    ebpo_error error = EBPO_ERROR_INIT;
    pair p = { .t = t, .nodes = EBPO_SUBTREE_NODES_INIT, .faces = EBPO_SUBTREE_FACES_INIT };
    p.octcode = root->octcode;
    p.level = ebpo_octcode_level(root->octcode);
    ck_assert_msg(ebpo_subtree_open(file, root->octcode, options, &p.subtree, &error) == EBPO_OK,
                  "%s", error.message);
    ck_assert(ebpo_subtree_get_nodes(p.subtree, &p.nodes) == EBPO_OK);
    bool has_faces = ebpo_subtree_get_faces(p.subtree, &p.faces, &error) == EBPO_OK;
    ck_assert(has_faces == (options->levels < 0));
    ck_assert(p.nodes.level == p.level && p.nodes.level_first[0] == 0);
    ck_assert(options->levels < 0 || p.nodes.level_count <= options->levels + 1);
    ck_assert(options->memory == 0 || p.nodes.memory <= options->memory);
    p.listed = calloc(t->tree.mesh.face_count + 1, 1);
    for (int i = 0; i < p.nodes.level_count; i++)
        compare_level(&p, i, has_faces);
    ck_assert(p.nodes.node_count == p.nodes.level_first[p.nodes.level_count]);
    compare_children(&p);
    compare_above(&p);
    if (has_faces)
        compare_faces(&p);
    free(p.listed);
    ebpo_subtree_close(p.subtree);
}

static ebpo_subtree_options with_corners(void)
{
    ebpo_subtree_options options = EBPO_SUBTREE_OPTIONS_INIT;
    options.corners = true;
    return options;
}

static bool is_pruned(const reference *t, const reference_node *n)
{
    int level = ebpo_octcode_level(n->octcode) + 1;
    return t->tree.info.pruned && n->type == EBPO_GRAY &&
           (level == t->tree.info.level_count ||
            t->tree.level[level].types[n->rank[EBPO_GRAY]] == 0);
}

static void check_refused(const ebpo_file *file, uint64_t octcode, ebpo_status status,
                          const char *word)
{
    ebpo_error error = EBPO_ERROR_INIT;
    ebpo_subtree *subtree = (void *)1;
    ck_assert_int_eq(ebpo_subtree_open(file, octcode, NULL, &subtree, &error), status);
    ck_assert_ptr_null(subtree);
    ck_assert_msg(strstr(error.message, word), "%s", error.message);
}

/* Checks every `step`th gray node and leaf. All other nodes are refused. */
static void check_all(const ebpo_file *file, uint64_t step)
{
    reference t;
    uint64_t turn = 0;
    ebpo_subtree_options options = with_corners();
    reference_make(&t, file);
    for (int level = 0; level < t.tree.info.level_count; level++)
        for (uint64_t k = 0; k < t.count[level]; k++) {
            const reference_node *n = &t.node[level][k];
            if (turn++ % step && level)
                continue;
            options.levels = turn % 4 == 3 ? (int)turn / 4 % 3 : -1;
            if (n->type == EBPO_WHITE || n->type == EBPO_BLACK)
                check_refused(file, n->octcode, EBPO_E_ARGUMENT,
                              n->type == EBPO_WHITE ? "is white" : "is black");
            else if (is_pruned(&t, n))
                check_refused(file, n->octcode, EBPO_E_ABSENT, "is a subset");
            else
                check_subtree(&t, file, n, &options);
        }
    reference_free(&t);
}

START_TEST(test_subtrees_of_random_trees_match_file)
{
    if (!ebpo_test_wanted(_i))
        return;
    ebpo_file *file = write_random((uint64_t)_i, 1 + _i % 5, 2 + (unsigned)_i % 5, _i % 5 == 0);
    check_all(file, 1);
    ebpo_close(file);
}
END_TEST

START_TEST(test_subtrees_of_solids_match_file)
{
    if (!ebpo_test_wanted(_i))
        return;
    ebpo_file *file =
        write_solid(ebpo_test_solids[_i].make(),
                    _i % 2 ? DEFAULT : EBPO_PART_MESH | EBPO_PART_LEAF_PLANES, 2, EBPO_CODEC_ZSTD);
    check_all(file, 3);
    ebpo_close(file);
}
END_TEST

/* These trees have index arrays and dozens of chunks. */
START_TEST(test_subtrees_of_larger_trees_match_file)
{
    ebpo_file *file =
        _i ? write_random(5, 7, 12, true)
           : write_solid(ebpo_test_torus(2, 0.7, 160, 100), DEFAULT, 4, EBPO_CODEC_ZSTD);
    check_all(file, _i ? 9973 : 211);
    ebpo_close(file);
}
END_TEST

/* Writes a subset of a solid, or of a tree whose white nodes have winding numbers. */
static ebpo_file *write_subset(bool windings)
{
    ebpo_error error = EBPO_ERROR_INIT;
    ebpo_subset_options options = EBPO_SUBSET_OPTIONS_INIT;
    ebpo_file *small = NULL, *file = windings ? write_random(7, 6, 8, false)
                                              : write_solid(ebpo_test_torus(2, 0.7, 40, 30),
                                                            DEFAULT, 4, EBPO_CODEC_ZSTD);
    const ebpo_info *info = ebpo_file_info(file);
    const char *name = scratch("small.ebpo.h5");
    options.last_level = 4;
    options.boxed = true;
    for (int k = 0; k < 3; k++) {
        options.min[k] = info->box_origin[k] + 0.4 * info->box_size[k];
        options.max[k] = info->box_origin[k] + 0.9 * info->box_size[k];
    }
    ck_assert_msg(ebpo_subset(file, name, &options, &error) == EBPO_OK, "%s", error.message);
    ebpo_close(file);
    ck_assert_msg(ebpo_open(name, &small, &error) == EBPO_OK, "%s", error.message);
    ck_assert(ebpo_file_info(small)->pruned);
    return small;
}

START_TEST(test_subtrees_of_subsets_match_file)
{
    ebpo_file *file = write_subset(_i);
    check_all(file, 1);
    ebpo_close(file);
}
END_TEST

/* --- nodes in model coordinates --- */

static void same_node(const ebpo_stream_node *a, const ebpo_stream_node *b)
{
    ck_assert(a->octcode == b->octcode && a->type == b->type && a->winding == b->winding);
    ck_assert(memcmp(a->min, b->min, sizeof a->min) == 0 &&
              memcmp(a->max, b->max, sizeof a->max) == 0);
    ck_assert(a->plane_count == b->plane_count && a->volume == b->volume);
    for (uint32_t i = 0; i < a->plane_count; i++)
        ck_assert(memcmp(a->planes[i], b->planes[i], sizeof a->planes[i]) == 0);
    ck_assert(a->vertex_count == b->vertex_count && a->polygon_count == b->polygon_count);
    for (uint32_t i = 0; i < a->vertex_count; i++)
        ck_assert(memcmp(a->vertices[i], b->vertices[i], sizeof a->vertices[i]) == 0);
    for (uint32_t i = 0; a->polygon_count && i <= a->polygon_count; i++)
        ck_assert(a->polygon_first[i] == b->polygon_first[i]);
    for (uint32_t i = 0; a->polygon_count && i < a->polygon_first[a->polygon_count]; i++)
        ck_assert(a->corners[i] == b->corners[i]);
}

/* Opens subtrees below these nodes of a level, by octcode. */
static ebpo_subtree *open_around(const ebpo_file *file, uint64_t octcode, int level, uint32_t parts,
                                 uint64_t *number)
{
    ebpo_subtree *subtree = NULL;
    ebpo_subtree_options options = EBPO_SUBTREE_OPTIONS_INIT;
    ebpo_subtree_nodes nodes = EBPO_SUBTREE_NODES_INIT;
    int up = ebpo_octcode_level(octcode) - level;
    options.parts = parts;
    if (ebpo_subtree_open(file, octcode >> 3 * (up > 0 ? up : 0), &options, &subtree, NULL) !=
        EBPO_OK)
        return NULL;
    ck_assert(ebpo_subtree_get_nodes(subtree, &nodes) == EBPO_OK);
    for (*number = 0; nodes.octcodes[*number] != octcode; ++*number)
        ck_assert(*number + 1 < nodes.node_count);
    return subtree;
}

/* Without faces the nodes equal those of streams, to the last bit. */
START_TEST(test_subtree_nodes_match_streams)
{
    ebpo_error error = EBPO_ERROR_INIT;
    ebpo_file *file =
        write_solid(ebpo_test_torus(2, 0.7, 30, 20), DEFAULT | (_i % 2 ? EBPO_PART_LEAF_PLANES : 0),
                    6, EBPO_CODEC_ZSTD);
    ebpo_stream *stream = NULL;
    ebpo_stream_options options = EBPO_STREAM_OPTIONS_INIT;
    ebpo_stream_level level;
    ebpo_stream_node node;
    bool more = true, another;
    uint64_t compared = 0, number;
    options.polygons = true;
    ck_assert_int_eq(ebpo_stream_new(file, &options, &stream, &error), EBPO_OK);
    while (ebpo_stream_next_level(stream, &level, &more, &error) == EBPO_OK && more)
        while (ebpo_stream_next_node(stream, &node, &another, &error) == EBPO_OK && another) {
            ebpo_subtree_node own = EBPO_SUBTREE_NODE_INIT;
            if (node.octcode % 7 && node.octcode > 64)
                continue;
            ebpo_subtree *subtree = open_around(file, node.octcode, _i,
                                                EBPO_PART_PLANES | EBPO_PART_LEAF_PLANES, &number);
            if (!subtree)
                continue; /* white and black nodes */
            ck_assert_int_eq(ebpo_subtree_get_node(subtree, number, true, &own, &error), EBPO_OK);
            same_node(&own.node, &node);
            compared++;
            ebpo_subtree_close(subtree);
        }
    ck_assert_uint_gt(compared, 50);
    ebpo_stream_free(stream);
    ebpo_close(file);
}
END_TEST

/* With faces, leaves are cut by derived planes, as in whole levels. */
START_TEST(test_subtree_leaves_match_whole_levels)
{
    ebpo_error error = EBPO_ERROR_INIT;
    ebpo_file *file = write_solid(ebpo_test_solids[_i].make(), DEFAULT, 3, EBPO_CODEC_ZSTD);
    const ebpo_info *info = ebpo_file_info(file);
    ebpo_mesh mesh;
    ebpo_lod_nodes nodes;
    ck_assert_msg(ebpo_lod_level_nodes(file, info->level_count - 1, NULL, &mesh, &nodes, NULL,
                                       &error) == EBPO_OK,
                  "%s", error.message);
    for (uint64_t i = 0; i < nodes.node_count; i += 1 + i / 16) {
        ebpo_subtree_node own = EBPO_SUBTREE_NODE_INIT;
        uint64_t number;
        if (nodes.nodes[i].type != EBPO_LEAF)
            continue;
        ebpo_subtree *subtree = open_around(file, nodes.nodes[i].octcode, (int)i % 4, ~0u, &number);
        ck_assert_ptr_nonnull(subtree);
        ck_assert_int_eq(ebpo_subtree_get_node(subtree, number, true, &own, &error), EBPO_OK);
        ck_assert_int_eq(own.node.winding, nodes.nodes[i].winding);
        ck_assert_double_eq_tol(own.node.volume, nodes.nodes[i].volume,
                                1e-9 * nodes.nodes[i].volume);
        ebpo_subtree_close(subtree);
    }
    ebpo_mesh_free(&mesh);
    ebpo_lod_nodes_free(&nodes);
    ebpo_close(file);
}
END_TEST

/* Counts all planes above a node. */
static uint64_t planes_above(const ebpo_subtree_nodes *nodes, uint64_t number)
{
    uint64_t planes = nodes->above_first[nodes->level], code = nodes->octcodes[number] >> 3;
    for (uint64_t i = number; i > 0 && code; code >>= 3) {
        while (i > 0 && nodes->octcodes[i] != code)
            i--;
        if (nodes->octcodes[i] == code)
            planes += nodes->plane_first[i + 1] - nodes->plane_first[i];
    }
    return planes;
}

/* The inherited planes, the node's planes and its cell bound the corners of an envelope. */
START_TEST(test_subtree_inherited_planes_bound_envelope)
{
    ebpo_error error = EBPO_ERROR_INIT;
    ebpo_file *file = write_solid(ebpo_test_torus(2, 0.7, 30, 20), DEFAULT, 6, EBPO_CODEC_ZSTD);
    ebpo_subtree *subtree = NULL;
    ebpo_subtree_nodes nodes = EBPO_SUBTREE_NODES_INIT;
    uint64_t inherited = 0;
    ck_assert_int_eq(ebpo_subtree_open(file, 9, NULL, &subtree, &error), EBPO_OK);
    ck_assert_int_eq(ebpo_subtree_get_nodes(subtree, &nodes), EBPO_OK);
    for (uint64_t i = 0; i < nodes.node_count; i++) {
        ebpo_subtree_node n = EBPO_SUBTREE_NODE_INIT;
        ck_assert_int_eq(ebpo_subtree_get_node(subtree, i, true, &n, &error), EBPO_OK);
        for (uint32_t v = 0; v < n.node.vertex_count && n.node.type != EBPO_BLACK; v++)
            for (uint32_t h = 0; h < n.inherited_count; h++) {
                const double *x = n.node.vertices[v], *a = n.inherited[h];
                ck_assert(a[0] * x[0] + a[1] * x[1] + a[2] * x[2] <= a[3] + 1e-9);
            }
        ck_assert(n.inherited_count == planes_above(&nodes, i));
        inherited += n.inherited_count;
    }
    ck_assert_uint_gt(inherited, nodes.node_count);
    ebpo_subtree_node none = EBPO_SUBTREE_NODE_INIT;
    ck_assert_int_eq(ebpo_subtree_get_node(subtree, nodes.node_count, true, &none, &error),
                     EBPO_E_ARGUMENT);
    ebpo_subtree_close(subtree);
    ebpo_close(file);
}
END_TEST

/* --- remote files --- */

/* In a file with subtrees, opening a subtree takes few round trips, whatever its size. */
START_TEST(test_remote_subtree_needs_few_batches)
{
    reference t;
    counted_source c;
    uint64_t most = 0;
    ebpo_subtree_options options = with_corners();
    ebpo_mesh mesh = ebpo_test_torus(2, 0.7, 160, 100);
    ebpo_close(write_solid(mesh, DEFAULT, 4, EBPO_CODEC_ZSTD));
    ebpo_file *near = NULL, *far = NULL;
    ck_assert(ebpo_open(path, &near, NULL) == EBPO_OK);
    int level = ebpo_file_info(near)->subtree_level;
    ck_assert_int_gt(level, 0);
    reference_make(&t, near);
    for (uint64_t k = 0; k < t.count[level]; k += 7) {
        if (t.node[level][k].type != EBPO_GRAY)
            continue;
        far = counted_open(&c, path, true);
        check_subtree(&t, far, &t.node[level][k], &options);
        most = c.batches + c.alone > most ? c.batches + c.alone : most;
        counted_close(&c, far);
    }
    ck_assert_msg(most <= FEW, "%llu", (unsigned long long)most);
    reference_free(&t);
    ebpo_close(near);
}
END_TEST

/* --- threads --- */

typedef struct opening {
    const reference *t;
    const ebpo_file *file;
    uint64_t first;
} opening;

static void *open_some(void *user)
{
    const opening *o = user;
    ebpo_subtree_options options = with_corners();
    for (int level = 1; level < o->t->tree.info.level_count; level++)
        for (uint64_t k = o->first; k < o->t->count[level]; k += 40)
            if (o->t->node[level][k].type == EBPO_GRAY)
                check_subtree(o->t, o->file, &o->t->node[level][k], &options);
    return NULL;
}

START_TEST(test_subtree_threads_share_file)
{
    enum { THREADS = 4 };
    pthread_t thread[THREADS];
    opening o[THREADS];
    reference t;
    ebpo_file *file = write_solid(ebpo_test_torus(2, 0.7, 40, 30), DEFAULT, 4, EBPO_CODEC_ZSTD);
    reference_make(&t, file);
    for (unsigned i = 0; i < THREADS; i++) {
        o[i] = (opening){ &t, file, i };
        ck_assert_int_eq(pthread_create(&thread[i], NULL, open_some, &o[i]), 0);
    }
    for (unsigned i = 0; i < THREADS; i++)
        ck_assert_int_eq(pthread_join(thread[i], NULL), 0);
    reference_free(&t);
    ebpo_close(file);
}
END_TEST

/* --- errors --- */

START_TEST(test_subtree_invalid_octcodes_are_refused)
{
    static const uint64_t none[] = { 0, 2, 7, 16, 50, UINT64_C(1) << 63, UINT64_MAX };
    ebpo_file *file = write_solid(ebpo_test_torus(2, 0.7, 30, 20), DEFAULT, 6, EBPO_CODEC_ZSTD);
    for (size_t i = 0; i < sizeof none / sizeof *none; i++)
        check_refused(file, none[i], EBPO_E_ARGUMENT, "is not an octcode");
    ebpo_close(file);
}
END_TEST

START_TEST(test_subtree_error_names_enclosing_leaf)
{
    reference t;
    ebpo_file *file = write_solid(ebpo_test_torus(2, 0.7, 30, 20), DEFAULT, 6, EBPO_CODEC_ZSTD);
    reference_make(&t, file);
    for (int level = 1; level < t.tree.info.level_count; level++)
        for (uint64_t k = 0; k < t.count[level]; k += 1 + k / 4) {
            const reference_node *n = &t.node[level][k];
            ebpo_subtree_options options = EBPO_SUBTREE_OPTIONS_INIT;
            ebpo_subtree_nodes nodes = EBPO_SUBTREE_NODES_INIT;
            ebpo_subtree *subtree = NULL;
            uint64_t below = n->octcode << 6 | 5;
            if (n->type == EBPO_GRAY)
                continue;
            check_refused(file, below, EBPO_E_ARGUMENT,
                          n->type == EBPO_LEAF ? "tree ends above it" : "would be in");
            options.or_leaf_above = true;
            ck_assert_int_eq(ebpo_subtree_open(file, below, &options, &subtree, NULL),
                             n->type == EBPO_LEAF ? EBPO_OK : EBPO_E_ARGUMENT);
            if (subtree) {
                ck_assert_int_eq(ebpo_subtree_get_nodes(subtree, &nodes), EBPO_OK);
                ck_assert(nodes.octcodes[0] == n->octcode && nodes.node_count == 1);
            }
            ebpo_subtree_close(subtree);
        }
    reference_free(&t);
    ebpo_close(file);
}
END_TEST

START_TEST(test_subtree_octcodes_of_points)
{
    ebpo_file *file = write_solid(ebpo_test_torus(2, 0.7, 30, 20), DEFAULT, 6, EBPO_CODEC_ZSTD);
    const ebpo_info *info = ebpo_file_info(file);
    double outside[3] = { info->box_origin[0] - 1, 0, 0 };
    uint64_t state = 7;
    for (int n = 0; n < 200; n++) {
        double p[3], low[3];
        int level = n % 8;
        for (int k = 0; k < 3; k++) {
            low[k] = info->box_origin[k];
            p[k] = low[k] + info->box_size[k] * ebpo_test_random_unit(&state);
        }
        uint64_t octcode = ebpo_octcode_at(info, p, level);
        ck_assert(ebpo_octcode_level(octcode) == level);
        for (int i = 1; i <= level; i++)
            for (int k = 0; k < 3; k++) {
                double half = info->box_size[k] / (double)(1u << i);
                if (octcode >> 3 * (level - i) >> k & 1)
                    low[k] += half;
                ck_assert(p[k] >= low[k] && p[k] <= low[k] + half);
            }
    }
    ck_assert_uint_eq(ebpo_octcode_at(info, outside, 3), 0);
    ck_assert_uint_eq(ebpo_octcode_at(info, info->box_origin, -1), 0);
    ck_assert_uint_eq(ebpo_octcode_at(info, info->box_origin, EBPO_LEVELS_MAX), 0);
    ck_assert_uint_eq(ebpo_octcode_at(info, (double[]){ NAN, 0, 0 }, 2), 0);
    ebpo_close(file);
}
END_TEST

/* The maximum number of levels requests all levels. */
START_TEST(test_subtree_level_count_is_clamped)
{
    ebpo_file *file = write_solid(ebpo_test_torus(2, 0.7, 30, 20), DEFAULT, 6, EBPO_CODEC_ZSTD);
    ebpo_subtree_options options = EBPO_SUBTREE_OPTIONS_INIT;
    static const int levels[] = { -1, EBPO_LEVELS_MAX, INT_MAX };
    uint64_t nodes[3];
    for (int i = 0; i < 3; i++) {
        ebpo_subtree *subtree = NULL;
        ebpo_subtree_nodes all = EBPO_SUBTREE_NODES_INIT;
        options.levels = levels[i];
        ck_assert_int_eq(ebpo_subtree_open(file, 1, &options, &subtree, NULL), EBPO_OK);
        ck_assert_int_eq(ebpo_subtree_get_nodes(subtree, &all), EBPO_OK);
        nodes[i] = all.node_count;
        ebpo_subtree_close(subtree);
    }
    ck_assert_uint_gt(nodes[0], 1);
    ck_assert_uint_eq(nodes[0], nodes[1]);
    ck_assert_uint_eq(nodes[0], nodes[2]);
    ebpo_close(file);
}
END_TEST

START_TEST(test_subtree_without_faces_gives_reason)
{
    ebpo_error error = EBPO_ERROR_INIT;
    ebpo_subtree *subtree = NULL;
    ebpo_subtree_options options = EBPO_SUBTREE_OPTIONS_INIT;
    ebpo_subtree_faces faces = EBPO_SUBTREE_FACES_INIT;
    ebpo_file *file = write_solid(ebpo_test_torus(2, 0.7, 30, 20),
                                  _i == 0 ? EBPO_PART_PLANES : DEFAULT, 6, EBPO_CODEC_ZSTD);
    static const char *const why[] = { "without its mesh", "EBPO_PART_MESH", "levels = -1" };
    if (_i == 1)
        options.parts = EBPO_PART_PLANES | EBPO_PART_MAPS;
    if (_i == 2)
        options.levels = 2;
    ck_assert_int_eq(ebpo_subtree_open(file, 1, &options, &subtree, &error), EBPO_OK);
    ck_assert_int_eq(ebpo_subtree_get_faces(subtree, &faces, &error), EBPO_E_ABSENT);
    ck_assert_msg(strstr(error.message, why[_i]), "%s", error.message);
    faces.struct_size = 0;
    ck_assert_int_eq(ebpo_subtree_get_faces(subtree, &faces, &error), EBPO_E_ARGUMENT);
    ebpo_subtree_close(subtree);
    options.levels = -2;
    ck_assert_int_eq(ebpo_subtree_open(file, 1, &options, &subtree, &error), EBPO_E_ARGUMENT);
    ebpo_close(file);
}
END_TEST

/* Returns the limit that the error message names, or 0 when `memory` is enough. */
static uint64_t named_limit(const ebpo_file *file, uint64_t octcode, uint64_t memory)
{
    ebpo_error error = EBPO_ERROR_INIT;
    ebpo_subtree *subtree = NULL;
    ebpo_subtree_options options = with_corners();
    options.memory = memory;
    ebpo_status status = ebpo_subtree_open(file, octcode, &options, &subtree, &error);
    ebpo_subtree_close(subtree);
    if (status == EBPO_OK)
        return 0;
    const char *named = strstr(error.message, "allowed; give ");
    ck_assert_msg(status == EBPO_E_LIMIT && named, "%s", error.message);
    return strtoull(named + strlen("allowed; give "), NULL, 10);
}

/* The message about a limit that is too small names a sufficient one. With less, the lists are read
 * for the number of shared faces: then the named limit is exact. */
START_TEST(test_subtree_memory_limit_is_kept)
{
    reference t;
    unsigned exact = 0;
    ebpo_subtree_options options = with_corners();
    ebpo_file *file = write_solid(ebpo_test_torus(2, 0.7, 120, 80), DEFAULT, 6, EBPO_CODEC_ZSTD);
    reference_make(&t, file);
    for (int level = 0; level < 3; level++)
        for (uint64_t k = 0; k < t.count[level]; k++) {
            if (t.node[level][k].type != EBPO_GRAY)
                continue;
            uint64_t octcode = t.node[level][k].octcode, named = named_limit(file, octcode, 1);
            options.memory = named;
            check_subtree(&t, file, &t.node[level][k], &options);
            uint64_t less = named_limit(file, octcode, named * 5 / 8);
            ck_assert_uint_gt(less, named * 5 / 8);
            ck_assert(level ? less <= named : less == named);
            ck_assert_uint_eq(named_limit(file, octcode, less), 0);
            ck_assert(less == named || named_limit(file, octcode, less - 1) == less);
            exact += less < named;
        }
    ck_assert_uint_gt(exact, 3);
    reference_free(&t);
    ebpo_close(file);
}
END_TEST

/* --- untrusted files --- */

static void check_bounds(const ebpo_subtree_nodes *n, const ebpo_subtree_faces *f, bool has_faces)
{
    for (uint64_t i = 0; i < n->node_count; i++) {
        ck_assert(n->children[i] == EBPO_NO_CHILDREN || n->children[i] + 8 <= n->node_count);
        ck_assert(!n->plane_first || n->plane_first[i] <= n->plane_first[i + 1]);
        ck_assert(!has_faces || f->list_first[i] <= f->list_first[i + 1]);
    }
    for (uint32_t i = 0; has_faces && i < f->list_first[n->node_count]; i++)
        ck_assert(f->list[i] < f->face_count);
    for (uint64_t i = 0; has_faces && i < 3 * f->face_count; i++)
        ck_assert(f->faces[i] < f->vertex_count);
}

static bool try_changed(const uint8_t *data, uint64_t size, uint64_t octcode)
{
    ebpo_file *file = NULL;
    ebpo_subtree *subtree = NULL;
    ebpo_subtree_nodes nodes = EBPO_SUBTREE_NODES_INIT;
    ebpo_subtree_faces faces = EBPO_SUBTREE_FACES_INIT;
    ebpo_status status = ebpo_open_memory(data, size, NULL, &file, NULL);
    if (status == EBPO_OK)
        status = ebpo_subtree_open(file, octcode, NULL, &subtree, NULL);
    ck_assert(status == EBPO_OK || status == EBPO_E_FORMAT || status == EBPO_E_ARGUMENT ||
              status == EBPO_E_LIMIT || status == EBPO_E_VERSION || status == EBPO_E_ABSENT);
    if (status == EBPO_OK) {
        ebpo_subtree_node node = EBPO_SUBTREE_NODE_INIT;
        ck_assert(ebpo_subtree_get_nodes(subtree, &nodes) == EBPO_OK);
        bool has_faces = ebpo_subtree_get_faces(subtree, &faces, NULL) == EBPO_OK;
        check_bounds(&nodes, &faces, has_faces);
        for (uint64_t i = 0; i < nodes.node_count; i += 97)
            ck_assert(ebpo_subtree_get_node(subtree, i, true, &node, NULL) == EBPO_OK);
    }
    ebpo_subtree_close(subtree);
    ebpo_close(file);
    return status == EBPO_OK;
}

/* Uses files without checksums, so that changed data is read. */
START_TEST(test_subtree_changed_bytes_stay_in_bounds)
{
    FILE *f;
    uint64_t state = 99 + (uint64_t)_i, turns = ebpo_test_scaled(400), refused = 0;
    ebpo_close(write_solid(ebpo_test_torus(2, 0.7, 30, 20), DEFAULT, 6, EBPO_CODEC_NONE));
    ck_assert_ptr_nonnull(f = fopen(path, "rb"));
    ck_assert_int_eq(fseek(f, 0, SEEK_END), 0);
    uint64_t size = (uint64_t)ftell(f);
    uint8_t *data = malloc(size);
    rewind(f);
    ck_assert_uint_eq(fread(data, 1, size, f), size);
    fclose(f);
    for (uint64_t n = 0; n < turns; n++) {
        uint64_t at = size / 4 + ebpo_test_random(&state) % (size - size / 4);
        uint8_t kept = data[at];
        data[at] = ebpo_test_random(&state) % 2 ? 0xff : (uint8_t)(kept ^ 1);
        refused += !try_changed(data, size, n % 2 ? 1 : 8 + n % 8);
        data[at] = kept;
    }
    ck_assert_uint_gt(refused, 0);
    free(data);
}
END_TEST

TEST_SUITE(subtree)
{
    Suite *suite = suite_create("subtree");
    TCase *tests = tcase_create("subtree");
    tcase_set_timeout(tests, 600);
    tcase_add_checked_fixture(tests, make_folder, scratch_leave);
    tcase_add_loop_test(tests, test_subtrees_of_random_trees_match_file, 0, 40);
    tcase_add_loop_test(tests, test_subtrees_of_solids_match_file, 0, ebpo_test_solid_count);
    tcase_add_loop_test(tests, test_subtrees_of_larger_trees_match_file, 0, 2);
    tcase_add_loop_test(tests, test_subtrees_of_subsets_match_file, 0, 2);
    tcase_add_loop_test(tests, test_subtree_nodes_match_streams, 0, 3);
    tcase_add_loop_test(tests, test_subtree_leaves_match_whole_levels, 0, ebpo_test_solid_count);
    tcase_add_test(tests, test_subtree_inherited_planes_bound_envelope);
    tcase_add_test(tests, test_remote_subtree_needs_few_batches);
    tcase_add_test(tests, test_subtree_threads_share_file);
    tcase_add_test(tests, test_subtree_invalid_octcodes_are_refused);
    tcase_add_test(tests, test_subtree_error_names_enclosing_leaf);
    tcase_add_test(tests, test_subtree_octcodes_of_points);
    tcase_add_loop_test(tests, test_subtree_without_faces_gives_reason, 0, 3);
    tcase_add_test(tests, test_subtree_level_count_is_clamped);
    tcase_add_test(tests, test_subtree_memory_limit_is_kept);
    tcase_add_loop_test(tests, test_subtree_changed_bytes_stay_in_bounds, 0, 3);
    suite_add_tcase(suite, tests);
    return suite;
}
