/* Computes points and planes without rounding, and keeps sets of points in which equal points have
 * one number. Each object is for one thread. If memory is short, GMP ends the program.
 *
 * A plane or three points are *seen against an axis* by an observer who looks in the direction of
 * the negative axis. Seen against the x axis, y points to the right and z upwards; against the y
 * axis, z to the right and x upwards; against the z axis, x to the right and y upwards. */
#ifndef EBPO_BOOLEAN_EXACT_POINT_H
#define EBPO_BOOLEAN_EXACT_POINT_H

#include <gmp.h>
#include <stdbool.h>
#include <stdint.h>

/* A point in homogeneous integer coordinates: coordinate k is x[k] / x[3] * 2^unit, x[3] > 0. All
 * points of a calculation have the same unit, which callers pass to the functions that need it. */
typedef struct ebpo_exact_point {
    mpz_t x[4];
    double at[3]; /* the coordinates, rounded to the nearest double; never -0 */
    bool exact;   /* `at` is not rounded: it is exactly the point */
} ebpo_exact_point;

/* A plane: the points with n[0] x[0] + n[1] x[1] + n[2] x[2] + n[3] x[3] = 0. */
typedef struct ebpo_exact_plane {
    mpz_t n[4];
} ebpo_exact_plane;

void ebpo_exact_point_init(ebpo_exact_point *p);
void ebpo_exact_point_clear(ebpo_exact_point *p);
void ebpo_exact_point_swap(ebpo_exact_point *p, ebpo_exact_point *q);
void ebpo_exact_plane_init(ebpo_exact_plane *p);
void ebpo_exact_plane_clear(ebpo_exact_plane *p);

/* Converts a finite point whose coordinates are multiples of 2^unit. */
void ebpo_exact_point_set(ebpo_exact_point *out, const double x[3], int unit);

/* Computes the plane through three points whose x[3] is 1. */
void ebpo_exact_plane_through(ebpo_exact_plane *out, const ebpo_exact_point corner[3]);

/* Computes the plane that contains two points and is parallel to an axis. Seen against the axis,
 * the positive side of the plane is to the left of the direction from p to q. */
void ebpo_exact_plane_along(ebpo_exact_plane *out, int axis, const ebpo_exact_point *p,
                            const ebpo_exact_point *q);

/* Returns the side of the plane, -1, 0 or 1, on which the point is. */
int ebpo_exact_side(const ebpo_exact_plane *plane, const ebpo_exact_point *p);

/* Computes the point where the line through p and q intersects the plane. At least one of p and q
 * must be outside the plane. `out` must be a third point. */
void ebpo_exact_intersect(ebpo_exact_point *out, const ebpo_exact_plane *plane,
                          const ebpo_exact_point *p, const ebpo_exact_point *q, int unit);

/* Compares coordinate k of two points. Returns -1 (p is less), 0 or 1. */
int ebpo_exact_compare(const ebpo_exact_point *p, const ebpo_exact_point *q, int k);

/* Compares two points by x, then y, then z. Returns -1 (p is less), 0 or 1. */
int ebpo_exact_order(const ebpo_exact_point *p, const ebpo_exact_point *q);

/* Returns the turn (the orientation) of three points seen against the axis: 1 if a, b, c are
 * counter-clockwise, -1 if they are clockwise, 0 if their projections are on a line. */
int ebpo_exact_turn(int axis, const ebpo_exact_point *a, const ebpo_exact_point *b,
                    const ebpo_exact_point *c);

/* Returns the sign of coordinate k minus its rounded value p->at[k]. */
int ebpo_exact_side_of_double(const ebpo_exact_point *p, int k, int unit);

/* Returns the distance between the point and `at`, rounded. */
double ebpo_exact_distance(const ebpo_exact_point *p, const double at[3], int unit);

/* A set of different points, numbered from 0. A zero struct is an empty set. */
typedef struct ebpo_point_set {
    ebpo_exact_point *point; /* [count]; the first `made` entries are initialized */
    uint64_t count, made, capacity;
    uint32_t *table; /* open addressing: number of a point + 1; 0: free */
    uint64_t table_size;
} ebpo_point_set;

/* Finds or adds a point. If the point is new, its contents move into the set, and *p gets the
 * contents of an unused point. Returns false without memory or with 2^31 points. */
bool ebpo_point_set_add(ebpo_point_set *set, ebpo_exact_point *p, uint32_t *number);
/* Removes all points; keeps the memory. */
void ebpo_point_set_empty(ebpo_point_set *set);
void ebpo_point_set_free(ebpo_point_set *set);

#endif
