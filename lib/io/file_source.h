/* Reads complete files into memory, opens files below a folder, and recognises files of other kinds
 * by their first bytes. Files are read and not mapped, because the process would end if another
 * program shortened a mapped file. */
#ifndef EBPO_IO_FILE_SOURCE_H
#define EBPO_IO_FILE_SOURCE_H

#include <stdbool.h>
#include <stdint.h>

#include <ebpo/base.h>
#include <ebpo/workspace.h>

/* One regular file. Fields are read-only; `size` may be 0, and `data` is NULL until the file is
 * loaded. */
typedef struct ebpo_whole_file {
    const uint8_t *data;
    uint64_t size;
    void *buffer; /* allocated memory that holds `data`, or NULL */
    ebpo_workspace *workspace;
    int fd; /* stays open, for ebpo_whole_file_unchanged */
    /* times of the last change, at opening. `fresh`: that change was so recent that a further
     * change may get the same times */
    int64_t mtime_s, mtime_ns, ctime_s, ctime_ns;
    bool fresh;
} ebpo_whole_file;

#define EBPO_WHOLE_FILE_INIT                       \
    {                                              \
        NULL, 0, NULL, NULL, -1, 0, 0, 0, 0, false \
    }

/* Opens `path` for reading, without reading its bytes. EBPO_E_IO when the file is missing, may not
 * be read, or is not a regular file (the size of a pipe is not known). On failure `out` is
 * EBPO_WHOLE_FILE_INIT. */
EBPO_MUST_USE ebpo_status ebpo_whole_file_open(ebpo_whole_file *out, const char *path,
                                               ebpo_error *error);

/* Same as ebpo_whole_file_open for a descriptor, which is closed with the file, or on failure.
 * `path` is for messages. */
EBPO_MUST_USE ebpo_status ebpo_whole_file_take(ebpo_whole_file *out, int fd, const char *path,
                                               ebpo_error *error);

/* Reads all bytes, into an array of `workspace` (NULL: into memory) that is freed with the file;
 * `data` is not NULL then. Reports the stage "reading" to `progress`, which may be NULL. EBPO_E_IO
 * when the file has become shorter; EBPO_E_LIMIT when the file is larger than an array may be (2
 * GiB on 32-bit machines). */
EBPO_MUST_USE ebpo_status ebpo_whole_file_load(ebpo_whole_file *file, ebpo_workspace *workspace,
                                               unsigned threads, const ebpo_progress *progress,
                                               const char *path, ebpo_error *error);

/* Reads some bytes of the file, whether it is loaded or not; errors as for ebpo_whole_file_load. */
EBPO_MUST_USE ebpo_status ebpo_whole_file_read(const ebpo_whole_file *file, uint64_t at, void *to,
                                               uint64_t bytes, const char *path, ebpo_error *error);

/* Returns EBPO_E_IO when the file has changed since opening: the bytes that were read may then
 * belong to no single version. Compares the size and the time of the last change. If this time is
 * not reliable, also compares the content with `data`, if the file is loaded. Renaming another file
 * to `path` is no change, because `file` still reads the old file. */
EBPO_MUST_USE ebpo_status ebpo_whole_file_unchanged(const ebpo_whole_file *file, const char *path,
                                                    ebpo_error *error);

/* Closes the file and frees its data. Harmless on EBPO_WHOLE_FILE_INIT. */
void ebpo_whole_file_close(ebpo_whole_file *file);

/* Returns the part of `path` after the last '/'; points into `path`. */
const char *ebpo_path_name(const char *path);

/* Finds the absolute path, without symbolic links to folders, of a file that need not exist; the
 * caller frees it. EBPO_E_IO: `path` ends with '/', or its folder cannot be used. EBPO_E_MEMORY. */
EBPO_MUST_USE ebpo_status ebpo_target_path(const char *path, char **out, ebpo_error *error);

/* Opens a file below a folder for reading. Never opens a file outside the folder, even if another
 * program changes names meanwhile. Opening does not wait for pipes. Returns a descriptor, or -1
 * with errno: EXDEV where the name leads out of the folder. Symbolic links are followed if they
 * lead to files below the folder. Where the system cannot check this while opening (Linux
 * before 5.6), no link is followed. Thread-safe. */
int ebpo_open_below(const char *folder, const char *name);

/* Recognises files of other kinds that are given as meshes or models by mistake. Returns a
 * description and a remedy, to follow the file's name in a message: "is compressed by gzip; ...".
 * NULL: not recognised. A binary STL file may begin with any bytes, so check first whether a file
 * is one. */
const char *ebpo_wrong_kind_of_file(const uint8_t *data, uint64_t size);

/* Returns true if the first bytes contain no control characters except white space. */
bool ebpo_bytes_are_text(const uint8_t *data, uint64_t size);

#endif
