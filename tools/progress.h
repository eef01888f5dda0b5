/* Progress of long work: one line on a terminal, nothing elsewhere. */
#ifndef EBPO_TOOLS_PROGRESS_H
#define EBPO_TOOLS_PROGRESS_H

#include <ebpo/base.h>

typedef struct progress_line {
    const char *command;
    bool active;        /* stderr is a terminal and the user does not want quiet */
    bool shown;         /* there is a line to wipe */
    const char *stage;  /* of the last report */
    double begun, last; /* seconds: when the stage began, when the line was drawn */
} progress_line;

/* What to hand to the library; `line` must live as long as the work. */
ebpo_progress progress_start(progress_line *line, const char *command, bool quiet);
/* Wipes the line; call before printing anything else. Harmless at any time. */
void progress_wipe(progress_line *line);

/* Seconds on a clock that only goes forward. */
double progress_now(void);

#endif
