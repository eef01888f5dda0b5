/* Evaluates a Boolean expression in cells of an octree of the world: decides if a cell is entirely
 * inside or entirely outside the result. */
#ifndef EBPO_BOOLEAN_WORLD_CELL_H
#define EBPO_BOOLEAN_WORLD_CELL_H

#include "extras/boolean/boolean.h"
#include "extras/collide/posed_solid.h"
#include "geometry/cells.h"

/* The tests that can decide if a cell is in or out of an operand: the box of the model, the nodes
 * of its tree, or its faces. */
enum { EBPO_CUBE_BY_BOX, EBPO_CUBE_BY_NODES, EBPO_CUBE_BY_FACES, EBPO_CUBE_STAGES };

/* Decides if a cube of the world is inside or outside a posed solid. The cube is parallel to the
 * axes; half: half of the cube's edge. *may: EBPO_MAY_IN if the whole closed cube is inside,
 * EBPO_MAY_OUT if it is outside, EBPO_MAY_BOTH if a face may be in the ball around the cube.
 * *stage: the test that has decided. */
EBPO_MUST_USE ebpo_status ebpo_solid_in_cube(const ebpo_posed_solid *s, ebpo_context *context,
                                             const double centre[3], double half, unsigned *may,
                                             unsigned *stage, ebpo_error *error);

/* The root cell of the octree, a cube around the result. */
typedef struct ebpo_world {
    double origin[3]; /* lower corner */
    double edge;      /* a power of two; 0: the result is empty */
    int level;        /* the finest level: down to it, corners and centres of cells are exact */
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

/* Returns the coordinate, on an axis, of the lower side of the cells with index k on a level. */
static inline double ebpo_world_cell_face(const ebpo_world *w, int axis, int level, uint32_t k)
{
    return w->origin[axis] + (double)k * ebpo_world_edge(w, level);
}

static inline ebpo_world_cell ebpo_world_child(const ebpo_world_cell *c, unsigned octant)
{
    return (ebpo_world_cell){ ebpo_cell_child(c->cell, octant), c->known, c->in };
}

/* Queries the operands whose state in the cell is not known yet, until the state of the result is
 * certain. *may: possible states of the result. Counts the deciding tests in
 * stages[EBPO_CUBE_STAGES]. */
EBPO_MUST_USE ebpo_status ebpo_world_cell_query(const ebpo_boolean *b, unsigned worker,
                                                const ebpo_world *w, ebpo_world_cell *c,
                                                unsigned *may, uint8_t *stages, ebpo_error *error);

#endif
