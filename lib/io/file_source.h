/* Whole files for reading, files below a folder, and files of other kinds. They are read and not
 * mapped: a mapping of a file that another program shortens ends the process. */
#ifndef EBPO_IO_FILE_SOURCE_H
#define EBPO_IO_FILE_SOURCE_H

#include <stdbool.h>
#include <stdint.h>

#include <ebpo/base.h>
#include <ebpo/workspace.h>

/* One regular file. Fields are for reading; `size` may be 0, and `data` is NULL until it is loaded.
 */
typedef struct ebpo_whole_file {
    const uint8_t *data;
    uint64_t size;
    void *buffer; /* to free, or NULL */
    ebpo_workspace *workspace;
    int fd; /* stays open, for ebpo_whole_file_unchanged */
    /* when it was opened: times of its change, and whether it had just been changed, so that the
     * clock of such times could miss another change */
    int64_t mtime_s, mtime_ns, ctime_s, ctime_ns;
    bool fresh;
} ebpo_whole_file;

#define EBPO_WHOLE_FILE_INIT                       \
    {                                              \
        NULL, 0, NULL, NULL, -1, 0, 0, 0, 0, false \
    }

/* Opens `path` for reading, without its bytes. EBPO_E_IO when it is missing, may not be read, or is
 * no regular file (the end of a pipe is not known). On failure `out` is as EBPO_WHOLE_FILE_INIT. */
EBPO_MUST_USE ebpo_status ebpo_whole_file_open(ebpo_whole_file *out, const char *path,
                                               ebpo_error *error);

/* The same of a descriptor, which is closed with the file, or on failure; `path` for messages. */
EBPO_MUST_USE ebpo_status ebpo_whole_file_take(ebpo_whole_file *out, int fd, const char *path,
                                               ebpo_error *error);

/* Reads all bytes, into an array of `workspace` (NULL: into memory) that is freed with the file;
 * `data` is not NULL then. Stage "reading" of `progress`, which may be NULL. EBPO_E_IO when the
 * file has become shorter; EBPO_E_LIMIT when it is longer than an array may be, which on machines
 * of 32 bits is 2 GiB. */
EBPO_MUST_USE ebpo_status ebpo_whole_file_load(ebpo_whole_file *file, ebpo_workspace *workspace,
                                               unsigned threads, const ebpo_progress *progress,
                                               const char *path, ebpo_error *error);

/* Some of its bytes, loaded or not; as the above. */
EBPO_MUST_USE ebpo_status ebpo_whole_file_read(const ebpo_whole_file *file, uint64_t at, void *to,
                                               uint64_t bytes, const char *path, ebpo_error *error);

/* EBPO_E_IO when the file is not what it was at opening, by its size, by the time of its last
 * change or, where that could be set back or be too coarse to tell, by what it says now and `data`
 * (which has to be loaded then): what was read may belong to no one version. A file that another
 * one has been renamed over is not changed: this is the old one. */
EBPO_MUST_USE ebpo_status ebpo_whole_file_unchanged(const ebpo_whole_file *file, const char *path,
                                                    ebpo_error *error);

/* Closes and clears. Harmless on EBPO_WHOLE_FILE_INIT. */
void ebpo_whole_file_close(ebpo_whole_file *file);

/* The part of `path` behind the last '/'; points into `path`. */
const char *ebpo_path_name(const char *path);

/* Finds the absolute path, without symbolic links to folders, of a file that need not exist; free()
 * it. EBPO_E_IO: `path` ends with '/', or its folder cannot be used. EBPO_E_MEMORY. */
EBPO_MUST_USE ebpo_status ebpo_target_path(const char *path, char **out, ebpo_error *error);

/* Opening a file that lies below a folder, whatever happens to names meanwhile. */

/* A descriptor for reading, which does not wait for pipes; -1: as errno says, EXDEV where the name
 * leads out of the folder. Links are followed while they stay below it; where the system cannot
 * tell that at the moment of opening (Linux before 5.6), links are not followed at all. Any thread.
 */
int ebpo_open_below(const char *folder, const char *name);

/* Files of other kinds that are given as meshes or models by mistake. */

/* Names what the first bytes are and what to do about it, to follow a file's name in a message:
 * "is compressed by gzip; ...". NULL: nothing known. A binary STL file begins with any bytes: look
 * whether it is one first. */
const char *ebpo_foreign_bytes(const uint8_t *data, uint64_t size);

/* True for text: the first bytes hold no control characters but white space. */
bool ebpo_bytes_are_text(const uint8_t *data, uint64_t size);

#endif
