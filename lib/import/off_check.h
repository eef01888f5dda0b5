/* What assimp's OFF reader must not get to see. */
#ifndef EBPO_IMPORT_OFF_CHECK_H
#define EBPO_IMPORT_OFF_CHECK_H

#include <ebpo/base.h>

/* assimp 5.2.4 crashes on some damaged OFF files, allocates what the header claims, moves vertex
 * numbers that are out of range onto the last vertex, and leaves out faces of more than nine
 * corners, all without a message. So rows are counted and vertex numbers checked here first.
 * EBPO_E_FORMAT with the line; EBPO_E_UNSUPPORTED for faces of more than nine corners. `name` is
 * for messages. *more: lines have more than positions and corners, such as colours and normals. */
EBPO_MUST_USE ebpo_status ebpo_import_check_off(const uint8_t *data, uint64_t size,
                                                const char *name, bool *more, ebpo_error *error);

#endif
