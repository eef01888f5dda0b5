/* Opening files that other programs have laid out: what they have is written anew through libhdf5,
 * in a process of its own, and the copy opened as every other file. */
#include <errno.h>
#include <fcntl.h>
#include <limits.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

#include "core/alloc.h"
#include "core/error.h"
#include "core/fp_env.h"
#include "core/sized.h"
#include "format/chunk_layout.h"
#include "hdf5_write/compat.h"
#include "hdf5_read/head.h"
#include "io/http_source.h"
#include "io/byte_source.h"

enum { PIECE = 4 << 20, BYTES_A_SECOND = 4 << 20 };

/* A file with a name for libhdf5, until that has opened it. */
typedef struct temporary {
    int fd;
    char name[PATH_MAX];
} temporary;

static ebpo_status make_temporary(temporary *t, const char *shown, ebpo_error *error)
{
    const char *folder = getenv("TMPDIR");
    snprintf(t->name, sizeof t->name, "%s/.ebpo-compat-XXXXXX",
             folder && *folder ? folder : "/tmp");
    t->fd = mkostemp(t->name, O_CLOEXEC);
    return t->fd >= 0 ? EBPO_OK
                      : ebpo_fail_errno(error, shown, "its copy could not be made in TMPDIR");
}

static void remove_temporary(temporary *t)
{
    if (t->fd < 0)
        return;
    unlink(t->name); /* unless that has happened */
    close(t->fd);
}

static ebpo_status write_piece(int fd, const char *shown, uint64_t at, const uint8_t *data,
                               uint64_t bytes, ebpo_error *error)
{
    while (bytes > 0) {
        ssize_t done = pwrite(fd, data, (size_t)bytes, (off_t)at);
        if (done < 0 && errno == EINTR)
            continue;
        if (done <= 0)
            return ebpo_fail_errno(error, shown, "its copy in TMPDIR could not be written");
        data += done;
        at += (uint64_t)done;
        bytes -= (uint64_t)done;
    }
    return EBPO_OK;
}

/* Everything of a URL, into a file without a name. */
static ebpo_status fetch_url(const char *url, const ebpo_http_options *http, const char *shown, int to,
                         ebpo_error *error)
{
    ebpo_source source = EBPO_SOURCE_INIT;
    ebpo_input input;
    ebpo_status status = ebpo_source_of_url(url, http, &source, error);
    if (status == EBPO_OK)
        status = ebpo_input_open(&input, &source, shown, error);
    if (status != EBPO_OK)
        return status;
    uint8_t *piece = ebpo_alloc(PIECE, 1);
    if (!piece)
        status = ebpo_fail_memory(error, PIECE);
    for (uint64_t at = 0; at < source.size && status == EBPO_OK; at += PIECE) {
        uint64_t bytes = source.size - at < PIECE ? source.size - at : PIECE;
        status = ebpo_input_read(&input, at, bytes, piece, error);
        if (status == EBPO_OK)
            status = write_piece(to, shown, at, piece, bytes, error);
    }
    free(piece);
    ebpo_input_close(&input);
    return status;
}

/* The name under which libhdf5 finds the file, and its bytes. */
static ebpo_status find_from(const char *path, const ebpo_http_options *http, const char *shown,
                             temporary *fetched, const char **from, uint64_t *bytes,
                             ebpo_error *error)
{
    struct stat facts;
    ebpo_status status = EBPO_OK;
    if (ebpo_is_url(path))
        status = make_temporary(fetched, shown, error);
    if (status == EBPO_OK && ebpo_is_url(path))
        status = fetch_url(path, http, shown, fetched->fd, error);
    *from = ebpo_is_url(path) ? fetched->name : path;
    if (status == EBPO_OK && (stat(*from, &facts) != 0 || !S_ISREG(facts.st_mode)))
        return ebpo_fail_errno(error, shown, "cannot be opened");
    if (status == EBPO_OK)
        *bytes = (uint64_t)facts.st_size;
    return status;
}

/* The copy by its descriptor, which stays the caller's; and whether it is what the head says. */
static ebpo_status open_copy(int to, const char *shown, const ebpo_compat_options *o,
                             ebpo_file **out, ebpo_error *error)
{
    char name[32];
    ebpo_source source = EBPO_SOURCE_INIT;
    ebpo_read_options read = EBPO_READ_OPTIONS_INIT;
    ebpo_open_options open = EBPO_OPEN_OPTIONS_INIT;
    read.threads = o->threads;
    open.source = &source;
    open.most_expansion = o->most_expansion;
    snprintf(name, sizeof name, "/dev/fd/%d", to);
    ebpo_status status = ebpo_source_of_path(&source, name, error);
    if (status == EBPO_OK)
        status = ebpo_open_with(shown, &open, out, error);
    if (status == EBPO_OK)
        status = ebpo_file_check_content(*out, &read, error);
    if (status != EBPO_OK) {
        ebpo_close(*out);
        *out = NULL;
    }
    return status;
}

/* Returns whether the copy lacks what an error is about. */
static bool copy_lacks(int copy, const char *shown, const char *object)
{
    char name[32];
    ebpo_source source = EBPO_SOURCE_INIT;
    ebpo_input input;
    ebpo_head head = EBPO_HEAD_INIT;
    snprintf(name, sizeof name, "/dev/fd/%d", copy);
    if (!*object || ebpo_source_of_path(&source, name, NULL) != EBPO_OK ||
        ebpo_input_open(&input, &source, shown, NULL) != EBPO_OK)
        return false;
    ebpo_status status = ebpo_head_open(&head, &input, NULL);
    bool absent = status == EBPO_OK && ebpo_head_look(&head, object) == EBPO_HEAD_ABSENT;
    (void)!ebpo_head_close(&head, status, NULL);
    ebpo_input_close(&input);
    return absent;
}

static ebpo_status open_foreign(const char *path, const ebpo_compat_options *o, ebpo_file **out,
                                ebpo_error *error)
{
    enum { HEAD_MORE = 64 << 20 };
    char redacted[EBPO_SHOWN_BYTES];
    const char *shown = ebpo_is_url(path) ? ebpo_url_redact(path, redacted, sizeof redacted) : path;
    ebpo_apart_limits limits = { o->memory_bytes, HEAD_MORE, o->seconds };
    temporary fetched = { .fd = -1 }, copy = { .fd = -1 };
    const char *from = NULL;
    uint64_t bytes = 0;
    ebpo_status status = find_from(path, o->http, shown, &fetched, &from, &bytes, error);
    if (status == EBPO_OK)
        status = make_temporary(&copy, shown, error);
    limits.file_bytes += 2 * bytes;
    if (!limits.seconds) /* decoding and encoding take about a twentieth of a second for a MiB */
        limits.seconds = 60 + (unsigned)(bytes / BYTES_A_SECOND);
    ebpo_error left_out = EBPO_ERROR_INIT, why = EBPO_ERROR_INIT;
    if (status == EBPO_OK)
        status = ebpo_h5_clean_copy(from, fetched.fd >= 0, copy.name, shown,
                                    ebpo_rows_of_foreign_chunk, &limits, &left_out, error);
    if (status == EBPO_OK && open_copy(copy.fd, shown, o, out, &why) != EBPO_OK)
        status = ebpo_fail_with(error, *left_out.message && copy_lacks(copy.fd, shown, why.object)
                                           ? &left_out /* it was there, and here is what it is */
                                           : &why);
    remove_temporary(&copy);
    remove_temporary(&fetched);
    return status;
}

ebpo_status ebpo_open_compat(const char *path, const ebpo_compat_options *options, ebpo_file **out,
                             ebpo_error *error)
{
    EBPO_DEFAULT_FP;
    ebpo_compat_options own = EBPO_COMPAT_OPTIONS_INIT;
    ebpo_error first = EBPO_ERROR_INIT;
    *out = NULL;
    ebpo_status status = options ? EBPO_TAKE(ebpo_compat_options, &own, options, error) : EBPO_OK;
    if (status != EBPO_OK)
        return status;
    own.memory_bytes = own.memory_bytes ? own.memory_bytes : UINT64_C(1) << 30;
    ebpo_open_options open = EBPO_OPEN_OPTIONS_INIT;
    open.most_expansion = own.most_expansion;
    open.http = own.http;
    status = ebpo_open_with(path, &open, out, &first);
    if (status == EBPO_E_UNSUPPORTED)
        return open_foreign(path, &own, out, error);
    return status == EBPO_OK ? EBPO_OK : ebpo_fail_with(error, &first);
}
