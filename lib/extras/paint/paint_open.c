/* Reads paint files, and defines the table of their arrays (ebpo_paint_columns).
 *
 * A paint file is untrusted input. The strict reader of HDF5 headers (lib/hdf5_read) reads it
 * without libhdf5. Every count is compared with its limit and with the file's size before memory is
 * allocated. Every number is checked for its range, and texts for UTF-8 without control characters.
 *
 * The table states for each array its path, its element type, and the member of a stroke or a point
 * that it contains. paint_save.c writes files by the same table.
 *
 * See format-spec/paint.md. */
#include "core/strict_fp.h"

#include <errno.h>
#include <fcntl.h>
#include <inttypes.h>
#include <stddef.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include <ebpo/paint.h>

#include "core/alloc.h"
#include "core/checksum.h"
#include "core/endian.h"
#include "core/error.h"
#include "core/fp_env.h"
#include "extras/paint/paint_open.h"
#include "hdf5_read/head.h"
#include "io/byte_source.h"
#include "io/file_source.h"

#define OF_STROKES(path, element, cols, member)                                    \
    {                                                                              \
        "/strokes/" path, element, cols, false, offsetof(ebpo_stroke_data, member) \
    }
#define OF_POINTS(path, element, cols, member)                                   \
    {                                                                            \
        "/points/" path, element, cols, true, offsetof(ebpo_paint_point, member) \
    }

const ebpo_paint_column ebpo_paint_columns[EBPO_PAINT_COLUMNS] = {
    OF_STROKES("layer", 4, 0, layer),      OF_STROKES("kind", 4, 0, kind),
    OF_STROKES("colour", 1, 4, rgba),      OF_STROKES("radius", 8, 0, radius),
    OF_STROKES("time", 8, 0, time),        OF_STROKES("points", 4, 0, count),
    OF_POINTS("face", 4, 0, face),         OF_POINTS("weights", 4, 2, weight),
    OF_POINTS("place", 8, 3, place),       OF_POINTS("size", 2, 0, size),
    OF_POINTS("pressure", 2, 0, pressure), OF_POINTS("time", 4, 0, time),
};

ebpo_shape ebpo_paint_column_shape(const ebpo_paint_column *c, uint64_t rows)
{
    return (ebpo_shape){ .rows = rows,
                         .cols = c->cols,
                         .chunk_rows = (uint32_t)rows,
                         .element_size = c->element,
                         .pipeline = EBPO_PIPELINE_CHECKSUM };
}

/* Returns the address of the column's member in a row. */
static uint8_t *member_of(const ebpo_paint *p, const ebpo_paint_column *c, uint64_t row)
{
    uint8_t *rows = c->of_points ? (uint8_t *)p->point : (uint8_t *)p->stroke;
    return rows + row * (c->of_points ? sizeof *p->point : sizeof *p->stroke) + c->offset;
}

/* Copies a number of 1, 2, 4 or 8 bytes, and swaps its bytes on a big-endian machine. This converts
 * a number from the file's byte order to the byte order in memory, or back. */
static void convert_value(const uint8_t *from, unsigned bytes, uint8_t *to)
{
    const uint16_t two = bytes == 2 ? ebpo_load16(from) : 0;
    const uint32_t four = bytes == 4 ? ebpo_load32(from) : 0;
    const uint64_t eight = bytes == 8 ? ebpo_load64(from) : 0;
    memcpy(to,
           bytes == 1   ? (const void *)from
           : bytes == 2 ? (const void *)&two
           : bytes == 4 ? (const void *)&four
                        : (const void *)&eight,
           bytes);
}

static unsigned values_of(const ebpo_paint_column *c) { return c->cols ? c->cols : 1; }

/* Copies all rows of a column from the bytes of the file to the members of strokes or points. */
static void convert_column(ebpo_paint *p, const ebpo_paint_column *c, const uint8_t *bytes)
{
    for (uint64_t row = 0; row < ebpo_paint_column_rows(p, c); row++)
        for (unsigned k = 0; k < values_of(c); k++, bytes += c->element)
            convert_value(bytes, c->element, member_of(p, c, row) + k * c->element);
}

void ebpo_paint_column_write(const ebpo_paint *p, const ebpo_paint_column *c, uint8_t *bytes)
{
    for (uint64_t row = 0; row < ebpo_paint_column_rows(p, c); row++)
        for (unsigned k = 0; k < values_of(c); k++, bytes += c->element)
            convert_value(member_of(p, c, row) + k * c->element, c->element, bytes);
}

/* --- reading --- */

typedef struct reader {
    ebpo_head head;
    ebpo_input input;
    ebpo_paint *p;
    uint64_t text_bytes;                /* number of bytes of all texts so far */
    char text[EBPO_PAINT_TEXT_MAX + 1]; /* workspace */
} reader;

static ebpo_status fail_wrong(const reader *r, const char *path, const char *what,
                              ebpo_error *error)
{
    return ebpo_fail_at(error, EBPO_E_FORMAT, r->input.shown, path, -1,
                        "%s; get a fresh copy of the file", what);
}

/* --- attributes --- */

static ebpo_status fail_missing(const reader *r, const char *path, const char *name,
                                ebpo_error *error)
{
    char what[80];
    snprintf(what, sizeof what, "attribute %s is missing", name);
    return fail_wrong(r, path, what, error);
}

/* Reads a text of less than `size` bytes. If the attribute is missing and not `required`, *out does
 * not change. */
static ebpo_status get_text(reader *r, ebpo_head_object object, const char *path, const char *name,
                            bool required, char *out, size_t size, ebpo_error *error)
{
    ebpo_status status = ebpo_head_get_text(&r->head, object, path, name, out, size, error);
    if (status == EBPO_E_ABSENT)
        status = required ? fail_missing(r, path, name, error) : EBPO_OK;
    return status;
}

static ebpo_status get_count(reader *r, ebpo_head_object object, const char *path, const char *name,
                             uint64_t most, uint64_t *out, ebpo_error *error)
{
    char what[96];
    ebpo_status status = ebpo_head_get_count(&r->head, object, path, name, out, error);
    if (status == EBPO_E_ABSENT)
        return fail_missing(r, path, name, error);
    if (status != EBPO_OK || *out <= most)
        return status;
    snprintf(what, sizeof what, "attribute %s is above %" PRIu64, name, most);
    return fail_wrong(r, path, what, error);
}

/* Checks that the file is a paint file of a version that this library reads. */
static ebpo_status check_paint_file(reader *r, ebpo_head_object root, ebpo_error *error)
{
    char format[64];
    int64_t major = 0, minor = 0;
    ebpo_status status =
        ebpo_head_get_text(&r->head, root, "/", "format", format, sizeof format, error);
    if (status != EBPO_OK || strcmp(format, EBPO_PAINT_FORMAT) != 0)
        return ebpo_fail_file(error, EBPO_E_FORMAT, r->input.shown, "this is not a paint file%s",
                              status == EBPO_OK && strcmp(format, "EBP-Octree in HDF5") == 0
                                  ? " but a model; paint files mostly end in .paint.h5"
                                  : "; name a .paint.h5 file");
    const char *name = "format_version_major";
    status = ebpo_head_get_int(&r->head, root, "/", name, &major, error);
    if (status == EBPO_OK) {
        name = "format_version_minor";
        status = ebpo_head_get_int(&r->head, root, "/", name, &minor, error);
    }
    if (status == EBPO_E_ABSENT)
        return fail_missing(r, "/", name, error);
    if (status == EBPO_OK && major != EBPO_PAINT_FORMAT_MAJOR)
        return ebpo_fail_file(error, EBPO_E_VERSION, r->input.shown,
                              "the paint file has version %" PRId64
                              " of its format, and this program reads "
                              "version %d; use a newer program",
                              major, EBPO_PAINT_FORMAT_MAJOR);
    if (status == EBPO_OK && (minor < 0 || minor > EBPO_PAINT_MINOR_MAX))
        return fail_wrong(r, "/", "attribute format_version_minor is out of range", error);
    return status;
}

static bool is_digest(const char *text)
{
    return strlen(text) == 64 && strspn(text, "0123456789abcdef") == 64;
}

static ebpo_status read_names(reader *r, ebpo_head_object root, ebpo_error *error)
{
    ebpo_paint *p = r->p;
    char numbers[16];
    ebpo_status status =
        get_text(r, root, "/", "generator", true, p->generator, sizeof p->generator, error);
    if (status == EBPO_OK)
        status = get_text(r, root, "/", "model_sha256", true, p->model_sha256,
                          sizeof p->model_sha256, error);
    if (status == EBPO_OK && !is_digest(p->model_sha256))
        return fail_wrong(r, "/", "attribute model_sha256 is not 64 digits 0-9 a-f", error);
    if (status == EBPO_OK)
        status =
            get_text(r, root, "/", "model_name", false, p->model_name, sizeof p->model_name, error);
    if (status == EBPO_OK)
        status = get_text(r, root, "/", "unit", false, p->unit, sizeof p->unit, error);
    if (status == EBPO_OK)
        status = get_text(r, root, "/", "face_numbers", true, numbers, sizeof numbers, error);
    if (status != EBPO_OK)
        return status;
    p->source_numbers = strcmp(numbers, "source") == 0;
    return p->source_numbers || strcmp(numbers, "file") == 0
               ? EBPO_OK
               : fail_wrong(r, "/", "attribute face_numbers is neither 'source' nor 'file'", error);
}

static ebpo_status read_texts(reader *r, ebpo_head_object group, const char *path,
                              const ebpo_paint_text_kind *kinds, char *text[EBPO_PAINT_TEXTS],
                              ebpo_error *error)
{
    for (int i = 0; i < EBPO_PAINT_TEXTS; i++) {
        ebpo_status status =
            get_text(r, group, path, kinds[i].name, true, r->text, kinds[i].max_bytes + 1, error);
        if (status != EBPO_OK)
            return status;
        r->text_bytes += strlen(r->text);
        if (r->text_bytes > r->input.source.size)
            return fail_wrong(r, path,
                              "the texts have more bytes than the file: groups share "
                              "objects",
                              error);
        char *copy = strdup(r->text);
        if (!copy)
            return ebpo_fail_memory(error, strlen(r->text));
        free(text[i]);
        text[i] = copy;
    }
    return EBPO_OK;
}

/* --- layers and notes --- */

static ebpo_status read_layer(reader *r, uint64_t number, ebpo_error *error)
{
    char path[32];
    ebpo_head_object group;
    ebpo_layer_data *l = &r->p->layer[number];
    snprintf(path, sizeof path, "/layers/%04" PRIu64, number);
    ebpo_status status = ebpo_head_open_group(&r->head, path, &group, error);
    if (status == EBPO_OK)
        status = read_texts(r, group, path, ebpo_paint_layer_texts, l->text, error);
    if (status == EBPO_OK)
        status = get_count(r, group, path, "colour", UINT32_MAX, &l->colour, error);
    if (status == EBPO_OK)
        status = get_count(r, group, path, "opacity", 255, &l->opacity, error);
    if (status == EBPO_OK)
        status = get_count(r, group, path, "visible", 1, &l->visible, error);
    return status;
}

static ebpo_status read_note_place(reader *r, ebpo_head_object group, const char *path,
                                   ebpo_note_data *n, ebpo_error *error)
{
    uint64_t face = 0;
    double weights[2] = { 0, 0 };
    ebpo_status status = get_count(r, group, path, "face", UINT32_MAX - 1, &face, error);
    if (status == EBPO_OK)
        status = ebpo_head_get_real(&r->head, group, path, "weights", weights, 2, error);
    if (status == EBPO_OK)
        status = ebpo_head_get_real(&r->head, group, path, "place", n->at.place, 3, error);
    if (status == EBPO_E_ABSENT)
        return fail_missing(r, path, "weights or place", error);
    if (status != EBPO_OK)
        return status;
    n->at.face = (uint32_t)face;
    n->at.size = EBPO_PAINT_FULL;
    for (int i = 0; i < 2; i++) {
        if (!(weights[i] >= 0 && weights[i] <= EBPO_PAINT_WEIGHTS) ||
            (double)(uint32_t)weights[i] != weights[i])
            return fail_wrong(r, path, "attribute weights must be integers from 0 to 2^30", error);
        n->at.weight[i] = (uint32_t)weights[i];
    }
    const char *what = ebpo_paint_point_wrong(&n->at);
    return what ? fail_wrong(r, path, what, error) : EBPO_OK;
}

static ebpo_status read_note(reader *r, uint64_t number, ebpo_error *error)
{
    char path[32];
    ebpo_head_object group;
    ebpo_note_data *n = &r->p->note[number];
    snprintf(path, sizeof path, "/notes/%04" PRIu64, number);
    ebpo_status status = ebpo_head_open_group(&r->head, path, &group, error);
    if (status == EBPO_OK)
        status = read_texts(r, group, path, ebpo_paint_note_texts, n->text, error);
    if (status == EBPO_OK)
        status = get_count(r, group, path, "layer", EBPO_PAINT_LAYERS, &n->layer, error);
    if (status == EBPO_OK && n->layer >= r->p->layer_count)
        return fail_wrong(r, path, "attribute layer is the number of a layer that does not exist",
                          error);
    return status == EBPO_OK ? read_note_place(r, group, path, n, error) : status;
}

/* Reads layers and notes. Increments p->layer_count and p->note_count when the texts of a layer or
 * a note have been allocated, so that after a failure exactly these texts are freed. */
static ebpo_status read_labels(reader *r, uint64_t layers, uint64_t notes, ebpo_error *error)
{
    ebpo_paint *p = r->p;
    ebpo_status status = EBPO_OK;
    p->layer = ebpo_alloc_zero(layers, sizeof *p->layer);
    p->note = ebpo_alloc_zero(notes, sizeof *p->note);
    if (!p->layer || !p->note)
        return ebpo_fail_memory(error, layers * sizeof *p->layer + notes * sizeof *p->note);
    p->layer_capacity = layers;
    p->note_capacity = notes;
    for (uint64_t i = 0; i < layers && status == EBPO_OK; i++) {
        if (!ebpo_paint_texts_begin(p->layer[i].text))
            return ebpo_fail_memory(error, EBPO_PAINT_TEXTS);
        p->layer_count++;
        status = read_layer(r, i, error);
    }
    for (uint64_t i = 0; i < notes && status == EBPO_OK; i++) {
        if (!ebpo_paint_texts_begin(p->note[i].text))
            return ebpo_fail_memory(error, EBPO_PAINT_TEXTS);
        p->note_count++;
        status = read_note(r, i, error);
    }
    return status;
}

/* --- strokes and points --- */

/* Finds the offset and the number of bytes of a column's only chunk, and checks the array's shape.
 * The chunk is within the file, so the file's size bounds the memory that is allocated for the
 * chunk. */
static ebpo_status find_column(reader *r, const ebpo_paint_column *c, uint64_t rows,
                               ebpo_chunk_location *place, ebpo_error *error)
{
    ebpo_shape shape = { .rows = 0 }, expected = ebpo_paint_column_shape(c, rows);
    ebpo_chunk_location *chunks = NULL;
    uint64_t stored;
    ebpo_status status = ebpo_head_read_array(&r->head, c->path, 1, EBPO_HEAD_ROWS_ALL, &shape,
                                              NULL, &chunks, &stored, error);
    if (status != EBPO_OK)
        return status;
    bool same = shape.rows == rows && shape.cols == expected.cols && !shape.is_signed &&
                shape.element_size == c->element && shape.pipeline == expected.pipeline && chunks;
    if (same)
        *place = chunks[0];
    free(chunks);
    if (!same)
        return fail_wrong(r, c->path,
                          "the array does not have the type, shape and filter of the format",
                          error);
    return place->bytes == rows * ebpo_shape_row_bytes(&expected) + 4
               ? EBPO_OK
               : fail_wrong(r, c->path, "the size of the chunk does not match its rows", error);
}

static ebpo_status read_column(reader *r, const ebpo_paint_column *c, ebpo_error *error)
{
    uint64_t rows = ebpo_paint_column_rows(r->p, c);
    ebpo_chunk_location place;
    if (rows == 0)
        return EBPO_OK;
    ebpo_status status = find_column(r, c, rows, &place, error);
    if (status != EBPO_OK)
        return status;
    uint8_t *bytes = ebpo_alloc(place.bytes, 1);
    if (!bytes)
        return ebpo_fail_memory(error, place.bytes);
    status = ebpo_input_read(&r->input, place.address, place.bytes, bytes, error);
    size_t count = place.bytes - 4;
    if (status == EBPO_OK &&
        ebpo_sum_differs(ebpo_load32(bytes + count), ebpo_fletcher32(bytes, count)))
        status = fail_wrong(r, c->path, "the chunk is damaged: its checksum differs", error);
    if (status == EBPO_OK)
        convert_column(r->p, c, bytes);
    free(bytes);
    return status;
}

static ebpo_status check_strokes(reader *r, ebpo_error *error)
{
    ebpo_paint *p = r->p;
    uint64_t sum = 0;
    for (uint64_t i = 0; i < p->stroke_count; i++) {
        const char *what = ebpo_paint_stroke_wrong(&p->stroke[i], p->layer_count);
        if (what)
            return fail_wrong(r, "/strokes", what, error);
        p->stroke[i].first = sum;
        sum += p->stroke[i].count;
    }
    if (sum != p->point_count)
        return fail_wrong(r, "/strokes/points",
                          "the sum of the strokes' point counts differs from the number of points",
                          error);
    for (uint64_t i = 0; i < p->point_count; i++) {
        const char *what = ebpo_paint_point_wrong(&p->point[i]);
        if (what)
            return fail_wrong(r, "/points", what, error);
    }
    return EBPO_OK;
}

/* Reads strokes and points. All arrays are checked before memory is allocated for rows. */
static ebpo_status read_strokes(reader *r, uint64_t strokes, uint64_t points, ebpo_error *error)
{
    ebpo_paint *p = r->p;
    ebpo_status status = EBPO_OK;
    ebpo_chunk_location place;
    for (int i = 0; i < EBPO_PAINT_COLUMNS && status == EBPO_OK; i++) {
        const ebpo_paint_column *c = &ebpo_paint_columns[i];
        uint64_t rows = c->of_points ? points : strokes;
        status = rows ? find_column(r, c, rows, &place, error) : EBPO_OK;
    }
    if (status != EBPO_OK)
        return status;
    p->stroke = ebpo_alloc_zero(strokes, sizeof *p->stroke);
    p->point = ebpo_alloc_zero(points, sizeof *p->point);
    if (!p->stroke || !p->point)
        return ebpo_fail_memory(error, strokes * sizeof *p->stroke + points * sizeof *p->point);
    p->stroke_count = p->stroke_capacity = strokes;
    p->point_count = p->point_capacity = points;
    for (int i = 0; i < EBPO_PAINT_COLUMNS && status == EBPO_OK; i++)
        status = read_column(r, &ebpo_paint_columns[i], error);
    return status == EBPO_OK ? check_strokes(r, error) : status;
}

/* --- files --- */

static ebpo_status read_all(reader *r, ebpo_error *error)
{
    ebpo_head_object root;
    uint64_t layers = 0, notes = 0, strokes = 0, points = 0;
    ebpo_status status = ebpo_head_open_group(&r->head, "/", &root, error);
    if (status == EBPO_OK)
        status = check_paint_file(r, root, error);
    if (status == EBPO_OK)
        status = read_names(r, root, error);
    if (status == EBPO_OK)
        status = get_count(r, root, "/", "layer_count", EBPO_PAINT_LAYERS, &layers, error);
    if (status == EBPO_OK)
        status = get_count(r, root, "/", "note_count", EBPO_PAINT_NOTES, &notes, error);
    if (status == EBPO_OK)
        status = get_count(r, root, "/", "stroke_count", EBPO_PAINT_STROKES, &strokes, error);
    if (status == EBPO_OK)
        status = get_count(r, root, "/", "point_count", EBPO_PAINT_POINTS, &points, error);
    if (status == EBPO_OK)
        status = read_labels(r, layers, notes, error);
    return status == EBPO_OK ? read_strokes(r, strokes, points, error) : status;
}

/* Stores the path and the version of the file that is read. */
static ebpo_status keep_version(const reader *r, ebpo_error *error)
{
    ebpo_paint_file *f = r->p->file;
    int fd = ebpo_input_descriptor(&r->input);
    char *path = fd >= 0 ? realpath(r->input.shown, NULL) : NULL;
    if (fd >= 0 && !path && errno == ENOMEM)
        return ebpo_fail_memory(error, strlen(r->input.shown));
    if (!path) /* the source is not a file, or the file has been removed */
        return EBPO_OK;
    f->path = path;
    f->fd = fcntl(fd, F_DUPFD_CLOEXEC, 3);
    if (f->fd < 0)
        return ebpo_fail_errno(error, r->input.shown, "cannot be opened");
    f->version = ebpo_file_version_of(f->fd);
    return EBPO_OK;
}

/* Reads a paint from a source, and takes ownership of the source. */
static ebpo_status open_source(const ebpo_source *source, const char *name, ebpo_paint **out,
                               ebpo_error *error)
{
    reader *r = ebpo_alloc_zero(1, sizeof *r);
    ebpo_paint *p = ebpo_paint_begin();
    ebpo_status status = r && p ? EBPO_OK : ebpo_fail_memory(error, sizeof *r + sizeof *p);
    if (status == EBPO_OK)
        status = ebpo_input_open(&r->input, source, name, error);
    else if (source->close)
        source->close(source->user);
    if (status == EBPO_OK) {
        r->p = p;
        status = keep_version(r, error);
        if (status == EBPO_OK)
            status = ebpo_head_open(&r->head, &r->input, error);
        if (status == EBPO_OK)
            status = read_all(r, error);
        status = ebpo_head_close(&r->head, status, error);
        ebpo_input_close(&r->input);
    }
    free(r);
    if (status == EBPO_OK)
        *out = p;
    else
        ebpo_paint_free(p);
    return status;
}

static ebpo_status open_path(const char *path, ebpo_paint **out, ebpo_error *error)
{
    ebpo_source source;
    ebpo_status status = ebpo_source_of_path(&source, path, error);
    return status == EBPO_OK ? open_source(&source, path, out, error) : status;
}

ebpo_status ebpo_paint_open(const char *path, ebpo_paint **out, ebpo_error *error)
{
    EBPO_DEFAULT_FP;
    *out = NULL;
    return open_path(path, out, error);
}

/* Makes a paint for a file that does not exist. Stores the path, so that saving fails if another
 * program makes a file with this path in the meantime. */
static ebpo_status make_new_paint(const char *path, const ebpo_file *model, ebpo_paint **out,
                                  ebpo_error *error)
{
    char *target;
    ebpo_status status = ebpo_target_path(path, &target, error);
    if (status == EBPO_OK)
        status = ebpo_paint_new(model, out, error);
    if (status == EBPO_OK)
        (*out)->file->path = target;
    else
        free(target);
    return status;
}

ebpo_status ebpo_paint_open_to_change(const char *path, const ebpo_file *model, double wait,
                                      const ebpo_progress *progress, ebpo_paint **out,
                                      ebpo_error *error)
{
    EBPO_DEFAULT_FP;
    ebpo_file_lock lock = EBPO_FILE_LOCK_INIT;
    *out = NULL;
    if (!(wait >= 0))
        return ebpo_fail(error, EBPO_E_ARGUMENT, "the time to wait is negative or not a number");
    ebpo_status status = ebpo_file_lock_take(&lock, path, wait, progress, error);
    if (status == EBPO_OK)
        status = model && access(path, F_OK) != 0 && errno == ENOENT
                     ? make_new_paint(path, model, out, error)
                     : open_path(path, out, error);
    if (status == EBPO_OK)
        (*out)->file->lock = lock;
    else
        ebpo_file_lock_release(&lock);
    return status;
}

ebpo_status ebpo_paint_open_memory(const void *data, uint64_t size, const char *name,
                                   ebpo_paint **out, ebpo_error *error)
{
    EBPO_DEFAULT_FP;
    ebpo_source source = ebpo_source_of_memory(data, size);
    *out = NULL;
    return open_source(&source, name ? name : "memory", out, error);
}
