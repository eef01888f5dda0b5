/* Answers as one NumPy array: a head, then what --raw prints. */
#ifndef EBPO_TOOLS_NPY_ANSWERS_H
#define EBPO_TOOLS_NPY_ANSWERS_H

#include <sys/types.h>

#include "cli/points.h"

typedef struct npy_answers {
    const char *command, *dtype; /* as NumPy writes it in a head */
    unsigned bytes;              /* of an answer */
    off_t begin;                 /* of the head in standard output; -1: the count was known */
} npy_answers;

/* Writes the head. How many answers there will be stands in it: it is set at the end where standard
 * output is a file, else the input must tell. False: neither, or it could not be written; said on
 * stderr. */
bool npy_begin(npy_answers *npy, points *in);
/* False: as above. */
bool npy_end(npy_answers *npy);

#endif
