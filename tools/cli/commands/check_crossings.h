/* Implements ebpo check --crossings: intersecting faces of a mesh, except neighbours. */
#ifndef EBPO_TOOLS_CHECK_CROSSINGS_H
#define EBPO_TOOLS_CHECK_CROSSINGS_H

#include <ebpo/collide.h>

#include "cli/json.h"
#include "cli/progress.h"

/* Finds the pairs of intersecting faces. report: of the check of `mesh`. If `j` is not NULL, prints
 * all pairs as JSON. Otherwise prints the first pairs in words, unless `quiet`. The mesh is empty
 * afterwards. Wipes `line` before printing. */
EBPO_MUST_USE ebpo_status check_crossings(ebpo_mesh *mesh, const ebpo_mesh_report *report,
                                          const ebpo_self_intersections_options *options, json *j,
                                          bool quiet, progress_line *line, ebpo_error *error);

#endif
