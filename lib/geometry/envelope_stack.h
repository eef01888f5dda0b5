/* Envelopes along a way down the tree, as polytopes, so that neighbours share their ancestors'. */
#ifndef EBPO_GEOMETRY_ENVELOPE_STACK_H
#define EBPO_GEOMETRY_ENVELOPE_STACK_H

#include <ebpo/file.h>

#include "geometry/polytope.h"
#include "geometry/octcode.h"

/* About 170 KB; zeroed before first use. */
typedef struct ebpo_envelope_stack {
    ebpo_octcode octcode[EBPO_LEVELS_MAX]; /* whose envelope it is; 0: nobody's */
    ebpo_polytope at[EBPO_LEVELS_MAX];
} ebpo_envelope_stack;

/* The node's envelope, or NULL when it is not in the stack. */
static inline const ebpo_polytope *ebpo_envelope_held(const ebpo_envelope_stack *stack,
                                                      ebpo_octcode octcode)
{
    int level = ebpo_octcode_level(octcode);
    return stack->octcode[level] == octcode ? &stack->at[level] : NULL;
}

/* Puts the envelope of a node whose parent's is held (the root's: the cube), in coordinates of its
 * cell: its parent's part in the cell, cut by its own planes. Lent until another node of its level
 * is put. */
const ebpo_polytope *ebpo_envelope_put(ebpo_envelope_stack *stack, ebpo_octcode octcode,
                                       const uint32_t *codes, uint64_t count);

/* A black node's: its cell. */
const ebpo_polytope *ebpo_envelope_put_cube(ebpo_envelope_stack *stack, ebpo_octcode octcode);

#endif
