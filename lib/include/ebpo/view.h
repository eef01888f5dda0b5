/* SPDX-License-Identifier: MIT
 * Streams nodes in the order of their importance to an observer, within a budget. The envelope of a
 * node is a convex polyhedron that contains the part of the solid in the node's cell. Gray nodes
 * have children, leaves list faces, and black nodes are inside the solid (ebpo_node_type in
 * file.h).
 *
 *     ebpo_view_options options = EBPO_VIEW_OPTIONS_INIT;
 *     options.priority = EBPO_PRIORITY_PIXELS;
 *     options.observer = &observer;
 *     options.pixels = 8;            refine visible cells larger than 8 pixels
 *     ebpo_view_stream_new(file, &options, &stream, &error);
 *     while (ebpo_view_stream_next(stream, &node, &end, &error) == EBPO_OK &&
 *            end == EBPO_VIEW_NODE)
 *         draw(&node);               if node.complete, discard the parent
 *
 * The root comes first, then groups of the eight children of a gray node. Children replace their
 * parent when all eight are delivered (`complete`). The delivered nodes that are not replaced are
 * the *cut* of the tree.
 *
 * At any time the cut is a conservative level of detail. Every point of the root cell is in exactly
 * one cell of the cut (except on cell faces). The envelopes of the cut's gray nodes and leaves,
 * together with its black cells, contain the solid.
 *
 * Sources: BP 2008, section 4.3, algorithm 9 (adaptive display); Meagher 1982 (octree enumeration
 * front to back).
 */
#ifndef EBPO_VIEW_H
#define EBPO_VIEW_H

#include <ebpo/lod.h>
#include <ebpo/stream.h>

#ifdef __cplusplus
extern "C" {
#endif

/*
 * Order in which gray nodes of the cut are refined. Nodes of equal priority are refined by level,
 * coarse to fine, and within a level by ascending octcode. An octcode is the path from the root to
 * the node, with three bits for each level (stream.h).
 */
typedef enum ebpo_priority {
    /* Level by level, by octcode: the order of the file. */
    EBPO_PRIORITY_LEVEL = 0,

    /* By distance from the eye to the nearest point of the cell, nearest cells first. */
    EBPO_PRIORITY_DISTANCE = 1,

    /* By size in the image (`pixels` of ebpo_view_node), largest cells first. */
    EBPO_PRIORITY_PIXELS = 2,

    /*
     * Front to back: of two cells on a ray from the eye, the nearer cell is refined first, with all
     * its descendants. The eight children of a node are also delivered front to back.
     */
    EBPO_PRIORITY_FRONT_TO_BACK = 3
} ebpo_priority;

/* A perspective camera. */
typedef struct ebpo_observer {
    size_t struct_size;

    /* Position of the eye, in the model's unit. */
    double eye[3];

    /* Viewing direction of any length. (0, 0, 0): all nodes are visible, in all directions. */
    double direction[3];

    /*
     * Upward direction in the image, of any length; not parallel to `direction`. Ignored if
     * `direction` is (0, 0, 0).
     */
    double up[3];

    /* Vertical field of view in degrees, above 0 and below 180. */
    double fov;

    /* Size of the image in pixels; each at least 1. */
    uint32_t width, height;
} ebpo_observer;

#define EBPO_OBSERVER_INIT                                                          \
    {                                                                               \
        sizeof(ebpo_observer), { 0, 0, 0 }, { 0, 0, 0 }, { 0, 1, 0 }, 45, 1280, 720 \
    }

/* Treatment of gray nodes whose cells are outside the image. */
typedef enum ebpo_unseen {
    EBPO_UNSEEN_LAST = 0, /* they are refined after all visible nodes */
    EBPO_UNSEEN_NEVER = 1 /* they are never refined */
} ebpo_unseen;

/* Options of ebpo_view_stream_new and ebpo_view_stream_change. */
typedef struct ebpo_view_options {
    size_t struct_size;

    /* ---- members that ebpo_view_stream_change may change ---- */

    /* Order in which gray nodes are refined. */
    ebpo_priority priority;

    /* The observer, which is copied. NULL: no observer; allowed only with EBPO_PRIORITY_LEVEL. */
    const ebpo_observer *observer;

    /* Treatment of gray nodes outside the image. */
    ebpo_unseen unseen;

    /*
     * Gray nodes whose size in the image (`pixels` of ebpo_view_node) is at most this number are
     * not refined. 0: the size does not matter.
     */
    double pixels;

    /*
     * Gray nodes whose cells are farther from the eye than this, in the model's unit, are not
     * refined. INFINITY: the distance does not matter.
     */
    double distance;

    /* Deepest level to deliver. -1: all levels. */
    int level;

    /*
     * Maximum number of bytes read from the file since opening (ebpo_file_get_stats). The stream
     * stops before it exceeds this number. 0: no limit.
     */
    uint64_t bytes;

    /* Maximum number of delivered nodes. 0: no limit. */
    uint64_t nodes;

    /* ---- members that ebpo_view_stream_change may not change ---- */

    /*
     * planes: true if nodes have half-spaces. polygons: true if nodes have envelopes as polygons.
     * Both are as in ebpo_stream_options. If both are false, no planes are read.
     */
    bool planes, polygons;

    /* True: reads winding numbers. False: winding numbers of nodes are 0. */
    bool windings;

    /*
     * Maximum memory for decoded chunks in bytes, at least 1 MiB. Chunks that were removed are read
     * again when needed. 0: no maximum. In addition, the stream takes about 10 bytes per delivered
     * node (14 with winding numbers), 32 bytes per gray node of the cut, and the plane codes.
     */
    uint64_t memory;

    /*
     * True: reads the faces of each leaf (ebpo_view_stream_get_faces); their bytes and chunks count
     * for `bytes` and `memory`. In this case the stream also takes one bit per face of the file.
     */
    bool faces;

    uint8_t reserved[7];
} ebpo_view_options;

#define EBPO_VIEW_OPTIONS_INIT                                                     \
    {                                                                              \
        sizeof(ebpo_view_options), EBPO_PRIORITY_LEVEL, NULL, EBPO_UNSEEN_LAST, 0, \
            __builtin_inf(), -1, 0, 0, true, false, false, 0, false,               \
        {                                                                          \
            0                                                                      \
        }                                                                          \
    }

/* A node that a view has delivered. */
typedef struct ebpo_view_node {
    /* Cell, type and envelope of the node. */
    ebpo_stream_node node;

    /* Level of the node in the tree; 0 is the root. */
    int level;

    /*
     * True for the root, and for the last of eight siblings. With this node, all eight siblings are
     * delivered, and they replace their parent.
     */
    bool complete;

    /*
     * False: the cell is certainly outside the image. True: the cell may be partly in the image, or
     * there is no observer.
     */
    bool seen;

    /*
     * Distance from the eye to the nearest point of the cell, in the model's unit. 0: the eye is in
     * the cell. NAN without an observer.
     */
    double distance;

    /*
     * Size of the cell in the image, in pixels. The size is the length of the image of a segment.
     * This segment is as long as the cell's diagonal, parallel to the image plane, in the middle of
     * the image, and `distance` away from the eye. INFINITY: the eye is in the cell. NAN without an
     * observer.
     */
    double pixels;
} ebpo_view_node;

/* Result of ebpo_view_stream_next: a node, or the reason why there is none. */
typedef enum ebpo_view_end {
    EBPO_VIEW_NODE = 0,  /* a node was delivered */
    EBPO_VIEW_DONE = 1,  /* all nodes that the options select were delivered */
    EBPO_VIEW_BYTES = 2, /* the next nodes would exceed options.bytes */
    EBPO_VIEW_NODES = 3  /* the next nodes would exceed options.nodes */
} ebpo_view_end;

/* Streams the nodes of one file for an observer. */
typedef struct ebpo_view_stream ebpo_view_stream;

/*
 * Makes a stream of an open file, which must stay open. Reads no data yet. Other streams and models
 * may use the file at the same time, but their reads also count for options.bytes.
 *
 * EBPO_E_ARGUMENT: invalid options. EBPO_E_ABSENT: faces are requested, and the file has no mesh.
 *
 * Threads: any.
 */
EBPO_API EBPO_MUST_USE ebpo_status ebpo_view_stream_new(const ebpo_file *file,
                                                        const ebpo_view_options *options,
                                                        ebpo_view_stream **out, ebpo_error *error);

/*
 * Frees a stream.
 *
 * Threads: one at a time per stream.
 */
EBPO_API void ebpo_view_stream_free(ebpo_view_stream *stream);

/*
 * Gets the next node; its pointers are valid until the next call with the stream. If *end is not
 * EBPO_VIEW_NODE, there is no node and *out is unchanged.
 *
 * Reads the chunks of the node and its siblings that are not in memory. For a remote file, chunks
 * of the next nodes are also prefetched, within options.bytes.
 *
 * The caller may pause at any time, and may repeat the call after EBPO_E_IO and EBPO_E_MEMORY.
 * EBPO_E_FORMAT is permanent, and so is EBPO_E_LIMIT (more than 2^32 groups of siblings).
 *
 * The sequence of nodes depends only on the file and the options. A lower limit of bytes or nodes
 * ends the same sequence earlier.
 *
 * Threads: one at a time per stream.
 */
EBPO_API EBPO_MUST_USE ebpo_status ebpo_view_stream_next(ebpo_view_stream *stream,
                                                         ebpo_view_node *out, ebpo_view_end *end,
                                                         ebpo_error *error);

/* All faces that intersect the cell of a leaf. */
typedef struct ebpo_view_faces {
    size_t struct_size;

    /*
     * face_count: number of faces. new_count: number of new faces, which were not delivered with an
     * earlier leaf.
     */
    uint64_t face_count, new_count;

    /* [face_count] coordinates of the three corners, in the model's unit */
    const double (*corners)[3][3];

    /* [face_count] index of each face in the file, ascending */
    const uint32_t *file_faces;

    /*
     * [face_count] 1: the face was delivered with an earlier leaf. 0: the face is new. A viewer
     * that draws only new faces draws each face once
     */
    const uint8_t *repeated;
} ebpo_view_faces;

#define EBPO_VIEW_FACES_INIT EBPO_SIZED(ebpo_view_faces)

/*
 * Gets the faces of the last node of ebpo_view_stream_next. If this node is not a leaf, or
 * options.faces is false, face_count is 0. Arrays are valid until the next call with the stream.
 *
 * Faces are read with the leaf and its siblings. If the faces would exceed options.bytes, the leaf
 * and its siblings are not delivered.
 *
 * Threads: one at a time per stream.
 */
EBPO_API ebpo_status ebpo_view_stream_get_faces(const ebpo_view_stream *stream,
                                                ebpo_view_faces *out);

/*
 * Sets new options, for example after the observer has moved. The cut is kept. Nodes after the
 * current group of siblings are selected by the new options. On failure nothing changes. `options`
 * must not be NULL.
 *
 * EBPO_E_ARGUMENT: invalid options, or a member that must not change differs (ebpo_view_options).
 *
 * Threads: one at a time per stream.
 */
EBPO_API EBPO_MUST_USE ebpo_status ebpo_view_stream_change(ebpo_view_stream *stream,
                                                           const ebpo_view_options *options,
                                                           ebpo_error *error);

/*
 * Callback that gets a node, which is valid until the callback returns. The callback returns false
 * to stop the call.
 */
typedef bool (*ebpo_view_visit_fn)(void *user, const ebpo_view_node *node);

/*
 * Visits the cut: all delivered nodes that are not replaced by their children, including white
 * nodes. The order is front to back as seen by the observer. Without an observer, it is depth first
 * by octcode. In these nodes, `complete` is always true. Before the root is delivered, the cut has
 * no nodes. Reads no data. `visit` must not use the stream.
 *
 * Threads: one at a time per stream.
 */
EBPO_API void ebpo_view_stream_cut(ebpo_view_stream *stream, ebpo_view_visit_fn visit, void *user);

/* Statistics of a view (ebpo_view_stream_get_stats). */
typedef struct ebpo_view_stats {
    size_t struct_size;

    /* Number of delivered nodes. */
    uint64_t nodes;

    /* Number of nodes of the cut by type, indexed by ebpo_node_type. */
    uint64_t cut[4];

    /* Number of gray nodes of the cut that will be refined. */
    uint64_t waiting;

    /*
     * Size in the image (`pixels` of ebpo_view_node) of the largest visible gray node of the cut.
     * 0: no gray node of the cut is visible. NAN without an observer.
     */
    double pixels;

    /* Bytes read from the file since opening. */
    uint64_t bytes_read;
} ebpo_view_stats;

#define EBPO_VIEW_STATS_INIT EBPO_SIZED(ebpo_view_stats)

/*
 * Gets statistics; visits all gray nodes of the cut.
 *
 * Threads: one at a time per stream.
 */
EBPO_API ebpo_status ebpo_view_stream_get_stats(const ebpo_view_stream *stream,
                                                ebpo_view_stats *out);

/*
 * Makes a mesh for the observer from patches of the simplified surface (EBPO_PART_SURFACE), without
 * cracks. The result does not depend on the delivered nodes. Reads the patches that it uses, and
 * the table of all patches.
 *
 * The mesh begins with the patch of the root. Again and again, the visible patch with the greatest
 * error in the image is replaced by the patches of the node's children. The options unseen,
 * distance, level, bytes and memory apply to patches as to nodes. If the option `faces` is true,
 * patches whose nodes have no patches below are replaced by the model's faces, except in a subset
 * by a box. The option `priority` is ignored.
 *
 * Option `pixels`: a visible patch with a greater error in the image is used only if another option
 * prevents its replacement. The error in the image is the length in pixels of a segment in the
 * middle of the image. The segment is as long as ebpo_patch.error, and as far from the eye as the
 * nearest point of the node's cell. If `pixels` is 0, the finest patches are used.
 *
 * out     freed by ebpo_surface_mesh_free; cleared on failure. `error` is the greatest error of the
 *         patches that were used, and `pixels` is the greatest error in the image of the visible
 *         patches. Both are bounds for the patches as they are stored. To close cracks, some
 *         vertices of a patch are replaced by vertices of a coarser patch
 *
 * EBPO_E_ABSENT: the file does not have the part, or `faces` is true and the file has no mesh.
 * EBPO_E_LIMIT: options.bytes is too small for the patch of the root. EBPO_E_FORMAT, EBPO_E_IO,
 * EBPO_E_MEMORY.
 *
 * Threads: one at a time per stream. Source: format-spec/surface.md.
 */
EBPO_API EBPO_MUST_USE ebpo_status ebpo_view_stream_surface(ebpo_view_stream *stream,
                                                            ebpo_surface_mesh *out,
                                                            ebpo_error *error);

#ifdef __cplusplus
}
#endif
#endif
