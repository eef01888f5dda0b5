/* SPDX-License-Identifier: MIT
 * Everything that can be asked of a file, each kind as a status and a hash of its answers: two
 * files answer alike when these are equal. */
#ifndef ASK_ALL_H
#define ASK_ALL_H

#include <ebpo/file.h>

enum { ASKED_KINDS = 13 };

typedef struct asked {
    ebpo_status open; /* nothing else is set unless EBPO_OK */
    ebpo_status status[ASKED_KINDS];
    uint64_t hash[ASKED_KINDS];
    /* what `ebpo verify` says; EBPO_OK and no violations: that all is well */
    ebpo_status verify;
    uint64_t violations;
    uint64_t spare_filled; /* bytes that belong to nothing and are not zero */
} asked;

extern const char *const asked_names[ASKED_KINDS];

/* `verified`: also verifies, which takes longest. */
void ask_all(const uint8_t *data, size_t size, bool verified, asked *out);

#endif
