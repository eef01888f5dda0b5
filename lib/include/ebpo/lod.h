/* EBP-Octree in HDF5: a level as closed polygons. */
#ifndef EBPO_LOD_H
#define EBPO_LOD_H

#include <ebpo/file.h>

#ifdef __cplusplus
extern "C" {
#endif

typedef struct ebpo_lod_options {
    size_t struct_size; /* EBPO_LOD_OPTIONS_INIT sets it */
    bool walls;         /* keep polygons that lie on cell walls, so that each envelope is closed */
    unsigned threads;   /* 0: all cores */
    ebpo_progress progress;
    ebpo_workspace *workspace; /* what is read of the file keeps to it; NULL: to none */
} ebpo_lod_options;
#define EBPO_LOD_OPTIONS_INIT                                   \
    {                                                           \
        sizeof(ebpo_lod_options), true, 0, { NULL, NULL }, NULL \
    }

/* The envelopes of `level`: its gray nodes, and the leaves and black nodes of levels 0 .. level,
 * each a convex polyhedron cut from its cell by the half-spaces of the node and its ancestors;
 * leaves by stored planes, else by planes derived from their faces (EBP 2017, 3.4). Triangles with
 * double vertices; node after node, vertices not shared between nodes. The polygons are rounded;
 * the guarantee is the decoded half-spaces'. `out` is freed by ebpo_mesh_free. `volume`, if not
 * NULL, receives the sum of the polyhedra's volumes. */
EBPO_API EBPO_MUST_USE ebpo_status ebpo_lod_level(const ebpo_file *file, int level,
                                                  const ebpo_lod_options *options, ebpo_mesh *out,
                                                  double *volume, ebpo_error *error);

/* One node of a level's envelopes. */
typedef struct ebpo_lod_node {
    uint64_t octcode;
    double volume; /* of the envelope, in the model's unit cubed */
    /* black: in the cell; leaf: at the lowest corner; gray, and surfaces: 0 */
    int32_t winding;
    ebpo_node_type type;                  /* gray (of the level asked for only), leaf or black */
    uint32_t vertex_count, polygon_count; /* of the polyhedron, less what `walls` left out */
} ebpo_lod_node;

/* Whose the triangles of ebpo_lod_level are. Nodes come level after level and in octcode order; the
 * mesh holds their vertices and triangles in the same order. A polygon of n corners is a fan of n -
 * 2 triangles around its first corner: corners 0 and 1 of its first triangle, then corner 2 of
 * each. */
typedef struct ebpo_lod_nodes {
    uint64_t node_count, polygon_count;
    ebpo_lod_node *nodes; /* [node_count] */
    uint8_t *corners;     /* [polygon_count] corners of each polygon, node after node */
} ebpo_lod_nodes;

EBPO_API void ebpo_lod_nodes_free(ebpo_lod_nodes *nodes);

/* The same with the nodes, freed by ebpo_lod_nodes_free; with `nodes` NULL it is ebpo_lod_level. */
EBPO_API EBPO_MUST_USE ebpo_status ebpo_lod_level_nodes(const ebpo_file *file, int level,
                                                        const ebpo_lod_options *options,
                                                        ebpo_mesh *out, ebpo_lod_nodes *nodes,
                                                        double *volume, ebpo_error *error);

#ifdef __cplusplus
}
#endif
#endif
