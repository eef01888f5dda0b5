/* Draws pictures of scenes, with intersecting faces in red. Does nothing in builds without libpng.
 */
#ifndef EBPO_TOOLS_CLASH_PICTURES_H
#define EBPO_TOOLS_CLASH_PICTURES_H

#include "cli/commands/clash_list.h"

/* Returns NULL, or why there are no pictures. */
const char *clash_pictures_missing(void);

/* Draws two instances at the time and position of their worst clash: sets `picture`. If one
 * instance is within the other, draws only the far side of the outer instance. */
EBPO_MUST_USE ebpo_status clash_draw(ebpo_scene *scene, clash *c, unsigned threads,
                                     ebpo_error *error);

/* A picture of the scene at several times, side by side, from one viewpoint. */
typedef struct clash_strip clash_strip;

enum { CLASH_TILES = 24 };

/* Makes a strip of pictures at `tiles` times, from `from` to `to`. Returns NULL if there is not
 * enough memory. */
clash_strip *clash_strip_new(ebpo_scene *scene, double from, double to, int tiles,
                             unsigned threads);
EBPO_MUST_USE ebpo_status clash_strip_add(clash_strip *strip, double time,
                                          const ebpo_scene_clash *clashes, uint64_t count,
                                          ebpo_error *error);
/* Writes a PNG file; replaces it atomically. */
EBPO_MUST_USE ebpo_status clash_strip_write(const clash_strip *strip, const char *path,
                                            ebpo_error *error);
void clash_strip_free(clash_strip *strip);

#endif
