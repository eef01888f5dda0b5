/* Structs that begin with their size (ebpo/base.h): taking the caller's options, and filling in
 * what the caller has made room for, whichever version of the header the caller was compiled with.
 */
#ifndef EBPO_CORE_SIZED_H
#define EBPO_CORE_SIZED_H

#include <ebpo/base.h>

/* Takes options into `own` (a pointer), which holds the usual ones; given NULL, it keeps them.
 * EBPO_E_ARGUMENT: struct_size was never set; EBPO_E_UNSUPPORTED: something is set that this
 * version does not know. */
#define EBPO_TAKE(type, own, given, error)  \
    (!(given) ? EBPO_OK                     \
     : (given)->struct_size == sizeof(type) \
         ? (*(own) = *(given), EBPO_OK)     \
         : ebpo_sized_take((own), sizeof(type), (given), (given)->struct_size, #type, error))

/* EBPO_E_ARGUMENT when the caller's struct, to be filled in later, does not say its size. */
#define EBPO_CHECK_SIZED(type, out, error) ebpo_sized_check((out)->struct_size, #type, error)

/* Fills in as much of `filled` as the caller's struct has, and zeros beyond; the caller's size
 * stays. Nothing where no size was set. */
#define EBPO_GIVE(type, out, filled) \
    ebpo_sized_give((out), (out)->struct_size, (filled), sizeof(type))

EBPO_MUST_USE ebpo_status ebpo_sized_take(void *own, size_t own_size, const void *given,
                                          size_t given_size, const char *type, ebpo_error *error);
EBPO_MUST_USE ebpo_status ebpo_sized_check(size_t size, const char *type, ebpo_error *error);
ebpo_status ebpo_sized_give(void *out, size_t out_size, const void *filled, size_t size);

#endif
