/* How deep the surfaces of two models are in each other. */
#include "core/strict_fp.h"

#include <math.h>

#include "core/error.h"
#include "core/fp_env.h"
#include "extras/collide/collider.h"
#include "extras/collide/depth_search.h"
#include "extras/collide/posed_model.h"
#include "query/query_model.h"

/* Of the caller's model `solid` (0: A), which holds the other one's surface. */
static ebpo_status depth_in(const ebpo_collision *q, int solid, double tolerance, ebpo_certain *out,
                            ebpo_error *error)
{
    ebpo_collider *c = q->collider;
    ebpo_posed_solid posed;
    const ebpo_pose *pose = solid ? &q->options.pose_b : &q->options.pose_a;
    ebpo_status status = ebpo_check_solid(c->model[solid], error);
    if (status == EBPO_OK)
        status = ebpo_posed_solid_make(&posed, c->model[solid], pose, error);
    if (status != EBPO_OK)
        return status;
    ebpo_depth_search s = { .from = c->context[!solid],
                            .posing = &q->posing[solid == q->turned].posing,
                            .reach = q->reach,
                            .solid = &posed,
                            .context = c->context[solid],
                            .tolerance = tolerance,
                            .late = q->late,
                            .progress = &q->options.progress };
    status = ebpo_depth_search_run(&s, error);
    if (status == EBPO_OK)
        *out = ebpo_certain_of(s.lo, s.hi);
    return status;
}

static ebpo_status make_contexts(ebpo_collider *c, ebpo_error *error)
{
    ebpo_status status = EBPO_OK;
    for (int i = 0; i < 2 && status == EBPO_OK; i++)
        if (!c->context[i])
            status = ebpo_context_new(c->model[i], &c->context[i], error);
    return status;
}

static uint64_t loads(const ebpo_collider *c)
{
    uint64_t sum = 0;
    for (int i = 0; i < 2; i++)
        sum += c->context[i] ? c->context[i]->loaded : 0;
    return sum;
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
    ebpo_status status = ebpo_collision_begin(&q, c, options, error);
    if (status != EBPO_OK)
        return status;
    uint64_t loaded = loads(c), read = ebpo_collision_bytes_read(&q);
    status = make_contexts(c, error);
    if (status == EBPO_OK && a_in_b)
        status = depth_in(&q, 1, tolerance, a_in_b, error);
    if (status == EBPO_OK && b_in_a)
        status = depth_in(&q, 0, tolerance, b_in_a, error);
    for (int i = 0; i < 2; i++)
        ebpo_context_let_go(c->context[i]);
    c->loads += loads(c) - loaded;
    c->bytes_read += ebpo_collision_bytes_read(&q) - read;
    return status;
}
