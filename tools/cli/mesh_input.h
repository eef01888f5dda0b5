/* Reads, repairs and checks the input mesh of a command; defines the options for repairs. */
#ifndef EBPO_TOOLS_MESH_INPUT_H
#define EBPO_TOOLS_MESH_INPUT_H

#include <ebpo/groups.h>
#include <ebpo/query.h>
#include <ebpo/repair.h>

#include "cli/args.h"

typedef struct repair_request {
    bool weld, drop_duplicates, orient, flip, fill_holes;
    bool repair; /* --repair: apply the shortest sequence of the repairs weld, drop_duplicates,
                  * orient and fill_holes that gives a plausible solid */
    /* if above 0: merge vertices within this distance before other repairs */
    double weld_distance;
    /* set by commands, not by an option: if no repair is requested, try repairs on copies */
    bool advise;
} repair_request;

typedef struct mesh_input {
    ebpo_mesh mesh;    /* the mesh after repairs */
    ebpo_mesh as_read; /* the mesh before repairs. Only its facts are valid: its array pointers show
                        * which arrays existed, but must not be used */
    char unread[512];  /* result of ebpo_mesh_ignored; empty: everything was read */
    bool chosen_by_repair; /* --repair was given, which excludes the options that it chooses from */
    ebpo_prepared prepared; /* findings before and after repairs, and the repairs made */
    bool repairs_tried;     /* true: repairs were tried; their results are in `repairs` */
    ebpo_repairs repairs;
    ebpo_finding repeated; /* faces of the repaired mesh at the positions of an earlier face */
    /* If vertices coincide: numbers of faces in `repeated` with the opposite orientation, and with
     * the same orientation, as the earlier face. Otherwise 0. */
    uint64_t repeated_opposite, repeated_same;
    bool shells_counted; /* true: closed components were counted in `shells` */
    ebpo_shells shells;
    uint32_t doubts; /* ebpo_doubt bits: reasons why the repaired mesh may not bound the intended
                      * solid */
    ebpo_rule rule;  /* rule of the solid; set by the caller, default nonzero */
} mesh_input;

/* Returns EXIT_USAGE with a message when --repair is combined with options that it chooses itself.
 */
int repair_check(const char *command, repair_request requested);

/* Data that is read in addition to the positions of vertices and the corners of faces. */
typedef enum mesh_reading {
    READ_MESH,
    READ_ATTRIBUTES,
    READ_TEXTURES /* attributes, and the bytes of the images that they name */
} mesh_reading;

/* Reads, repairs and checks a mesh. `more`: which further data to read. After success, call
 * ebpo_mesh_free(&out->mesh); after a failure, there is nothing to free. */
EBPO_MUST_USE ebpo_status mesh_input_read(mesh_input *out, const char *path,
                                          repair_request requested, mesh_reading more,
                                          ebpo_workspace *workspace, unsigned threads,
                                          ebpo_progress progress, ebpo_error *error);

/* Same as mesh_input_read, but also reads the groups of the file if `groups` is not NULL (see
 * ebpo_mesh_read_groups). */
EBPO_MUST_USE ebpo_status mesh_input_read_groups(mesh_input *out, const char *path,
                                                 repair_request requested, mesh_reading more,
                                                 ebpo_mesh_groups **groups,
                                                 ebpo_workspace *workspace, unsigned threads,
                                                 ebpo_progress progress, ebpo_error *error);

/* Returns the bounds of the volume of the solid. If `after`, these are the bounds after repairs,
 * otherwise before repairs. */
ebpo_solid_volume mesh_input_solid(const mesh_input *input, bool after);

/* Warns of file contents that were not read, and of ambiguous triangulations. */
void mesh_input_warn(const char *command, const char *path, const mesh_input *input);

#endif
