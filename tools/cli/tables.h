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

/* As table_cell; but when x is not finite, returns words that can follow "volume". */
const char *table_volume(char out[TABLE_CELL], const char *format, double x);

/* Prints the meaning of "-" in columns of volumes, below a table that has some. */
void table_beyond(FILE *out);

/* Writes x * 2^exponent with `digits` significant digits, 1 to 17, as %g does; beyond the range of
 * a double with at most 9, such as 4.2e+901. */
const char *table_scaled(char out[TABLE_CELL], int digits, double x, int64_t exponent);

/* Writes x * 2^exponent as a number; beyond the range of a double as the same text. */
void table_json(json *j, const char *key, double x, int64_t exponent);

/* Returns true if a double holds x * 2^exponent, neither infinite nor rounded to 0 or near it. */
bool table_in_range(double x, int64_t exponent);

/* Returns "mm^3" with a blank before it; "" without a unit. */
const char *table_unit(char out[TABLE_CELL], const char *unit, int power);

#endif
