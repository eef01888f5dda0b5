/* Recognises the format of points by the first bytes, and reads headers and complete inputs. */
#include <ebpo/mesh.h>
#include <ebpo/rows.h>
#include <inttypes.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

#include "cli/points_format.h"

enum { SIGNATURE_SIZE = 8 }; /* bytes of HDF5's signature */

static const char *const kind_words[] = { "points", "rays", "boxes" };

/* --- PLY --- */

static bool read_ply(points *p, points_block *b)
{
    ebpo_error error = EBPO_ERROR_INIT;
    if (p->kind != POINTS)
        return points_fault(b, 0,
                            "is a PLY file, which holds points; give %s as text or with --raw",
                            kind_words[p->kind]);
    if (!points_fill_all(p, b))
        return false;
    if (ebpo_points_parse_ply(p->unread, p->unread_count, p->name, &p->all_rows, &p->rows_total,
                              &error) != EBPO_OK) {
        fprintf(stderr, "ebpo %s: %s\n", p->command, error.message);
        p->failed = true;
        return false;
    }
    p->from_zero = true; /* messages count the vertices of a PLY from 0, as PLY files do */
    p->rows_known = true;
    return true;
}

/* --- NumPy arrays --- */

/* Returns the value that follows 'name': in the header, which is a Python dictionary. Returns NULL
 * if the name is missing. */
static const char *find_npy_value(const char *head, const char *name)
{
    const char *at = strstr(head, name);
    at = at ? strchr(at + strlen(name), ':') : NULL;
    while (at && (*++at == ' '))
        ;
    return at;
}

/* Reads a type such as '<f8'. Returns false for a type other than float64 and float32. */
static bool parse_npy_type(points *p, const char *descr)
{
    if (strnlen(descr, 5) < 5)
        return false; /* the header ends within the value */
    p->layout.big_endian = descr[1] == '>';
    p->layout.bytes = descr[3] == '4' ? 4 : 8;
    return strchr("<>", descr[1]) && descr[2] == 'f' && strchr("48", descr[3]) && descr[4] == '\'';
}

/* Reads a count of at most 18 digits, which cannot overflow, and the blanks around it. */
static bool read_npy_count(const char **at, uint64_t *count)
{
    enum { DIGITS_MAX = 18 };
    *at += strspn(*at, " ");
    size_t digits = strspn(*at, "0123456789");
    if (digits == 0 || digits > DIGITS_MAX)
        return false;
    *count = strtoull(*at, NULL, 10);
    *at += digits;
    *at += strspn(*at, " ");
    return true;
}

/* Reads "(N, 3)"; "(3,)" is one row. Allows blanks anywhere and a comma after the last number. */
static bool parse_npy_shape(points *p, const char *shape)
{
    uint64_t rows = 1, columns = 0;
    const char *at = shape + 1;
    if (*shape != '(' || !read_npy_count(&at, &columns) || *at++ != ',')
        return false;
    at += strspn(at, " ");
    if (*at != ')') {
        rows = columns;
        if (!read_npy_count(&at, &columns))
            return false;
        at += *at == ',';
        at += strspn(at, " ");
    }
    /* rays have six or seven columns, because tmax may be missing */
    if (*at != ')' || columns < (uint64_t)points_raw_width(p->kind) ||
        columns > (uint64_t)points_width(p->kind))
        return false;
    p->layout.per_row = (int)columns;
    p->rows_total = rows;
    p->rows_known = p->rows_stated = true;
    return true;
}

static bool parse_npy_header(points *p, points_block *b, const char *head)
{
    const char *descr = find_npy_value(head, "'descr'"),
               *order = find_npy_value(head, "'fortran_order'"),
               *shape = find_npy_value(head, "'shape'");
    if (!descr || !order || !shape)
        return points_fault(b, 0, "has no valid NumPy header");
    if (*descr == '[')
        return points_fault(b, 0,
                            "holds named fields; save "
                            "numpy.lib.recfunctions.structured_to_unstructured of it");
    if (*descr != '\'')
        return points_fault(b, 0, "has no valid NumPy header");
    if (!parse_npy_type(p, descr))
        return points_fault(b, 0, "holds numbers of type %.*s; give float64 or float32 (astype)",
                            (int)strcspn(descr + 1, "'") + 2, descr);
    if (strncmp(order, "False", 5) != 0)
        return points_fault(b, 0, "is stored column by column; save numpy.ascontiguousarray of it");
    if (!parse_npy_shape(p, shape))
        return points_fault(b, 0, "has the shape %.*s; %s are rows of %s",
                            (int)strcspn(shape, ")") + 1, shape, kind_words[p->kind],
                            p->kind == POINTS        ? "three"
                            : p->kind == POINTS_RAYS ? "six or seven"
                                                     : "six");
    return true;
}

/* Reads the signature, the version, the length of the header, and the header. */
static bool read_npy(points *p, points_block *b)
{
    enum { PREFIX_SIZE = 12, HEADER_MAX = 1 << 16 };
    char head[4096];
    while (p->unread_count < PREFIX_SIZE && !p->is_ended && points_fill(p, b))
        ;
    if (!b->failed && p->unread_count < PREFIX_SIZE)
        return points_fault(b, 0, "has no valid NumPy header");
    const uint8_t *u = (const uint8_t *)p->unread;
    size_t before = u[6] == 1 ? 10 : 12,
           length = u[6] == 1 ? (size_t)u[8] | (size_t)u[9] << 8
                              : (size_t)u[8] | (size_t)u[9] << 8 | (size_t)u[10] << 16;
    while (p->unread_count < before + length && length < sizeof head && !p->is_ended &&
           points_fill(p, b))
        ;
    if (b->failed)
        return false;
    if (u[6] < 1 || u[6] > 3)
        return points_fault(b, 0, "is a NumPy array of version %d.%d; supported: 1.0 to 3.0", u[6],
                            u[7]);
    if (p->unread_count < before + length || length >= sizeof head)
        return points_fault(b, 0, "has no valid NumPy header");
    memcpy(head, p->unread + before, length);
    head[length] = 0;
    for (char *quote = head; (quote = strchr(quote, '"'));)
        *quote = '\''; /* Python writes ' or " */
    points_drop(p, before + length);
    p->raw = true;
    return parse_npy_header(p, b, head);
}

/* --- HDF5 datasets --- */

/* Returns the last colon of "FILE.h5:/path" that a slash follows; NULL: there is none. */
static const char *dataset_colon(const char *path)
{
    const char *colon = NULL;
    for (const char *at = strstr(path, ":/"); at; at = strstr(at + 1, ":/"))
        colon = at;
    return colon;
}

bool points_is_dataset(const char *path)
{
    struct stat st;
    return dataset_colon(path) && stat(path, &st) != 0;
}

bool points_file(const char *path, struct stat *st, const char **dataset)
{
    const char *colon = points_is_dataset(path) ? dataset_colon(path) : path + strlen(path);
    char *file = strndup(path, (size_t)(colon - path));
    bool found = file && stat(file, st) == 0;
    free(file);
    *dataset = colon;
    return found;
}

/* Reads the rows [first, end) of a dataset, and sets *total to the dataset's number of rows. */
static ebpo_status read_dataset(points *p, const char *file, const char *name, uint64_t first,
                                uint64_t end, uint64_t *total, ebpo_error *error)
{
    free(p->all_rows);
    return ebpo_rows_read_part(file, name, (unsigned)points_raw_width(p->kind),
                               (unsigned)points_width(p->kind), p->tmax, first, end - first,
                               &p->all_rows, &p->rows_total, total, error);
}

static ebpo_status read_part(points *p, const char *file, const char *name, uint64_t number,
                             uint64_t part_count, ebpo_error *error)
{
    uint64_t first = 0, end = 0, total, total_again;
    /* If there are several parts, the first call reads only the number of rows. */
    ebpo_status status =
        read_dataset(p, file, name, 0, part_count > 1 ? 0 : UINT64_MAX, &total, error);
    if (status != EBPO_OK || part_count == 1)
        return status;
    p->all_rows_are_part = true;
    p->row = first = points_share(total, number, part_count);
    end = points_share(total, number + 1, part_count);
    status = read_dataset(p, file, name, first, end, &total_again, error);
    if (status == EBPO_OK && (total_again != total || p->rows_total != end - first)) {
        snprintf(error->message, sizeof error->message, "%s: changed while it was read", file);
        status = EBPO_E_IO;
    }
    return status;
}

bool points_open_dataset(points *p, const char *path, uint64_t number, uint64_t part_count)
{
    const char *colon = dataset_colon(path);
    char *file = strndup(path, (size_t)(colon - path));
    ebpo_error error = { .status = EBPO_E_MEMORY };
    p->is_begun = p->rows_known = true;
    p->failed = !file || read_part(p, file, colon + 1, number, part_count, &error) != EBPO_OK;
    free(file);
    if (p->failed)
        fprintf(stderr, "ebpo %s: %s\n", p->command,
                error.message[0] ? error.message : ebpo_status_name(error.status));
    return !p->failed;
}

/* --- all formats --- */

static bool begins_with(const points *p, const char *with, size_t count)
{
    return p->unread_count >= count && memcmp(p->unread, with, count) == 0;
}

/* Returns true if the input is a PLY. Raw doubles may begin with the bytes "ply\n", too. But then
 * letters are unlikely to follow, because they would make the first double about 1e219 or 1e243. */
static bool begins_as_ply(const points *p)
{
    if (!begins_with(p, "ply\n", 4) && !begins_with(p, "ply\r", 4) &&
        (p->raw || (!begins_with(p, "ply ", 4) && !begins_with(p, "ply\t", 4))))
        return false;
    for (size_t i = 5; i < SIGNATURE_SIZE && p->raw; i++)
        if (i >= p->unread_count || p->unread[i] < 'a' || p->unread[i] > 'z')
            return false;
    return true;
}

/* Returns true, after an error message, if the input has a known format without points, such as a
 * mesh or an image. ebpo_points_parse_ply recognises such files; then error.offset is 0. */
static bool is_foreign(points *p)
{
    ebpo_error error = EBPO_ERROR_INIT;
    double *xyz = NULL;
    uint64_t count;
    if (ebpo_points_parse_ply(p->unread, p->unread_count, p->name, &xyz, &count, &error) ==
            EBPO_OK ||
        error.offset != 0)
        return free(xyz), false;
    fprintf(stderr, "ebpo %s: %s\n", p->command, error.message);
    p->failed = true;
    return true;
}

/* Refuses an HDF5 file that was given without the path of a dataset, and lists datasets that the
 * user may have meant. */
static bool refuse_hdf5(points *p, points_block *b)
{
    ebpo_error error = EBPO_ERROR_INIT;
    uint64_t total;
    if (p->fd == STDIN_FILENO)
        return points_fault(b, 0,
                            "is an HDF5 file, which cannot be read from a pipe; give a "
                            "dataset by its name: FILE.h5:/path");
    if (read_dataset(p, p->name, "", 0, UINT64_MAX, &total, &error) == EBPO_E_ABSENT)
        return points_fault(
            b, 0, "is an HDF5 file and holds no %s; give the model first, then the query input",
            kind_words[p->kind]);
    fprintf(stderr, "ebpo %s: %s\n", p->command, error.message);
    p->failed = true;
    return false;
}

static bool recognise_format(points *p, points_block *b)
{
    if (begins_with(p, "\211HDF\r\n\032\n", SIGNATURE_SIZE))
        return refuse_hdf5(p, b);
    if (begins_with(p, "\223NUMPY", 6))
        return read_npy(p, b);
    if (!p->raw && begins_with(p, "\xef\xbb\xbf", 3)) /* byte order mark */
        points_drop(p, 3);
    if (begins_as_ply(p) && !p->raw)
        return read_ply(p, b);
    if (begins_as_ply(p) && p->kind == POINTS)
        return points_fault(b, 0, "is a PLY file, not raw doubles; omit --raw");
    if (begins_as_ply(p))
        return points_fault(b, 0,
                            "is a PLY file, which holds points; give %s as text or as raw doubles",
                            kind_words[p->kind]);
    return p->raw || !is_foreign(p);
}

/* Decides from the first eight bytes of binary input, or from the first four bytes of text. So a
 * short line of text from a terminal or a pipe is evaluated at once. */
bool points_recognise(points *p, points_block *b)
{
    for (;;) {
        bool binary = p->unread_count && (uint8_t)p->unread[0] > 0x7f;
        if (p->unread_count >= (p->raw || binary ? SIGNATURE_SIZE : 4) || p->is_ended || b->failed)
            break;
        points_fill(p, b);
    }
    return !b->failed && recognise_format(p, b);
}
