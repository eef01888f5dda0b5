/* The levels' arrays from what the pieces made. */
#ifndef EBPO_CONSTRUCT_JOIN_LEVELS_H
#define EBPO_CONSTRUCT_JOIN_LEVELS_H

#include "construct/builder.h"

ebpo_status ebpo_build_levels(ebpo_builder *b, ebpo_tree *out, ebpo_error *error);

#endif
