/* Faces by their indices, for the WebAssembly module. */
#include <stdlib.h>

#include "format/pick_rows.h"
#include "format/schema.h"
#include "module.h"

enum {
    FACE_CORNERS, /* double [9] of each face */
    FACE_SOURCES, /* uint32 of each face: index in the source; none without maps */
    FACE_VERTICES,
    FACE_FLOATS
};

/* Puts the corners of faces. */
static ebpo_status put_corners(ebpo_js_object *object, const uint32_t *faces, uint32_t count)
{
    bool wide = ebpo_file_info(object->file)->double_coordinates;
    uint64_t vertices = 3 * (uint64_t)count;
    uint32_t *rows = ebpo_js_extend(object, FACE_VERTICES, vertices, sizeof *rows);
    double *corners = ebpo_js_extend(object, FACE_CORNERS, vertices, 3 * sizeof *corners);
    float *floats = ebpo_js_extend(object, FACE_FLOATS, wide ? 0 : vertices, 3 * sizeof *floats);
    if (!rows || !corners || !floats)
        return EBPO_E_MEMORY;
    ebpo_faces_hint(object->chunks, faces, count, ebpo_file_info(object->file)->parts);
    ebpo_status status =
        ebpo_pick_rows(object->chunks, EBPO_A_FACES, faces, count, 1, rows, &object->error);
    if (status == EBPO_OK)
        status = ebpo_pick_rows(object->chunks, EBPO_A_VERTICES, rows, vertices, 1,
                                wide ? (void *)corners : floats, &object->error);
    for (uint64_t i = 0; i < 3 * vertices && !wide && status == EBPO_OK; i++)
        corners[i] = (double)floats[i];
    return status;
}

/* Reads faces by their indices in the file. */
int EBPO_JS(ebpo_js_faces)(ebpo_js_object *object, const uint32_t *faces, uint32_t count)
{
    enum { CACHE_BYTES = 8 << 20 };
    ebpo_js_clear(object);
    ebpo_status status = EBPO_OK;
    if (!object->chunks)
        status = ebpo_chunks_make(&object->chunks, object->file, CACHE_BYTES, &object->error);
    if (status == EBPO_OK)
        status = put_corners(object, faces, count);
    if (status != EBPO_OK || !(ebpo_file_info(object->file)->parts & EBPO_PART_MAPS))
        return status;
    uint32_t *sources = ebpo_js_extend(object, FACE_SOURCES, count, sizeof *sources);
    return sources ? ebpo_pick_rows(object->chunks, EBPO_A_FACE_SOURCE, faces, count, 1, sources,
                                    &object->error)
                   : EBPO_E_MEMORY;
}
