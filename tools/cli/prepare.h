/* Reading a mesh, mending it as asked, and checking what came out. */
#ifndef EBPO_TOOLS_PREPARE_H
#define EBPO_TOOLS_PREPARE_H

#include <ebpo/mesh.h>

typedef struct mending {
    bool weld, orient, fill_holes;
} mending;

typedef struct prepared {
    ebpo_mesh mesh;          /* as mended */
    ebpo_mesh as_read;       /* facts only; its array pointers tell which there were, no more */
    ebpo_mesh_report before; /* of the mesh as read */
    ebpo_mesh_report report; /* of the mesh as mended */
    ebpo_mend_record record;
    bool mended; /* a mending step ran, so the two reports may differ */
} prepared;

/* Weld (always for STL, which has no shared vertices), orient, fill holes, each if asked; checks
 * before and after. The mesh is put into the order that building needs before all that, so that
 * every step keeps to the workspace's memory. On failure nothing is left to free; else
 * ebpo_mesh_free(&out->mesh). */
EBPO_MUST_USE ebpo_status prepare_mesh(prepared *out, const char *path, mending asked,
                                       ebpo_workspace *workspace, unsigned threads,
                                       ebpo_progress progress, ebpo_error *error);

#endif
