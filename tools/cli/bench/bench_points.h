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

/* `what`: "uniform" (in the bounding box of the mesh), "path" (along the surface; points only),
 * "camera", "segments" or "degenerate" (rays: bench_rays.h), or a file, of which at most `count`
 * rows are taken (0: all; 100,000 for generated rows). `tmax`: the end of rays whose rows in a file
 * do not state one; generated rays end there at the latest. Returns an exit code; errors are
 * reported on stderr. Call bench_points_free in any case. */
int bench_points_make(bench_points *out, points_kind kind, const char *model,
                      const remote_values *remote, const char *what, bool raw, uint64_t count,
                      uint64_t seed, double tmax);
/* Returns false for files. */
bool bench_points_generated(const char *what);
void bench_points_free(bench_points *p);

/* Closes a stream of open_memstream (NULL: there was no memory for the stream), writes its data to
 * the file `path`, which is replaced atomically, and frees the data. */
int bench_save(FILE *stream, char *const *data, const size_t *size, const char *path);

/* Writes little-endian doubles, 3 or 6 for each row. */
int bench_points_save(const bench_points *p, const char *path);

#endif
