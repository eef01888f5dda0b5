/* Expressions over operands of which it is known, or not, whether something is inside. Pure
 * functions, any thread. */
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

/* EBPO_E_LIMIT, EBPO_E_ARGUMENT as ebpo_boolean_new says. */
EBPO_MUST_USE ebpo_status ebpo_expression_make(ebpo_expression *out, const ebpo_boolean_node *nodes,
                                               uint32_t count, uint32_t operands,
                                               ebpo_error *error);

/* Bit i of `known`: it is known of operand i, by bit i of `in`. MAY_IN or MAY_OUT is certain;
 * MAY_BOTH may be more than what is possible where an operand is used twice. */
unsigned ebpo_expression_value(const ebpo_expression *e, uint64_t known, uint64_t in);

/* Operands that the result depends on, a bit for each. */
uint64_t ebpo_expression_operands(const ebpo_expression *e);

/* A box that holds the result, low[3] and high[3] in turn; box: those of the operands. Empty: a low
 * above its high. */
void ebpo_expression_box(const ebpo_expression *e, const double (*box)[6], double out[6]);

/* Whether a cube of the world is inside a solid at a pose, outside, or neither for certain. */

/* What has decided. */
enum { EBPO_CUBE_BY_BOX, EBPO_CUBE_BY_NODES, EBPO_CUBE_BY_FACES, EBPO_CUBE_WAYS };

/* An axis-parallel cube by its centre and half its edge. *may: EBPO_MAY_IN when all of the closed
 * cube is inner to the solid, EBPO_MAY_OUT when none of it belongs to it, on posed coordinates;
 * EBPO_MAY_BOTH when a face may be within half the cube's diagonal of its centre. */
EBPO_MUST_USE ebpo_status ebpo_solid_in_cube(const ebpo_posed_solid *s, ebpo_context *context,
                                             const double centre[3], double half, unsigned *may,
                                             unsigned *way, ebpo_error *error);

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
