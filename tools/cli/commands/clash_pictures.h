/* Draws pictures of scenes, with intersecting faces in red. In builds without libpng the functions
 * have no effect. */
#ifndef EBPO_TOOLS_CLASH_PICTURES_H
#define EBPO_TOOLS_CLASH_PICTURES_H

#include "cli/commands/clash_list.h"

/* Returns NULL if this build can draw pictures, otherwise the reason as text. */
const char *clash_pictures_missing(void);

/* Draws the two instances of c->worst at the time c->time, near the contact. Sets c->picture. If
 * one instance is within the other, draws only the far side of the outer instance. */
EBPO_MUST_USE ebpo_status clash_draw(ebpo_scene *scene, clash *c, unsigned threads,
                                     ebpo_error *error);

/* A picture of the scene at several times, side by side, from one viewpoint. */
typedef struct clash_strip clash_strip;

enum { CLASH_TILES = 24 }; /* maximum number of times in a strip */

/* Makes a strip of pictures at `tiles` times, from `from` to `to`. Returns NULL if there is not
 * enough memory. */
clash_strip *clash_strip_new(ebpo_scene *scene, double from, double to, int tiles,
                             unsigned threads);
/* Adds the picture at `time`, the next time of the strip. clashes[count]: all clashes at this time.
 */
EBPO_MUST_USE ebpo_status clash_strip_add(clash_strip *strip, double time,
                                          const ebpo_scene_clash *clashes, uint64_t count,
                                          ebpo_error *error);
/* Writes a PNG file; replaces it atomically. */
EBPO_MUST_USE ebpo_status clash_strip_write(const clash_strip *strip, const char *path,
                                            ebpo_error *error);
void clash_strip_free(clash_strip *strip);

#endif
