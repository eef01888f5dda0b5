#include "core/strict_fp.h"

#include "extras/boolean/expression.h"

#include <inttypes.h>
#include <math.h>
#include <string.h>

#include "core/error.h"

static ebpo_status check_node(const ebpo_boolean_node *node, uint32_t number, uint32_t operands,
                              ebpo_error *error)
{
    bool operand = node->operation == EBPO_BOOLEAN_OPERAND;
    if (node->operation < 0 || node->operation > EBPO_BOOLEAN_SYMMETRIC_DIFFERENCE)
        return ebpo_fail(error, EBPO_E_ARGUMENT,
                         "node %" PRIu32 " of the expression: there is no operation %" PRId32,
                         number, node->operation);
    if (operand && node->left >= operands)
        return ebpo_fail(error, EBPO_E_ARGUMENT,
                         "node %" PRIu32 " of the expression: left is %" PRIu32
                         ", but operands are numbered from 0 and there are %" PRIu32,
                         number, node->left, operands);
    if (!operand && (node->left >= number || node->right >= number))
        return ebpo_fail(error, EBPO_E_ARGUMENT,
                         "node %" PRIu32 " of the expression names node %" PRIu32
                         ", which does not stand before it",
                         number, node->left >= number ? node->left : node->right);
    return EBPO_OK;
}

ebpo_status ebpo_expression_make(ebpo_expression *out, const ebpo_boolean_node *nodes,
                                 uint32_t count, uint32_t operands, ebpo_error *error)
{
    if (count == 0 || count > EBPO_BOOLEAN_NODES_MAX)
        return ebpo_fail(error, EBPO_E_LIMIT, "an expression of %" PRIu32 " nodes; give 1 to %d",
                         count, EBPO_BOOLEAN_NODES_MAX);
    ebpo_status status = EBPO_OK;
    for (uint32_t i = 0; i < count && status == EBPO_OK; i++)
        status = check_node(&nodes[i], i, operands, error);
    if (status != EBPO_OK)
        return status;
    memcpy(out->node, nodes, count * sizeof *nodes);
    out->count = count;
    return EBPO_OK;
}

static unsigned opposite(unsigned may)
{
    return (may & EBPO_MAY_IN ? EBPO_MAY_OUT : 0u) | (may & EBPO_MAY_OUT ? EBPO_MAY_IN : 0u);
}

/* In both: possible if it is in both; not in both: possible if it is not in either. */
static unsigned both(unsigned a, unsigned b)
{
    return (a & b & EBPO_MAY_IN) | ((a | b) & EBPO_MAY_OUT);
}

static unsigned combine(int32_t operation, unsigned a, unsigned b)
{
    switch (operation) {
    case EBPO_BOOLEAN_UNION: return opposite(both(opposite(a), opposite(b)));
    case EBPO_BOOLEAN_INTERSECTION: return both(a, b);
    case EBPO_BOOLEAN_DIFFERENCE: return both(a, opposite(b));
    default: break;
    }
    if (a == EBPO_MAY_BOTH || b == EBPO_MAY_BOTH)
        return EBPO_MAY_BOTH;
    return a != b ? EBPO_MAY_IN : EBPO_MAY_OUT;
}

unsigned ebpo_expression_value(const ebpo_expression *e, uint64_t known, uint64_t in)
{
    uint8_t may[EBPO_BOOLEAN_NODES_MAX];
    for (uint32_t i = 0; i < e->count; i++) {
        const ebpo_boolean_node *n = &e->node[i];
        if (n->operation != EBPO_BOOLEAN_OPERAND)
            may[i] = (uint8_t)combine(n->operation, may[n->left], may[n->right]);
        else
            may[i] = !(known >> n->left & 1) ? EBPO_MAY_BOTH
                     : in >> n->left & 1     ? EBPO_MAY_IN
                                             : EBPO_MAY_OUT;
    }
    return may[e->count - 1];
}

uint64_t ebpo_expression_operands(const ebpo_expression *e)
{
    bool used[EBPO_BOOLEAN_NODES_MAX] = { false };
    uint64_t operands = 0;
    used[e->count - 1] = true;
    for (uint32_t i = e->count; i-- > 0;) {
        const ebpo_boolean_node *n = &e->node[i];
        if (used[i] && n->operation == EBPO_BOOLEAN_OPERAND)
            operands |= UINT64_C(1) << n->left;
        else if (used[i])
            used[n->left] = used[n->right] = true;
    }
    return operands;
}

static void combine_boxes(int32_t operation, const double a[6], const double b[6], double out[6])
{
    bool smaller = operation == EBPO_BOOLEAN_INTERSECTION;
    if (operation == EBPO_BOOLEAN_DIFFERENCE)
        memcpy(out, a, 6 * sizeof *out);
    for (int k = 0; k < 3 && operation != EBPO_BOOLEAN_DIFFERENCE; k++) {
        out[k] = smaller ? fmax(a[k], b[k]) : fmin(a[k], b[k]);
        out[3 + k] = smaller ? fmin(a[3 + k], b[3 + k]) : fmax(a[3 + k], b[3 + k]);
    }
    if (out[0] > out[3] || out[1] > out[4] || out[2] > out[5])
        for (int k = 0; k < 3; k++) { /* so that a union takes no part of what is empty */
            out[k] = INFINITY;
            out[3 + k] = -INFINITY;
        }
}

void ebpo_expression_box(const ebpo_expression *e, const double (*box)[6], double out[6])
{
    double of[EBPO_BOOLEAN_NODES_MAX][6];
    for (uint32_t i = 0; i < e->count; i++) {
        const ebpo_boolean_node *n = &e->node[i];
        if (n->operation == EBPO_BOOLEAN_OPERAND)
            memcpy(of[i], box[n->left], sizeof of[i]);
        else
            combine_boxes(n->operation, (const double *)of[n->left], (const double *)of[n->right],
                          of[i]);
    }
    memcpy(out, of[e->count - 1], sizeof of[0]);
}
