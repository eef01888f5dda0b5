/* A recorded hand. */
#include <errno.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "cli/numbers.h"
#include "cli/commands/touch_device.h"

typedef struct path {
    touch_pose *pose;
    uint64_t count, capacity;
} path;

static const char *skip_blanks(const char *at)
{
    while (*at == ' ' || *at == '\t' || *at == '\r' || *at == '\n')
        at++;
    return at;
}

/* The numbers of a line; -1: something else is in it. */
static int read_numbers(const char *line, size_t length, double out[7])
{
    const char *at = skip_blanks(line), *end = line + length;
    int count = 0;
    while (*at && *at != '#') {
        const char *after;
        double x = number_read(at, end, &after);
        if (after == at || count == 7 || !isfinite(x) || fabs(x) > 0x1p200)
            return -1;
        out[count++] = x;
        at = skip_blanks(after);
    }
    return count;
}

static bool make_unit(double q[4])
{
    double length = hypot(hypot(q[0], q[1]), hypot(q[2], q[3]));
    for (int k = 0; k < 4; k++)
        q[k] /= length;
    return length >= 0x1p-200;
}

static bool add_pose(path *p, const double v[7], int count)
{
    if (p->count == p->capacity) {
        uint64_t more = p->capacity ? 2 * p->capacity : 1024;
        touch_pose *pose = realloc(p->pose, more * sizeof *pose);
        if (!pose)
            return false;
        p->pose = pose;
        p->capacity = more;
    }
    touch_pose *t = &p->pose[p->count++];
    memcpy(t->place, v, sizeof t->place);
    memcpy(t->turn, count == 7 ? v + 3 : (const double[4]){ 0, 0, 0, 1 }, sizeof t->turn);
    return make_unit(t->turn);
}

static bool read_lines(path *p, FILE *in, const char *name)
{
    char *line = NULL;
    size_t room = 0;
    bool fine = true;
    ssize_t length;
    for (uint64_t n = 1; fine && (length = getline(&line, &room, in)) >= 0; n++) {
        double v[7];
        const char *text = n == 1 ? number_skip_mark(line) : line;
        int count = strlen(line) == (size_t)length
                        ? read_numbers(text, (size_t)(line + length - text), v)
                        : -1;
        fine = count == 0 || ((count == 3 || count == 7) && add_pose(p, v, count));
        if (!fine)
            fprintf(stderr,
                    "ebpo touch: %s, line %llu: expected three numbers, or seven of which the last "
                    "four are a quaternion\n",
                    name, (unsigned long long)n);
    }
    free(line);
    if (fine && ferror(in)) {
        perror(name);
        return false;
    }
    if (fine && p->count == 0)
        fprintf(stderr, "ebpo touch: the path '%s' has no place\n", name);
    return fine && p->count > 0;
}

static bool begin_path(void *self, double seconds, touch_pose *first)
{
    (void)seconds;
    *first = ((path *)self)->pose[0];
    return true;
}

static bool read_pose(void *self, uint64_t tick, touch_pose *out)
{
    path *p = self;
    if (tick >= p->count)
        return false;
    *out = p->pose[tick];
    return true;
}

static void write_answer(void *self, const touch_answer *answer)
{
    (void)self;
    (void)answer;
}

static uint64_t count_ticks(void *self) { return ((path *)self)->count; }

static void end_path(void *self)
{
    free(((path *)self)->pose);
    free(self);
}

bool touch_path_open(touch_device *out, const char *name)
{
    path *p = calloc(1, sizeof *p);
    bool standard = strcmp(name, "-") == 0;
    FILE *in = standard ? stdin : fopen(name, "r");
    *out = (touch_device){ begin_path, read_pose, write_answer, count_ticks, end_path, p };
    bool fine = p && in;
    if (!in)
        fprintf(stderr, "ebpo touch: %s: cannot be opened: %s\n", name, strerror(errno));
    if (fine)
        fine = read_lines(p, in, standard ? "standard input" : name);
    if (in && !standard)
        fclose(in);
    return fine;
}
