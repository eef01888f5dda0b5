/* Everything that the library computes of a stiff case, as bits. */
#ifndef EBPO_TESTS_FP_HASH_H
#define EBPO_TESTS_FP_HASH_H

#include "stiff.h"

/* The floating-point environment in which the library is called; the test's own arithmetic runs in
 * the default one. */
typedef struct fp_setting {
    int rounding;          /* of <fenv.h> */
    unsigned control_bits; /* x86: set in the SSE control register besides */
} fp_setting;

typedef struct fp_hashes {
    ebpo_status status; /* of converting */
    uint64_t content;   /* the report, the file's facts and arrays */
    uint64_t answers;   /* levels, measures, verification, questions of all kinds */
    bool kept;          /* each call returned with the environment as it was */
} fp_hashes;

void fp_hash_case(const stiff_case *c, const fp_setting *setting, uint64_t questions,
                  fp_hashes *out);

/* Small enough to be hashed by all builds. */
bool fp_hash_takes(const stiff_case *c);

#endif
