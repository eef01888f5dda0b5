/* Writes results as one NumPy array: a header, then the output of --raw. */
#ifndef EBPO_TOOLS_NPY_RESULTS_H
#define EBPO_TOOLS_NPY_RESULTS_H

#include <sys/types.h>

#include "cli/points.h"

typedef struct npy_results {
    const char *command; /* name of the command, for messages */
    const char *dtype;   /* type of a result, as NumPy writes it in a header */
    unsigned bytes;      /* bytes of a result */
    /* offset of the header in standard output, where npy_end rewrites it; -1: npy_end does nothing,
     * because the number of results was known at the beginning */
    off_t begin;
} npy_results;

/* Writes the header, which states the number of results. If standard output is a file, npy_end sets
 * this number later; otherwise the input must state the number of its rows. Returns false, after an
 * error message, if the number is not known or writing failed. */
bool npy_begin(npy_results *npy, points *in);
/* Sets the number of results in the header, if standard output is a file. Returns false if writing
 * failed (reported on stderr). */
bool npy_end(npy_results *npy);

#endif
