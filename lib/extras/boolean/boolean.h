/* Boolean expressions over solids at poses. An expression is evaluated from the states of its
 * operands at a point or in a cell: in, out or unknown. Functions on expressions are pure; any
 * thread may call them. */
#ifndef EBPO_BOOLEAN_BOOLEAN_H
#define EBPO_BOOLEAN_BOOLEAN_H

#include <ebpo/boolean.h>

#include "extras/boolean/region_model.h"
#include "extras/collide/posed_solid.h"

/* Possible states of an operand or of a result, as bits. */
enum { EBPO_MAY_IN = 1, EBPO_MAY_OUT = 2, EBPO_MAY_BOTH = 3 };

/* Maximum number of nodes: the caller's nodes, and two nodes for each region (the box or a
 * half-space to which the result is cut). */
enum { EBPO_EXPRESSION_NODES = EBPO_BOOLEAN_NODES_MAX + 2 * EBPO_BOOLEAN_OPERANDS_MAX };

/* An expression whose complements have been replaced by differences from the box. The last node is
 * the result. */
typedef struct ebpo_expression {
    ebpo_boolean_node node[EBPO_EXPRESSION_NODES];
    uint32_t count;
} ebpo_expression;

/* Returns the possible states of an expression. If bit i of `known` is set, bit i of `in` is the
 * state of operand i: 1 for in. If the returned value has one bit, the state is certain. If the
 * expression uses an operand twice, the function may return EBPO_MAY_BOTH although only one state
 * is possible. */
unsigned ebpo_expression_value(const ebpo_expression *e, uint64_t known, uint64_t in);

/* Returns a bit for each operand on which the result depends. */
uint64_t ebpo_expression_operands(const ebpo_expression *e);

/* An expression with its operands. */
struct ebpo_boolean {
    ebpo_expression expression;
    uint32_t count;       /* number of operands: the caller's operands, the box, the half-spaces */
    uint32_t given;       /* number of the caller's operands */
    uint32_t first_plane; /* index of the first half-space */
    ebpo_region_model region[EBPO_BOOLEAN_OPERANDS_MAX]; /* [operand] models of the regions */
    ebpo_posed_solid *solid;                             /* [count] */
    ebpo_pose *pose; /* [count] poses of the operands, as the caller gave them */
    unsigned threads;
    ebpo_context **context; /* [threads][count] contexts of queries */
};

/* Returns true if a point is in the result. in: bit i is set if the point is in operand i. */
static inline bool ebpo_boolean_holds(const ebpo_boolean *b, uint64_t in)
{
    return ebpo_expression_value(&b->expression, UINT64_MAX, in) == EBPO_MAY_IN;
}

static inline ebpo_context *ebpo_boolean_context(const ebpo_boolean *b, unsigned worker,
                                                 uint32_t operand)
{
    return b->context[(size_t)worker * b->count + operand];
}

/* Computes a box that contains the result from the operands' boxes: low[3], then high[3]. If the
 * result is empty, a low is above its high. */
void ebpo_boolean_box(const ebpo_boolean *b, double out[6]);

/* Evaluates the expression at a point of the world. worker: index of the calling thread, whose
 * contexts are used. */
EBPO_MUST_USE ebpo_status ebpo_boolean_query(const ebpo_boolean *b, unsigned worker,
                                             const double point[3], ebpo_boolean_result *out,
                                             ebpo_error *error);

/* Groups equal operands (same content, same pose) that the expression uses. If operand i is the
 * first of its group, equal[i] has a bit for each operand of the group, including i. If operand i
 * is not the first of its group or is not used, equal[i] is 0. */
void ebpo_boolean_find_equal(const ebpo_boolean *b, uint64_t equal[EBPO_BOOLEAN_OPERANDS_MAX]);

/* Fails with the status of `cause`, an error that occurred with an operand. The message begins with
 * "FILE: operand 1: "; messages count operands from 1. operand: index from 0. */
ebpo_status ebpo_fail_operand(const ebpo_model *model, uint32_t operand, const ebpo_error *cause,
                              ebpo_error *error);

#endif
