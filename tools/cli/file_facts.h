/* Prints facts from a file header as tables and JSON: source, mesh, stored bytes, levels. */
#ifndef EBPO_TOOLS_FILE_FACTS_H
#define EBPO_TOOLS_FILE_FACTS_H

#include <ebpo/file.h>
#include <stdio.h>

#include "cli/json.h"
#include "cli/solid_facts.h"

/* Returns an explanation if the integral of the winding number is negative, so that the solid is
 * turned inside out; else NULL. */
const char *facts_inside_out(const ebpo_info *info);
/* Returns the number of white nodes of a level. The eight child positions of a pruned node (a gray
 * node whose children a subset omits) are stored like white nodes, but do not count. */
uint64_t facts_white(const ebpo_info *info, int level);
/* Returns the bytes of the header and of levels 0 .. level. */
uint64_t facts_cumulative(const ebpo_info *info, const ebpo_stored_sizes *stored, int level);

/* facts_print prints the facts of the file, facts_table prints a table of its levels, and
 * facts_json writes both. `stored`: result of ebpo_file_locate. `shells`: as for facts_solid. */
void facts_print(FILE *out, const char *path, const ebpo_info *info,
                 const ebpo_stored_sizes *stored);
void facts_table(FILE *out, const ebpo_info *info, const ebpo_stored_sizes *stored);
void facts_json(json *j, const char *path, const ebpo_info *info, const ebpo_stored_sizes *stored,
                const ebpo_shells *shells);

/* Prints the arrays of a file with their types, sizes and descriptions. */
void facts_arrays(FILE *out, const ebpo_file *file);
void facts_arrays_json(json *j, const ebpo_file *file);

/* Prints the attributes of a file with the ranges of their values. */
void facts_attributes(FILE *out, const ebpo_file *file);
void facts_attributes_json(json *j, const ebpo_file *file);

/* Returns the reason why a simplified surface cannot be made for a file, for messages. */
const char *facts_no_surface(const ebpo_info *info);

#endif
