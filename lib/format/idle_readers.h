/* Readers of chunks that wait for the next thread: setting up a decoder takes longer than a chunk.
 * They stay with the file, a few of them, and count to no budget. */
#ifndef EBPO_FORMAT_IDLE_READERS_H
#define EBPO_FORMAT_IDLE_READERS_H

#include <pthread.h>

#include "hdf5_read/chunk.h"

/* Decoding state and room for one stored chunk, of one thread. */
typedef struct ebpo_chunk_reader {
    ebpo_chunk_coder coder;
    uint8_t *stored;
    size_t capacity;
} ebpo_chunk_reader;

/* What one thread needs. */
typedef struct ebpo_idle_reader ebpo_idle_reader;
struct ebpo_idle_reader {
    ebpo_idle_reader *next;
    ebpo_chunk_reader reader;
    uint8_t raw[EBPO_CHUNK_BYTES_MAX];
};

typedef struct ebpo_idle_readers {
    pthread_mutex_t lock; /* of what follows */
    ebpo_idle_reader *first;
    unsigned count;
} ebpo_idle_readers;

void ebpo_idle_readers_make(ebpo_idle_readers *readers);
/* Those that wait. */
void ebpo_idle_readers_free(ebpo_idle_readers *readers);
/* One that waits, or a new one; NULL: no memory. The caller's until it is given back. */
ebpo_idle_reader *ebpo_idle_readers_take(ebpo_idle_readers *readers);
/* NULL is nothing. */
void ebpo_idle_readers_give(ebpo_idle_readers *readers, ebpo_idle_reader *reader);

#endif
