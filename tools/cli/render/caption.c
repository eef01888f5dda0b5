/* Draws captions with cairo. cairo computes how much of each pixel the text covers, and this
 * coverage mixes the colour of the text into the picture. */
#include "ebpo_config.h"

#include "cli/render/picture.h"

#if EBPO_HAVE_CAIRO

#include <cairo.h>
#include <dlfcn.h>
#include <math.h>
#include <stdio.h>
#include <string.h>

#if defined __SANITIZE_ADDRESS__
/* fontconfig keeps some patterns until the end of the process; leak checks must not report them. */
#define EXPORTED __attribute__((visibility("default")))
EXPORTED const char *__lsan_default_suppressions(void);
EXPORTED const char *__lsan_default_options(void);
const char *__lsan_default_suppressions(void) { return "leak:libfontconfig"; }
const char *__lsan_default_options(void) { return "print_suppressions=0"; }
#endif

/* Functions of cairo. cairo needs fifteen libraries. It is loaded when the first caption is drawn,
 * so that other commands do not load these libraries. */
#define CAIRO_FUNCTIONS(X)      \
    X(image_surface_create)     \
    X(image_surface_get_data)   \
    X(image_surface_get_stride) \
    X(surface_flush)            \
    X(surface_destroy)          \
    X(create)                   \
    X(destroy)                  \
    X(select_font_face)         \
    X(set_font_size)            \
    X(text_extents)             \
    X(move_to)                  \
    X(status)                   \
    X(show_text)

static struct {
#define MEMBER(name) __typeof__(&cairo_##name) name;
    CAIRO_FUNCTIONS(MEMBER)
#undef MEMBER
} lib;

/* UNTRIED: cairo has not been needed yet. MISSING: cairo is not installed, and captions are
 * omitted. FAILED: cairo is installed but could not be loaded. This is an error, because the
 * picture would lack its captions. */
static enum { UNTRIED, LOADED, MISSING, FAILED } loaded;

static void load_cairo(void)
{
    if (loaded != UNTRIED)
        return;
    void *library = dlopen("libcairo.so.2", RTLD_NOW | RTLD_LOCAL);
    const char *why = library ? NULL : dlerror();
    loaded = library ? LOADED : why && strstr(why, "No such file") ? MISSING : FAILED;
#define FIND(name)                                                         \
    *(void **)&lib.name = library ? dlsym(library, "cairo_" #name) : NULL; \
    if (library && !lib.name)                                              \
        loaded = MISSING; /* this version of cairo lacks the function */
    CAIRO_FUNCTIONS(FIND)
#undef FIND
}

bool picture_has_captions(void)
{
    load_cairo();
    return loaded != MISSING;
}

/* Returns a surface with the coverage of the text. *success: false if there is not enough memory.
 */
static cairo_surface_t *text_coverage(int width, int height, const char *text, bool *success)
{
    cairo_surface_t *surface = lib.image_surface_create(CAIRO_FORMAT_A8, width, height);
    cairo_t *cairo = lib.create(surface);
    cairo_text_extents_t extents;
    double size = 0.64 * height;
    lib.select_font_face(cairo, "sans-serif", CAIRO_FONT_SLANT_NORMAL, CAIRO_FONT_WEIGHT_NORMAL);
    lib.set_font_size(cairo, size);
    lib.text_extents(cairo, text, &extents);
    if (extents.x_advance > 0.96 * width) { /* reduces the size so that the text fits */
        lib.set_font_size(cairo, size * 0.96 * width / extents.x_advance);
        lib.text_extents(cairo, text, &extents);
    }
    /* the text begins at a whole pixel; the baseline does not depend on the letters */
    lib.move_to(cairo, floor((width - extents.x_advance) / 2), floor(0.72 * height));
    lib.show_text(cairo, text);
    *success = lib.status(cairo) == CAIRO_STATUS_SUCCESS;
    lib.destroy(cairo);
    lib.surface_flush(surface);
    return surface;
}

static ebpo_status no_memory(const char *what, ebpo_error *error)
{
    snprintf(error->message, sizeof error->message, "%s", what);
    return error->status = EBPO_E_MEMORY;
}

ebpo_status picture_caption(picture *p, int x, int y, int width, int height,
                            const uint8_t colour[3], const char *text, ebpo_error *error)
{
    bool success = false;
    load_cairo();
    if (loaded == MISSING)
        return EBPO_OK;
    if (loaded == FAILED)
        return no_memory("libcairo, which draws captions, cannot be loaded: there is not enough "
                         "memory, or the library is damaged",
                         error);
    cairo_surface_t *surface = text_coverage(width, height, text, &success);
    const unsigned char *row = success ? lib.image_surface_get_data(surface) : NULL;
    success = row != NULL;
    for (int j = 0; row && j < height; j++, row += lib.image_surface_get_stride(surface))
        for (int i = 0; i < width; i++) {
            uint8_t *rgb = p->rgb + 3 * ((size_t)(y + j) * (size_t)p->width + (size_t)(x + i));
            for (int k = 0; k < 3; k++)
                rgb[k] = (uint8_t)((rgb[k] * (255 - row[i]) + colour[k] * row[i] + 127) / 255);
        }
    lib.surface_destroy(surface);
    return success ? EBPO_OK : no_memory("out of memory for a picture's captions", error);
}

#else

bool picture_has_captions(void) { return false; }

ebpo_status picture_caption(picture *p, int x, int y, int width, int height,
                            const uint8_t colour[3], const char *text, ebpo_error *error)
{
    (void)p;
    (void)x;
    (void)y;
    (void)width;
    (void)height;
    (void)colour;
    (void)text;
    (void)error;
    return EBPO_OK;
}

#endif
