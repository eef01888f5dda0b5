/* Containment: no point of a face in the cell, and no inside corner of the cell, is cut off by the
 * node's own planes. */
#ifndef EBPO_VERIFY_CONTAINMENT_H
#define EBPO_VERIFY_CONTAINMENT_H

#include "verify/touch.h"
#include "verify/twin_tree.h"

enum { EBPO_HALF_SPACES_MAX = 255 }; /* counts are bytes */

/* A node's own planes, decoded. Codes that stand for no plane are left out (they are violations
 * elsewhere). */
typedef struct ebpo_half_spaces {
    int count;
    double n[EBPO_HALF_SPACES_MAX][3], bound[EBPO_HALF_SPACES_MAX]; /* n . xi <= bound; exact */
    int32_t normal[EBPO_HALF_SPACES_MAX][3], d[EBPO_HALF_SPACES_MAX];
    uint32_t number[EBPO_HALF_SPACES_MAX]; /* place among the node's codes */
} ebpo_half_spaces;

void ebpo_half_spaces_of(ebpo_half_spaces *out, const ebpo_twin_tree *view,
                         const ebpo_twin_node *node);

/* A face that touches the cell. */
void ebpo_check_face_contained(ebpo_tally *tally, const ebpo_half_spaces *planes,
                               const ebpo_twin_node *node, const ebpo_frame *frame,
                               const ebpo_corners *face, uint64_t number);

/* Cell corners, bit i for corner i (bit 0 x, bit 1 y, bit 2 z). */
void ebpo_check_corners_contained(ebpo_tally *tally, const ebpo_half_spaces *planes,
                                  const ebpo_twin_node *node, unsigned corners);

#endif
