#include "cli/pose_args.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

enum { MOST = 13 };

/* Returns how many numbers there are, -1: something else stands there, or more. */
static int read_numbers(const char *text, double number[MOST])
{
    static const char between[] = " \t,";
    int count = 0;
    for (text += strspn(text, between); *text; text += strspn(text, between)) {
        char *end;
        double x = strtod(text, &end);
        if (end == text || count == MOST || !isfinite(x))
            return -1;
        number[count++] = x;
        text = end;
    }
    return count;
}

/* q: x, y, z, w of any length but 0. */
static bool turn(ebpo_pose *pose, const double q[4])
{
    double most = fmax(fmax(fabs(q[0]), fabs(q[1])), fmax(fabs(q[2]), fabs(q[3])));
    if (!(most > 0))
        return false;
    double x = q[0] / most, y = q[1] / most, z = q[2] / most, w = q[3] / most;
    double s = 2 / (x * x + y * y + z * z + w * w);
    const double r[3][3] = {
        { 1 - s * (y * y + z * z), s * (x * y - w * z), s * (x * z + w * y) },
        { s * (x * y + w * z), 1 - s * (x * x + z * z), s * (y * z - w * x) },
        { s * (x * z - w * y), s * (y * z + w * x), 1 - s * (x * x + y * y) },
    };
    memcpy(pose->rotation, r, sizeof r);
    return true;
}

static void take_rows(ebpo_pose *pose, const double *number)
{
    for (int i = 0; i < 3; i++) {
        memcpy(pose->rotation[i], number + 4 * i, sizeof pose->rotation[i]);
        pose->translation[i] = number[4 * i + 3];
    }
}

bool pose_read(const char *text, ebpo_pose *out)
{
    double number[MOST];
    int count = read_numbers(text, number);
    if (count != 3 && count != 7 && count != 8 && count != 12 && count != 13)
        return false;
    if (count >= 12)
        take_rows(out, number);
    else
        memcpy(out->translation, number, sizeof out->translation);
    if (count == 8 || count == 13)
        out->scale = number[count - 1];
    return count == 3 || count >= 12 || turn(out, number + 3);
}
