/* The faces and vertices of a slice. */
#ifndef EBPO_FORMAT_SLICE_FACES_H
#define EBPO_FORMAT_SLICE_FACES_H

#include "format/slice.h"

/* From levels with numbers of the file, and first_face and face_count: everything else, with `maps`
 * numbers in the source, too, and local numbers in the levels. `room`: ebpo_slice_read_within. */
EBPO_MUST_USE ebpo_status ebpo_slice_take_faces(ebpo_slice *slice, ebpo_chunks *chunks, bool maps,
                                                ebpo_room *room, ebpo_error *error);

#endif
