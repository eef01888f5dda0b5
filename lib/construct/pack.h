/* The store: where pieces put what they made until the levels are joined. */
#ifndef EBPO_CONSTRUCT_PACK_H
#define EBPO_CONSTRUCT_PACK_H

#include "construct/builder.h"
#include "construct/piece_levels.h"

/* Moves what a piece gave to the store, out of the way: to be read once, when the levels are
 * joined. Nothing to do without a workspace. */
ebpo_status ebpo_build_pack(ebpo_builder *b, ebpo_piece_level *out, ebpo_error *error);
/* Room in it, aligned for 8 bytes, until it is freed; NULL: see ebpo_workspace_fail. Needs a
 * workspace. */
void *ebpo_store_reserve(ebpo_builder *b, uint64_t bytes);
void ebpo_store_free(struct ebpo_store *store);

#endif
