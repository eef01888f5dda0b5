/* A trial: a chunk of faces, coded across edges of faces before them in it. What it would save and
 * why no file has it: docs/develop/codings.md. */
#ifndef EBPO_TESTS_GATES_H
#define EBPO_TESTS_GATES_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

enum { GATES_ROWS_MOST = 4096, GATES_STREAMS = 4 };

/* Bytes of a chunk, subject by subject: which gate; which third corner and which corner comes
 * first; low and further bytes of numbers. `room` is 16 bytes for each face and stream. */
typedef struct gates {
    uint8_t *stream[GATES_STREAMS];
    size_t bytes[GATES_STREAMS];
    uint8_t room[GATES_STREAMS][16 * GATES_ROWS_MOST];
} gates;

/* [rows][3] corners, rows <= GATES_ROWS_MOST; `seen` vertices are used before. `streams` is filled.
 */
void gates_encode(const uint32_t *faces, uint32_t rows, uint64_t seen, gates *streams);

/* False when `streams` are those of no faces. Reads nothing beyond their bytes. */
bool gates_decode(const gates *streams, uint32_t rows, uint64_t seen, uint32_t *faces);

#endif
