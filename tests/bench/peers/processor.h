/* Which processor a model takes its kernels from. */
#ifndef EBPO_BENCH_PROCESSOR_H
#define EBPO_BENCH_PROCESSOR_H

#include <ebpo/query.h>

#ifdef __cplusplus
extern "C" {
#endif

/* The base kernels (SSE2), or the best ones that this processor runs. Between questions. */
void processor_is_base(ebpo_model *model, bool base);

#ifdef __cplusplus
}
#endif
#endif
