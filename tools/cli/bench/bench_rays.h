/* Generates query rays: rows[count][7], where a row is an ebpo_ray. */
#ifndef EBPO_TOOLS_BENCH_RAYS_H
#define EBPO_TOOLS_BENCH_RAYS_H

#include <ebpo/file.h>

/* The bounding box of the model. */
typedef struct bench_scene {
    double low[3], high[3];
} bench_scene;

/* Generates rays from points in the box, with directions uniform over the sphere. */
void bench_rays_uniform(const bench_scene *scene, uint64_t seed, uint64_t count, double *rows);
/* Generates the rays of bench_rays_uniform, but each ray ends after a twentieth of the box's
 * diagonal, at t = 1. */
void bench_rays_segments(const bench_scene *scene, uint64_t seed, uint64_t count, double *rows);
/* Generates rays through the pixels of a square picture, row by row. The box fills the picture, and
 * the eye is one and a half diagonals away. */
void bench_rays_camera(const bench_scene *scene, uint64_t seed, uint64_t count, double *rows);
/* Generates four kinds of rays in turn:
 * - from a point in the box to a vertex
 * - from a point in the box to the middle of an edge
 * - from a vertex in any direction
 * - from outside along an axis through a vertex
 * Origins are floats. */
void bench_rays_degenerate(const bench_scene *scene, const ebpo_mesh *mesh, uint64_t seed,
                           uint64_t count, double *rows);

#endif
