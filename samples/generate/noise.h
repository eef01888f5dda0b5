/* Computes smooth noise by additions and multiplications only, so that it is the same on every
 * machine. */
#ifndef EBPO_SAMPLES_NOISE_H
#define EBPO_SAMPLES_NOISE_H

#include <stdint.h>

/* Returns gradient noise (Perlin 2002) at p with lattice cells of size 1; about -1 .. 1, twice
 * continuously differentiable. |p| < 2^31. */
double ebpo_noise(const double p[3], uint64_t seed);

/* Returns octaves from the wavelength `longest` down to `shortest` by halves, each half as strong
 * as the one before; about -1 .. 1. */
double ebpo_noise_octaves(const double p[3], double longest, double shortest, uint64_t seed);

/* Computes cos and sin of `turns` full turns, 0 <= turns <= 1. */
void ebpo_circle(double turns, double *cosine, double *sine);

#endif
