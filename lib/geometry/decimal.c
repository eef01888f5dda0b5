/* Converts decimal text to the nearest float or double. There are three methods. Each method is
 * exact for the numbers that it accepts. The fastest method is tried first:
 * 1. Digits below 2^53, multiplied or divided by a power of ten up to 10^22. Both numbers are
 *   doubles, so one operation rounds once (Clinger, "How to read floating point numbers
 *   accurately", 1990). The float is this double, rounded again. Exception: if the double is
 * exactly between two floats, rounding twice may give the wrong float, so method 1 does not apply.
 * 2. Up to 19 digits, divided by a power of ten up to 10^27: a 128-bit quotient with its remainder,
 *   rounded by this code.
 * 3. The C library. */
#include "core/strict_fp.h"

#include "geometry/decimal.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <strings.h>

typedef struct decimal {
    uint64_t digits;
    int32_t exponent; /* value = digits * 10^exponent */
    bool negative;
    bool short_form; /* at most 19 digits; false: `digits` lacks the digits after the 19th */
} decimal;

static const double tens[] = { 1e0,  1e1,  1e2,  1e3,  1e4,  1e5,  1e6,  1e7,
                               1e8,  1e9,  1e10, 1e11, 1e12, 1e13, 1e14, 1e15,
                               1e16, 1e17, 1e18, 1e19, 1e20, 1e21, 1e22 };

static bool is_digit(char c) { return c >= '0' && c <= '9'; }

static bool is_sign(char c) { return c == '+' || c == '-'; }

/* Adds the exponent in [s, end), digits without a sign, to d->exponent. If `negative` is true,
 * subtracts the exponent instead. Returns false if the text has other characters. */
static bool scan_exponent_of(decimal *d, bool negative, const char *s, const char *end)
{
    int32_t e = 0;
    for (; s < end && is_digit(*s); s++)
        e = e < 100000 ? e * 10 + (*s - '0') : e;
    d->exponent += negative ? -e : e;
    return s == end;
}

static bool scan_exponent(decimal *d, const char *s, const char *end)
{
    bool negative = s < end && *s == '-';
    if (s < end && is_sign(*s))
        s++;
    return s < end && scan_exponent_of(d, negative, s, end);
}

/* Parses digits, decimal point and exponent. Returns false for other text. */
static bool scan_number(decimal *d, const char *s, const char *end)
{
    *d = (decimal){ .short_form = true };
    d->negative = s < end && *s == '-';
    if (s < end && (*s == '-' || *s == '+'))
        s++;
    bool point = false;
    int significant = 0;
    size_t digit_count = 0;
    for (; s < end && (is_digit(*s) || (*s == '.' && !point)); s++) {
        if (*s == '.') {
            point = true;
            continue;
        }
        digit_count++;
        d->exponent -= point;
        if (significant == 19) {
            d->short_form = false;
            continue;
        }
        d->digits = d->digits * 10 + (uint64_t)(*s - '0');
        significant += d->digits != 0;
    }
    if (!digit_count)
        return false;
    if (s == end || *s == 'e' || *s == 'E')
        return s == end || scan_exponent(d, s + 1, end);
    /* some programs write 3.1+e2 instead of 3.1e+2 */
    return end - s > 2 && is_sign(*s) && (s[1] == 'e' || s[1] == 'E') && is_digit(s[2]) &&
           scan_exponent_of(d, *s == '-', s + 2, end);
}

/* Recognises the words that Microsoft's C library prints for infinite and undefined numbers.
 * Depending on the precision, this library adds zeros. */
static bool scan_foreign_word(double *out, const char *s, size_t n)
{
    static const struct {
        const char *word;
        bool zeros;
        double value;
    } words[] = { { "1.#inf", true, INFINITY }, { "1.#ind", true, NAN },
                  { "1.#qnan", true, NAN },     { "1.#snan", true, NAN },
                  { "nan(ind)", false, NAN },   { "nan(snan)", false, NAN } };
    for (size_t i = 0; i < sizeof words / sizeof *words; i++) {
        size_t length = strlen(words[i].word), k = length;
        if (n < length || strncasecmp(s, words[i].word, length) != 0)
            continue;
        while (k < n && words[i].zeros && s[k] == '0')
            k++;
        *out = words[i].value;
        return k == n;
    }
    return false;
}

/* Parses nan, inf and infinity with an optional sign. Returns false for other text. */
static bool scan_word(double *out, const char *s, size_t n)
{
    bool negative = n && *s == '-';
    if (n && (*s == '-' || *s == '+')) {
        s++;
        n--;
    }
    double value;
    if (n == 3 && strncasecmp(s, "nan", 3) == 0)
        value = NAN;
    else if ((n == 3 && strncasecmp(s, "inf", 3) == 0) ||
             (n == 8 && strncasecmp(s, "infinity", 8) == 0))
        value = INFINITY;
    else if (!scan_foreign_word(&value, s, n))
        return false;
    *out = negative ? -value : value;
    return true;
}

/* Converts by method 1. Returns false if this method does not apply. */
static bool one_operation(double *out, const decimal *d)
{
    if (!d->short_form || d->digits > (UINT64_C(1) << 53) || d->exponent < -22 || d->exponent > 22)
        return false;
    *out = d->exponent < 0 ? (double)d->digits / tens[-d->exponent]
                           : (double)d->digits * tens[d->exponent];
    return true;
}

#ifdef EBPO_HAVE_INT128
__extension__ typedef unsigned __int128 wide;

static uint64_t power_of_five(int exponent)
{
    uint64_t five = 1;
    for (int i = 0; i < exponent; i++)
        five *= 5;
    return five;
}

/* Converts by method 2 to a number with a mantissa of `bits` bits. The quotient q has at least 65
 * bits, so the bits of q below the last kept bit and the remainder determine the rounding. Returns
 * false if this method does not apply. */
static bool long_quotient(double *out, const decimal *d, int bits)
{
    if (!d->short_form || !d->digits || d->exponent > 0 || d->exponent < -27)
        return false;
    int e = -d->exponent;
    uint64_t five = power_of_five(e);
    int lift = __builtin_clzll(d->digits);
    wide n = (wide)(d->digits << lift) << 64;
    wide q = n / five;
    bool rest = q * five != n;
    int length = 128 - __builtin_clzll((uint64_t)(q >> 64));
    int shift = length - bits;
    uint64_t kept = (uint64_t)(q >> shift);
    wide below = q & (((wide)1 << shift) - 1), half = (wide)1 << (shift - 1);
    if (below > half || (below == half && (rest || (kept & 1))))
        kept++;
    *out = ldexp((double)kept, shift - 64 - lift - e);
    return true;
}

/* Decides exactly whether `value`, the float nearest to digits / 10^e, gives the digits again when
 * it is rounded to the last digit (ties to even). It does so if value * 10^e differs from the
 * digits by less than 0.5, or by exactly 0.5 if the digits are an even number; e = -d->exponent.
 * The value is from 1e-27 to 1e20, where floats are normal. *keeps: the result. Returns false if
 * this method does not apply. */
static bool compare_scaled(bool *keeps, float value, const decimal *d)
{
    if (!d->short_form || !d->digits || d->exponent > 0 || d->exponent < -27)
        return false;
    uint32_t bits;
    memcpy(&bits, &value, sizeof bits);
    wide scaled = ((bits & 0x7fffff) | 0x800000) * (wide)power_of_five(-d->exponent);
    int shift = (int)(bits >> 23 & 0xff) - 150 - d->exponent;
    if (shift >= 0) {
        *keeps = scaled << shift == d->digits;
        return true;
    }
    wide wanted = (wide)d->digits << -shift, half = (wide)1 << (-shift - 1);
    wide apart = scaled > wanted ? scaled - wanted : wanted - scaled;
    *keeps = apart < half || (apart == half && d->digits % 2 == 0);
    return true;
}

#else
/* Without integers of 128 bits, these methods never apply, and the callers use slower methods. */
static bool long_quotient(double *out, const decimal *d, int bits)
{
    (void)out, (void)d, (void)bits;
    return false;
}

static bool compare_scaled(bool *keeps, float value, const decimal *d)
{
    (void)keeps, (void)value, (void)d;
    return false;
}
#endif

/* Returns true if the value is exactly between two floats: of the 29 bits that a float lacks, only
 * the first is set. */
static bool is_float_tie(double value)
{
    uint64_t bits;
    memcpy(&bits, &value, sizeof bits);
    return (bits & UINT64_C(0x1fffffff)) == UINT64_C(0x10000000);
}

static void copy_token(char buffer[EBPO_NUMBER_LONGEST + 1], const char *s, size_t n)
{
    memcpy(buffer, s, n);
    buffer[n] = 0;
    char *e = strpbrk(buffer, "eE");
    if (e && e - buffer >= 2 && is_sign(e[-1])) { /* 3.1+e2 */
        char sign = e[-1];
        e[-1] = *e;
        *e = sign;
    }
}

/* Converts by methods 2 and 3. */
static float nearest_float(const decimal *d, const char *s, size_t n, locale_t c_locale)
{
    double value;
    if (long_quotient(&value, d, 24))
        return (float)(d->negative ? -value : value);
    char buffer[EBPO_NUMBER_LONGEST + 1];
    copy_token(buffer, s, n);
    return strtof_l(buffer, NULL, c_locale);
}

/* Prints the value with `count` digits. Returns true if the printed digits are `digits`, and the
 * first digit has the power of ten `first`. */
static bool prints_digits(float value, const char *digits, size_t count, int32_t first)
{
    char printed[EBPO_NUMBER_LONGEST + 16];
    snprintf(printed, sizeof printed, "%.*e", (int)count - 1, (double)fabsf(value));
    const char *exponent = strrchr(printed, 'e');
    if (printed[0] != digits[0] || !exponent || strtol(exponent + 1, NULL, 10) != first)
        return false;
    /* the decimal point may have several bytes, depending on the locale */
    return count == 1 || memcmp(exponent - (count - 1), digits + 1, count - 1) == 0;
}

/* Decides by printing whether the float, rounded to the text's last digit, gives the text. If the
 * text is a power of ten, such as 1000, the float may be less, such as 999.7. Such a float has one
 * digit fewer before the decimal point, so it is also printed with one digit fewer. */
static bool prints_as(float value, const decimal *d, const char *s, size_t n)
{
    char digits[EBPO_NUMBER_LONGEST];
    size_t count = 0, i = s[0] == '-' || s[0] == '+';
    bool power = true;
    for (; i < n && (is_digit(s[i]) || s[i] == '.'); i++) {
        if (s[i] == '.' || (s[i] == '0' && !count))
            continue;
        power &= s[i] == (count ? '0' : '1');
        digits[count++] = s[i];
    }
    int32_t first = d->exponent + (int32_t)count - 1;
    return count == 0 || prints_digits(value, digits, count, first) ||
           (power && count > 1 && prints_digits(value, digits, count - 1, first));
}

/* Returns true if arithmetic in doubles shows that the float nearest to digits * 10^exponent keeps
 * the digits, because it differs from the number by less than half of 10^exponent. This is always
 * true for digits below 2^23: then 10^exponent is greater than the distance between neighbouring
 * floats. For digits below 2^40 the double `nearest` is accurate enough for this test: its error is
 * at most 2^-12 of half of 10^exponent. */
static inline bool surely_keeps(double nearest, float value, const decimal *d)
{
    return d->digits < UINT64_C(1) << 23 ||
           (d->digits < UINT64_C(1) << 40 &&
            2 * (double)d->digits * fabs(nearest - (double)value) < 0.999 * nearest);
}

/* Decides exactly whether a float keeps the text's digits. */
static bool keeps_digits(float value, const decimal *d, const char *s, size_t n, locale_t c_locale)
{
    bool keeps;
    double wide_value;
    if (isinf(value)) /* the number is too large for a float, but perhaps not for a double */
        return ebpo_number_double(&wide_value, s, n, c_locale) && isinf(wide_value);
    return compare_scaled(&keeps, value, d) ? keeps : prints_as(value, d, s, n);
}

bool ebpo_number_float_kept(float *out, bool *kept, const char *s, size_t n, locale_t c_locale)
{
    decimal d;
    double value;
    *kept = true;
    if (n > EBPO_NUMBER_LONGEST)
        return false;
    if (!scan_number(&d, s, s + n)) {
        bool word = scan_word(&value, s, n);
        *out = word ? (float)value : 0;
        return word;
    }
    /* Both fast methods stay between 1e-27 and 1e38, where floats have all their bits. */
    if (one_operation(&value, &d) && !is_float_tie(value)) {
        float nearest = (float)value;
        *out = d.negative ? -nearest : nearest;
        if (surely_keeps(value, nearest, &d))
            return true;
    } else {
        *out = nearest_float(&d, s, n, c_locale);
    }
    *kept = keeps_digits(*out, &d, s, n, c_locale);
    return true;
}

bool ebpo_number_double(double *out, const char *s, size_t n, locale_t c_locale)
{
    decimal d;
    double value;
    if (n > EBPO_NUMBER_LONGEST)
        return false;
    if (!scan_number(&d, s, s + n))
        return scan_word(out, s, n);
    if (one_operation(&value, &d) || long_quotient(&value, &d, 53)) {
        *out = d.negative ? -value : value;
        return true;
    }
    char buffer[EBPO_NUMBER_LONGEST + 1];
    copy_token(buffer, s, n);
    *out = strtod_l(buffer, NULL, c_locale);
    return true;
}

bool ebpo_number_integer(int64_t *out, const char *s, size_t n)
{
    bool negative = n && *s == '-';
    if (n && (*s == '-' || *s == '+')) {
        s++;
        n--;
    }
    if (n == 0 || n > 18)
        return false;
    int64_t value = 0;
    for (size_t i = 0; i < n; i++) {
        if (!is_digit(s[i]))
            return false;
        value = value * 10 + (s[i] - '0');
    }
    *out = negative ? -value : value;
    return true;
}
