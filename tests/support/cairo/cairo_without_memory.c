/* Replaces libcairo.so.2, and draws nothing. The environment variable EBPO_TEST_CAIRO=drawing or
 * surface selects the call that runs out of memory. Without the variable no call fails. */
#include <cairo.h>
#include <stdbool.h>
#include <stdlib.h>
#include <string.h>

static int surface_width;
static unsigned char *surface_bytes;

static bool lacks(const char *what)
{
    const char *reported = getenv("EBPO_TEST_CAIRO");
    return reported && strcmp(reported, what) == 0;
}

#pragma GCC visibility push(default) /* the project's own symbols are hidden */

cairo_surface_t *cairo_image_surface_create(cairo_format_t format, int width, int height)
{
    (void)format;
    surface_width = width;
    surface_bytes = calloc((size_t)width, (size_t)height);
    return (cairo_surface_t *)&surface_width;
}

unsigned char *cairo_image_surface_get_data(cairo_surface_t *surface)
{
    (void)surface;
    return lacks("surface") ? NULL : surface_bytes;
}

int cairo_image_surface_get_stride(cairo_surface_t *surface)
{
    (void)surface;
    return surface_width;
}

void cairo_surface_flush(cairo_surface_t *surface) { (void)surface; }

void cairo_surface_destroy(cairo_surface_t *surface)
{
    (void)surface;
    free(surface_bytes);
}

cairo_t *cairo_create(cairo_surface_t *surface) { return (cairo_t *)surface; }
void cairo_destroy(cairo_t *cairo) { (void)cairo; }

void cairo_select_font_face(cairo_t *cairo, const char *family, cairo_font_slant_t slant,
                            cairo_font_weight_t weight)
{
    (void)cairo;
    (void)family;
    (void)slant;
    (void)weight;
}

void cairo_set_font_size(cairo_t *cairo, double size)
{
    (void)cairo;
    (void)size;
}

void cairo_text_extents(cairo_t *cairo, const char *text, cairo_text_extents_t *extents)
{
    (void)cairo;
    (void)text;
    memset(extents, 0, sizeof *extents);
}

void cairo_move_to(cairo_t *cairo, double x, double y)
{
    (void)cairo;
    (void)x;
    (void)y;
}

void cairo_show_text(cairo_t *cairo, const char *text)
{
    (void)cairo;
    (void)text;
}

cairo_status_t cairo_status(cairo_t *cairo)
{
    (void)cairo;
    return lacks("drawing") ? CAIRO_STATUS_NO_MEMORY : CAIRO_STATUS_SUCCESS;
}
