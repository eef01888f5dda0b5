/* Progress of long work: one line on a terminal, nothing elsewhere. */
#ifndef EBPO_TOOLS_PROGRESS_H
#define EBPO_TOOLS_PROGRESS_H

#include <ebpo/base.h>

enum { PROGRESS_STAGES = 48 };

typedef struct progress_line {
    const char *command;
    bool active;        /* stderr is a terminal and the user does not want quiet */
    bool shown;         /* there is a line to wipe */
    const char *stage;  /* of the last report */
    double begun, last; /* seconds: when the stage began, when the line was drawn */
    /* in the order in which they began first */
    struct {
        const char *name;
        double seconds;
    } stages[PROGRESS_STAGES];
    int stage_count, current;
    const int *plan; /* rows of stages.h that will come, in their order; NULL: not known */
    int plan_count, at;
    /* of the mesh, 0 while it is not read; NULL: rates are of what is done */
    const uint64_t *faces;
} progress_line;

/* What to hand to the library; `line` must live as long as the work. */
ebpo_progress progress_start(progress_line *line, const char *command, bool quiet);
/* Work that the command does itself: how far it is. */
void progress_tell(progress_line *line, const char *stage, uint64_t done, uint64_t total);
/* Says which stages will come, so that the line tells how many are left, and gives rates in faces.
 * Both must live as long as the work. */
void progress_plan(progress_line *line, const int *plan, int count, const uint64_t *faces);
/* Wipes the line; call before printing anything else. Harmless at any time. */
void progress_wipe(progress_line *line);

/* Lets the stages' times end here; before they are read. */
void progress_end_stage(progress_line *line);

/* Seconds on a clock that only goes forward. */
double progress_now(void);

#endif
