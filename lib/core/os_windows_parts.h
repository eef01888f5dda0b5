/* Functions that the files os_windows_*.c share. */
#ifndef EBPO_CORE_OS_WINDOWS_PARTS_H
#define EBPO_CORE_OS_WINDOWS_PARTS_H

#include <stdatomic.h>
#include <wchar.h>

/* Sets errno from the last error of Windows; returns -1. */
int ebpo_windows_fail(void);

/* Converts UTF-16 to UTF-8; NULL: no memory. The caller frees the text. */
char *ebpo_windows_narrow(const wchar_t *wide);

#endif
