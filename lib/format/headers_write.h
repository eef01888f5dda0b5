/* For writing: all of a file but its chunks: groups, arrays' headers, attributes, and the indexes
 * of chunks; how many bytes these take is learned from a trial in memory. */
#ifndef EBPO_FORMAT_HEADERS_WRITE_H
#define EBPO_FORMAT_HEADERS_WRITE_H

#include "format/write_plan.h"

/* In the order of the file. */
typedef enum ebpo_list { EBPO_LIST_SUMS, EBPO_LIST_PLACES, EBPO_LISTS } ebpo_list;

typedef struct ebpo_headers {
    ebpo_plan *plan; /* whose arrays get handles */
    ebpo_h5_out out;
    ebpo_h5_id root;
    /* lists about all chunks, the last chunks of the file; without rows they are not written */
    ebpo_array_out list[EBPO_LISTS];
    uint64_t chunks; /* of the plan's arrays */
    int codec_level;
    uint64_t head_bytes;  /* headers */
    uint64_t index_bytes; /* of arrays of several chunks; 0: there are none */
} ebpo_headers;

/* The file's first chunk (of the root's type): it is written with the headers. */
typedef struct ebpo_first_chunk {
    const void *data;
    size_t bytes;
} ebpo_first_chunk;

/* The plan stays the caller's. End with ebpo_headers_close, and ebpo_h5_finish or ebpo_h5_discard.
 */
void ebpo_headers_plan(ebpo_headers *h, ebpo_plan *plan, uint64_t chunks,
                       const ebpo_write_options *options);

/* Sizes of headers and indexes: the same file in memory, with chunks of one byte. */
EBPO_MUST_USE ebpo_status ebpo_headers_measure(ebpo_headers *h, const char *shown,
                                               ebpo_error *error);

/* Then the file, which is left open. `shown`: for messages. */
EBPO_MUST_USE ebpo_status ebpo_headers_lay_out(ebpo_headers *h, const char *path, const char *shown,
                                               ebpo_first_chunk first, ebpo_error *error);

/* With index_bytes: what comes now is in a piece of its own, once the first array of several chunks
 * calls for it. */
EBPO_MUST_USE ebpo_status ebpo_headers_begin_index(ebpo_headers *h, ebpo_error *error);

/* Of a list: its own place and the file's size, which tell readers whether it still holds. */
EBPO_MUST_USE ebpo_status ebpo_headers_put_holds(ebpo_headers *h, ebpo_list list,
                                                 uint64_t file_bytes, uint64_t offset,
                                                 ebpo_error *error);

/* Closes root and arrays, not the file. */
void ebpo_headers_close(ebpo_headers *h);

#endif
