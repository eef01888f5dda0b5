/* Inside lib/extras/paint: the reach of a stroke's point. */
#ifndef EBPO_PAINT_PAINT_REACH_H
#define EBPO_PAINT_PAINT_REACH_H

#include "extras/paint/paint_parts.h"
#include "extras/paint/reach.h"

/* Point `i` of a stroke as a ball. */
static inline ebpo_reach_ball ebpo_paint_ball(const ebpo_paint *p, uint64_t stroke, uint32_t i)
{
    const ebpo_stroke_held *s = &p->stroke[stroke];
    const ebpo_paint_point *q = &p->point[s->first + i];
    return (ebpo_reach_ball){ { q->place[0], q->place[1], q->place[2] },
                              ebpo_paint_radius(s, q),
                              q->face };
}

/* As ebpo_reach_find. */
EBPO_MUST_USE static inline ebpo_status ebpo_paint_reach(ebpo_reach *reach, const ebpo_paint *p,
                                                         uint64_t stroke, uint32_t i, bool *here,
                                                         ebpo_error *error)
{
    ebpo_reach_ball ball = ebpo_paint_ball(p, stroke, i);
    return ebpo_reach_find(reach, &ball, here, error);
}

#endif
