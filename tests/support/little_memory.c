/* Simulates a machine with little memory, or without locks of files, as a preloaded library.
 * Environment variables: EBPO_TEST_FREE, number of bytes of free memory; EBPO_TEST_LOCK, error
 * number with which locking a file fails. */
#include <errno.h>
#include <stdint.h>
#include <stdlib.h>
#include <sys/file.h>
#include <sys/syscall.h>
#include <unistd.h>

uint64_t ebpo_free_memory(void);

__attribute__((visibility("default"))) uint64_t ebpo_free_memory(void)
{
    const char *bytes = getenv("EBPO_TEST_FREE");
    return bytes ? strtoull(bytes, NULL, 10) : UINT64_C(1) << 40;
}

__attribute__((visibility("default"))) int flock(int file, int operation)
{
    const char *number = getenv("EBPO_TEST_LOCK");
    if (!number)
        return (int)syscall(SYS_flock, file, operation);
    errno = atoi(number);
    return -1;
}
