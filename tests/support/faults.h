/* Calls of the system that fail on demand. Of faults.c, which is preloaded: a program that runs
 * without it finds these functions NULL. From outside a program it is ordered by its environment:
 *   EBPO_TEST_FAULT=KIND:N:ERRNO    the N-th call of a kind fails with that error
 *   EBPO_TEST_FAULT=KIND:N+:ERRNO   and all after it
 *   EBPO_TEST_FAULT_COUNT=FILE      two numbers of 64 bits: calls so far, and failed ones
 *   EBPO_TEST_FAULT_FOREIGN=1       calls by other libraries count, and ours do not
 *   EBPO_TEST_NAMED=1               file systems know no files without names (O_TMPFILE)
 *   EBPO_TEST_PAUSE=1               a temporary file about to lose its name keeps it for a second
 * Only calls of this project count, or made on its behalf by the C library, from main on. */
#ifndef EBPO_TESTS_FAULTS_H
#define EBPO_TESTS_FAULTS_H

#include <stdbool.h>
#include <stdint.h>

/* In the order of their names in faults.c. */
enum {
    FAULT_MALLOC = 1 << 0,
    FAULT_READ = 1 << 1, /* read and pread, of streams too */
    FAULT_SHORT_READ = 1 << 2,
    FAULT_WRITE = 1 << 3,
    FAULT_SHORT_WRITE = 1 << 4,
    FAULT_SYNC = 1 << 5,
    FAULT_RENAME = 1 << 6,
    FAULT_TRUNCATE = 1 << 7,
    FAULT_CLOSE = 1 << 8, /* the file is closed all the same */
    FAULT_MMAP = 1 << 9,
    FAULT_OPEN = 1 << 10,
    FAULT_ALLOCATE = 1 << 11, /* posix_fallocate */
    FAULT_THREAD = 1 << 12,
    FAULT_KINDS = 13
};

/* From here on the n-th call of these kinds fails (1 is the next one), and with `onward` all after
 * it. 0: none. Counts anew. */
__attribute__((weak)) void faults_begin(unsigned kinds, uint64_t n, bool onward, int error);
/* All succeed again. How many calls there were. */
__attribute__((weak)) uint64_t faults_end(void);
/* Neither failed nor counted meanwhile. */
__attribute__((weak)) void faults_pause(void);
__attribute__((weak)) void faults_resume(void);

#endif
