/* Reads or generates the query rows of the benchmark. */
#ifndef EBPO_TOOLS_BENCH_POINTS_H
#define EBPO_TOOLS_BENCH_POINTS_H

#include <ebpo/file.h>

#include "cli/points.h"
#include "cli/remote_args.h"

typedef struct bench_points {
    points_kind kind;
    double *rows; /* [count][points_width(kind)] */
    uint64_t count;
} bench_points;

/* Makes the query rows. Returns an exit code; errors are reported on stderr. Call bench_points_free
 * in any case.
 *
 *   what   "uniform" (in the bounding box of the mesh), "path" (along the surface; points only),
 *          "camera", "segments" or "degenerate" (rays: bench_rays.h), or the name of a file
 *   count  number of generated rows (0: 100,000), or maximum number of rows of the file (0: all)
 *   raw    the file contains doubles, not text
 *   tmax   default of a ray's greatest parameter t if a row of the file does not state it; upper
 *          bound of this parameter for generated rays */
int bench_points_make(bench_points *out, points_kind kind, const char *model,
                      const remote_values *remote, const char *what, bool raw, uint64_t count,
                      uint64_t seed, double tmax);
/* Returns true if `what` is the word for generated rows, and false if it is a file. */
bool bench_points_generated(const char *what);
void bench_points_free(bench_points *p);

/* Closes a stream of open_memstream, writes the stream's data to the file `path`, and frees the
 * data. The file is replaced atomically. Returns an exit code. `stream`: NULL if open_memstream
 * failed. `data`, `size`: the arguments of open_memstream. */
int bench_save(FILE *stream, char *const *data, const size_t *size, const char *path);

/* Writes the rows as little-endian doubles, 3 or 6 for each row. Returns an exit code. */
int bench_points_save(const bench_points *p, const char *path);

#endif
