/* SPDX-License-Identifier: MIT
 * Reports the available memory.
 */
#ifndef EBPO_MEMORY_H
#define EBPO_MEMORY_H

#include <ebpo/base.h>

#ifdef __cplusplus
extern "C" {
#endif

/*
 * Returns the number of bytes that this process can still allocate: the memory that the machine has
 * available, or the smallest remainder of the limits of its control groups. Memory that caches
 * files counts as free. Returns half of the machine's memory if the system does not report it.
 *
 * Threads: any.
 */
EBPO_API uint64_t ebpo_free_memory(void);

#ifdef __cplusplus
}
#endif
#endif
