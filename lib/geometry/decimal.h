/* Converts decimal text to float and double, correctly rounded in any locale. */
#ifndef EBPO_GEOMETRY_DECIMAL_H
#define EBPO_GEOMETRY_DECIMAL_H

#include <ebpo/base.h>
#include <locale.h>

/* Converts s[0 .. n), which must be exactly one number: [+-] digits [. digits] [e [+-] digits], or
 * nan, inf, infinity in upper or lower case. Also accepts 3.1+e2 and the words of Microsoft's C
 * library: 1.#INF, 1.#IND, 1.#QNAN, 1.#SNAN, each with any number of zeros after it, nan(ind) and
 * nan(snan). Hexadecimal numbers are rejected. The result is the nearest double, ties to even.
 * Numbers beyond the range of doubles give an infinite result. Returns false for other text, and
 * for text longer than EBPO_NUMBER_LONGEST bytes. `c_locale`: from newlocale(LC_ALL_MASK, "C", 0);
 * used for the few numbers that the fast exact methods cannot convert. */
bool ebpo_number_double(double *out, const char *s, size_t n, locale_t c_locale);
enum { EBPO_NUMBER_LONGEST = 1200 };

/* Same as ebpo_number_double for a float. *kept is true if the float, rounded to the text's last
 * digit (ties to even), gives the text. It is also true for nan and inf, and for numbers beyond the
 * range of doubles. */
bool ebpo_number_float_kept(float *out, bool *kept, const char *s, size_t n, locale_t c_locale);

static inline bool ebpo_number_float(float *out, const char *s, size_t n, locale_t c_locale)
{
    bool kept;
    return ebpo_number_float_kept(out, &kept, s, n, c_locale);
}

/* Converts an integer: [+-] and at most 18 digits. Returns false for other text. */
bool ebpo_number_integer(int64_t *out, const char *s, size_t n);

#endif
