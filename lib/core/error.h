/* Provides functions that fill in the caller's ebpo_error, and functions that read and write the
 * versioned structs of public functions, which begin with their size. */
#ifndef EBPO_CORE_ERROR_H
#define EBPO_CORE_ERROR_H

#include <ebpo/base.h>

/* Writes the message (printf style) and the status to *error, and returns `status`. `error` may be
 * NULL. An error that is already set is overwritten. */
ebpo_status ebpo_fail(ebpo_error *error, ebpo_status status, const char *format, ...)
    EBPO_PRINTF(3, 4);

/* Same as ebpo_fail, for an error about a file: the message becomes "FILE: ...". */
ebpo_status ebpo_fail_file(ebpo_error *error, ebpo_status status, const char *file,
                           const char *format, ...) EBPO_PRINTF(4, 5);

/* Same as ebpo_fail, for an error about an object in a file: the message becomes "FILE: OBJECT:
 * ...". `object` "": no object. `offset`: offset of the wrong byte in the file, for error->offset;
 * -1: not known. */
ebpo_status ebpo_fail_at(ebpo_error *error, ebpo_status status, const char *file,
                         const char *object, int64_t offset, const char *format, ...)
    EBPO_PRINTF(6, 7);

/* Copies the error `cause` of another call to *error, and returns the status of `cause`. */
ebpo_status ebpo_fail_with(ebpo_error *error, const ebpo_error *cause);

/* Returns EBPO_E_MEMORY. `bytes`: the number of bytes that could not be allocated, for the message.
 */
ebpo_status ebpo_fail_memory(ebpo_error *error, uint64_t bytes);

/* Returns EBPO_E_IO, with the message "PATH: WHAT: " and the text of errno. */
ebpo_status ebpo_fail_errno(ebpo_error *error, const char *path, const char *what);

/* EBPO_TAKE reads the caller's options, and EBPO_GIVE fills in the caller's results. Both are
 * structs that begin with their size (ebpo/base.h), so the caller may have been compiled with any
 * version of the header. */

/* Reads the caller's options `given` into the library's struct *own, which already has the
 * defaults. If `given` is NULL, *own does not change. EBPO_E_ARGUMENT: struct_size is not set.
 * EBPO_E_UNSUPPORTED: a member is set that this version of the library does not support. */
#define EBPO_TAKE(type, own, given, error)  \
    (!(given) ? EBPO_OK                     \
     : (given)->struct_size == sizeof(type) \
         ? (*(own) = *(given), EBPO_OK)     \
         : ebpo_sized_take((own), sizeof(type), (given), (given)->struct_size, #type, error))

/* Returns EBPO_E_ARGUMENT when the caller's result struct does not state its size. */
#define EBPO_CHECK_SIZED(type, out, error) ebpo_sized_check((out)->struct_size, #type, error)

/* Copies each member of *filled to the caller's struct *out, if *out has this member. Members of
 * *out that *filled lacks become 0. Keeps the caller's struct_size. If struct_size is not set,
 * returns EBPO_E_ARGUMENT and writes nothing. */
#define EBPO_GIVE(type, out, filled) \
    ebpo_sized_give((out), (out)->struct_size, (filled), sizeof(type))

EBPO_MUST_USE ebpo_status ebpo_sized_take(void *own, size_t own_size, const void *given,
                                          size_t given_size, const char *type, ebpo_error *error);
EBPO_MUST_USE ebpo_status ebpo_sized_check(size_t size, const char *type, ebpo_error *error);
ebpo_status ebpo_sized_give(void *out, size_t out_size, const void *filled, size_t size);

#endif
