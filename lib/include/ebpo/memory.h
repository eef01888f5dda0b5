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
 * Returns the number of bytes that this process can still allocate: the minimum of the available
 * memory of the machine and of the unused memory in each control group of the process. Memory that
 * caches files counts as available. Returns half of the machine's memory if the system does not
 * report the available memory.
 *
 * Threads: any.
 */
EBPO_API uint64_t ebpo_free_memory(void);

#ifdef __cplusplus
}
#endif
#endif
