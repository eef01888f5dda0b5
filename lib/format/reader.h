/* Reading the arrays of an open file chunk by chunk. */
#ifndef EBPO_FORMAT_READER_H
#define EBPO_FORMAT_READER_H

#include "format/file_in.h"

/* What will be read, collected and then announced; nothing is done for sources that do not want to
 * know. For one thread.
 *
 *     ebpo_expected expected = EBPO_EXPECTED_INIT(file);
 *     ebpo_expect_array(&expected, array);    ...
 *     ebpo_expect_all(&expected);
 */
typedef struct ebpo_expected {
    const ebpo_file *file;
    ebpo_range *range;
    uint64_t count, capacity;
    bool failed; /* where chunks lie could not be read */
    bool near;   /* of files on a disk, too: the system is told */
    bool summed; /* of any file: for ebpo_expected_bytes */
} ebpo_expected;
#define EBPO_EXPECTED_INIT(file)              \
    {                                         \
        file, NULL, 0, 0, false, false, false \
    }
/* Chunks [begin, end) of an array that is present or not. */
void ebpo_expect_chunks(ebpo_expected *expected, const ebpo_array_in *array, uint64_t begin,
                        uint64_t end);
void ebpo_expect_array(ebpo_expected *expected, const ebpo_array_in *array);
/* A level's arrays but those of parts that will not be read. */
void ebpo_expect_level(ebpo_expected *expected, int level, uint32_t without);
/* The arrays of the root that are there for any of these needs. */
void ebpo_expect_root(ebpo_expected *expected, uint32_t needs);
/* Those of attributes. */
void ebpo_expect_attributes(ebpo_expected *expected);
/* Announces the whole file. */
void ebpo_expect_tree(const ebpo_file *file);
/* Announces what looking up a subtree takes, if the file has subtrees and says so: levels down to
 * their roots, the sums before them, and where all chunks lie. */
void ebpo_expect_top(const ebpo_file *file);
/* Whether anything comes of it. */
bool ebpo_expected_wanted(const ebpo_expected *expected);
/* Announces what was collected, and frees it. */
void ebpo_expect_all(ebpo_expected *expected);
/* Instead: how many bytes of the file that is, each counted once. */
uint64_t ebpo_expected_bytes(ebpo_expected *expected);

/* In memory, by so many threads. */
static inline ebpo_read_options ebpo_read_threads(unsigned threads)
{
    ebpo_read_options options = EBPO_READ_OPTIONS_INIT;
    options.threads = threads;
    return options;
}

/* Fetches chunk number `chunk` of an array that is present and decodes it: chunk_rows rows as the
 * specification describes them (the last chunk with its filling), into `raw` of
 * EBPO_CHUNK_BYTES_MAX bytes. Several threads at once, each with its own reader. */
EBPO_MUST_USE ebpo_status ebpo_reader_chunk(const ebpo_file *file, const ebpo_array_in *array,
                                            uint64_t chunk, ebpo_chunk_reader *reader, uint8_t *raw,
                                            ebpo_error *error);

/* The same of faces that are stored as gates, as these: EBPO_GATES_COLS bytes for each row. */
EBPO_MUST_USE ebpo_status ebpo_reader_gates(const ebpo_file *file, uint64_t chunk,
                                            ebpo_chunk_reader *reader, uint8_t *raw,
                                            ebpo_error *error);

/* Takes rows [row, row + rows) of chunk number `chunk`, decoded to the bytes that the specification
 * describes. Called from several threads. */
typedef ebpo_status (*ebpo_rows_fn)(void *context, const ebpo_array_in *array, uint64_t chunk,
                                    uint64_t row, uint64_t rows, const uint8_t *bytes,
                                    ebpo_error *error);

/* Reads all chunks of an array that is present. Chunks come in any order, unless threads is 1. Of
 * the workspace, pages are released meanwhile. */
EBPO_MUST_USE ebpo_status ebpo_reader_rows(const ebpo_file *file, const ebpo_array_in *array,
                                           const ebpo_read_options *options, ebpo_rows_fn take,
                                           void *context, ebpo_error *error);

/* The same into new memory: NULL when the array is absent. The workspace of the options owns it. */
EBPO_MUST_USE ebpo_status ebpo_reader_make(const ebpo_file *file, ebpo_array_id id, int level,
                                           const ebpo_read_options *options, size_t size,
                                           void *values_out, ebpo_error *error);

/* A leaf's references in place: gaps, counted down from its first new face, to ascending numbers.
 * False when one falls below 0. */
bool ebpo_refs_decode(uint32_t *refs, uint64_t count, uint64_t first);

void ebpo_idle_readers_make(ebpo_idle_readers *readers);
/* Frees the readers that wait. */
void ebpo_idle_readers_free(ebpo_idle_readers *readers);
/* One that waits, or a new one; NULL: no memory. The caller's until it is given back. */
ebpo_idle_reader *ebpo_idle_readers_take(ebpo_idle_readers *readers);
/* NULL is nothing. */
void ebpo_idle_readers_give(ebpo_idle_readers *readers, ebpo_idle_reader *reader);

#endif
