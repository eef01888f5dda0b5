/* SPDX-License-Identifier: MIT
 * Streams the nodes of a file by levels, coarse to fine. The envelope of a node is a convex
 * polyhedron that contains the part of the solid in the node's cell. Gray nodes have children,
 * leaves list faces, white nodes are outside the solid, and black nodes are inside (ebpo_node_type
 * in file.h).
 *
 *     ebpo_stream_new(file, NULL, &stream, &error);
 *     while (ebpo_stream_next_level(stream, &level, &more, &error) == EBPO_OK && more)
 *         while (ebpo_stream_next_node(stream, &node, &more, &error) == EBPO_OK && more)
 *             draw(&node);
 *     ebpo_stream_free(stream);
 */
#ifndef EBPO_STREAM_H
#define EBPO_STREAM_H

#include <ebpo/file.h>

#ifdef __cplusplus
extern "C" {
#endif

/* Options of ebpo_stream_new. */
typedef struct ebpo_stream_options {
    size_t struct_size;

    /* True: nodes have half-spaces. False: plane_count of all nodes is 0. */
    bool planes;

    /* True: computes the polygons and volumes of envelopes. Implies `planes`. */
    bool polygons;

    unsigned threads;
} ebpo_stream_options;

#define EBPO_STREAM_OPTIONS_INIT                    \
    {                                               \
        sizeof(ebpo_stream_options), true, false, 0 \
    }

/*
 * One node. Its pointers are valid until the next call with the stream. Streams never read the
 * mesh. So in a file without EBPO_PART_LEAF_PLANES, a leaf has no planes, and its envelope is the
 * intersection of the parent's envelope with the leaf's cell.
 *
 * The vertices of an envelope's polygons are rounded, and planes that remove a negligible volume
 * are omitted. So the polygons usually enclose slightly more than the envelope. The half-spaces in
 * `planes` are guaranteed to contain the envelope, but the polygons are not.
 */
typedef struct ebpo_stream_node {
    /* Path from the root to the node: a leading 1, then three bits for each level. */
    uint64_t octcode;

    ebpo_node_type type;

    /* Exact bounds of the cell. */
    double min[3], max[3];

    /*
     * White and black nodes: winding number of all points in the cell. Leaves: leaf_winding of
     * ebpo_level (file.h). Gray nodes: 0.
     */
    int32_t winding;

    /*
     * Number of planes that are stored for this gray node or leaf. The planes of all ancestors also
     * bound the envelope.
     */
    uint32_t plane_count;

    /*
     * [plane_count] coefficients a, b, c, d of the half-space a x + b y + c z <= d, in the model's
     * unit, with a unit normal. The coefficients are rounded outward. All points of the cell that
     * are in the exact half-space of the plane code satisfy this inequality, even if its left side
     * is computed in doubles.
     */
    const double (*planes)[4];

    /*
     * Volume in cubic units of the model. Gray nodes and leaves: volume of the envelope with the
     * option `polygons`, else 0. Black nodes: volume of the cell. White nodes: 0.
     */
    double volume;

    /*
     * Number of vertices and polygons of the envelope of a gray node, leaf or black node; 0 without
     * the option `polygons`.
     */
    uint32_t vertex_count, polygon_count;

    /* [vertex_count] coordinates, in the model's unit */
    const double (*vertices)[3];

    /* [polygon_count + 1] index in `corners` of the first corner of each polygon */
    const uint32_t *polygon_first;

    /* Indices of the polygons' corners in `vertices`, counter-clockwise seen from outside. */
    const uint32_t *corners;

    /*
     * Colour: red + 256 green + 65,536 blue, sRGB. Nodes that are not gray have the colour of their
     * parent. 0x808080 if `coloured` is 0.
     */
    uint32_t colour;

    /* 1: the file has a colour for this node. 0 in views (view.h), which do not read colours. */
    uint32_t coloured;
} ebpo_stream_node;

/* Properties of a level that a stream has read. */
typedef struct ebpo_stream_level {
    int level; /* 0: the root */

    /* Number of nodes of all types. */
    uint64_t node_count;

    /* Number of bytes of the file for the header and levels 0 to `level`. */
    uint64_t cumulative_bytes;

    /*
     * Volume of the model's outer approximation at this level, in cubic units of the model. The
     * approximation consists of the envelopes of this level's gray nodes, and of all leaves and
     * black cells of levels 0 to `level`. With the option `polygons` it is the sum of the nodes'
     * volumes; without this option it is computed from the volumes stored in the file.
     *
     * The envelopes of leaves are bounded by the planes of the leaves' ancestors, and by the planes
     * of the leaves if these are stored. ebpo_lod_level derives further planes of leaves from the
     * faces; the envelopes would be smaller with these planes.
     *
     * In a subset, the nodes in the file count. A pruned node counts at its own level, and not at
     * deeper levels.
     */
    double volume;
} ebpo_stream_level;

/* Reads the levels of one file. */
typedef struct ebpo_stream ebpo_stream;

/*
 * Makes a stream of an open file, which must stay open. Reads no data yet. The stream has in memory
 * the node types of all levels that it has read and, with the option `polygons`, the planes of
 * these levels.
 *
 * Threads: any.
 */
EBPO_API EBPO_MUST_USE ebpo_status ebpo_stream_new(const ebpo_file *file,
                                                   const ebpo_stream_options *options,
                                                   ebpo_stream **out, ebpo_error *error);

/*
 * Frees a stream.
 *
 * Threads: one at a time per stream.
 */
EBPO_API void ebpo_stream_free(ebpo_stream *stream);

/*
 * Prefetch hint: the stream will be read down to level `last`. A remote source fetches these levels
 * with as few requests as possible. Errors are reported by later reads.
 *
 * Threads: one at a time per stream.
 */
EBPO_API void ebpo_stream_prefetch(const ebpo_stream *stream, int last);

/*
 * Reads the next level, from level 0 on, and no data of deeper levels. After the last level, *more
 * is false and *out is unchanged. The caller may pause at any level, and may repeat the call after
 * a failure.
 *
 * Threads: one at a time per stream.
 */
EBPO_API EBPO_MUST_USE ebpo_status ebpo_stream_next_level(ebpo_stream *stream,
                                                          ebpo_stream_level *out, bool *more,
                                                          ebpo_error *error);

/*
 * Gets the next node of the current level, in the order of octcodes. After the last node, *more is
 * false and *out is unchanged.
 *
 * EBPO_E_ARGUMENT: no level has been read yet.
 *
 * Threads: one at a time per stream.
 */
EBPO_API EBPO_MUST_USE ebpo_status ebpo_stream_next_node(ebpo_stream *stream, ebpo_stream_node *out,
                                                         bool *more, ebpo_error *error);

#ifdef __cplusplus
}
#endif
#endif
