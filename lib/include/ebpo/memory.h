/* SPDX-License-Identifier: MIT
 * EBP-Octree in HDF5: how much memory there is.
 */
#ifndef EBPO_MEMORY_H
#define EBPO_MEMORY_H

#include <ebpo/base.h>

#ifdef __cplusplus
extern "C" {
#endif

/*
 * Bytes that this process may still take: what the machine has available, or the least that a
 * control group of it has left. What files occupy counts as free. Half of the machine's, where the
 * system does not tell.
 *
 * Threads: any.
 */
EBPO_API uint64_t ebpo_free_memory(void);

#ifdef __cplusplus
}
#endif
#endif
