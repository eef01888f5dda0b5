/* The top of the tree, and the lists of faces of the pieces below it. */
#ifndef EBPO_CONSTRUCT_SPLIT_H
#define EBPO_CONSTRUCT_SPLIT_H

#include "construct/builder.h"

ebpo_status ebpo_build_split(ebpo_builder *b, ebpo_error *error);

#endif
