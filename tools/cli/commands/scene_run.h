/* Defines the options of `ebpo scene`, which all its subcommands share. */
#ifndef EBPO_TOOLS_SCENE_RUN_H
#define EBPO_TOOLS_SCENE_RUN_H

#include <ebpo/scene.h>

typedef struct scene_values {
    double time, from, to; /* NAN: not given; the command then sets `from` and `to` */
    double step, tolerance, margin, depth;  /* 0: not given */
    const char *out, *target_size, *memory; /* NULL: not given */
    int purpose;                            /* an ebpo_scene_purpose */
    int64_t threads;
    int64_t max_expansion; /* as in ebpo_open_options */
    bool outside, remote, json, csv, count, locations, solids, least, quiet;
} scene_values;

#define SCENE_VALUES_INIT                                                             \
    {                                                                                 \
        .time = __builtin_nan(""), .from = __builtin_nan(""), .to = __builtin_nan("") \
    }

#endif
