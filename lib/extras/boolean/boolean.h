/* Boolean expressions over solids at poses, evaluated where each operand is known to be in or out,
 * or not known. Expressions: pure functions, any thread. */
#ifndef EBPO_BOOLEAN_BOOLEAN_H
#define EBPO_BOOLEAN_BOOLEAN_H

#include <ebpo/boolean.h>

#include "extras/collide/posed_solid.h"

/* What is possible, as bits. */
enum { EBPO_MAY_IN = 1, EBPO_MAY_OUT = 2, EBPO_MAY_BOTH = 3 };

typedef struct ebpo_expression {
    ebpo_boolean_node node[EBPO_BOOLEAN_NODES_MAX];
    uint32_t count;
} ebpo_expression;

/* Bit i of `known`: it is known of operand i, by bit i of `in`. MAY_IN or MAY_OUT is certain;
 * MAY_BOTH may be more than what is possible where an operand is used twice. */
unsigned ebpo_expression_value(const ebpo_expression *e, uint64_t known, uint64_t in);

/* Operands that the result depends on, a bit for each. */
uint64_t ebpo_expression_operands(const ebpo_expression *e);

/* A box that holds the result, low[3] and high[3] in turn; box: those of the operands. Empty: a low
 * above its high. */
void ebpo_expression_box(const ebpo_expression *e, const double (*box)[6], double out[6]);

/* An expression at work. */

struct ebpo_boolean {
    ebpo_expression expression;
    uint32_t count; /* operands */
    ebpo_posed_solid *solid;
    ebpo_pose *pose; /* of each, as it was given */
    unsigned threads;
    ebpo_context **context; /* [threads][count] */
};

static inline ebpo_context *ebpo_boolean_context(const ebpo_boolean *b, unsigned worker,
                                                 uint32_t operand)
{
    return b->context[(size_t)worker * b->count + operand];
}

/* With the contexts of one worker. */
EBPO_MUST_USE ebpo_status ebpo_boolean_ask(const ebpo_boolean *b, unsigned worker,
                                           const double w[3], ebpo_boolean_result *out,
                                           ebpo_error *error);

/* Hands on what a call about an operand has said: "FILE: operand 1: ...", from 1 on. */
ebpo_status ebpo_fail_operand(const ebpo_model *model, uint32_t number, const ebpo_error *cause,
                              ebpo_error *error);

#endif
