/* What `ebpo subset` and `ebpo fetch` share: which part of a file, and telling of the result. */
#ifndef EBPO_TOOLS_SUBSET_RUN_H
#define EBPO_TOOLS_SUBSET_RUN_H

#include <ebpo/ebpo.h>

#include "cli/args.h"
#include "cli/remote_args.h"

typedef struct subset_values {
    const char *levels, *box, *parts, *target_size;
    double max_error;   /* 0: none given */
    int profile, codec; /* -1: none given */
    int64_t zstd_level, threads;
    bool json, quiet;
    remote_values remote;
} subset_values;
#define SUBSET_VALUES_INIT                                       \
    {                                                            \
        .profile = -1, .codec = -1, .remote = REMOTE_VALUES_INIT \
    }

extern const char *const profile_words[];

/* Rows for the tables of options of a command whose values are a subset_values. */
#define SUBSET_OPTIONS                                                                             \
    { "levels", 0,                                                                                 \
      ARG_TEXT, offsetof(subset_values, levels),                                                   \
      "0-N",    "keep levels 0 to N only; without mesh, unless --parts or\n--profile asks for it", \
      0,        0,                                                                                 \
      NULL },                                                                                      \
        { "box",                                                                                   \
          0,                                                                                       \
          ARG_TEXT,                                                                                \
          offsetof(subset_values, box),                                                            \
          "X0,Y0,Z0,X1,Y1,Z1",                                                                     \
          "keep what meets this box only",                                                         \
          0,                                                                                       \
          0,                                                                                       \
          NULL },                                                                                  \
        { "parts",                                                                                 \
          0,                                                                                       \
          ARG_TEXT,                                                                                \
          offsetof(subset_values, parts),                                                          \
          "LIST",                                                                                  \
          "keep these of mesh, maps, envelopes, leaf-planes; with a\nminus sign before each: all " \
          "but these",                                                                             \
          0,                                                                                       \
          0,                                                                                       \
          NULL },                                                                                  \
        { "profile",                                                                               \
          0,                                                                                       \
          ARG_WORD,                                                                                \
          offsetof(subset_values, profile),                                                        \
          "NAME",                                                                                  \
          "full: all parts; lod: envelopes, leaf-planes, for viewers;\ncollision: mesh, "          \
          "envelopes, for exact questions",                                                        \
          0,                                                                                       \
          0,                                                                                       \
          profile_words },                                                                         \
        { "codec",    0,                                                                           \
          ARG_WORD,   offsetof(subset_values, codec),                                              \
          "NAME",     "zstd, deflate or none; default: as in the input",                           \
          0,          0,                                                                           \
          codec_words },                                                                           \
        { "zstd-level",                                                                            \
          0,                                                                                       \
          ARG_INT,                                                                                 \
          offsetof(subset_values, zstd_level),                                                     \
          "N",                                                                                     \
          "effort of zstd, 1 to 22; default 3",                                                    \
          1,                                                                                       \
          22,                                                                                      \
          NULL },                                                                                  \
        { "threads", 0,                                                                            \
          ARG_INT,   offsetof(subset_values, threads),                                             \
          "N",       "threads; 0, the default: all cores",                                         \
          0,         256,                                                                          \
          NULL },                                                                                  \
        ARG_SWITCH("json", 0, subset_values, json, "print the facts of the result as JSON"),       \
        ARG_SWITCH("quiet", 'q', subset_values, quiet,                                             \
                   "no summary, no progress: errors and warnings only"),                           \
        REMOTE_OPTIONS(subset_values, remote)

/* The same for choosing by need, which takes the whole model: `ebpo subset` only. */
#define NEED_OPTIONS(type)                                                                       \
    { "max-error",                                                                               \
      0,                                                                                         \
      ARG_REAL,                                                                                  \
      offsetof(type, max_error),                                                                 \
      "E",                                                                                       \
      "refine only where envelopes may reach more than E beyond the\nmodel (in its unit): what " \
      "is left out is certainly closer",                                                         \
      0,                                                                                         \
      1.7976931348623157e308,                                                                    \
      NULL },                                                                                    \
    {                                                                                            \
        "target-size", 0, ARG_TEXT, offsetof(type, target_size), "S",                            \
            "at most so many bytes (k, M, G: powers of 1024), with the least\n--max-error for "  \
            "which that holds; which parts are kept is\nchosen too, unless said",                \
            0, 0, NULL                                                                           \
    }

/* The two, read; the exit code. */
int subset_need(const char *name, double max_error, const char *target_size,
                ebpo_subset_options *out);

/* ", ..." for summaries: the error that was kept to and, if it was `chosen`, the profile; or
 * nothing. */
void subset_print_need(const ebpo_info *info, bool chosen);

/* What can be said before the file is open; the exit code, EXIT_FINE to go on. `out` gets all but
 * what depends on the file. */
int subset_options(const char *name, const subset_values *v, const char *in, const char *out_path,
                   ebpo_subset_options *out);

/* The rest, which depends on what the file has. EBPO_E_ARGUMENT: a part that the file does not have
 * was asked for by name. */
EBPO_MUST_USE ebpo_status subset_settle(const subset_values *v, const ebpo_info *info,
                                        const char *shown, ebpo_subset_options *out,
                                        ebpo_error *error);

/* What is on the disk, as a reader sees it. `t`: what was read of the input. */
EBPO_MUST_USE ebpo_status subset_tell(const subset_values *v, const char *out_path,
                                      const ebpo_info *from, const traffic *t, double seconds,
                                      ebpo_error *error);

#endif
