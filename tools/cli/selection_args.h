/* Checks the options for the selection of planes (`ebpo convert` and `ebpo report`), and reads the
 * value of --k-root. */
#ifndef EBPO_TOOLS_SELECTION_ARGS_H
#define EBPO_TOOLS_SELECTION_ARGS_H

#include <ebpo/build.h>

typedef struct selection_options {
    uint32_t chosen;         /* bits by ebpo_selection: the selections that are built */
    double percent, epsilon; /* negative: not given */
    const char *k_root;      /* NULL: not given */
    int normals;             /* ebpo_normal_distance; negative: not given */
    int64_t seed;            /* seed of random choices; negative: not given */
} selection_options;

/* Refuses options that have no effect on the chosen selections or are out of range. Returns an exit
 * code; errors have been reported on stderr. */
int selection_check(const char *name, const selection_options *o);

/* Sets *out to the number of planes at the root, 1 to 1e9. `text` is the checked value of --k-root.
 * It is a number such as "500", or a share of the faces such as "1%", which gives at least 1 plane.
 * If `text` is NULL, *out is 0. EBPO_E_ARGUMENT: the share is more than 1e9 planes. */
EBPO_MUST_USE ebpo_status selection_k_root(const char *text, uint64_t faces, double *out,
                                           ebpo_error *error);

#endif
