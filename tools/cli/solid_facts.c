/* Computes volumes in percent of a base: the volume of the solid or, if this is not known, the
 * integral of the winding number or the volume of the root box. */
#include "cli/solid_facts.h"

#include <math.h>

#include <ebpo/lod.h>

#include "cli/mesh_findings.h"

static double cell_volume(const ebpo_info *info, int level)
{
    return info->box_size[0] * info->box_size[1] * info->box_size[2] * ldexp(1, -3 * level);
}

double facts_volume(const ebpo_info *info, int level)
{
    /* If doubles cannot represent the volume of a cell, the volumes in the file are not valid. */
    if (!isnormal(cell_volume(info, level)))
        return NAN;
    double sum = info->level[level].gray_volume;
    for (int i = 0; i <= level; i++)
        /* the volume of a coarser cell may be infinite, and 0 * INFINITY would be NAN */
        sum +=
            info->level[i].leaf_volume +
            (info->level[i].black_count ? (double)info->level[i].black_count * cell_volume(info, i)
                                        : 0);
    return sum;
}

ebpo_status facts_derived(ebpo_file *file, int level, unsigned threads, ebpo_progress progress,
                          double *volume, ebpo_error *error)
{
    ebpo_lod_options options = EBPO_LOD_OPTIONS_INIT;
    options.threads = threads;
    options.progress = progress;
    return ebpo_lod_level(file, level, &options, NULL, volume, error);
}

ebpo_solid_volume facts_solid(const ebpo_info *info, const ebpo_shells *shells)
{
    return findings_solid(&info->report, info->rule, shells, info);
}

ebpo_solid_volume facts_measured(const ebpo_info *info, const ebpo_mass *mass)
{
    ebpo_solid_volume solid = facts_solid(info, NULL);
    bool capped = info->parts & EBPO_PART_BORDER;
    if (capped || !findings_volume_known(&solid)) {
        solid.lo = mass->volume_lo;
        solid.hi = mass->volume_hi;
    }
    if (capped)
        solid.integral = mass->integral;
    return solid;
}

const char *facts_whole(const ebpo_info *info, const ebpo_solid_volume *solid)
{
    return !info->solid ? "box" : findings_volume_known(solid) ? "solid" : "integral";
}

double facts_share(const ebpo_info *info, const ebpo_solid_volume *solid, double volume)
{
    double whole = !info->solid                   ? cell_volume(info, 0)
                   : findings_volume_known(solid) ? solid->lo
                                                  : fabs(solid->integral);
    double percent = 100 * volume / whole;
    return isfinite(percent) ? percent : NAN; /* not infinity, whose sign would mean nothing */
}

double facts_percent(const ebpo_info *info, const ebpo_solid_volume *solid, int level)
{
    return facts_share(info, solid, facts_volume(info, level));
}

double facts_excess(const ebpo_info *info, const ebpo_solid_volume *solid, double volume)
{
    return info->solid && findings_volume_known(solid) && solid->lo > 0
               ? 100 * (volume - solid->lo) / solid->lo
               : NAN;
}

double facts_excess_ratio(const ebpo_info *info, const ebpo_solid_volume *solid, double volume,
                          double limit)
{
    double least = facts_excess(info, solid, limit);
    /* 1e-7 percent is 1e-9 of the volume: a possible rounding error */
    return least > 1e-7 ? facts_excess(info, solid, volume) / least : NAN;
}

void facts_print_whole(FILE *out, const ebpo_info *info, const ebpo_solid_volume *solid)
{
    if (info->solid && !findings_volume_known(solid))
        fputs("% integral: percent of the integral of the winding number, because the solid's "
              "volume is not known\n",
              out);
    else
        fputs(info->solid ? "% solid: percent of the solid's volume\n"
                          : "% box: percent of the volume of the root's box\n",
              out);
}
