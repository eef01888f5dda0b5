/* Writes a .npy file of integers: the face numbers of a part, for catalogues. */
#ifndef EBPO_TESTS_NPY_NUMBERS_H
#define EBPO_TESTS_NPY_NUMBERS_H

#include <stdint.h>
#include <stdio.h>

#include "check_main.h"

/* Writes `count` numbers from `first` on. */
static inline void write_numbers(const char *path, uint64_t count, int64_t first)
{
    char head[119];
    int length =
        snprintf(head, sizeof head, "{'descr': '<i8', 'fortran_order': False, 'shape': (%llu,), }",
                 (unsigned long long)count);
    FILE *out = fopen(path, "wb");
    ck_assert_ptr_nonnull(out);
    fwrite("\x93NUMPY\x01\0\x76\0", 1, 10, out);
    fprintf(out, "%s%*s\n", head, 117 - length, "");
    for (uint64_t i = 0; i < count; i++) {
        int64_t number = first + (int64_t)i;
        for (int byte = 0; byte < 8; byte++)
            fputc((int)(number >> (8 * byte) & 255), out);
    }
    fclose(out);
}

#endif
