/* Filling in the caller's ebpo_error. */
#ifndef EBPO_CORE_ERROR_H
#define EBPO_CORE_ERROR_H

#include <ebpo/base.h>

/* Writes the message (printf style) and returns `status`, so that `return ebpo_fail(...)` reads
 * well. `error` may be NULL. An error that is already set is overwritten. */
ebpo_status ebpo_fail(ebpo_error *error, ebpo_status status, const char *format, ...)
    EBPO_PRINTF(3, 4);

/* The same about a file: the message becomes "`file`: ...". */
ebpo_status ebpo_fail_file(ebpo_error *error, ebpo_status status, const char *file,
                           const char *format, ...) EBPO_PRINTF(4, 5);

/* The same about an object in it, "`file`: `object`: ..."; "": about none. `offset` of the byte at
 * fault is told beside the message; -1: not known. */
ebpo_status ebpo_fail_at(ebpo_error *error, ebpo_status status, const char *file,
                         const char *object, int64_t offset, const char *format, ...)
    EBPO_PRINTF(6, 7);

/* Hands on what another call has said. */
ebpo_status ebpo_fail_with(ebpo_error *error, const ebpo_error *cause);

/* EBPO_E_MEMORY with the number of bytes that could not be had. */
ebpo_status ebpo_fail_memory(ebpo_error *error, uint64_t bytes);

/* EBPO_E_IO: "`path`: `what`: strerror(errno)". */
ebpo_status ebpo_fail_errno(ebpo_error *error, const char *path, const char *what);

#endif
