/* Defines the data of the pieces of the tree during the build: subtrees that are built separately
 */
#ifndef EBPO_CONSTRUCT_PIECES_H
#define EBPO_CONSTRUCT_PIECES_H

#include <ebpo/build.h>

#include "construct/builder.h"
#include "format/schema.h"

/* --- a piece's part of the levels' arrays --- */

/* A piece's stretches of the arrays of one level. */
typedef struct ebpo_piece_level {
    ebpo_level level;
    bool packed;                          /* its arrays are in the builder's store */
    uint64_t capacity[EBPO_LEVEL_ARRAYS]; /* indexed by ebpo_array_id */
} ebpo_piece_level;

bool ebpo_piece_level_add_group(ebpo_piece_level *out, uint16_t types);
bool ebpo_piece_level_add_gray(ebpo_piece_level *out, const uint32_t *codes, int count,
                               double volume);
bool ebpo_piece_level_add_empty(ebpo_piece_level *out, bool black, int32_t winding);
/* Frees the arrays of all levels of a piece. */
void ebpo_piece_levels_free(ebpo_piece_level *out);

/* --- planes chosen from the leaves up, and the data that nodes pass to their parents --- */

/* A plane that a node's parent may choose: its normal, its position in the node's order, and n . xi
 * of its face. */
typedef struct ebpo_offer {
    uint32_t normal, place;
    double origin; /* n . xi at the centroid of the plane's face */
} ebpo_offer;

/* Data that a node passes to its parent, in the coordinates of the node's cell: its planes and the
 * corners of its envelope's polygons (EBP 2017, 3.4.1). */
typedef struct ebpo_handover {
    ebpo_offer *offers;
    double (*corner)[3];
    uint64_t offer_count, offer_capacity, corner_count, corner_capacity;
} ebpo_handover;

/* Chosen planes of a piece's gray nodes and leaves, by detail. */
typedef struct ebpo_proposals {
    uint64_t *first; /* [detail_count] index in `codes` */
    uint8_t *count;  /* [detail_count] */
    uint32_t *codes;
    uint64_t code_count, code_capacity;
    bool packed;               /* the arrays are in the builder's store */
    ebpo_thesis_level *thesis; /* [EBPO_LEVELS_MAX] sums; NULL: a tree for a file is built */
    ebpo_handover root;        /* data of a subtree's root, until the top has used them */
} ebpo_proposals;

/* Makes proposals without planes. Returns false when out of memory. */
bool ebpo_proposals_make(ebpo_branch *s);
/* Returns the planes of a node; NULL when the selection works from the root. */
const uint32_t *ebpo_proposed(const ebpo_branch *s, uint32_t detail, int *count);
void ebpo_proposals_free(ebpo_proposals *p);

void ebpo_handover_free(ebpo_handover *h);
/* Adds a plane. Returns false when out of memory. */
bool ebpo_handover_add(ebpo_handover *h, uint32_t normal, double origin);
/* Adds a child's data, transformed from its coordinates to its parent's. */
bool ebpo_handover_gather(ebpo_handover *given, const ebpo_handover *child, unsigned octant);

/* --- the store: holds the results of pieces until the levels are joined --- */

/* Moves a piece's results to the store; they are read once, when the levels are joined. Does
 * nothing without a workspace. */
ebpo_status ebpo_build_pack(ebpo_builder *b, ebpo_piece_level *out, ebpo_error *error);
/* Reserves memory in the store, aligned to 8 bytes. It is valid until the store is freed. Returns
 * NULL on failure, which ebpo_workspace_fail reports. Needs a workspace. */
void *ebpo_store_reserve(ebpo_builder *b, uint64_t bytes);
void ebpo_store_free(struct ebpo_store *store);

/* --- the nodes of a piece --- */

/* ebpo_branch_detail adds an empty detail, ebpo_branch_children eight empty nodes. They return
 * false when out of memory. */
bool ebpo_branch_detail(const ebpo_builder *b, ebpo_branch *s, uint32_t *index);
bool ebpo_branch_children(const ebpo_builder *b, ebpo_branch *s, uint32_t *first);
/* Returns EBPO_E_LIMIT when 32 bits cannot number more nodes of the piece. */
ebpo_status ebpo_build_check_branch(const ebpo_branch *s, ebpo_error *error);

/* Frees the results of partition for the piece; a second call of partition makes them again. */
void ebpo_branch_forget(ebpo_branch *s);
/* Frees the data that only partition and envelopes need; keeps `out` and the root's type and corner
 * differences. */
void ebpo_branch_release(ebpo_branch *s);
void ebpo_branch_free(ebpo_branch *s);

#endif
