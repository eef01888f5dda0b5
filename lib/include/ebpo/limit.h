/* SPDX-License-Identifier: MIT
 * Computes the least possible volume of convex envelopes, for comparison with the envelopes in a
 * file. The envelope of a node is a convex polyhedron that contains the part of the solid in the
 * node's cell.
 */
#ifndef EBPO_LIMIT_H
#define EBPO_LIMIT_H

#include <ebpo/file.h>

#ifdef __cplusplus
extern "C" {
#endif

/* Options of ebpo_limit_level. */
typedef struct ebpo_limit_options {
    size_t struct_size;

    unsigned threads;

    ebpo_progress progress;

    /*
     * 1: volumes of the result are fractions of the root cell's volume, 0 to 1, independent of the
     * model's scale. 0: they are in cubic units of the model.
     */
    uint64_t in_root_cells;
} ebpo_limit_options;

#define EBPO_LIMIT_OPTIONS_INIT                          \
    {                                                    \
        sizeof(ebpo_limit_options), 0, { NULL, NULL }, 0 \
    }

/*
 * Result of ebpo_limit_level. Volumes are in cubic units of the model, or fractions of the root
 * cell's volume (in_root_cells of ebpo_limit_options).
 */
typedef struct ebpo_limit {
    size_t struct_size;

    /*
     * Sum of the volumes of the hulls of gray nodes and leaves, and of the cells of black nodes. No
     * convex envelopes of the level have a smaller volume. The nodes are those of ebpo_lod_level.
     */
    double volume;

    /* Sum of the volumes of the hulls of the level's gray nodes. */
    double gray_volume;

    /* Number of computed hulls. */
    uint64_t hulls;

    /* Number of hulls without volume, whose points are in a plane or nearly in a plane. */
    uint64_t flat;
} ebpo_limit;

#define EBPO_LIMIT_INIT EBPO_SIZED(ebpo_limit)

/*
 * Sums the volumes of the convex hulls of the model in the cells of a level. qhull computes a hull
 * from the parts of faces in the cell, and from the corners of the cell that are inside: in a solid
 * and in a surface with info.border_inside. The inside of the latter may extend beyond the hulls
 * next to holes.
 *
 * The sum is rounded and not certified, so use it only for comparison. In cubic units of the model,
 * the sum is infinite or 0 if the volume of a cell is out of the range of doubles. This happens
 * with coordinates beyond about 1e102 or below 1e-102.
 *
 * The decoded tree, the mesh, and one number for each node of the level are in memory. The cost of
 * a hull depends on the faces in the cell. Memory and time are not limited; `progress` can stop the
 * call.
 *
 * EBPO_E_ABSENT: the file has no mesh, or info.border_inside without the border; or the library was
 * built without qhull. Also the errors of reading (base.h).
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
