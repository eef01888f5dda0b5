/* Inside lib/extras/paint: to which strokes the parts of a face belong, and how large these are.
 * format-spec/paint.md, section 6. */
#ifndef EBPO_PAINT_AREA_CUT_H
#define EBPO_PAINT_AREA_CUT_H

#include "extras/paint/paint_parts.h"

/* A ball in whose reach a face is. */
typedef struct ebpo_area_ball {
    double centre[3], radius;
    uint32_t layer, stroke;
} ebpo_area_ball;

/* Areas by stroke, by colour, by layer and of all, one behind the other: area_keys of them. */
typedef struct ebpo_area_keys {
    const ebpo_paint *p;
    uint32_t *colour; /* [strokes] the number of a stroke's colour */
    uint64_t colours;
} ebpo_area_keys;

static inline uint64_t ebpo_area_key_count(const ebpo_area_keys *k)
{
    return k->p->stroke_count + k->colours + k->p->layer_count + 1;
}

/* One thread's. */
typedef struct ebpo_area_cut {
    const ebpo_area_keys *keys;
    double fineness;
    ebpo_paint_area *area; /* [keys] to which is added */
    ebpo_area_ball *ball;  /* a stack: of each part those balls that it meets */
    uint64_t ball_capacity;
    uint64_t *seen; /* [colours] the last part that a colour was noted for */
    uint64_t part;
} ebpo_area_cut;

/* Room for the sums of a thread: `area` stays the caller's. False: no memory. */
bool ebpo_area_cut_begin(ebpo_area_cut *cut, const ebpo_area_keys *keys, double fineness);
void ebpo_area_cut_end(ebpo_area_cut *cut);

/* Adds a face whose `count` balls stand at cut->ball, by layer, within a layer the last stroke
 * first. False: no memory. */
bool ebpo_area_cut_face(ebpo_area_cut *cut, const double corner[3][3], uint64_t count);

#endif
