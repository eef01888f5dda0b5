/* A stream into memory that tells when memory was short: those of the C library (open_memstream)
 * may lose what did not fit and say nothing. They serve where there is nothing better. */
#ifndef EBPO_CORE_TEXT_STREAM_H
#define EBPO_CORE_TEXT_STREAM_H

#include <stdbool.h>
#include <stdint.h>
#include <stdio.h>

typedef struct ebpo_text_stream {
    char *text; /* NUL-terminated when it has ended; the caller's, for free() */
    uint64_t bytes, capacity;
    FILE *file; /* to print to */
    bool failed;
    size_t size;       /* of open_memstream */
    char buffer[1024]; /* the stream's, so that it needs none of its own */
} ebpo_text_stream;

/* `s` may not move until it has ended. False: no memory, and nothing is left to end. */
bool ebpo_text_stream_begin(ebpo_text_stream *s);
/* False: something is missing; there is no text then. */
bool ebpo_text_stream_end(ebpo_text_stream *s);

#endif
