/* Dates and times of ISO 8601, by the calendar. */
#include <string.h>

#include <ebpo/base.h>

/* Reads `count` digits as a number from `least` to `most`; *text goes on behind them. */
static bool take_digits(const char **text, int count, int least, int most, int *out)
{
    *out = 0;
    for (int i = 0; i < count; i++, (*text)++) {
        if (**text < '0' || **text > '9')
            return false;
        *out = 10 * *out + (**text - '0');
    }
    return *out >= least && *out <= most;
}

static int days_of(int year, int month)
{
    static const int days[] = { 31, 28, 31, 30, 31, 30, 31, 31, 30, 31, 30, 31 };
    bool leaps = (year % 4 == 0 && year % 100 != 0) || year % 400 == 0;
    return days[month - 1] + (month == 2 && leaps);
}

/* Returns true for HH:MM, HH:MM:SS or with decimals of seconds, and then Z, +HH:MM, -HH:MM or
 * nothing. */
static bool is_time(const char *t)
{
    int n;
    if (!take_digits(&t, 2, 0, 23, &n) || *t != ':' || (t++, !take_digits(&t, 2, 0, 59, &n)))
        return false;
    if (*t == ':') {
        t++;
        if (!take_digits(&t, 2, 0, 60, &n)) /* 60: a leap second */
            return false;
        if (*t == '.' || *t == ',') {
            size_t digits = strspn(t + 1, "0123456789");
            if (digits == 0)
                return false;
            t += 1 + digits;
        }
    }
    if (*t == 'Z')
        return t[1] == 0;
    if (*t == '+' || *t == '-') {
        t++;
        if (!take_digits(&t, 2, 0, 23, &n) || *t != ':' || (t++, !take_digits(&t, 2, 0, 59, &n)))
            return false;
    }
    return *t == 0;
}

bool ebpo_is_date(const char *text)
{
    int year, month, day;
    if (!take_digits(&text, 4, 0, 9999, &year))
        return false;
    if (*text == 0)
        return true;
    if (*text++ != '-' || !take_digits(&text, 2, 1, 12, &month))
        return false;
    if (*text == 0)
        return true;
    if (*text++ != '-' || !take_digits(&text, 2, 1, days_of(year, month), &day))
        return false;
    return *text == 0 || (*text == 'T' && is_time(text + 1));
}
