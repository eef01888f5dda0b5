#ifndef EBPO_DERIVE_SAMPLES_H
#define EBPO_DERIVE_SAMPLES_H

#include <ebpo/deviation.h>

/* Sets out->mean, rms and samples. */
EBPO_MUST_USE ebpo_status ebpo_deviation_sample(ebpo_model *model, const ebpo_file *file, int level,
                                                const ebpo_deviation_options *options,
                                                ebpo_deviation *out, ebpo_error *error);

#endif
