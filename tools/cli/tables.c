#include "cli/tables.h"

#include <float.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "cli/words.h"

void table_legend(FILE *out)
{
    fputs("gray: mixed, divided further; leaf: surface, lists its faces; white: outside;\n"
          "black: inside\n",
          out);
}

const char *table_cell(char out[TABLE_CELL], const char *format, double x)
{
    if (isfinite(x))
        snprintf(out, TABLE_CELL, format, x);
    else
        strcpy(out, "-");
    return out;
}

const char *table_volume(char out[TABLE_CELL], const char *format, double x)
{
    return isfinite(x) ? table_cell(out, format, x) : strcpy(out, "beyond 1.8e+308");
}

void table_beyond(FILE *out)
{
    fputs("-: not known, because volumes exceed the range of numbers in the file, 2.2e-308 to "
          "1.8e+308\n",
          out);
}

bool table_in_range(double x, int64_t exponent)
{
    int own_exponent;
    if (!isfinite(x) || fabs(x) < DBL_MIN) /* 0 is 0 at any scale */
        return isfinite(x);
    frexp(x, &own_exponent);
    return own_exponent + exponent > -1021 && own_exponent + exponent <= 1024;
}

const char *table_scaled(char out[TABLE_CELL], int digits, double x, int64_t exponent)
{
    char mantissa[32];
    int own_exponent;
    if (table_in_range(x, exponent)) {
        snprintf(out, TABLE_CELL, "%.*g", digits, ldexp(x, (int)exponent));
        return out;
    }
    if (!isfinite(x))
        return strcpy(out, "-");
    double part = frexp(x, &own_exponent), log10_2 = 0.30102999566398119521;
    double power = log10(fabs(part)) + (double)(own_exponent + exponent) * log10_2,
           whole = floor(power);
    /* `power` has about 13 exact digits, of which up to four are before the decimal point. So nine
     * digits of the mantissa are exact. */
    digits = digits < 9 ? digits : 9;
    snprintf(mantissa, sizeof mantissa, "%.*f", digits - 1, copysign(pow(10, power - whole), x));
    if (fabs(strtod(mantissa, NULL)) >= 10) { /* 9.9999... was rounded */
        snprintf(mantissa, sizeof mantissa, "%.*f", digits - 1, copysign(1, x));
        whole += 1;
    }
    size_t length = strlen(mantissa); /* no trailing zeros, as with %g */
    while (length > 1 && digits > 1 && mantissa[length - 1] == '0')
        mantissa[--length] = 0;
    if (mantissa[length - 1] == '.')
        mantissa[--length] = 0;
    snprintf(out, TABLE_CELL, "%se%+.0f", mantissa, whole);
    return out;
}

void table_json(json *j, const char *key, double x, int64_t exponent)
{
    char cell[TABLE_CELL];
    if (table_in_range(x, exponent))
        json_real(j, key, ldexp(x, (int)exponent));
    else
        json_text(j, key, table_scaled(cell, 9, x, exponent));
}

const char *table_unit(char out[TABLE_CELL], const char *unit, int power)
{
    out[0] = 0;
    if (unit[0] && power == 1)
        snprintf(out, TABLE_CELL, " %.30s", unit);
    else if (unit[0])
        snprintf(out, TABLE_CELL, " %.30s^%d", unit, power);
    return out;
}
