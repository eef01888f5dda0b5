/* Any bytes as a file: opening, reading everything and asking ends in a status, nothing else. */
#include "fuzz_kit.h"

#include <ebpo/export.h>
#include <ebpo/lod.h>
#include <ebpo/query.h>
#include <ebpo/stream.h>
#include <ebpo/subtree.h>
#include <ebpo/verify.h>
#include <ebpo/view.h>
#include <stdio.h>
#include <unistd.h>

#include "known_leaks.h"
#include "read_by.h"
#include "subset/subset_parts.h"

static bool take_triangles(void *user, const ebpo_triangles *triangles)
{
    *(uint64_t *)user += triangles->count;
    return true;
}

/* Questions through whole models and through subtrees loaded on demand. */
static void ask(ebpo_file *file, int cut_level)
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

static void view(ebpo_file *file, ebpo_priority priority)
{
    ebpo_view_options options = EBPO_VIEW_OPTIONS_INIT;
    ebpo_observer observer = EBPO_OBSERVER_INIT;
    ebpo_view_stream *stream;
    ebpo_view_node node;
    ebpo_view_end end;
    options.priority = priority;
    options.observer = &observer;
    options.polygons = options.windings = true;
    options.faces = ebpo_file_info(file)->parts & EBPO_PART_MESH;
    options.nodes = 2000;
    if (ebpo_view_stream_new(file, &options, &stream, NULL) != EBPO_OK)
        return;
    while (ebpo_view_stream_next(stream, &node, &end, NULL) == EBPO_OK && end == EBPO_VIEW_NODE)
        ;
    ebpo_view_stream_free(stream);
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

static void cut_level(ebpo_file *file)
{
    ebpo_lod_options options = EBPO_LOD_OPTIONS_INIT;
    ebpo_mesh mesh;
    ebpo_lod_nodes nodes;
    options.threads = 1;
    if (ebpo_lod_level_nodes(file, ebpo_file_info(file)->level_count - 1, &options, &mesh, &nodes,
                             NULL, NULL) != EBPO_OK)
        return;
    ebpo_lod_nodes_free(&nodes);
    ebpo_mesh_free(&mesh);
}

static void stream(ebpo_file *file)
{
    ebpo_stream_options options = EBPO_STREAM_OPTIONS_INIT;
    ebpo_stream *of;
    ebpo_stream_level level;
    ebpo_stream_node node;
    bool more = true, more_nodes = true;
    options.polygons = true;
    options.threads = 1;
    if (ebpo_stream_new(file, &options, &of, NULL) != EBPO_OK)
        return;
    while (ebpo_stream_next_level(of, &level, &more, NULL) == EBPO_OK && more)
        for (int nodes = 0; nodes < 500 && more_nodes; nodes++)
            if (ebpo_stream_next_node(of, &node, &more_nodes, NULL) != EBPO_OK)
                break;
    ebpo_stream_free(of);
}

/* Whatever it finds; it must not do more than the file's size calls for. */
static void verify(ebpo_file *file)
{
    ebpo_workspace_options limited = EBPO_WORKSPACE_OPTIONS_INIT;
    ebpo_verify_options options = EBPO_VERIFY_OPTIONS_INIT;
    ebpo_verify_report report = EBPO_VERIFY_REPORT_INIT;
    limited.memory = 512 << 20;
    if (ebpo_workspace_new(&limited, &options.workspace, NULL) != EBPO_OK)
        return;
    options.threads = 1;
    options.label_samples = 64;
    (void)!ebpo_verify(file, &options, &report, NULL);
    ebpo_workspace_free(options.workspace);
}

static void read_attributes(ebpo_file *file)
{
    ebpo_attribute_facts facts = EBPO_ATTRIBUTE_FACTS_INIT;
    ebpo_array_facts array = EBPO_ARRAY_FACTS_INIT;
    ebpo_attribute_values values;
    for (unsigned n = 0; ebpo_file_attribute(file, n, &facts); n++)
        if (ebpo_file_read_attribute(file, n, READ_BY(1), &values, NULL) == EBPO_OK)
            ebpo_attribute_values_free(&values);
    for (unsigned n = 0; ebpo_file_array(file, n, &array); n++)
        ;
}

/* Files are written, so of some inputs only. */
static void export(ebpo_file *file, ebpo_export_format format)
{
    char path[64], second[80];
    ebpo_export_options options = EBPO_EXPORT_OPTIONS_INIT;
    options.last_level = ebpo_file_info(file)->level_count - 1;
    options.threads = 1;
    snprintf(path, sizeof path, "/dev/shm/fuzz_%ld.%s", (long)getpid(),
             ebpo_export_format_name(format));
    (void)!ebpo_export(file, path, format, &options, NULL, NULL);
    (void)!unlink(path);
    if (ebpo_export_second_file(format, path, second, sizeof second) && *second)
        (void)!unlink(second);
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    ebpo_file *file;
    ebpo_tree tree;
    ebpo_mesh mesh;
    if (ebpo_open_memory(data, size, "fuzzed", &file, NULL) != EBPO_OK)
        return 0;
    if (ebpo_file_read_tree(file, READ_BY(1), &tree, NULL) == EBPO_OK)
        ebpo_tree_free(&tree);
    if (ebpo_file_read_source_mesh(file, READ_BY(1), &mesh, NULL, NULL) == EBPO_OK)
        ebpo_mesh_free(&mesh);
    (void)!ebpo_file_check_content(file, READ_BY(1), NULL);
    ebpo_subset_options part = EBPO_SUBSET_OPTIONS_INIT;
    part.last_level = 2;
    part.boxed = true;
    part.max[0] = part.max[1] = part.max[2] = 0.3;
    part.threads = 1;
    if (ebpo_subset_tree(&tree, file, &part, NULL) == EBPO_OK)
        ebpo_tree_free(&tree);
    cut_level(file);
    for (int cut = -1; cut < 3; cut++)
        ask(file, cut);
    for (uint64_t octcode = 1; octcode < 65; octcode += 9)
        load(file, octcode);
    view(file, EBPO_PRIORITY_LEVEL);
    view(file, EBPO_PRIORITY_FRONT_TO_BACK);
    stream(file);
    verify(file);
    read_attributes(file);
    if (size % 8 == 0)
        export(file, (ebpo_export_format)(data[size - 1] % 4));
    ebpo_close(file);
    return 0;
}
