/* Colliders of subsets, for those who know what has been left out. */
#ifndef EBPO_COLLIDE_OF_PARTS_H
#define EBPO_COLLIDE_OF_PARTS_H

#include <ebpo/collide.h>

/* As ebpo_collider_new; answers are about the faces that are there. */
EBPO_MUST_USE ebpo_status ebpo_collider_of_parts(ebpo_model *a, ebpo_model *b,
                                                 const ebpo_collider_options *options,
                                                 ebpo_collider **out, ebpo_error *error);

#endif
