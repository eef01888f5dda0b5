/* Where the faces of a subtree, or of a whole model, are in its blocks. Any thread. */
#ifndef EBPO_COLLIDE_FACE_SLOTS_H
#define EBPO_COLLIDE_FACE_SLOTS_H

#include "query/accel.h"

/* Slots by local numbers, which in a whole model are those in the file. NULL: no memory. The caller
 * frees it. */
uint32_t *ebpo_face_slots(const ebpo_accel *subtree);

#endif
