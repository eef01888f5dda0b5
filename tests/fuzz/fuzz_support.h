/* SPDX-License-Identifier: MIT
 * Shared code of fuzz targets. */
#ifndef FUZZ_KIT_H
#define FUZZ_KIT_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size);

static inline void fuzz_must(bool holds)
{
    if (!holds)
        abort();
}

/* Allocates exactly this size, so that an access after its end is detected. The caller frees it. */
static inline void *fuzz_capacity(size_t bytes)
{
    void *p = malloc(bytes ? bytes : 1);
    if (!p)
        exit(2);
    return p;
}

static inline void *fuzz_copy(const void *data, size_t bytes)
{
    void *p = fuzz_capacity(bytes);
    if (bytes)
        memcpy(p, data, bytes);
    return p;
}

/* The same with a zero byte at the end. */
static inline char *fuzz_text(const void *data, size_t bytes)
{
    char *p = fuzz_capacity(bytes + 1);
    if (bytes)
        memcpy(p, data, bytes);
    p[bytes] = 0;
    return p;
}

#endif
