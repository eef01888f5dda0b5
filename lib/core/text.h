/* Text as files hold it: UTF-8, dates, streams into memory, named runs. */
#ifndef EBPO_CORE_TEXT_H
#define EBPO_CORE_TEXT_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>

bool ebpo_text_is_utf8(const char *text);
/* True for UTF-8 without control characters. */
bool ebpo_text_ok(const char *text);

/* Returns the length of the mark of the order of bytes (UTF-8) that text begins with, or 0. */
uint64_t ebpo_text_mark(const void *text, uint64_t size);

/* A stream into memory that tells when memory was short: those of the C library (open_memstream)
 * may lose what did not fit and say nothing. They serve where there is nothing better. */

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

/* What a file has under one name, from where it is said to where the next one is. */

typedef struct ebpo_named_run {
    const char *name; /* within the file's bytes, without spaces around it */
    size_t size;
    uint64_t faces; /* triangles, which follow those of the run before */
} ebpo_named_run;

#endif
