/* Parses the numbers of a block of points. */
#ifndef EBPO_TOOLS_POINTS_PARSE_H
#define EBPO_TOOLS_POINTS_PARSE_H

#include "cli/points_input.h"

/* Converts the bytes of a block to rows, and checks them. All threads may call this. */
void points_parse(const points *p, points_block *block);

#endif
