/* SPDX-License-Identifier: MIT
 * What fuzz targets share. */
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

/* Of its very size, so that an access behind its end is seen. The caller frees it. */
static inline void *fuzz_room(size_t bytes)
{
    void *p = malloc(bytes ? bytes : 1);
    if (!p)
        exit(2);
    return p;
}

static inline void *fuzz_copy(const void *data, size_t bytes)
{
    void *p = fuzz_room(bytes);
    if (bytes)
        memcpy(p, data, bytes);
    return p;
}

/* The same with a zero byte behind it. */
static inline char *fuzz_text(const void *data, size_t bytes)
{
    char *p = fuzz_room(bytes + 1);
    if (bytes)
        memcpy(p, data, bytes);
    p[bytes] = 0;
    return p;
}

#endif
