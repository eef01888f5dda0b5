/* Makes a picture in memory (8-bit sRGB, rows from the top), draws captions, and encodes PNG. */
#ifndef EBPO_TOOLS_PICTURE_H
#define EBPO_TOOLS_PICTURE_H

#include <ebpo/base.h>

typedef struct picture {
    int width, height;
    uint8_t *rgb; /* [height][width][3] */
} picture;

/* Makes a picture of one colour. Returns false if there is not enough memory. */
bool picture_make(picture *out, int width, int height, const uint8_t colour[3]);
void picture_free(picture *p);

/* Returns true if this build can draw text (cairo); otherwise captions are omitted. */
bool picture_has_captions(void);
/* Draws text in the middle of a rectangle in the picture. EBPO_E_MEMORY: there is not enough
 * memory, or the library that draws text is installed but cannot be loaded. */
EBPO_MUST_USE ebpo_status picture_caption(picture *p, int x, int y, int width, int height,
                                          const uint8_t colour[3], const char *text,
                                          ebpo_error *error);

/* Encodes pixels as a PNG in memory, which the caller frees. pixels: [height][width][channels],
 * rows from the top. channels: 3 (RGB) or 4 (RGB and opacity), 8 bits each. what: name for
 * messages. */
EBPO_MUST_USE ebpo_status picture_encode_png(const uint8_t *pixels, int width, int height,
                                             int channels, const char *what, void **bytes,
                                             size_t *size, ebpo_error *error);

/* Returns a PNG in memory as "data:image/png;base64,...", which the caller frees. Returns NULL if
 * there is not enough memory. */
char *picture_data_uri(const uint8_t *bytes, size_t size);

/* Writes a PNG file; replaces it atomically. */
EBPO_MUST_USE ebpo_status picture_write_png(const picture *p, const char *path, ebpo_error *error);

#endif
