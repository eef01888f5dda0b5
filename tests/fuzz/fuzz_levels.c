/* SPDX-License-Identifier: MIT
 * Any bytes as a file whose levels are read: in order, by an observer in two orders, and as
 * polygons of one level. */
#include "fuzz_support.h"

#include <ebpo/lod.h>
#include <ebpo/stream.h>
#include <ebpo/view.h>

#include "known_leaks.h"

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
    options.nodes = 200;
    if (ebpo_view_stream_new(file, &options, &stream, NULL) != EBPO_OK)
        return;
    while (ebpo_view_stream_next(stream, &node, &end, NULL) == EBPO_OK && end == EBPO_VIEW_NODE)
        ;
    ebpo_view_stream_free(stream);
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
        for (int nodes = 0; nodes < 60 && more_nodes; nodes++)
            if (ebpo_stream_next_node(of, &node, &more_nodes, NULL) != EBPO_OK)
                break;
    ebpo_stream_free(of);
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    ebpo_file *file;
    if (ebpo_open_memory(data, size, "fuzzed", &file, NULL) != EBPO_OK)
        return 0;
    cut_level(file);
    view(file, EBPO_PRIORITY_LEVEL);
    view(file, EBPO_PRIORITY_FRONT_TO_BACK);
    stream(file);
    ebpo_close(file);
    return 0;
}
