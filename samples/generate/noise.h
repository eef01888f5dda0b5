/* Computes smooth noise with basic arithmetic only, so that the results are the same on every
 * machine. */
#ifndef EBPO_SAMPLES_NOISE_H
#define EBPO_SAMPLES_NOISE_H

#include <stdint.h>

/* Returns the value of gradient noise (Perlin 2002) at p, about -1 .. 1. The cells of the lattice
 * have the size 1. The function is twice continuously differentiable. The absolute coordinates of p
 * must be below 2^31. */
double ebpo_noise(const double p[3], uint64_t seed);

/* Returns a weighted mean of several noises (octaves) at p, about -1 .. 1. The first octave has the
 * wavelength `longest`. Each further octave has half of the wavelength and half of the weight of
 * the octave before, down to the wavelength `shortest`. */
double ebpo_noise_octaves(const double p[3], double longest, double shortest, uint64_t seed);

/* Computes cos and sin of `turns` full turns, 0 <= turns <= 1. */
void ebpo_circle(double turns, double *cosine, double *sine);

#endif
