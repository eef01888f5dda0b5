/* The extents of a workspace: whole pages of memory, or of files. */
#ifndef EBPO_CORE_WORKSPACE_EXTENTS_H
#define EBPO_CORE_WORKSPACE_EXTENTS_H

#include "core/workspace_parts.h"

/* NULL: the workspace's `failed` tells why. */
ebpo_extent *ebpo_extent_make(ebpo_workspace *w, size_t bytes, ebpo_extent_kind kind);
ebpo_extent *ebpo_part_make(ebpo_workspace *w, size_t bytes);
/* Takes the extent that begins there out of the table; NULL: it is none of the workspace's. */
ebpo_extent *ebpo_extent_take(ebpo_workspace *w, const void *at);
void ebpo_extent_free(ebpo_workspace *w, ebpo_extent *extent);

#endif
