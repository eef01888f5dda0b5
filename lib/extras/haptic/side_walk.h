/* On which side a probe is: its winding number, which exact arithmetic changes at each face that it
 * goes through. */
#ifndef EBPO_HAPTIC_SIDE_WALK_H
#define EBPO_HAPTIC_SIDE_WALK_H

#include "extras/haptic/face_box.h"

typedef struct ebpo_side {
    double at[3]; /* of this place, which is on no face, */
    int32_t winding;
    bool known;
    uint32_t turns; /* of ways around what is met badly */
} ebpo_side;

/* Goes on to `place`, as far as it gets with so little work: at most `most` faces for each of some
 * pieces, into found[most]. True: it is there. Else it stands where the winding number is known, or
 * has left the box (known is false then). */
bool ebpo_side_go(ebpo_side *side, const ebpo_face_box *box, const double place[3], uint32_t *found,
                  uint32_t most, uint32_t visits, uint64_t *work);

/* Whether a place is on a face: true also where that is not to be told without memory. */
bool ebpo_side_on(const ebpo_face_box *box, const double place[3], uint32_t *found, uint32_t most,
                  uint32_t visits);

#endif
