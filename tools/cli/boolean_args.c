#include "cli/boolean_args.h"

#include <string.h>

#include "cli/command.h"
#include "cli/pose_args.h"

enum { DEPTH_MAX = 64 }; /* maximum number of nested parentheses and complements */

/* A recursive-descent parser. Each function read_... parses the part of the expression that begins
 * at p->at, and sets *number to the index of the part's node. It returns false after an error. */
typedef struct parser {
    const char *name; /* name of the command */
    const char *text, *at;
    uint32_t operands; /* number of models that exist */
    boolean_nodes *out;
    int depth; /* number of open parentheses and complements */
} parser;

static bool fail_here(const parser *p, const char *what)
{
    command_usage(p->name, "expression '%s', column %d: %s", p->text, (int)(p->at - p->text) + 1,
                  what);
    return false;
}

static void skip_blanks(parser *p) { p->at += strspn(p->at, " \t\r\n"); }

static bool add_node(parser *p, int32_t operation, uint32_t left, uint32_t right, uint32_t *number)
{
    if (p->out->count == EBPO_BOOLEAN_NODES_MAX)
        return fail_here(p, "too many operations");
    *number = p->out->count++;
    p->out->node[*number] = (ebpo_boolean_node){ operation, left, right, 0 };
    return true;
}

static bool read_sum(parser *p, uint32_t *number);

static bool read_atom(parser *p, uint32_t *number)
{
    skip_blanks(p);
    if ((*p->at == '(' || *p->at == '~') && ++p->depth > DEPTH_MAX)
        return fail_here(p, "too many nested parentheses or complements");
    if (*p->at == '~') {
        p->at++;
        if (!read_atom(p, number) || !add_node(p, EBPO_BOOLEAN_COMPLEMENT, *number, 0, number))
            return false;
        p->depth--;
    } else if (*p->at == '(') {
        p->at++;
        if (!read_sum(p, number))
            return false;
        if (*p->at != ')')
            return fail_here(p, "expected an operator or ')'");
        p->at++;
        p->depth--;
    } else if (*p->at >= 'A' && *p->at <= 'Z') {
        uint32_t operand = (uint32_t)(*p->at - 'A');
        if (operand >= p->operands)
            return fail_here(p, "there is no such model");
        p->at++;
        if (!add_node(p, EBPO_BOOLEAN_OPERAND, operand, 0, number))
            return false;
    } else {
        return fail_here(p, "expected a model (A, B, ...), '~' or '('");
    }
    skip_blanks(p);
    return true;
}

static bool read_product(parser *p, uint32_t *number)
{
    uint32_t right;
    if (!read_atom(p, number))
        return false;
    while (*p->at == '&' || *p->at == '*') {
        p->at++;
        if (!read_atom(p, &right) ||
            !add_node(p, EBPO_BOOLEAN_INTERSECTION, *number, right, number))
            return false;
    }
    return true;
}

enum { NO_OPERATOR = EBPO_BOOLEAN_OPERAND };

/* Returns the operation of the operator c (| + - ^) in a sum; NO_OPERATOR for any other character.
 */
static int32_t operation_of(char c)
{
    return c == '|' || c == '+' ? EBPO_BOOLEAN_UNION
           : c == '-'           ? EBPO_BOOLEAN_DIFFERENCE
           : c == '^'           ? EBPO_BOOLEAN_SYMMETRIC_DIFFERENCE
                                : NO_OPERATOR;
}

static bool read_sum(parser *p, uint32_t *number)
{
    int32_t operation;
    uint32_t right;
    if (!read_product(p, number))
        return false;
    while ((operation = operation_of(*p->at)) != NO_OPERATOR) {
        p->at++;
        if (!read_product(p, &right) || !add_node(p, operation, *number, right, number))
            return false;
    }
    return true;
}

bool boolean_read(const char *name, const char *text, uint32_t operands, boolean_nodes *out)
{
    parser p = { name, text, text, operands, out, 0 };
    uint32_t root;
    out->count = 0;
    if (!read_sum(&p, &root))
        return false;
    return *p.at == 0 || fail_here(&p, "expected an operator or the end");
}

/* --- poses --- */

static bool read_pose(const char *name, const char *text, uint32_t operands, ebpo_pose *pose)
{
    const char *at = text + strspn(text, " \t");
    uint32_t operand = *at >= 'A' && *at <= 'Z' ? (uint32_t)(*at - 'A') : operands;
    if (operand < operands && pose_read(at + 1, &pose[operand]))
        return true;
    command_usage(name,
                  "--pose '%s': expected a model and a pose, 'B " POSE_FORM
                  "' with a quaternion that is not 0",
                  text);
    return false;
}

bool boolean_read_poses(const char *name, const arg_list *texts, uint32_t operands, ebpo_pose *pose)
{
    for (int i = 0; i < texts->count; i++)
        if (!read_pose(name, texts->item[i], operands, pose))
            return false;
    return true;
}

/* --- planes --- */

bool boolean_read_plane(const char *name, const char *text, double plane[4])
{
    int axis = text[0] - 'x'; /* 0 to 2 for x, y, z; not used if the text is four numbers */
    for (int k = 0; k < 4; k++)
        plane[k] = k == axis;
    if (axis >= 0 && axis < 3 && text[1] == '=' ? args_read_reals(text + 2, 1, plane + 3)
                                                : args_read_reals(text, 4, plane))
        return true;
    command_usage(name, "--section '%s': expected x=V, y=V, z=V or four numbers NX,NY,NZ,D", text);
    return false;
}
