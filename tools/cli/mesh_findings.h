/* A mesh report in words and in JSON. */
#ifndef EBPO_TOOLS_MESH_FINDINGS_H
#define EBPO_TOOLS_MESH_FINDINGS_H

#include <ebpo/query.h>
#include <stdio.h>

#include "cli/json.h"

/* Returns what is known of the volume of the solid that a report is of, see ebpo_solid_volume_of.
 */
ebpo_solid_volume findings_solid(const ebpo_mesh_report *report, ebpo_rule rule,
                                 const ebpo_shells *shells, const ebpo_info *info);
static inline bool findings_knows(const ebpo_solid_volume *solid) { return solid->lo >= solid->hi; }
/* Writes "volume" and the volume; or between which values it is; or, and where it is another value,
 * "integral of the winding number". `unit`: as table_unit takes it. */
enum { FINDINGS_VOLUME = 320 };
const char *findings_volume(char text[FINDINGS_VOLUME], const ebpo_solid_volume *solid,
                            const ebpo_mesh_report *report, const char *unit);
/* Members volume (null: not known), volume_lo, volume_hi and winding_integral. */
void findings_volume_json(json *j, const ebpo_solid_volume *solid);
/* What the mesh is, then each finding with its first places, and what was not looked at, unless
 * faces that cross are looked for later. */
void findings_print(FILE *out, const char *path, const ebpo_mesh *mesh,
                    const ebpo_mesh_report *report, const ebpo_solid_volume *solid,
                    bool crossings_follow);
/* What several findings of the kind that the report calls `name` are called. */
const char *findings_many(const char *name);
/* What mending did; nothing when nothing was asked for. */
void findings_print_mending(FILE *out, const ebpo_mend_record *record);
/* An area (power 2) or volume (3) of what the report is of: %.6g, or that it is more or less than
 * doubles hold, as it may be although each coordinate is one. `text`: of `size` bytes. */
const char *findings_extent(char *text, size_t size, double x, int power,
                            const ebpo_mesh_report *report);
void findings_json(json *j, const char *key, const ebpo_mesh_report *report,
                   const ebpo_solid_volume *solid);
void findings_json_mending(json *j, const char *key, const ebpo_mend_record *record);
/* unread   what reading left out; empty: nothing */
void findings_json_source(json *j, const char *key, const ebpo_mesh *mesh, const char *unread);

#endif
