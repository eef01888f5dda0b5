/* A straight way counts the faces that it crosses well: through the inside, from one side of the
 * plane to the other. Where it meets an edge or begins in a face's plane, it goes by way of another
 * place: almost every one will do. */
#include "core/strict_fp.h"

#include "extras/haptic/side_walk.h"

#include <math.h>

#include "extras/haptic/face_near.h"
#include "extras/haptic/vectors.h"

enum { PIECES = 12 };

static void extent_of(const double p[3], const double q[3], ebpo_extent *out)
{
    for (int i = 0; i < 3; i++) {
        out->min[i] = fmin(p[i], q[i]);
        out->max[i] = fmax(p[i], q[i]);
    }
}

typedef enum crossing { CROSSED, TOO_MANY, BADLY } crossing;

static crossing cross_faces(ebpo_side *side, const ebpo_face_box *box, const double to[3],
                            uint32_t *found, uint32_t most, uint32_t visits, uint64_t *work)
{
    ebpo_extent around;
    uint32_t count;
    int32_t change = 0;
    extent_of(side->at, to, &around);
    bool all = ebpo_face_box_find(box, &around, found, most, &visits, &count);
    *work += count;
    if (!all)
        return TOO_MANY;
    for (uint32_t i = 0; i < count; i++) {
        int sign = ebpo_segment_crosses(side->at, to, (const double(*)[3])box->corner[found[i]]);
        if (sign == EBPO_CROSSES_BADLY)
            return BADLY;
        change += sign;
    }
    side->winding += change;
    copy(to, side->at);
    return CROSSED;
}

/* A place near the middle of the way, another one each time. */
static void go_round(ebpo_side *side, const double to[3], const ebpo_extent *within, double via[3])
{
    double length = 0;
    for (int i = 0; i < 3; i++)
        length = fmax(length, fabs(to[i] - side->at[i]));
    for (int i = 0; i < 3; i++) {
        side->turns = side->turns * 1664525u + 1013904223u;
        double off = (double)(side->turns >> 8) * 0x1p-24 - 0.5;
        via[i] = 0.5 * (side->at[i] + to[i]) + 0.75 * off * length;
        via[i] = fmin(fmax(via[i], within->min[i]), within->max[i]);
    }
}

bool ebpo_side_go(ebpo_side *side, const ebpo_face_box *box, const double place[3], uint32_t *found,
                  uint32_t most, uint32_t visits, uint64_t *work)
{
    double to[3];
    copy(place, to);
    side->known = side->known && ebpo_extent_holds(&box->centres, side->at);
    if (!side->known || !ebpo_extent_holds(&box->centres, place))
        return false;
    for (int piece = 0; piece < PIECES; piece++) {
        switch (cross_faces(side, box, to, found, most, visits, work)) {
        case CROSSED:
            if (to[0] == place[0] && to[1] == place[1] && to[2] == place[2])
                return true;
            copy(place, to);
            break;
        case TOO_MANY:
            for (int i = 0; i < 3; i++)
                to[i] = side->at[i] + 0.25 * (to[i] - side->at[i]);
            break;
        case BADLY: go_round(side, to, &box->centres, to); break;
        }
    }
    return false;
}

bool ebpo_side_on(const ebpo_face_box *box, const double place[3], uint32_t *found, uint32_t most,
                  uint32_t visits)
{
    ebpo_extent around;
    uint32_t count;
    extent_of(place, place, &around);
    bool all = ebpo_face_box_find(box, &around, found, most, &visits, &count);
    for (uint32_t i = 0; i < count; i++)
        if (ebpo_segment_may_meet(place, place, (const double(*)[3])box->corner[found[i]]))
            return true;
    return !all;
}
