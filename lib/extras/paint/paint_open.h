/* Lists the arrays of a paint file. Each array is a column: it has the values of one member of all
 * strokes, or of all points (format-spec/paint.md, section 3). */
#ifndef EBPO_PAINT_PAINT_OPEN_H
#define EBPO_PAINT_PAINT_OPEN_H

#include "extras/paint/paint_parts.h"
#include "hdf5_read/chunk.h"

typedef struct ebpo_paint_column {
    const char *path;
    uint8_t element; /* bytes of an element, in the file and in memory */
    uint8_t cols;    /* number of columns; 0: the array has one dimension */
    bool of_points;  /* true: a column of points, false: of strokes */
    size_t offset;   /* offset of the member in its struct */
} ebpo_paint_column;

enum { EBPO_PAINT_COLUMNS = 12 };
extern const ebpo_paint_column ebpo_paint_columns[EBPO_PAINT_COLUMNS];

static inline uint64_t ebpo_paint_column_rows(const ebpo_paint *p, const ebpo_paint_column *c)
{
    return c->of_points ? p->point_count : p->stroke_count;
}

/* Returns the shape of a column's array with `rows` rows (above 0), which is one chunk. */
ebpo_shape ebpo_paint_column_shape(const ebpo_paint_column *column, uint64_t rows);

/* Writes all rows of a column to `bytes` in the form in which the file stores them. */
void ebpo_paint_column_write(const ebpo_paint *paint, const ebpo_paint_column *column,
                             uint8_t *bytes);

#endif
