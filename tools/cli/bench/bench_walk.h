/* A walk over a mesh: points of a continuous path along the surface. */
#ifndef EBPO_TOOLS_BENCH_WALK_H
#define EBPO_TOOLS_BENCH_WALK_H

#include <ebpo/mesh.h>

/* splitmix64 (Steele, Lea, Flood, 2014): the next number, and one in [0, 1) of 53 bits. */
uint64_t bench_random(uint64_t *state);
double bench_random_unit(uint64_t *state);

/* Fills out[count][3]. The walk goes straight across edges (as on the unfolded surface), turns
 * slowly, and swings within 1 % of `diagonal` to both sides of the surface; a step is a tenth of
 * `mean_edge`. Where an edge has no neighbour it turns back; where it gets stuck, at faces without
 * area, it goes on elsewhere. The same points everywhere: only + - * / and square roots. False when
 * memory is short. */
bool bench_walk(const ebpo_mesh *mesh, double mean_edge, double diagonal, uint64_t seed,
                uint64_t count, double *out);

#endif
