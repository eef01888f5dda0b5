/* A way that planes through its beginning hold back: the nearest that is allowed to where it wanted
 * to end. */
#ifndef EBPO_HAPTIC_HELD_BACK_H
#define EBPO_HAPTIC_HELD_BACK_H

enum { EBPO_PLANES_MOST = 12 };

typedef struct ebpo_held_planes {
    double normal[EBPO_PLANES_MOST][3]; /* unit vectors to the side that is free */
    int count;
} ebpo_held_planes;

/* One more, unless it is there already, or there is no room. */
void ebpo_held_planes_add(ebpo_held_planes *planes, const double normal[3]);

/* `out` is the way `want` projected onto the cone n . x >= 0 for all planes; 0 if rounding finds
 * none. Returns how far below 0 n . out may be. */
double ebpo_hold_back(const ebpo_held_planes *planes, const double want[3], double out[3]);

#endif
