/* Generates points of a continuous path along the surface of a mesh. */
#ifndef EBPO_TOOLS_BENCH_WALK_H
#define EBPO_TOOLS_BENCH_WALK_H

#include <ebpo/mesh.h>

/* Return the next random number of splitmix64 (Steele, Lea, Flood, 2014), and the next one as a
 * double in [0, 1), with 53 random bits. */
uint64_t bench_random(uint64_t *state);
double bench_random_unit(uint64_t *state);

/* Fills out[count][3]. The walk crosses edges straight (as on the unfolded surface), turns slowly,
 * and swings within 1 % of `diagonal` to both sides of the surface; a step is a tenth of
 * `mean_edge`. At an edge without neighbour it turns back; at faces without area it continues on a
 * random face. The points are the same on all machines, as only + - * / and square roots are used.
 * Returns false if there is not enough memory. */
bool bench_walk(const ebpo_mesh *mesh, double mean_edge, double diagonal, uint64_t seed,
                uint64_t count, double *out);

#endif
