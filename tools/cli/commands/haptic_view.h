/* Shows a haptic device in the web viewer while it moves: serves the viewer and the models on
 * loopback, and sends steps and new paint to the page. The page can also be the device. */
#ifndef EBPO_TOOLS_HAPTIC_VIEW_H
#define EBPO_TOOLS_HAPTIC_VIEW_H

#include "cli/commands/haptic_device.h"
#include "cli/commands/haptic_live.h"
#include "cli/commands/haptic_scene.h"

typedef struct haptic_view_options {
    const char *model;         /* path of the model; not used with a scene */
    const haptic_scene *scene; /* NULL: a single model */
    const char *viewer;        /* folder of the viewer; NULL: as installed */
    int64_t port, max_expansion;
    haptic_paints *paint; /* NULL: nothing is painted */
    double radius;        /* radius of the ball */
    double full_depth;    /* depth of full pressure */
    bool is_device;       /* the page is the device */
    bool is_probe;        /* the tool is a probe, without contact */
} haptic_view_options;

typedef struct haptic_view haptic_view;

/* Starts the server, prints its address on stderr, and waits up to a minute for the first page.
 * Call it before the thread of the loop gets real-time scheduling. Returns NULL after an error,
 * reported on stderr. */
haptic_view *haptic_view_begin(const haptic_view_options *options);

/* Takes steps: a haptic_live_fn, whose `user` is a haptic_view. */
void haptic_view_take(void *user, const haptic_sample *samples, uint64_t count);

/* Makes the page the device. `view` must outlive the device. */
void haptic_view_open_device(haptic_device *out, haptic_view *view);

/* Sends the rest to the pages, ends the server and frees the object, which may be NULL. */
void haptic_view_end(haptic_view *view);

#endif
