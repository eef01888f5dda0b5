/* A ray or segment, and where it meets a triangle. */
#ifndef EBPO_GEOMETRY_RAY_H
#define EBPO_GEOMETRY_RAY_H

#include <stdbool.h>

/* origin + t direction, 0 <= t <= t_max; direction is not zero; t_max >= 0 or INFINITY. */
typedef struct ebpo_segment {
    double origin[3], direction[3];
    double t_max;
} ebpo_segment;

typedef struct ebpo_ray_meeting {
    bool meets; /* the closed triangle and the ray have a common point with 0 <= t <= t_max */
    /* 1: it goes against the normal through the triangle's interior (enters), -1: with it (leaves),
     * 0: an edge, a corner, within the plane, or no area */
    int side;
    /* 1: the line goes against the normal, -1: with it, wherever it meets the triangle; 0: within
     * the plane, or no area */
    int facing;
    double t; /* of the first common point, correctly rounded */
} ebpo_ray_meeting;

#endif
