#ifndef EBPO_CORE_MACHINE_MEMORY_H
#define EBPO_CORE_MACHINE_MEMORY_H

#include <stdint.h>

/* Bytes: the machine's, or the least that a control group of this process allows. */
uint64_t ebpo_machine_memory(void);

#endif
