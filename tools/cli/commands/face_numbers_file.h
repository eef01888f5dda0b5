/* Numbers of faces in the whole, of a part: a .npy of integers, read where they are wanted. */
#ifndef EBPO_TOOLS_FACE_NUMBERS_FILE_H
#define EBPO_TOOLS_FACE_NUMBERS_FILE_H

#include <ebpo/base.h>
#include <sys/types.h>

typedef struct face_numbers_file {
    const char *path; /* the caller's */
    int fd;
    off_t begin;
    uint64_t count;
    unsigned bytes; /* of a number: 1, 2, 4 or 8 */
    bool is_signed, big_endian;
} face_numbers_file;

/* EBPO_E_FORMAT: it cannot be read as an array of integers with one dimension. Then, and after
 * face_numbers_close, it is not open (fd -1). */
EBPO_MUST_USE ebpo_status face_numbers_open(face_numbers_file *f, const char *path,
                                            ebpo_error *error);
void face_numbers_close(face_numbers_file *f);

/* numbers[face], for each of count, in their place. EBPO_E_FORMAT: there is no such number, or it
 * is negative; EBPO_E_IO. Threads: any. */
EBPO_MUST_USE ebpo_status face_numbers_get(const face_numbers_file *f, uint64_t *face,
                                           ebpo_error *error);

#endif
