/* What is left of a damaged file: each of its parts is read. */
#ifndef EBPO_CMD_REPAIR_LOOK_H
#define EBPO_CMD_REPAIR_LOOK_H

#include <ebpo/ebpo.h>
#include <stdbool.h>

#include "cli/progress.h"

typedef enum fate { NONE, KEPT, REBUILT, LOST } fate; /* NONE: the file has no such part */

typedef enum piece { MESH, MAPS, ATTRIBUTES, LEVELS, SUMS, PIECES } piece;

typedef struct patient {
    const struct values *v; /* what the command was given */
    const char *path;
    unsigned threads;
    uint64_t most_expansion;
    ebpo_file *file;
    const ebpo_info *info;
    ebpo_workspace *workspace;
    ebpo_progress progress;
    fate fate[PIECES];
    char why[PIECES][sizeof((ebpo_error *)NULL)->message]; /* what is wrong; "": nothing */
    bool same;                                             /* the new content is that of the file */
} patient;

/* How its parts are read. */
ebpo_read_options patient_reading(const patient *p);

/* Sets what has become of each part, and why. The file may be another one afterwards, opened
 * without its lists; p->info goes with it. Fails for what says nothing about the file, such as
 * want of memory. */
ebpo_status patient_look(patient *p, ebpo_error *error);

#endif
