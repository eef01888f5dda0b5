/* SPDX-License-Identifier: MIT
 * EBP-Octree in HDF5: what no convex envelope can be better than.
 */
#ifndef EBPO_LIMIT_H
#define EBPO_LIMIT_H

#include <ebpo/file.h>

#ifdef __cplusplus
extern "C" {
#endif

typedef struct ebpo_limit_options {
    size_t struct_size; /* EBPO_LIMIT_OPTIONS_INIT sets it */

    /* 0: all cores. The result does not depend on it. */
    unsigned threads;

    ebpo_progress progress;

    /*
     * 1: volumes are counted in root cells, 0 to 1, which is free of the model's
     * scale. 0: in its unit cubed.
     */
    uint64_t in_root_cells;
} ebpo_limit_options;

#define EBPO_LIMIT_OPTIONS_INIT                          \
    {                                                    \
        sizeof(ebpo_limit_options), 0, { NULL, NULL }, 0 \
    }

/* Volumes are in the model's unit cubed, unless root cells were asked for. */
typedef struct ebpo_limit {
    size_t struct_size; /* EBPO_LIMIT_INIT sets it */

    /*
     * Of the level: hulls of gray nodes and leaves, cells of black nodes, of the
     * same nodes as in ebpo_lod_level.
     */
    double volume;

    /* The part of the level's gray nodes. */
    double gray_volume;

    /* How many hulls were computed. */
    uint64_t hulls;

    /* How many of them have no volume: their points lie in a plane, or nearly. */
    uint64_t flat;
} ebpo_limit;

#define EBPO_LIMIT_INIT EBPO_SIZED(ebpo_limit)

/*
 * The volume of the convex hull of the solid in each cell (of a surface: of its
 * faces there), summed over a level. qhull computes it from the parts of faces in
 * the cell and from the cell's corners that are inside.
 *
 * The sum is rounded and not certified: a figure to compare with. In the model's
 * unit cubed it is infinite or 0 where the volume of a cell is no normal double,
 * which takes coordinates beyond about 1e102 or below 1e-102.
 *
 * All of the tree and the mesh is held in memory, decoded, and a number for each node
 * of the level; a hull costs as its faces do. Nothing else bounds memory and time, but
 * that `progress` may stop it.
 *
 * EBPO_E_ABSENT: the file has no mesh, or the library was built without qhull.
 * EBPO_E_ARGUMENT: no such level. EBPO_E_CANCELLED, EBPO_E_MEMORY, and the errors
 * of reading.
 *
 * Threads: any.
 */
EBPO_API EBPO_MUST_USE ebpo_status ebpo_limit_level(const ebpo_file *file, int level,
                                                    const ebpo_limit_options *options,
                                                    ebpo_limit *out, ebpo_error *error);

#ifdef __cplusplus
}
#endif
#endif
