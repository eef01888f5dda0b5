/* Defines the data of pieces: subtrees that are built separately, each by one thread. The nodes
 * above all pieces are the top; a branch `s` is the top or a piece (builder.h). */
#ifndef EBPO_CONSTRUCT_PIECES_H
#define EBPO_CONSTRUCT_PIECES_H

#include <ebpo/build.h>

#include "construct/builder.h"
#include "format/schema.h"

/* --- a piece's part of the levels' arrays --- */

/* A piece's part of the arrays of one level: a contiguous range ("stretch") of each array. */
typedef struct ebpo_piece_level {
    ebpo_level level;
    /* the arrays are in the builder's store, which frees them */
    bool packed;
    /* [ebpo_array_id] number of elements for which the array has space */
    uint64_t capacity[EBPO_LEVEL_ARRAYS];
} ebpo_piece_level;

/* These three functions add, in this order: the types of a group of eight nodes; the plane codes
 * and the volume of a gray node; the winding number of a white or black node. They return false
 * when out of memory. */
bool ebpo_piece_level_add_group(ebpo_piece_level *out, uint16_t types);
bool ebpo_piece_level_add_gray(ebpo_piece_level *out, const uint32_t *codes, int count,
                               double volume);
bool ebpo_piece_level_add_empty(ebpo_piece_level *out, bool black, int32_t winding);
/* Frees the arrays of all levels of a piece. */
void ebpo_piece_levels_free(ebpo_piece_level *out);

/* --- planes chosen from the leaves up, and the data that nodes pass to their parents --- */

/* A plane that a node offers to its parent: a plane that the node has chosen, or the plane of a
 * face of a leaf. */
typedef struct ebpo_offer {
    uint32_t normal; /* normal of the plane: bits 0 to 19 of a plane code */
    /* position among all offers that the node got from its children, or from its faces if it is a
     * leaf */
    uint32_t rank;
    /* offset of the plane before any node moved the plane: n . x for the centroid x of the face
     * that gave the plane, in the coordinates of the node's cell */
    double origin;
} ebpo_offer;

/* Data that a node passes to its parent, in the coordinates of the node's cell (EBP 2017, 3.4.1):
 * the node's chosen planes, and corners of the node's envelope. Only corners of those envelope
 * faces are passed that planes made. Corners that only faces of the cell have are not passed. */
typedef struct ebpo_handover {
    ebpo_offer *offers;
    double (*corner)[3];
    uint64_t offer_count, offer_capacity, corner_count, corner_capacity;
} ebpo_handover;

/* Planes of a branch's gray nodes and leaves, chosen from the leaves up. The index of a node in
 * these arrays is its index in ebpo_branch.details. */
typedef struct ebpo_proposals {
    uint64_t *first; /* [detail_count] index of the node's first code in `codes` */
    uint8_t *count;  /* [detail_count] number of the node's codes */
    uint32_t *codes;
    uint64_t code_count, code_capacity;
    bool packed;               /* the arrays are in the builder's store */
    ebpo_thesis_level *thesis; /* [EBPO_LEVELS_MAX] sums of ebpo_build_as_theses, or NULL */
    ebpo_handover root;        /* data that the piece's root passes to its parent in the top */
} ebpo_proposals;

/* Sets s->proposals to proposals without planes, for all elements of s->details. Returns false when
 * out of memory. */
bool ebpo_proposals_make(ebpo_branch *s);
/* Returns the codes of the planes that were chosen for a node, and sets *count to their number.
 * Returns NULL if the selection works from the root down. */
const uint32_t *ebpo_proposed(const ebpo_branch *s, uint32_t detail, int *count);
void ebpo_proposals_free(ebpo_proposals *p);

void ebpo_handover_free(ebpo_handover *h);
/* Adds an offer with this normal and this origin; its rank is 0. Returns false when out of memory.
 */
bool ebpo_handover_add(ebpo_handover *h, uint32_t normal, double origin);
/* Adds the data of the child in this octant to `given`, in the coordinates of the parent's cell.
 * Returns false when out of memory. */
bool ebpo_handover_gather(ebpo_handover *given, const ebpo_handover *child, unsigned octant);

/* --- the store: holds the results of pieces until the levels are joined --- */

/* Moves a piece's results to the store. Does nothing if the builder has no workspace. */
ebpo_status ebpo_build_pack(ebpo_builder *b, ebpo_piece_level *out, ebpo_error *error);
/* Reserves memory in the store, aligned to 8 bytes and valid until the store is freed. The builder
 * must have a workspace. Returns NULL on failure; then call ebpo_workspace_fail. */
void *ebpo_store_reserve(ebpo_builder *b, uint64_t bytes);
void ebpo_store_free(struct ebpo_store *store);

/* --- the nodes of a piece --- */

/* The first function adds a detail of zeros, and sets *index to its index. The second function adds
 * eight empty nodes, and sets *first to the index of the first one. Both return false when out of
 * memory. */
bool ebpo_branch_detail(const ebpo_builder *b, ebpo_branch *s, uint32_t *index);
bool ebpo_branch_children(const ebpo_builder *b, ebpo_branch *s, uint32_t *first);
/* Returns EBPO_E_LIMIT if the indices of eight more nodes, or of a detail, exceed 32 bits. */
ebpo_status ebpo_build_check_branch(const ebpo_branch *s, ebpo_error *error);

/* Frees the piece's nodes, details, entries and crossing faces, which ebpo_build_partition can make
 * again. */
void ebpo_branch_forget(ebpo_branch *s);
/* Frees all data of the piece except `out` and the fields that are not pointers. */
void ebpo_branch_release(ebpo_branch *s);
/* Frees all data of the branch, and sets its bytes to zero. */
void ebpo_branch_free(ebpo_branch *s);

#endif
