/* SPDX-License-Identifier: MIT
 * Reads a part of a model as plain arrays: the nodes, envelopes and faces below a node. The
 * envelope of a node is a convex polyhedron that contains the part of the solid in the node's cell.
 * Gray nodes have children, leaves list faces, white nodes are outside the solid, and black nodes
 * are inside.
 *
 *     ebpo_subtree *subtree = NULL;
 *     ebpo_subtree_faces faces = EBPO_SUBTREE_FACES_INIT;
 *     if (ebpo_subtree_open(file, octcode, NULL, &subtree, &error) == EBPO_OK &&
 *         ebpo_subtree_get_faces(subtree, &faces, &error) == EBPO_OK)
 *         draw(faces.vertex_count, faces.xyz32, faces.face_count, faces.faces);
 *     ebpo_subtree_close(subtree);
 *
 * The library reads little more of the file than the returned data; a remote file (http.h) takes a
 * few requests. The octcode (locational code) of a node is a leading 1 and three bits for each
 * level (stream.h); ebpo_octcode_at returns the octcode of the cell that contains a point.
 */
#ifndef EBPO_SUBTREE_H
#define EBPO_SUBTREE_H

#include <ebpo/stream.h>

#ifdef __cplusplus
extern "C" {
#endif

/* ---- opening ---- */

/* Options of ebpo_subtree_open. */
typedef struct ebpo_subtree_options {
    size_t struct_size;

    /*
     * ebpo_part bits: parts to read if the file has them (envelopes, faces, source indices, stored
     * planes of leaves). Nodes are always read.
     */
    uint32_t parts;

    /*
     * Number of levels to read below the subtree's root. -1: all levels. With any other value, no
     * faces are read. The faces would be incomplete, because leaves below the last level also list
     * faces, and these leaves are not read.
     */
    int levels;

    /*
     * Maximum memory of the subtree in bytes, including buffers for reading. 0: no maximum. The
     * chunk directory of the file and its checksums (28 bytes per chunk) do not count.
     */
    uint64_t memory;

    /* True: also returns the coordinates of the corners of each face. */
    bool corners;

    /*
     * Action if there is no node with this octcode, because a leaf above it has no children. True:
     * this leaf is opened. False: EBPO_E_ARGUMENT is returned.
     */
    bool or_leaf_above;

    uint8_t reserved[6];
} ebpo_subtree_options;

#define EBPO_SUBTREE_OPTIONS_INIT                                     \
    {                                                                 \
        sizeof(ebpo_subtree_options), ~0u, -1, 0, false, false, { 0 } \
    }

/* An immutable subtree in memory. */
typedef struct ebpo_subtree ebpo_subtree;

/*
 * Reads the subtree of the gray node or leaf with this octcode. The octcode of the root, 1, reads
 * the whole tree. The file may be closed before the subtree.
 *
 * EBPO_E_ARGUMENT: the value is not an octcode, the node does not exist, or it is a white or black
 * node, which no face intersects. EBPO_E_ABSENT: the file is a subset (ebpo_subset) without the
 * data below this node.
 * EBPO_E_LIMIT: options.memory is too small, and the message names a sufficient value; or more than
 * 2^32 - 2 nodes, planes or listed faces. Also the errors of reading (base.h).
 *
 * Threads: any.
 */
EBPO_API EBPO_MUST_USE ebpo_status ebpo_subtree_open(const ebpo_file *file, uint64_t octcode,
                                                     const ebpo_subtree_options *options,
                                                     ebpo_subtree **out, ebpo_error *error);

/*
 * Closes a subtree.
 *
 * Threads: one at a time per subtree.
 */
EBPO_API void ebpo_subtree_close(ebpo_subtree *subtree);

/*
 * Returns the octcode of the cell of level `level` that contains the point. A point on a cell face
 * belongs to the cell with the larger coordinates. The tree may have no node for this cell
 * (ebpo_subtree_options.or_leaf_above). Returns 0 if the point is not in the model's root cell, or
 * the level is invalid.
 *
 * level   0 to EBPO_LEVELS_MAX - 1
 *
 * Threads: any.
 */
EBPO_API uint64_t ebpo_octcode_at(const ebpo_info *info, const double point[3], int level);

/* ---- nodes ---- */

/* Value in `children` of ebpo_subtree_nodes: the node has no children in this subtree. */
#define EBPO_NO_CHILDREN UINT32_MAX

/*
 * All nodes of a subtree, including white nodes. Index 0 is the subtree's root; nodes are sorted by
 * level and then by octcode, so octcodes ascend. Arrays are valid until the subtree is closed.
 */
typedef struct ebpo_subtree_nodes {
    size_t struct_size;

    /* Level of the subtree's root in the tree, and number of levels of the subtree. */
    int level, level_count;

    uint64_t node_count;

    /* [level_count + 1] index of the first node of each level; the last item is node_count */
    const uint64_t *level_first;

    /* [node_count] octcodes of the nodes */
    const uint64_t *octcodes;

    /* [node_count] ebpo_node_type */
    const uint8_t *types;

    /*
     * [node_count] winding numbers. White or black node: winding number of all points in the cell.
     * Leaf: winding number of the lowest corner, after the corner was shifted by infinitely small
     * positive numbers (format-spec/README.md, section 10). Gray node: 0. NULL: the model is a
     * surface
     */
    const int32_t *windings;

    /*
     * [node_count] index of the first child of each gray node; its eight children are consecutive,
     * in the order of octants. EBPO_NO_CHILDREN: the node is not gray, it is pruned, or its
     * children are beyond options.levels
     */
    const uint32_t *children;

    /*
     * [node_count + 1] index in `planes` of each node's first stored plane. Stored planes are the
     * planes that a gray node adds to the planes of its ancestors, and the planes of a leaf if the
     * file has planes of leaves. NULL: planes were not requested, or the file has none
     */
    const uint32_t *plane_first;

    /* Plane codes (ebpo_plane_decode) of all nodes, in the coordinates of each node's cell. */
    const uint32_t *planes;

    /*
     * [level + 1] index in `above_planes` of the first plane of each node above the subtree's root,
     * from the tree's root down. These planes also bound all envelopes of the subtree. NULL: planes
     * were not requested, or the file has none
     */
    const uint32_t *above_first;

    /*
     * Plane codes (ebpo_plane_decode) of the nodes above the subtree's root, in the coordinates of
     * each node's cell.
     */
    const uint32_t *above_planes;

    /* Total memory of the subtree in bytes. */
    uint64_t memory;
} ebpo_subtree_nodes;

#define EBPO_SUBTREE_NODES_INIT EBPO_SIZED(ebpo_subtree_nodes)

/*
 * Gets the nodes.
 *
 * Threads: any.
 */
EBPO_API ebpo_status ebpo_subtree_get_nodes(const ebpo_subtree *subtree, ebpo_subtree_nodes *out);

/* A node of a subtree, with planes and vertices in the model's coordinates. */
typedef struct ebpo_subtree_node {
    size_t struct_size;

    /*
     * The node as a stream returns it (stream.h), with one difference. If no planes of leaves are
     * stored, and the subtree has faces, then leaves have planes derived from their faces (EBP
     * 2017, 3.3.4), but not with info.border_inside, where leaves also contain the inside.
     */
    ebpo_stream_node node;

    /* Number of half-spaces in `inherited`. */
    uint32_t inherited_count;

    /*
     * [inherited_count] half-spaces of the nodes above this node, from the tree's root down, in the
     * form of `planes` of ebpo_stream_node
     */
    const double (*inherited)[4];
} ebpo_subtree_node;

#define EBPO_SUBTREE_NODE_INIT EBPO_SIZED(ebpo_subtree_node)

/*
 * Gets the node with index `number` in ebpo_subtree_nodes: its cell, its half-spaces if planes were
 * read, and its envelope if `polygons` is true. The pointers in *out are valid until the next call
 * of this function for the same subtree.
 *
 * Threads: one at a time per subtree.
 */
EBPO_API EBPO_MUST_USE ebpo_status ebpo_subtree_get_node(ebpo_subtree *subtree, uint64_t number,
                                                         bool polygons, ebpo_subtree_node *out,
                                                         ebpo_error *error);

/* ---- faces ---- */

/*
 * All faces that intersect the subtree's cell, in the order of the file. Leaves may also list faces
 * that are outside the cell by a rounding error. In a subset (ebpo_subset), faces that are only
 * below pruned nodes are missing. Arrays are valid until the subtree is closed.
 *
 * A face is shared if a leaf that precedes this subtree in the file also lists the face. Shared
 * faces come first, because faces are in the order in which leaves first list them. All other faces
 * are owned. So if the tree is divided into disjoint subtrees, exactly one of the subtrees that
 * list a face owns the face. The whole tree owns all faces.
 */
typedef struct ebpo_subtree_faces {
    size_t struct_size;

    /* Number of faces, and number of shared faces. The shared faces are 0 .. shared_count - 1. */
    uint64_t face_count, shared_count;

    uint64_t vertex_count;

    /*
     * [vertex_count][3] coordinates in the model's unit, as stored. One of the two arrays is set;
     * the other array is NULL
     */
    const float *xyz32;
    const double *xyz64;

    /* [face_count][3] vertex indices in this subtree */
    const uint32_t *faces;

    /*
     * [face_count][3][3] coordinates of the corners of each face, with options.corners; else NULL.
     * One of the two arrays is set
     */
    const float *corners32;
    const double *corners64;

    /* [face_count] index of each face in the file, ascending */
    const uint32_t *file_faces;

    /*
     * [face_count] source index of each face. NULL: source indices were not requested, or the file
     * has none (EBPO_PART_MAPS)
     */
    const uint32_t *source;

    /*
     * [node_count + 1] index in `list` of the first face that each node lists; only leaves list
     * faces
     */
    const uint32_t *list_first;

    /* Indices of the listed faces in this subtree, leaf after leaf, ascending within each leaf. */
    const uint32_t *list;
} ebpo_subtree_faces;

#define EBPO_SUBTREE_FACES_INIT EBPO_SIZED(ebpo_subtree_faces)

/*
 * Gets the faces.
 *
 * EBPO_E_ABSENT: the file has no mesh, or the subtree was opened without EBPO_PART_MESH or with
 * limited levels.
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
