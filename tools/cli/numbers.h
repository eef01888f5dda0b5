/* Converts numbers and text exactly: reads as strtod does, prints the fewest digits that read back
 * as the same double. All threads may call these functions; the program never leaves the "C"
 * locale. */
#ifndef EBPO_TOOLS_NUMBERS_H
#define EBPO_TOOLS_NUMBERS_H

#include <stdbool.h>
#include <stdint.h>

/* Size of the output of the functions below, which has no zero byte at its end. */
enum { NUMBER_CAPACITY = 32 };

/* Reads the number at `text`. A character that cannot be part of a number, such as a zero byte,
 * must follow the number. *after: the end of the number, or `text` when there is none. `end`: the
 * end of the text of the line; no number may continue beyond it. */
double number_read(const char *text, const char *end, const char **after);

/* Returns the beginning of the text of a file, after a byte order mark, if any. */
const char *number_skip_mark(const char *text);

/* Returns the end of the output, which is the same as by printf's %.17g; not finite: inf, -inf,
 * nan, -nan. */
char *number_write(char *out, double v);
char *number_write_uint(char *out, uint64_t v);
char *number_write_int(char *out, int64_t v);

#ifdef __cplusplus
extern "C" {
#endif
/* Functions that use the C++ library, when it has <charconv> (EBPO_HAVE_CHARCONV).
 * number_charconv_read returns false for text that only strtod can read. number_charconv_digits
 * writes the layout of printf's %e with the fewest digits, and returns the end of the text. */
bool number_charconv_read(const char *text, const char *end, const char **after, double *out);
char *number_charconv_digits(char *out, double v);
#ifdef __cplusplus
}
#endif
#endif
