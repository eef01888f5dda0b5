/* SPDX-License-Identifier: MIT
 * Runs every query on a file, each kind with a status and a hash of its results: two files give the
 * same results when these are equal. */
#ifndef QUERY_ALL_H
#define QUERY_ALL_H

#include <ebpo/file.h>

enum { QUERY_KINDS = 13 };

typedef struct query_results {
    ebpo_status open; /* no other member is set unless EBPO_OK */
    ebpo_status status[QUERY_KINDS];
    uint64_t hash[QUERY_KINDS];
    /* result of `ebpo verify`; EBPO_OK and no violations: the file is correct */
    ebpo_status verify;
    uint64_t violations;
    uint64_t spare_filled; /* unused bytes that are not zero */
} query_results;

extern const char *const query_names[QUERY_KINDS];

/* `verified`: also verifies, which takes longest. */
void query_all(const uint8_t *data, size_t size, bool verified, query_results *out);

#endif
