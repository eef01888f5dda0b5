/* The coding `gates` of format-spec/gates.md: represents each face of a chunk by the
 * edge of an earlier face across which it is, and its third vertex. Pure functions, any thread. */
#ifndef EBPO_HDF5_READ_FACE_GATES_H
#define EBPO_HDF5_READ_FACE_GATES_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

enum {
    EBPO_GATES_COLS = 13, /* bytes of a face in a chunk */
    EBPO_GATES_ENDS = 4   /* streams of a chunk, before its final zeros */
};

/* Encodes `codes`: [rows][3] codes of corners (ebpo_corners_encode in coding.h), little-endian, of
 * faces that need not be the first ones of the mesh. Fills `out`, EBPO_GATES_COLS bytes for each
 * face, and sets the end of each stream in it. Any codes can be written. rows > 0. Time is
 * proportional to rows. */
void ebpo_gates_encode(const uint8_t *codes, uint32_t rows, uint8_t *out,
                       size_t ends[EBPO_GATES_ENDS]);

/* Decodes any bytes. Returns false when they represent no faces. Numbers above `seen` become codes
 * above it, which ebpo_corners_decode rejects. */
bool ebpo_gates_decode(const uint8_t *in, uint32_t rows, uint8_t *codes);

#endif
