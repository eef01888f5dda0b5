/* EBP-Octree in HDF5: how far a level's envelopes reach beyond the model. */
#ifndef EBPO_DEVIATION_H
#define EBPO_DEVIATION_H

#include <ebpo/query.h>

#ifdef __cplusplus
extern "C" {
#endif

typedef struct ebpo_deviation_options {
    size_t struct_size; /* EBPO_DEVIATION_OPTIONS_INIT sets it */
    /* the bounds are refined until hi <= (1 + tolerance) lo, or no node that stands in the way has
     * questions left (see below); > 0 */
    double tolerance;
    uint64_t samples; /* points on the level's polygons, for mean and rms; 0: none */
    uint64_t seed;    /* of the samples: equal seeds give equal points */
    /* stop refining after about so many distances, and tell what is certain then; 0: up to 65,536
     * for each node. Two for each node are always asked */
    uint64_t questions;
    unsigned threads; /* 0: all cores; the result does not depend on it */
    ebpo_progress progress;
} ebpo_deviation_options;
#define EBPO_DEVIATION_OPTIONS_INIT                                          \
    {                                                                        \
        sizeof(ebpo_deviation_options), 0.05, 20000, 1, 0, 0, { NULL, NULL } \
    }

typedef struct ebpo_deviation {
    size_t struct_size; /* EBPO_DEVIATION_INIT sets it */
    /* the one-sided Hausdorff distance, from the level's envelopes to the model, is certainly
     * within; model's unit. 0 and hi: perhaps none reaches beyond it */
    double lo, hi;
    /* a point of an envelope, about lo from the model; (0, 0, 0) when lo is 0 */
    double place[3];
    /* of the distance over the level's surface, by area; NAN without samples on it */
    double mean, rms;
    /* points that lay on the level's surface, of those that were drawn on its polygons */
    uint64_t samples;
    uint64_t questions; /* distances that were asked for the bounds */
} ebpo_deviation;
#define EBPO_DEVIATION_INIT EBPO_SIZED(ebpo_deviation)

/* The greatest distance from the model of a point of the level's envelopes (those of
 * ebpo_lod_level), their insides included: a cavity that an envelope covers counts. The model is
 * the closed solid with all faces (some may bound no part of it), so the distance is 0 within; a
 * surface's faces. `hi` holds for the decoded half-spaces and allows for all rounding: it never
 * gets closer to the truth than about 1e-6 of a node's cell, or some ulp of the coordinates, so the
 * tolerance is not met where a level reaches less far. Nor is it always met where a node has taken
 * 65,536 distances: then the bounds are what is certain, and wider. The level's surface, for mean
 * and rms, is what of the envelopes' polygons lies in no other envelope. `model` is the same
 * file's, with its mesh, or that of the file of which `file` is a subset (of any kind). Takes
 * memory for all of the model's tree and mesh beside `model`, and 80 bytes a node of the level. Not
 * in the theses, which give volumes only. EBPO_E_ABSENT: the model has no mesh, or is a subset
 * itself. EBPO_E_ARGUMENT: no such level, a tolerance of 0, or a file that is neither the model's
 * nor a subset of it, as far as their digests, and else their sources and how they were built,
 * tell. */
EBPO_API EBPO_MUST_USE ebpo_status ebpo_deviation_level(ebpo_model *model, const ebpo_file *file,
                                                        int level,
                                                        const ebpo_deviation_options *options,
                                                        ebpo_deviation *out, ebpo_error *error);

#ifdef __cplusplus
}
#endif
#endif
