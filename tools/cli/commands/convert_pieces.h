/* Implements `ebpo convert --split-components` and `--split-groups`: a folder with a file for each
 * piece of the mesh, and a scene. */
#ifndef EBPO_TOOLS_CONVERT_PIECES_H
#define EBPO_TOOLS_CONVERT_PIECES_H

#include "cli/mesh_input.h"
#include "cli/progress.h"

typedef struct pieces_run {
    /* Builds a file; the mesh is freed in any case. */
    ebpo_status (*build)(void *user, mesh_input *piece, const char *path, ebpo_progress progress,
                         ebpo_error *error);
    /* Checks that there is enough memory for the largest piece, which has `faces` faces. */
    ebpo_status (*fits)(void *user, uint64_t faces, ebpo_error *error);
    void *user;
    const ebpo_mesh_groups *groups; /* NULL: components are the pieces */
    const char *folder;             /* the folder to write */
    const char *unit;               /* unit of the coordinates; NULL: none */
    bool json, quiet;
    unsigned threads;
    progress_line *line; /* wiped before a warning */
    ebpo_progress progress;
} pieces_run;

/* Makes a temporary folder beside `folder`, before anything is read, and registers clean-up at
 * exit. */
EBPO_MUST_USE ebpo_status pieces_begin(const char *folder, bool groups, ebpo_error *error);

/* Writes the pieces of the repaired mesh, and frees the mesh. Then gives the folder its final name,
 * and reports the contents of the folder. */
EBPO_MUST_USE ebpo_status pieces_write(const pieces_run *run, mesh_input *whole, double begun,
                                       ebpo_error *error);

/* Removes the temporary folder and its files, unless the folder has its final name. May be called
 * at any time. */
void pieces_end(void);

#endif
