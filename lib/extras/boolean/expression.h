/* Expressions over operands of which it is known, or not, whether something is inside. Pure
 * functions, any thread. */
#ifndef EBPO_BOOLEAN_EXPRESSION_H
#define EBPO_BOOLEAN_EXPRESSION_H

#include <ebpo/boolean.h>

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

#endif
