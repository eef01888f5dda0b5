/* Options and results of `ebpo map`, shared by its files. */
#ifndef EBPO_TOOLS_MAP_JOB_H
#define EBPO_TOOLS_MAP_JOB_H

#include <ebpo/map.h>

#include "cli/remote_args.h"

#define MAP_MARGIN 0.1 /* default */

typedef struct map_values {
    const char *plane, *grid, *from, *out, *picture, *size, *box, *memory;
    double margin, max_distance, range;
    bool unsigned_distance, bounds, json, quiet;
    int palette;
    int64_t threads;
    remote_values remote;
} map_values;

typedef struct map_job {
    const map_values *v;
    const char *path; /* FILE */
    ebpo_file *file;
    ebpo_model *model;
    ebpo_map_options options;
    /* points of a plane or grid */
    bool plane;
    ebpo_lattice lattice;
    /* map of vertices */
    int width, height; /* size of their picture */
    /* results */
    double range; /* range of the colours */
    ebpo_map_stats stats;
    ebpo_map_hausdorff hausdorff;
} map_job;

/* Reads "800x600" into two numbers of 2 to 8192 each. Returns false after an error, which was
 * reported. */
bool map_read_size(const char *text, int *width, int *height);

#endif
