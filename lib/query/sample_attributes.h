/* Interpolates values of a face's corners at a point of the face. */
#ifndef EBPO_QUERY_SAMPLE_ATTRIBUTES_H
#define EBPO_QUERY_SAMPLE_ATTRIBUTES_H

/* Computes the weights of the three corners at the point p. Weights are at least 0; their sum is 1.
 */
void ebpo_weigh_corners(const double corner[3][3], const double p[3], double weight[3]);

/* Returns the weighted mean of three values. The result is between the values, also after rounding.
 */
double ebpo_blend_values(const double weight[3], const double value[3]);

#endif
