/* Inside lib/derive: the one file that assimp may write, under a temporary name until it is
 * complete. */
#ifndef EBPO_DERIVE_SCENE_FILE_H
#define EBPO_DERIVE_SCENE_FILE_H

#include "io/publish.h"

struct aiFileIO;

typedef struct ebpo_scene_file {
    const char *path; /* lent */
    ebpo_publish publish;
    FILE *stream; /* NULL: assimp has not opened it */
    bool failed;  /* a write came short; `why` is its errno */
    int why;
    char unknown[128]; /* another name that assimp wanted to write to, or "" */
} ebpo_scene_file;

void ebpo_scene_file_begin(ebpo_scene_file *file, const char *path);
/* Hands the file to assimp by the last part of its name; no other name exists for it. `io` points
 * into `file`. */
void ebpo_scene_file_offer(ebpo_scene_file *file, struct aiFileIO *io);
EBPO_MUST_USE ebpo_status ebpo_scene_file_commit(ebpo_scene_file *file, ebpo_error *error);
/* Removes it, unless it was committed. */
void ebpo_scene_file_abort(ebpo_scene_file *file);

#endif
