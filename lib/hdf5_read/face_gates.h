/* Declares the coding `gates` of format-spec/gates.md. It represents a face of a chunk by its gate
 * (the edge that the face shares with an earlier face) and its third vertex. Any thread may call
 * these functions. */
#ifndef EBPO_HDF5_READ_FACE_GATES_H
#define EBPO_HDF5_READ_FACE_GATES_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

enum {
    EBPO_GATES_COLS = 13, /* bytes of a face in a chunk */
    EBPO_GATES_ENDS = 4   /* number of streams of a chunk; zeros follow the last stream */
};

/* Encodes `rows` consecutive faces of the mesh. `codes`: [rows][3] codes of the faces' corners, as
 * ebpo_corners_encode (coding.h) writes them; any codes are allowed. Fills `out` with
 * EBPO_GATES_COLS bytes for each face, and sets the end of each stream in `out`. rows > 0. */
void ebpo_gates_encode(const uint8_t *codes, uint32_t rows, uint8_t *out,
                       size_t ends[EBPO_GATES_ENDS]);

/* Decodes `in`, which has EBPO_GATES_COLS bytes for each face, to `codes`. Safe for any bytes:
 * returns false if the bytes do not represent `rows` faces. A vertex that does not exist becomes a
 * code that ebpo_corners_decode rejects. */
bool ebpo_gates_decode(const uint8_t *in, uint32_t rows, uint8_t *codes);

#endif
