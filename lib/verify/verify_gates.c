/* Faces that are stored across edges, read by the plain twin. */
#include <inttypes.h>
#include <stdlib.h>

#include "core/alloc.h"
#include "core/error.h"
#include "hdf5_read/chunk.h"
#include "format/reader.h"
#include "verify/plain_gates.h"
#include "verify/verify_subtrees.h"

enum { CORNERS_MOST = EBPO_CHUNK_BYTES_MAX / 4 };

static void compare_chunk(ebpo_tally *tally, const uint8_t *streams, uint32_t *faces,
                          const ebpo_tree *tree, uint64_t row, uint64_t rows, uint64_t *seen)
{
    const uint32_t *corners = tree->mesh.faces + 3 * row;
    bool same = ebpo_plain_gates_read(streams, (uint32_t)rows, seen, faces);
    for (uint64_t i = 0; i < 3 * rows && same; i++)
        same = faces[i] == corners[i];
    (void)ebpo_tally_check(tally, EBPO_VERIFY_STRUCTURE, same,
                           "/mesh/faces, from face %" PRIu64
                           " on: the streams are read in two ways, with different corners",
                           row);
}

static ebpo_status compare(ebpo_tally *tally, const ebpo_file *file, const ebpo_tree *tree,
                           ebpo_idle_reader *r, uint32_t *faces, ebpo_error *error)
{
    const ebpo_array_in *array = ebpo_reader_array(file, EBPO_A_FACES, 0);
    ebpo_status status = EBPO_OK;
    uint64_t seen = 0, rows = array->shape.chunk_rows;
    for (uint64_t row = 0; row < array->shape.rows && status == EBPO_OK; row += rows) {
        uint64_t left = array->shape.rows - row;
        status = ebpo_reader_gates(file, row / rows, &r->reader, r->raw, error);
        if (status == EBPO_OK)
            compare_chunk(tally, r->raw, faces, tree, row, left < rows ? left : rows, &seen);
    }
    return status;
}

ebpo_status ebpo_check_gates(ebpo_tally *tally, const ebpo_file *file, const ebpo_tree *tree,
                             ebpo_error *error)
{
    if (!ebpo_reader_array(file, EBPO_A_FACES, 0)->gates)
        return EBPO_OK;
    ebpo_idle_reader *r = ebpo_idle_readers_take(&ebpo_reader_own(file)->idle);
    uint32_t *faces = ebpo_alloc(CORNERS_MOST, sizeof *faces);
    ebpo_status status = r && faces ? compare(tally, file, tree, r, faces, error)
                                    : ebpo_fail_memory(error, CORNERS_MOST * sizeof *faces);
    free(faces);
    ebpo_idle_readers_give(&ebpo_reader_own(file)->idle, r);
    return status;
}
