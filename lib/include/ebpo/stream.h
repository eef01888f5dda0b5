/* SPDX-License-Identifier: MIT
 * EBP-Octree in HDF5: levels, coarse to fine, one after the other.
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

typedef struct ebpo_stream_options {
    size_t struct_size; /* EBPO_STREAM_OPTIONS_INIT sets it */

    /* Give the envelopes' own half-spaces. Else plane_count is 0. */
    bool planes;

    /* Cut the envelopes' polygons, and give their volumes. Implies planes. */
    bool polygons;

    /* 0: all cores. The result does not depend on it. */
    unsigned threads;
} ebpo_stream_options;

#define EBPO_STREAM_OPTIONS_INIT                    \
    {                                               \
        sizeof(ebpo_stream_options), true, false, 0 \
    }

/*
 * One node. What it points to is the stream's, until the next call on the stream.
 *
 * The mesh is never read. A leaf of a file without EBPO_PART_LEAF_PLANES has no
 * planes of its own, so that its envelope is its parent's in the leaf's cell.
 *
 * Polygons are rounded, and cuts that remove next to nothing are left out: an
 * envelope drawn is too large rather than too small.
 */
typedef struct ebpo_stream_node {
    /* A leading 1, then three bits for each level. */
    uint64_t octcode;

    ebpo_node_type type;

    /* The cell, exact. */
    double min[3], max[3];

    /* White, black: in the cell. Leaf: at the lowest corner. Gray: 0. */
    int32_t winding;

    /*
     * The node's own planes: of gray nodes, and stored ones of leaves. The
     * envelope is cut by the planes of all ancestors as well.
     */
    uint32_t plane_count;

    /*
     * [plane_count] a x + b y + c z <= d, in the model's unit, with unit normals,
     * rounded outward: what the code contains of the cell satisfies it, also when
     * the left side is evaluated in doubles.
     */
    const double (*planes)[4];

    /*
     * With `polygons`: of the envelope, in the model's unit cubed. Black nodes:
     * of the cell, always. White ones: 0.
     */
    double volume;

    /* With `polygons`: of gray nodes, leaves and black nodes. */
    uint32_t vertex_count, polygon_count;

    /* [vertex_count] */
    const double (*vertices)[3];

    /* [polygon_count + 1] where each polygon begins in `corners` */
    const uint32_t *polygon_first;

    /* Numbers of vertices, counter-clockwise seen from outside. */
    const uint32_t *corners;

    /*
     * Red + 256 green + 65,536 blue, sRGB: of gray nodes their own, of other ones
     * their parent's. Gray (0x808080) where `coloured` is 0.
     */
    uint32_t colour;

    /* 1: the file has colours of this node. Views (view.h) do not read them. */
    uint32_t coloured;
} ebpo_stream_node;

typedef struct ebpo_stream_level {
    int level;

    /* Nodes of all types. */
    uint64_t node_count;

    /* Bytes of the file, head included, that levels 0 to `level` took. */
    uint64_t cumulative_bytes;

    /*
     * Of the model's outer approximation at this level: envelopes of its gray
     * nodes and of the leaves so far, and black cells so far. With `polygons` it
     * is the sum of the nodes' volumes, without it is what the file states.
     *
     * Leaves count as cut by stored planes, or as they inherit them. Planes
     * derived from their faces would cut off more (ebpo_lod_level).
     *
     * Of a subset: of what it holds. Where a box left nodes out, these count at
     * their own level only.
     */
    double volume;
} ebpo_stream_level;

typedef struct ebpo_stream ebpo_stream;

/*
 * Makes a stream of an open file, which must stay open. Nothing is read yet. Of
 * levels that have passed, only node types stay in memory, and with `polygons`
 * their planes.
 *
 * EBPO_E_MEMORY.
 *
 * Threads: any.
 */
EBPO_API EBPO_MUST_USE ebpo_status ebpo_stream_new(const ebpo_file *file,
                                                   const ebpo_stream_options *options,
                                                   ebpo_stream **out, ebpo_error *error);

/*
 * Threads: one per stream.
 */
EBPO_API void ebpo_stream_free(ebpo_stream *stream);

/*
 * Announces that the stream will be read down to level `last`. A source far away
 * then fetches these levels with as few requests as it can, where reading one
 * after the other would ask for each by itself. Cannot fail: what could not be
 * fetched is told when it is read.
 *
 * Threads: one per stream.
 */
EBPO_API void ebpo_stream_prefetch(const ebpo_stream *stream, int last);

/*
 * Reads the next level, level 0 first, and nothing deeper. After the last one,
 * *more is false and *out is left alone.
 *
 * One may stop at any level and go on later, and try again after a failure.
 *
 * Threads: one per stream.
 */
EBPO_API EBPO_MUST_USE ebpo_status ebpo_stream_next_level(ebpo_stream *stream,
                                                          ebpo_stream_level *out, bool *more,
                                                          ebpo_error *error);

/*
 * The nodes of the level that was read last, in the order of their octcodes.
 * After the last one, *more is false and *out is left alone.
 *
 * EBPO_E_ARGUMENT: no level has been read yet.
 *
 * Threads: one per stream.
 */
EBPO_API EBPO_MUST_USE ebpo_status ebpo_stream_next_node(ebpo_stream *stream, ebpo_stream_node *out,
                                                         bool *more, ebpo_error *error);

#ifdef __cplusplus
}
#endif
#endif
