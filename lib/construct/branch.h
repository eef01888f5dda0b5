/* The nodes of a subtree under construction. */
#ifndef EBPO_CONSTRUCT_BRANCH_H
#define EBPO_CONSTRUCT_BRANCH_H

#include "construct/builder.h"

/* Adds an empty detail, or eight empty nodes. False: out of memory. */
bool ebpo_branch_detail(const ebpo_builder *b, ebpo_branch *s, uint32_t *index);
bool ebpo_branch_children(const ebpo_builder *b, ebpo_branch *s, uint32_t *first);
/* EBPO_E_LIMIT when 32 bits cannot number any more nodes of the branch. */
ebpo_status ebpo_build_check_branch(const ebpo_branch *s, ebpo_error *error);

/* Frees what partition made of the piece's list: it can be made again. */
void ebpo_branch_forget(ebpo_branch *s);
/* Frees what only partition and envelopes need; `out` and the root's facts stay. */
void ebpo_branch_release(ebpo_branch *s);
void ebpo_branch_free(ebpo_branch *s);

#endif
