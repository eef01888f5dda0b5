/* Expressions and poses as texts. */
#ifndef EBPO_TOOLS_BOOLEAN_ARGS_H
#define EBPO_TOOLS_BOOLEAN_ARGS_H

#include <ebpo/boolean.h>

#include "cli/args.h"

typedef struct boolean_nodes {
    ebpo_boolean_node node[EBPO_BOOLEAN_NODES_MAX];
    uint32_t count;
} boolean_nodes;

/* "A - (B | C)": | or + union, & or * intersection, - difference, ^ symmetric difference; & and *
 * bind first, the others from left to right. A is operand 0. False: `name` (the command's) has said
 * on stderr what is wrong (exit with EXIT_USAGE). */
bool boolean_read(const char *name, const char *text, uint32_t operands, boolean_nodes *out);

/* Each text a model and a pose as pose_read has it, into pose[operands], which are set before.
 * False as above. */
bool boolean_read_poses(const char *name, const arg_list *texts, uint32_t operands,
                        ebpo_pose *pose);

#endif
