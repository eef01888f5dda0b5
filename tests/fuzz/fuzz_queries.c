/* SPDX-License-Identifier: MIT
 * Any bytes as a file that is queried: through the whole model, through subtrees loaded on demand,
 * and through subtrees as plain arrays. */
#include "fuzz_support.h"

#include <ebpo/query.h>
#include <ebpo/subtree.h>

#include "known_leaks.h"

static bool take_triangles(void *user, const ebpo_triangles *triangles)
{
    *(uint64_t *)user += triangles->count;
    return true;
}

/* Runs queries through whole models and through subtrees loaded on demand. */
static void run_query(ebpo_file *file, int cut_level)
{
    static const double points[4][3] = {
        { 0, 0, 0 }, { 0.25, 0.3, 0.2 }, { 1, 1, 1 }, { 1e9, -3, 0.5 }
    };
    ebpo_model_options options = EBPO_MODEL_OPTIONS_INIT;
    ebpo_model *model;
    ebpo_context *context;
    options.cut_level = cut_level;
    options.threads = 1;
    options.memory = 64 << 20;
    if (ebpo_model_new(file, &options, &model, NULL) != EBPO_OK)
        return;
    if (ebpo_context_new(model, &context, NULL) == EBPO_OK) {
        ebpo_inside_result where;
        ebpo_distance_result distance;
        const ebpo_ray_hit *hits;
        const uint64_t *faces;
        uint64_t count;
        for (int i = 0; i < 4; i++) {
            ebpo_distance_options limited = EBPO_DISTANCE_OPTIONS_INIT;
            limited.level = i;
            ebpo_inside_options inside_options = EBPO_INSIDE_OPTIONS_INIT;
            inside_options.level = i;
            (void)!ebpo_inside(context, points[i], NULL, &where, NULL);
            (void)!ebpo_inside(context, points[i], &inside_options, &where, NULL);
            (void)!ebpo_distance(context, points[i], NULL, &distance, NULL);
            (void)!ebpo_distance(context, points[i], &limited, &distance, NULL);
        }
        (void)!ebpo_ray_all(context, points[1], points[2], 10, &hits, &count, NULL);
        (void)!ebpo_faces_in_box(context, points[0], points[2], &faces, &count, NULL);
        (void)!ebpo_triangles_in_box(context, points[0], points[2], take_triangles, &count, NULL);
        ebpo_context_free(context);
    }
    ebpo_model_free(model);
}

static void load(ebpo_file *file, uint64_t octcode)
{
    ebpo_subtree_options options = EBPO_SUBTREE_OPTIONS_INIT;
    ebpo_subtree_nodes nodes = EBPO_SUBTREE_NODES_INIT;
    ebpo_subtree_node node = EBPO_SUBTREE_NODE_INIT;
    ebpo_subtree *subtree;
    options.corners = options.or_leaf_above = true;
    options.memory = 64 << 20;
    if (ebpo_subtree_open(file, octcode, &options, &subtree, NULL) != EBPO_OK)
        return;
    ebpo_subtree_get_nodes(subtree, &nodes);
    for (uint64_t i = 0; i < nodes.node_count && i < 200; i++)
        (void)!ebpo_subtree_get_node(subtree, i, true, &node, NULL);
    ebpo_subtree_close(subtree);
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    ebpo_file *file;
    if (ebpo_open_memory(data, size, "fuzzed", &file, NULL) != EBPO_OK)
        return 0;
    for (int cut = -1; cut < 3; cut++)
        run_query(file, cut);
    for (uint64_t octcode = 1; octcode < 65; octcode += 9)
        load(file, octcode);
    ebpo_close(file);
    return 0;
}
