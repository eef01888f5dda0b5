/* Cutting the ears off an outline in the plane, by exact tests, in any order of coordinates.
 *
 * A corner is tested again only when its own neighbours have changed, or when the corner that
 * blocked its ear is gone; blocking corners are searched for in a tree of boxes. So outlines of
 * 100,000 corners and more are cut in about n log n steps. */
#ifndef EBPO_GEOMETRY_POLYGON_EARS_H
#define EBPO_GEOMETRY_POLYGON_EARS_H

#include <ebpo/base.h>

/* What blocks an ear. */
typedef enum ebpo_ear_rule {
    /* Any corner in the closed triangle, unless it is at the place of one of the triangle's. */
    EBPO_EARS_CLOSED,

    /* For outlines that touch themselves (slits, bridges to holes, pinched corners): a corner
     * within the triangle or on its new side; and one elsewhere on its border if the outline goes
     * into the triangle from there. Where no ear is left, spikes without area are cut off. */
    EBPO_EARS_TOUCHING
} ebpo_ear_rule;

typedef enum ebpo_ears {
    EBPO_EARS_CUT,   /* all of it: every triangle turns counter-clockwise, or has no area */
    EBPO_EARS_STUCK, /* the outline crosses itself */
    EBPO_EARS_WORK   /* more steps than `limit` were needed */
} ebpo_ears;

/* Bytes of scratch for n corners, at any alignment that malloc gives; 0 when that does not fit 64
 * bits. */
uint64_t ebpo_ears_scratch_bytes(uint64_t n);

/* Writes n - 2 triangles of corner numbers for the outline at[n], n >= 4, that runs
 * counter-clockwise; what is written is of use with EBPO_EARS_CUT only. The result depends on the
 * corners alone. Pure, any thread. */
ebpo_ears ebpo_ears_cut(uint32_t (*triangle)[3], const double (*at)[2], uint32_t n,
                        ebpo_ear_rule rule, uint64_t limit, void *scratch);

#endif
