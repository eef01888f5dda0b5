/* Large arrays that are read here and there. */
#ifndef EBPO_CORE_HUGE_PAGES_H
#define EBPO_CORE_HUGE_PAGES_H

#include <stddef.h>

/* Asks the system to hold an array in pages of 2 MiB, as far as whole ones fit within it (no more
 * memory is taken): translating addresses is a fifth of what a search in a large model costs. To be
 * called before the array is filled; only advice, any pointer and size will do. */
void ebpo_prefer_huge_pages(void *array, size_t bytes);

#endif
