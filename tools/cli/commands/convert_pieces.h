/* Implements `ebpo convert --split-components` and `--split-groups`: a folder with a file for each
 * piece of the mesh, and a scene. */
#ifndef EBPO_TOOLS_CONVERT_PIECES_H
#define EBPO_TOOLS_CONVERT_PIECES_H

#include "cli/mesh_input.h"
#include "cli/progress.h"

typedef struct pieces_run {
    /* Builds the file `path`; frees the mesh of the piece also after an error. */
    ebpo_status (*build)(void *user, mesh_input *piece, const char *path, ebpo_progress progress,
                         ebpo_error *error);
    /* Checks that there is enough memory for the largest piece, which has `faces` faces. */
    ebpo_status (*fits)(void *user, uint64_t faces, ebpo_error *error);
    void *user;                     /* the first argument of both functions */
    const ebpo_mesh_groups *groups; /* NULL: components are the pieces */
    const char *folder;             /* the folder to write */
    const char *unit;               /* unit of the coordinates; NULL: none */
    bool json, quiet;
    unsigned threads;
    progress_line *line; /* wiped before a warning */
    ebpo_progress progress;
} pieces_run;

/* Makes a temporary folder beside `folder`, which a signal handler removes if the program is
 * interrupted. Call before reading the mesh, so that an unwritable folder is reported early.
 * groups: the pieces are groups, not components. */
EBPO_MUST_USE ebpo_status pieces_begin(const char *folder, bool groups, ebpo_error *error);

/* Writes the pieces of the repaired mesh `whole`, and frees the mesh. Then gives the folder its
 * final name, and reports the contents of the folder. begun: the time when the command began, see
 * progress_now. */
EBPO_MUST_USE ebpo_status pieces_write(const pieces_run *run, mesh_input *whole, double begun,
                                       ebpo_error *error);

/* Removes the temporary folder and its files, unless the folder has its final name. May be called
 * at any time. */
void pieces_end(void);

#endif
