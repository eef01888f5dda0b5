/* The stages of a build as people see them, and where the EBP-Octree thesis has the same work. */
#ifndef EBPO_TOOLS_STAGES_H
#define EBPO_TOOLS_STAGES_H

#include <stdio.h>

#include <ebpo/build.h>

#include "cli/json.h"
#include "cli/progress.h"
#include "cli/stage_rows.h"

typedef struct stage_facts {
    bool mended, solid, from_leaves, judged; /* from_leaves: the theses' selections */
    bool leaf_planes;                        /* they are made, not left to readers */
    uint64_t faces;
    ebpo_build_times times;
} stage_facts;

enum { STAGE_PLAN_MAX = STAGE_ROWS + 3 };
/* The rows that will come, in their order, for progress; returns how many. */
int stages_plan(const stage_facts *f, int plan[STAGE_PLAN_MAX]);

/* Cells and envelopes of the pieces are one stage of the library's: makes it two, by what their
 * threads took. Before the two below. */
void stages_split(progress_line *line, const ebpo_build_times *times);

/* Both after progress_end_stage. `seconds`: of all. */
void stages_print(FILE *out, const progress_line *line, const stage_facts *f, double seconds);
void stages_json(json *j, const progress_line *line, const stage_facts *f);

#endif
