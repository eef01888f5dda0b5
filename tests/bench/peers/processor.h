/* Selects the processor whose kernels a model uses. */
#ifndef EBPO_BENCH_PROCESSOR_H
#define EBPO_BENCH_PROCESSOR_H

#include <ebpo/query.h>

#ifdef __cplusplus
extern "C" {
#endif

/* Selects the base kernels (SSE2), or the best ones for this processor. Call between queries. */
void processor_is_base(ebpo_model *model, bool base);

#ifdef __cplusplus
}
#endif
#endif
