/* Boolean expressions over solids at poses, evaluated from operands that are in, out or unknown.
 * Expressions: pure functions, any thread. */
#ifndef EBPO_BOOLEAN_BOOLEAN_H
#define EBPO_BOOLEAN_BOOLEAN_H

#include <ebpo/boolean.h>

#include "extras/collide/posed_solid.h"

/* Possible states, as bits. */
enum { EBPO_MAY_IN = 1, EBPO_MAY_OUT = 2, EBPO_MAY_BOTH = 3 };

typedef struct ebpo_expression {
    ebpo_boolean_node node[EBPO_BOOLEAN_NODES_MAX];
    uint32_t count;
} ebpo_expression;

/* Evaluates an expression. If bit i of `known` is set, bit i of `in` is the state of operand i.
 * MAY_IN or MAY_OUT is certain; MAY_BOTH may be more than is possible where an operand is used
 * twice. */
unsigned ebpo_expression_value(const ebpo_expression *e, uint64_t known, uint64_t in);

/* Returns the operands that the result depends on, a bit for each. */
uint64_t ebpo_expression_operands(const ebpo_expression *e);

/* Computes a box that contains the result, low[3] and high[3] in turn, from the operands' boxes.
 * Empty: a low above its high. */
void ebpo_expression_box(const ebpo_expression *e, const double (*box)[6], double out[6]);

/* An expression with its operands. */

struct ebpo_boolean {
    ebpo_expression expression;
    uint32_t count; /* number of operands */
    ebpo_posed_solid *solid;
    ebpo_pose *pose; /* poses of the operands, as given */
    unsigned threads;
    ebpo_context **context; /* [threads][count] */
};

static inline ebpo_context *ebpo_boolean_context(const ebpo_boolean *b, unsigned worker,
                                                 uint32_t operand)
{
    return b->context[(size_t)worker * b->count + operand];
}

/* Uses the contexts of one worker. */
EBPO_MUST_USE ebpo_status ebpo_boolean_query(const ebpo_boolean *b, unsigned worker,
                                             const double w[3], ebpo_boolean_result *out,
                                             ebpo_error *error);

/* Fails with the error of a call about an operand: "FILE: operand 1: ...", from 1 on. */
ebpo_status ebpo_fail_operand(const ebpo_model *model, uint32_t number, const ebpo_error *cause,
                              ebpo_error *error);

#endif
