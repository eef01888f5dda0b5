#include "core/strict_fp.h"

#include "extras/collide/unmet_patches.h"

#include <math.h>
#include <stdlib.h>

#include "core/error.h"
#include "extras/collide/face_patches.h"
#include "extras/collide/face_slots.h"
#include "extras/collide/posed_subtrees.h"
#include "geometry/rule.h"

void ebpo_unmet_patches_begin(ebpo_unmet_patches *u, const ebpo_collision *question,
                              ebpo_two_models *two, int m)
{
    const ebpo_model *model = question->model[m];
    *u = (ebpo_unmet_patches){ .question = question, .two = two, .m = m };
    u->subtrees = model->whole ? 1 : model->top->below_count;
}

void ebpo_unmet_patches_end(ebpo_unmet_patches *u) { free(u->patch); }

static ebpo_status find_patches(ebpo_unmet_patches *u, const ebpo_accel *subtree,
                                const uint32_t *slots, const uint64_t *met, ebpo_error *error)
{
    u->first = subtree->first_face;
    u->count = subtree->face_count - subtree->outer_count;
    return ebpo_face_patches(subtree, slots, met, &u->patch, error);
}

ebpo_status ebpo_unmet_patches_find(ebpo_unmet_patches *u, uint64_t number, const uint64_t *met,
                                    ebpo_error *error)
{
    const ebpo_model *model = u->question->model[u->m];
    ebpo_context *context = u->two->context[u->m];
    ebpo_accel *subtree;
    free(u->patch);
    u->patch = NULL;
    if (model->whole)
        return find_patches(u, model->whole, u->two->faces[u->m]->slots, met, error);
    ebpo_status status = ebpo_context_subtree(context, (uint32_t)number, &subtree, error);
    if (status != EBPO_OK)
        return status;
    uint32_t *slots = ebpo_face_slots(subtree);
    status = slots ? find_patches(u, subtree, slots, met, error)
                   : ebpo_fail_memory(error, subtree->face_count * sizeof *slots);
    free(slots);
    ebpo_context_let_go(context);
    return status;
}

static bool note_any(void *user, const ebpo_triangles *triangles)
{
    bool *any = user;
    *any |= triangles->count > 0;
    return !*any;
}

/* Whether the solid has all of a ball around a point of the world inside, or outside. */
static ebpo_status side_of_ball(const ebpo_unmet_patches *u, const double middle[3], double radius,
                                int *in, ebpo_error *error)
{
    const ebpo_posed_solid *other = &u->two->model[!u->m];
    ebpo_context *context = u->two->context[!u->m];
    double low[3], high[3], p[3], doubt;
    bool near = false;
    ebpo_inside_result inside;
    ebpo_unpose(other, middle, p, &doubt);
    double room = (radius / other->posing.scale + 2 * doubt) * (1 + 0x1p-20);
    for (int k = 0; k < 3; k++) {
        low[k] = nextafter(p[k] - room, -INFINITY);
        high[k] = nextafter(p[k] + room, INFINITY);
    }
    ebpo_status status = ebpo_triangles_in_box(context, low, high, note_any, &near, error);
    if (status != EBPO_OK || near)
        return status;
    status = ebpo_inside(context, p, NULL, &inside, error);
    *in = ebpo_rule_inside(u->two->rule[!u->m], inside.winding);
    return status;
}

/* The cell has a point of each of its own faces; so does the ball around it. If no face of the
 * other model comes near the ball, it is on one side, and so is each face that meets none. */
ebpo_status ebpo_unmet_patches_side(const ebpo_unmet_patches *u, uint64_t number, int *in,
                                    ebpo_error *error)
{
    const ebpo_model *model = u->question->model[u->m];
    ebpo_posed_subtrees as = { .model = model, .posing = u->question->posing[u->m].posing };
    double corner[8][3], middle[3];
    *in = -1;
    if (model->whole)
        return EBPO_OK;
    ebpo_cell cell = model->top->below[number].cell;
    double radius =
        ebpo_posed_diagonal(&as, cell) / 2 + ebpo_posed_slack(&as, cell, u->question->reach);
    ebpo_posed_cell(&as, cell, corner);
    for (int k = 0; k < 3; k++)
        middle[k] = corner[0][k] / 2 + corner[7][k] / 2;
    if (ebpo_posed_solid_near(&u->two->model[!u->m], middle, radius))
        return side_of_ball(u, middle, radius, in, error);
    *in = 0;
    return EBPO_OK;
}
