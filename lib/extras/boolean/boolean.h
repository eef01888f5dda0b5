/* An expression at work. */
#ifndef EBPO_BOOLEAN_BOOLEAN_H
#define EBPO_BOOLEAN_BOOLEAN_H

#include "extras/boolean/expression.h"
#include "extras/collide/posed_sides.h"

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
