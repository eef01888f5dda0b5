/* Which of a mesh's attributes are colours, and these as bytes. */
#include "core/strict_fp.h"

#include <ebpo/colours.h>

#include <stdlib.h>
#include <string.h>

#include "mesh/colour_columns.h"
#include "core/alloc.h"
#include "core/error.h"

enum { CHANNELS = EBPO_COLOUR_CHANNELS };

static ebpo_status make(uint8_t **out, const ebpo_attributes *from, const char *element,
                        uint64_t count, ebpo_error *error)
{
    ebpo_colour_column channels[CHANNELS];
    *out = NULL;
    if (!ebpo_colour_columns(from, element, channels))
        return EBPO_OK;
    uint8_t *rgba = ebpo_alloc(count ? count : 1, CHANNELS);
    if (!rgba)
        return ebpo_fail_memory(error, count * CHANNELS);
    memset(rgba, 255, count * CHANNELS);
    for (int k = 0; k < CHANNELS; k++)
        for (uint64_t i = 0; channels[k].of && i < count && i < channels[k].of->rows; i++)
            rgba[CHANNELS * i + (unsigned)k] = ebpo_colour_byte(&channels[k], i);
    *out = rgba;
    return EBPO_OK;
}

static bool all_the_same(const uint8_t *rgba, uint64_t count)
{
    return count < 2 || memcmp(rgba, rgba + CHANNELS, (count - 1) * CHANNELS) == 0;
}

ebpo_status ebpo_mesh_colours(const ebpo_mesh *mesh, ebpo_colours *out, ebpo_error *error)
{
    memset(out, 0, sizeof *out);
    ebpo_status status = make(&out->vertex, mesh->attributes, "vertex", mesh->vertex_count, error);
    if (status == EBPO_OK)
        status = make(&out->face, mesh->attributes, "face", mesh->face_count, error);
    if (status != EBPO_OK)
        ebpo_colours_free(out);
    out->by_face = out->face && (!out->vertex || all_the_same(out->vertex, mesh->vertex_count));
    return status;
}

void ebpo_colours_free(ebpo_colours *colours)
{
    if (!colours)
        return;
    free(colours->vertex);
    free(colours->face);
    memset(colours, 0, sizeof *colours);
}
