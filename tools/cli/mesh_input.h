/* The mesh that a command is given: read, mended as asked, checked; and the options for that. */
#ifndef EBPO_TOOLS_MESH_INPUT_H
#define EBPO_TOOLS_MESH_INPUT_H

#include <ebpo/groups.h>

#include "cli/args.h"

typedef struct mending {
    bool weld, orient, fill_holes;
} mending;

#define MENDING_OPTIONS(type, member)                                               \
    OPTION_FLAG("weld", 0, type, member.weld,                                       \
                "first merge vertices at the same position (always done for STL)"), \
        OPTION_FLAG("orient", 0, type, member.orient,                               \
                    "then make neighbouring faces agree in orientation"),           \
        OPTION_FLAG("fill-holes", 0, type, member.fill_holes, "then close simple boundary loops")

typedef struct mesh_input {
    ebpo_mesh mesh;         /* as mended */
    ebpo_mesh as_read;      /* facts only; its array pointers tell which there were, no more */
    ebpo_prepared prepared; /* what was found and mended */
} mesh_input;

/* `attributes`: properties beyond positions and corners are read as well. On failure nothing is
 * left to free; else ebpo_mesh_free(&out->mesh). */
EBPO_MUST_USE ebpo_status mesh_input_read(mesh_input *out, const char *path, mending asked,
                                          bool attributes, ebpo_workspace *workspace,
                                          unsigned threads, ebpo_progress progress,
                                          ebpo_error *error);

/* With the file's groups: see ebpo_mesh_read_groups. */
EBPO_MUST_USE ebpo_status mesh_input_read_groups(mesh_input *out, const char *path, mending asked,
                                                 bool attributes, ebpo_mesh_groups **groups,
                                                 ebpo_workspace *workspace, unsigned threads,
                                                 ebpo_progress progress, ebpo_error *error);

#endif
