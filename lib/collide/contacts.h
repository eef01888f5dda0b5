/* Where crossing faces meet, as callers are told. */
#ifndef EBPO_COLLIDE_CONTACTS_H
#define EBPO_COLLIDE_CONTACTS_H

#include "collide/collider.h"

/* A pair with its faces, of the caller's A and B. */
typedef struct ebpo_posed_pair {
    double corner[2][3][3];
    uint32_t slot[2];
} ebpo_posed_pair;

/* Slots of both models, once for a collider. EBPO_E_MEMORY. */
EBPO_MUST_USE ebpo_status ebpo_collider_slots(ebpo_collider *collider, ebpo_error *error);

/* Needs slots. */
void ebpo_pose_pair(const ebpo_collision *collision, const ebpo_face_pair *pair,
                    ebpo_posed_pair *out);

/* The pair is EBPO_PAIR_CROSSING. */
void ebpo_contact_of(const ebpo_posed_pair *faces, const ebpo_face_pair *pair,
                     ebpo_contact_segment *out);

#endif
