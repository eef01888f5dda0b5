/* Implements `ebpo convert --split-components` and `--split-groups`: a folder with a file for each
 * part, and a scene. */
#ifndef EBPO_TOOLS_CONVERT_PARTS_H
#define EBPO_TOOLS_CONVERT_PARTS_H

#include "cli/mesh_input.h"
#include "cli/progress.h"

typedef struct parts_run {
    /* Builds a file; the mesh is freed in any case. */
    ebpo_status (*build)(void *user, mesh_input *part, const char *path, ebpo_progress progress,
                         ebpo_error *error);
    /* Checks memory for the largest part. */
    ebpo_status (*fits)(void *user, uint64_t faces, ebpo_error *error);
    void *user;
    const ebpo_mesh_groups *groups; /* NULL: components are the parts */
    const char *folder, *unit;      /* unit: NULL: none */
    bool json, quiet;
    unsigned threads;
    progress_line *line; /* wiped before a warning */
    ebpo_progress progress;
} parts_run;

/* Makes a temporary folder beside `folder`, before anything is read, and registers clean-up at
 * exit. */
EBPO_MUST_USE ebpo_status parts_begin(const char *folder, bool groups, ebpo_error *error);

/* Writes the parts of the repaired mesh, and frees the mesh. Then gives the folder its final name,
 * and reports the contents of the folder. */
EBPO_MUST_USE ebpo_status parts_write(const parts_run *run, mesh_input *whole, double begun,
                                      ebpo_error *error);

/* Removes parts whose folder does not have its final name. May be called at any time. */
void parts_end(void);

#endif
