/* Numbers in text, exact both ways: read as strtod reads them, printed with the fewest digits that
 * read back as the same double. Any thread; the program never leaves the "C" locale. */
#ifndef EBPO_TOOLS_NUMBERS_H
#define EBPO_TOOLS_NUMBERS_H

#include <stdbool.h>
#include <stdint.h>

/* Room for what the functions below print, which ends without a zero byte. */
enum { NUMBER_ROOM = 32 };

/* The number at `text`, which is followed by something that no number goes on with, a zero byte at
 * last: *after it, or `text` where there is none. Never before `end`, which is where the line's
 * text ends. */
double number_read(const char *text, const char *end, const char **after);

/* Returns where a file's text begins: behind a mark of the order of bytes, if there is one. */
const char *number_skip_mark(const char *text);

/* Where it ends. The layout is that of printf's %.17g; not finite: inf, -inf, nan, -nan. */
char *number_write(char *out, double v);
char *number_write_uint(char *out, uint64_t v);
char *number_write_int(char *out, int64_t v);

#ifdef __cplusplus
extern "C" {
#endif
/* The two halves that the C++ library does, where it is there (EBPO_HAVE_CHARCONV).
 * False: strtod shall decide. Digits: as printf's %e, but as few as will do; where they end. */
bool number_charconv_read(const char *text, const char *end, const char **after, double *out);
char *number_charconv_digits(char *out, double v);
#ifdef __cplusplus
}
#endif
#endif
