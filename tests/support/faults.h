/* System calls that fail on demand. The preloaded faults.c implements these functions; without it
 * they are NULL. The environment of a program controls the failures:
 *   EBPO_TEST_FAULT=KIND:N:ERRNO    the N-th call of a kind fails with this error
 *   EBPO_TEST_FAULT=KIND:N+:ERRNO   the N-th and all later calls fail
 *   EBPO_TEST_FAULT_COUNT=FILE      file of two 64-bit numbers: calls so far, failed calls
 *   EBPO_TEST_FAULT_FOREIGN=1       counts calls of other libraries instead of this project's
 *   EBPO_TEST_NAMED=1               file systems do not support unnamed files (O_TMPFILE)
 *   EBPO_TEST_PAUSE=1               a temporary file is unlinked only after a second
 *   EBPO_TEST_SLOW_DISK=1           fsync takes two seconds longer
 *
 * Calls count from the start of main. Only calls of this project count, or of the C library on its
 * behalf. */
#ifndef EBPO_TESTS_FAULTS_H
#define EBPO_TESTS_FAULTS_H

#include <stdbool.h>
#include <stdint.h>

/* In the order of their names in faults.c. */
enum {
    FAULT_MALLOC = 1 << 0,
    FAULT_READ = 1 << 1, /* read and pread, also by streams */
    FAULT_SHORT_READ = 1 << 2,
    FAULT_WRITE = 1 << 3,
    FAULT_SHORT_WRITE = 1 << 4,
    FAULT_SYNC = 1 << 5,
    FAULT_RENAME = 1 << 6,
    FAULT_TRUNCATE = 1 << 7,
    FAULT_CLOSE = 1 << 8, /* the file is closed nevertheless */
    FAULT_MMAP = 1 << 9,
    FAULT_OPEN = 1 << 10,
    FAULT_ALLOCATE = 1 << 11, /* posix_fallocate */
    FAULT_THREAD = 1 << 12,
    FAULT_KINDS = 13
};

/* Number of the first call of a new place: no call with the same innermost functions has failed in
 * this process or in another one with the same parent. */
#define FAULTS_NEW_PLACE UINT64_MAX

/* Lets the n-th call of these kinds from now on fail (1: the next call; 0: none), and with `onward`
 * all later calls. */
__attribute__((weak)) void faults_begin(unsigned kinds, uint64_t n, bool onward, int error);
/* Ends all failures. Returns the number of the first call that has failed, or 0. */
__attribute__((weak)) uint64_t faults_end(void);
/* Suspends failing and counting. */
__attribute__((weak)) void faults_pause(void);
__attribute__((weak)) void faults_resume(void);

#endif
