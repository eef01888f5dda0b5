/* Compares conversions of decimal text to float and double with the C library, which rounds
 * correctly. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "check_main.h"
#include "geometry/decimal.h"

static uint64_t next(uint64_t *state)
{
    *state ^= *state << 13;
    *state ^= *state >> 7;
    *state ^= *state << 17;
    return *state;
}

static void compare(const char *s, locale_t c)
{
    float f = 1, expected_f = strtof(s, NULL);
    double d = 1, expected_d = strtod(s, NULL);
    ck_assert_msg(ebpo_number_float(&f, s, strlen(s), c) && ebpo_number_double(&d, s, strlen(s), c),
                  "%s refused", s);
    ck_assert_msg(memcmp(&f, &expected_f, sizeof f) == 0, "%s as float: %a instead of %a", s,
                  (double)f, (double)expected_f);
    ck_assert_msg(memcmp(&d, &expected_d, sizeof d) == 0, "%s as double: %a instead of %a", s, d,
                  expected_d);
}

/* Generates any number of digits, exponent and position of the point. */
static void random_decimal(char *out, uint64_t *state)
{
    int digits = 1 + (int)(next(state) % 24), point = (int)(next(state) % (uint64_t)(digits + 1));
    if (next(state) % 2)
        *out++ = '-';
    for (int i = 0; i < digits; i++) {
        if (i == point)
            *out++ = '.';
        *out++ = (char)('0' + next(state) % 10);
    }
    *out = 0;
    if (next(state) % 3 == 0)
        sprintf(out, "e%d", (int)(next(state) % 90) - 50);
}

START_TEST(test_random_decimals_round_like_c_library)
{
    locale_t c = newlocale(LC_ALL_MASK, "C", (locale_t)0);
    uint64_t state = 88172645463325252u + (uint64_t)_i;
    char s[80];
    for (int i = 0; i < 60000; i++) {
        random_decimal(s, &state);
        compare(s, c);
    }
    freelocale(c);
}
END_TEST

/* Tests midpoints of neighbouring floats, and numbers slightly above and below, where rounding
 * twice fails. */
START_TEST(test_float_midpoints_are_rounded_once)
{
    locale_t c = newlocale(LC_ALL_MASK, "C", (locale_t)0);
    uint64_t state = 12345;
    char s[200];
    for (int i = 0; i < 10000; i++) {
        uint32_t bits = (uint32_t)(0x30000000 + next(&state) % 0x20000000);
        float a;
        memcpy(&a, &bits, sizeof a);
        double middle = ((double)a + (double)nextafterf(a, INFINITY)) / 2;
        for (int digits = 9; digits <= 40; digits += i % 7 + 1) {
            snprintf(s, sizeof s, "%.*e", digits, middle);
            compare(s, c);
            snprintf(s, sizeof s, "%.*f", digits % 25, middle);
            compare(s, c);
        }
        snprintf(s, sizeof s, "%.60f", middle);
        compare(s, c);
        strcat(s, "000000000000000000001");
        compare(s, c);
    }
    freelocale(c);
}
END_TEST

/* Returns true when printing with as many digits after the point gives the same text, as the
 * declaration requires. */
static bool prints_again(const char *s, float value)
{
    char text[400];
    const char *point = strchr(s, '.');
    snprintf(text, sizeof text, "%.*f", point ? (int)strlen(point + 1) : 0, (double)value);
    return strcmp(text, s) == 0;
}

static void check_kept(const char *s, locale_t c)
{
    float f;
    bool kept;
    ck_assert(ebpo_number_float_kept(&f, &kept, s, strlen(s), c));
    ck_assert_msg(kept == prints_again(s, f), "%s as float %.9g: %s", s, (double)f,
                  kept ? "kept" : "not kept");
}

START_TEST(test_decimal_digits_survive_printing)
{
    locale_t c = newlocale(LC_ALL_MASK, "C", (locale_t)0);
    uint64_t state = 88172645463325252u + (uint64_t)_i;
    char s[400];
    for (int i = 0; i < 10000; i++) {
        int digits = 1 + (int)(next(&state) % 10), decimals = (int)(next(&state) % 12);
        char *at = s + sprintf(s, "%s%llu", next(&state) % 2 ? "-" : "",
                               (unsigned long long)(next(&state) % 9000000000u) /
                                   (unsigned long long)pow(10, digits));
        at += sprintf(at, decimals ? "." : "");
        for (int k = 0; k < decimals; k++)
            *at++ = (char)('0' + next(&state) % 10);
        *at = 0;
        check_kept(s, c);
        /* with enough digits, as programs print floats, and with too many */
        float f = strtof(s, NULL);
        for (int k = 5; k < 40; k += 1 + (int)(next(&state) % 5)) {
            snprintf(s, sizeof s, "%.*f", k, (double)f);
            check_kept(s, c);
        }
    }
    /* floats of this size are multiples of a quarter, so that two texts give one float; ties go to
     * even */
    check_kept("2097152.2", c);
    check_kept("2097152.3", c);
    freelocale(c);
}
END_TEST

/* Cases not covered by printing with a point: exponents, signs, zeros, ends of the range. */
START_TEST(test_exponent_digits_are_kept_or_rejected)
{
    static const struct {
        const char *text;
        bool kept;
    } cases[] = { { "1.5e3", true },
                  { "+1.5E+03", true },
                  { "007.50", true },
                  { "-0.000", true },
                  { "0e-500", true },
                  { "1.00000e10", true },
                  { "1.0000001e10", true },
                  { "1.00000005e10", false },
                  { "1.2345678e8", true },
                  { "1.23456789e8", false },
                  { "123456789e-3", true },
                  { "123456787e-3", false },
                  { "1000000000000e-15", false },
                  { "1e-45", true },
                  { "1.0e-44", true },
                  { "1.2e-45", false },
                  { "1.17549435e-38", true },
                  { "1e-60", false },
                  { "3.4028235e38", true },
                  { "3.40282347e+38", true },
                  { "3.402823466385288598117e38", true },
                  { "3.402823466385288598118e38", false },
                  { "340282346638528859811704183484516925440", true },
                  { "1e39", false },
                  { "1e400", true },
                  { "nan", true },
                  { "-inf", true },
                  { "16777216", true },
                  { "16777217", false },
                  { "16777217.0000000001", false },
                  { "0.100000001490116119384765625", true },
                  { "0.100000001490116119384765626", false },
                  { "0.1000000014901161193847656250000000000000000000000000000", true },
                  { "8388607.5", true },
                  { "9999999.5", false },
                  { "99999999.9", false } };
    locale_t c = newlocale(LC_ALL_MASK, "C", (locale_t)0);
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        const char *s = cases[i].text;
        float f;
        bool kept;
        ck_assert(ebpo_number_float_kept(&f, &kept, s, strlen(s), c));
        ck_assert_msg(kept == cases[i].kept, "%s", s);
    }
    freelocale(c);
}
END_TEST

START_TEST(test_numbers_at_range_limits_are_read)
{
    static const char *const cases[] = { "0",
                                         "-0",
                                         "0.0",
                                         "-0.000",
                                         "1e400",
                                         "-1e400",
                                         "1e-400",
                                         "1.17549435e-38",
                                         "1e-45",
                                         "7.0e-46",
                                         "3.4028235e38",
                                         "3.4028236e38",
                                         "2.2250738585072011e-308",
                                         "4.9e-324",
                                         "2.4e-324",
                                         "1.7976931348623159e308",
                                         "9007199254740993",
                                         "18446744073709551615",
                                         "0.000000000000000000000000000000000000000000000001",
                                         "1.",
                                         ".5",
                                         "+1",
                                         "1E+2",
                                         "00000000000000000000000000000001.5",
                                         "0e99999999999",
                                         "1e-99999999999",
                                         "9999999999999999999",
                                         "99999999999999999999" };
    locale_t c = newlocale(LC_ALL_MASK, "C", (locale_t)0);
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++)
        compare(cases[i], c);
    freelocale(c);
}
END_TEST

static const struct {
    const char *text, *standard;
} foreign[] = {
    { "3.1+e2", "3.1e2" },
    { "-3.1-E02", "-3.1e-02" },
    { "1234567890123456789012+e-1", NULL },
    { "12345678901234567890123456789-e20", "12345678901234567890123456789e-20" },
    { "1+e2", "1e2" },
    { ".5+e300", ".5e300" },
    { "+e2", NULL },
    { "1+e", NULL },
    { "1+e+2", NULL },
    { "1+2", NULL },
    { "1++e2", NULL },
    { "1.#INF", "inf" },
    { "-1.#inf00", "-inf" },
    { "+1.#IND", "nan" },
    { "1.#QNAN0", "nan" },
    { "1.#SNAN", "nan" },
    { "-nan(ind)", "nan" },
    { "NaN(snan)", "nan" },
    { "1.#", NULL },
    { "1.#INF1", NULL },
    { "1.#INDEX", NULL },
    { "2.#INF", NULL },
    { "nan()", NULL },
    { "nan(ind)0", NULL },
};

START_TEST(test_foreign_number_formats_are_read)
{
    locale_t c = newlocale(LC_ALL_MASK, "C", (locale_t)0);
    const char *s = foreign[_i].text, *standard = foreign[_i].standard;
    float f = 1;
    double d = 1;
    bool read_f = ebpo_number_float(&f, s, strlen(s), c),
         read_d = ebpo_number_double(&d, s, strlen(s), c);
    ck_assert_msg(read_f == (standard != NULL) && read_d == read_f, "%s", s);
    if (standard && strcmp(standard, "nan") == 0)
        ck_assert_msg(isnan(f) && isnan(d), "%s", s);
    else if (standard)
        ck_assert_msg(f == strtof(standard, NULL) && d == strtod(standard, NULL), "%s", s);
    freelocale(c);
}
END_TEST

START_TEST(test_malformed_numbers_are_refused)
{
    static const char *const cases[] = { "",     "-",     "+",   ".",    "e5",   "1e",
                                         "1e+",  "1.2.3", "1,5", "0x10", "1f",   "--1",
                                         "nanx", "in",    "1 ",  " 1",   "1e5.0" };
    locale_t c = newlocale(LC_ALL_MASK, "C", (locale_t)0);
    float f;
    double d;
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++)
        ck_assert_msg(!ebpo_number_float(&f, cases[i], strlen(cases[i]), c) &&
                          !ebpo_number_double(&d, cases[i], strlen(cases[i]), c),
                      "%s", cases[i]);
    char *many = malloc(EBPO_NUMBER_LONGEST + 1);
    memset(many, '7', EBPO_NUMBER_LONGEST + 1);
    ck_assert(ebpo_number_double(&d, many, EBPO_NUMBER_LONGEST, c) && isinf(d));
    ck_assert(!ebpo_number_double(&d, many, EBPO_NUMBER_LONGEST + 1, c));
    free(many);
    freelocale(c);
}
END_TEST

START_TEST(test_integers_are_read_completely_or_refused)
{
    int64_t value;
    ck_assert(ebpo_number_integer(&value, "-12", 3) && value == -12);
    ck_assert(ebpo_number_integer(&value, "+7", 2) && value == 7);
    ck_assert(ebpo_number_integer(&value, "999999999999999999", 18) && value == 999999999999999999);
    ck_assert(!ebpo_number_integer(&value, "9999999999999999999", 19));
    ck_assert(!ebpo_number_integer(&value, "1.", 2) && !ebpo_number_integer(&value, "", 0) &&
              !ebpo_number_integer(&value, "-", 1));
}
END_TEST

TEST_SUITE(number)
{
    TCase *tests = tcase_create("number");
    tcase_set_timeout(tests, 120);
    tcase_add_loop_test(tests, test_random_decimals_round_like_c_library, 0, 3);
    tcase_add_test(tests, test_float_midpoints_are_rounded_once);
    tcase_add_loop_test(tests, test_decimal_digits_survive_printing, 0, 3);
    tcase_add_test(tests, test_exponent_digits_are_kept_or_rejected);
    tcase_add_test(tests, test_numbers_at_range_limits_are_read);
    tcase_add_loop_test(tests, test_foreign_number_formats_are_read, 0,
                        (int)(sizeof foreign / sizeof *foreign));
    tcase_add_test(tests, test_malformed_numbers_are_refused);
    tcase_add_test(tests, test_integers_are_read_completely_or_refused);
    Suite *suite = suite_create("number");
    suite_add_tcase(suite, tests);
    return suite;
}
