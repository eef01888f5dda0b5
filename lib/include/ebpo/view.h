/* EBP-Octree in HDF5: nodes in the order in which they matter to an observer, as many as a budget
 * allows.
 *
 *     ebpo_view_options options = EBPO_VIEW_OPTIONS_INIT;
 *     options.priority = EBPO_PRIORITY_PIXELS;
 *     options.observer = &observer;
 *     options.pixels = 8;                                   refine until no visible cell is larger
 *     ebpo_view_stream_new(file, &options, &stream, &error);
 *     while (ebpo_view_stream_next(stream, &node, &end, &error) == EBPO_OK && end ==
 * EBPO_VIEW_NODE)
 *         ...                                               draw; when node.complete, forget the
 * parent
 *
 * The root comes first, then the eight children of one gray node after the other. Children replace
 * their parent when all eight are there (`complete`): the nodes that have not been replaced are the
 * cut, and at any time a conservative level of detail: every point of the root cell lies in exactly
 * one of their cells (walls aside), and what lies in the envelopes of its gray nodes and leaves and
 * in its black cells contains the solid. Sources: BP 2008, section 4.3, algorithm 9 (adaptive
 * display); Meagher 1982 (octree enumeration front to back).
 */
#ifndef EBPO_VIEW_H
#define EBPO_VIEW_H

#include <ebpo/stream.h>

#ifdef __cplusplus
extern "C" {
#endif

/* Whose children come next: of all gray nodes of the cut that are to be refined, the one that is
 * first by ... Equal ones: coarser levels first, then by octcode. */
typedef enum ebpo_priority {
    EBPO_PRIORITY_LEVEL = 0,    /* level after level, by octcode: the order of the file */
    EBPO_PRIORITY_DISTANCE = 1, /* distance from the eye to the nearest point of the cell */
    /* size on the picture, the largest first: ebpo_view_node.pixels */
    EBPO_PRIORITY_PIXELS = 2,
    /* enumeration front to back: of two cells that one ray from the eye passes, the one that it
       meets first, with all that is below it. The eight children of a node come front to back as
       well */
    EBPO_PRIORITY_FRONT_TO_BACK = 3
} ebpo_priority;

/* A perspective camera. */
typedef struct ebpo_observer {
    size_t struct_size; /* EBPO_OBSERVER_INIT sets it */
    double eye[3];      /* in the model's unit */
    /* of sight, of any length; (0, 0, 0): looks everywhere, and all nodes are seen */
    double direction[3];
    /* points upwards on the picture; of any length, not along `direction`. Means nothing to one who
     * looks everywhere */
    double up[3];
    double fov;             /* vertical angle of view, degrees, above 0 and below 180 */
    uint32_t width, height; /* of the picture, in pixels; from 1 */
} ebpo_observer;
#define EBPO_OBSERVER_INIT                                                          \
    {                                                                               \
        sizeof(ebpo_observer), { 0, 0, 0 }, { 0, 0, 0 }, { 0, 1, 0 }, 45, 1280, 720 \
    }

/* Gray nodes whose cells lie outside the picture. */
typedef enum ebpo_unseen {
    EBPO_UNSEEN_LAST = 0, /* are refined when nothing is left that is seen */
    EBPO_UNSEEN_NEVER = 1
} ebpo_unseen;

typedef struct ebpo_view_options {
    size_t struct_size; /* EBPO_VIEW_OPTIONS_INIT sets it */
    /* May be changed while the stream is going on: ebpo_view_stream_change. */
    ebpo_priority priority;
    const ebpo_observer *observer; /* copied; NULL: none, for EBPO_PRIORITY_LEVEL only */
    ebpo_unseen unseen;
    double pixels; /* nodes that are no larger on the picture are not refined; 0: all are */
    /* nodes that are farther from the eye, in the model's unit, are not refined; INFINITY: all are
     */
    double distance;
    int level; /* deepest level to deliver; -1: all */
    /* stop before more of the file has been read than this, counted as ebpo_file_get_stats does,
     * all since opening included; 0: no limit */
    uint64_t bytes;
    uint64_t nodes; /* stop before more nodes have been delivered than this; 0: no limit */
    /* Fixed. */
    bool planes, polygons; /* as in ebpo_stream_options; without both no planes are read */
    bool windings;         /* read winding numbers; else ebpo_stream_node.winding is 0 */
    /* bytes for decoded chunks, 1 MiB at least; what falls out is read again when it is needed. 0:
     * no limit. Beside it, the stream takes about 10 bytes for each node delivered, 4 more with
     * winding numbers, 32 for each gray node of the cut, and the plane codes */
    uint64_t memory;
} ebpo_view_options;
#define EBPO_VIEW_OPTIONS_INIT                                                     \
    {                                                                              \
        sizeof(ebpo_view_options), EBPO_PRIORITY_LEVEL, NULL, EBPO_UNSEEN_LAST, 0, \
            __builtin_inf(), -1, 0, 0, true, false, false, 0                       \
    }

typedef struct ebpo_view_node {
    ebpo_stream_node node;
    int level;
    /* the last of its siblings: they replace their parent from now on. The root is alone */
    bool complete;
    /* the cell is at least partly in the picture (errs towards true); true without an observer */
    bool seen;
    /* from the eye to the nearest point of the cell, 0: the eye is in it; NAN without an observer
     */
    double distance;
    /* of the cell's diagonal, at this distance, in the middle of the picture; INFINITY: the eye is
     * in the cell. NAN without an observer */
    double pixels;
} ebpo_view_node;

typedef enum ebpo_view_end {
    EBPO_VIEW_NODE = 0, /* not the end: there is a node */
    EBPO_VIEW_DONE = 1, /* every node is there that the options ask for */
    /* the next nodes do not fit the budget of bytes; ebpo_view_stream_change can raise it */
    EBPO_VIEW_BYTES = 2,
    EBPO_VIEW_NODES = 3 /* the same for nodes */
} ebpo_view_end;

typedef struct ebpo_view_stream ebpo_view_stream;

/* The file must stay open; nothing is read yet. One thread at a time; other threads may use the
 * file, but what they read counts as well. EBPO_E_ARGUMENT: options that make no sense. `options`
 * may be NULL. */
EBPO_API EBPO_MUST_USE ebpo_status ebpo_view_stream_new(const ebpo_file *file,
                                                        const ebpo_view_options *options,
                                                        ebpo_view_stream **out, ebpo_error *error);
EBPO_API void ebpo_view_stream_free(ebpo_view_stream *stream); /* NULL is fine */

/* The next node, lent until the next call on the stream. Of the file, the chunks are read that the
 * node and its siblings stand in, unless they are in memory; files far away are asked ahead, within
 * the budget, for what stands next in the order. One may stop anywhere and go on later, and try
 * again after a failure (EBPO_E_IO, EBPO_E_MEMORY; EBPO_E_FORMAT and EBPO_E_LIMIT, for more than
 * 2^32 groups, stay). *end tells why *out is untouched when it is not EBPO_VIEW_NODE. The sequence
 * depends on the file and the options only; a budget cuts it short and changes nothing else. */
EBPO_API EBPO_MUST_USE ebpo_status ebpo_view_stream_next(ebpo_view_stream *stream,
                                                         ebpo_view_node *out, ebpo_view_end *end,
                                                         ebpo_error *error);

/* Takes other options, for example an observer who has moved: the cut stays, what comes next is
 * chosen anew. Siblings that are on the way come first. On failure nothing changes; EBPO_E_ARGUMENT
 * also when a fixed option is another one. `options` must not be NULL. */
EBPO_API EBPO_MUST_USE ebpo_status ebpo_view_stream_change(ebpo_view_stream *stream,
                                                           const ebpo_view_options *options,
                                                           ebpo_error *error);

/* Called for one node after the other; lent until it returns. False: enough. */
typedef bool (*ebpo_view_visit_fn)(void *user, const ebpo_view_node *node);

/* The cut: nodes that have not been replaced, white ones included. Front to back of the observer,
 * without one in depth-first order of the octcodes; `complete` is always true. Reads nothing. No
 * node before the root has been delivered. `visit` must not use the stream. */
EBPO_API void ebpo_view_stream_cut(ebpo_view_stream *stream, ebpo_view_visit_fn visit, void *user);

typedef struct ebpo_view_stats {
    size_t struct_size; /* EBPO_VIEW_STATS_INIT sets it */
    uint64_t nodes;     /* delivered */
    uint64_t cut[4];    /* nodes of the cut, by ebpo_node_type */
    uint64_t waiting;   /* gray nodes of the cut that are to be refined */
    /* size of the largest gray node of the cut that is seen, which bounds how coarse the picture
     * is; 0: none is; NAN without an observer */
    double pixels;
    uint64_t bytes_read; /* of the file since it was opened */
} ebpo_view_stats;
#define EBPO_VIEW_STATS_INIT EBPO_SIZED(ebpo_view_stats)
/* Looks at all gray nodes of the cut. */
EBPO_API ebpo_status ebpo_view_stream_get_stats(const ebpo_view_stream *stream,
                                                ebpo_view_stats *out);

#ifdef __cplusplus
}
#endif
#endif
