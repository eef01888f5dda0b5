/* One ray: what it meets first, whether it meets anything, all that it meets. */
#include "core/strict_fp.h"

#include "core/error.h"
#include "core/fp_env.h"
#include "query/query_model.h"
#include "query/ray_walk.h"

static ebpo_status cast(ebpo_casting *c, ebpo_context *context, const double origin[3],
                        const double direction[3], double t_max, ebpo_ray_wants wants,
                        ebpo_error *error)
{
    ebpo_casting_begin(c, context, origin, direction, t_max, wants, EBPO_RAY_BOTH);
    ebpo_status status = ebpo_check_mesh(context->model, error);
    const char *fault = ebpo_ray_fault(&c->ray);
    if (fault)
        return ebpo_fail(error, EBPO_E_ARGUMENT, "the ray %s", fault);
    return status == EBPO_OK ? ebpo_ray_walk(c, error) : status;
}

ebpo_status ebpo_ray_first(ebpo_context *context, const double origin[3], const double direction[3],
                           double t_max, ebpo_ray_hit *out, bool *hit, ebpo_error *error)
{
    EBPO_DEFAULT_FP;
    ebpo_casting c;
    ebpo_status status = cast(&c, context, origin, direction, t_max, EBPO_WANTS_FIRST, error);
    *hit = status == EBPO_OK && c.count;
    if (*hit)
        *out = ebpo_hit_of(&c.first);
    return status;
}

ebpo_status ebpo_ray_any(ebpo_context *context, const double origin[3], const double direction[3],
                         double t_max, bool *any, ebpo_error *error)
{
    EBPO_DEFAULT_FP;
    ebpo_casting c;
    ebpo_status status = cast(&c, context, origin, direction, t_max, EBPO_WANTS_ANY, error);
    *any = status == EBPO_OK && c.count;
    return status;
}

ebpo_status ebpo_ray_all(ebpo_context *context, const double origin[3], const double direction[3],
                         double t_max, const ebpo_ray_hit **hits, uint64_t *count,
                         ebpo_error *error)
{
    EBPO_DEFAULT_FP;
    ebpo_casting c;
    uint64_t end;
    *hits = NULL;
    *count = 0;
    ebpo_status status = cast(&c, context, origin, direction, t_max, EBPO_WANTS_ALL, error);
    if (status == EBPO_OK)
        status = ebpo_casting_sort(&c, 0, &end, error);
    if (status == EBPO_OK && end) {
        *hits = context->hits;
        *count = end;
    }
    return status;
}
