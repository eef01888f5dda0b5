/* Reference implementation for two faces in rational arithmetic, by brute force over all edges and
 * faces, and hard pairs as inputs. Independent of the library: calls none of its code. */
#ifndef EBPO_TESTS_PAIR_REFERENCE_H
#define EBPO_TESTS_PAIR_REFERENCE_H

#include <stdbool.h>
#include <stdint.h>

/* Returns the kind as a number, in the order of ebpo_pair_kind: apart, touching, crossing,
 * coplanar. It is found from the corners of the intersection, and their mean. */
int reference_pair_kind(const double a[3][3], const double b[3][3]);

/* An end of a segment, an argument of reference_pair_contact. */
typedef struct reference_end {
    const double *point;
    int on_a, on_b; /* 0 to 2 a corner, 3 to 5 the edge from corner k - 3, 6 the interior */
} reference_end;
/* Checks the segment of a crossing pair: end[0] and end[1] are the ends of the common segment in
 * the direction of A's normal x B's, on these features, each coordinate within 0.51 units in the
 * last place and 2^-60 of `most[axis]`. Returns NULL, or a description of the error. */
const char *reference_pair_contact(const double a[3][3], const double b[3][3],
                                   const reference_end end[2], const double most[3]);

/* Returns the sign of (distance of the faces) - d, where d is finite and not negative; minimises
 * the distance over all pairs of corners, edges and faces. */
int reference_pair_distance_compare(const double a[3][3], const double b[3][3], double d);

/* Fills two faces with a case of the given kind. */
enum { REFERENCE_PAIR_KINDS = 15 };
const char *reference_pair_name(int kind);
void reference_pair_case(double a[3][3], double b[3][3], int kind, uint64_t *state);

#endif
