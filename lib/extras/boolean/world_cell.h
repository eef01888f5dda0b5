/* Cells of an octree of the world; decides if a cube is inside or outside a solid at a pose. */
#ifndef EBPO_BOOLEAN_WORLD_CELL_H
#define EBPO_BOOLEAN_WORLD_CELL_H

#include "extras/boolean/boolean.h"
#include "extras/collide/posed_solid.h"
#include "geometry/cells.h"

/* Stages of the decision. */
enum { EBPO_CUBE_BY_BOX, EBPO_CUBE_BY_NODES, EBPO_CUBE_BY_FACES, EBPO_CUBE_STAGES };

/* The root of the octree: corners and centres of cells down to `level` are exact. */
typedef struct ebpo_world {
    double origin[3], edge; /* edge: a power of two; 0: the world is empty */
    int level;
} ebpo_world;

/* Makes a world around the result. Fails with EBPO_E_LIMIT if corners would not be doubles. */
EBPO_MUST_USE ebpo_status ebpo_world_make(ebpo_world *out, const ebpo_boolean *b, int level,
                                          ebpo_error *error);

typedef struct ebpo_world_cell {
    ebpo_cell cell;
    uint64_t known, in; /* states of operands, as for ebpo_expression_value */
} ebpo_world_cell;

static inline double ebpo_world_edge(const ebpo_world *w, int level)
{
    return w->edge * ebpo_half_power(level);
}

static inline double ebpo_world_cell_face(const ebpo_world *w, int axis, int level, uint32_t k)
{
    return w->origin[axis] + (double)k * ebpo_world_edge(w, level);
}

static inline ebpo_world_cell ebpo_world_child(const ebpo_world_cell *c, unsigned octant)
{
    return (ebpo_world_cell){ ebpo_cell_child(c->cell, octant), c->known, c->in };
}

/* Queries the operands whose state in the cell is not known yet, until the expression is decided.
 * *may: possible states of the result. Counts the deciding stages in stages[EBPO_CUBE_STAGES]. */
EBPO_MUST_USE ebpo_status ebpo_world_cell_query(const ebpo_boolean *b, unsigned worker,
                                                const ebpo_world *w, ebpo_world_cell *c,
                                                unsigned *may, uint8_t *stages, ebpo_error *error);

#endif
