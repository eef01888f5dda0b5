/* Whole files for reading: mapped where the system can, else read into memory. */
#ifndef EBPO_IO_FILE_H
#define EBPO_IO_FILE_H

#include <ebpo/base.h>

/* The bytes of one regular file. Fields are for reading; `data` is never NULL after a successful
 * open, `size` may be 0. */
typedef struct ebpo_whole_file {
    const uint8_t *data;
    uint64_t size;
    void *mapped;    /* to unmap, or NULL */
    void *buffer;    /* to free, or NULL */
    int fd;          /* stays open, for ebpo_whole_file_unchanged */
    int64_t mtime_s; /* when it was opened */
    int64_t mtime_ns;
} ebpo_whole_file;

#define EBPO_WHOLE_FILE_INIT          \
    {                                 \
        NULL, 0, NULL, NULL, -1, 0, 0 \
    }

/* Opens `path` for reading. EBPO_E_IO when it is missing, may not be read, or is no regular file (a
 * pipe cannot be mapped, and its end is not known). On failure `out` is as EBPO_WHOLE_FILE_INIT. A
 * mapped file that another program shortens while it is being read raises SIGBUS, as with every
 * mapping. */
EBPO_MUST_USE ebpo_status ebpo_whole_file_open(ebpo_whole_file *out, const char *path,
                                               ebpo_error *error);

/* The same of a descriptor, which is closed with the file, or on failure; `path` for messages. */
EBPO_MUST_USE ebpo_status ebpo_whole_file_take(ebpo_whole_file *out, int fd, const char *path,
                                               ebpo_error *error);

/* EBPO_E_IO when size or time of change are not what they were at opening: what was read then
 * belongs to no one version. */
EBPO_MUST_USE ebpo_status ebpo_whole_file_unchanged(const ebpo_whole_file *file, const char *path,
                                                    ebpo_error *error);

/* Closes and clears. Harmless on EBPO_WHOLE_FILE_INIT. */
void ebpo_whole_file_close(ebpo_whole_file *file);

/* The part of `path` behind the last '/'; points into `path`. */
const char *ebpo_path_name(const char *path);

#endif
