/* Winding numbers of many points by rays through the whole mesh: the points are sorted into columns
 * along x, and every face looks for those that it lies before. So the faces are gone through once,
 * in their order, and what is held is for the points alone. */
#ifndef EBPO_VERIFY_VERIFY_RAYS_H
#define EBPO_VERIFY_VERIFY_RAYS_H

#include <ebpo/mesh.h>

#include "geometry/cell.h"

/* A point, and what the file says about it. */
typedef struct ebpo_ray_point {
    double at[3];
    uint64_t octcode; /* of the cell whose lowest corner it is */
    int64_t stored;   /* its winding number by the file */
    int64_t found;    /* by ebpo_rays_follow */
} ebpo_ray_point;

/* Points as they come up. Zeroed is empty; free `point` with ebpo_array_free. */
typedef struct ebpo_ray_points {
    ebpo_workspace *workspace; /* what the list keeps to, or NULL */
    ebpo_ray_point *point;
    uint64_t count, capacity;
} ebpo_ray_points;

/* False when memory is short. */
EBPO_MUST_USE bool ebpo_rays_add(ebpo_ray_points *points, const ebpo_ray_point *point);

/* Sets `found` of all points: their winding numbers, shifted, over the whole mesh. Exact. The
 * points lie in the box; the mesh is not empty, its coordinates finite and indices in range. Sorts
 * the points into columns. */
EBPO_MUST_USE ebpo_status ebpo_rays_follow(ebpo_ray_points *points, const ebpo_mesh *mesh,
                                           const ebpo_box *box, unsigned threads,
                                           const ebpo_progress *progress, ebpo_error *error);

/* About how many points a face would look at in all, were `count` points spread evenly over the
 * box. */
double ebpo_rays_work(const ebpo_mesh *mesh, const ebpo_box *box, uint64_t count);

#endif
