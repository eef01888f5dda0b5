/* The facts of a file's head: tables and JSON. */
#ifndef EBPO_TOOLS_FILE_FACTS_H
#define EBPO_TOOLS_FILE_FACTS_H

#include <ebpo/file.h>
#include <ebpo/query.h>
#include <stdio.h>

#include "cli/json.h"

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
/* Returns what it means that the integral of the winding number is negative; NULL: it is not. */
const char *facts_inside_out(const ebpo_info *info);
/* White nodes of a level without the places of pruned nodes' children. */
uint64_t facts_white(const ebpo_info *info, int level);
/* Bytes of the head and of levels 0 .. level. */
uint64_t facts_cumulative(const ebpo_info *info, const ebpo_stored_sizes *stored, int level);

/* `stored`: by ebpo_file_locate. */
void facts_print(FILE *out, const char *path, const ebpo_info *info,
                 const ebpo_stored_sizes *stored);
void facts_table(FILE *out, const ebpo_info *info, const ebpo_stored_sizes *stored);
/* `shells`: as for facts_solid. */
void facts_json(json *j, const char *path, const ebpo_info *info, const ebpo_stored_sizes *stored,
                const ebpo_shells *shells);

/* The arrays of a file, in the order of their bytes. */
void facts_arrays(FILE *out, const ebpo_file *file);
void facts_arrays_json(json *j, const ebpo_file *file);

/* The attributes of a file, with what their values reach. */
void facts_attributes(FILE *out, const ebpo_file *file);
void facts_attributes_json(json *j, const ebpo_file *file);

#endif
