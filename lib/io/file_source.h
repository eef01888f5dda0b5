/* Reads complete files into memory, opens files below a folder, and recognises files of other kinds
 * by their first bytes. Files are read and not mapped, because the process would end if another
 * program shortened a mapped file. */
#ifndef EBPO_IO_FILE_SOURCE_H
#define EBPO_IO_FILE_SOURCE_H

#include <stdbool.h>
#include <stdint.h>

#include <ebpo/base.h>
#include <ebpo/workspace.h>

/* One regular file. Callers only read these members. */
typedef struct ebpo_whole_file {
    const uint8_t *data;       /* [size] NULL until the file is loaded */
    uint64_t size;             /* bytes of the file; may be 0 */
    void *buffer;              /* allocated memory that holds `data`, or NULL */
    ebpo_workspace *workspace; /* workspace that contains `buffer`, or NULL */
    int fd;                    /* stays open, for ebpo_whole_file_unchanged */
    /* times of the last change before opening. `fresh`: true if this change was so recent that a
     * further change may get the same times */
    int64_t mtime_s, mtime_ns, ctime_s, ctime_ns;
    bool fresh;
} ebpo_whole_file;

#define EBPO_WHOLE_FILE_INIT                       \
    {                                              \
        NULL, 0, NULL, NULL, -1, 0, 0, 0, 0, false \
    }

/* Opens the file at `path`, without reading its bytes. Returns EBPO_E_IO if the file is missing,
 * may not be read, or is not a regular file (the size of a pipe is not known). On failure *out is
 * EBPO_WHOLE_FILE_INIT. */
EBPO_MUST_USE ebpo_status ebpo_whole_file_open(ebpo_whole_file *out, const char *path,
                                               ebpo_error *error);

/* Same as ebpo_whole_file_open, for an open descriptor. The descriptor is closed together with the
 * file, or on failure. `path` is for messages. */
EBPO_MUST_USE ebpo_status ebpo_whole_file_take(ebpo_whole_file *out, int fd, const char *path,
                                               ebpo_error *error);

/* Reads all bytes of the file into an array of `workspace` (NULL: into memory), which is freed with
 * the file. file->data is then not NULL. Reports the stage "reading" to `progress`, which may be
 * NULL. EBPO_E_IO: the file has become shorter. EBPO_E_LIMIT: the file is larger than an array may
 * be (2 GiB on 32-bit machines). */
EBPO_MUST_USE ebpo_status ebpo_whole_file_load(ebpo_whole_file *file, ebpo_workspace *workspace,
                                               unsigned threads, const ebpo_progress *progress,
                                               const char *path, ebpo_error *error);

/* Reads some bytes of the file, whether it is loaded or not; errors as for ebpo_whole_file_load. */
EBPO_MUST_USE ebpo_status ebpo_whole_file_read(const ebpo_whole_file *file, uint64_t at, void *to,
                                               uint64_t bytes, const char *path, ebpo_error *error);

/* Returns EBPO_E_IO if the file has changed since opening, because the bytes that were read may be
 * a mixture of two versions. Compares the size and the time of the last change. If this time is not
 * reliable and the file is loaded, also compares the content with `data`. A file that is renamed to
 * `path` does not count as a change, because `file` still reads the old file. */
EBPO_MUST_USE ebpo_status ebpo_whole_file_unchanged(const ebpo_whole_file *file, const char *path,
                                                    ebpo_error *error);

/* Closes the file and frees its data. Does nothing on EBPO_WHOLE_FILE_INIT. */
void ebpo_whole_file_close(ebpo_whole_file *file);

/* Returns the part of `path` after the last '/'; points into `path`. */
const char *ebpo_path_name(const char *path);

/* Finds the absolute path of an output file, which need not exist. Symbolic links to folders are
 * resolved. The caller frees *out. EBPO_E_IO: `path` ends with '/', or its folder cannot be used.
 * EBPO_E_MEMORY. */
EBPO_MUST_USE ebpo_status ebpo_target_path(const char *path, char **out, ebpo_error *error);

/* Opens a file below a folder for reading. Never opens a file outside the folder, even if another
 * program changes names meanwhile. Does not wait if the file is a pipe. Returns a descriptor, or -1
 * with errno; EXDEV: the name leads out of the folder. Symbolic links to files below the folder are
 * followed, except on systems that cannot check a link while opening it (Linux before 5.6). Any
 * thread may call this function. */
int ebpo_open_below(const char *folder, const char *name);

/* Recognises files of other kinds that users pass as meshes or models by mistake. Returns a
 * description and a remedy, which follow the file's name in a message, such as "is compressed by
 * gzip; ...". Returns NULL if no kind is recognised. A binary STL file may begin with any bytes, so
 * check for binary STL before calling this function. */
const char *ebpo_wrong_kind_of_file(const uint8_t *data, uint64_t size);

/* Returns true if the first 512 bytes contain no control characters except white space. Returns
 * false if there are no bytes. */
bool ebpo_bytes_are_text(const uint8_t *data, uint64_t size);

#endif
