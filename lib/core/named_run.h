/* What a file has under one name, from where it is said to where the next one is. */
#ifndef EBPO_CORE_NAMED_RUN_H
#define EBPO_CORE_NAMED_RUN_H

#include <stddef.h>
#include <stdint.h>

typedef struct ebpo_named_run {
    const char *name; /* within the file's bytes, without spaces around it */
    size_t size;
    uint64_t faces; /* triangles, which follow those of the run before */
} ebpo_named_run;

#endif
