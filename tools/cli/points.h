/* Reading what is asked about: points, rays or boxes, a batch at a time, from standard input or a
 * file. */
#ifndef EBPO_TOOLS_POINTS_H
#define EBPO_TOOLS_POINTS_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

typedef enum points_kind {
    POINTS,      /* x y z */
    POINTS_RAYS, /* ox oy oz dx dy dz tmax; the last number may be missing */
    POINTS_BOXES /* x0 y0 z0 x1 y1 z1, the lower corner first */
} points_kind;

enum { POINTS_BATCH = 4096, POINTS_WIDEST = 7 };

/* Doubles in a row that points_next fills: 3, 7, 6. */
int points_width(points_kind kind);
/* Doubles of one in raw input: 3, 6, 6. */
int points_raw_width(points_kind kind);

typedef struct points {
    const char *command, *name; /* for messages */
    points_kind kind;
    bool raw;
    double tmax; /* of rays that tell none */
    int fd;
    char *buffer; /* [room + 1] */
    size_t capacity, at, end;
    bool begun, ended, failed; /* failed: said on stderr, the command shall end with EXIT_FAILED */
    uint64_t line, row;        /* of what was read last, from 1 */
    double *ply;               /* all vertices of a PLY, or NULL */
    uint64_t ply_count, ply_at;
} points;

/* `by`: the command. `path` NULL or "-": standard input. False: it cannot be opened (said on
 * stderr). points_close in any case. */
bool points_open(points *p, const char *by, const char *path, points_kind kind, bool raw,
                 double tmax);
/* Fills rows[POINTS_BATCH][points_width], as many as there are without waiting, but at least one;
 * returns their number, 0 at the end or after an error. */
uint64_t points_next(points *p, double *rows);
void points_close(points *p);

#endif
