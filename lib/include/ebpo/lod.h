/* SPDX-License-Identifier: MIT
 * Computes the envelopes of a level as closed polygons. The envelope of a node is a convex
 * polyhedron that contains the part of the solid in the node's cell. Gray nodes have children,
 * leaves list faces, and black nodes are inside the solid (ebpo_node_type in file.h).
 */
#ifndef EBPO_LOD_H
#define EBPO_LOD_H

#include <ebpo/colours.h>
#include <ebpo/file.h>

#ifdef __cplusplus
extern "C" {
#endif

/* Options of ebpo_lod_level and ebpo_lod_level_nodes. */
typedef struct ebpo_lod_options {
    size_t struct_size;

    /*
     * True: polygons on cell faces are kept, so that each envelope is closed. False: they are
     * omitted.
     */
    bool cell_faces;

    unsigned threads;

    ebpo_progress progress;

    /* Workspace that limits the memory for data read from the file. NULL: no limit. */
    ebpo_workspace *workspace;
} ebpo_lod_options;

#define EBPO_LOD_OPTIONS_INIT                                   \
    {                                                           \
        sizeof(ebpo_lod_options), true, 0, { NULL, NULL }, NULL \
    }

/*
 * Computes the envelopes of a level: the envelopes of its gray nodes, and of the leaves and black
 * nodes of levels 0 to `level`. Each envelope is a convex polyhedron: the intersection of the
 * node's cell with the half-spaces of the node and its ancestors. If the file stores half-spaces of
 * leaves, these are used; otherwise the half-spaces of a leaf are derived from its faces (EBP 2017,
 * 3.3.4).
 *
 * The polygons are rounded. Only the decoded half-spaces are guaranteed to contain the solid.
 *
 * out      mesh of triangles in the order of the nodes, with coordinates as doubles; nodes share no
 *          vertices. Freed by ebpo_mesh_free. NULL: only the volume is computed
 * volume   sum of the polyhedra's volumes, in cubic units of the model; may be NULL
 *
 * The level's nodes, their polygons and `out` are in memory that `workspace` does not limit. Memory
 * and time depend on the level; `progress` can stop the call.
 *
 * EBPO_E_LIMIT: more than 2^32 - 2 vertices or triangles. Also the errors of reading the file.
 *
 * Threads: any.
 */
EBPO_API EBPO_MUST_USE ebpo_status ebpo_lod_level(const ebpo_file *file, int level,
                                                  const ebpo_lod_options *options, ebpo_mesh *out,
                                                  double *volume, ebpo_error *error);

/* A node whose envelope is part of a level. */
typedef struct ebpo_lod_node {
    /* Path from the root to the node, as in ebpo_stream_node (stream.h). */
    uint64_t octcode;

    /* Volume of the envelope, in cubic units of the model. */
    double volume;

    /*
     * Black nodes: winding number of all points in the cell. Leaves: winding number of the cell's
     * lowest corner. 0 for gray nodes, and for nodes of surfaces.
     */
    int32_t winding;

    /* EBPO_GRAY (only on the requested level), EBPO_LEAF or EBPO_BLACK. */
    ebpo_node_type type;

    /*
     * Number of vertices and of polygons of the envelope. Without the option `cell_faces`, polygons
     * on cell faces are not counted.
     */
    uint32_t vertex_count, polygon_count;

    /*
     * Colour: red + 256 green + 65,536 blue, sRGB. A gray node has the colour that is stored for
     * it; a leaf or black node has the colour of its parent. 0x808080 if `coloured` is 0.
     */
    uint32_t colour;

    /* 1: the file has a colour for this node. */
    uint32_t coloured;
} ebpo_lod_node;

/*
 * The nodes whose envelopes ebpo_lod_level computes, level by level, in the order of their
 * octcodes. The mesh has the nodes' vertices and triangles in the same order.
 *
 * A polygon of n corners is a fan of n - 2 triangles around its first corner. The polygon's corners
 * are corners 0 and 1 of the first triangle, then corner 2 of each triangle.
 */
typedef struct ebpo_lod_nodes {
    uint64_t node_count, polygon_count;

    /* [node_count] descriptions of the nodes */
    ebpo_lod_node *nodes;

    /* [polygon_count] number of corners of each polygon, in the order of the nodes */
    uint8_t *corners;
} ebpo_lod_nodes;

/*
 * Frees the arrays and clears the struct.
 *
 * Threads: one at a time per struct.
 */
EBPO_API void ebpo_lod_nodes_free(ebpo_lod_nodes *nodes);

/*
 * Computes the envelopes as ebpo_lod_level does, and describes their nodes in `nodes`.
 *
 * nodes   freed by ebpo_lod_nodes_free. May be NULL, and must be NULL if `out` is NULL
 *
 * Threads: any.
 */
EBPO_API EBPO_MUST_USE ebpo_status ebpo_lod_level_nodes(const ebpo_file *file, int level,
                                                        const ebpo_lod_options *options,
                                                        ebpo_mesh *out, ebpo_lod_nodes *nodes,
                                                        double *volume, ebpo_error *error);

/*
 * Gets the colours of a level's vertices: each vertex has the colour of its node. Faces have no
 * colours. If the file has no colours, `out` has no colours.
 *
 * vertex_count  number of vertices of the mesh returned with the nodes
 * out           freed by ebpo_colours_free; cleared on failure
 *
 * EBPO_E_ARGUMENT: the nodes have another number of vertices.
 *
 * Threads: any.
 */
EBPO_API EBPO_MUST_USE ebpo_status ebpo_lod_colours(const ebpo_lod_nodes *nodes,
                                                    uint64_t vertex_count, ebpo_colours *out,
                                                    ebpo_error *error);

/*
 * Computes normals for shading a level's polygons. A polygon on a plane of the envelope gets the
 * normal of the plane. The direction of a polygon on a cell face does not follow the surface,
 * because the polygon only closes the envelope. So it gets the mean of the normals of nearby
 * polygons on planes, weighted by area. Nearby polygons whose normals are more than 107 degrees
 * away from the normal of the cell face are not included, because they are on the opposite side of
 * the solid. If no nearby polygon is included, the polygon gets the normal of the cell face. Cell
 * faces of the root cell are treated as planes of the envelope. Use the normals for images only:
 * they are rounded and guarantee nothing about the solid.
 *
 * info  metadata of the level's file
 * mesh  mesh returned with the nodes
 * out   [polygon_count][3] unit normals, or 0 for a polygon without area; allocated by the caller
 *
 * EBPO_E_ARGUMENT: the nodes have another number of triangles, or the mesh has single precision.
 *
 * Threads: any.
 */
EBPO_API EBPO_MUST_USE ebpo_status ebpo_lod_normals(const ebpo_info *info, const ebpo_mesh *mesh,
                                                    const ebpo_lod_nodes *nodes, float *out,
                                                    ebpo_error *error);

/* ---- the simplified surface ---- */

/* Patches of the simplified surface, joined to one mesh. */
typedef struct ebpo_surface_mesh {
    ebpo_mesh mesh; /* double precision */

    /*
     * [vertex_count][3] unit normals. A vertex at a crease is repeated, with one normal for each
     * side.
     */
    float *normals;

    /* Colours of vertices. If the patches have no colours, its arrays are NULL. */
    ebpo_colours colours;

    /*
     * Greatest error of the patches (ebpo_patch), in the model's unit. To close cracks, some
     * vertices of a finer patch are replaced by vertices of a coarser patch. The error at the new
     * vertices is at most the error of the coarser patch, so this member is a bound for the new
     * vertices, too.
     */
    double error;

    /*
     * Greatest error of the patches, in pixels of the observer's image; see
     * ebpo_view_stream_surface (view.h). NAN without an observer.
     */
    double pixels;

    /*
     * Number of simplified patches in the mesh, and number of original faces in the mesh. The mesh
     * has original faces only if the option `faces` of ebpo_view_stream_surface is true. They
     * replace the finest patches.
     */
    uint64_t patches, faces;
} ebpo_surface_mesh;

/* Frees the arrays and clears the struct. Threads: one at a time per struct. */
EBPO_API void ebpo_surface_mesh_free(ebpo_surface_mesh *mesh);

/*
 * Lists the patches of a level. Some parts of the model have patches only at coarser levels; for
 * such a part, lists the patch of its deepest level. Together these patches replace all faces of
 * the model.
 *
 * patches  [*count] indices of patches, ascending; freed by free()
 *
 * EBPO_E_MEMORY.
 *
 * Threads: any.
 */
EBPO_API EBPO_MUST_USE ebpo_status ebpo_surface_select(const ebpo_surface *surface, int level,
                                                       uint64_t **patches, uint64_t *count,
                                                       ebpo_error *error);

/*
 * Joins patches of any levels to one mesh without cracks. The nodes of two patches must not be
 * ancestor and descendant. Vertices on the borders of finer patches are replaced by vertices of
 * coarser patches.
 *
 * info     metadata of the file or tree
 * patches  [count] indices of patches, ascending
 * out      freed by ebpo_surface_mesh_free; cleared on failure
 *
 * EBPO_E_ARGUMENT, EBPO_E_FORMAT, EBPO_E_MEMORY, EBPO_E_LIMIT.
 *
 * Threads: any.
 */
EBPO_API EBPO_MUST_USE ebpo_status ebpo_surface_join(const ebpo_surface *surface,
                                                     const ebpo_info *info, const uint64_t *patches,
                                                     uint64_t count, ebpo_surface_mesh *out,
                                                     ebpo_error *error);

#ifdef __cplusplus
}
#endif
#endif
