/* A ray on its way through one accel, as the kernels see it. */
#ifndef EBPO_QUERY_RAY_KERNEL_H
#define EBPO_QUERY_RAY_KERNEL_H

#include "query/accel.h"
#include "geometry/ray.h"

typedef enum ebpo_ray_wants { EBPO_WANTS_FIRST, EBPO_WANTS_ANY, EBPO_WANTS_ALL } ebpo_ray_wants;

typedef struct ebpo_ray_search ebpo_ray_search;

/* A face that may be met: not before `low`, a t of the frame. `facing`: of ebpo_ray_meeting, where
 * the line certainly goes through its interior; else 0. */
typedef struct ebpo_ray_candidate {
    float low;
    uint32_t slot;
    int facing;
} ebpo_ray_candidate;
enum { EBPO_RAY_CANDIDATES = 64 };

struct ebpo_ray_search {
    /* Set by the caller. */
    const ebpo_segment *ray;
    ebpo_ray_wants wants;
    int facing;   /* 1, -1: only faces seen from the front, the back; 0: all */
    double limit; /* t beyond which nothing matters, certain; falls */
    /* Decides exactly about a face (`facing`: as of a candidate), keeps it if it counts, and lowers
     * search->limit and sets search->done accordingly. */
    void (*decide)(ebpo_ray_search *search, uint32_t slot, int facing);
    void *user;

    /* All that follows is made by ebpo_ray_search_accel. */
    bool done; /* nothing more is to be looked at */
    bool met;  /* any wanted: some face is certainly met (`decide` was not told) */
    void (*judge)(ebpo_ray_search *search); /* decides about all that waits */
    const ebpo_accel *s;
    /* In the frame: the direction with a longest coordinate of 2^-12 to 2^12, and the origin, moved
     * along the ray to `moved`; how far off it may be, for boxes. */
    double direction[3], origin[3], error;
    /* Made of these by the kernels. What distances to the sides of boxes start from, the nearer
     * ones and the farther ones; four floats, of which three count. */
    float near_from[4], far_from[4], inverse[4];
    float step_inverse[4];    /* any number, then `inverse` */
    double inverse_double[4]; /* of the direction, small coordinates replaced */
    /* bytes in ebpo_bound where those sides are: nearer ones, farther ones */
    const uint8_t (*side_at)[3];
    int axis[3];    /* z: where the direction is longest */
    float shear[3]; /* x and y for a step of 1 along z; t for such a step */
    /* The origin in the model's unit, in two parts for blocks of floats. */
    double from[3];
    float from_high[4], from_low[4];
    float blur; /* distance at which rounding would be as bad as the origin's own */
    double moved, limit_scale;
    float bound, surely; /* limit, rounded up; t_max, rounded down */
    int count;
    ebpo_ray_candidate waiting[EBPO_RAY_CANDIDATES];
};

#endif
