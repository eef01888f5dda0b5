/* Two faces in rational arithmetic, by brute force over all edges and faces, and hard pairs to ask
 * about. Written apart from the library: nothing of it is called here. */
#ifndef EBPO_TESTS_PAIR_TWIN_H
#define EBPO_TESTS_PAIR_TWIN_H

#include <stdbool.h>
#include <stdint.h>

/* Kinds as numbers, in the order of ebpo_pair_kind: apart, touching, crossing, coplanar. Found from
 * the points that are corners of what is common, and their mean. */
int twin_pair_kind(const double a[3][3], const double b[3][3]);

/* What twin_pair_contact finds wrong. */
typedef struct twin_end {
    const double *point;
    int on_a, on_b; /* 0 to 2 a corner, 3 to 5 the edge from corner k - 3, 6 the interior */
} twin_end;
/* Of a crossing pair: NULL when end[0] and end[1] are the ends of the common segment in the
 * direction of A's normal x B's, on those features, each coordinate within 0.51 units in the last
 * place and 2^-60 of `most[axis]`; else what is not so. */
const char *twin_pair_contact(const double a[3][3], const double b[3][3], const twin_end end[2],
                              const double most[3]);

/* Sign of (distance of the faces) - d, d finite and not negative: by minimising the distance of all
 * pairs of corners, edges and faces. */
int twin_pair_distance_compare(const double a[3][3], const double b[3][3], double d);

/* Fills two faces with a case of the given kind. */
enum { TWIN_PAIR_KINDS = 15 };
const char *twin_pair_name(int kind);
void twin_pair_case(double a[3][3], double b[3][3], int kind, uint64_t *state);

#endif
