/* Cores that this process may use. */
#ifndef EBPO_TOOLS_USABLE_CORES_H
#define EBPO_TOOLS_USABLE_CORES_H

#include <sched.h>
#include <unistd.h>

/* At least 1. */
static inline unsigned usable_cores(void)
{
#ifdef EBPO_HAVE_SCHED_GETAFFINITY
    cpu_set_t set;
    long cores = sched_getaffinity(0, sizeof set, &set) == 0 ? CPU_COUNT(&set) : 1;
#else
    long cores = sysconf(_SC_NPROCESSORS_ONLN);
#endif
    return cores < 1 ? 1 : (unsigned)cores;
}

#endif
