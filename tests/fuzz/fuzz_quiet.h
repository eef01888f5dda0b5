/* SPDX-License-Identifier: MIT
 * For targets of what speaks to people: their words go nowhere, those of sanitizers are still
 * heard. */
#ifndef FUZZ_QUIET_H
#define FUZZ_QUIET_H

#include <stdio.h>

static inline void fuzz_quiet(void)
{
    static FILE *nowhere;
    if (nowhere || !(nowhere = fopen("/dev/null", "w")))
        return;
    stderr = nowhere;
    stdout = nowhere;
}

#endif
