/* Which faces of an OBJ file stand under which `g` and `o` lines. */
#ifndef EBPO_IMPORT_OBJ_RUNS_H
#define EBPO_IMPORT_OBJ_RUNS_H

#include <ebpo/mesh.h>

#include "base/named_run.h"

typedef struct ebpo_obj_runs {
    ebpo_named_run *of; /* [count] the first is what stands before any name; that is "" */
    uint64_t count;
    /* The file with a name for each run, its number: assimp puts faces to an object of the same
     * name, or to the one before. */
    char *text;
    uint64_t text_size;
} ebpo_obj_runs;

/* Of the bytes, which the runs' names point into; without faces yet. EBPO_E_UNSUPPORTED: assimp
 * would not see the names where they are. EBPO_E_LIMIT, EBPO_E_MEMORY. On failure cleared. */
EBPO_MUST_USE ebpo_status ebpo_obj_runs_find(ebpo_obj_runs *out, const uint8_t *data, uint64_t size,
                                             const char *name, ebpo_error *error);

/* EBPO_E_UNSUPPORTED: what assimp makes of the file is not in the runs' order. */
ebpo_status ebpo_fail_no_runs(const char *name, ebpo_error *error);

/* The number of the run that an object of assimp's is; false where it is none. */
bool ebpo_obj_run_number(const ebpo_obj_runs *runs, const char *object, uint64_t *number);

void ebpo_obj_runs_free(ebpo_obj_runs *runs);

#endif
