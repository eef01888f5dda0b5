/* What is within crowded hosts. */
#ifndef EBPO_MESH_SHELL_RAYS_H
#define EBPO_MESH_SHELL_RAYS_H

#include "mesh/shells.h"

/* A ray from each sample goes through a tree of all of their faces; adds to the depths. */
EBPO_MUST_USE ebpo_status ebpo_nesting_cast(nesting *n, ebpo_error *error);

#endif
