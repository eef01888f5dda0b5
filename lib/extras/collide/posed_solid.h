/* Models at poses: their extent, and on which side of a solid a point of the world is, exact on
 * posed coordinates. Proofs: docs/develop/booleans.md. Solids are not changed: any thread may use
 * them, each with its own context. */
#ifndef EBPO_COLLIDE_POSED_SOLID_H
#define EBPO_COLLIDE_POSED_SOLID_H

#include <gmp.h>
#include <math.h>

#include "geometry/pose.h"
#include "query/query_model.h"

/* No vertex of the model is beyond these coordinates, in size. */
void ebpo_model_reach(const ebpo_model *model, double reach[3]);

/* No posed coordinate of its vertices is greater in size. */
double ebpo_posed_reach(const ebpo_posing *posing, const double reach[3]);

/* One file, or two of the same content: the same faces, and the same is meant by them. */
bool ebpo_same_model(const ebpo_model *a, const ebpo_model *b);

typedef struct ebpo_posed_solid {
    ebpo_model *model;
    ebpo_posing posing;
    double rotation[3][3];
    double box[6]; /* low and high: no posed vertex is beyond */
    double moved;  /* posed vertices are at most so far from where the true motion has them */
} ebpo_posed_solid;

/* Of a surface too, which nobody may ask for winding numbers then. EBPO_E_ARGUMENT: a pose;
 * EBPO_E_ABSENT: a model without its mesh. */
EBPO_MUST_USE ebpo_status ebpo_posed_solid_make(ebpo_posed_solid *out, ebpo_model *model,
                                                const ebpo_pose *pose, ebpo_error *error);

/* False: w is certainly outside, beyond the box by more than `margin` (0 or more) on an axis. */
bool ebpo_posed_solid_near(const ebpo_posed_solid *s, const double w[3], double margin);

/* Returns the greatest gap between two boxes on an axis: above 0 where they are apart. */
static inline double ebpo_box_gap(const double a_low[3], const double a_high[3],
                                  const double b_low[3], const double b_high[3])
{
    double most = -INFINITY;
    for (int k = 0; k < 3; k++)
        most = fmax(most, fmax(a_low[k] - b_high[k], b_low[k] - a_high[k]));
    return most;
}

/* The point in the model's coordinates that the true motion brings to w, and *doubt: that point is
 * within it of p, and so is what rounding has moved. If no face of the model is within *doubt of p,
 * the posed model has at w the winding number that the model has at p. */
void ebpo_unpose(const ebpo_posed_solid *s, const double w[3], double p[3], double *doubt);

/* The box, in the model, of all faces that may have a point of the box between a and b
 * (corners of it, in any order) when posed. */
void ebpo_unpose_box(const ebpo_posed_solid *s, const double a[3], const double b[3], double low[3],
                     double high[3]);

/* Around a point of the world. */
typedef struct ebpo_posed_sides {
    bool on;            /* a posed face with an area goes through it */
    bool flat;          /* and all such faces have one plane */
    double plane[3][3]; /* on: corners of one of them */
    /* Winding numbers close to the point: on the side that is greater in x, or if the plane is
     * parallel to the x axis in y, or else in z, and on the other one. Equal unless `on`. If on and
     * not flat, `above` alone is right, somewhere near the point. */
    int32_t above, below;
} ebpo_posed_sides;

EBPO_MUST_USE ebpo_status ebpo_posed_solid_sides(const ebpo_posed_solid *s, ebpo_context *context,
                                                 const double w[3], ebpo_posed_sides *out,
                                                 ebpo_error *error);

/* The winding number at x, whose coordinates are canonical fractions no farther than doubles reach,
 * shifted by (d0, d1, d2) as in ebpo_axis_crossing: never on a face. */
EBPO_MUST_USE ebpo_status ebpo_exact_winding(const ebpo_posed_solid *s, ebpo_context *context,
                                             const mpq_t x[3], int32_t *winding, ebpo_error *error);

#endif
