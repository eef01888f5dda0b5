/* Prints a mesh report in words and in JSON. */
#ifndef EBPO_TOOLS_MESH_FINDINGS_H
#define EBPO_TOOLS_MESH_FINDINGS_H

#include <ebpo/query.h>
#include <stdio.h>

#include "cli/json.h"

/* Returns the bounds of the volume of the solid in a report; arguments as in ebpo_solid_volume_of.
 */
ebpo_solid_volume findings_solid(const ebpo_mesh_report *report, ebpo_rule rule,
                                 const ebpo_shells *shells, const ebpo_info *info);
/* Returns true if the bounds of the volume are equal. */
static inline bool findings_volume_known(const ebpo_solid_volume *solid)
{
    return solid->lo >= solid->hi;
}
/* Writes "volume" and the volume or its bounds. If the integral of the winding number differs from
 * the volume, also writes the integral; if no bounds are known, writes only the integral. `unit`:
 * unit of lengths; "": none. */
enum { FINDINGS_VOLUME = 320 };
const char *findings_volume(char text[FINDINGS_VOLUME], const ebpo_solid_volume *solid,
                            const ebpo_mesh_report *report, const char *unit);
/* Writes members volume (null: not known), volume_lo, volume_hi and winding_integral. */
void findings_volume_json(json *j, const ebpo_solid_volume *solid);
/* Prints the kind of the mesh, each kind of finding (defect) with its first faces or vertices, and
 * a note that intersecting faces were not searched. `crossings_follow`: the caller searches them
 * later, so the note is not printed. `path`: of the source; NULL: the mesh is one after repairs,
 * and the facts about its source are not printed. */
void findings_print(FILE *out, const char *path, const ebpo_mesh *mesh,
                    const ebpo_mesh_report *report, const ebpo_solid_volume *solid,
                    bool crossings_follow);
/* Returns the plural words for the finding that the report calls `name`. */
const char *findings_plural(const char *name);
/* Prints the effects of the requested repairs. */
void findings_print_repair(FILE *out, const ebpo_repair_record *record);
/* Writes the area (power 2) or the volume (power 3) x of a mesh with %.6g. If x is beyond the range
 * of doubles, says so; this is possible although each coordinate is a double. report: gives the box
 * of the mesh. */
const char *findings_extent(char *text, size_t size, double x, int power,
                            const ebpo_mesh_report *report);
void findings_json(json *j, const char *key, const ebpo_mesh_report *report,
                   const ebpo_solid_volume *solid);
void findings_json_repair(json *j, const char *key, const ebpo_repair_record *record);
/* Writes facts about the input file. `unread`: description of data that was not read; "": none. */
void findings_json_source(json *j, const char *key, const ebpo_mesh *mesh, const char *unread);

#endif
