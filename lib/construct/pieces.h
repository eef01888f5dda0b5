/* What the pieces of the tree own while they are built (pieces.c). */
#ifndef EBPO_CONSTRUCT_PIECES_H
#define EBPO_CONSTRUCT_PIECES_H

#include <ebpo/build.h>

#include "construct/builder.h"
#include "format/schema.h"

/* --- a piece's part of the levels' arrays --- */

/* Of one level. */
typedef struct ebpo_piece_level {
    ebpo_level level;
    bool packed;                          /* its arrays are in the builder's store */
    uint64_t capacity[EBPO_LEVEL_ARRAYS]; /* by ebpo_array_id */
} ebpo_piece_level;

bool ebpo_piece_level_add_group(ebpo_piece_level *out, uint16_t types);
bool ebpo_piece_level_add_gray(ebpo_piece_level *out, const uint32_t *codes, int count,
                               double volume);
bool ebpo_piece_level_add_empty(ebpo_piece_level *out, bool black, int32_t winding);
/* All levels of a piece. */
void ebpo_piece_levels_free(ebpo_piece_level *out);

/* --- planes that were chosen from the leaves up, and what nodes hand to their parents --- */

/* A plane that a node's parent may choose from: its normal, and n . xi of the face that it comes
 * from. */
typedef struct ebpo_offer {
    uint32_t normal;
    double origin;
} ebpo_offer;

/* What a node hands to its parent, in its own cell's coordinates: its planes and the corners of its
 * envelope's polygons (EBP 2017, 3.4.1). */
typedef struct ebpo_handover {
    ebpo_offer *offers;
    double (*corner)[3];
    uint64_t offer_count, offer_capacity, corner_count, corner_capacity;
} ebpo_handover;

/* Chosen planes of a branch's gray nodes and leaves, by detail. */
typedef struct ebpo_proposals {
    uint64_t *first; /* [detail_count] in `codes` */
    uint8_t *count;  /* [detail_count] */
    uint32_t *codes;
    uint64_t code_count, code_capacity;
    bool packed;        /* the arrays are in the builder's store */
    ebpo_handover root; /* a subtree's, until the top has used it */
} ebpo_proposals;

/* Without any planes yet. False: out of memory. */
bool ebpo_proposals_make(ebpo_branch *s);
/* The planes of a node; NULL when the selection works from the root. */
const uint32_t *ebpo_proposed(const ebpo_branch *s, uint32_t detail, int *count);
void ebpo_proposals_free(ebpo_proposals *p);

void ebpo_handover_free(ebpo_handover *h);
/* False: out of memory. */
bool ebpo_handover_add(ebpo_handover *h, uint32_t normal, double origin);
/* Adds what a child hands over, from its coordinates to its parent's. */
bool ebpo_handover_gather(ebpo_handover *given, const ebpo_handover *child, unsigned octant);

/* --- the store: holds the results of pieces until the levels are joined --- */

/* Moves what a piece gave to the store, out of the way: to be read once, when the levels are
 * joined. Nothing to do without a workspace. */
ebpo_status ebpo_build_pack(ebpo_builder *b, ebpo_piece_level *out, ebpo_error *error);
/* Room in it, aligned for 8 bytes, until it is freed; NULL: see ebpo_workspace_fail. Needs a
 * workspace. */
void *ebpo_store_reserve(ebpo_builder *b, uint64_t bytes);
void ebpo_store_free(struct ebpo_store *store);

/* --- the nodes of a piece --- */

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
