/* Where the bytes of a file come from: regular files and memory as ebpo_source, and an input, which
 * is a source with a name and a count of its use. */
#ifndef EBPO_IO_BYTE_SOURCE_H
#define EBPO_IO_BYTE_SOURCE_H

#include <stdatomic.h>

#include <ebpo/file.h>
#include <ebpo/http.h>

/* Opens a regular file, by pread: one that is shortened while it is open gives EBPO_E_IO, where a
 * mapping would raise SIGBUS. EBPO_E_IO when it is missing, may not be read, or is a folder, pipe
 * or device. The caller (or whoever takes the source over) calls out->close. */
EBPO_MUST_USE ebpo_status ebpo_source_of_path(ebpo_source *out, const char *path,
                                              ebpo_error *error);

/* `size` bytes that stay the caller's and outlive the source. There is nothing to close. */
ebpo_source ebpo_source_of_memory(const void *data, uint64_t size);

/* A source being read. Any number of threads may read at once. */
typedef struct ebpo_input {
    ebpo_source source;
    char *shown; /* the name for messages */
    _Atomic uint64_t bytes, reads;
} ebpo_input;

/* Takes the source over; on failure (EBPO_E_MEMORY) it is closed. `name` is copied. */
EBPO_MUST_USE ebpo_status ebpo_input_open(ebpo_input *input, const ebpo_source *source,
                                          const char *name, ebpo_error *error);
/* Closes the source, once. Harmless on a zeroed input. */
void ebpo_input_close(ebpo_input *input);

/* Bytes [offset, offset + size) into `data`. Beyond the source's end: EBPO_E_FORMAT, because only
 * the file itself can have named such an offset. The status of the source's own `read` is passed
 * on, with a message if it gave none. */
EBPO_MUST_USE ebpo_status ebpo_input_read(ebpo_input *input, uint64_t offset, uint64_t size,
                                          void *data, ebpo_error *error);

/* Returns the descriptor of the file that it reads, which stays the input's; -1: it reads none, or
 * a copy in place of the file that it is named after (open_file.c). */
int ebpo_input_descriptor(const ebpo_input *input);

/* True when announcing is of use. */
static inline bool ebpo_input_expects(const ebpo_input *input)
{
    return input->source.prefetch != NULL;
}
/* True when opening should not read everything. */
static inline bool ebpo_input_is_far(const ebpo_input *input)
{
    return input->source.prefetch && input->source.prefetched &&
           input->source.prefetched < input->source.size;
}
/* Announces what will be read. Ranges beyond the source's end are let pass: reading them will fail.
 */
void ebpo_input_expect(ebpo_input *input, const ebpo_range *ranges, size_t count);

/* True when the system can be told what of the source will be read, which helps where it lies on a
 * disk: a file opened by its name. */
bool ebpo_input_hints(const ebpo_input *input);
/* Tells it; it begins to read, and nobody waits. Ranges that are large, which it reads ahead by
 * itself, are let pass. */
void ebpo_input_hint(ebpo_input *input, const ebpo_range *ranges, size_t count);

/* What the layers above need of sources by URL: ebpo/http.h, and the figures of such a source. */

enum { EBPO_SHOWN_BYTES = 300 }; /* room for a URL in a message */

/* False when the source is not one of ebpo_source_of_url. */
bool ebpo_source_http_stats(const ebpo_source *source, ebpo_http_stats *out);

#endif
