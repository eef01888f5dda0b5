/* Defines the options for a part of a file and the report of the result, shared by `ebpo subset`
 * and `ebpo fetch`. */
#ifndef EBPO_TOOLS_SUBSET_RUN_H
#define EBPO_TOOLS_SUBSET_RUN_H

#include <ebpo/ebpo.h>

#include "cli/args.h"
#include "cli/remote_args.h"
#include "cli/subtree_args.h"

typedef struct subset_values {
    const char *levels, *box, *parts, *target_size, *subtree_faces;
    double max_error;   /* 0: not given */
    int profile, codec; /* -1: not given */
    int face_coding;
    int64_t zstd_level, threads;
    bool json, quiet;
    remote_values remote;
} subset_values;
#define SUBSET_VALUES_INIT                                       \
    {                                                            \
        .profile = -1, .codec = -1, .remote = REMOTE_VALUES_INIT \
    }

extern const char *const profile_words[]; /* by ebpo_profile; NULL-terminated */

/* Reads --parts, a list of part names separated by commas. Without signs, *parts becomes the named
 * parts. With a minus or plus sign before each name, it becomes `base` without or with these parts.
 * Returns false if the list is invalid. */
bool subset_read_parts(const char *text, uint32_t base, uint32_t *parts);
#define SUBSET_PARTS_EXPECTED                                                                     \
    "is not a list of mesh, maps, attributes, envelopes, leaf-planes, colours, border, surface, " \
    "or of these with a minus or a plus sign before each"

/* Sets the target in *out from --max-error and --target-size. name: of the command. Returns an exit
 * code. */
int subset_read_target(const char *name, double max_error, const char *target_size,
                       ebpo_subset_options *out);

/* Continues the line of a summary with ", ...". Prints the profile if `chosen` (the command chose
 * the parts), and the maximum error if the file is pruned. */
void subset_print_target(const ebpo_info *info, bool chosen);

/* Checks options before the file is open, and sets the members of *out that do not depend on the
 * file. Returns an exit code; EXIT_OK: the options are valid. */
int subset_options(const char *name, const subset_values *v, const char *in, const char *out_path,
                   ebpo_subset_options *out);

/* Sets the members of *out that depend on the file: parts and codec. EBPO_E_ARGUMENT: a level or a
 * part that was requested by name is not in the file, or an option does not apply to the file. */
EBPO_MUST_USE ebpo_status subset_set_parts(const subset_values *v, const ebpo_info *info,
                                           const char *shown, ebpo_subset_options *out,
                                           ebpo_error *error);

/* Opens the written file, and reports its properties. from: facts of the input; t: traffic of the
 * input. */
EBPO_MUST_USE ebpo_status subset_report(const subset_values *v, const char *out_path,
                                        const ebpo_info *from, const traffic *t, double seconds,
                                        ebpo_error *error);

#endif
