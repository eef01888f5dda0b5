/* Making workspaces, and what went wrong in them. */
#ifndef EBPO_CORE_WORKSPACE_H
#define EBPO_CORE_WORKSPACE_H

#include <ebpo/workspace.h>

/* ebpo_workspace_new without a least: for tests, which want small models in files. */
EBPO_MUST_USE ebpo_status ebpo_workspace_make_any(ebpo_workspace **out, uint64_t memory,
                                                  const char *temp_dir, ebpo_error *error);

/* Why the last allocation of this size failed: EBPO_E_MEMORY, or EBPO_E_IO with the folder. */
ebpo_status ebpo_workspace_fail(const ebpo_workspace *workspace, uint64_t bytes, ebpo_error *error);
/* Likewise where the size is not known any more; `what` as in "while joining levels". */
ebpo_status ebpo_workspace_fail_while(const ebpo_workspace *workspace, const char *what,
                                      ebpo_error *error);

/* One holder less, of which each extent is one; the last one frees it. */
void ebpo_workspace_leave(ebpo_workspace *w);

#endif
