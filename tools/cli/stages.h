/* Stages of a build as shown to users, and the matching stages of the EBP-Octree thesis. */
#ifndef EBPO_TOOLS_STAGES_H
#define EBPO_TOOLS_STAGES_H

#include <stdio.h>

#include <ebpo/build.h>

#include "cli/json.h"
#include "cli/progress.h"
#include "cli/stage_rows.h"

typedef struct stage_facts {
    bool may_repair; /* true: the options or the format of the input may cause repairs */
    bool solid;
    bool from_leaves; /* true: envelopes are selected from the leaves, as in the theses */
    bool selected;    /* true: levels are selected by error or size after the build */
    bool leaf_planes; /* true: leaf planes are stored; false: readers derive them */
    uint64_t faces;   /* number of faces of the mesh */
    ebpo_build_times times;
} stage_facts;

enum { STAGE_PLAN_MAX = STAGE_ROWS + 3 };
/* Sets `plan` to the rows of all stages of the build in their order, for the display of progress.
 * Returns the number of stages. */
int stages_plan(const stage_facts *f, int plan[STAGE_PLAN_MAX]);

/* Splits the time of the stage in which the library makes cells and envelopes into two stages, in
 * the ratio of the processor times in `times`. Call this before stages_print and stages_json. */
void stages_split(progress_line *line, const ebpo_build_times *times);

/* Print the times of the stages, as a table or as JSON. Call these functions after
 * progress_end_stage. `seconds`: total time. */
void stages_print(FILE *out, const progress_line *line, const stage_facts *f, double seconds);
void stages_json(json *j, const progress_line *line, const stage_facts *f);

#endif
