/* Main loop of a viewer that shows a model from coarse to fine. As soon as a level is read, it gets
 * the envelopes of the level as closed polyhedra. This sample counts their polygons instead of
 * drawing them.
 *
 *     stream_levels FILE.ebpo.h5 [LEVEL]
 *     cc stream_levels.c $(pkg-config --cflags --libs ebpo) */
#include <ebpo/ebpo.h>
#include <inttypes.h>
#include <stdio.h>
#include <stdlib.h>

int main(int argc, char **argv)
{
    ebpo_error error = EBPO_ERROR_INIT;
    ebpo_file *file = NULL;
    ebpo_stream *stream = NULL;
    ebpo_stream_options options = EBPO_STREAM_OPTIONS_INIT;
    ebpo_stream_level level;
    ebpo_stream_node node;
    bool more = true;
    int last = argc > 2 ? atoi(argv[2]) : EBPO_LEVELS_MAX;
    if (argc < 2) {
        fprintf(stderr, "usage: stream_levels FILE.ebpo.h5 [LEVEL]\n");
        return 2;
    }
    options.polygons = true;
    if (ebpo_open(argv[1], &file, &error) != EBPO_OK ||
        ebpo_stream_new(file, &options, &stream, &error) != EBPO_OK)
        goto done;
    while (ebpo_stream_next_level(stream, &level, &more, &error) == EBPO_OK && more) {
        uint64_t polyhedra = 0, polygons = 0;
        while (ebpo_stream_next_node(stream, &node, &more, &error) == EBPO_OK && more) {
            polyhedra += node.polygon_count > 0; /* white nodes have no polygons */
            /* a renderer draws node.vertices, node.polygon_first and node.corners here */
            polygons += node.polygon_count;
        }
        printf("level %d after %" PRIu64 " bytes: %" PRIu64 " new polyhedra with %" PRIu64
               " polygons; volume with earlier leaves %.9g\n",
               level.level, level.cumulative_bytes, polyhedra, polygons, level.volume);
        if (error.status != EBPO_OK || level.level >= last)
            break;
    }
done:
    if (error.status != EBPO_OK)
        fprintf(stderr, "stream_levels: %s\n", error.message);
    ebpo_stream_free(stream);
    ebpo_close(file);
    return error.status != EBPO_OK;
}
