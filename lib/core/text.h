/* Checks texts (UTF-8), provides streams into memory, and declares named runs of triangles. */
#ifndef EBPO_CORE_TEXT_H
#define EBPO_CORE_TEXT_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>

/* Returns true for valid UTF-8. */
bool ebpo_text_is_utf8(const char *text);
/* Returns true for UTF-8 without control characters. */
bool ebpo_text_ok(const char *text);

/* Returns the length of the UTF-8 byte order mark at the beginning of text, or 0. */
uint64_t ebpo_text_bom_length(const void *text, uint64_t size);

/* A stream into memory that reports failed allocations. open_memstream of the C library may lose
 * data silently, so the stream uses open_memstream only if the C library has no fopencookie. */
typedef struct ebpo_text_stream {
    char *text; /* the written text, with a final zero byte after the end; the caller frees it */
    uint64_t bytes, capacity; /* length of the text, and allocated bytes */
    FILE *file;               /* stream to print to */
    bool failed;
    size_t size;       /* length of the text, if open_memstream is used */
    char buffer[1024]; /* buffer of `file`, so that stdio does not allocate a buffer */
} ebpo_text_stream;

/* Begins a stream; `s` must not move until the stream has ended. Returns false when out of memory;
 * then ebpo_text_stream_end must not be called. */
bool ebpo_text_stream_begin(ebpo_text_stream *s);
/* Ends a stream. Returns false if data is missing because an allocation failed; then s->text is
 * NULL. */
bool ebpo_text_stream_end(ebpo_text_stream *s);

/* A named run of triangles in a mesh file: the triangles between two lines that set a name. */
typedef struct ebpo_named_run {
    const char *name; /* points into the file's bytes, without surrounding spaces */
    size_t size;
    uint64_t
        faces; /* number of triangles in this run; they follow the triangles of the previous run */
} ebpo_named_run;

#endif
