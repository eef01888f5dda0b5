/* EBP-Octree in HDF5: levels, coarse to fine, one after the other. */
#ifndef EBPO_STREAM_H
#define EBPO_STREAM_H

#include <ebpo/file.h>

#ifdef __cplusplus
extern "C" {
#endif

typedef struct ebpo_stream_options {
    size_t struct_size; /* EBPO_STREAM_OPTIONS_INIT sets it */
    bool planes;        /* give the envelopes' own half-spaces; else plane_count is 0 */
    bool polygons;      /* cut the envelopes' polygons, and their volumes; implies planes */
    unsigned threads;
} ebpo_stream_options;
#define EBPO_STREAM_OPTIONS_INIT                    \
    {                                               \
        sizeof(ebpo_stream_options), true, false, 0 \
    }

/* One node. Lent until the next call on the stream. The mesh is never read: a leaf of a file
 * without EBPO_PART_LEAF_PLANES has no planes of its own, and its envelope is its parent's in the
 * leaf's cell. The polygons are rounded, and near-empty cuts are left out (they are too large,
 * never too small but for rounding). */
typedef struct ebpo_stream_node {
    uint64_t octcode; /* a leading 1 and three bits a level */
    ebpo_node_type type;
    double min[3], max[3]; /* cell, exact */
    int32_t winding;       /* white, black: in the cell; leaf: at the lowest corner; gray: 0 */
    /* its own planes (gray; leaf: stored ones); the envelope is cut by those of all ancestors as
     * well */
    uint32_t plane_count;
    /* [plane_count] a x + b y + c z <= d in the model's unit, unit normals, rounded outward: what
     * the code contains of the cell satisfies it, also when the left side is evaluated in doubles
     */
    const double (*planes)[4];
    /* of the envelope, with `polygons`; black nodes: the cell, always; white: 0 */
    double volume;
    /* with `polygons`, gray nodes, leaves and black nodes */
    uint32_t vertex_count, polygon_count;
    const double (*vertices)[3];   /* [vertex_count] */
    const uint32_t *polygon_first; /* [polygon_count + 1] into corners */
    const uint32_t *corners;       /* counter-clockwise from outside */
} ebpo_stream_node;

typedef struct ebpo_stream_level {
    int level;
    uint64_t node_count;       /* of all types */
    uint64_t cumulative_bytes; /* of the file, head included, that levels 0 .. level took */
    /* Of the model's outer approximation at this level: envelopes of its gray nodes and of the
     * leaves so far, and black cells so far. With `polygons`: the sum of the nodes' volumes;
     * without: as the file states (ebpo_info). Either way leaves by stored planes, or as inherited:
     * planes derived from their faces cut off more (ebpo_lod_level). */
    /* of a subset: of what it holds; where a box left nodes out, these count at their own level
     * only */
    double volume;
} ebpo_stream_level;

typedef struct ebpo_stream ebpo_stream;

/* The file must stay open. One thread at a time. Of passed levels only node types stay in memory,
 * and with `polygons` their planes. */
EBPO_API EBPO_MUST_USE ebpo_status ebpo_stream_new(const ebpo_file *file,
                                                   const ebpo_stream_options *options,
                                                   ebpo_stream **out, ebpo_error *error);
EBPO_API void ebpo_stream_free(ebpo_stream *stream);

/* Reads the next level (0 first), nothing deeper, and tells of it; *more is false, and *out
 * untouched, after the last one. One may stop at any level and go on later, and try again after a
 * failure. */
EBPO_API EBPO_MUST_USE ebpo_status ebpo_stream_next_level(ebpo_stream *stream,
                                                          ebpo_stream_level *out, bool *more,
                                                          ebpo_error *error);
/* The nodes of the level last read, in octcode order; *more is false after the last one.
 * EBPO_E_ARGUMENT before the first level. */
EBPO_API EBPO_MUST_USE ebpo_status ebpo_stream_next_node(ebpo_stream *stream, ebpo_stream_node *out,
                                                         bool *more, ebpo_error *error);

#ifdef __cplusplus
}
#endif
#endif
