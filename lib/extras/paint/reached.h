/* Inside lib/extras/paint: the reaches of many points, found on all cores, given one after the
 * other. */
#ifndef EBPO_PAINT_REACHED_H
#define EBPO_PAINT_REACHED_H

#include "extras/paint/paint_parts.h"

typedef struct ebpo_reached_face {
    uint64_t face; /* as in ebpo_paint_face */
    bool within[3];
} ebpo_reached_face;

/* Of one point. */
typedef struct ebpo_reached {
    const ebpo_reached_face *face;
    uint64_t count;
    bool here; /* else a subset does not have all of it */
} ebpo_reached;

typedef struct ebpo_reacher ebpo_reacher;

/* `threads`: 0: all cores; fewer where the model's budget is small. Uses the context, and makes
 * others of its model. On failure NULL. */
EBPO_MUST_USE ebpo_status ebpo_reacher_new(const ebpo_paint *p, ebpo_context *context,
                                           unsigned threads, ebpo_reacher **out, ebpo_error *error);
void ebpo_reacher_free(ebpo_reacher *r);

/* Of a stroke's point `i`; lent until the next call. Those of the points that follow in the stroke
 * are found with it: ask in their order. Errors are those of ebpo_reach_find. */
EBPO_MUST_USE ebpo_status ebpo_reacher_find(ebpo_reacher *r, uint32_t stroke, uint32_t i,
                                            ebpo_reached *out, ebpo_error *error);

#endif
