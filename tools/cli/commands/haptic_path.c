/* Reads recorded positions of a haptic device. */
#include <errno.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "cli/numbers.h"
#include "cli/commands/haptic_device.h"

typedef struct path {
    haptic_pose *pose;
    uint64_t count, capacity;
} path;

static const char *skip_blanks(const char *at)
{
    while (*at == ' ' || *at == '\t' || *at == '\r' || *at == '\n')
        at++;
    return at;
}

/* Greatest count of numbers of a line: a position, a quaternion, and a pressure. */
enum { NUMBERS = 8 };

/* Reads the numbers of a line, up to '#'. Returns the count of the numbers; -1: other text, or too
 * many numbers. */
static int read_numbers(const char *line, size_t length, double out[NUMBERS])
{
    const char *at = skip_blanks(line), *end = line + length;
    int count = 0;
    while (*at && *at != '#') {
        const char *after;
        double x = number_read(at, end, &after);
        if (after == at || count == NUMBERS || !isfinite(x) || fabs(x) > 0x1p200)
            return -1;
        out[count++] = x;
        at = skip_blanks(after);
    }
    return count;
}

/* Divides a quaternion by its length. A unit quaternion stays as it is, to the last bit, so that a
 * replay repeats the recorded run. Returns false if the length is nearly 0. */
static bool make_unit(double q[4])
{
    double length = hypot(hypot(q[0], q[1]), hypot(q[2], q[3]));
    for (int k = 0; k < 4 && fabs(length - 1) > 0x1p-50; k++)
        q[k] /= length;
    return length >= 0x1p-200;
}

int haptic_pose_read(const char *line, size_t length, haptic_pose *out)
{
    double v[NUMBERS];
    int count = strlen(line) == length ? read_numbers(line, length, v) : -1;
    if (count != 3 && count != 7 && count != 8)
        return count == 0 ? 0 : -1;
    out->pressure = count == 8 ? v[7] : 0;
    out->lifted = count == 8 && v[7] == 0;
    if (!(out->pressure >= 0 && out->pressure <= 1))
        return -1;
    memcpy(out->position, v, sizeof out->position);
    memcpy(out->rotation, count > 3 ? v + 3 : (const double[4]){ 0, 0, 0, 1 },
           sizeof out->rotation);
    return make_unit(out->rotation) ? count : -1;
}

/* Adds a pose. Returns false if there is not enough memory. */
static bool add_pose(path *p, const haptic_pose *added)
{
    if (p->count == p->capacity) {
        uint64_t more = p->capacity ? 2 * p->capacity : 1024;
        haptic_pose *pose = realloc(p->pose, more * sizeof *pose);
        if (!pose)
            return false;
        p->pose = pose;
        p->capacity = more;
    }
    p->pose[p->count++] = *added;
    return true;
}

static bool read_lines(path *p, FILE *in, const char *name)
{
    char *line = NULL;
    size_t space = 0;
    bool ok = true;
    ssize_t length;
    for (uint64_t n = 1; ok && (length = getline(&line, &space, in)) >= 0; n++) {
        haptic_pose pose;
        const char *text = n == 1 ? number_skip_mark(line) : line;
        int count = haptic_pose_read(text, (size_t)(line + length - text), &pose);
        ok = count == 0 || (count > 0 && add_pose(p, &pose));
        if (!ok)
            fprintf(
                stderr,
                "ebpo haptic: %s, line %llu: expected three numbers, or seven numbers, of which "
                "the last four are a quaternion; then optionally a pressure from 0 to 1\n",
                name, (unsigned long long)n);
    }
    free(line);
    if (ok && ferror(in)) {
        perror(name);
        return false;
    }
    if (ok && p->count == 0)
        fprintf(stderr, "ebpo haptic: the path '%s' has no position\n", name);
    return ok && p->count > 0;
}

static bool begin_path(void *self, double seconds, haptic_pose *first)
{
    (void)seconds;
    *first = ((path *)self)->pose[0];
    return true;
}

static bool read_pose(void *self, uint64_t step, haptic_pose *out)
{
    path *p = self;
    if (step >= p->count)
        return false;
    *out = p->pose[step];
    return true;
}

static void end_path(void *self)
{
    free(((path *)self)->pose);
    free(self);
}

bool haptic_path_open(haptic_device *out, const char *name)
{
    path *p = calloc(1, sizeof *p);
    bool standard = strcmp(name, "-") == 0;
    FILE *in = standard ? stdin : fopen(name, "r");
    *out = (haptic_device){ begin_path, read_pose, NULL, end_path, p, 0 };
    bool ok = p && in;
    if (!in)
        fprintf(stderr, "ebpo haptic: %s: cannot be opened: %s\n", name, strerror(errno));
    if (ok)
        ok = read_lines(p, in, standard ? "standard input" : name);
    out->step_count = p ? p->count : 0;
    if (in && !standard)
        fclose(in);
    return ok;
}
