/* Shows progress of long work: one line on a terminal, otherwise nothing. */
#ifndef EBPO_TOOLS_PROGRESS_H
#define EBPO_TOOLS_PROGRESS_H

#include <ebpo/base.h>

enum { PROGRESS_STAGES = 48 };

typedef struct progress_line {
    const char *command; /* name of the command */
    bool active;         /* true: stderr is a terminal, and --quiet was not given */
    bool shown;          /* true: the line is on the terminal, and must be wiped */
    const char *stage;   /* stage of the last report */
    double begun, last;  /* times of progress_now: start of the stage; last drawing of the line */
    /* stages in the order in which they first began, with their times so far */
    struct {
        const char *name;
        double seconds;
    } stages[PROGRESS_STAGES];
    int stage_count, current; /* current: index of the stage that runs */
    const int *plan;          /* rows of all stages in their order (stages_plan); NULL: not known */
    int plan_count, at;       /* at: index in `plan` of the stage that runs */
    /* *faces: number of faces of the mesh, 0 before the mesh is read. After that, rates are shown
     * in faces per second. NULL: rates are shown in units of the reports */
    const uint64_t *faces;
} progress_line;

/* Returns the value to pass to the library; `line` must live as long as the work. */
ebpo_progress progress_start(progress_line *line, const char *command, bool quiet);
/* Reports progress of work that the command does itself. */
void progress_report(progress_line *line, const char *stage, uint64_t done, uint64_t total);
/* Sets the plan of stages, so that the line shows "stage 2 of 9", and the number of faces, for
 * rates. `plan`, `faces`: see progress_line; both must live as long as the work. */
void progress_plan(progress_line *line, const int *plan, int count, const uint64_t *faces);
/* Wipes the line. Call this before printing other text; it may be called at any time. */
void progress_wipe(progress_line *line);

/* Ends the time of the last stage; call before reading the times of stages. */
void progress_end_stage(progress_line *line);

/* Returns seconds on a monotonic clock. */
double progress_now(void);

#endif
