/* What `ebpo subset` and `ebpo fetch` share: which part of a file, and telling of the result. */
#ifndef EBPO_TOOLS_SUBSET_RUN_H
#define EBPO_TOOLS_SUBSET_RUN_H

#include <ebpo/ebpo.h>

#include "cli/args.h"
#include "cli/remote_args.h"
#include "cli/subtree_args.h"

typedef struct subset_values {
    const char *levels, *box, *parts, *target_size, *subtree_faces;
    double max_error;   /* 0: none given */
    int profile, codec; /* -1: none given */
    int face_coding;
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
    OPTION_TEXT("levels", 0, subset_values, levels, "0-N",                                         \
                "keep only levels 0 to N, and no mesh unless --parts or --profile asks for it"),   \
        OPTION_TEXT("box", 0, subset_values, box, "X0,Y0,Z0,X1,Y1,Z1",                             \
                    "keep only what meets this box"),                                              \
        OPTION_TEXT("parts", 0, subset_values, parts, "LIST",                                      \
                    "keep these parts: mesh, maps, envelopes, leaf-planes; with a minus sign "     \
                    "before each: all but these"),                                                 \
        OPTION_WORD("profile", 0, subset_values, profile, "NAME", profile_words,                   \
                    "full: all parts; lod: envelopes, leaf-planes, for viewers; collision: mesh, " \
                    "envelopes, for exact questions"),                                             \
        OPTION_WORD("codec", 0, subset_values, codec, "NAME", codec_words,                         \
                    "zstd, deflate or none; default: that of the input"),                          \
        OPTION_INT("zstd-level", 0, subset_values, zstd_level, "N", 1, 22,                         \
                   "effort of zstd, 1 to 22; default 3, 5 where it pays"),                         \
        SUBTREE_OPTION(subset_values, subtree_faces),                                              \
        FACE_CODING_OPTION(subset_values, face_coding), OPTION_THREADS(subset_values, threads),    \
        OPTION_FLAG("json", 0, subset_values, json, "print the facts of the result as JSON"),      \
        OPTION_QUIET(subset_values, quiet), REMOTE_OPTIONS(subset_values, remote)

/* The same for choosing by need, which takes the whole model: `ebpo subset` only. */
#define NEED_OPTIONS(type)                                                                    \
    OPTION_REAL("max-error", 0, type, max_error, "E", 0, 1.7976931348623157e308,              \
                "refine only where envelopes may reach more than E beyond the model (in its " \
                "unit); what is left out is certainly closer"),                               \
        OPTION_TEXT("target-size", 0, type, target_size, "S",                                 \
                    "at most this many bytes (5M, 512KiB), with the smallest --max-error "    \
                    "for which they suffice; which parts are kept is chosen too, unless given")

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
