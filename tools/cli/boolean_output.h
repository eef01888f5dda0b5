/* Writes meshes of Boolean results: the exact result, or octree cells that enclose the result. */
#ifndef EBPO_TOOLS_BOOLEAN_OUTPUT_H
#define EBPO_TOOLS_BOOLEAN_OUTPUT_H

#include <ebpo/boolean.h>
#include <ebpo/build.h>

#include "cli/json.h"

typedef struct boolean_output {
    const char *path;
    const char *unit; /* unit of lengths to record in an .ebpo.h5 file; NULL: none */
    unsigned threads;
    bool doubles;              /* write double coordinates */
    bool changed_only;         /* write only faces that are not faces of the first operand */
    bool colours;              /* give faces the colour of their operand */
    bool volume;               /* compute the volume of the exact result */
    bool crossings;            /* count the intersecting faces of the written mesh */
    ebpo_workspace *workspace; /* limits the memory for the exact result; NULL: no limit */
    /* results of boolean_write_result */
    uint64_t vertices, faces; /* numbers of vertices and faces that were written */
    bool is_empty;            /* the result has no faces */
    ebpo_boolean_mesh_report report;
    uint64_t temporary;      /* greatest size of the temporary files, in bytes */
    uint64_t crossing_pairs; /* if `crossings`: number of pairs of intersecting faces; rounded
                              * vertices cause such pairs */
} boolean_output;

/* Writes a mesh to o->path: OUT.ply or OUT.ebpo.h5. */
EBPO_MUST_USE ebpo_status boolean_write_mesh(const boolean_output *o, ebpo_mesh *mesh,
                                             ebpo_progress progress, ebpo_error *error);

/* Computes and writes the exact result. An empty result becomes an empty PLY file; if the output is
 * an .ebpo.h5 file, the function fails with EBPO_E_ABSENT. */
EBPO_MUST_USE ebpo_status boolean_write_result(boolean_output *o, ebpo_boolean *b,
                                               ebpo_progress progress, ebpo_error *error);

/* Print facts about the written mesh: on standard output, or as members of a JSON object. */
void boolean_print_result(const boolean_output *o);
void boolean_result_to_json(const boolean_output *o, json *j);

#endif
