/* What is told of two instances whose faces meet: which pairs of faces, where, how often, how deep.
 */
#ifndef EBPO_SCENE_MEETING_FACTS_H
#define EBPO_SCENE_MEETING_FACTS_H

#include <ebpo/collide.h>
#include <ebpo/scene.h>

/* Two instances at their poses. */
typedef struct scene_two {
    const ebpo_scene_ask_options *how;
    ebpo_collider *collider;
    const ebpo_collide_options *options;
    bool solid[2];
} scene_two;

/* Nothing that was asked for is known yet. */
void scene_forget_facts(ebpo_scene_meeting *m);

/* `first`: as ebpo_collide_first gives it. Sets faces, numbers of pairs, contacts and place. */
EBPO_MUST_USE ebpo_status scene_tell_contacts(const scene_two *two, const ebpo_face_pair *first,
                                              ebpo_scene_meeting *m, ebpo_error *error);

/* Faces, distance and place of the nearest pair. */
void scene_tell_nearest(const scene_two *two, const ebpo_clearance *nearest, ebpo_scene_meeting *m);

/* What is inside which. */
EBPO_MUST_USE ebpo_status scene_tell_depths(const scene_two *two, ebpo_scene_meeting *m,
                                            ebpo_error *error);

#endif
