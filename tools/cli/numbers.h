/* Converts text to numbers and numbers to text, exactly: reads as strtod does, and prints the
 * fewest digits that read back as the same double. All threads may call these functions; the
 * program always has the "C" locale. */
#ifndef EBPO_TOOLS_NUMBERS_H
#define EBPO_TOOLS_NUMBERS_H

#include <stdbool.h>
#include <stdint.h>

/* Maximum size in bytes of the output of the functions number_write... The output has no zero byte
 * at the end. */
enum { NUMBER_CAPACITY = 32 };

/* Returns the number at `text`. A character that cannot be part of a number, such as a zero byte,
 * must follow the number. *after: the end of the number; if it equals `text`, there is no number.
 * `end`: the end of the line, which must also end the number. */
double number_read(const char *text, const char *end, const char **after);

/* Returns the beginning of the text of a file, after a byte order mark, if any. */
const char *number_skip_mark(const char *text);

/* Each function writes a number at `out`, and returns the end of the output. A double that is not
 * finite is written as inf, -inf, nan or -nan. An exponent is written if printf's %.17g would write
 * an exponent. */
char *number_write(char *out, double v);
char *number_write_uint(char *out, uint64_t v);
char *number_write_int(char *out, int64_t v);

#ifdef __cplusplus
extern "C" {
#endif
/* Functions of numbers_charconv.cpp, if the C++ library has <charconv> (EBPO_HAVE_CHARCONV).
 * number_charconv_read returns false for text that only strtod can read. number_charconv_digits
 * writes the layout of printf's %e with the fewest digits, and returns the end of the text. */
bool number_charconv_read(const char *text, const char *end, const char **after, double *out);
char *number_charconv_digits(char *out, double v);
#ifdef __cplusplus
}
#endif
#endif
