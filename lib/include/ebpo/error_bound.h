/* SPDX-License-Identifier: MIT
 * Computes the error bound of a level: the distance by which its envelopes extend beyond the model.
 * The envelope of a node is a convex polyhedron that contains the part of the solid in the node's
 * cell.
 */
#ifndef EBPO_ERROR_BOUND_H
#define EBPO_ERROR_BOUND_H

#include <ebpo/query.h>

#ifdef __cplusplus
extern "C" {
#endif

/* Options of ebpo_level_error_bound. */
typedef struct ebpo_error_bound_options {
    size_t struct_size;

    /*
     * The bounds lo and hi of the result are refined until hi <= (1 + tolerance) * lo. Refining
     * ends earlier if `queries` distances have been computed. It also ends earlier if all nodes
     * that determine the bounds have reached their limit of 65,536 distances. The tolerance is
     * above 0.
     */
    double tolerance;

    /* Number of sample points on the level's polygons, for `mean` and `rms`. 0: none. */
    uint64_t samples;

    /* Seed for the sample points: equal seeds give equal points. */
    uint64_t seed;

    /*
     * Refining stops, with the bounds known so far, when about this many distances have been
     * computed. At least two distances are computed for each node. 0: the level has no limit, but
     * at most 65,536 distances are computed for each node.
     */
    uint64_t queries;

    unsigned threads;

    ebpo_progress progress;

    /*
     * `hi` of a coarser level of the same file. Envelopes are nested, so this value also bounds
     * this level. 0: unknown. In this case, the function may also compute bounds of coarser levels,
     * each with as many distances as for this level. This happens if the search reaches a limit of
     * distances (see `queries`) before it reaches the tolerance.
     */
    double at_most;
} ebpo_error_bound_options;

#define EBPO_ERROR_BOUND_OPTIONS_INIT                                             \
    {                                                                             \
        sizeof(ebpo_error_bound_options), 0.05, 20000, 1, 0, 0, { NULL, NULL }, 0 \
    }

/* Error bound of a level, and statistics. Lengths are in the model's unit. */
typedef struct ebpo_error_bound {
    size_t struct_size;

    /*
     * Bounds of the one-sided Hausdorff distance from the level's envelopes to the model. If lo is
     * 0, it is not known if any envelope extends beyond the model.
     */
    double lo, hi;

    /* Point of an envelope, about lo away from the model; zeros if lo is 0. */
    double location[3];

    /*
     * Mean and root mean square distance of the level's surface from the model, weighted by area.
     * NAN if no sample is on the surface.
     */
    double mean, rms;

    /* Number of sample points on the level's surface. */
    uint64_t samples;

    /* Number of distances computed for the bounds, including distances for coarser levels. */
    uint64_t queries;
} ebpo_error_bound;

#define EBPO_ERROR_BOUND_INIT EBPO_SIZED(ebpo_error_bound)

/*
 * Computes the maximum distance of a point of a level's envelopes from the model.
 *
 * The envelopes are those of ebpo_lod_level, including their interior. So if an envelope covers a
 * cavity of the solid, the points of the cavity are points of the envelope. The model is the closed
 * solid with all its faces, so the distance is 0 inside the solid. For a surface, the model is its
 * faces.
 *
 * `hi` is a bound for the envelopes of the decoded planes and includes all rounding errors.
 * Therefore `hi` exceeds the true value by at least about the greater of two lengths: 1e-6 of the
 * size of a node's cell, and a few ulp of the coordinates. The tolerance is not reached if the
 * error bound is smaller than this excess, or if a node has reached its limit of 65,536 distances.
 * In these cases the bounds are wider, but still certain.
 *
 * The level's surface, for `mean` and `rms`, is the part of the envelopes' polygons that is in no
 * other envelope.
 *
 * model    model of `file`, which must then have a mesh. If `file` is a subset, `model` may instead
 *          be the model of the file from which the subset was made
 *
 * Memory, in addition to the memory of `model`: the entire tree and mesh, and 80 bytes for each
 * node of the level.
 *
 * EBPO_E_ABSENT: the model has no mesh, or is itself a subset. EBPO_E_ARGUMENT: the level is not
 * valid, the tolerance is 0, at_most is below 0, or `file` is neither the model's file nor a subset
 * of the model's file. `file` and the model's file must have equal root cells. Their digests must
 * agree, or their sources and build options must be equal. Also the errors of reading (base.h).
 *
 * Threads: any.
 */
EBPO_API EBPO_MUST_USE ebpo_status ebpo_level_error_bound(ebpo_model *model, const ebpo_file *file,
                                                          int level,
                                                          const ebpo_error_bound_options *options,
                                                          ebpo_error_bound *out, ebpo_error *error);

#ifdef __cplusplus
}
#endif
#endif
