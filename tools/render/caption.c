/* Captions by cairo: the text is drawn as coverage, which mixes its colour into the picture. */
#include "ebpo_config.h"

#include "render/picture.h"

#if EBPO_HAVE_CAIRO

#include <cairo.h>
#include <math.h>

#if defined __SANITIZE_ADDRESS__
/* fontconfig keeps some of its patterns to the end, and nobody else may free them. */
#define SHOWN __attribute__((visibility("default")))
SHOWN const char *__lsan_default_suppressions(void);
SHOWN const char *__lsan_default_options(void);
const char *__lsan_default_suppressions(void) { return "leak:libfontconfig"; }
const char *__lsan_default_options(void) { return "print_suppressions=0"; }
#endif

bool picture_has_captions(void) { return true; }

static cairo_surface_t *coverage(int width, int height, const char *text)
{
    cairo_surface_t *surface = cairo_image_surface_create(CAIRO_FORMAT_A8, width, height);
    cairo_t *cairo = cairo_create(surface);
    cairo_text_extents_t extents;
    double size = 0.64 * height;
    cairo_select_font_face(cairo, "sans-serif", CAIRO_FONT_SLANT_NORMAL, CAIRO_FONT_WEIGHT_NORMAL);
    cairo_set_font_size(cairo, size);
    cairo_text_extents(cairo, text, &extents);
    if (extents.x_advance > 0.96 * width) { /* as large as there is room */
        cairo_set_font_size(cairo, size * 0.96 * width / extents.x_advance);
        cairo_text_extents(cairo, text, &extents);
    }
    /* on whole pixels, and all captions on one line, whichever letters they have */
    cairo_move_to(cairo, floor((width - extents.x_advance) / 2), floor(0.72 * height));
    cairo_show_text(cairo, text);
    cairo_destroy(cairo);
    cairo_surface_flush(surface);
    return surface;
}

void picture_caption(picture *p, int x, int y, int width, int height, const uint8_t colour[3],
                     const char *text)
{
    cairo_surface_t *surface = coverage(width, height, text);
    const unsigned char *row = cairo_image_surface_get_data(surface); /* NULL: no memory */
    for (int j = 0; row && j < height; j++, row += cairo_image_surface_get_stride(surface))
        for (int i = 0; i < width; i++) {
            uint8_t *rgb = p->rgb + 3 * ((size_t)(y + j) * (size_t)p->width + (size_t)(x + i));
            for (int k = 0; k < 3; k++)
                rgb[k] = (uint8_t)((rgb[k] * (255 - row[i]) + colour[k] * row[i] + 127) / 255);
        }
    cairo_surface_destroy(surface);
}

#else

bool picture_has_captions(void) { return false; }

void picture_caption(picture *p, int x, int y, int width, int height, const uint8_t colour[3],
                     const char *text)
{
    (void)p;
    (void)x;
    (void)y;
    (void)width;
    (void)height;
    (void)colour;
    (void)text;
}

#endif
