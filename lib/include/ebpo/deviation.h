/* SPDX-License-Identifier: MIT
 * EBP-Octree in HDF5: how far a level's envelopes reach beyond the model.
 */
#ifndef EBPO_DEVIATION_H
#define EBPO_DEVIATION_H

#include <ebpo/query.h>

#ifdef __cplusplus
extern "C" {
#endif

typedef struct ebpo_deviation_options {
    size_t struct_size; /* EBPO_DEVIATION_OPTIONS_INIT sets it */

    /*
     * The bounds are refined until hi <= (1 + tolerance) lo, or until no node
     * that stands in the way may take more distances (see below). Above 0.
     */
    double tolerance;

    /* Points on the level's polygons, for mean and rms. 0: none. */
    uint64_t samples;

    /* Of the samples: equal seeds give equal points. */
    uint64_t seed;

    /*
     * Stop refining after about so many distances, and say what is certain then.
     * Two for each node are always taken. 0: up to 65,536 for each node.
     */
    uint64_t questions;

    /* 0: all cores. The result does not depend on it. */
    unsigned threads;

    ebpo_progress progress;

    /*
     * The `hi` of a coarser level of the same file, if it is known: envelopes
     * nest, so this level's is not greater. 0: not known. A level that has spent
     * its distances before it met the tolerance then asks the coarser ones, each
     * with as many distances.
     */
    double at_most;
} ebpo_deviation_options;

#define EBPO_DEVIATION_OPTIONS_INIT                                             \
    {                                                                           \
        sizeof(ebpo_deviation_options), 0.05, 20000, 1, 0, 0, { NULL, NULL }, 0 \
    }

/* Lengths are in the model's unit. */
typedef struct ebpo_deviation {
    size_t struct_size; /* EBPO_DEVIATION_INIT sets it */

    /*
     * The one-sided Hausdorff distance, from the level's envelopes to the model,
     * is certainly within these bounds. lo is 0: perhaps no envelope reaches
     * beyond the model.
     */
    double lo, hi;

    /* A point of an envelope, about lo away from the model; zeros if lo is 0. */
    double place[3];

    /*
     * Of the distance over the level's surface, by area. NAN if no sample lies
     * on it.
     */
    double mean, rms;

    /* How many samples lie on the level's surface, of those that were drawn. */
    uint64_t samples;

    /* How many distances were taken for the bounds, those of coarser levels too. */
    uint64_t questions;
} ebpo_deviation;

#define EBPO_DEVIATION_INIT EBPO_SIZED(ebpo_deviation)

/*
 * How far from the model the farthest point of a level's envelopes is. This is
 * not in the theses, which give volumes only.
 *
 * The envelopes are those of ebpo_lod_level, and all of their inside counts, so
 * that a cavity which an envelope covers does too. The model is the closed solid
 * with all its faces, so the distance is 0 inside; of a surface, its faces.
 *
 * `hi` holds for the decoded half-spaces and allows for all rounding. Therefore
 * it is never closer to the truth than about 1e-6 of a node's cell, or some ulp
 * of the coordinates, and the tolerance is not met where a level reaches less
 * far. Nor is it met where a node has taken 65,536 distances: the bounds are
 * wider then, and still certain.
 *
 * The level's surface, for mean and rms, is what of the envelopes' polygons lies
 * in no other envelope.
 *
 * model    of the same file, with its mesh, or of the file of which `file` is a
 *          subset of any kind
 * memory   all of the model's tree and mesh beside `model`, and 80 bytes for
 *          each node of the level
 *
 * EBPO_E_ABSENT: the model has no mesh, or is a subset itself. EBPO_E_ARGUMENT:
 * no such level; a tolerance of 0; an at_most below 0; or a file that is neither the model's nor a
 * subset of it, as far as their digests tell, or else their sources and how they
 * were built. EBPO_E_CANCELLED, EBPO_E_MEMORY, and the errors of reading.
 *
 * Threads: any.
 */
EBPO_API EBPO_MUST_USE ebpo_status ebpo_deviation_level(ebpo_model *model, const ebpo_file *file,
                                                        int level,
                                                        const ebpo_deviation_options *options,
                                                        ebpo_deviation *out, ebpo_error *error);

#ifdef __cplusplus
}
#endif
#endif
