/* Declares functions that the files os_windows_*.c share. */
#ifndef EBPO_CORE_OS_WINDOWS_PARTS_H
#define EBPO_CORE_OS_WINDOWS_PARTS_H

#include <stdatomic.h>
#include <stdbool.h>
#include <wchar.h>

/* Sets errno to the value for the last error of Windows. Returns -1. */
int ebpo_windows_fail(void);

/* Converts UTF-16 to UTF-8. Returns NULL when out of memory. The caller frees the text. */
char *ebpo_windows_narrow(const wchar_t *wide);

/* Returns 1 if the descriptor is a socket and a read would not wait, 0 if a read would wait, and -1
 * if it is not a socket. */
int ebpo_windows_socket_state(int fd);

/* Sets whether reads from a socket wait. Returns 0, or -1 with errno. */
int ebpo_windows_socket_waits(int fd, bool waits);

#endif
