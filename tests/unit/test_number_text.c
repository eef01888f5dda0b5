/* Compares numbers in the text of the tool with the C library. They are read equally, and are
 * printed so that reading returns the same double, in the layout of %.17g, with no more digits
 * than printf needs. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "check_main.h"
#include "cli/numbers.h"
#include "solids.h"

static uint64_t next(uint64_t *state)
{
    *state ^= *state << 13;
    *state ^= *state >> 7;
    *state ^= *state << 17;
    return *state;
}

static double from_bits(uint64_t bits)
{
    double v;
    memcpy(&v, &bits, sizeof v);
    return v;
}

static bool same(double a, double b) { return memcmp(&a, &b, sizeof a) == 0; }

static const char *written(double v)
{
    static char text[NUMBER_CAPACITY + 1];
    *number_write(text, v) = 0;
    return text;
}

/* Counts digits, without sign, point, exponent and the zeros around them. */
static size_t digits_in(const char *text)
{
    char digits[NUMBER_CAPACITY];
    size_t count = 0, first = 0;
    for (const char *c = text; *c && *c != 'e'; c++)
        if (*c >= '0' && *c <= '9')
            digits[count++] = *c;
    while (count > 1 && digits[count - 1] == '0')
        count--;
    while (first + 1 < count && digits[first] == '0')
        first++;
    return count - first;
}

static size_t digits_needed(double v)
{
    char text[NUMBER_CAPACITY];
    for (int count = 1; count < 17; count++) {
        snprintf(text, sizeof text, "%.*e", count - 1, v);
        if (same(strtod(text, NULL), v))
            return digits_in(text);
    }
    return 17;
}

static void check_written(double v)
{
    char plain[NUMBER_CAPACITY];
    const char *text = written(v);
    ck_assert_msg(same(strtod(text, NULL), v), "%a is printed as %s", v, text);
    ck_assert_msg(digits_in(text) <= digits_needed(v), "%a is printed as %s", v, text);
    snprintf(plain, sizeof plain, "%.17g", v);
    ck_assert_msg(!strchr(text, 'e') == !strchr(plain, 'e') &&
                      !strchr(text, '-') == !strchr(plain, '-') &&
                      strcspn(text, ".e") == strcspn(plain, ".e"),
                  "%s does not have the layout of %s", text, plain);
}

START_TEST(test_number_text_round_trip_is_short)
{
    static const double some[] = { 1,        0.1,
                                   0.5,      -0.125,
                                   100000,   1e15,
                                   1e16,     1e17,
                                   1e22,     1e23,
                                   1e-4,     1e-5,
                                   123456,   5e-324,
                                   1e308,    0x1p-44,
                                   0x1p1023, 0x1p-1022,
                                   1e300,    9.5e-10,
                                   1.0 / 3,  99999999999999984.0 };
    uint64_t state = 88172645463325252u;
    for (size_t i = 0; i < sizeof some / sizeof *some; i++)
        check_written(some[i]);
    for (int i = -1074; i < 1024; i++)
        check_written(ldexp(1, i));
    for (int i = 0, count = (int)ebpo_test_scaled(200000); i < count; i++) {
        double v = from_bits(next(&state));
        if (isfinite(v))
            check_written(v);
        check_written((double)(next(&state) % 100000000) / 1024);
        check_written((double)(int64_t)next(&state));
    }
    ck_assert_str_eq(written(0), "0");
    ck_assert_str_eq(written(-0.0), "-0");
    ck_assert_str_eq(written(INFINITY), "inf");
    ck_assert_str_eq(written(-INFINITY), "-inf");
    ck_assert_str_eq(written(1e-5), "1e-05");
    ck_assert_str_eq(written(123456789), "123456789");
}
END_TEST

START_TEST(test_integers_print_like_c_library)
{
    static const int64_t some[] = { 0, 1, -1, 9, 10, -10, INT64_MAX, INT64_MIN };
    for (size_t i = 0; i < sizeof some / sizeof *some; i++) {
        char text[NUMBER_CAPACITY + 1], plain[NUMBER_CAPACITY];
        *number_write_int(text, some[i]) = 0;
        snprintf(plain, sizeof plain, "%lld", (long long)some[i]);
        ck_assert_str_eq(text, plain);
        *number_write_uint(text, (uint64_t)some[i]) = 0;
        snprintf(plain, sizeof plain, "%llu", (unsigned long long)some[i]);
        ck_assert_str_eq(text, plain);
    }
}
END_TEST

/* Compares with strtod: the number and the end of the text must be equal. */
static void check_read(const char *text)
{
    char *stop;
    const char *after;
    double expected = strtod(text, &stop), v = number_read(text, text + strlen(text), &after);
    ck_assert_msg(after == stop, "'%s' ends at %ld", text, (long)(after - text));
    ck_assert_msg(same(v, expected) || (isnan(v) && isnan(expected)), "'%s' is read as %a", text,
                  v);
}

START_TEST(test_numbers_read_like_strtod)
{
    static const char *const some[] = {
        "1",
        "+5e-1",
        "+-5",
        "-+5",
        "--5",
        "+",
        "-",
        "",
        ".",
        ".5",
        "5.",
        "1e",
        "1e+",
        "1e5x",
        "1.5.5",
        "0x1p-3",
        "0x.8p0",
        "-0x1p1",
        "0x",
        "1e999",
        "-1e999",
        "1e-999",
        "4e-324",
        "2e-324",
        "1e-320",
        "nan",
        "-nan",
        "nan(12)",
        "inf",
        "-infinity",
        "infi",
        "1 2",
        "1,2",
        "1#2",
        "1\t",
        "1\r",
        "9007199254740993",
        "9007199254740992.99999999999999999999999999999999999999999999",
        "0.1e-0005",
        "00012",
        "1_000",
        "1e5,",
        "+inf",
        "+ 1",
        "-.5e+03 "
    };
    uint64_t state = 362436069362436069u;
    for (size_t i = 0; i < sizeof some / sizeof *some; i++)
        check_read(some[i]);
    for (int i = 0, count = (int)ebpo_test_scaled(200000); i < count; i++) {
        char text[64];
        double v = from_bits(next(&state));
        snprintf(text, sizeof text, "%.*g", 1 + (int)(next(&state) % 20), v);
        check_read(text);
        static const char letters[] = "0123456789..eE+-x, #";
        size_t length = next(&state) % 12;
        for (size_t k = 0; k < length; k++)
            text[k] = letters[next(&state) % (sizeof letters - 1)];
        text[length] = 0;
        if (text[0] != ' ') /* the callers skip blanks */
            check_read(text);
    }
}
END_TEST

Suite *test_suite(void)
{
    TCase *tests = tcase_create("number_text");
    tcase_set_timeout(tests, 120);
    tcase_add_test(tests, test_number_text_round_trip_is_short);
    tcase_add_test(tests, test_integers_print_like_c_library);
    tcase_add_test(tests, test_numbers_read_like_strtod);
    Suite *suite = suite_create("number_text");
    suite_add_tcase(suite, tests);
    return suite;
}
