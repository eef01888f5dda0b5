/* The nearest point of a cone lies in its inside, on a plane, or on a line of two: all are tried,
 * there are few. Else it is the apex. */
#include "core/strict_fp.h"

#include "extras/haptic/held_back.h"

#include <math.h>
#include <stdbool.h>
#include <string.h>

#include "extras/haptic/vectors.h"

typedef struct trial {
    const ebpo_held_planes *planes;
    const double *want;
    double length, best, slack;
    double *out;
} trial;

static void try_way(trial *t, const double way[3], double slack)
{
    double lost[3];
    for (int i = 0; i < t->planes->count; i++)
        if (dot(way, t->planes->normal[i]) < -slack)
            return;
    difference(t->want, way, lost);
    double square = dot(lost, lost);
    if (square < t->best) {
        t->best = square;
        t->slack = slack;
        copy(way, t->out);
    }
}

static void try_plane(trial *t, const double n[3], double slack)
{
    double way[3], into = dot(t->want, n);
    for (int i = 0; i < 3; i++)
        way[i] = t->want[i] - into * n[i];
    try_way(t, way, slack);
}

static void try_line(trial *t, const double m[3], const double n[3], double slack)
{
    double line[3], way[3];
    cross(m, n, line);
    double square = dot(line, line);
    if (!(square > 0x1p-40))
        return;
    double part = dot(t->want, line) / square;
    for (int i = 0; i < 3; i++)
        way[i] = part * line[i];
    try_way(t, way, slack / sqrt(square));
}

double ebpo_hold_back(const ebpo_held_planes *planes, const double want[3], double out[3])
{
    double length = sqrt(dot(want, want)), slack = 0x1p-44 * length;
    trial t = { planes, want, length, INFINITY, slack, out };
    for (int i = 0; i < 3; i++)
        out[i] = 0;
    try_way(&t, want, slack);
    if (t.best == 0)
        return slack;
    for (int i = 0; i < planes->count; i++)
        try_plane(&t, planes->normal[i], slack);
    for (int i = 0; i < planes->count; i++)
        for (int j = 0; j < i; j++)
            try_line(&t, planes->normal[i], planes->normal[j], slack);
    return t.slack;
}

void ebpo_held_planes_add(ebpo_held_planes *planes, const double normal[3])
{
    for (int k = 0; k < planes->count; k++)
        if (memcmp(planes->normal[k], normal, sizeof planes->normal[k]) == 0)
            return;
    if (planes->count < EBPO_PLANES_MOST)
        copy(normal, planes->normal[planes->count++]);
}
