/* Where crossing faces meet, as callers are told. */
#ifndef EBPO_COLLIDE_CONTACTS_H
#define EBPO_COLLIDE_CONTACTS_H

#include "extras/collide/collider.h"
#include "extras/collide/faces_by_number.h"

/* A pair with its faces, of the caller's A and B: as in the files, and at their poses. */
typedef struct ebpo_posed_pair {
    double own[2][3][3], corner[2][3][3];
} ebpo_posed_pair;

/* Where faces of a question's pairs are looked up. */
typedef struct ebpo_pair_faces {
    const ebpo_collision *question;
    ebpo_faces_by_number side[2]; /* of the caller's A and B */
} ebpo_pair_faces;

/* Slots of those models that are in memory, once for a collider. EBPO_E_MEMORY. */
EBPO_MUST_USE ebpo_status ebpo_collider_slots(ebpo_collider *collider, ebpo_error *error);

/* Ended also after a failure; zero is fine. */
EBPO_MUST_USE ebpo_status ebpo_pair_faces_begin(ebpo_pair_faces *f, const ebpo_collision *question,
                                                ebpo_error *error);
void ebpo_pair_faces_end(ebpo_pair_faces *f);

/* The errors of reading. */
EBPO_MUST_USE ebpo_status ebpo_pose_pair(ebpo_pair_faces *f, const ebpo_face_pair *pair,
                                         ebpo_posed_pair *out, ebpo_error *error);

/* Segments that ebpo_collide_polylines has room for: one for each crossing pair. */
uint64_t ebpo_contact_lines_most(const ebpo_collider *collider);

/* The pair is EBPO_PAIR_CROSSING. */
void ebpo_contact_of(const ebpo_posed_pair *faces, const ebpo_face_pair *pair,
                     ebpo_contact_segment *out);

#endif
