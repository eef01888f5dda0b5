/* Boolean expressions over solids at poses. They are evaluated from the states of operands: in, out
 * or unknown. Functions on expressions are pure; any thread may call them. */
#ifndef EBPO_BOOLEAN_BOOLEAN_H
#define EBPO_BOOLEAN_BOOLEAN_H

#include <ebpo/boolean.h>

#include "extras/boolean/region_model.h"
#include "extras/collide/posed_solid.h"

/* Possible states, as bits. */
enum { EBPO_MAY_IN = 1, EBPO_MAY_OUT = 2, EBPO_MAY_BOTH = 3 };

/* Maximum number of nodes: those of the caller, and two for each region. */
enum { EBPO_EXPRESSION_NODES = EBPO_BOOLEAN_NODES_MAX + 2 * EBPO_BOOLEAN_OPERANDS_MAX };

/* Nodes without complements. */
typedef struct ebpo_expression {
    ebpo_boolean_node node[EBPO_EXPRESSION_NODES];
    uint32_t count;
} ebpo_expression;

/* Returns the possible states of an expression. If bit i of `known` is set, bit i of `in` is the
 * state of operand i. MAY_IN or MAY_OUT alone is certain; MAY_BOTH may be returned although only
 * one is possible, if an operand is used twice. */
unsigned ebpo_expression_value(const ebpo_expression *e, uint64_t known, uint64_t in);

/* Returns the operands on which the result depends, a bit for each. */
uint64_t ebpo_expression_operands(const ebpo_expression *e);

/* An expression with its operands. */

struct ebpo_boolean {
    ebpo_expression expression;
    uint32_t count;       /* number of operands */
    uint32_t given;       /* number of the caller's operands; the others are regions */
    uint32_t first_plane; /* the first half-space; the box, if any, is before it */
    ebpo_region_model region[EBPO_BOOLEAN_OPERANDS_MAX]; /* models of the regions */
    ebpo_posed_solid *solid;
    ebpo_pose *pose; /* poses of the operands, as the caller gave them */
    unsigned threads;
    ebpo_context **context; /* [threads][count] */
};

/* Returns true if a point is in the result. in: bit i is set if it is in operand i. */
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

/* Uses the contexts of one worker. */
EBPO_MUST_USE ebpo_status ebpo_boolean_query(const ebpo_boolean *b, unsigned worker,
                                             const double w[3], ebpo_boolean_result *out,
                                             ebpo_error *error);

/* Groups equal operands (same content, same pose) that the expression uses. same[i] has a bit for
 * each operand that is equal to operand i, if i is the first of them; otherwise it is 0. */
void ebpo_boolean_find_equal(const ebpo_boolean *b, uint64_t same[EBPO_BOOLEAN_OPERANDS_MAX]);

/* Fails with the error of a call about an operand. The message begins with "FILE: operand 1: ...";
 * operands are numbered from 1. */
ebpo_status ebpo_fail_operand(const ebpo_model *model, uint32_t number, const ebpo_error *cause,
                              ebpo_error *error);

#endif
