/* Compiles lib/query/face_block.h for any processor, or for processors with AVX2. READ_BLOCK is
 * the name of the function. */
#include "query/face_block.h"
#include "read_blocks.h"

unsigned READ_BLOCK(const ebpo_accel *s, uint32_t block, double out[3][3][EBPO_BLOCK])
{
    ebpo_face_block b = ebpo_face_block_open(s, block);
    for (int k = 0; k < 3; k++) {
        f8 corner[3];
        if (s->wide)
            ebpo_face_block_doubles(&b, k, out[k]);
        else
            ebpo_face_block_floats(&b, k, corner);
        for (int i = 0; i < 3 && !s->wide; i++) {
            float x[EBPO_BLOCK];
            f8_store(x, corner[i]);
            for (int lane = 0; lane < EBPO_BLOCK; lane++)
                out[k][i][lane] = (double)x[lane];
        }
    }
    return ebpo_face_block_lanes(&b);
}
