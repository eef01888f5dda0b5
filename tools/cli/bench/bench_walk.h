/* Generates points of a continuous path along the surface of a mesh. */
#ifndef EBPO_TOOLS_BENCH_WALK_H
#define EBPO_TOOLS_BENCH_WALK_H

#include <ebpo/mesh.h>

/* bench_random returns the next random number of splitmix64 (Steele, Lea, Flood, 2014).
 * bench_random_unit returns the next random number as a double in [0, 1), with 53 random bits. */
uint64_t bench_random(uint64_t *state);
double bench_random_unit(uint64_t *state);

/* Fills out[count][3] with the points of a walk on the surface. The walk crosses edges straight (as
 * if both faces were unfolded into one plane) and turns slowly. A step is a tenth of `mean_edge`.
 * The points swing to both sides of the surface, up to 1 % of `diagonal` away. At an edge without
 * neighbour the walk turns back; at a face without area it continues on a random face. The points
 * are the same on all machines, because only + - * / and square roots are used. Returns false if
 * there is not enough memory or no face has an area. */
bool bench_walk(const ebpo_mesh *mesh, double mean_edge, double diagonal, uint64_t seed,
                uint64_t count, double *out);

#endif
