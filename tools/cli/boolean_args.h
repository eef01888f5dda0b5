/* Parses Boolean expressions, poses of operands, and planes at which a result is cut. */
#ifndef EBPO_TOOLS_BOOLEAN_ARGS_H
#define EBPO_TOOLS_BOOLEAN_ARGS_H

#include <ebpo/boolean.h>

#include "cli/args.h"

typedef struct boolean_nodes {
    ebpo_boolean_node node[EBPO_BOOLEAN_NODES_MAX];
    uint32_t count;
} boolean_nodes;

/* Parses an expression such as "A - (B | C)":
 *   | or +  union
 *   & or *  intersection
 *   -       difference
 *   ^       symmetric difference
 *   ~       complement, before a model, '~' or '('
 * ~ binds first, then & and *; the other operators are evaluated from left to right. A is operand
 * 0, B is operand 1, and so on. `operands`: number of operands. Returns false after an error, which
 * is reported on stderr for the command `name`; the caller exits with EXIT_USAGE. */
bool boolean_read(const char *name, const char *text, uint32_t operands, boolean_nodes *out);

/* Reads texts such as 'B 1 0 0', the letter of an operand and its pose (see pose_read), into
 * pose[operands], which the caller has initialized. Returns false after an error, as boolean_read
 * does. */
bool boolean_read_poses(const char *name, const arg_list *texts, uint32_t operands,
                        ebpo_pose *pose);

/* Reads a plane in the form 'NX,NY,NZ,D' or 'x=V'. `plane`: receives the four numbers that
 * ebpo_boolean_options.planes has for a plane. Returns false after an error, as boolean_read does.
 */
bool boolean_read_plane(const char *name, const char *text, double plane[4]);

#endif
