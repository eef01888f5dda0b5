/* Draws a small picture of a model. */
#ifndef EBPO_TOOLS_THUMBNAIL_H
#define EBPO_TOOLS_THUMBNAIL_H

#include <ebpo/ebpo.h>

/* Draws the model as a PNG in memory, which the caller frees. Draws the mesh if it is small,
 * otherwise the simplified surface if there is one, otherwise the envelopes of a level.
 * `max_expansion`: as in remote_values. */
EBPO_MUST_USE ebpo_status thumbnail_draw(const char *path, int64_t max_expansion, int width,
                                         int height, void **png, size_t *size, ebpo_error *error);

#endif
