#include "cli/render/picture.h"

#include <png.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

bool picture_make(picture *out, int width, int height, const uint8_t colour[3])
{
    size_t pixels = (size_t)width * (size_t)height;
    *out = (picture){ width, height, malloc(3 * pixels) };
    for (size_t i = 0; out->rgb && i < pixels; i++)
        memcpy(out->rgb + 3 * i, colour, 3);
    return out->rgb != NULL;
}

void picture_free(picture *p)
{
    free(p->rgb);
    p->rgb = NULL;
}

ebpo_status picture_encode_png(const uint8_t *pixels, int width, int height, int channels,
                               const char *what, void **bytes, size_t *size, ebpo_error *error)
{
    png_image image;
    memset(&image, 0, sizeof image);
    image.version = PNG_IMAGE_VERSION;
    image.width = (png_uint_32)width;
    image.height = (png_uint_32)height;
    image.format = channels == 4 ? PNG_FORMAT_RGBA : PNG_FORMAT_RGB;
    png_alloc_size_t capacity = PNG_IMAGE_PNG_SIZE_MAX(image);
    ebpo_status status = EBPO_E_MEMORY;
    *bytes = malloc(capacity);
    if (!*bytes)
        snprintf(error->message, sizeof error->message,
                 "%s: not enough memory for %zu bytes; choose a smaller picture", what,
                 (size_t)capacity);
    else if (!png_image_write_to_memory(&image, *bytes, &capacity, 0, pixels, 0, NULL))
        snprintf(error->message, sizeof error->message, "%s: libpng cannot encode the picture: %s",
                 what, image.message);
    else
        status = EBPO_OK;
    *size = capacity;
    error->status = status;
    png_image_free(&image);
    if (status != EBPO_OK) {
        free(*bytes);
        *bytes = NULL;
    }
    return status;
}

char *picture_data_uri(const uint8_t *bytes, size_t size)
{
    static const char digits[] = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/",
                      head[] = "data:image/png;base64,";
    char *text = malloc(sizeof head + (size + 2) / 3 * 4), *at = text;
    if (!text)
        return NULL;
    memcpy(text, head, sizeof head);
    at += sizeof head - 1;
    for (size_t i = 0; i < size; i += 3) {
        uint32_t v = (uint32_t)bytes[i] << 16 | (i + 1 < size ? (uint32_t)bytes[i + 1] << 8 : 0) |
                     (i + 2 < size ? bytes[i + 2] : 0);
        for (unsigned k = 0; k < 4; k++)
            *at++ = i + k <= size ? digits[v >> (18 - 6 * k) & 63] : '=';
    }
    *at = 0;
    return text;
}

ebpo_status picture_write_png(const picture *p, const char *path, ebpo_error *error)
{
    void *bytes;
    size_t size;
    ebpo_status status =
        picture_encode_png(p->rgb, p->width, p->height, 3, path, &bytes, &size, error);
    if (status == EBPO_OK)
        status = error->status = ebpo_write_file(path, bytes, size, error);
    free(bytes);
    return status;
}
