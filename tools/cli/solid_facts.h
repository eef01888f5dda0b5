/* Computes volumes of envelopes and of the solid, and percentages of a base: the volume of the
 * solid, the integral of its winding number, or the volume of the root box. */
#ifndef EBPO_TOOLS_SOLID_FACTS_H
#define EBPO_TOOLS_SOLID_FACTS_H

#include <ebpo/query.h>
#include <stdio.h>

/* Returns the volume of the envelopes that represent the model at `level`: its gray nodes, and the
 * leaves and black nodes of levels 0 .. level. Leaves count with the volume that the file states;
 * the planes that readers derive would cut off more. */
double facts_volume(const ebpo_info *info, int level);
/* Computes the same volume with leaves cut by planes that are derived from their faces. Reads the
 * faces; the file must have faces, and no planes of leaves. */
EBPO_MUST_USE ebpo_status facts_derived(ebpo_file *file, int level, unsigned threads,
                                        ebpo_progress progress, double *volume, ebpo_error *error);
/* Returns the bounds of the volume of the solid. `shells`: as for ebpo_solid_volume_of. */
ebpo_solid_volume facts_solid(const ebpo_info *info, const ebpo_shells *shells);
/* Returns the bounds of the volume of the solid, or, if they are not equal, those of `mass`, the
 * measurements of the mesh. */
ebpo_solid_volume facts_measured(const ebpo_info *info, const ebpo_mass *mass);
/* Returns the word for the base of percentages: "solid"; "box" (the root box) for a surface;
 * "integral" (of the winding number) if the volume of the solid is not known. */
const char *facts_whole(const ebpo_info *info, const ebpo_solid_volume *solid);
/* Prints which base the percentages have, for the legend of a table. */
void facts_print_whole(FILE *out, const ebpo_info *info, const ebpo_solid_volume *solid);
/* Returns the volume of the envelopes of a level in percent of the base. */
double facts_percent(const ebpo_info *info, const ebpo_solid_volume *solid, int level);
/* Returns any volume in percent of the base. */
double facts_share(const ebpo_info *info, const ebpo_solid_volume *solid, double volume);
/* Returns the excess of `volume` over the volume of the solid in percent; NAN for a surface, and
 * for a solid with no volume or an unknown one. */
double facts_excess(const ebpo_info *info, const ebpo_solid_volume *solid, double volume);
/* Returns the excess of `volume` divided by the excess of `limit`, the volume of the convex hulls.
 * NAN: one of the two volumes has no excess, or the hulls equal the solid except for rounding. */
double facts_excess_ratio(const ebpo_info *info, const ebpo_solid_volume *solid, double volume,
                          double limit);

#endif
