#include "core/strict_fp.h"

#include "geometry/envelope_stack.h"

#include "geometry/plane_clip.h"

const ebpo_polytope *ebpo_envelope_put(ebpo_envelope_stack *stack, ebpo_octcode octcode,
                                       const uint32_t *codes, uint64_t count)
{
    int level = ebpo_octcode_level(octcode);
    ebpo_polytope *envelope = &stack->at[level];
    if (level)
        (void)ebpo_polytope_child(&stack->at[level - 1], octcode & 7, envelope);
    else
        ebpo_polytope_cube(envelope);
    ebpo_planes_cut(envelope, codes, count);
    stack->octcode[level] = octcode;
    return envelope;
}

const ebpo_polytope *ebpo_envelope_put_cube(ebpo_envelope_stack *stack, ebpo_octcode octcode)
{
    int level = ebpo_octcode_level(octcode);
    ebpo_polytope_cube(&stack->at[level]);
    stack->octcode[level] = octcode;
    return &stack->at[level];
}
