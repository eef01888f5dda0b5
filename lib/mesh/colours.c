/* Reads colours of vertices or faces from a mesh's attributes: finds colour properties by the names
 * that PLY files use, and converts values to RGBA bytes. Used for exports, images and mean colours
 * of gray nodes. */
#include "core/strict_fp.h"

#include <stdlib.h>
#include <string.h>

#include <ebpo/colours.h>

#include "core/alloc.h"
#include "core/error.h"
#include "mesh/attributes.h"

static ebpo_colour_column find_colour_column(const ebpo_attributes *in, const char *element,
                                             const char *name)
{
    size_t length = strlen(name);
    for (uint64_t i = 0; i < in->count; i++) {
        const ebpo_attribute *a = &in->array[i];
        if (a->list != EBPO_ATTRIBUTE_NO_LIST || !a->values || !ebpo_attribute_is_of(a, element))
            continue;
        uint32_t column = 0;
        for (const char *at = a->names; *at; column++) {
            size_t n = strcspn(at, " ");
            if (n == length && memcmp(at, name, n) == 0)
                return (ebpo_colour_column){ a, column };
            at += n + (at[n] == ' ');
        }
    }
    return (ebpo_colour_column){ NULL, 0 };
}

bool ebpo_colour_columns(const ebpo_attributes *in, const char *element,
                         ebpo_colour_column out[EBPO_COLOUR_CHANNELS])
{
    static const char *const names[][EBPO_COLOUR_CHANNELS] = {
        { "red", "green", "blue", "alpha" },
        { "diffuse_red", "diffuse_green", "diffuse_blue", "diffuse_alpha" },
    };
    for (unsigned set = 0; in && set < sizeof names / sizeof *names; set++) {
        for (int k = 0; k < EBPO_COLOUR_CHANNELS; k++)
            out[k] = find_colour_column(in, element, names[set][k]);
        if (out[0].of && out[1].of && out[2].of)
            return true;
    }
    return false;
}

/* Converts a value from the range [0, full] to a byte from 0 to 255. */
static uint8_t byte_of(double value, double full)
{
    double scaled = value / full * 255;
    return scaled >= 255 ? 255 : scaled > 0 ? (uint8_t)(scaled + 0.5) : 0; /* NaN gives 0 */
}

/* Reads a value of this type at `from`, and returns it as a byte. */
#define VALUE_AS(type, full)                 \
    {                                        \
        type value;                          \
        memcpy(&value, from, sizeof value);  \
        return byte_of((double)value, full); \
    }

uint8_t ebpo_colour_byte(const ebpo_colour_column *c, uint64_t row)
{
    const uint8_t *from = c->of->values + row * ebpo_attribute_row_bytes(c->of) +
                          (uint64_t)c->column * ebpo_attribute_bytes(c->of->type);
    switch (c->of->type) {
    case EBPO_ATTRIBUTE_INT8: VALUE_AS(int8_t, 255)
    case EBPO_ATTRIBUTE_UINT8: return *from;
    case EBPO_ATTRIBUTE_INT16: VALUE_AS(int16_t, 255)
    case EBPO_ATTRIBUTE_UINT16: VALUE_AS(uint16_t, 65535)
    case EBPO_ATTRIBUTE_INT32: VALUE_AS(int32_t, 255)
    case EBPO_ATTRIBUTE_UINT32: VALUE_AS(uint32_t, 255)
    case EBPO_ATTRIBUTE_FLOAT32: VALUE_AS(float, 1)
    case EBPO_ATTRIBUTE_FLOAT64: VALUE_AS(double, 1)
    }
    return 0;
}

bool ebpo_attributes_coloured(const ebpo_attributes *in)
{
    ebpo_colour_column column[EBPO_COLOUR_CHANNELS];
    return ebpo_colour_columns(in, "vertex", column) || ebpo_colour_columns(in, "face", column);
}

enum { CHANNELS = EBPO_COLOUR_CHANNELS };

static ebpo_status make_colours(uint8_t **out, const ebpo_attributes *from, const char *element,
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

/* Returns true if all colours are equal. */
static bool all_the_same(const uint8_t *rgba, uint64_t count)
{
    return count < 2 || memcmp(rgba, rgba + CHANNELS, (count - 1) * CHANNELS) == 0;
}

ebpo_status ebpo_mesh_colours(const ebpo_mesh *mesh, ebpo_colours *out, ebpo_error *error)
{
    memset(out, 0, sizeof *out);
    ebpo_status status =
        make_colours(&out->vertex, mesh->attributes, "vertex", mesh->vertex_count, error);
    if (status == EBPO_OK)
        status = make_colours(&out->face, mesh->attributes, "face", mesh->face_count, error);
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
