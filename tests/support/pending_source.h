/* A file whose bytes are never available at first: each call returns EBPO_E_PENDING until the bytes
 * that it needs have been supplied (ebpo/async.h). Aborts on failure. */
#ifndef EBPO_TESTS_PENDING_SOURCE_H
#define EBPO_TESTS_PENDING_SOURCE_H

#include <ebpo/async.h>

typedef struct pending_source {
    ebpo_async *async;
    uint8_t *data;
    uint64_t size;
    uint64_t operation, last_call; /* operations of the call with its repetitions, and of the last
                                    * repetition */
    /* number of round trips, of ranges, and of bytes in them */
    uint64_t rounds, requests, fetched;
    uint64_t peak; /* maximum number of bytes in memory */
} pending_source;

/* Reads the file that is to be supplied. memory: maximum number of supplied bytes that no operation
 * uses. */
void pending_begin(pending_source *p, const char *path, uint64_t memory);
void pending_end(pending_source *p);

/* Opens the file. head: number of bytes that are requested at first; 0: the default. */
ebpo_file *pending_open(pending_source *p, uint64_t head);

/* Returns true if the status is EBPO_E_PENDING, after supplying all needed bytes: repeat the call.
 * Otherwise ends the operation and begins the next one. */
bool pending_again(pending_source *p, ebpo_status status);

/* Does the same as pending_again, for a batch that has completed some items: bytes that the last
 * call did not use may be dropped. */
bool pending_progress(pending_source *p, ebpo_status status);

#endif
