#include "cli/pose_args.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

enum { NUMBERS_MAX = 13 };

/* Returns the number of numbers in the text; -1: the text has other words, or more than NUMBERS_MAX
 * numbers. */
static int read_numbers(const char *text, double number[NUMBERS_MAX])
{
    static const char between[] = " \t,";
    int count = 0;
    for (text += strspn(text, between); *text; text += strspn(text, between)) {
        char *end;
        double x = strtod(text, &end);
        if (end == text || count == NUMBERS_MAX || !isfinite(x) || (*end && !strchr(between, *end)))
            return -1;
        number[count++] = x;
        text = end;
    }
    return count;
}

static void set_rows(ebpo_pose *pose, const double *number)
{
    for (int i = 0; i < 3; i++) {
        memcpy(pose->rotation[i], number + 4 * i, sizeof pose->rotation[i]);
        pose->translation[i] = number[4 * i + 3];
    }
}

bool pose_read(const char *text, ebpo_pose *out)
{
    double number[NUMBERS_MAX];
    int count = read_numbers(text, number);
    if (count != 3 && count != 7 && count != 8 && count != 12 && count != 13)
        return false;
    if (count >= 12)
        set_rows(out, number);
    else
        memcpy(out->translation, number, sizeof out->translation);
    if (count == 8 || count == 13)
        out->scale = number[count - 1];
    return count == 3 || count >= 12 || ebpo_pose_turn(out, number + 3, NULL) == EBPO_OK;
}
