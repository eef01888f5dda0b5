#include "core/strict_fp.h"

#include "extras/boolean/world_cell.h"

#include <math.h>
#include <string.h>

#include "core/error.h"

/* Smaller or larger than 2^+-this, and volumes of cells would leave the range of doubles. */
enum { MOST_POWER = 300 };

static ebpo_status fail_place(const double box[6], int level, ebpo_error *error)
{
    return ebpo_fail(error, EBPO_E_LIMIT,
                     "the result is around (%g, %g, %g), up to %g long: corners of cells of level "
                     "%d would be no exact doubles; give a lower level, or move the world's origin "
                     "closer",
                     box[0], box[1], box[2],
                     fmax(box[3] - box[0], fmax(box[4] - box[1], box[5] - box[2])), level);
}

static ebpo_status fail_range(double most, ebpo_error *error)
{
    return ebpo_fail(error, EBPO_E_LIMIT,
                     "the result is up to %g long, and volumes of cells are doubles from 2^-%d to "
                     "2^%d only; scale the models by their poses",
                     most, MOST_POWER, MOST_POWER);
}

ebpo_status ebpo_world_make(ebpo_world *out, const ebpo_boolean *b, int level, ebpo_error *error)
{
    double boxes[EBPO_BOOLEAN_OPERANDS_MAX][6], box[6];
    int power;
    *out = (ebpo_world){ .level = level };
    for (uint32_t i = 0; i < b->count; i++)
        memcpy(boxes[i], b->solid[i].box, sizeof boxes[i]);
    ebpo_expression_box(&b->expression, (const double(*)[6])boxes, box);
    if (box[0] > box[3])
        return EBPO_OK;
    double most = fmax(box[3] - box[0], fmax(box[4] - box[1], box[5] - box[2]));
    frexp(1.07 * most, &power); /* 16 / 15 and its rounding: the origin is on a grid of 1 / 16 */
    if (most == 0 || power < -MOST_POWER || power > MOST_POWER)
        return fail_range(most, error);
    out->edge = ldexp(1, power);
    double grid = out->edge / 16, finest = ldexp(out->edge, -(level > 4 ? level : 4) - 1);
    for (int k = 0; k < 3; k++) {
        out->origin[k] = floor(box[k] / grid) * grid;
        if (!(fabs(out->origin[k]) + out->edge <= 0x1p53 * finest))
            return fail_place(box, level, error);
    }
    return EBPO_OK;
}

ebpo_status ebpo_world_cell_ask(const ebpo_boolean *b, unsigned worker, const ebpo_world *w,
                                ebpo_world_cell *c, unsigned *may, uint8_t *ways, ebpo_error *error)
{
    double centre[3], half = ebpo_world_edge(w, c->cell.level + 1);
    for (int k = 0; k < 3; k++)
        centre[k] = ebpo_world_wall(w, k, c->cell.level + 1, 2 * c->cell.at[k] + 1);
    *may = ebpo_expression_value(&b->expression, c->known, c->in);
    for (uint32_t i = 0; i < b->count && *may == EBPO_MAY_BOTH; i++) {
        unsigned operand, way;
        if (c->known >> i & 1)
            continue;
        ebpo_status status = ebpo_solid_in_cube(&b->solid[i], ebpo_boolean_context(b, worker, i),
                                                centre, half, &operand, &way, error);
        if (status != EBPO_OK)
            return status;
        ways[way]++;
        if (operand == EBPO_MAY_BOTH)
            continue;
        c->known |= UINT64_C(1) << i;
        c->in |= (uint64_t)(operand == EBPO_MAY_IN) << i;
        *may = ebpo_expression_value(&b->expression, c->known, c->in);
    }
    return EBPO_OK;
}
