/* The facts of a file's head: tables and JSON. */
#ifndef EBPO_TOOLS_FILE_FACTS_H
#define EBPO_TOOLS_FILE_FACTS_H

#include <ebpo/file.h>
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
/* facts_volume in percent of the solid; of the root box for a surface. */
double facts_percent(const ebpo_info *info, int level);
/* Any volume in percent of the same. */
double facts_share(const ebpo_info *info, double volume);
/* How much `volume` is above the solid's, in percent of the solid's; NAN for a surface, or a solid
 * without volume. */
double facts_excess(const ebpo_info *info, double volume);
/* Excess of `volume` / excess of `limit`, the volume of the convex hulls; NAN where either has
 * none, or the hulls are the solid but for rounding. */
double facts_excess_ratio(const ebpo_info *info, double volume, double limit);
/* What it means that the solid's volume is negative; NULL: it is not. */
const char *facts_inside_out(const ebpo_info *info);
/* White nodes of a level without the places of pruned nodes' children. */
uint64_t facts_white(const ebpo_info *info, int level);
/* Bytes of the head and of levels 0 .. level. */
uint64_t facts_cumulative(const ebpo_info *info, const ebpo_stored_sizes *stored, int level);

/* `stored`: by ebpo_file_locate. */
void facts_print(FILE *out, const char *path, const ebpo_info *info,
                 const ebpo_stored_sizes *stored);
void facts_table(FILE *out, const ebpo_info *info, const ebpo_stored_sizes *stored);
void facts_json(json *j, const char *path, const ebpo_info *info, const ebpo_stored_sizes *stored);

/* The arrays of a file, in the order of their bytes. */
void facts_arrays(FILE *out, const ebpo_file *file);
void facts_arrays_json(json *j, const ebpo_file *file);

/* The attributes of a file, with what their values reach. */
void facts_attributes(FILE *out, const ebpo_file *file);
void facts_attributes_json(json *j, const ebpo_file *file);

#endif
