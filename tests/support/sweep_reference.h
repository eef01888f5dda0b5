/* Reference implementation of the separation of two faces along a direction. The line of the
 * direction leaves the convex hull of the nine differences of corners through a corner, an edge or
 * a triangle of three of them. All of these are tried, in integers. Shares no code with the
 * library. */
#ifndef EBPO_TESTS_SWEEP_REFERENCE_H
#define EBPO_TESTS_SWEEP_REFERENCE_H

#include <gmp.h>
#include <stdbool.h>

/* Finds the greatest value (may be negative) for which a + value * direction and b have a common
 * point. Sets `t` to this value, and returns true, if it is above `t` or if `any` is false. */
bool sweep_reference(const double a[3][3], const double b[3][3], const double direction[3],
                     bool any, mpq_t t);

#endif
