/* Provides sources of a file's bytes (ebpo_source): regular files and memory. An input is a source
 * with a name for messages and a count of reads. */
#ifndef EBPO_IO_BYTE_SOURCE_H
#define EBPO_IO_BYTE_SOURCE_H

#include <stdatomic.h>

#include <ebpo/file.h>
#include <ebpo/http.h>

/* Opens a regular file, which is read by pread. Returns EBPO_E_IO if the file is missing, may not
 * be read, or is a folder, pipe or device. If another program shortens the file later, reads return
 * EBPO_E_IO (a mapped file would raise SIGBUS). The owner of the source calls out->close. */
EBPO_MUST_USE ebpo_status ebpo_source_of_path(ebpo_source *out, const char *path,
                                              ebpo_error *error);

/* Returns a source of `size` bytes in memory. The caller keeps the bytes, which must outlive the
 * source. The source need not be closed. */
ebpo_source ebpo_source_of_memory(const void *data, uint64_t size);

/* A source that is read. Several threads may read at once. */
typedef struct ebpo_input {
    ebpo_source source;
    char *shown; /* the name for messages */
    /* bytes requested from the source, including the bytes that the source already had when the
     * input was opened */
    _Atomic uint64_t bytes;
    _Atomic uint64_t reads; /* number of reads */
} ebpo_input;

/* Takes ownership of the source, and closes the source on failure (EBPO_E_MEMORY). `name` is
 * copied. */
EBPO_MUST_USE ebpo_status ebpo_input_open(ebpo_input *input, const ebpo_source *source,
                                          const char *name, ebpo_error *error);
/* Closes the source. Does nothing for a zeroed input, and for an input that is closed already. */
void ebpo_input_close(ebpo_input *input);

/* Reads bytes [offset, offset + size) into `data`. Returns EBPO_E_FORMAT if they are beyond the end
 * of the source, because only a damaged file leads to such an offset. Otherwise returns the status
 * of the source's function `read`, and adds a message if `read` fails without a message. */
EBPO_MUST_USE ebpo_status ebpo_input_read(ebpo_input *input, uint64_t offset, uint64_t size,
                                          void *data, ebpo_error *error);

/* Returns the descriptor of the file; the input keeps owning the descriptor. Returns -1 if the
 * input does not read a file, or reads a copy instead of the named file (ebpo_open_compat). */
int ebpo_input_descriptor(const ebpo_input *input);

/* Returns true if the source accepts prefetch hints, which announce ranges that will be read soon.
 * Sources for remote files accept them. */
static inline bool ebpo_input_prefetches(const ebpo_input *input)
{
    return input->source.prefetch != NULL;
}
/* Returns true for a remote file that the source does not have completely. Opening then reads only
 * the bytes at the beginning that the source already has. */
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

/* Gets the statistics of a source by URL. Returns false if ebpo_source_of_url has not made the
 * source. */
bool ebpo_source_http_stats(const ebpo_source *source, ebpo_http_stats *out);

#endif
