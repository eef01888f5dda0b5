/* Calls of each public function with real models: every_call_*.c contain the calls,
 * test_every_call.c runs them with and without a workspace, and with failing allocations. */
#ifndef EBPO_TESTS_EVERY_CALL_H
#define EBPO_TESTS_EVERY_CALL_H

#include <ebpo/ebpo.h>

typedef struct every_call_env {
    ebpo_workspace *workspace; /* NULL: arrays are allocated by malloc */
    ebpo_file *file;           /* an open file, which a failed call leaves usable */
    ebpo_error *error;
} every_call_env;

/* A named call. It leaves nothing behind, whether it succeeds or fails. */
typedef struct every_call {
    const char *name;
    ebpo_status (*call)(every_call_env *e);
} every_call;

/* The last entry has no name. */
extern const every_call every_call_meshes[], every_call_files[], every_call_results[],
    every_call_extras[];

/* Points in and around the model. */
enum { EVERY_CALL_POINTS = 40 };
void every_call_points(double (*points)[3]);

/* Reads a mesh of the scratch folder, and repairs it to a solid. */
ebpo_status every_call_read(every_call_env *e, const char *name, ebpo_mesh *mesh);
ebpo_status every_call_prepare(ebpo_mesh *mesh, ebpo_prepared *out, ebpo_error *error);

/* Defined in every_call_extras.c, called by every_call_results.c. */
ebpo_status every_call_two_models(ebpo_model *model, bool whole, ebpo_error *error);

/* Inputs of the calls, below the scratch folder. */
#define EVERY_CALL_MODEL     "model.ebpo.h5"
#define EVERY_CALL_SURFACE   "surface.ebpo.h5" /* with holes, without its border */
#define EVERY_CALL_ROWS      "rows.h5"         /* rows of coordinates, at EVERY_CALL_ROWS_PATH */
#define EVERY_CALL_ROWS_PATH "/VTKHDF/Points"
#define EVERY_CALL_PLY       "torus.ply"
#define EVERY_CALL_SPLIT     "split.ply"    /* without shared vertices */
#define EVERY_CALL_TURNED    "turned.ply"   /* some faces are reversed */
#define EVERY_CALL_DOUBLE    "double.ply"   /* some faces occur twice */
#define EVERY_CALL_HOLED     "holed.ply"    /* some faces are missing */
#define EVERY_CALL_CROSSING  "crossing.ply" /* faces intersect */
#define EVERY_CALL_OBJ       "torus.obj"

/* Returns a URL of the model; NULL: no server. */
const char *every_call_url(void);

/* Makes all allocations succeed until every_call_resume(). Used for allocations of the tests
 * themselves. */
void every_call_pause(void);
void every_call_resume(void);

#endif
