/* Hashes of all results of the library for an ill-conditioned case. */
#ifndef EBPO_TESTS_FP_HASH_H
#define EBPO_TESTS_FP_HASH_H

#include "degenerate.h"

/* Floating-point environment in which the library is called; the test's own arithmetic uses the
 * default one. */
typedef struct fp_setting {
    int rounding;          /* a rounding mode of <fenv.h> */
    unsigned control_bits; /* x86: additional bits of the SSE control register */
} fp_setting;

typedef struct fp_hashes {
    ebpo_status status; /* status of converting */
    uint64_t content;   /* the report, metadata and arrays of the file */
    uint64_t results;   /* levels, measures, verification, queries of all kinds */
    bool kept;          /* every call preserved the environment */
} fp_hashes;

void fp_hash_case(const degenerate_case *c, const fp_setting *setting, uint64_t queries,
                  fp_hashes *out);

/* Returns true if the case is small enough for tests of all builds. */
bool fp_hash_takes(const degenerate_case *c);

#endif
