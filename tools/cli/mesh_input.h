/* The mesh that a command is given: read, mended as asked, checked; and the options for that. */
#ifndef EBPO_TOOLS_MESH_INPUT_H
#define EBPO_TOOLS_MESH_INPUT_H

#include <ebpo/groups.h>
#include <ebpo/query.h>
#include <ebpo/repair.h>

#include "cli/args.h"

typedef struct mending {
    bool weld, drop_duplicates, orient, flip, fill_holes;
    bool repair;          /* the shortest sequence of these that leaves a plausible solid */
    double weld_distance; /* above 0: vertices are merged within it, before repairs are tried */
    bool advise;          /* no option: without any of these, find out which one that is */
} mending;

typedef struct mesh_input {
    ebpo_mesh mesh;         /* as mended */
    ebpo_mesh as_read;      /* facts only; its array pointers tell which there were, no more */
    char unread[512];       /* ebpo_mesh_unread; empty: nothing was left out */
    ebpo_prepared prepared; /* what was found and mended */
    bool tried;             /* repairs, which `repairs` tells of */
    ebpo_repairs repairs;
    /* faces at the positions of an earlier one, of the mesh as mended; of these, where vertices are
     * at one position, those that look the other way and those that look the same way */
    ebpo_finding repeated;
    uint64_t repeated_opposite, repeated_same;
    bool counted; /* closed components, which `shells` tells of */
    ebpo_shells shells;
    uint32_t doubts; /* ebpo_doubt, of the mesh as mended */
    ebpo_rule rule;  /* of the solid; set by the caller, else nonzero */
} mesh_input;

/* EXIT_USAGE with a message when --repair is given with what it chooses from. */
int mending_check(const char *command, mending asked);

/* What is read beside positions and corners. */
typedef enum mesh_reading {
    READ_MESH,
    READ_ATTRIBUTES,
    READ_TEXTURES /* and the bytes of images that it names */
} mesh_reading;

/* On failure nothing is left to free; else ebpo_mesh_free(&out->mesh). */
EBPO_MUST_USE ebpo_status mesh_input_read(mesh_input *out, const char *path, mending asked,
                                          mesh_reading more, ebpo_workspace *workspace,
                                          unsigned threads, ebpo_progress progress,
                                          ebpo_error *error);

/* With the file's groups: see ebpo_mesh_read_groups. */
EBPO_MUST_USE ebpo_status mesh_input_read_groups(mesh_input *out, const char *path, mending asked,
                                                 mesh_reading more, ebpo_mesh_groups **groups,
                                                 ebpo_workspace *workspace, unsigned threads,
                                                 ebpo_progress progress, ebpo_error *error);

/* Returns what is known of the solid's volume, before or after mending. */
ebpo_solid_volume mesh_input_solid(const mesh_input *input, bool after);

/* Warns where the file holds or names what reading it left out, and of triangles that are a guess.
 */
void mesh_input_warn(const char *command, const char *path, const mesh_input *input);

#endif
