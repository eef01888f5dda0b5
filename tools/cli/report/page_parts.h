/* Declares the files of the page (page/ and Chart.js) that the build embeds in the program. */
#ifndef EBPO_TOOLS_PAGE_PARTS_H
#define EBPO_TOOLS_PAGE_PARTS_H

#include <stddef.h>

typedef struct page_part {
    const char *name, *text;
    size_t size;
} page_part;

extern const page_part page_parts[]; /* the name of the last element is NULL */

#endif
