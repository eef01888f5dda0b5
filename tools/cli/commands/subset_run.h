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
