/* The facts of a file's head: tables and JSON. */
#ifndef EBPO_TOOLS_FILE_FACTS_H
#define EBPO_TOOLS_FILE_FACTS_H

#include <ebpo/file.h>
#include <stdio.h>

#include "cli/json.h"
#include "cli/solid_facts.h"

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
