/* Computes volumes of envelopes and of the solid, in units or in percent of a base. The base is the
 * volume of the solid, the integral of its winding number, or the volume of the root box. */
#ifndef EBPO_TOOLS_SOLID_FACTS_H
#define EBPO_TOOLS_SOLID_FACTS_H

#include <ebpo/query.h>
#include <stdio.h>

/* Returns the volume of the envelopes that represent the model at `level`: its gray nodes, and the
 * leaves and black nodes of levels 0 to `level`. The volumes of leaves come from the file; they
 * ignore the planes that readers derive from faces. NAN: the volumes are beyond the range of
 * doubles. */
double facts_volume(const ebpo_info *info, int level);
/* Computes the volume of facts_volume, but with the planes of leaves that follow from their faces.
 * Reads the faces; the file must have faces, and no stored planes of leaves. */
EBPO_MUST_USE ebpo_status facts_derived(ebpo_file *file, int level, unsigned threads,
                                        ebpo_progress progress, double *volume, ebpo_error *error);
/* Returns the bounds of the volume of the solid. `shells`: as for ebpo_solid_volume_of. */
ebpo_solid_volume facts_solid(const ebpo_info *info, const ebpo_shells *shells);
/* Returns the bounds of the volume of the solid. If the bounds from the header are not equal,
 * returns the bounds in `mass`, the measurements of the mesh. For a surface with its border,
 * returns the bounds in `mass` of the volume that faces and caps enclose. */
ebpo_solid_volume facts_measured(const ebpo_info *info, const ebpo_mass *mass);
/* Returns the word for the base of percentages: "box" (the root box) for a surface, "solid" for a
 * solid, or "integral" (of the winding number) for a solid whose volume is not known. */
const char *facts_whole(const ebpo_info *info, const ebpo_solid_volume *solid);
/* Prints the line of a table's legend that explains the base of the percentages. */
void facts_print_whole(FILE *out, const ebpo_info *info, const ebpo_solid_volume *solid);
/* Returns the volume of the envelopes of a level in percent of the base. */
double facts_percent(const ebpo_info *info, const ebpo_solid_volume *solid, int level);
/* Returns any volume in percent of the base. */
double facts_share(const ebpo_info *info, const ebpo_solid_volume *solid, double volume);
/* Returns the excess of `volume` over the volume of the solid, in percent of the solid's volume.
 * NAN for a surface, and for a solid whose volume is 0 or not known. */
double facts_excess(const ebpo_info *info, const ebpo_solid_volume *solid, double volume);
/* Returns the excess of `volume` divided by the excess of `limit`, the volume of the convex hulls.
 * NAN: one of the two volumes has no excess, or the hulls equal the solid except for rounding. */
double facts_excess_ratio(const ebpo_info *info, const ebpo_solid_volume *solid, double volume,
                          double limit);

#endif
