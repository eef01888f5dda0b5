/* Reads face indices. A catalogue can cut a model into several files (parts). A face of a part has
 * an index in this part and an index in the whole model. A .npy file lists, for each face of a
 * part, its index in the whole model. The list consists of integers and has one dimension (NumPy's
 * format, versions 1 to 3). Any thread may read single indices when they are needed.
 *
 * The file is untrusted input, as is the catalogue that refers to it. Its header is read once, when
 * the file is opened. The header states the type, the byte order and the number of indices; the
 * file must be long enough for this number. If an index is negative or beyond 2^63, reading this
 * index fails. */
#include <errno.h>
#include <fcntl.h>
#include <inttypes.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

#include "catalogue/catalogue_in.h"
#include "core/error.h"

/* Maximum number of bytes from the beginning of the file to the end of the header. */
enum { HEAD_MAX = 4096 };

static ebpo_status bad_numbers(const ebpo_catalogue_numbers *f, ebpo_error *error, const char *what)
{
    return ebpo_fail_file(error, EBPO_E_FORMAT, f->path,
                          "is not a .npy array of integers with one dimension: %s", what);
}

/* Returns the text after `key` and a colon in the header, or NULL if the header does not have the
 * key. */
static const char *value_of(const char *head, const char *key)
{
    const char *at = strstr(head, key);
    at = at ? strchr(at + strlen(key), ':') : NULL;
    return at ? at + 1 + strspn(at + 1, " ") : NULL;
}

/* Reads a type such as '<i8' at `at`. Reads nothing beyond the end of the header. */
static bool read_type(ebpo_catalogue_numbers *f, const char *at)
{
    if (!at || (*at != '\'' && *at != '"') || strlen(at) < sizeof "'<i8'" - 1 ||
        !strchr("<>|=", at[1]) || !strchr("iu", at[2]) || !strchr("1248", at[3]) || at[4] != *at)
        return false;
    f->big_endian = at[1] == '>';
    f->is_signed = at[2] == 'i';
    f->bytes = (unsigned)(at[3] - '0');
    return true;
}

/* Reads the shape at `at`, which must be (N,). */
static bool read_shape(ebpo_catalogue_numbers *f, const char *at)
{
    char *end;
    if (!at || *at != '(' || at[1] < '0' || at[1] > '9')
        return false;
    errno = 0;
    f->count = strtoull(at + 1, &end, 10);
    end += strspn(end, " ");
    return errno == 0 && *end == ',' && end[1 + strspn(end + 1, " ")] == ')';
}

/* Reads the header. Its length is stored in two bytes in version 1, and in four bytes in versions 2
 * and 3. */
static ebpo_status read_head(ebpo_catalogue_numbers *f, ebpo_error *error)
{
    char text[HEAD_MAX + 1];
    struct stat st;
    ssize_t received = pread(f->fd, text, HEAD_MAX, 0);
    const unsigned char *b = (const unsigned char *)text;
    if (received < 0)
        return ebpo_fail_errno(error, f->path, "cannot be read");
    if (received < 12 || memcmp(text, "\x93NUMPY", 6) != 0 || b[6] < 1 || b[6] > 3)
        return bad_numbers(f, error, "invalid start of the file");
    size_t first = b[6] == 1 ? 10 : 12, length = (size_t)b[8] | (size_t)b[9] << 8;
    if (b[6] > 1)
        length |= (size_t)b[10] << 16 | (size_t)b[11] << 24;
    if (length > (size_t)received - first)
        return bad_numbers(f, error, "the header is too long");
    text[first + length] = 0;
    if (strlen(text + first) != length || !read_type(f, value_of(text + first, "'descr'")) ||
        !read_shape(f, value_of(text + first, "'shape'")))
        return bad_numbers(f, error, "unsupported header");
    f->begin = (int64_t)(first + length);
    if (fstat(f->fd, &st) != 0 || f->count > (uint64_t)(st.st_size - f->begin) / f->bytes)
        return bad_numbers(f, error, "the file is shorter than its header requires");
    return EBPO_OK;
}

ebpo_status ebpo_catalogue_numbers_open(ebpo_catalogue_numbers *f, const char *path,
                                        ebpo_error *error)
{
    struct stat st;
    /* O_NONBLOCK: the call does not wait for the writer of a pipe */
    int fd = open(path, O_RDONLY | O_CLOEXEC | O_NONBLOCK | O_NOCTTY);
    *f = (ebpo_catalogue_numbers){ .path = path, .fd = fd };
    if (fd < 0)
        return ebpo_fail_file(error,
                              errno == ENOENT || errno == ENOTDIR ? EBPO_E_FORMAT : EBPO_E_IO, path,
                              "cannot be read as a .npy file: %s", strerror(errno));
    if (fstat(fd, &st) != 0 || !S_ISREG(st.st_mode)) {
        ebpo_catalogue_numbers_close(f);
        return ebpo_fail_file(error, EBPO_E_FORMAT, path,
                              "cannot be read as a .npy file: not a regular file");
    }
    ebpo_status status = read_head(f, error);
    if (status != EBPO_OK)
        ebpo_catalogue_numbers_close(f);
    return status;
}

void ebpo_catalogue_numbers_close(ebpo_catalogue_numbers *f)
{
    if (f->fd >= 0)
        close(f->fd);
    f->fd = -1;
}

ebpo_status ebpo_catalogue_numbers_get(const ebpo_catalogue_numbers *f, uint64_t *face,
                                       ebpo_error *error)
{
    unsigned char b[8];
    uint64_t number = 0;
    if (*face >= f->count)
        return ebpo_fail_file(error, EBPO_E_FORMAT, f->path, "has no index for face %" PRIu64,
                              *face);
    if (pread(f->fd, b, f->bytes, (off_t)(f->begin + (int64_t)(*face * f->bytes))) !=
        (ssize_t)f->bytes)
        return ebpo_fail_file(error, EBPO_E_IO, f->path,
                              "the index for face %" PRIu64 " cannot be read", *face);
    for (unsigned i = 0; i < f->bytes; i++)
        number = number << 8 | b[f->big_endian ? i : f->bytes - 1 - i];
    if ((f->is_signed || f->bytes == 8) && number >> (8 * f->bytes - 1))
        return ebpo_fail_file(error, EBPO_E_FORMAT, f->path,
                              "the index for face %" PRIu64 " is negative or beyond 2^63", *face);
    *face = number;
    return EBPO_OK;
}
