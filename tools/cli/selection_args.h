/* The options that say how planes are chosen: what `ebpo convert` and `ebpo report` refuse, and
 * what --k-root means. */
#ifndef EBPO_TOOLS_SELECTION_ARGS_H
#define EBPO_TOOLS_SELECTION_ARGS_H

#include <ebpo/build.h>

typedef struct selection_options {
    uint32_t chosen;         /* bit i: ebpo_selection i is built */
    double percent, epsilon; /* negative: not given */
    const char *k_root;      /* NULL: not given */
    int normals;             /* ebpo_normal_distance; negative: not given */
    int64_t seed;            /* of the selections alone; negative: not given */
} selection_options;

/* Refuses what would be without effect, and what is out of range. An exit code; what is wrong has
 * been said on stderr. */
int selection_check(const char *name, const selection_options *o);

/* Planes at the root, 1 to 1e9, of a text that was checked: "500", or "1%" of so many faces, at
 * least 1. NULL: 0. EBPO_E_ARGUMENT: a share that is more than 1e9 planes. */
EBPO_MUST_USE ebpo_status selection_k_root(const char *text, uint64_t faces, double *out,
                                           ebpo_error *error);

#endif
