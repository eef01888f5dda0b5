/* Reads the arrays of an open file chunk by chunk. */
#ifndef EBPO_FORMAT_READER_H
#define EBPO_FORMAT_READER_H

#include "format/file_in.h"

/* Collects chunks that will be read and sends prefetch hints for them. Does nothing for sources
 * without prefetching. One thread at a time.
 *
 *     ebpo_hints hints = EBPO_HINTS_INIT(file);
 *     ebpo_hint_array(&hints, array);    ...
 *     ebpo_hint_all(&hints); */
typedef struct ebpo_hints {
    const ebpo_file *file;
    ebpo_range *range;
    uint64_t count, capacity;
    bool failed; /* true: chunk offsets could not be read, so nothing more is collected */
    bool local;  /* also collect chunks of local files: the operating system receives the hints */
    bool counts_bytes;  /* collect chunks of any file, for ebpo_hints_bytes */
    bool has_all_pages; /* all pages of checksums are collected */
} ebpo_hints;
#define EBPO_HINTS_INIT(file)                        \
    {                                                \
        file, NULL, 0, 0, false, false, false, false \
    }
/* Collects chunks [begin, end) of an array; does nothing if the array is absent. */
void ebpo_hint_chunks(ebpo_hints *hints, const ebpo_array_in *array, uint64_t begin, uint64_t end);
/* Collects all chunks of an array. */
void ebpo_hint_array(ebpo_hints *hints, const ebpo_array_in *array);
/* Collects a level's arrays, except those of the parts `without`. */
void ebpo_hint_level(ebpo_hints *hints, int level, uint32_t without);
/* Collects the arrays of the root that any of `needs` (EBPO_NEEDS_..., schema.h) requires. */
void ebpo_hint_root(ebpo_hints *hints, uint32_t needs);
/* Collects the arrays of attributes. */
void ebpo_hint_attributes(ebpo_hints *hints);
/* Sends prefetch hints for all arrays of the file. */
void ebpo_hint_tree(const ebpo_file *file);
/* Sends prefetch hints for the data with which a reader locates a subtree: levels down to the
 * subtrees' roots, the sums before the subtrees, and the chunk offsets. Does nothing if the file
 * has no subtrees, or does not state the size of these data (top_bytes). */
void ebpo_hint_top(const ebpo_file *file);
/* Returns true if ebpo_hint_chunks collects chunks: if the source uses prefetch hints, or because
 * of `local` or `counts_bytes`. */
bool ebpo_hints_wanted(const ebpo_hints *hints);
/* Sends hints for the collected chunks, and clears the collection. */
void ebpo_hint_all(ebpo_hints *hints);
/* Returns the number of bytes of the file in the collected chunks, each byte counted once. Clears
 * the collection and sends no hints. */
uint64_t ebpo_hints_bytes(ebpo_hints *hints);

/* Returns true if the checksums of an array's chunks are in pages of the file. */
bool ebpo_has_paged_checksums(const ebpo_file *file, const ebpo_array_in *array);

/* Finds the rows of all chunks in the pages. Reads /subtrees/index. Does nothing if the file has no
 * pages, and in later calls. Any thread may call this function. */
EBPO_MUST_USE ebpo_status ebpo_checksum_pages_prepare(const ebpo_file *file, ebpo_error *error);

/* Returns options for reading into memory with this number of threads. */
static inline ebpo_read_options ebpo_read_threads(unsigned threads)
{
    ebpo_read_options options = EBPO_READ_OPTIONS_INIT;
    options.threads = threads;
    return options;
}

/* Fetches and decodes chunk number `chunk` of an array that is present. Writes chunk_rows rows (in
 * the last chunk, the rows beyond the end are padding) to `raw` of EBPO_CHUNK_BYTES_MAX bytes.
 * Several threads may call this function at once, each with a separate `reader`. */
EBPO_MUST_USE ebpo_status ebpo_reader_chunk(const ebpo_file *file, const ebpo_array_in *array,
                                            uint64_t chunk, ebpo_chunk_reader *reader, uint8_t *raw,
                                            ebpo_error *error);

/* Fetches a chunk of faces that are stored as gates (relative to edges of preceding faces,
 * face_gates.h), without converting the gates to corners. Writes EBPO_GATES_COLS bytes for each
 * row. */
EBPO_MUST_USE ebpo_status ebpo_reader_gates(const ebpo_file *file, uint64_t chunk,
                                            ebpo_chunk_reader *reader, uint8_t *raw,
                                            ebpo_error *error);

/* Callback that receives the rows [row, row + rows) of an array, which are chunk number `chunk`.
 * `bytes`: the rows as ebpo_reader_chunk returns them. Several threads may call it at once. */
typedef ebpo_status (*ebpo_rows_fn)(void *context, const ebpo_array_in *array, uint64_t chunk,
                                    uint64_t row, uint64_t rows, const uint8_t *bytes,
                                    ebpo_error *error);

/* Reads all chunks of an array that is present, and passes them to `take`: in any order, or in
 * ascending order if options->threads is 1. Releases pages of the workspace while it reads. */
EBPO_MUST_USE ebpo_status ebpo_reader_rows(const ebpo_file *file, const ebpo_array_in *array,
                                           const ebpo_read_options *options, ebpo_rows_fn take,
                                           void *context, ebpo_error *error);

/* Reads an array as integers of `size` bytes into new memory from the workspace of the options.
 * `values_out` is the address of the pointer; the pointer is NULL when the array is absent. */
EBPO_MUST_USE ebpo_status ebpo_reader_make(const ebpo_file *file, ebpo_array_id id, int level,
                                           const ebpo_read_options *options, size_t size,
                                           void *values_out, ebpo_error *error);

/* Decodes a leaf's references in place. A reference is a face that an earlier leaf lists, so its
 * index is below `first`, the leaf's first new face. The file stores gaps between references, from
 * `first` downwards. The result is ascending face indices. Returns false if an index would be below
 * 0. */
bool ebpo_refs_decode(uint32_t *refs, uint64_t count, uint64_t first);

/* Makes an empty list of idle readers. */
void ebpo_idle_readers_make(ebpo_idle_readers *readers);
/* Frees the idle readers. */
void ebpo_idle_readers_free(ebpo_idle_readers *readers);
/* Removes an idle reader from the list, or creates one. Returns NULL when out of memory. The caller
 * passes the reader to ebpo_idle_readers_give. */
ebpo_idle_reader *ebpo_idle_readers_take(ebpo_idle_readers *readers);
/* Puts a reader back into the list, or frees it when the list is full. NULL is allowed. */
void ebpo_idle_readers_give(ebpo_idle_readers *readers, ebpo_idle_reader *reader);

#endif
