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
 * Returns the number of bytes that this process can still allocate: the least of the available
 * memory of the machine and the unused memory of each of the process's control groups. Memory that
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
