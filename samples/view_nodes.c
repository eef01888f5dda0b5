/* Main loop of a viewer with a camera. Refines the node that is largest in the image first, until
 * no visible node is larger than 16 pixels, or until BYTES are read. Then the camera moves.
 *
 *     view_nodes FILE.ebpo.h5|URL X Y Z [BYTES]
 *     cc view_nodes.c $(pkg-config --cflags --libs ebpo) */
#include <ebpo/ebpo.h>
#include <inttypes.h>
#include <stdio.h>
#include <stdlib.h>

static bool draw(void *user, const ebpo_view_node *node)
{
    *(uint64_t *)user += node->seen ? node->node.polygon_count
                                    /* a renderer draws node->node here; nodes come from front to
                                     * back */
                                    : 0;
    return true;
}

int main(int argc, char **argv)
{
    ebpo_error error = EBPO_ERROR_INIT;
    ebpo_file *file = NULL;
    ebpo_view_stream *stream = NULL;
    ebpo_view_options options = EBPO_VIEW_OPTIONS_INIT;
    ebpo_observer observer = EBPO_OBSERVER_INIT;
    ebpo_view_node node;
    ebpo_view_end end = EBPO_VIEW_NODE;
    double middle[3];
    if (argc < 5) {
        fprintf(stderr, "usage: view_nodes FILE.ebpo.h5|URL X Y Z [BYTES]\n");
        return 2;
    }
    options.priority = EBPO_PRIORITY_PIXELS;
    options.observer = &observer;
    options.unseen = EBPO_UNSEEN_NEVER;
    options.pixels = 16;
    options.polygons = true;
    options.bytes = argc > 5 ? strtoull(argv[5], NULL, 10) : 0;
    for (int k = 0; k < 3; k++)
        observer.eye[k] = strtod(argv[2 + k], NULL);
    if (ebpo_open(argv[1], &file, &error) != EBPO_OK)
        goto done;
    const ebpo_info *info = ebpo_file_info(file);
    for (int k = 0; k < 3; k++) {
        middle[k] = info->box_origin[k] + info->box_size[k] / 2;
        observer.direction[k] = middle[k] - observer.eye[k];
    }
    if (ebpo_view_stream_new(file, &options, &stream, &error) != EBPO_OK)
        goto done;
    for (int frame = 0; frame < 2 && error.status == EBPO_OK; frame++) {
        uint64_t arrived = 0, polygons = 0;
        while (ebpo_view_stream_next(stream, &node, &end, &error) == EBPO_OK &&
               end == EBPO_VIEW_NODE)
            arrived++; /* if node.complete, the children replace their parent */
        ebpo_view_stats stats = EBPO_VIEW_STATS_INIT;
        ebpo_view_stream_get_stats(stream, &stats);
        ebpo_view_stream_cut(stream, draw, &polygons);
        printf("%" PRIu64 " nodes more, %" PRIu64 " bytes read: %" PRIu64
               " polygons to draw, no node larger than %.3g pixels\n",
               arrived, stats.bytes_read, polygons, stats.pixels);
        /* Moves the camera half the way to the middle of the model. Nodes in memory are not read
         * again. */
        for (int k = 0; k < 3; k++)
            observer.eye[k] += (middle[k] - observer.eye[k]) / 2;
        if (error.status == EBPO_OK && ebpo_view_stream_change(stream, &options, &error) != EBPO_OK)
            break;
    }
done:
    if (error.status != EBPO_OK)
        fprintf(stderr, "view_nodes: %s\n", error.message);
    ebpo_view_stream_free(stream);
    ebpo_close(file);
    return error.status != EBPO_OK;
}
