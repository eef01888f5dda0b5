/* Reads a block as kernels do, into [axis][corner][lane]. Returns a bit for each lane with a face.
 */
#ifndef EBPO_TESTS_READ_BLOCKS_H
#define EBPO_TESTS_READ_BLOCKS_H

#include "query/accel.h"

unsigned read_block_base(const ebpo_accel *s, uint32_t block, double out[3][3][EBPO_BLOCK]);
unsigned read_block_avx2(const ebpo_accel *s, uint32_t block, double out[3][3][EBPO_BLOCK]);

#endif
