/* Declares the coding `gates` of format-spec/gates.md. It represents a face of a chunk by its gate
 * (the edge that it shares with an earlier face) and its third vertex. Pure functions, any thread.
 */
#ifndef EBPO_HDF5_READ_FACE_GATES_H
#define EBPO_HDF5_READ_FACE_GATES_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

enum {
    EBPO_GATES_COLS = 13, /* bytes of a face in a chunk */
    EBPO_GATES_ENDS = 4   /* number of streams of a chunk; zeros follow the last stream */
};

/* Encodes `codes`: [rows][3] codes of corners (ebpo_corners_encode in coding.h), little-endian, of
 * any consecutive faces of the mesh. Fills `out` with EBPO_GATES_COLS bytes for each face, and sets
 * the end of each stream in `out`. Any codes can be written. rows > 0. Time is proportional to
 * rows. */
void ebpo_gates_encode(const uint8_t *codes, uint32_t rows, uint8_t *out,
                       size_t ends[EBPO_GATES_ENDS]);

/* Decodes to `codes`. Accepts any bytes, and returns false when the bytes represent no faces. A
 * vertex that does not exist becomes a code that ebpo_corners_decode rejects. */
bool ebpo_gates_decode(const uint8_t *in, uint32_t rows, uint8_t *codes);

#endif
