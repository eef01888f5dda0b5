/* Reads the arrays of an open file chunk by chunk. */
#ifndef EBPO_FORMAT_READER_H
#define EBPO_FORMAT_READER_H

#include "format/file_in.h"

/* Collects chunks that will be read and sends prefetch hints for them; does nothing for sources
 * without prefetching. For one thread.
 *
 *     ebpo_hints expected = EBPO_HINTS_INIT(file);
 *     ebpo_hint_array(&expected, array);    ...
 *     ebpo_hint_all(&expected); */
typedef struct ebpo_hints {
    const ebpo_file *file;
    ebpo_range *range;
    uint64_t count, capacity;
    bool failed; /* chunk offsets could not be read */
    bool near;   /* also for local files: hints go to the operating system */
    bool summed; /* for any file: for ebpo_hints_bytes */
} ebpo_hints;
#define EBPO_HINTS_INIT(file)                 \
    {                                         \
        file, NULL, 0, 0, false, false, false \
    }
/* Collects chunks [begin, end) of an array, present or not. */
void ebpo_hint_chunks(ebpo_hints *expected, const ebpo_array_in *array, uint64_t begin,
                      uint64_t end);
void ebpo_hint_array(ebpo_hints *expected, const ebpo_array_in *array);
/* Collects a level's arrays except those of parts that will not be read. */
void ebpo_hint_level(ebpo_hints *expected, int level, uint32_t without);
/* Collects the arrays of the root that any of these needs require. */
void ebpo_hint_root(ebpo_hints *expected, uint32_t needs);
/* Collects the arrays of attributes. */
void ebpo_hint_attributes(ebpo_hints *expected);
/* Sends prefetch hints for all of the file. */
void ebpo_hint_tree(const ebpo_file *file);
/* Sends prefetch hints for looking up a subtree, if the file has subtrees and states their size:
 * levels down to their roots, the sums before them, and the chunk offsets. */
void ebpo_hint_top(const ebpo_file *file);
/* Returns true if hints have an effect. */
bool ebpo_hints_wanted(const ebpo_hints *expected);
/* Sends the collected hints, and frees them. */
void ebpo_hint_all(ebpo_hints *expected);
/* Returns the bytes of the file that were collected, each counted once; sends no hints. */
uint64_t ebpo_hints_bytes(ebpo_hints *expected);

/* Options for reading into memory with this number of threads. */
static inline ebpo_read_options ebpo_read_threads(unsigned threads)
{
    ebpo_read_options options = EBPO_READ_OPTIONS_INIT;
    options.threads = threads;
    return options;
}

/* Fetches and decodes chunk number `chunk` of an array that is present: chunk_rows rows as
 * specified (the last chunk with its padding), into `raw` of EBPO_CHUNK_BYTES_MAX bytes. Several
 * threads may call it at once, each with a separate reader. */
EBPO_MUST_USE ebpo_status ebpo_reader_chunk(const ebpo_file *file, const ebpo_array_in *array,
                                            uint64_t chunk, ebpo_chunk_reader *reader, uint8_t *raw,
                                            ebpo_error *error);

/* Does the same for faces that are stored as gates, without converting them: EBPO_GATES_COLS bytes
 * for each row. */
EBPO_MUST_USE ebpo_status ebpo_reader_gates(const ebpo_file *file, uint64_t chunk,
                                            ebpo_chunk_reader *reader, uint8_t *raw,
                                            ebpo_error *error);

/* Receives rows [row, row + rows) of chunk number `chunk`, decoded to the specified bytes. Called
 * from several threads. */
typedef ebpo_status (*ebpo_rows_fn)(void *context, const ebpo_array_in *array, uint64_t chunk,
                                    uint64_t row, uint64_t rows, const uint8_t *bytes,
                                    ebpo_error *error);

/* Reads all chunks of an array that is present. Chunks come in any order, unless threads is 1.
 * Releases pages of the workspace meanwhile. */
EBPO_MUST_USE ebpo_status ebpo_reader_rows(const ebpo_file *file, const ebpo_array_in *array,
                                           const ebpo_read_options *options, ebpo_rows_fn take,
                                           void *context, ebpo_error *error);

/* Reads an array into new memory, which the workspace of the options owns. NULL when the array is
 * absent. */
EBPO_MUST_USE ebpo_status ebpo_reader_make(const ebpo_file *file, ebpo_array_id id, int level,
                                           const ebpo_read_options *options, size_t size,
                                           void *values_out, ebpo_error *error);

/* Decodes a leaf's references in place: gaps, counted down from its first new face, become
 * ascending indices. Returns false when an index would be below 0. */
bool ebpo_refs_decode(uint32_t *refs, uint64_t count, uint64_t first);

void ebpo_idle_readers_make(ebpo_idle_readers *readers);
/* Frees the idle readers. */
void ebpo_idle_readers_free(ebpo_idle_readers *readers);
/* Returns an idle or new reader, or NULL without memory. The caller owns it until it is returned.
 */
ebpo_idle_reader *ebpo_idle_readers_take(ebpo_idle_readers *readers);
/* Returns a reader to the list; NULL is allowed. */
void ebpo_idle_readers_give(ebpo_idle_readers *readers, ebpo_idle_reader *reader);

#endif
