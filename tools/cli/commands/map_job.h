/* Options and results of `ebpo map`, shared by its files. */
#ifndef EBPO_TOOLS_MAP_JOB_H
#define EBPO_TOOLS_MAP_JOB_H

#include <ebpo/map.h>

#include "cli/remote_args.h"

#define MAP_MARGIN                                                                \
    0.1 /* default of --margin, as a share of the longest edge of the model's box \
         */

/* Values of the options. */
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
    const char *path; /* FILE, the operand */
    ebpo_file *file;
    ebpo_model *model;
    ebpo_map_options options;
    bool plane;           /* --plane was given, not --grid or --from */
    ebpo_lattice lattice; /* points of a plane or grid */
    int width, height;    /* size of the picture in pixels; 0: follows from the plane */
    double range;         /* distance with the last colour of the palette; 0: not yet known */
    ebpo_map_stats stats; /* results */
    ebpo_map_hausdorff hausdorff; /* result of --bounds */
} map_job;

/* Reads "800x600" into two numbers of 2 to 8192 each. Returns false after an error, which was
 * reported. */
bool map_read_size(const char *text, int *width, int *height);

#endif
