/* Reads the line of names before points in text. */
#ifndef EBPO_TOOLS_POINTS_HEADER_H
#define EBPO_TOOLS_POINTS_HEADER_H

#include "cli/points_input.h"

/* Reads the line of names if it is in the block; the block then begins after this line, and the
 * names are in `p`. On false the block holds the error. */
bool points_take_header(points *p, points_block *b);
/* Splits a line that ends at `end` with a zero byte into fields, without surrounding blanks and
 * quotes, each ended by a zero byte. Returns their number. */
int points_split(char separator, char *line, char *end, char *field[POINTS_FIELDS]);

#endif
