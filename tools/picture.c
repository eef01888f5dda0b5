#include "picture.h"

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

ebpo_status picture_write_png(const picture *p, const char *path, ebpo_error *error)
{
    png_image image;
    memset(&image, 0, sizeof image);
    image.version = PNG_IMAGE_VERSION;
    image.width = (png_uint_32)p->width;
    image.height = (png_uint_32)p->height;
    image.format = PNG_FORMAT_RGB;
    png_alloc_size_t size = PNG_IMAGE_PNG_SIZE_MAX(image);
    void *bytes = malloc(size);
    ebpo_status status = EBPO_E_MEMORY;
    if (!bytes)
        snprintf(error->message, sizeof error->message, "%s: no memory for %zu bytes; take a smaller --size", path,
                 (size_t)size);
    else if (!png_image_write_to_memory(&image, bytes, &size, 0, p->rgb, 0, NULL))
        snprintf(error->message, sizeof error->message, "%s: libpng cannot encode the picture: %s", path,
                 image.message);
    else
        status = ebpo_write_file(path, bytes, size, error);
    error->status = status;
    png_image_free(&image);
    free(bytes);
    return status;
}
