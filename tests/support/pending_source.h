/* A file whose bytes are never available at first: each call returns EBPO_E_PENDING until the bytes
 * that it needs have been supplied (ebpo/async.h). Aborts on failure. */
#ifndef EBPO_TESTS_PENDING_SOURCE_H
#define EBPO_TESTS_PENDING_SOURCE_H

#include <ebpo/async.h>

typedef struct pending_source {
    ebpo_async *async;
    uint8_t *data;
    uint64_t size;
    uint64_t operation, last_call; /* operations: the call with its repetitions; the last call */
    /* number of round trips, of ranges, and of bytes in them */
    uint64_t rounds, requests, fetched;
    uint64_t peak; /* maximum number of bytes held */
} pending_source;

/* Reads the file to be supplied. `memory`: limit for supplied bytes that no operation uses. */
void pending_begin(pending_source *p, const char *path, uint64_t memory);
void pending_end(pending_source *p);

/* Opens the file. The head has `head` bytes; 0: the default size. */
ebpo_file *pending_open(pending_source *p, uint64_t head);

/* Returns true if the status is EBPO_E_PENDING, after supplying all needed bytes: repeat the call.
 * Otherwise ends the operation and begins the next one. */
bool pending_again(pending_source *p, ebpo_status status);

/* Same as pending_again, for a batch that has completed some items: bytes that the last call did
 * not use need not stay. */
bool pending_progress(pending_source *p, ebpo_status status);

#endif
