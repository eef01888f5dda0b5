/* Computes the extent of posed models, and the winding number of a posed solid at a point of the
 * world. The winding number is exact for the posed coordinates, which are rounded to doubles.
 * Proofs: docs/develop/booleans.md. Functions do not change a posed solid: several threads may use
 * the same posed solid, each thread with a separate context. */
#ifndef EBPO_COLLIDE_POSED_SOLID_H
#define EBPO_COLLIDE_POSED_SOLID_H

#include <gmp.h>
#include <math.h>

#include "geometry/pose.h"
#include "query/query_model.h"

/* Sets max_coordinate[axis] to an upper bound of the absolute values of the vertices' coordinates
 * on the axis. */
void ebpo_model_extent(const ebpo_model *model, double max_coordinate[3]);

/* Returns an upper bound of the absolute values of the posed vertices' coordinates. max_coordinate:
 * result of ebpo_model_extent. */
double ebpo_posed_extent(const ebpo_posing *posing, const double max_coordinate[3]);

/* Returns true if both models come from files with the same content and have the same kind (solid
 * or surface) and rule. Then they have the same faces in the same order. */
bool ebpo_same_model(const ebpo_model *a, const ebpo_model *b);

/* A model at a pose. */
typedef struct ebpo_posed_solid {
    ebpo_model *model;
    ebpo_posing posing;
    double rotation[3][3]; /* rotation of the pose, without its scale */
    double box[6]; /* the low corner, then the high corner of a box around all posed vertices */
    double moved;  /* bound of the distance of a posed vertex from its exact motion, which is not
                    * rounded */
} ebpo_posed_solid;

/* Makes a posed solid. The model may be a surface; then its winding numbers must not be queried.
 * Fails with EBPO_E_ARGUMENT (the pose) and EBPO_E_ABSENT (a model without its mesh). */
EBPO_MUST_USE ebpo_status ebpo_posed_solid_make(ebpo_posed_solid *out, ebpo_model *model,
                                                const ebpo_pose *pose, ebpo_error *error);

/* Returns false if w is beyond the box by more than `margin` (0 or more) on an axis. Then w is
 * certainly farther than `margin` from all posed vertices and faces. */
bool ebpo_posed_solid_near(const ebpo_posed_solid *s, const double w[3], double margin);

/* Returns the greatest of the gaps between two boxes on the three axes; negative if they overlap on
 * all axes. */
static inline double ebpo_box_gap(const double a_low[3], const double a_high[3],
                                  const double b_low[3], const double b_high[3])
{
    double most = -INFINITY;
    for (int k = 0; k < 3; k++)
        most = fmax(most, fmax(a_low[k] - b_high[k], b_low[k] - a_high[k]));
    return most;
}

/* Computes the point p, in the model's coordinates, that the exact motion maps to w. *uncertainty
 * bounds the errors of p and of the rounding of posed coordinates. If no face of the model is
 * within *uncertainty of p, the winding number of the posed model at w is equal to the winding
 * number of the model at p. */
void ebpo_unpose(const ebpo_posed_solid *s, const double w[3], double p[3], double *uncertainty);

/* Computes a box in the model's coordinates from a box of the world (the world box). A face of the
 * model intersects the computed box if the posed face may have a point in the world box. a and b
 * are opposite corners of the world box, in any order. */
void ebpo_unpose_box(const ebpo_posed_solid *s, const double a[3], const double b[3], double low[3],
                     double high[3]);

/* Winding numbers of a posed solid around a point of the world. */
typedef struct ebpo_posed_sides {
    bool on;            /* a posed face with an area contains the point */
    bool flat;          /* all posed faces that contain the point are in one plane */
    double plane[3][3]; /* if `on`: corners of a face that contains the point */
    /* Winding numbers next to the point, on both sides of the plane: `above` is the winding number
     * on the side of greater x. If the plane is parallel to the x axis, `above` is for the side of
     * greater y; if the plane is also parallel to the y axis, for the side of greater z. `below` is
     * the winding number on the other side. `above` and `below` are equal if `on` is false. If `on`
     * is true and `flat` is false, only `above` is valid: the winding number at some point next to
     * the query point. */
    int32_t above, below;
} ebpo_posed_sides;

/* Computes the winding numbers around the point w. Fails with the errors of reading. */
EBPO_MUST_USE ebpo_status ebpo_posed_solid_sides(const ebpo_posed_solid *s, ebpo_context *context,
                                                 const double w[3], ebpo_posed_sides *out,
                                                 ebpo_error *error);

/* Computes the winding number at the point x, which is shifted by the infinitesimal vector (d0, d1,
 * d2) of ebpo_axis_crossing (geometry/predicates.h), so that the shifted point is on no face. The
 * coordinates of x are canonical fractions in the range of doubles. */
EBPO_MUST_USE ebpo_status ebpo_exact_winding(const ebpo_posed_solid *s, ebpo_context *context,
                                             const mpq_t x[3], int32_t *winding, ebpo_error *error);

#endif
