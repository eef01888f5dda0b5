/* The cube's ball is brought into the model. If its tree's white and black nodes do not decide, the
 * nearest face does. */
#include "geom/strict_fp.h"

#include "boolean/solid_in_cube.h"

#include <math.h>

#include "query/query_node.h"

enum { SEEN_FACES = 4 }; /* beside EBPO_MAY_IN and EBPO_MAY_OUT: perhaps faces */

typedef struct ball {
    const ebpo_model *model;
    ebpo_box box;
    const double *p;
    double radius, square;
    unsigned seen;
} ball;

/* The cell has certainly no point in the ball. */
static bool apart(const ball *b, ebpo_cell cell)
{
    double low[3], high[3], sum = 0;
    ebpo_cell_bounds(&b->box, cell, low, high);
    for (int k = 0; k < 3; k++) {
        double d = fmax(fmax(low[k] - b->p[k], b->p[k] - high[k]), 0);
        sum += d * d;
    }
    return sum * (1 - 0x1p-48) > b->square;
}

static void look(ball *b, const ebpo_node *node)
{
    if (b->seen & SEEN_FACES || b->seen == EBPO_MAY_BOTH || apart(b, node->cell))
        return;
    if (ebpo_node_is_uniform(node)) {
        b->seen |= node->type == EBPO_BLACK ? EBPO_MAY_IN : EBPO_MAY_OUT;
    } else if (node->type != EBPO_GRAY || node->pruned || ebpo_node_is_below(node)) {
        b->seen |= SEEN_FACES;
    } else {
        for (unsigned octant = 0; octant < 8; octant++) {
            ebpo_node child = ebpo_model_child(b->model, node, octant);
            look(b, &child);
        }
    }
}

static unsigned seen_by_nodes(const ebpo_model *model, const double p[3], double radius)
{
    ball b = { model, ebpo_model_box(model), p, radius, radius * radius * (1 + 0x1p-48) + 0x1p-1000,
               0 };
    double low[3], high[3];
    ebpo_node root = ebpo_model_root(model);
    ebpo_cell_bounds(&b.box, root.cell, low, high);
    for (int k = 0; k < 3; k++)
        if (!(p[k] - radius > low[k] && p[k] + radius < high[k])) /* rounding: the root is larger */
            b.seen |= EBPO_MAY_OUT;                               /* than all faces */
    look(&b, &root);
    return b.seen;
}

/* What the faces say of the ball. */
static ebpo_status look_at_faces(ebpo_context *context, const double p[3], double radius,
                                 unsigned *may, ebpo_error *error)
{
    ebpo_distance_options o = EBPO_DISTANCE_OPTIONS_INIT;
    ebpo_distance_result nearest;
    ebpo_inside_result inside;
    o.max_distance = radius;
    o.unsigned_distance = true;
    *may = EBPO_MAY_BOTH;
    ebpo_status status = ebpo_distance(context, p, &o, &nearest, error);
    if (status != EBPO_OK || nearest.distance < INFINITY)
        return status;
    status = ebpo_inside(context, p, NULL, &inside, error);
    if (status == EBPO_OK && inside.where != EBPO_ON)
        *may = inside.where == EBPO_IN ? EBPO_MAY_IN : EBPO_MAY_OUT;
    return status;
}

ebpo_status ebpo_solid_in_cube(const ebpo_posed_solid *s, ebpo_context *context,
                               const double centre[3], double half, unsigned *may, unsigned *way,
                               ebpo_error *error)
{
    double p[3], doubt;
    *way = EBPO_CUBE_BY_BOX;
    *may = EBPO_MAY_OUT;
    if (!ebpo_posed_solid_near(s, centre, half))
        return EBPO_OK;
    ebpo_unpose(s, centre, p, &doubt);
    /* 1.7321 is more than the root of 3 */
    double radius = 1.7321 * half / s->posing.scale * (1 + 0x1p-40) + doubt;
    unsigned seen = seen_by_nodes(s->model, p, radius);
    *way = EBPO_CUBE_BY_NODES;
    *may = seen;
    if (!(seen & SEEN_FACES))
        return EBPO_OK;
    *way = EBPO_CUBE_BY_FACES;
    return look_at_faces(context, p, radius, may, error);
}
