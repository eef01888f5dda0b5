/* EBP-Octree in HDF5: a level as closed polygons. */
#ifndef EBPO_LOD_H
#define EBPO_LOD_H

#include <ebpo/file.h>

#ifdef __cplusplus
extern "C" {
#endif

typedef struct ebpo_lod_options {
    bool walls;          /* keep polygons that lie on cell walls, so that each envelope is closed */
    unsigned threads;    /* 0: all cores */
    ebpo_progress progress;
} ebpo_lod_options;
#define EBPO_LOD_OPTIONS_INIT { true, 0, { NULL, NULL } }

/* The envelopes of `level`: its gray nodes, and the leaves and black nodes of levels 0 .. level, each a convex polyhedron cut from its cell by the half-spaces
 * of the node and its ancestors; leaves by stored planes, else by planes derived from their faces (EBP 2017, 3.4). Triangles with double
 * vertices; node after node, vertices not shared between nodes. The polygons are rounded; the guarantee is the decoded half-spaces'.
 * `out` is freed by ebpo_mesh_free. `volume`, if not NULL, receives the sum of the polyhedra's volumes. */
EBPO_API EBPO_MUST_USE ebpo_status ebpo_lod_level(ebpo_file *file, int level, const ebpo_lod_options *options,
                                                  ebpo_mesh *out, double *volume, ebpo_error *error);

#ifdef __cplusplus
}
#endif
#endif
