/* How deep the surfaces of two models are in each other. */
#include "geom/strict_fp.h"

#include <math.h>

#include "base/error.h"
#include "base/fp_env.h"
#include "collide/collider.h"
#include "collide/depth_search.h"
#include "collide/posed_model.h"
#include "query/options.h"

/* Of the caller's model `solid` (0: A), which holds the other one's surface. */
static ebpo_status depth_in(const ebpo_collision *q, int solid, double tolerance, ebpo_certain *out,
                            ebpo_error *error)
{
    ebpo_collider *c = q->collider;
    ebpo_posed_solid posed;
    const ebpo_pose *pose = solid ? &q->options.pose_b : &q->options.pose_a;
    const ebpo_posing *posing = &q->posing[solid == q->turned].posing;
    ebpo_status status = ebpo_check_solid(c->model[solid], error);
    if (status == EBPO_OK)
        status = ebpo_posed_solid_make(&posed, c->model[solid], pose, error);
    if (status == EBPO_OK && !c->context[solid])
        status = ebpo_context_new(c->model[solid], &c->context[solid], error);
    if (status != EBPO_OK)
        return status;
    ebpo_depth_search s = { .surface = c->model[!solid]->whole,
                            .posing = posing,
                            .reach = q->reach,
                            .solid = &posed,
                            .context = c->context[solid],
                            .tolerance = tolerance,
                            .late = q->late,
                            .progress = &q->options.progress };
    if (s.surface->bound_count > 0)
        status = ebpo_depth_search_run(&s, error);
    if (status == EBPO_OK)
        *out = ebpo_certain_of(s.lo, s.hi);
    return status;
}

ebpo_status ebpo_collide_depth(ebpo_collider *c, const ebpo_collide_options *options,
                               double tolerance, ebpo_certain *a_in_b, ebpo_certain *b_in_a,
                               ebpo_error *error)
{
    EBPO_DEFAULT_FP;
    ebpo_collision q;
    if (!(tolerance > 0 && tolerance < INFINITY))
        return ebpo_fail(error, EBPO_E_ARGUMENT,
                         "the depth's tolerance has to be greater than 0 and finite");
    ebpo_status status = ebpo_collision_begin_whole(&q, c, options, error);
    if (status == EBPO_OK && a_in_b)
        status = depth_in(&q, 1, tolerance, a_in_b, error);
    if (status == EBPO_OK && b_in_a)
        status = depth_in(&q, 0, tolerance, b_in_a, error);
    return status;
}
