/* What both passes over an OBJ file share. */
#ifndef EBPO_MESH_OBJ_STATE_H
#define EBPO_MESH_OBJ_STATE_H

#include "mesh/import_build.h"
#include "mesh/obj_names.h"
#include "mesh/obj_text.h"

/* What the file says and the mesh does not have. */
typedef struct obj_losses {
    uint64_t weights, surplus;              /* vertices divided by w; with values beyond */
    uint64_t curves, unknown, unknown_line; /* statements; where the first unknown one is */
    uint64_t absent[IMPORT_SORTS];          /* corners that name values that are not there */
    uint64_t uncoloured, alpha, no_numbers; /* vertices, vertices, normals and coordinates */
    bool third, smoothing, library, groups;
} obj_losses;

typedef struct obj_reading {
    import_build *build;
    const uint8_t *data;
    uint64_t size;
    obj_text text;
    uint64_t next_release;       /* byte */
    uint64_t line;               /* where the statement began */
    uint64_t rows[IMPORT_SORTS]; /* of the file's vertices, normals, texture coordinates; in the
                                    second pass of those so far */
    ebpo_obj_runs *runs;         /* NULL: not asked for */
    obj_losses losses;
    obj_names names;
} obj_reading;

/* The next statement's first word; lets pages go now and then. */
bool ebpo_obj_step(obj_reading *r, obj_word *word);

/* EBPO_E_FORMAT, with the statement's line. */
ebpo_status ebpo_obj_fail(const obj_reading *r, const char *format, ...) EBPO_PRINTF(2, 3);

#endif
