/* Colours of a level's nodes. */
#ifndef EBPO_LEVELS_LOD_COLOURS_H
#define EBPO_LEVELS_LOD_COLOURS_H

#include <ebpo/lod.h>

#include "levels/lod_model.h"

void ebpo_lod_add_colours(ebpo_lod_nodes *nodes, const ebpo_lod_model *model);

#endif
