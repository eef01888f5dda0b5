/* Allocations of the library that fail on demand: the linker hands its calls of malloc and others
 * to failing_allocations.c (option --wrap); those of other libraries are left alone. */
#ifndef EBPO_TESTS_FAILING_ALLOCATIONS_H
#define EBPO_TESTS_FAILING_ALLOCATIONS_H

#include <stdbool.h>
#include <stdint.h>

/* From here on the n-th allocation fails (1 is the next one), and with `onward` all after it. 0:
 * none. Counts anew. */
void failing_allocations_begin(uint64_t n, bool onward);
/* All succeed again. How many there were. */
uint64_t failing_allocations_end(void);
/* Neither failed nor counted meanwhile. */
void failing_allocations_pause(void);
void failing_allocations_resume(void);

#endif
