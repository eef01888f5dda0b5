/* Volumes of envelopes and of the solid, and what percentages are of. */
#ifndef EBPO_TOOLS_SOLID_FACTS_H
#define EBPO_TOOLS_SOLID_FACTS_H

#include <ebpo/query.h>
#include <stdio.h>

/* Volume of the envelopes that stand for the model at `level`: its gray nodes, and the leaves and
 * black nodes of levels 0 .. level, these as the file states them (planes that readers derive cut
 * off more). */
double facts_volume(const ebpo_info *info, int level);
/* The same with leaves cut by planes derived from their faces, where the file has faces and no
 * planes of leaves: reads them. */
EBPO_MUST_USE ebpo_status facts_derived(ebpo_file *file, int level, unsigned threads,
                                        ebpo_progress progress, double *volume, ebpo_error *error);
/* Returns what is known of the solid's volume. `shells`: as ebpo_solid_volume_of takes them. */
ebpo_solid_volume facts_solid(const ebpo_info *info, const ebpo_shells *shells);
/* Returns the same with what measuring the mesh has found. */
ebpo_solid_volume facts_measured(const ebpo_info *info, const ebpo_mass *mass);
/* Returns what percentages are of: "solid"; "box", the root box, for a surface; "integral", of the
 * winding number, where the solid's volume is not known. */
const char *facts_whole(const ebpo_info *info, const ebpo_solid_volume *solid);
/* Prints what that is, for the legend of a table. */
void facts_print_whole(FILE *out, const ebpo_info *info, const ebpo_solid_volume *solid);
/* Returns facts_volume in percent of that. */
double facts_percent(const ebpo_info *info, const ebpo_solid_volume *solid, int level);
/* Returns any volume in percent of the same. */
double facts_share(const ebpo_info *info, const ebpo_solid_volume *solid, double volume);
/* Returns how much `volume` is above the solid's, in percent of the solid's; NAN for a surface, and
 * for a solid without volume or whose volume is not known. */
double facts_excess(const ebpo_info *info, const ebpo_solid_volume *solid, double volume);
/* Returns the excess of `volume` / excess of `limit`, the volume of the convex hulls; NAN where
 * either has none, or the hulls are the solid but for rounding. */
double facts_excess_ratio(const ebpo_info *info, const ebpo_solid_volume *solid, double volume,
                          double limit);

#endif
