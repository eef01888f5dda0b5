/* Where a whole model's faces are in its blocks. Any thread. */
#ifndef EBPO_COLLIDE_FACE_SLOTS_H
#define EBPO_COLLIDE_FACE_SLOTS_H

#include "accel/accel.h"

/* Slots by numbers in the file, which are local numbers in a whole model. NULL: no memory. The
 * caller frees it. */
uint32_t *ebpo_face_slots(const ebpo_accel *whole);

#endif
