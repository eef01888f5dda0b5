/* How far one model has to be moved to be clear of another. */
#include "core/strict_fp.h"

#include <math.h>

#include "core/error.h"
#include "core/fp_env.h"
#include "extras/collide/subtree_way.h"

/* The question's first model's direction, times a power of two, which is told. */
static int set_direction(ebpo_way_search *s, const double direction[3])
{
    int exponent;
    (void)frexp(fmax(fabs(direction[0]), fmax(fabs(direction[1]), fabs(direction[2]))), &exponent);
    for (int k = 0; k < 3; k++)
        s->direction[k] =
            ldexp(s->question->turned ? -direction[k] : direction[k], -exponent) + 0.0;
    return exponent;
}

static void tell(const ebpo_way_search *s, int exponent, ebpo_way_out *out)
{
    double lo = 0, hi = ldexp(s->hi, -exponent) * (1 + 0x1p-50);
    *out = (ebpo_way_out){ .pair = s->pair };
    if (s->last.ever) {
        ebpo_sweep_time t = s->last;
        t.unit -= exponent;
        lo = ebpo_sweep_time_round(&t);
    }
    out->t = ebpo_certain_of(lo, s->hi < 0 ? lo : fmax(lo, hi));
}

ebpo_status ebpo_collide_way_out(ebpo_collider *c, const ebpo_collide_options *options,
                                 const double direction[3], ebpo_way_out *out, ebpo_error *error)
{
    EBPO_DEFAULT_FP;
    ebpo_collision q;
    double size = fabs(direction[0]) + fabs(direction[1]) + fabs(direction[2]);
    if (!(size > 0x1p-500 && size < 0x1p500))
        return ebpo_fail(error, EBPO_E_ARGUMENT,
                         "a direction of three finite numbers, not all 0, is needed");
    ebpo_status status = ebpo_collision_begin(&q, c, options, error);
    if (status != EBPO_OK)
        return status;
    ebpo_way_search s = { .question = &q };
    int exponent = set_direction(&s, direction);
    ebpo_way_search_begin(&s);
    const ebpo_accel *const whole[2] = { q.model[0]->whole, q.model[1]->whole };
    status = ebpo_collision_is_in_parts(&q) ? ebpo_way_of_parts(&s, error)
                                            : ebpo_way_search_run(&s, whole, error);
    if (status == EBPO_OK)
        tell(&s, exponent, out);
    ebpo_sweep_time_clear(&s.last);
    return status;
}
