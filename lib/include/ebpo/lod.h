/* SPDX-License-Identifier: MIT
 * EBP-Octree in HDF5: a level as closed polygons.
 */
#ifndef EBPO_LOD_H
#define EBPO_LOD_H

#include <ebpo/colours.h>
#include <ebpo/file.h>

#ifdef __cplusplus
extern "C" {
#endif

typedef struct ebpo_lod_options {
    size_t struct_size; /* EBPO_LOD_OPTIONS_INIT sets it */

    /* Keep polygons that lie on cell walls, so that each envelope is closed. */
    bool walls;

    /* 0: all cores. The result does not depend on it. */
    unsigned threads;

    ebpo_progress progress;

    /* What is read of the file keeps to it. NULL: as much memory as it takes. */
    ebpo_workspace *workspace;
} ebpo_lod_options;

#define EBPO_LOD_OPTIONS_INIT                                   \
    {                                                           \
        sizeof(ebpo_lod_options), true, 0, { NULL, NULL }, NULL \
    }

/*
 * The envelopes of `level`: of its gray nodes, and of the leaves and black nodes
 * of levels 0 to `level`. Each is a convex polyhedron, cut from its cell by the
 * half-spaces of the node and of its ancestors. Leaves are cut by stored planes
 * where the file has them, else by planes derived from their faces (EBP 2017,
 * 3.4).
 *
 * The polygons are rounded. What is guaranteed to contain the solid is the
 * decoded half-spaces.
 *
 * out      triangles with double vertices, node after node; nodes share no
 *          vertices. Freed by ebpo_mesh_free. NULL: only the volume is wanted.
 * volume   the sum of the polyhedra's volumes, in the model's unit cubed; or NULL
 *
 * The level's nodes, their polygons and `out` are held in memory, whatever `workspace`
 * says, and all of them are made: nothing but the level bounds memory and time, unless
 * `progress` stops it.
 *
 * EBPO_E_ARGUMENT: no such level. EBPO_E_LIMIT: more than 2^32 - 2 vertices or
 * triangles. EBPO_E_CANCELLED, EBPO_E_MEMORY, and the errors of reading.
 *
 * Threads: any.
 */
EBPO_API EBPO_MUST_USE ebpo_status ebpo_lod_level(const ebpo_file *file, int level,
                                                  const ebpo_lod_options *options, ebpo_mesh *out,
                                                  double *volume, ebpo_error *error);

/* One node of a level's envelopes. */
typedef struct ebpo_lod_node {
    uint64_t octcode;

    /* Of the envelope, in the model's unit cubed. */
    double volume;

    /* Black: in the cell. Leaf: at the lowest corner. Gray, and surfaces: 0. */
    int32_t winding;

    /* EBPO_GRAY (of the level asked for only), EBPO_LEAF or EBPO_BLACK. */
    ebpo_node_type type;

    /* Of the polyhedron, without what `walls` left out. */
    uint32_t vertex_count, polygon_count;

    /*
     * Red + 256 green + 65,536 blue, sRGB: of gray nodes their own, of leaves and
     * black nodes their parent's. Gray (0x808080) where `coloured` is 0.
     */
    uint32_t colour;

    /* 1: the file has colours of this node. */
    uint32_t coloured;
} ebpo_lod_node;

/*
 * Whose the triangles of ebpo_lod_level are. Nodes come level after level, in
 * the order of their octcodes; the mesh holds their vertices and triangles in the
 * same order.
 *
 * A polygon of n corners is a fan of n - 2 triangles around its first corner:
 * corners 0 and 1 of its first triangle, then corner 2 of each.
 */
typedef struct ebpo_lod_nodes {
    uint64_t node_count, polygon_count;

    /* [node_count] */
    ebpo_lod_node *nodes;

    /* [polygon_count] how many corners each polygon has, node after node */
    uint8_t *corners;
} ebpo_lod_nodes;

/*
 * Frees the arrays and clears the struct.
 *
 * Threads: one per struct.
 */
EBPO_API void ebpo_lod_nodes_free(ebpo_lod_nodes *nodes);

/*
 * ebpo_lod_level, and the nodes with it, which are freed by ebpo_lod_nodes_free.
 * `nodes` may be NULL; without `out` it must be.
 *
 * Threads: any.
 */
EBPO_API EBPO_MUST_USE ebpo_status ebpo_lod_level_nodes(const ebpo_file *file, int level,
                                                        const ebpo_lod_options *options,
                                                        ebpo_mesh *out, ebpo_lod_nodes *nodes,
                                                        double *volume, ebpo_error *error);

/*
 * Colours of a level's vertices, each in its node's; none if the file has no
 * colours. Faces have none.
 *
 * vertex_count  of the mesh that came with the nodes
 * out           freed by ebpo_colours_free; cleared on failure
 *
 * EBPO_E_ARGUMENT: the nodes have another number of vertices. EBPO_E_MEMORY.
 *
 * Threads: any.
 */
EBPO_API EBPO_MUST_USE ebpo_status ebpo_lod_colours(const ebpo_lod_nodes *nodes,
                                                    uint64_t vertex_count, ebpo_colours *out,
                                                    ebpo_error *error);

/*
 * Which way to light a level's polygons: those on planes as they lie; those on
 * walls between cells, which are steps and not surface, as the planes around them
 * that look to the same side, by area, or as they lie where there is none. Walls of
 * the root cell count as planes. For pictures: rounded, and no promise about the
 * solid.
 *
 * info  of the file that the level is of
 * mesh  that came with the nodes
 * out   [polygon_count][3] of length 1, of a polygon without area 0; the caller's
 *
 * EBPO_E_ARGUMENT: the nodes have another number of triangles, or the mesh is of
 * single precision. EBPO_E_MEMORY.
 *
 * Threads: any.
 */
EBPO_API EBPO_MUST_USE ebpo_status ebpo_lod_normals(const ebpo_info *info, const ebpo_mesh *mesh,
                                                    const ebpo_lod_nodes *nodes, float *out,
                                                    ebpo_error *error);

#ifdef __cplusplus
}
#endif
#endif
