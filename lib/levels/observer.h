/* What an observer makes of cells: how far, how large, whether seen, what is in front. */
#ifndef EBPO_LEVELS_OBSERVER_H
#define EBPO_LEVELS_OBSERVER_H

#include <ebpo/view.h>

#include "geometry/cell.h"
#include "geometry/octcode.h"

/* Made ready. Lengths are in units of about the root cell's longest side (a power of two of the
 * model's unit), so that squares neither overflow nor vanish. */
typedef struct ebpo_viewpoint {
    bool given, everywhere;
    double eye[3]; /* the model's unit */
    double unit;   /* of the model's units in one */
    double focal;  /* pixels of the length 1 at the distance 1 */
    /* normals of the frustum's walls, all through the eye, and of the plane through the eye that
     * faces the picture */
    double inward[5][3];
    double diagonal2[EBPO_LEVELS_MAX]; /* squared, of a level's cells */
} ebpo_viewpoint;

/* `observer` may be NULL. EBPO_E_ARGUMENT: one that makes no sense. */
EBPO_MUST_USE ebpo_status ebpo_viewpoint_make(ebpo_viewpoint *out, const ebpo_box *box,
                                              const ebpo_observer *observer, ebpo_error *error);

typedef struct ebpo_seen {
    double distance2; /* squared, from the eye to the cell's nearest point */
    bool seen;
} ebpo_seen;
ebpo_seen ebpo_viewpoint_see(const ebpo_viewpoint *viewpoint, const ebpo_box *box, ebpo_cell cell);

/* In the model's unit; in pixels. */
double ebpo_viewpoint_distance(const ebpo_viewpoint *viewpoint, double distance2);
double ebpo_viewpoint_pixels(const ebpo_viewpoint *viewpoint, int level, double distance2);

/* The octant of the cell in which the eye is, or beyond which it is. A child o is in no ray's way
 * to a child p when o ^ this has a bit that p ^ this has not. */
unsigned ebpo_viewpoint_octant(const ebpo_viewpoint *viewpoint, const ebpo_box *box,
                               ebpo_cell cell);

/* Place in the order of the priority: the least comes first. For two cells of which none contains
 * the other. */
uint64_t ebpo_viewpoint_key(const ebpo_viewpoint *viewpoint, const ebpo_box *box,
                            ebpo_priority priority, ebpo_octcode octcode, double distance2);

#endif
