/* How far a place is from a face, fast, and what a moving ball and a face are to each other. */
#ifndef EBPO_HAPTIC_FACE_NEAR_H
#define EBPO_HAPTIC_FACE_NEAR_H

#include <stdbool.h>

typedef struct ebpo_face_near {
    double distance;
    double away[3];   /* unit vector from the nearest point of the face; 0 at distance 0 */
    double weight[3]; /* of the corners at the nearest point */
} ebpo_face_near;

/* In doubles: right within some ulps of the coordinates. */
void ebpo_face_nearest(const double p[3], const double face[3][3], ebpo_face_near *out);

typedef struct ebpo_ball_way {
    const double *from, *way; /* [3] */
    double reach, band;       /* the ball's radius; it touches if it is that much farther away */
    /* Going towards a face by less than this over the whole way is none; the least where the ball
     * is closer than its radius already. */
    double slack, least_slack;
} ebpo_ball_way;

/* The part 0 to 1 of the way at which the ball comes to touch the face, or a little less; 2 if it
 * does not. `away` as above there. */
double ebpo_ball_meets(const ebpo_ball_way *w, const double face[3][3], double away[3]);

/* False: the closed segment and the closed face have certainly no common point. True: they have
 * one, or numbers are so large or small that only integers of any size could tell. Faces without
 * area have none. No memory is taken. */
bool ebpo_segment_may_meet(const double p[3], const double q[3], const double face[3][3]);

/* How the winding number changes from p to q through the face: 1 from outside to inside, -1 back,
 * 0: they have no common point. EBPO_CROSSES_BADLY: through an edge, a corner, from or to the
 * face's plane, or perhaps not at all. No memory is taken. */
enum { EBPO_CROSSES_BADLY = 2 };
int ebpo_segment_crosses(const double p[3], const double q[3], const double face[3][3]);

#endif
