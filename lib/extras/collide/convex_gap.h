/* How far apart two convex sets are, from their corners. Pure functions, any thread. */
#ifndef EBPO_COLLIDE_CONVEX_GAP_H
#define EBPO_COLLIDE_CONVEX_GAP_H

/* The hull of its points. */
typedef struct ebpo_convex {
    int count; /* 1 at least */
    const double (*point)[3];
} ebpo_convex;

/* A lower bound of the distance, 0 if none was found: right to 2^-48 of the greatest coordinate. It
 * is near the distance, but need not be it; one that is beyond `enough` ends the search. The same
 * on every processor. */
double ebpo_convex_gap(const ebpo_convex *a, const ebpo_convex *b, double enough);

/* No two of their points are farther apart; rounded up. */
double ebpo_convex_span(const ebpo_convex *a, const ebpo_convex *b);

#endif
