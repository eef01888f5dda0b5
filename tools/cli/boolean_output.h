/* Writes meshes of Boolean results: the exact result, or its cells. */
#ifndef EBPO_TOOLS_BOOLEAN_OUTPUT_H
#define EBPO_TOOLS_BOOLEAN_OUTPUT_H

#include <ebpo/boolean.h>
#include <ebpo/build.h>

#include "cli/json.h"

typedef struct boolean_output {
    const char *path;
    const char *unit; /* recorded in an .ebpo.h5 file */
    unsigned threads;
    bool doubles;              /* write double coordinates */
    bool changed_only;         /* write only the changes of the first operand */
    bool colours;              /* colour faces by their operand */
    bool volume, crossings;    /* compute these facts of the exact result */
    ebpo_workspace *workspace; /* of the exact result; NULL: no limit of memory */
    uint64_t vertices, faces;  /* of the exact result that was written */
    ebpo_boolean_mesh_report report;
    uint64_t temporary;      /* largest size of the temporary files */
    uint64_t crossing_pairs; /* with `crossings`: pairs of faces that intersect, by rounding */
} boolean_output;

/* Writes a mesh to OUT.ply or OUT.ebpo.h5. */
EBPO_MUST_USE ebpo_status boolean_write_mesh(const boolean_output *o, ebpo_mesh *mesh,
                                             ebpo_progress progress, ebpo_error *error);

/* Computes and writes the exact result. An empty result is an empty PLY file; as .ebpo.h5 file it
 * is EBPO_E_ABSENT. */
EBPO_MUST_USE ebpo_status boolean_write_result(boolean_output *o, ebpo_boolean *b,
                                               ebpo_progress progress, ebpo_error *error);

/* Report what was written. */
void boolean_print_result(const boolean_output *o);
void boolean_result_to_json(const boolean_output *o, json *j);

#endif
