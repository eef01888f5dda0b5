/* A node's cell in the model: lengths are in units of a power of two near the cell's longest side,
 * so that nothing overflows or vanishes. */
#ifndef EBPO_DERIVE_FRAME_H
#define EBPO_DERIVE_FRAME_H

#include "geometry/cell.h"
#include "geometry/polytope.h"

typedef struct ebpo_cell_frame {
    ebpo_cell cell;
    int exponent;                    /* the unit is 2^exponent in the model's */
    double factor[2];                /* 2^-exponent in two steps, as one may not hold it */
    double low[3], high[3], size[3]; /* of the cell, in the model's unit */
    double side[3];                  /* of the cell, in ours */
    /* what rounding of coordinates may move a point or change a distance, in ours */
    double grain;
} ebpo_cell_frame;

void ebpo_cell_frame_make(ebpo_cell_frame *out, const ebpo_box *box, ebpo_cell cell);

/* From cell coordinates to the model's: rounded by less than the grain. */
void ebpo_cell_frame_point(const ebpo_cell_frame *f, const double xi[3], double out[3]);

/* A length of the model in our unit, and back (rounded up). INFINITY stays. */
double ebpo_cell_frame_length(const ebpo_cell_frame *f, double length);
double ebpo_cell_frame_model_length(const ebpo_cell_frame *f, double length);

/* At least the distance of two points given in cell coordinates, in our unit. */
double ebpo_cell_frame_apart(const ebpo_cell_frame *f, const double a[3], const double b[3]);

/* At least the distance of every point of the cell, or of one `levels` below, to a face that it is
 * known to touch or nearly so (format-spec, section 5). */
double ebpo_cell_frame_diagonal(const ebpo_cell_frame *f, int levels);

/* At least the distance of a point (cell coordinates) to a triangle of the model, in our unit. */
double ebpo_cell_frame_distance(const ebpo_cell_frame *f, const double xi[3],
                                const double triangle[3][3]);

/* A triangle of the model in cell coordinates; returns a bound on their error. */
double ebpo_cell_frame_triangle(const ebpo_cell_frame *f, const double triangle[3][3],
                                double out[3][3]);

#endif
