/* A face in the coordinates of a cell, and whether it touches the closed cell: floating point with
 * error bounds, rationals when in doubt. */
#ifndef EBPO_VERIFY_TOUCH_H
#define EBPO_VERIFY_TOUCH_H

#include "geometry/cell.h"
#include "verify/exact.h"
#include "verify/tally.h"

/* A cell: its walls (exact) and the reciprocals of its sizes (rounded). */
typedef struct ebpo_frame {
    double low[3], high[3], inverse[3];
} ebpo_frame;

ebpo_frame ebpo_frame_make(const ebpo_box *box, ebpo_cell cell);

/* Corners of a face in cell coordinates. Each coordinate is off by at most 4 * 2^-53 of its
 * absolute value (and 2^-1000). */
typedef struct ebpo_local {
    double at[3][3];
    double reach[3];    /* largest absolute coordinate on each axis, at least 1 */
    unsigned contained; /* bit i: corner i lies in the closed cell; exact */
} ebpo_local;

void ebpo_local_make(ebpo_local *out, const ebpo_frame *frame, const ebpo_corners *face);

static inline bool ebpo_corner_in_cell(const ebpo_frame *frame, const double p[3])
{
    return p[0] >= frame->low[0] && p[0] <= frame->high[0] && p[1] >= frame->low[1] &&
           p[1] <= frame->high[1] && p[2] >= frame->low[2] && p[2] <= frame->high[2];
}

/* Exact: the closed triangle and the closed cell have a point in common. Counts questions that went
 * to rationals. */
bool ebpo_face_touches(const ebpo_frame *frame, const ebpo_corners *face, ebpo_tally *tally);

#endif
