/* Cores that this process may use. */
#ifndef EBPO_CORE_CORES_H
#define EBPO_CORE_CORES_H

#include <sched.h>
#include <unistd.h>

/* At least 1. */
static inline int ebpo_cores(void)
{
#ifdef EBPO_HAVE_SCHED_GETAFFINITY
    cpu_set_t set;
    int cores = sched_getaffinity(0, sizeof set, &set) == 0 ? CPU_COUNT(&set) : 1;
#else
    int cores = (int)sysconf(_SC_NPROCESSORS_ONLN);
#endif
    return cores < 1 ? 1 : cores;
}

#endif
