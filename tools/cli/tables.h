/* Helpers of printed tables: words for types of nodes, empty cells, and numbers beyond the range of
 * a double. */
#ifndef EBPO_TOOLS_TABLES_H
#define EBPO_TOOLS_TABLES_H

#include <stdbool.h>
#include <stdint.h>
#include <stdio.h>

#include "cli/json.h"

enum { TABLE_CELL = 40 };

/* Prints the meaning of gray, leaf, white and black, below a table that counts them. */
void table_legend(FILE *out);

/* Prints x by the printf `format` with one conversion of a double; "-" when x is not finite. */
const char *table_cell(char out[TABLE_CELL], const char *format, double x);

/* Same as table_cell, but if x is not finite, returns words that can follow "volume". */
const char *table_volume(char out[TABLE_CELL], const char *format, double x);

/* Prints the meaning of "-" in columns of volumes, below a table that has such cells. */
void table_beyond(FILE *out);

/* Writes x * 2^exponent with `digits` significant digits, 1 to 17, as %g does. A number beyond the
 * range of a double, such as 4.2e+901, has at most 9 digits. */
const char *table_scaled(char out[TABLE_CELL], int digits, double x, int64_t exponent);

/* Writes x * 2^exponent as a JSON number. Beyond the range of a double, writes the text of
 * table_scaled as a string. */
void table_json(json *j, const char *key, double x, int64_t exponent);

/* Returns true if x * 2^exponent is in the range of normal doubles, or 0. */
bool table_in_range(double x, int64_t exponent);

/* Writes " mm^3" for the unit mm and the power 3; "" without a unit. */
const char *table_unit(char out[TABLE_CELL], const char *unit, int power);

#endif
