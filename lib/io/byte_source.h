/* Sources of a file's bytes (ebpo_source): regular files and memory. An input is a source with a
 * name for messages and a count of reads. */
#ifndef EBPO_IO_BYTE_SOURCE_H
#define EBPO_IO_BYTE_SOURCE_H

#include <stdatomic.h>

#include <ebpo/file.h>
#include <ebpo/http.h>

/* Opens a regular file, which is read by pread. If the file is shortened while open, reads return
 * EBPO_E_IO (a mapped file would raise SIGBUS). EBPO_E_IO when the file is missing, may not be
 * read, or is a folder, pipe or device. The owner of the source calls out->close. */
EBPO_MUST_USE ebpo_status ebpo_source_of_path(ebpo_source *out, const char *path,
                                              ebpo_error *error);

/* Returns a source of `size` bytes in memory. The bytes stay the caller's and must outlive the
 * source. The source need not be closed. */
ebpo_source ebpo_source_of_memory(const void *data, uint64_t size);

/* A source being read. Thread-safe for reading. */
typedef struct ebpo_input {
    ebpo_source source;
    char *shown; /* the name for messages */
    /* bytes requested from the source, including those that it had before the input was opened */
    _Atomic uint64_t bytes;
    _Atomic uint64_t reads; /* number of requests */
} ebpo_input;

/* Takes ownership of the source, and closes the source on failure (EBPO_E_MEMORY). `name` is
 * copied. */
EBPO_MUST_USE ebpo_status ebpo_input_open(ebpo_input *input, const ebpo_source *source,
                                          const char *name, ebpo_error *error);
/* Closes the source. Harmless on a zeroed input, and on an input that is closed already. */
void ebpo_input_close(ebpo_input *input);

/* Reads bytes [offset, offset + size) into `data`. Beyond the source's end: EBPO_E_FORMAT, because
 * such an offset can only come from the file itself. Returns the status of the source's `read`
 * function; if that function has set no message, a message is added. */
EBPO_MUST_USE ebpo_status ebpo_input_read(ebpo_input *input, uint64_t offset, uint64_t size,
                                          void *data, ebpo_error *error);

/* Returns the descriptor of the file, which the input still owns. Returns -1 if the input does not
 * read a file, or reads a copy in place of the named file (open_file.c). */
int ebpo_input_descriptor(const ebpo_input *input);

/* Returns true if the source accepts prefetch hints, as sources for remote files do. */
static inline bool ebpo_input_prefetches(const ebpo_input *input)
{
    return input->source.prefetch != NULL;
}
/* Returns true for a remote file, if opening should read only the bytes that are available. */
static inline bool ebpo_input_is_remote(const ebpo_input *input)
{
    return input->source.prefetch && input->source.prefetched &&
           input->source.prefetched < input->source.size;
}
/* Sends prefetch hints to the source. If a range is beyond the source's end, sends no hints,
 * because the later read will fail. */
void ebpo_input_prefetch(ebpo_input *input, const ebpo_range *ranges, size_t count);

/* Returns true if ebpo_input_advise can send prefetch hints to the operating system: the input is a
 * file opened by its path. Such hints help if the data is on a disk. */
bool ebpo_input_can_advise(const ebpo_input *input);
/* Sends prefetch hints to the operating system, which then reads in the background. Ranges of 1 MiB
 * or more are skipped, because the system reads ahead within such ranges by itself. */
void ebpo_input_advise(ebpo_input *input, const ebpo_range *ranges, size_t count);

/* --- sources by URL (ebpo/http.h) --- */

enum { EBPO_SHOWN_BYTES = 300 }; /* size of a URL in a message */

/* Gets the statistics of a source by URL. Returns false when the source is not from
 * ebpo_source_of_url. */
bool ebpo_source_http_stats(const ebpo_source *source, ebpo_http_stats *out);

#endif
