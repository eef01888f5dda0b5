#include "extras/paint/paint_columns.h"

#include <stddef.h>
#include <string.h>

#include "core/endian.h"

#define OF_STROKES(path, element, cols, member)                                    \
    {                                                                              \
        "/strokes/" path, element, cols, false, offsetof(ebpo_stroke_held, member) \
    }
#define OF_POINTS(path, element, cols, member)                                   \
    {                                                                            \
        "/points/" path, element, cols, true, offsetof(ebpo_paint_point, member) \
    }

const ebpo_paint_column ebpo_paint_columns[EBPO_PAINT_COLUMNS] = {
    OF_STROKES("layer", 4, 0, layer),      OF_STROKES("kind", 4, 0, kind),
    OF_STROKES("colour", 1, 4, rgba),      OF_STROKES("radius", 8, 0, radius),
    OF_STROKES("time", 8, 0, time),        OF_STROKES("points", 4, 0, count),
    OF_POINTS("face", 4, 0, face),         OF_POINTS("weights", 4, 2, weight),
    OF_POINTS("place", 8, 3, place),       OF_POINTS("size", 2, 0, size),
    OF_POINTS("pressure", 2, 0, pressure), OF_POINTS("time", 4, 0, time),
};

ebpo_shape ebpo_paint_column_shape(const ebpo_paint_column *c, uint64_t rows)
{
    return (ebpo_shape){ .rows = rows,
                         .cols = c->cols,
                         .chunk_rows = (uint32_t)rows,
                         .element_size = c->element,
                         .pipeline = EBPO_PIPELINE_CHECKSUM };
}

/* The member in a row. */
static uint8_t *member_of(const ebpo_paint *p, const ebpo_paint_column *c, uint64_t row)
{
    uint8_t *rows = c->of_points ? (uint8_t *)p->point : (uint8_t *)p->stroke;
    return rows + row * (c->of_points ? sizeof *p->point : sizeof *p->stroke) + c->offset;
}

static void take_value(const uint8_t *from, unsigned bytes, uint8_t *to)
{
    const uint16_t two = bytes == 2 ? ebpo_load16(from) : 0;
    const uint32_t four = bytes == 4 ? ebpo_load32(from) : 0;
    const uint64_t eight = bytes == 8 ? ebpo_load64(from) : 0;
    memcpy(to,
           bytes == 1   ? (const void *)from
           : bytes == 2 ? (const void *)&two
           : bytes == 4 ? (const void *)&four
                        : (const void *)&eight,
           bytes);
}

static unsigned values_of(const ebpo_paint_column *c) { return c->cols ? c->cols : 1; }

void ebpo_paint_column_take(ebpo_paint *p, const ebpo_paint_column *c, const uint8_t *bytes)
{
    for (uint64_t row = 0; row < ebpo_paint_column_rows(p, c); row++)
        for (unsigned k = 0; k < values_of(c); k++, bytes += c->element)
            take_value(bytes, c->element, member_of(p, c, row) + k * c->element);
}

/* Turning bytes around is its own inverse. */
void ebpo_paint_column_give(const ebpo_paint *p, const ebpo_paint_column *c, uint8_t *bytes)
{
    for (uint64_t row = 0; row < ebpo_paint_column_rows(p, c); row++)
        for (unsigned k = 0; k < values_of(c); k++, bytes += c->element)
            take_value(member_of(p, c, row) + k * c->element, c->element, bytes);
}
