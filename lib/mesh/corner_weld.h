/* Joining vertices at identical positions. */
#ifndef EBPO_MESH_CORNER_WELD_H
#define EBPO_MESH_CORNER_WELD_H

#include <ebpo/base.h>

/* Moves the first vertex of each position to the front of xyz [count][3], which are doubles or
 * floats, in order, and writes each old vertex's new number to map [count]. Positions are the same
 * when their bits are, or both coordinates are zero (STL writers mix -0 and 0 along planes of
 * symmetry; the first one's sign stays). count <= 2^32 - 2. *welded: vertices left. EBPO_E_MEMORY
 * only. */
EBPO_MUST_USE ebpo_status ebpo_import_weld(void *xyz, bool doubles, uint64_t count, uint32_t *map,
                                           uint64_t *welded, ebpo_error *error);

#endif
