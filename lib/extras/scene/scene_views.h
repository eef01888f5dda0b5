/* What of each file the scene's cameras can see. */
#ifndef EBPO_SCENE_SCENE_VIEWS_H
#define EBPO_SCENE_SCENE_VIEWS_H

#include "extras/scene/scene_needs.h"

EBPO_MUST_USE ebpo_status scene_add_views(scene_needs *needs);

#endif
