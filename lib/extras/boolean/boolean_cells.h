/* In-cells and mixed cells of a result. */
#ifndef EBPO_BOOLEAN_BOOLEAN_CELLS_H
#define EBPO_BOOLEAN_BOOLEAN_CELLS_H

#include "extras/boolean/world_cell.h"
#include "geometry/octcode.h"

/* An in-cell, as octcodes of the finest level. */
typedef struct ebpo_in_run {
    ebpo_octcode first;
    uint64_t count;
} ebpo_in_run;

struct ebpo_boolean_cells {
    ebpo_world world;
    ebpo_in_run *in; /* ascending */
    uint64_t in_count, in_capacity;
    ebpo_octcode *mixed; /* of the finest level, ascending */
    uint64_t mixed_count, mixed_capacity;
    uint64_t ways[EBPO_CUBE_WAYS];
};

#endif
