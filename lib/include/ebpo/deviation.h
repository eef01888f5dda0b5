/* EBP-Octree in HDF5: how far a level's envelopes reach beyond the model. */
#ifndef EBPO_DEVIATION_H
#define EBPO_DEVIATION_H

#include <ebpo/query.h>

#ifdef __cplusplus
extern "C" {
#endif

typedef struct ebpo_deviation_options {
    double tolerance;    /* the bounds are refined until hi <= (1 + tolerance) lo; > 0 */
    uint64_t samples;    /* points on the level's surface, for mean and rms; 0: none */
    uint64_t seed;       /* of the samples */
    uint64_t questions;  /* stop refining after so many distance questions, and tell what is certain then; 0: no limit */
    unsigned threads;    /* 0: all cores; the result does not depend on it */
    ebpo_progress progress;
} ebpo_deviation_options;
#define EBPO_DEVIATION_OPTIONS_INIT { 0.05, 20000, 1, 0, 0, { NULL, NULL } }

typedef struct ebpo_deviation {
    double lo, hi;       /* the one-sided Hausdorff distance, from the level's envelopes to the model, is certainly within; model's unit */
    double place[3];     /* a point of an envelope with distance lo */
    double mean, rms;    /* of the distance over the level's surface, by area; NAN without samples */
    uint64_t samples;    /* points that lay on the level's surface, of those that were drawn on its polygons */
    uint64_t questions;  /* distances that were asked for the bounds */
} ebpo_deviation;

/* The greatest distance of a point of the level's envelopes (those of ebpo_lod_level) from the model: from the solid, so 0 in its inside; of a surface, from its faces. The level's
 * surface is what of the envelopes' polygons lies in no other envelope. `model` is the same file's, opened with its mesh.
 * Not in the theses, which give volumes only. EBPO_E_ABSENT without mesh; EBPO_E_ARGUMENT: no such level. */
EBPO_API EBPO_MUST_USE ebpo_status ebpo_deviation_level(ebpo_model *model, ebpo_file *file, int level, const ebpo_deviation_options *options,
                                                        ebpo_deviation *out, ebpo_error *error);

#ifdef __cplusplus
}
#endif
#endif
