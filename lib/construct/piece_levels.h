/* What a piece adds to the levels' arrays, while it is made. */
#ifndef EBPO_CONSTRUCT_PIECE_LEVELS_H
#define EBPO_CONSTRUCT_PIECE_LEVELS_H

#include <ebpo/build.h>

#include "format/schema.h"

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

#endif
