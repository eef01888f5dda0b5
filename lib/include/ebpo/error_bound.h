/* SPDX-License-Identifier: MIT
 * Computes the error bound of a level: the distance of its envelopes from the model.
 */
#ifndef EBPO_ERROR_BOUND_H
#define EBPO_ERROR_BOUND_H

#include <ebpo/query.h>

#ifdef __cplusplus
extern "C" {
#endif

typedef struct ebpo_error_bound_options {
    size_t struct_size;

    /*
     * Bounds are refined until hi <= (1 + tolerance) lo, or until no relevant node may compute more
     * distances (see below). Above 0.
     */
    double tolerance;

    /* Points on the level's polygons, for mean and rms. 0: none. */
    uint64_t samples;

    /* For the samples: equal seeds give equal points. */
    uint64_t seed;

    /*
     * Refining stops after about this many distances, with the bounds known so far. Two for each
     * node are always computed. 0: up to 65,536 for each node.
     */
    uint64_t queries;

    unsigned threads;

    ebpo_progress progress;

    /*
     * `hi` of a coarser level of the same file, if known. Envelopes are nested, so it also bounds
     * this level. 0: unknown; a level that reaches its limit of distances before the tolerance then
     * also computes the coarser levels, each with as many distances.
     */
    double at_most;
} ebpo_error_bound_options;

#define EBPO_ERROR_BOUND_OPTIONS_INIT                                             \
    {                                                                             \
        sizeof(ebpo_error_bound_options), 0.05, 20000, 1, 0, 0, { NULL, NULL }, 0 \
    }

/* Lengths are in the model's unit. */
typedef struct ebpo_error_bound {
    size_t struct_size;

    /*
     * Bounds of the one-sided Hausdorff distance from the level's envelopes to the model. lo is 0:
     * perhaps no envelope extends beyond the model.
     */
    double lo, hi;

    /* Point of an envelope, about lo away from the model; zeros if lo is 0. */
    double place[3];

    /* Mean distance of the level's surface, weighted by area. NAN if no sample is on it. */
    double mean, rms;

    /* Number of samples on the level's surface. */
    uint64_t samples;

    /* Number of distances for the bounds, including coarser levels. */
    uint64_t queries;
} ebpo_error_bound;

#define EBPO_ERROR_BOUND_INIT EBPO_SIZED(ebpo_error_bound)

/*
 * Computes the maximum distance of a point of a level's envelopes from the model.
 *
 * The envelopes are those of ebpo_lod_level including their interior, so a cavity covered by an
 * envelope counts. The model is the closed solid with all its faces, so the distance is 0 inside;
 * for a surface, its faces.
 *
 * `hi` holds for the decoded half-spaces and includes all rounding. Its excess is therefore at
 * least about 1e-6 of a node's cell, or some ulp of the coordinates. The tolerance is not reached
 * for smaller error bounds, or if a node has computed 65,536 distances: the bounds are then wider,
 * and still certain.
 *
 * The level's surface, for mean and rms, is the part of the envelopes' polygons that is in no other
 * envelope.
 *
 * model    of the same file, with its mesh, or of the file of which `file` is a subset of any kind
 * memory   the model's entire tree and mesh besides `model`, and 80 bytes for each node of the
 *          level
 *
 * EBPO_E_ABSENT: the model has no mesh, or is itself a subset. EBPO_E_ARGUMENT: invalid level; a
 * tolerance of 0; an at_most below 0; or `file` is not the model's file or a subset of it, by
 * digests, or else by sources and build options. The errors of reading.
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
