/* A piece to its part of the levels' arrays. */
#ifndef EBPO_CONSTRUCT_EMIT_LEVELS_H
#define EBPO_CONSTRUCT_EMIT_LEVELS_H

#include "construct/builder.h"

typedef struct ebpo_emit_scratch ebpo_emit_scratch;
ebpo_status ebpo_emit_scratch_make(ebpo_emit_scratch **out, ebpo_workspace *workspace,
                                   ebpo_error *error);
void ebpo_emit_scratch_free(ebpo_emit_scratch *scratch);

/* leaf_refs still holds the faces' numbers along the curve, not the final ones. */
ebpo_status ebpo_emit_piece(const ebpo_builder *b, ebpo_emit_scratch *scratch, ebpo_branch *s,
                            ebpo_error *error);

/* The levels' arrays from what the pieces made. */

ebpo_status ebpo_build_levels(ebpo_builder *b, ebpo_tree *out, ebpo_error *error);

#endif
