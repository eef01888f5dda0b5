/* The predicates in integers of any size: slow, right for every finite double, and used when
 * everything faster gives up. */
#ifndef EBPO_GEOMETRY_PREDICATES_EXACT_H
#define EBPO_GEOMETRY_PREDICATES_EXACT_H

/* The same meaning and ranges as the functions of predicates.h without "_exact". Each call
 * allocates through GMP, which ends the program when memory is out (a few kilobytes suffice). */
int ebpo_orient2d_exact(const double a[2], const double b[2], const double c[2]);
int ebpo_orient3d_exact(const double a[3], const double b[3], const double c[3], const double d[3]);
int ebpo_sign_of_products_exact(const double *factor, int n);

#endif
