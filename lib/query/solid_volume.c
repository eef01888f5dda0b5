/* Decides whether the volume of a solid is known. */
#include "core/strict_fp.h"

#include <ebpo/query.h>

#include <math.h>

#include "core/error.h"
#include "core/fp_env.h"
#include "geometry/rule.h"

/* What rounding may do to sums of envelopes: of the sum, and of the root cell's volume. */
static const double OF_SUM = 1e-9, OF_ROOT = 1e-12;

/* Sets out->lo and hi to what black cells fill and envelopes hold. */
static void bound_by_cells(const ebpo_info *info, ebpo_solid_volume *out)
{
    double root = info->box_size[0] * info->box_size[1] * info->box_size[2], lo = 0, hi = 0;
    if (info->pruned || !isnormal(ldexp(root, -3 * EBPO_LEVELS_MAX)))
        return;
    for (int i = 0; i < info->level_count; i++) {
        lo += (double)info->level[i].black_count * ldexp(root, -3 * i);
        hi += info->level[i].leaf_volume;
    }
    hi += lo;
    out->lo = fmax(0, lo * (1 - OF_SUM));
    out->hi = hi * (1 + OF_SUM) + root * OF_ROOT;
}

/* Returns the volume of components that do not meet; NAN: it is not known. Shells that were not
 * counted are not apart. */
static double known_volume(const ebpo_mesh_report *report, ebpo_rule rule,
                           const ebpo_shells *shells)
{
    double integral = report->volume;
    if (!report->manifold)
        return NAN;
    if (report->components == 1)
        return ebpo_rule_inside(rule, signbit(integral) ? -1 : 1) ? fabs(integral) : 0;
    return shells->apart ? integral + shells->beyond[rule] : NAN;
}

ebpo_status ebpo_solid_volume_of(const ebpo_mesh_report *report, ebpo_rule rule,
                                 const ebpo_shells *shells, const ebpo_info *info,
                                 ebpo_solid_volume *out, ebpo_error *error)
{
    EBPO_DEFAULT_FP;
    ebpo_solid_volume v = { .hi = INFINITY, .integral = report->volume };
    ebpo_shells own = EBPO_SHELLS_INIT;
    ebpo_status status = EBPO_CHECK_SIZED(ebpo_solid_volume, out, error);
    if (status == EBPO_OK)
        status = EBPO_TAKE(ebpo_shells, &own, shells, error);
    if (status != EBPO_OK)
        return status;
    if ((unsigned)rule > EBPO_RULE_POSITIVE)
        return ebpo_fail(error, EBPO_E_ARGUMENT, "unknown winding rule %d", (int)rule);
    if (info)
        bound_by_cells(info, &v);
    double volume = known_volume(report, rule, &own);
    if (!report->balanced)
        v = (ebpo_solid_volume){ .integral = 0 };
    else if (volume >= v.lo && volume <= v.hi)
        v.lo = v.hi = volume;
    return EBPO_GIVE(ebpo_solid_volume, out, &v);
}
