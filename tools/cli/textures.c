/* Reads and writes the images of textures. Row i of each array about images is for image i. */
#include "cli/textures.h"

#include <errno.h>
#include <fcntl.h>
#include <inttypes.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

/* NAMES to IMAGES: indices in textures.list. DIGEST: number of bytes of a digest. */
enum { NAMES, USES, DIGESTS, IMAGES, DIGEST = 32 };

/* The n bytes at s. */
typedef struct span {
    const char *s;
    uint64_t n;
} span;

/* Returns the bytes of a row in one of the arrays; empty if the array was not read. */
static span list_of(const textures *t, int which, uint64_t row)
{
    const ebpo_attribute_values *v = &t->list[which];
    uint64_t from = row * t->columns[which], to = from + t->columns[which];
    if (v->ends) {
        from = row ? v->ends[row - 1] : 0;
        to = v->ends[row];
    }
    return v->values && to <= v->count ? (span){ (const char *)v->values + from, to - from }
                                       : (span){ "", 0 };
}

/* Returns the index of an attribute in textures.list; -1: the attribute is not about images. */
static int which_of(const ebpo_attribute_facts *a)
{
    static const char *const names[TEXTURE_ARRAYS] = { "name", "use", "sha256", "bytes" };
    if (strcmp(a->element, "ebpo:texture") != 0 || a->type != EBPO_ATTRIBUTE_UINT8 || !a->list)
        return -1;
    for (int i = 0; i < TEXTURE_ARRAYS; i++)
        if (strcmp(a->names, names[i]) == 0)
            return i;
    return -1;
}

bool textures_embedded(const ebpo_file *file)
{
    ebpo_attribute_facts facts = EBPO_ATTRIBUTE_FACTS_INIT;
    bool found = false;
    for (unsigned n = 0; !found && ebpo_file_attribute(file, n, &facts); n++)
        found = which_of(&facts) == IMAGES;
    return found;
}

ebpo_status textures_read(textures *out, const ebpo_file *file, bool bytes, ebpo_error *error)
{
    ebpo_attribute_facts a = EBPO_ATTRIBUTE_FACTS_INIT;
    ebpo_status status = EBPO_OK;
    memset(out, 0, sizeof *out);
    for (unsigned n = 0; status == EBPO_OK && ebpo_file_attribute(file, n, &a); n++) {
        int i = which_of(&a);
        if (i < 0 || out->list[i].values)
            continue;
        out->count = a.rows;
        out->columns[i] = a.columns;
        out->embedded = out->embedded || i == IMAGES;
        if (i != IMAGES || bytes)
            status = ebpo_file_read_attribute(file, n, NULL, &out->list[i], error);
        else /* images may be large: only their presence is read */
            status = ebpo_file_attribute_ends(file, n, NULL, &out->list[i], error);
    }
    if (status != EBPO_OK)
        textures_free(out);
    return status;
}

void textures_free(textures *t)
{
    for (int i = 0; i < TEXTURE_ARRAYS; i++)
        ebpo_attribute_values_free(&t->list[i]);
    memset(t, 0, sizeof *t);
}

bool textures_same(const ebpo_file *a, const ebpo_file *b)
{
    ebpo_error error = EBPO_ERROR_INIT;
    textures x = { 0 }, y = { 0 };
    bool equal = textures_read(&x, a, false, &error) != EBPO_OK ||
                 textures_read(&y, b, false, &error) != EBPO_OK;
    if (!equal) {
        equal = x.count == y.count && x.embedded == y.embedded;
        for (int i = 0; i < IMAGES && equal; i++)
            equal = x.list[i].count == y.list[i].count &&
                    (!x.list[i].count ||
                     memcmp(x.list[i].values, y.list[i].values, x.list[i].count) == 0);
    }
    textures_free(&x);
    textures_free(&y);
    return equal;
}

/* --- facts --- */

/* Returns the number of bytes of an image, even if the bytes were not read. */
static uint64_t byte_count(const textures *t, uint64_t row)
{
    const uint64_t *ends = t->list[IMAGES].ends;
    return !ends ? t->columns[IMAGES] : row ? ends[row] - ends[row - 1] : ends[0];
}

/* Returns true if the file has the bytes of the image. A row with a digest but without bytes is an
 * image that was not embedded, or an empty image file. The digest of an empty file is
 * digest_of_nothing. */
static bool is_kept(const textures *t, uint64_t row)
{
    static const char digest_of_nothing[] =
        "\xe3\xb0\xc4\x42\x98\xfc\x1c\x14\x9a\xfb\xf4\xc8\x99\x6f\xb9\x24"
        "\x27\xae\x41\xe4\x64\x9b\x93\x4c\xa4\x95\x99\x1b\x78\x52\xb8\x55";
    span digest = list_of(t, DIGESTS, row);
    return t->embedded && digest.n == DIGEST &&
           (byte_count(t, row) || memcmp(digest.s, digest_of_nothing, DIGEST) == 0);
}

/* Returns a zero-terminated copy without control characters; NULL when out of memory. */
static char *text_of(span s)
{
    char *text = strndup(s.s, s.n);
    for (char *c = text; c && *c; c++)
        if ((unsigned char)*c < ' ' || *c == 127)
            *c = *c == '\n' ? ';' : '?';
    return text;
}

/* Writes the digest in hexadecimal; "" when there is none. */
static void digest_of(const textures *t, uint64_t row, char hex[2 * DIGEST + 1])
{
    span s = list_of(t, DIGESTS, row);
    hex[0] = 0;
    for (int i = 0; s.n == DIGEST && i < DIGEST; i++)
        sprintf(hex + 2 * i, "%02x", (unsigned char)s.s[i]);
}

void textures_print(FILE *out, const textures *t)
{
    for (uint64_t i = 0; i < t->count; i++) {
        char hex[2 * DIGEST + 1], *name = text_of(list_of(t, NAMES, i)),
                                  *use = text_of(list_of(t, USES, i));
        digest_of(t, i, hex);
        fprintf(out, "  %s %s, %s%s%s%s%s\n", i ? "          " : "textures  ", name ? name : "?",
                hex[0] ? "sha256 " : "was not found", hex, use && *use ? ", " : "", use ? use : "",
                is_kept(t, i) ? ", kept"
                : hex[0]      ? ", only name and digest are kept"
                              : "");
        free(name);
        free(use);
    }
}

void textures_json(json *j, const textures *t)
{
    json_array(j, "textures");
    for (uint64_t i = 0; i < t->count; i++) {
        char hex[2 * DIGEST + 1], *name = text_of(list_of(t, NAMES, i)),
                                  *use = text_of(list_of(t, USES, i));
        digest_of(t, i, hex);
        json_object(j, NULL);
        json_text(j, "name", name ? name : "");
        json_text(j, "use", use ? use : "");
        json_text(j, "sha256", hex);
        json_bool(j, "kept", is_kept(t, i));
        json_end(j);
        free(name);
        free(use);
    }
    json_end(j);
}

/* --- files --- */

static ebpo_status fail_file(ebpo_error *error, ebpo_status status, const char *path,
                             const char *what)
{
    error->status = status;
    snprintf(error->message, sizeof error->message, "%s: %s", path, what);
    return status;
}

static ebpo_status fail_system(ebpo_error *error, const char *path)
{
    return fail_file(error, EBPO_E_IO, path, strerror(errno));
}

/* Returns true if the name leads to a file below the folder. This is the case if the name has no
 * drive letter, no word between slashes is empty or "..", and the last word is not ".". */
static bool stays_below(const char *name)
{
    size_t n = 0;
    if (*name && name[1] == ':')
        return false;
    for (const char *c = name;; c += n + 1) {
        n = strcspn(c, "/");
        if (n == 0 || (n == 2 && c[0] == '.' && c[1] == '.') || (n == 1 && *c == '.' && !c[n]))
            return false;
        if (!c[n])
            return true;
    }
}

/* Removes repeated slashes (material files double their backslashes) and words ".". */
static void normalize_name(char *name)
{
    char *to = name;
    for (const char *c = name; *c; c++) {
        bool begins = to > name && to[-1] == '/';
        if (begins && *c == '/')
            continue;
        if ((begins || to == name) && c[0] == '.' && c[1] == '/' && c[2] && c[2] != '/') {
            c++;
            continue;
        }
        *to++ = *c;
    }
    *to = 0;
}

/* Returns the name with slashes in place of backslashes. Returns NULL when out of memory, and if
 * the name is not that of a file below the folder. */
static char *safe_name(span s)
{
    char *name = strndup(s.s, s.n);
    bool is_printable = name && strlen(name) == s.n;
    for (char *c = name; is_printable && *c; c++) {
        if (*c == '\\')
            *c = '/';
        is_printable = (unsigned char)*c >= ' ' && *c != 127;
    }
    if (is_printable)
        normalize_name(name);
    if (is_printable && stays_below(name))
        return name;
    free(name);
    return NULL;
}

/* Opens the folder of the file `name`, and creates the folder if needed. Does not follow links.
 * `top`: descriptor of the folder to which `name` is relative. *last: the file's name without
 * folders. Returns the folder's descriptor, or -1 with errno. */
static int open_folder(int top, char *name, char **last)
{
    int folder = dup(top);
    char *position = NULL, *word = strtok_r(name, "/", &position), *next;
    for (; folder >= 0 && (next = strtok_r(NULL, "/", &position)); word = next) {
        int below = mkdirat(folder, word, 0777) == 0 || errno == EEXIST
                        ? openat(folder, word, O_RDONLY | O_DIRECTORY | O_NOFOLLOW | O_CLOEXEC)
                        : -1;
        int why = errno;
        close(folder);
        errno = why;
        folder = below;
    }
    *last = word;
    return folder;
}

static bool write_all(int fd, span bytes)
{
    while (bytes.n) {
        ssize_t n = write(fd, bytes.s, bytes.n < 1 << 30 ? (size_t)bytes.n : 1 << 30);
        if (n < 0 && errno != EINTR)
            return false;
        if (n > 0)
            bytes = (span){ bytes.s + n, bytes.n - (uint64_t)n };
    }
    return true;
}

/* Opens a file without a name. Returns a negative number if such files are not supported, or if
 * /proc, which link_file needs, is missing. */
static int open_unnamed(int folder)
{
#ifdef EBPO_HAVE_O_TMPFILE
    if (access("/proc/self/fd", X_OK) == 0)
        return openat(folder, ".", O_TMPFILE | O_WRONLY | O_CLOEXEC, 0666);
#endif
    (void)folder;
    return -1;
}

/* Gives a complete file without a name its name, so that the name never refers to an incomplete
 * image. */
static bool link_file(int fd, int folder, const char *name)
{
    char path[64];
    snprintf(path, sizeof path, "/proc/self/fd/%d", fd);
    return linkat(AT_FDCWD, path, folder, name, AT_SYMLINK_FOLLOW) == 0;
}

/* Writes a new file. Fails with EEXIST if the file exists, and leaves it unchanged. */
static bool write_file(int top, char *name, span bytes)
{
    char *last;
    int folder = open_folder(top, name, &last);
    if (folder < 0)
        return false;
    int fd = open_unnamed(folder);
    bool named = fd < 0;
    if (named)
        fd = openat(folder, last, O_CREAT | O_EXCL | O_WRONLY | O_NOFOLLOW | O_CLOEXEC, 0666);
    bool complete = fd >= 0 && write_all(fd, bytes) && (fsync(fd) == 0 || errno == EINVAL),
         /* this call has made the file of this name */
        made = named || (complete && link_file(fd, folder, last));
    complete = complete && made;
    int why = errno;
    if (fd >= 0 && close(fd) != 0 && complete) {
        complete = false;
        why = errno;
    }
    if (fd >= 0 && !complete && made)
        unlinkat(folder, last, 0);
    close(folder);
    errno = why;
    return complete;
}

/* Checks the names of all images in the file, before anything is written. */
static ebpo_status check_names(const textures *t, ebpo_error *error)
{
    uint64_t kept = 0;
    for (uint64_t i = 0; i < t->count; i++) {
        if (!is_kept(t, i))
            continue;
        kept++;
        char *name = safe_name(list_of(t, NAMES, i)), *shown = text_of(list_of(t, NAMES, i));
        ebpo_status status =
            name ? EBPO_OK
                 : fail_file(error, EBPO_E_FORMAT, shown ? shown : "?",
                             "the name of this image leads out of the folder; nothing was written");
        free(name);
        free(shown);
        if (status != EBPO_OK)
            return status;
    }
    return kept ? EBPO_OK
                : fail_file(
                      error, EBPO_E_ABSENT, "no images",
                      "the file has no bytes of images; ebpo convert --embed-textures keeps them");
}

static bool spans_equal(span a, span b)
{
    return a.n == b.n && (!a.n || memcmp(a.s, b.s, a.n) == 0);
}

/* Returns true if an earlier row has the same image, and the names of both rows lead to the same
 * file. The names may be spelled differently. */
static bool is_repeated(const textures *t, uint64_t row)
{
    char *name = safe_name(list_of(t, NAMES, row));
    bool repeated = false;
    for (uint64_t i = 0; i < row && name && !repeated; i++) {
        if (!is_kept(t, i) || !spans_equal(list_of(t, IMAGES, i), list_of(t, IMAGES, row)))
            continue;
        char *before = safe_name(list_of(t, NAMES, i));
        repeated = before && strcmp(before, name) == 0;
        free(before);
    }
    free(name);
    return repeated;
}

/* Writes an image to a file. Increases *written if the file is new. */
static ebpo_status write_one(const textures *t, uint64_t row, int top, uint64_t *written,
                             ebpo_error *error)
{
    char *name = safe_name(list_of(t, NAMES, row)), *shown = text_of(list_of(t, NAMES, row));
    ebpo_status status = EBPO_OK;
    if (!name || !shown)
        status = fail_file(error, EBPO_E_MEMORY, "out of memory",
                           "the name of an image could not be copied");
    else if (write_file(top, name, list_of(t, IMAGES, row)))
        ++*written;
    else if (errno != EEXIST || !is_repeated(t, row))
        status = fail_system(error, shown);
    free(name);
    free(shown);
    return status;
}

ebpo_status textures_write(const textures *t, const char *folder, uint64_t *written,
                           ebpo_error *error)
{
    *written = 0;
    ebpo_status status = check_names(t, error);
    if (status != EBPO_OK)
        return status;
    if (mkdir(folder, 0777) != 0 && errno != EEXIST)
        return fail_system(error, folder);
    int top = open(folder, O_RDONLY | O_DIRECTORY | O_CLOEXEC);
    if (top < 0)
        return fail_system(error, folder);
    for (uint64_t i = 0; i < t->count && status == EBPO_OK; i++)
        if (is_kept(t, i))
            status = write_one(t, i, top, written, error);
    close(top);
    return status;
}
