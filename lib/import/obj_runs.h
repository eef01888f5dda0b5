/* Which faces of an OBJ file stand under which `g` and `o` lines. */
#ifndef EBPO_IMPORT_OBJ_RUNS_H
#define EBPO_IMPORT_OBJ_RUNS_H

#include "base/named_run.h"
#include "import/import.h"

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

/* As ebpo_import_memory. `runs`: NULL, or those that `data` is the text of, whose faces are
 * counted.
 */
EBPO_MUST_USE ebpo_status ebpo_import_runs(ebpo_mesh *out, ebpo_import_format format,
                                           const uint8_t *data, uint64_t size, const char *name,
                                           ebpo_workspace *workspace, ebpo_obj_runs *runs,
                                           ebpo_error *error);

/* An OBJ file with its runs and their faces; their names point into `data`. One run: the file has
 * no names. Assimp reads it twice, so that the mesh is what ebpo_import_memory gives, and
 * EBPO_E_UNSUPPORTED where that would not be so. */
EBPO_MUST_USE ebpo_status ebpo_import_groups(ebpo_mesh *out, const uint8_t *data, uint64_t size,
                                             const char *name, ebpo_workspace *workspace,
                                             ebpo_obj_runs *runs, ebpo_error *error);

/* EBPO_E_UNSUPPORTED: what assimp makes of the file is not in the runs' order. */
ebpo_status ebpo_fail_no_runs(const char *name, ebpo_error *error);

/* The number of the run that an object of assimp's is; false where it is none. */
bool ebpo_obj_run_number(const ebpo_obj_runs *runs, const char *object, uint64_t *number);

void ebpo_obj_runs_free(ebpo_obj_runs *runs);

#endif
