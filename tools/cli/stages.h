/* Stages of a build as shown to users, and the matching stages of the EBP-Octree thesis. */
#ifndef EBPO_TOOLS_STAGES_H
#define EBPO_TOOLS_STAGES_H

#include <stdio.h>

#include <ebpo/build.h>

#include "cli/json.h"
#include "cli/progress.h"
#include "cli/stage_rows.h"

typedef struct stage_facts {
    bool may_repair; /* the options or the format of the input may cause repairs */
    bool solid;
    bool from_leaves; /* envelopes are selected from the leaves, as in the theses */
    bool selected;    /* levels are selected by error or size after the build */
    bool leaf_planes; /* leaf planes are stored, not derived by readers */
    uint64_t faces;
    ebpo_build_times times;
} stage_facts;

enum { STAGE_PLAN_MAX = STAGE_ROWS + 3 };
/* Sets `plan` to the rows of all stages to come, in their order, for progress. Returns their
 * number. */
int stages_plan(const stage_facts *f, int plan[STAGE_PLAN_MAX]);

/* The library makes cells and envelopes in one stage. Splits its time into two stages, in the ratio
 * of the processor times in `times`. Call this before stages_print and stages_json. */
void stages_split(progress_line *line, const ebpo_build_times *times);

/* Print the times of the stages, as a table or as JSON. Call them after progress_end_stage.
 * seconds: total time. */
void stages_print(FILE *out, const progress_line *line, const stage_facts *f, double seconds);
void stages_json(json *j, const progress_line *line, const stage_facts *f);

#endif
