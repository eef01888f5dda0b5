#include "core/strict_fp.h"

#include "extras/collide/face_slots.h"

#include "core/alloc.h"

uint32_t *ebpo_face_slots(const ebpo_accel *subtree)
{
    uint32_t *slot = ebpo_alloc(subtree->face_count, sizeof *slot);
    if (!slot)
        return NULL;
    for (uint32_t n = 0; n < subtree->bound_count; n++)
        for (unsigned i = 0; i < subtree->bound[n].count; i++) {
            uint32_t block = subtree->bound[n].child[i];
            if (block == EBPO_NO_CHILD || !(block & EBPO_IS_BLOCK))
                continue;
            block &= ~EBPO_IS_BLOCK;
            const ebpo_meshlet *m = ebpo_accel_meshlet(subtree, block);
            for (uint32_t lane = 0; lane < m->faces; lane++)
                slot[m->face + lane] = block * EBPO_BLOCK + lane;
        }
    return slot;
}
