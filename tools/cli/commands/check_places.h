/* ebpo check --places. */
#ifndef EBPO_TOOLS_CHECK_PLACES_H
#define EBPO_TOOLS_CHECK_PLACES_H

#include <ebpo/places.h>

#include "cli/json.h"
#include "cli/progress.h"

/* False: `to` is neither "all" nor the name of a PLY file. */
bool check_places_good(const char *to);

/* The PLY that `to` names; NULL: "all". */
const char *check_places_ply(const char *to);

/* Prints all places, or writes the picture and prints its legend. `j`: into its open object
 * instead; NULL: words, unless `quiet`. */
EBPO_MUST_USE ebpo_status check_places(const ebpo_mesh *mesh, const char *to, unsigned threads,
                                       ebpo_progress progress, json *j, bool quiet,
                                       progress_line *line, ebpo_error *error);

#endif
