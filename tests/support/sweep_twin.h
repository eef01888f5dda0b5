/* Until when a face that moves along a direction has common points with another one: by the nine
 * differences of corners, whose convex hull the line of the direction leaves through a corner, an
 * edge or a triangle of three of them. All of these are tried, in integers. Shares no code with the
 * library. */
#ifndef EBPO_TESTS_SWEEP_TWIN_H
#define EBPO_TESTS_SWEEP_TWIN_H

#include <gmp.h>
#include <stdbool.h>

/* Sets `t` to the greatest one (also less than 0) with a common point of a + t * direction and b if
 * that is above `t`, or if `any` is false. Returns whether it did. */
bool sweep_twin(const double a[3][3], const double b[3][3], const double direction[3], bool any,
                mpq_t t);

#endif
