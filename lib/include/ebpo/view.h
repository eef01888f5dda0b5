/* SPDX-License-Identifier: MIT
 * EBP-Octree in HDF5: nodes in the order in which they matter to an observer, as
 * many as a budget allows.
 *
 *     ebpo_view_options options = EBPO_VIEW_OPTIONS_INIT;
 *     options.priority = EBPO_PRIORITY_PIXELS;
 *     options.observer = &observer;
 *     options.pixels = 8;            refine until no visible cell is larger
 *     ebpo_view_stream_new(file, &options, &stream, &error);
 *     while (ebpo_view_stream_next(stream, &node, &end, &error) == EBPO_OK &&
 *            end == EBPO_VIEW_NODE)
 *         draw(&node);               when node.complete, forget the parent
 *
 * The root comes first, then the eight children of one gray node after the other.
 * Children replace their parent when all eight are there (`complete`). The nodes
 * that have not been replaced are the cut.
 *
 * At any time the cut is a conservative level of detail. Every point of the root
 * cell lies in exactly one of its cells, walls aside, and the solid lies within
 * the envelopes of its gray nodes and leaves and within its black cells.
 *
 * Sources: BP 2008, section 4.3, algorithm 9 (adaptive display); Meagher 1982
 * (octree enumeration front to back).
 */
#ifndef EBPO_VIEW_H
#define EBPO_VIEW_H

#include <ebpo/stream.h>

#ifdef __cplusplus
extern "C" {
#endif

/*
 * Whose children come next: of all gray nodes of the cut that are to be refined,
 * the one that is first by this. Of equal ones, coarser levels come first, then
 * the order of octcodes.
 */
typedef enum ebpo_priority {
    /* Level after level, by octcode: the order of the file. */
    EBPO_PRIORITY_LEVEL = 0,

    /* Distance from the eye to the nearest point of the cell. */
    EBPO_PRIORITY_DISTANCE = 1,

    /* Size on the picture, the largest first: `pixels` of ebpo_view_node. */
    EBPO_PRIORITY_PIXELS = 2,

    /*
     * Front to back: of two cells on one ray from the eye, the one that it meets
     * first, with all that is below it. The eight children of a node come front
     * to back as well.
     */
    EBPO_PRIORITY_FRONT_TO_BACK = 3
} ebpo_priority;

/* A perspective camera. */
typedef struct ebpo_observer {
    size_t struct_size; /* EBPO_OBSERVER_INIT sets it */

    /* In the model's unit. */
    double eye[3];

    /* Of sight, of any length. (0, 0, 0): looks everywhere, all nodes are seen. */
    double direction[3];

    /*
     * What points upwards on the picture: of any length, not along `direction`.
     * Does not matter to one who looks everywhere.
     */
    double up[3];

    /* The vertical angle of view in degrees, above 0 and below 180. */
    double fov;

    /* Of the picture in pixels, from 1. */
    uint32_t width, height;
} ebpo_observer;

#define EBPO_OBSERVER_INIT                                                          \
    {                                                                               \
        sizeof(ebpo_observer), { 0, 0, 0 }, { 0, 0, 0 }, { 0, 1, 0 }, 45, 1280, 720 \
    }

/* What becomes of gray nodes whose cells lie outside the picture. */
typedef enum ebpo_unseen {
    EBPO_UNSEEN_LAST = 0, /* refined when nothing is left that is seen */
    EBPO_UNSEEN_NEVER = 1 /* never refined */
} ebpo_unseen;

typedef struct ebpo_view_options {
    size_t struct_size; /* EBPO_VIEW_OPTIONS_INIT sets it */

    /* ---- what ebpo_view_stream_change may change ---- */

    ebpo_priority priority;

    /* Copied. NULL: none, which will do for EBPO_PRIORITY_LEVEL only. */
    const ebpo_observer *observer;

    ebpo_unseen unseen;

    /* Nodes no larger than this on the picture are not refined. 0: all are. */
    double pixels;

    /*
     * Nodes farther from the eye than this, in the model's unit, are not refined.
     * INFINITY: all are.
     */
    double distance;

    /* The deepest level to deliver. -1: all. */
    int level;

    /*
     * Stop before more bytes of the file have been read than this, since it was
     * opened and counted as by ebpo_file_get_stats. 0: no limit.
     */
    uint64_t bytes;

    /* Stop before more nodes have been delivered than this. 0: no limit. */
    uint64_t nodes;

    /* ---- what stays as it is ---- */

    /* As in ebpo_stream_options. Without both, no planes are read. */
    bool planes, polygons;

    /* Read winding numbers. Else those of nodes are 0. */
    bool windings;

    /*
     * Bytes for decoded chunks, at least 1 MiB; what falls out is read again when
     * it is needed. 0: no limit. Beside it, the stream takes about 10 bytes for
     * each node delivered, 4 more with winding numbers, 32 for each gray node of
     * the cut, and the plane codes.
     */
    uint64_t memory;

    /*
     * With each leaf read its faces (ebpo_view_stream_get_faces), within the limits of bytes and
     * memory. Beside these, the stream takes one bit more for each face of the file.
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

typedef struct ebpo_view_node {
    ebpo_stream_node node;

    int level;

    /*
     * The last of its siblings: from now on they replace their parent. The root
     * is alone.
     */
    bool complete;

    /*
     * The cell is at least partly in the picture; errs towards true. True without
     * an observer.
     */
    bool seen;

    /*
     * From the eye to the nearest point of the cell, in the model's unit. 0: the
     * eye is in it. NAN without an observer.
     */
    double distance;

    /*
     * Of the cell's diagonal, at this distance, in the middle of the picture.
     * INFINITY: the eye is in the cell. NAN without an observer.
     */
    double pixels;
} ebpo_view_node;

typedef enum ebpo_view_end {
    EBPO_VIEW_NODE = 0,  /* not the end: there is a node */
    EBPO_VIEW_DONE = 1,  /* every node is there that the options ask for */
    EBPO_VIEW_BYTES = 2, /* the next nodes would exceed options.bytes */
    EBPO_VIEW_NODES = 3  /* the next nodes would exceed options.nodes */
} ebpo_view_end;

typedef struct ebpo_view_stream ebpo_view_stream;

/*
 * Makes a stream of an open file, which must stay open. Nothing is read yet.
 * Others may use the file, but what they read counts as well (options.bytes).
 *
 * EBPO_E_ARGUMENT: options that make no sense. EBPO_E_ABSENT: faces are wanted, and the file has no
 * mesh. EBPO_E_MEMORY.
 *
 * Threads: any.
 */
EBPO_API EBPO_MUST_USE ebpo_status ebpo_view_stream_new(const ebpo_file *file,
                                                        const ebpo_view_options *options,
                                                        ebpo_view_stream **out, ebpo_error *error);

/*
 * Threads: one per stream.
 */
EBPO_API void ebpo_view_stream_free(ebpo_view_stream *stream);

/*
 * The next node. What it points to is the stream's, until the next call on it.
 * Unless *end is EBPO_VIEW_NODE, there is none and *out is left alone.
 *
 * Of the file, the chunks are read that hold the node and its siblings, unless
 * they are in memory. Of a file far away, what comes next in the order is fetched
 * ahead, within the budget.
 *
 * One may stop anywhere and go on later, and try again after EBPO_E_IO and
 * EBPO_E_MEMORY. EBPO_E_FORMAT stays, and so does EBPO_E_LIMIT, for more than 2^32
 * groups of siblings.
 *
 * The sequence depends on the file and the options only. A budget cuts it short
 * and changes nothing else.
 *
 * Threads: one per stream.
 */
EBPO_API EBPO_MUST_USE ebpo_status ebpo_view_stream_next(ebpo_view_stream *stream,
                                                         ebpo_view_node *out, ebpo_view_end *end,
                                                         ebpo_error *error);

/* The faces of a leaf: all that touch its cell. */
typedef struct ebpo_view_faces {
    size_t struct_size; /* EBPO_VIEW_FACES_INIT sets it */

    /* All, and those of them that have come with no leaf before. */
    uint64_t face_count, new_count;

    /* [face_count] corner after corner, in the model's unit */
    const double (*corners)[3][3];

    /* [face_count] number in the file, ascending */
    const uint32_t *numbers;

    /*
     * [face_count] 1: has come with a leaf before, so that who draws the others draws each face
     * once; else 0
     */
    const uint8_t *repeated;
} ebpo_view_faces;

#define EBPO_VIEW_FACES_INIT EBPO_SIZED(ebpo_view_faces)

/*
 * With options.faces: those of the leaf that ebpo_view_stream_next gave last; none if it gave
 * another node or none. Arrays are the stream's, until the next call on it.
 *
 * They have been read with the leaf and its siblings, at most as far as options.bytes allows: where
 * their faces would exceed it, the siblings do not come either.
 *
 * EBPO_E_ARGUMENT: `out` was not begun with its macro.
 *
 * Threads: one per stream.
 */
EBPO_API ebpo_status ebpo_view_stream_get_faces(const ebpo_view_stream *stream,
                                                ebpo_view_faces *out);

/*
 * Takes other options, for example an observer who has moved. The cut stays; what
 * comes next is chosen anew, after siblings that are on their way. On failure
 * nothing changes. `options` must not be NULL.
 *
 * EBPO_E_ARGUMENT: options that make no sense, or one that cannot be changed is
 * another.
 *
 * Threads: one per stream.
 */
EBPO_API EBPO_MUST_USE ebpo_status ebpo_view_stream_change(ebpo_view_stream *stream,
                                                           const ebpo_view_options *options,
                                                           ebpo_error *error);

/* Called with one node after the other, lent until it returns. False: enough. */
typedef bool (*ebpo_view_visit_fn)(void *user, const ebpo_view_node *node);

/*
 * Visits the cut: all nodes that have not been replaced, white ones included,
 * front to back of the observer, or by octcode and depth first if there is none.
 * `complete` is always true. Before the root has been delivered there is no node.
 * Reads nothing.
 *
 * `visit` must not use the stream.
 *
 * Threads: one per stream.
 */
EBPO_API void ebpo_view_stream_cut(ebpo_view_stream *stream, ebpo_view_visit_fn visit, void *user);

typedef struct ebpo_view_stats {
    size_t struct_size; /* EBPO_VIEW_STATS_INIT sets it */

    /* Nodes delivered. */
    uint64_t nodes;

    /* Nodes of the cut, by ebpo_node_type. */
    uint64_t cut[4];

    /* Gray nodes of the cut that are to be refined. */
    uint64_t waiting;

    /*
     * The size of the largest gray node of the cut that is seen, which bounds how
     * coarse the picture is. 0: none is seen. NAN without an observer.
     */
    double pixels;

    /* Bytes of the file, since it was opened. */
    uint64_t bytes_read;
} ebpo_view_stats;

#define EBPO_VIEW_STATS_INIT EBPO_SIZED(ebpo_view_stats)

/*
 * Looks at all gray nodes of the cut.
 *
 * EBPO_E_ARGUMENT: `out` was not begun with its macro.
 *
 * Threads: one per stream.
 */
EBPO_API ebpo_status ebpo_view_stream_get_stats(const ebpo_view_stream *stream,
                                                ebpo_view_stats *out);

#ifdef __cplusplus
}
#endif
#endif
