// Conversions of the C++ library: correctly rounded, the fewest digits, no locale, several times as
// fast as strtod and printf.
#include "cli/numbers.h"

#include <charconv>

bool number_charconv_read(const char *text, const char *end, const char **after, double *out)
{
    std::from_chars_result r = std::from_chars(text, end, *out);
    *after = r.ptr;
    return r.ec == std::errc();
}

char *number_charconv_digits(char *out, double v)
{
    return std::to_chars(out, out + NUMBER_CAPACITY, v, std::chars_format::scientific).ptr;
}
