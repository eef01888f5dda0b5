/* Pictures of scenes, faces that meet red. In builds without libpng all of it does nothing. */
#ifndef EBPO_TOOLS_CLASH_PICTURES_H
#define EBPO_TOOLS_CLASH_PICTURES_H

#include "cli/commands/clash_list.h"

/* NULL, or why there are none. */
const char *clash_pictures_missing(void);

/* Two instances where and when they clash worst: sets `picture`. Of one within another the outer
 * one's far side. */
EBPO_MUST_USE ebpo_status clash_draw(ebpo_scene *scene, clash *c, unsigned threads,
                                     ebpo_error *error);

/* The scene at several times, side by side, from one place. */
typedef struct clash_strip clash_strip;

enum { CLASH_TILES = 24 };

/* Of `tiles` times from .. to. NULL: no memory. */
clash_strip *clash_strip_new(ebpo_scene *scene, double from, double to, int tiles,
                             unsigned threads);
EBPO_MUST_USE ebpo_status clash_strip_add(clash_strip *strip, double time,
                                          const ebpo_scene_meeting *meetings, uint64_t count,
                                          ebpo_error *error);
/* As a PNG file, whole or not at all. */
EBPO_MUST_USE ebpo_status clash_strip_write(const clash_strip *strip, const char *path,
                                            ebpo_error *error);
void clash_strip_free(clash_strip *strip);

#endif
