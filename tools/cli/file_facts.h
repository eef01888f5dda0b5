/* Prints the facts of a file header as tables and JSON. */
#ifndef EBPO_TOOLS_FILE_FACTS_H
#define EBPO_TOOLS_FILE_FACTS_H

#include <ebpo/file.h>
#include <stdio.h>

#include "cli/json.h"
#include "cli/solid_facts.h"

/* Returns an explanation of a negative integral of the winding number; NULL: it is not negative. */
const char *facts_inside_out(const ebpo_info *info);
/* Returns the number of white nodes of a level, without the child positions of pruned nodes. */
uint64_t facts_white(const ebpo_info *info, int level);
/* Returns the bytes of the header and of levels 0 .. level. */
uint64_t facts_cumulative(const ebpo_info *info, const ebpo_stored_sizes *stored, int level);

/* Prints the facts of the file and of its levels. stored: result of ebpo_file_locate. */
void facts_print(FILE *out, const char *path, const ebpo_info *info,
                 const ebpo_stored_sizes *stored);
void facts_table(FILE *out, const ebpo_info *info, const ebpo_stored_sizes *stored);
/* `shells`: as for facts_solid. */
void facts_json(json *j, const char *path, const ebpo_info *info, const ebpo_stored_sizes *stored,
                const ebpo_shells *shells);

/* Prints the arrays of a file by byte count. */
void facts_arrays(FILE *out, const ebpo_file *file);
void facts_arrays_json(json *j, const ebpo_file *file);

/* Prints the attributes of a file with the ranges of their values. */
void facts_attributes(FILE *out, const ebpo_file *file);
void facts_attributes_json(json *j, const ebpo_file *file);

/* Returns why a file without a simplified surface gets none. */
const char *facts_no_surface(const ebpo_info *info);

#endif
