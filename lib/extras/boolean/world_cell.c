/* Evaluates a Boolean expression in cells of an octree of the world: decides if a cell is entirely
 * inside or entirely outside the result.
 *
 * For each operand, the ball around the cell is transformed into the model's coordinates. Three
 * tests decide if the cell is inside, outside, or may contain a face: by the model's box, then by
 * the white and black nodes of the model's tree, then by the nearest face. A cell keeps the states
 * of the operands, so its children need not query them again. The size of the root is a power of
 * two, so corners and centres are exact. */
#include "core/strict_fp.h"

#include <math.h>
#include <string.h>

#include "core/error.h"
#include "extras/boolean/world_cell.h"
#include "query/query_node.h"

enum {
    SEEN_FACES = 4, /* a bit beside EBPO_MAY_IN and EBPO_MAY_OUT: there may be faces */
    NODES_MAX =
        64 /* maximum number of nodes that are visited after the first node that may have faces.
              After this node, the search decides only if it finds both a black and a white node. */
};

/* A ball in the coordinates of a model. A black node is inside the solid, a white node outside. */
typedef struct ball {
    const ebpo_model *model;
    ebpo_box box;    /* the model's root cell */
    const double *p; /* centre */
    double square;   /* squared radius */
    unsigned seen;   /* bits of what the ball may contain: inner points, outer points, faces */
    unsigned sure;   /* bits of what the ball certainly contains: inner points, outer points */
    unsigned nodes;  /* number of nodes visited after the first node that may have faces */
} ball;

/* Returns the squared distance of the cell from the ball's centre, with a relative error of at most
 * 2^-50 if it is not almost 0. */
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

/* Adds what the node and its descendants contain to b->seen and b->sure. */
static void inspect_node(ball *b, const ebpo_node *node)
{
    bool enough = b->sure == EBPO_MAY_BOTH || (b->seen & SEEN_FACES && ++b->nodes > NODES_MAX);
    double square = enough ? 0 : square_to(b, node->cell);
    if (enough || square * (1 - 0x1p-48) > b->square + 0x1p-1000)
        return;
    if (ebpo_node_is_uniform(node)) {
        unsigned kind = node->type == EBPO_BLACK ? EBPO_MAY_IN : EBPO_MAY_OUT;
        b->seen |= kind;
        if (square < b->square * (1 - 0x1p-48) && b->square > 0x1p-900)
            b->sure |= kind;
    } else if (node->type != EBPO_GRAY || node->pruned || ebpo_node_is_subtree_root(node)) {
        b->seen |= SEEN_FACES;
    } else {
        for (unsigned octant = 0; octant < 8; octant++) {
            ebpo_node child = ebpo_model_child(b->model, node, octant);
            inspect_node(b, &child);
        }
    }
}

/* Decides by the nodes of the tree if the ball is inside or outside. Returns EBPO_MAY_IN or
 * EBPO_MAY_OUT if no face is in the ball, EBPO_MAY_BOTH if a face is in the ball, and 0 if this is
 * unknown. A test of the faces would give the same result, so the result does not depend on which
 * nodes are in memory. */
static unsigned decide_by_nodes(const ebpo_model *model, const double p[3], double radius)
{
    ball b = { .model = model, .box = ebpo_model_box(model), .p = p, .square = radius * radius };
    double low[3], high[3];
    ebpo_node root = ebpo_model_root(model);
    ebpo_cell_bounds(&b.box, root.cell, low, high);
    for (int k = 0; k < 3; k++) { /* everything outside the root cell is out */
        double beyond = radius - fmin(p[k] - low[k], high[k] - p[k]);
        if (!(beyond < -0x1p-48 * radius))
            b.seen |= EBPO_MAY_OUT;
        if (beyond > 0x1p-48 * radius)
            b.sure |= EBPO_MAY_OUT;
    }
    inspect_node(&b, &root);
    if (b.sure == EBPO_MAY_BOTH) /* there is a face between a black and a white point */
        return EBPO_MAY_BOTH;
    return b.seen == EBPO_MAY_IN || b.seen == EBPO_MAY_OUT ? b.seen : 0;
}

/* Decides by the distance of the nearest face if the ball is inside or outside. *may: EBPO_MAY_BOTH
 * if a face may be in the ball. */
static ebpo_status inspect_faces(ebpo_context *context, const double p[3], double radius,
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
                               const double centre[3], double half, unsigned *may, unsigned *stage,
                               ebpo_error *error)
{
    double p[3], doubt;
    *stage = EBPO_CUBE_BY_BOX;
    *may = EBPO_MAY_OUT;
    if (!ebpo_posed_solid_near(s, centre, half))
        return EBPO_OK;
    ebpo_unpose(s, centre, p, &doubt);
    /* 1.7321 is more than the root of 3 */
    double radius = 1.7321 * half / s->posing.scale * (1 + 0x1p-40) + doubt;
    *may = decide_by_nodes(s->model, p, radius);
    *stage = EBPO_CUBE_BY_NODES;
    if (*may)
        return EBPO_OK;
    *stage = EBPO_CUBE_BY_FACES;
    return inspect_faces(context, p, radius, may, error);
}

/* The edge of the root cell is from 2^-MAX_POWER to 2^MAX_POWER. Otherwise, volumes of cells could
 * leave the range of doubles. */
enum { MAX_POWER = 300 };

static ebpo_status fail_location(const double box[6], int level, ebpo_error *error)
{
    return ebpo_fail(error, EBPO_E_LIMIT,
                     "the result is around (%g, %g, %g), up to %g long: corners of cells of "
                     "level %d would not be exact doubles; give a lower level, or move the "
                     "world's origin closer",
                     box[0], box[1], box[2],
                     fmax(box[3] - box[0], fmax(box[4] - box[1], box[5] - box[2])), level);
}

static ebpo_status fail_range(double most, ebpo_error *error)
{
    return ebpo_fail(error, EBPO_E_LIMIT,
                     "the result is up to %g long, but volumes of cells must be doubles from "
                     "2^-%d to 2^%d; scale the models by their poses",
                     most, MAX_POWER, MAX_POWER);
}

ebpo_status ebpo_world_make(ebpo_world *out, const ebpo_boolean *b, int level, ebpo_error *error)
{
    double box[6];
    int power;
    *out = (ebpo_world){ .level = level };
    ebpo_boolean_box(b, box);
    if (box[0] > box[3])
        return EBPO_OK;
    double most = fmax(box[3] - box[0], fmax(box[4] - box[1], box[5] - box[2]));
    /* The origin is on a grid of 1/16 of the edge, so it may be up to 1/16 of the edge below the
     * box. So 15/16 of the edge must be at least `most`, the longest side of the box. 1.07 is a
     * little more than 16/15. */
    frexp(1.07 * most, &power);
    if (most == 0 || power < -MAX_POWER || power > MAX_POWER)
        return fail_range(most, error);
    out->edge = ldexp(1, power);
    double grid = out->edge / 16, finest = ldexp(out->edge, -(level > 4 ? level : 4) - 1);
    for (int k = 0; k < 3; k++) {
        out->origin[k] = floor(box[k] / grid) * grid;
        if (!(fabs(out->origin[k]) + out->edge <= 0x1p53 * finest))
            return fail_location(box, level, error);
    }
    return EBPO_OK;
}

ebpo_status ebpo_world_cell_query(const ebpo_boolean *b, unsigned worker, const ebpo_world *w,
                                  ebpo_world_cell *c, unsigned *may, uint8_t *stages,
                                  ebpo_error *error)
{
    double centre[3], half = ebpo_world_edge(w, c->cell.level + 1);
    for (int k = 0; k < 3; k++)
        centre[k] = ebpo_world_cell_face(w, k, c->cell.level + 1, 2 * c->cell.at[k] + 1);
    *may = ebpo_expression_value(&b->expression, c->known, c->in);
    for (uint32_t i = 0; i < b->count && *may == EBPO_MAY_BOTH; i++) {
        unsigned operand, stage;
        if (c->known >> i & 1)
            continue;
        ebpo_status status = ebpo_solid_in_cube(&b->solid[i], ebpo_boolean_context(b, worker, i),
                                                centre, half, &operand, &stage, error);
        if (status != EBPO_OK)
            return status;
        stages[stage]++;
        if (operand == EBPO_MAY_BOTH)
            continue;
        c->known |= UINT64_C(1) << i;
        c->in |= (uint64_t)(operand == EBPO_MAY_IN) << i;
        *may = ebpo_expression_value(&b->expression, c->known, c->in);
    }
    return EBPO_OK;
}
