/* Poses and routes in a scene file. */
#ifndef EBPO_SCENE_JSON_ROUTES_H
#define EBPO_SCENE_JSON_ROUTES_H

#include "extras/scene/json_reader.h"

/* *out stays where the member is missing. */
EBPO_MUST_USE ebpo_status json_read_pose(json_reader *r, const json_t *object, const char *key,
                                         ebpo_pose *out);
/* For json_each_member. */
ebpo_status json_read_route(json_reader *r, const char *name, const json_t *value);

#endif
