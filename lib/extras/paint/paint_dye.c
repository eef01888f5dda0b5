/* Colours as a mesh's own: where they are already, in their types. */
#include "core/strict_fp.h"

#include <ebpo/colours.h>
#include <ebpo/paint.h>

#include <stdio.h>
#include <string.h>

#include "mesh/attributes.h"
#include "core/error.h"

/* The inverse of ebpo_colour_byte. */
static void put_byte(const ebpo_colour_column *c, uint64_t row, uint8_t value)
{
    uint8_t *to = c->of->values + row * ebpo_attribute_row_bytes(c->of) +
                  (uint64_t)c->column * ebpo_attribute_bytes(c->of->type);
    const uint16_t full = (uint16_t)(257 * value), two = value;
    const uint32_t four = value;
    const float share = (float)(value / 255.0);
    const double exact = value / 255.0;
    switch (c->of->type) {
    case EBPO_ATTRIBUTE_INT8: *to = value < 127 ? value : 127; break; /* the most it holds */
    case EBPO_ATTRIBUTE_UINT8: *to = value; break;
    case EBPO_ATTRIBUTE_INT16: memcpy(to, &two, sizeof two); break;
    case EBPO_ATTRIBUTE_UINT16: memcpy(to, &full, sizeof full); break;
    case EBPO_ATTRIBUTE_INT32:
    case EBPO_ATTRIBUTE_UINT32: memcpy(to, &four, sizeof four); break;
    case EBPO_ATTRIBUTE_FLOAT32: memcpy(to, &share, sizeof share); break;
    case EBPO_ATTRIBUTE_FLOAT64: memcpy(to, &exact, sizeof exact); break;
    }
}

/* Three new properties of all vertices. */
static ebpo_status add_colours(ebpo_mesh *mesh, const uint8_t *rgba, ebpo_error *error)
{
    ebpo_attribute like = { .element = "vertex",
                            .names = "red green blue",
                            .type = EBPO_ATTRIBUTE_UINT8,
                            .list = EBPO_ATTRIBUTE_NO_LIST,
                            .columns = 3,
                            .rows = mesh->vertex_count };
    if (!mesh->attributes)
        mesh->attributes = ebpo_attributes_make(mesh->workspace);
    if (mesh->attributes && mesh->attributes->count >= EBPO_ATTRIBUTE_ARRAYS)
        return ebpo_fail(error, EBPO_E_ARGUMENT,
                         "the mesh has so many attributes that no more fit; leave some out");
    ebpo_attribute *a = mesh->attributes ? ebpo_attributes_add(mesh->attributes, &like) : NULL;
    if (a && !ebpo_attribute_reserve(mesh->attributes->workspace, a, mesh->vertex_count, 0)) {
        ebpo_attributes_remove(mesh->attributes, mesh->attributes->count - 1);
        a = NULL;
    }
    if (!a)
        return ebpo_fail_memory(error, 3 * mesh->vertex_count);
    for (uint64_t i = 0; i < mesh->vertex_count; i++)
        memcpy(a->values + 3 * i, rgba + 4 * i, 3);
    return EBPO_OK;
}

ebpo_status ebpo_paint_dye_mesh(ebpo_mesh *mesh, const uint8_t *rgba, ebpo_error *error)
{
    ebpo_colour_column channels[EBPO_COLOUR_CHANNELS];
    if (!ebpo_colour_columns(mesh->attributes, "vertex", channels))
        return add_colours(mesh, rgba, error);
    for (int k = 0; k < 3; k++)
        for (uint64_t i = 0; i < mesh->vertex_count && i < channels[k].of->rows; i++)
            if (ebpo_colour_byte(&channels[k], i) != rgba[4 * i + (unsigned)k])
                put_byte(&channels[k], i, rgba[4 * i + (unsigned)k]);
    return EBPO_OK;
}
