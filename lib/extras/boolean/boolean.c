/* Evaluates Boolean expressions over solids at poses (union, intersection, difference, symmetric
 * difference and complement) at points of the world.
 *
 * An expression is a list of nodes. Each node refers to earlier nodes or to an operand. The states
 * of the operands (in, out, or unknown) give the possible results. If a point is on a face of an
 * operand, the result is computed on both sides of the face. Operands are queried until the result
 * is certain. Proofs: docs/develop/booleans.md. The object is immutable after creation; each thread
 * has separate contexts. */
#include "core/strict_fp.h"

#include <inttypes.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "core/alloc.h"
#include "core/error.h"
#include "core/fp_env.h"
#include "core/parallel.h"
#include "extras/boolean/boolean.h"
#include "geometry/predicates.h"
#include "geometry/level_nodes.h"
#include "query/query_model.h"

/* --- expressions --- */

/* Returns true if the operation refers to one other node (`left`), not two. */
static bool has_one_node(int32_t operation) { return operation == EBPO_BOOLEAN_COMPLEMENT; }

static ebpo_status check_node(const ebpo_boolean_node *node, uint32_t number, uint32_t operands,
                              bool has_box, ebpo_error *error)
{
    bool operand = node->operation == EBPO_BOOLEAN_OPERAND, one = has_one_node(node->operation);
    if (node->operation < 0 || node->operation > EBPO_BOOLEAN_COMPLEMENT)
        return ebpo_fail(error, EBPO_E_ARGUMENT,
                         "node %" PRIu32 " of the expression: unknown operation %" PRId32, number,
                         node->operation);
    if (operand && node->left >= operands)
        return ebpo_fail(error, EBPO_E_ARGUMENT,
                         "node %" PRIu32 " of the expression: left is %" PRIu32
                         ", but operands are numbered from 0 and there are %" PRIu32,
                         number, node->left, operands);
    if (!operand && (node->left >= number || (!one && node->right >= number)))
        return ebpo_fail(error, EBPO_E_ARGUMENT,
                         "node %" PRIu32 " of the expression refers to node %" PRIu32
                         ", but must refer to earlier nodes",
                         number, node->left >= number ? node->left : node->right);
    if (one && !has_box)
        return ebpo_fail(error, EBPO_E_ARGUMENT,
                         "node %" PRIu32 " of the expression is a complement; give a box to which "
                         "the result is cut",
                         number);
    return EBPO_OK;
}

static void add_node(ebpo_expression *e, int32_t operation, uint32_t left, uint32_t right)
{
    e->node[e->count++] = (ebpo_boolean_node){ operation, left, right, 0 };
}

/* Intersects the expression with an operand. */
static void cut_expression(ebpo_expression *e, uint32_t operand)
{
    add_node(e, EBPO_BOOLEAN_OPERAND, operand, 0);
    add_node(e, EBPO_BOOLEAN_INTERSECTION, e->count - 2, e->count - 1);
}

/* Copies the caller's nodes. If there is a box, node 0 is the box, and the result is cut to it.
 * Inside the box, the complement of a solid is equal to the box minus the solid. So each complement
 * node is replaced by a difference node: node 0 minus the node `left`. Fails with EBPO_E_LIMIT and
 * EBPO_E_ARGUMENT, as documented at ebpo_boolean_new. */
static ebpo_status make_expression(ebpo_boolean *b, const ebpo_boolean_node *nodes, uint32_t count,
                                   bool has_box, ebpo_error *error)
{
    ebpo_expression *e = &b->expression;
    uint32_t shift = has_box ? 1 : 0; /* the index of a caller's node increases by this */
    if (count == 0 || count > EBPO_BOOLEAN_NODES_MAX)
        return ebpo_fail(error, EBPO_E_LIMIT,
                         "the expression has %" PRIu32 " nodes; give 1 to %d nodes", count,
                         EBPO_BOOLEAN_NODES_MAX);
    if (has_box)
        add_node(e, EBPO_BOOLEAN_OPERAND, b->given, 0);
    for (uint32_t i = 0; i < count; i++) {
        ebpo_boolean_node n = nodes[i];
        ebpo_status status = check_node(&n, i, b->given, has_box, error);
        if (status != EBPO_OK)
            return status;
        if (n.operation == EBPO_BOOLEAN_OPERAND)
            add_node(e, n.operation, n.left, 0);
        else if (has_one_node(n.operation))
            add_node(e, EBPO_BOOLEAN_DIFFERENCE, 0, n.left + shift);
        else
            add_node(e, n.operation, n.left + shift, n.right + shift);
    }
    if (has_box)
        add_node(e, EBPO_BOOLEAN_INTERSECTION, 0, e->count - 1);
    return EBPO_OK;
}

static unsigned may_not(unsigned may)
{
    return (may & EBPO_MAY_IN ? EBPO_MAY_OUT : 0u) | (may & EBPO_MAY_OUT ? EBPO_MAY_IN : 0u);
}

/* Returns the possible states of an intersection of two operands. The state "in" is possible if it
 * is possible for both operands. The state "out" is possible if it is possible for at least one
 * operand. */
static unsigned may_in_both(unsigned a, unsigned b)
{
    return (a & b & EBPO_MAY_IN) | ((a | b) & EBPO_MAY_OUT);
}

static unsigned combine_values(int32_t operation, unsigned a, unsigned b)
{
    switch (operation) {
    case EBPO_BOOLEAN_UNION: return may_not(may_in_both(may_not(a), may_not(b)));
    case EBPO_BOOLEAN_INTERSECTION: return may_in_both(a, b);
    case EBPO_BOOLEAN_DIFFERENCE: return may_in_both(a, may_not(b));
    default: break;
    }
    if (a == EBPO_MAY_BOTH || b == EBPO_MAY_BOTH) /* symmetric difference */
        return EBPO_MAY_BOTH;
    return a != b ? EBPO_MAY_IN : EBPO_MAY_OUT;
}

unsigned ebpo_expression_value(const ebpo_expression *e, uint64_t known, uint64_t in)
{
    uint8_t may[EBPO_EXPRESSION_NODES];
    for (uint32_t i = 0; i < e->count; i++) {
        const ebpo_boolean_node *n = &e->node[i];
        if (n->operation != EBPO_BOOLEAN_OPERAND)
            may[i] = (uint8_t)combine_values(n->operation, may[n->left], may[n->right]);
        else
            may[i] = !(known >> n->left & 1) ? EBPO_MAY_BOTH
                     : in >> n->left & 1     ? EBPO_MAY_IN
                                             : EBPO_MAY_OUT;
    }
    return may[e->count - 1];
}

uint64_t ebpo_expression_operands(const ebpo_expression *e)
{
    bool used[EBPO_EXPRESSION_NODES] = { false };
    uint64_t operands = 0;
    used[e->count - 1] = true;
    for (uint32_t i = e->count; i-- > 0;) {
        const ebpo_boolean_node *n = &e->node[i];
        if (used[i] && n->operation == EBPO_BOOLEAN_OPERAND)
            operands |= UINT64_C(1) << n->left;
        else if (used[i])
            used[n->left] = used[n->right] = true;
    }
    return operands;
}

/* Computes a box that contains the result of an operation on two solids, one in box a and one in
 * box b. The box of a difference is a. */
static void combine_boxes(int32_t operation, const double a[6], const double b[6], double out[6])
{
    bool smaller = operation == EBPO_BOOLEAN_INTERSECTION;
    if (operation == EBPO_BOOLEAN_DIFFERENCE)
        memcpy(out, a, 6 * sizeof *out);
    for (int k = 0; k < 3 && operation != EBPO_BOOLEAN_DIFFERENCE; k++) {
        out[k] = smaller ? fmax(a[k], b[k]) : fmin(a[k], b[k]);
        out[3 + k] = smaller ? fmin(a[3 + k], b[3 + k]) : fmax(a[3 + k], b[3 + k]);
    }
    if (out[0] > out[3] || out[1] > out[4] || out[2] > out[5])
        for (int k = 0; k < 3; k++) { /* an empty box does not extend the box of a union */
            out[k] = INFINITY;
            out[3 + k] = -INFINITY;
        }
}

void ebpo_boolean_box(const ebpo_boolean *b, double out[6])
{
    const ebpo_expression *e = &b->expression;
    double box[EBPO_EXPRESSION_NODES][6]; /* box of each node */
    for (uint32_t i = 0; i < e->count; i++) {
        const ebpo_boolean_node *n = &e->node[i];
        if (n->operation == EBPO_BOOLEAN_OPERAND)
            memcpy(box[i], b->solid[n->left].box, sizeof box[i]);
        else
            combine_boxes(n->operation, (const double *)box[n->left], (const double *)box[n->right],
                          box[i]);
    }
    memcpy(out, box[e->count - 1], sizeof box[0]);
}

/* --- equal operands --- */

static bool equal_operands(const ebpo_boolean *b, uint32_t i, uint32_t k)
{
    return ebpo_same_model(b->solid[i].model, b->solid[k].model) &&
           memcmp(&b->pose[i], &b->pose[k], sizeof b->pose[i]) == 0;
}

void ebpo_boolean_find_equal(const ebpo_boolean *b, uint64_t equal[EBPO_BOOLEAN_OPERANDS_MAX])
{
    uint64_t used = ebpo_expression_operands(&b->expression);
    memset(equal, 0, EBPO_BOOLEAN_OPERANDS_MAX * sizeof *equal);
    for (uint32_t i = 0; i < b->count; i++) {
        uint32_t k = 0;
        if (!(used >> i & 1))
            continue;
        while (k < i && !(equal[k] && equal_operands(b, k, i)))
            k++;
        equal[k] |= UINT64_C(1) << i;
    }
}

/* --- creation --- */

ebpo_status ebpo_fail_operand(const ebpo_model *model, uint32_t operand, const ebpo_error *cause,
                              ebpo_error *error)
{
    const char *file = model->file->in.shown, *message = cause->message;
    size_t length = strlen(file);
    if (strncmp(message, file, length) == 0 && strncmp(message + length, ": ", 2) == 0)
        message += length + 2; /* the message begins with the file's name already */
    return ebpo_fail_file(error, cause->status, file, "operand %" PRIu32 ": %s", operand + 1,
                          message);
}

static ebpo_status add_solid(ebpo_boolean *b, ebpo_model *model, const ebpo_pose *pose,
                             ebpo_error *error)
{
    ebpo_error cause = EBPO_ERROR_INIT;
    if (ebpo_check_solid(model, &cause) != EBPO_OK ||
        ebpo_posed_solid_make(&b->solid[b->count], model, pose, &cause) != EBPO_OK)
        return ebpo_fail_operand(model, b->count, &cause, error);
    b->pose[b->count++] = *pose;
    return EBPO_OK;
}

/* Adds a region as an operand. status: result of making the region's model. */
static ebpo_status add_region(ebpo_boolean *b, ebpo_status status, ebpo_error *error)
{
    const ebpo_pose pose = EBPO_POSE_INIT;
    return status == EBPO_OK ? add_solid(b, b->region[b->count].model, &pose, error) : status;
}

/* Adds the half-spaces as operands, and intersects the expression with them. The model of a
 * half-space contains only the part near the box of the expression. */
static ebpo_status add_half_spaces(ebpo_boolean *b, const ebpo_boolean_options *options,
                                   ebpo_error *error)
{
    double box[6];
    ebpo_status status = EBPO_OK;
    ebpo_boolean_box(b, box);
    b->first_plane = b->count;
    for (uint32_t i = 0; i < options->plane_count && status == EBPO_OK; i++) {
        status = ebpo_region_half_space(&b->region[b->count], options->planes + 4 * i, box,
                                        options->temp_dir, error);
        status = add_region(b, status, error);
        if (status == EBPO_OK)
            cut_expression(&b->expression, b->count - 1);
    }
    return status;
}

/* Fails if two operands have different units. Units are texts that the user chose. An operand
 * without a unit may be combined with every unit, and so may an operand that its pose scales: the
 * pose may convert its unit into the unit of the world. */
static ebpo_status check_units(const ebpo_boolean *b, ebpo_error *error)
{
    const char *unit = "";
    uint64_t used = ebpo_expression_operands(&b->expression);
    for (uint32_t i = 0; i < b->count; i++) {
        const ebpo_model *model = b->solid[i].model;
        const char *own = model->info->unit;
        ebpo_error cause = EBPO_ERROR_INIT;
        if (!(used >> i & 1) || !own[0] || b->pose[i].scale != 1)
            continue;
        if (unit[0] && strcmp(unit, own) != 0) {
            ebpo_fail(&cause, EBPO_E_ARGUMENT,
                      "the unit is %s, but another operand has the unit %s; convert a model again "
                      "with the same unit, or scale it by its pose",
                      own, unit);
            return ebpo_fail_operand(model, i, &cause, error);
        }
        unit = own;
    }
    return EBPO_OK;
}

static ebpo_status make_contexts(ebpo_boolean *b, ebpo_error *error)
{
    ebpo_status status = EBPO_OK;
    for (size_t i = 0; i < (size_t)b->threads * b->count && status == EBPO_OK; i++)
        status = ebpo_context_new(b->solid[i % b->count].model, &b->context[i], error);
    return status;
}

static ebpo_status fill_operands(ebpo_boolean *b, const ebpo_boolean_operand *operands,
                                 const ebpo_boolean_options *options, ebpo_error *error)
{
    uint32_t all = b->given + (options->box ? 1 : 0) + options->plane_count;
    ebpo_status status = EBPO_OK;
    b->solid = ebpo_alloc_zero(all, sizeof *b->solid);
    b->pose = ebpo_alloc_zero(all, sizeof *b->pose);
    b->context = ebpo_alloc_zero((uint64_t)b->threads * all, sizeof(ebpo_context *));
    if (!b->solid || !b->pose || !b->context)
        return ebpo_fail_memory(error, all * (sizeof *b->solid + b->threads * sizeof(void *)));
    for (uint32_t i = 0; i < b->given && status == EBPO_OK; i++)
        status = add_solid(b, operands[i].model, &operands[i].pose, error);
    if (status == EBPO_OK && options->box) {
        status = ebpo_region_box(&b->region[b->count], options->box, options->temp_dir, error);
        status = add_region(b, status, error);
    }
    if (status == EBPO_OK)
        status = add_half_spaces(b, options, error);
    if (status == EBPO_OK)
        status = check_units(b, error);
    return status == EBPO_OK ? make_contexts(b, error) : status;
}

ebpo_status ebpo_boolean_new(const ebpo_boolean_operand *operands, uint32_t operand_count,
                             const ebpo_boolean_node *nodes, uint32_t node_count,
                             const ebpo_boolean_options *options, ebpo_boolean **out,
                             ebpo_error *error)
{
    EBPO_DEFAULT_FP;
    ebpo_boolean_options checked = EBPO_BOOLEAN_OPTIONS_INIT;
    *out = NULL;
    ebpo_status status = EBPO_TAKE(ebpo_boolean_options, &checked, options, error);
    if (status != EBPO_OK)
        return status;
    uint64_t all = (uint64_t)operand_count + (checked.box ? 1 : 0) + checked.plane_count;
    if (operand_count == 0 || all > EBPO_BOOLEAN_OPERANDS_MAX)
        return ebpo_fail(error, EBPO_E_LIMIT,
                         "the expression has %" PRIu64 " operands; give 1 to %d operands", all,
                         EBPO_BOOLEAN_OPERANDS_MAX);
    ebpo_boolean *b = ebpo_alloc_zero(1, sizeof *b);
    if (!b)
        return ebpo_fail_memory(error, sizeof *b);
    b->given = operand_count;
    b->threads = ebpo_thread_count(checked.threads);
    status = make_expression(b, nodes, node_count, checked.box != NULL, error);
    if (status == EBPO_OK)
        status = fill_operands(b, operands, &checked, error);
    if (status == EBPO_OK)
        *out = b;
    else
        ebpo_boolean_free(b);
    return status;
}

void ebpo_boolean_free(ebpo_boolean *b)
{
    if (!b)
        return;
    for (size_t i = 0; b->context && i < (size_t)b->threads * b->count; i++)
        ebpo_context_free(b->context[i]);
    for (uint32_t i = b->given; i < EBPO_BOOLEAN_OPERANDS_MAX; i++)
        ebpo_region_model_free(&b->region[i]);
    free(b->context);
    free(b->solid);
    free(b->pose);
    free(b);
}

/* --- points --- */

/* States of the operands at a point. If the point is on a face, each operand has one state just
 * above the plane of the face and one state just below it. */
typedef struct operand_states {
    uint64_t known;     /* a bit for each operand that has the same state on both sides */
    uint64_t above;     /* a bit for each operand that contains the points just above the plane */
    uint64_t below;     /* a bit for each operand that contains the points just below the plane */
    bool flat;          /* all faces through the point are in one plane */
    bool on;            /* the point is on the boundary of an operand */
    double plane[3][3]; /* three points of the plane, if `on` */
} operand_states;

static bool same_plane(const double a[3][3], const double b[3][3])
{
    for (int i = 0; i < 3; i++)
        if (ebpo_orient3d(a[0], a[1], a[2], b[i]) != 0)
            return false;
    return true;
}

/* Adds the states of operand i. sides: the operand's winding numbers at the point, on both sides of
 * the face that contains the point. */
static void add_states(operand_states *o, uint32_t i, ebpo_rule rule, const ebpo_posed_sides *sides)
{
    uint64_t above = ebpo_rule_inside(rule, sides->above),
             below = ebpo_rule_inside(rule, sides->below);
    if (sides->flat && above == below) { /* the point is not on the operand's boundary, although a
                                          * face contains the point */
        o->known |= UINT64_C(1) << i;
        o->above |= above << i;
        o->below |= above << i;
        return;
    }
    o->above |= above << i;
    o->below |= below << i;
    if (!sides->flat ||
        (o->on && !same_plane((const double(*)[3])o->plane, (const double(*)[3])sides->plane)))
        o->flat = false;
    for (int k = 0; k < 9; k++)
        o->plane[k / 3][k % 3] = sides->plane[k / 3][k % 3];
    o->on = true;
}

/* Sets the result. may: the result's possible states, computed from the known states of operands.
 * If all faces through the point are in one plane, the states on both sides of the plane decide. */
static void conclude_result(const ebpo_boolean *b, const operand_states *o, unsigned may,
                            ebpo_boolean_result *out)
{
    if (may == EBPO_MAY_BOTH && o->flat) {
        uint64_t all = ~UINT64_C(0);
        may = ebpo_expression_value(&b->expression, all, o->above) |
              ebpo_expression_value(&b->expression, all, o->below);
    }
    out->where = may == EBPO_MAY_IN ? EBPO_IN : may == EBPO_MAY_OUT ? EBPO_OUT : EBPO_ON;
    out->certain = out->where != EBPO_ON || o->flat;
}

ebpo_status ebpo_boolean_query(const ebpo_boolean *b, unsigned worker, const double point[3],
                               ebpo_boolean_result *out, ebpo_error *error)
{
    operand_states o = { .flat = true };
    unsigned may = EBPO_MAY_BOTH;
    for (uint32_t i = 0; i < b->count && may == EBPO_MAY_BOTH; i++) {
        ebpo_posed_sides sides;
        ebpo_error cause = EBPO_ERROR_INIT;
        if (ebpo_posed_solid_sides(&b->solid[i], ebpo_boolean_context(b, worker, i), point, &sides,
                                   &cause) != EBPO_OK)
            return ebpo_fail_operand(b->solid[i].model, i, &cause, error);
        add_states(&o, i, b->solid[i].model->info->rule, &sides);
        may = ebpo_expression_value(&b->expression, o.known, o.above);
    }
    conclude_result(b, &o, may, out);
    return EBPO_OK;
}

/* Context of query_some. */
typedef struct point_queries {
    const ebpo_boolean *b;
    const double *points;
    ebpo_boolean_result *out;
} point_queries;

static ebpo_status query_some(void *context, uint64_t begin, uint64_t end, unsigned worker,
                              ebpo_error *error)
{
    const point_queries *q = context;
    ebpo_status status = EBPO_OK;
    for (uint64_t i = begin; i < end && status == EBPO_OK; i++)
        status = ebpo_boolean_query(q->b, worker, q->points + 3 * i, &q->out[i], error);
    return status;
}

ebpo_status ebpo_boolean_inside_many(ebpo_boolean *boolean, const double *points, uint64_t count,
                                     ebpo_boolean_result *out, ebpo_error *error)
{
    EBPO_DEFAULT_FP;
    enum { GRAIN = 256 };
    point_queries context = { boolean, points, out };
    ebpo_status status = ebpo_check_points(points, count, error);
    if (status != EBPO_OK)
        return status;
    return ebpo_parallel_for(count <= GRAIN ? 1 : boolean->threads, NULL, count, GRAIN, query_some,
                             &context, NULL, "booleans", error);
}

ebpo_status ebpo_boolean_inside(ebpo_boolean *boolean, const double point[3],
                                ebpo_boolean_result *out, ebpo_error *error)
{
    return ebpo_boolean_inside_many(boolean, point, 1, out, error);
}
