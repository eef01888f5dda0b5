/* SPDX-License-Identifier: MIT
 * Computes the least possible volume of convex envelopes, for comparison.
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
     * 1: volumes as fractions of the root cell, 0 to 1, independent of the model's scale. 0:
     * volumes in cubic units of the model.
     */
    uint64_t in_root_cells;
} ebpo_limit_options;

#define EBPO_LIMIT_OPTIONS_INIT                          \
    {                                                    \
        sizeof(ebpo_limit_options), 0, { NULL, NULL }, 0 \
    }

/*
 * Result of ebpo_limit_level. Volumes are in cubic units of the model, or as fractions of the root
 * cell (ebpo_limit_options).
 */
typedef struct ebpo_limit {
    size_t struct_size;

    /*
     * Volume of the level: sum over the nodes of ebpo_lod_level; hulls of gray nodes and leaves,
     * cells of black nodes.
     */
    double volume;

    /* Volume of the hulls of the level's gray nodes alone. */
    double gray_volume;

    /* Number of computed hulls. */
    uint64_t hulls;

    /* Number of hulls without volume: their points are in a plane or nearly in a plane. */
    uint64_t flat;
} ebpo_limit;

#define EBPO_LIMIT_INIT EBPO_SIZED(ebpo_limit)

/*
 * Computes the volume of the convex hull of the solid in each cell (for a surface: of its faces
 * there), summed over a level. qhull computes the hull from the parts of faces in the cell, and
 * from the corners of the cell that are inside the solid.
 *
 * The sum is rounded and not certified: use it for comparison. In cubic units of the model, the sum
 * is infinite or 0 if a double cannot hold the volume of a cell, with coordinates beyond about
 * 1e102 or below 1e-102.
 *
 * The decoded tree and mesh are in memory, and a number for each node of the level. The cost of a
 * hull depends on the faces in the cell. Memory and time are not limited; `progress` can stop the
 * call.
 *
 * EBPO_E_ABSENT: the file has no mesh, or the library was built without qhull. The errors of
 * reading.
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
