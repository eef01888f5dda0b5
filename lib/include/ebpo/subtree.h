/* SPDX-License-Identifier: MIT
 * EBP-Octree in HDF5: a part of a model as plain arrays. The subtree of a node: its nodes, their
 * envelopes, and its faces with coordinates.
 *
 *     ebpo_subtree *subtree = NULL;
 *     ebpo_subtree_faces faces = EBPO_SUBTREE_FACES_INIT;
 *     if (ebpo_subtree_open(file, octcode, NULL, &subtree, &error) == EBPO_OK &&
 *         ebpo_subtree_get_faces(subtree, &faces, &error) == EBPO_OK)
 *         draw(faces.vertex_count, faces.xyz32, faces.face_count, faces.faces);
 *     ebpo_subtree_close(subtree);
 *
 * Of the file, about that is read which is given: of a file far away (http.h) in a few requests.
 * Octcodes are those of ebpo_stream_node and ebpo_view_node; ebpo_octcode_at gives that of the cell
 * around a point.
 */
#ifndef EBPO_SUBTREE_H
#define EBPO_SUBTREE_H

#include <ebpo/stream.h>

#ifdef __cplusplus
extern "C" {
#endif

/* ---- opening ---- */

typedef struct ebpo_subtree_options {
    size_t struct_size; /* EBPO_SUBTREE_OPTIONS_INIT sets it */

    /*
     * Bits of ebpo_part that are read, of those the file has: envelopes, faces, numbers in the
     * source, stored planes of leaves. Nodes always are.
     */
    uint32_t parts;

    /*
     * Give nodes of at most so many levels below the subtree's root. -1: all. Otherwise there are
     * no faces, because these are those of the whole subtree.
     */
    int levels;

    /*
     * Bytes that the subtree may take, with all that reading it needs on the way. 0: as much as it
     * takes. Beside it there is the file's table of chunks (24 bytes a chunk).
     */
    uint64_t memory;

    /* Give the corners of each face as coordinates, too. */
    bool corners;

    /*
     * Where the tree ends above the octcode, open the leaf there. Else that is EBPO_E_ARGUMENT.
     */
    bool or_leaf_above;

    uint8_t reserved[6];
} ebpo_subtree_options;

#define EBPO_SUBTREE_OPTIONS_INIT                                     \
    {                                                                 \
        sizeof(ebpo_subtree_options), ~0u, -1, 0, false, false, { 0 } \
    }

/* A subtree in memory. It does not change. */
typedef struct ebpo_subtree ebpo_subtree;

/*
 * Reads the subtree of the gray node or leaf with this octcode; 1: the whole tree. The file may be
 * closed before the subtree is.
 *
 * EBPO_E_ARGUMENT: not an octcode; no such node; a white or black one, which no face touches.
 * EBPO_E_ABSENT: the file is a subset (ebpo_subset) that does not hold what is below this node.
 * EBPO_E_LIMIT: options.memory is too little, the message names enough; or more than 2^32 - 2
 * nodes, planes or listed faces. EBPO_E_MEMORY, and the errors of reading.
 *
 * Threads: any.
 */
EBPO_API EBPO_MUST_USE ebpo_status ebpo_subtree_open(const ebpo_file *file, uint64_t octcode,
                                                     const ebpo_subtree_options *options,
                                                     ebpo_subtree **out, ebpo_error *error);

/*
 * Threads: one per subtree.
 */
EBPO_API void ebpo_subtree_close(ebpo_subtree *subtree);

/*
 * The octcode of the cell of a level that holds the point, walls being of the cell above them: of a
 * node that may or may not be in the tree (ebpo_subtree_options.or_leaf_above). 0: the point is not
 * in the model's root cell, or there can be no such level.
 *
 * level   0 to EBPO_LEVELS_MAX - 1
 *
 * Threads: any.
 */
EBPO_API uint64_t ebpo_octcode_at(const ebpo_info *info, const double point[3], int level);

/* ---- nodes ---- */

/* In `children`: of a node that has none here. */
#define EBPO_NO_CHILDREN UINT32_MAX

/*
 * All nodes of a subtree, white ones included. They have numbers from 0, which is the subtree's
 * root, level after level and within each by octcode: octcodes ascend. Arrays are the subtree's.
 */
typedef struct ebpo_subtree_nodes {
    size_t struct_size; /* EBPO_SUBTREE_NODES_INIT sets it */

    /* Of the subtree's root in the tree; and how many levels of the subtree are given. */
    int level, level_count;

    uint64_t node_count;

    /* [level_count + 1] the first node of each level */
    const uint64_t *level_first;

    /* [node_count] */
    const uint64_t *octcodes;

    /* [node_count] an ebpo_node_type */
    const uint8_t *types;

    /*
     * [node_count] white, black: winding number in the cell. Leaf: at the lowest corner, shifted
     * (see format-spec). Gray: 0. NULL: the model is a surface.
     */
    const int32_t *windings;

    /*
     * [node_count] the first of a gray node's eight children, octant after octant.
     * EBPO_NO_CHILDREN: the node is not gray, its children are beyond options.levels, or it is
     * pruned, having none in this file.
     */
    const uint32_t *children;

    /*
     * [node_count + 1] where each node's own planes begin in `planes`: those that a gray node adds
     * to its parent's envelope, and those stored for a leaf. NULL: the parts were not asked for, or
     * the file does not have them.
     */
    const uint32_t *plane_first;

    /* Codes, see ebpo_plane_decode, in coordinates of the node's cell. */
    const uint32_t *planes;

    /*
     * [level + 1] where the planes of each node above the subtree's root begin in `above_planes`,
     * from the tree's root down: they bound all envelopes of the subtree as well. NULL as
     * plane_first.
     */
    const uint32_t *above_first;

    /* Codes in coordinates of that node's cell. */
    const uint32_t *above_planes;

    /* Bytes that the subtree takes, all in all. */
    uint64_t memory;
} ebpo_subtree_nodes;

#define EBPO_SUBTREE_NODES_INIT EBPO_SIZED(ebpo_subtree_nodes)

/*
 * EBPO_E_ARGUMENT: `out` was not begun with its macro.
 *
 * Threads: any.
 */
EBPO_API ebpo_status ebpo_subtree_get_nodes(const ebpo_subtree *subtree, ebpo_subtree_nodes *out);

/* A node in the model's coordinates. */
typedef struct ebpo_subtree_node {
    size_t struct_size; /* EBPO_SUBTREE_NODE_INIT sets it */

    /*
     * As streams give it, without polygons unless they are asked for. But leaves without stored
     * planes have those that follow from their faces, where the subtree has faces (EBP 2017, 3.4).
     */
    ebpo_stream_node node;

    /* Half-spaces of the nodes above it, from the tree's root down. */
    uint32_t inherited_count;

    /* [inherited_count] as `planes` of ebpo_stream_node */
    const double (*inherited)[4];
} ebpo_subtree_node;

#define EBPO_SUBTREE_NODE_INIT EBPO_SIZED(ebpo_subtree_node)

/*
 * Node `number` of ebpo_subtree_nodes: its cell, half-spaces and, with `polygons`, its envelope,
 * without planes where these have not been read. What it points to is the subtree's, until the next
 * call for a node of it.
 *
 * EBPO_E_ARGUMENT: no such node, or `out` was not begun with its macro. EBPO_E_MEMORY.
 *
 * Threads: one per subtree.
 */
EBPO_API EBPO_MUST_USE ebpo_status ebpo_subtree_get_node(ebpo_subtree *subtree, uint64_t number,
                                                         bool polygons, ebpo_subtree_node *out,
                                                         ebpo_error *error);

/* ---- faces ---- */

/*
 * All faces that touch the subtree's cell (and maybe some that pass by it at the distance of a
 * rounding error, which its leaves list, too), in the order of the file: first those that are new
 * in a leaf before the subtree's and only listed here again, then its own. So of all subtrees that
 * share a face one has it as its own, the whole tree all. Of a subset (ebpo_subset) those that are
 * only below pruned nodes are missing. Arrays are the subtree's.
 */
typedef struct ebpo_subtree_faces {
    size_t struct_size; /* EBPO_SUBTREE_FACES_INIT sets it */

    /* All; and how many of them, the first ones, are other subtrees' own. */
    uint64_t face_count, outer_count;

    uint64_t vertex_count;

    /* [vertex_count][3] in the model's unit, as stored: one of the two, the other is NULL */
    const float *xyz32;
    const double *xyz64;

    /* [face_count][3] vertices, from 0 in this subtree */
    const uint32_t *faces;

    /* [face_count][3][3] corner after corner, with options.corners: one of the two */
    const float *corners32;
    const double *corners64;

    /* [face_count] number in the file, ascending */
    const uint32_t *numbers;

    /* [face_count] number in the source; NULL: not asked for, or the file has no maps */
    const uint32_t *source;

    /*
     * [node_count + 1] where each node's list of faces begins in `list`; of nodes that are not
     * leaves the lists are empty
     */
    const uint32_t *list_first;

    /* Faces, from 0 in this subtree, ascending within each leaf. */
    const uint32_t *list;
} ebpo_subtree_faces;

#define EBPO_SUBTREE_FACES_INIT EBPO_SIZED(ebpo_subtree_faces)

/*
 * EBPO_E_ABSENT: the file has no mesh; or it was opened without EBPO_PART_MESH, or for few levels.
 * EBPO_E_ARGUMENT: `out` was not begun with its macro.
 *
 * Threads: any.
 */
EBPO_API EBPO_MUST_USE ebpo_status ebpo_subtree_get_faces(const ebpo_subtree *subtree,
                                                          ebpo_subtree_faces *out,
                                                          ebpo_error *error);

#ifdef __cplusplus
}
#endif
#endif
