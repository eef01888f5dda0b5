/* The cube's ball is brought into the model. If its tree's white and black nodes do not decide, the
 * nearest face does. */
#include "core/strict_fp.h"

#include "extras/boolean/solid_in_cube.h"

#include <math.h>

#include "query/query_node.h"

enum {
    SEEN_FACES = 4, /* beside EBPO_MAY_IN and EBPO_MAY_OUT: perhaps faces */
    NODES_MOST = 64 /* looked at for a black and a white one once faces are seen */
};

typedef struct ball {
    const ebpo_model *model;
    ebpo_box box;
    const double *p;
    double square; /* of its radius */
    unsigned seen; /* perhaps in the ball */
    unsigned sure; /* of EBPO_MAY_IN and EBPO_MAY_OUT: certainly in it */
    unsigned nodes;
} ball;

/* Squared distance of the cell, right to 2^-50 of itself while it is not almost 0. */
static double square_to(const ball *b, ebpo_cell cell)
{
    double low[3], high[3], sum = 0;
    ebpo_cell_bounds(&b->box, cell, low, high);
    for (int k = 0; k < 3; k++) {
        double d = fmax(fmax(low[k] - b->p[k], b->p[k] - high[k]), 0);
        sum += d * d;
    }
    return sum;
}

static void look(ball *b, const ebpo_node *node)
{
    bool enough = b->sure == EBPO_MAY_BOTH || (b->seen & SEEN_FACES && ++b->nodes > NODES_MOST);
    double square = enough ? 0 : square_to(b, node->cell);
    if (enough || square * (1 - 0x1p-48) > b->square + 0x1p-1000)
        return;
    if (ebpo_node_is_uniform(node)) {
        unsigned kind = node->type == EBPO_BLACK ? EBPO_MAY_IN : EBPO_MAY_OUT;
        b->seen |= kind;
        if (square < b->square * (1 - 0x1p-48) && b->square > 0x1p-900)
            b->sure |= kind;
    } else if (node->type != EBPO_GRAY || node->pruned || ebpo_node_is_below(node)) {
        b->seen |= SEEN_FACES;
    } else {
        for (unsigned octant = 0; octant < 8; octant++) {
            ebpo_node child = ebpo_model_child(b->model, node, octant);
            look(b, &child);
        }
    }
}

/* EBPO_MAY_IN or EBPO_MAY_OUT: no face is in the ball. EBPO_MAY_BOTH: one is. 0: not known. What is
 * said is what the faces would say, so that nothing depends on what is in memory. */
static unsigned decide_by_nodes(const ebpo_model *model, const double p[3], double radius)
{
    ball b = { .model = model,
               .box = ebpo_model_box(model),
               .p = p,

               .square = radius * radius };
    double low[3], high[3];
    ebpo_node root = ebpo_model_root(model);
    ebpo_cell_bounds(&b.box, root.cell, low, high);
    for (int k = 0; k < 3; k++) { /* beyond the root cell all is out */
        double beyond = radius - fmin(p[k] - low[k], high[k] - p[k]);
        if (!(beyond < -0x1p-48 * radius))
            b.seen |= EBPO_MAY_OUT;
        if (beyond > 0x1p-48 * radius)
            b.sure |= EBPO_MAY_OUT;
    }
    look(&b, &root);
    if (b.sure == EBPO_MAY_BOTH) /* between a black and a white point there is a face */
        return EBPO_MAY_BOTH;
    return b.seen == EBPO_MAY_IN || b.seen == EBPO_MAY_OUT ? b.seen : 0;
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
    *may = decide_by_nodes(s->model, p, radius);
    *way = EBPO_CUBE_BY_NODES;
    if (*may)
        return EBPO_OK;
    *way = EBPO_CUBE_BY_FACES;
    return look_at_faces(context, p, radius, may, error);
}
