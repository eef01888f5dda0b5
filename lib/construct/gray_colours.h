/* Colours of gray nodes: means of those of the faces below. format-spec/README.md, section 19. */
#ifndef EBPO_CONSTRUCT_GRAY_COLOURS_H
#define EBPO_CONSTRUCT_GRAY_COLOURS_H

#include "construct/builder.h"

/* Of a tree whose levels, mesh and attributes are there, and have colours. EBPO_E_MEMORY,
 * EBPO_E_IO, EBPO_E_CANCELLED. */
EBPO_MUST_USE ebpo_status ebpo_build_gray_colours(const ebpo_builder *b, ebpo_tree *out,
                                                  ebpo_error *error);

#endif
