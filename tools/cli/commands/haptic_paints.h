/* Paints what a haptic device touches: a single model, or the models of a scene. Each model has its
 * paint file, which its instances share. */
#ifndef EBPO_TOOLS_HAPTIC_PAINTS_H
#define EBPO_TOOLS_HAPTIC_PAINTS_H

#include "cli/commands/haptic_paint.h"

/* Maximum number of models: each has two threads. */
enum { HAPTIC_PAINTS_MAX = 64 };

/* A model that can be painted. */
typedef struct haptic_surface {
    const char *name;  /* in the scene; NULL: a single model */
    const char *paint; /* path of its paint file */
    const ebpo_file *file;
    ebpo_model *model;
} haptic_surface;

typedef struct haptic_paints haptic_paints;

/* Opens the paint files of all surfaces, see haptic_paint_open. pen: for all; its path, name,
 * diagonal and undone are not used. of: [instances of the scene] index of the surface of each
 * instance; NULL: there is one surface. All arguments must outlive the object. */
ebpo_status haptic_paints_open(haptic_paints **out, const haptic_pen *pen,
                               const haptic_surface *surfaces, uint64_t count, const uint64_t *of,
                               ebpo_error *error);

/* Paints in these steps: a haptic_live_fn, whose `user` is a haptic_paints. */
void haptic_paints_take(void *user, const haptic_sample *samples, uint64_t count);

/* What a page of the viewer has. The caller frees it. Returns NULL without memory. */
haptic_paint_cursor *haptic_paints_cursor(const haptic_paints *paints);

/* Writes the news of all models, see haptic_paint_write_news. */
void haptic_paints_write_news(haptic_paints *paints, haptic_paint_cursor *cursor, FILE *out);

/* Does the command for all models, see haptic_paint_command; "undo" for the model that was touched
 * last. With several models, "layer" is refused: their files have different layers. */
bool haptic_paints_command(haptic_paints *paints, const char *text);

/* Saves the rest, and frees the object, which may be NULL. Adds up the results. Returns the first
 * error, see haptic_paint_close. */
ebpo_status haptic_paints_close(haptic_paints *paints, haptic_painted *out, ebpo_error *error);

#endif
