/* Writes paint files: annotations of a model (layers, strokes, notes). The table ebpo_paint_columns
 * (paint_open.c) lists the arrays of a file.
 *
 * A file is written under a temporary name and published when it is complete. An existing file is
 * replaced only if it has not changed since the annotations were read from it or last saved to it.
 * So a change by another program is not lost.
 *
 * See format-spec/paint.md. */
#include "core/strict_fp.h"

#include <ebpo/paint.h>

#include <fcntl.h>
#include <inttypes.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "core/alloc.h"
#include "core/endian.h"
#include "core/error.h"
#include "hdf5_write/h5.h"
#include "io/file_source.h"
#include "io/publish.h"
#include "extras/paint/paint_open.h"

static ebpo_status put_root(ebpo_h5_out *out, const ebpo_paint *p, ebpo_error *error)
{
    const struct {
        const char *name;
        uint64_t count;
    } counts[] = { { "layer_count", p->layer_count },
                   { "note_count", p->note_count },
                   { "stroke_count", p->stroke_count },
                   { "point_count", p->point_count } };
    char generator[64];
    ebpo_h5_id root;
    snprintf(generator, sizeof generator, "ebpo %s", ebpo_version());
    const char *texts[][2] = { { "format", EBPO_PAINT_FORMAT },
                               { "generator", generator },
                               { "model_sha256", p->model_sha256 },
                               { "model_name", p->model_name },
                               { "unit", p->unit },
                               { "face_numbers", p->source_numbers ? "source" : "file" } };
    ebpo_status status = ebpo_h5_root(out, &root, error);
    for (size_t i = 0; i < sizeof texts / sizeof *texts && status == EBPO_OK; i++)
        status = ebpo_h5_put_text(out, root, texts[i][0], texts[i][1], error);
    if (status == EBPO_OK)
        status = ebpo_h5_put_int(out, root, "format_version_major", EBPO_PAINT_FORMAT_MAJOR, error);
    if (status == EBPO_OK)
        status = ebpo_h5_put_int(out, root, "format_version_minor", EBPO_PAINT_FORMAT_MINOR, error);
    for (size_t i = 0; i < sizeof counts / sizeof *counts && status == EBPO_OK; i++)
        status = ebpo_h5_put_count(out, root, counts[i].name, counts[i].count, error);
    ebpo_h5_close_id(out, root);
    return status;
}

static ebpo_status put_texts(ebpo_h5_out *out, ebpo_h5_id group, const ebpo_paint_text_kind *kinds,
                             char *const text[EBPO_PAINT_TEXTS], ebpo_error *error)
{
    ebpo_status status = EBPO_OK;
    for (int i = 0; i < EBPO_PAINT_TEXTS && status == EBPO_OK; i++)
        status = ebpo_h5_put_text(out, group, kinds[i].name, text[i], error);
    return status;
}

static ebpo_status put_layer(ebpo_h5_out *out, const ebpo_paint *p, uint64_t number,
                             ebpo_error *error)
{
    char path[32];
    ebpo_h5_id group;
    const ebpo_layer_data *l = &p->layer[number];
    snprintf(path, sizeof path, "/layers/%04" PRIu64, number);
    ebpo_status status = ebpo_h5_make_group(out, path, 0, &group, error);
    if (status == EBPO_OK)
        status = put_texts(out, group, ebpo_paint_layer_texts, l->text, error);
    if (status == EBPO_OK)
        status = ebpo_h5_put_count(out, group, "colour", l->colour, error);
    if (status == EBPO_OK)
        status = ebpo_h5_put_count(out, group, "opacity", l->opacity, error);
    if (status == EBPO_OK)
        status = ebpo_h5_put_count(out, group, "visible", l->visible, error);
    ebpo_h5_close_id(out, group);
    return status;
}

static ebpo_status put_note(ebpo_h5_out *out, const ebpo_paint *p, uint64_t number,
                            ebpo_error *error)
{
    char path[32];
    ebpo_h5_id group;
    const ebpo_note_data *n = &p->note[number];
    const double weights[2] = { n->at.weight[0], n->at.weight[1] };
    snprintf(path, sizeof path, "/notes/%04" PRIu64, number);
    ebpo_status status = ebpo_h5_make_group(out, path, 0, &group, error);
    if (status == EBPO_OK)
        status = put_texts(out, group, ebpo_paint_note_texts, n->text, error);
    if (status == EBPO_OK)
        status = ebpo_h5_put_count(out, group, "layer", n->layer, error);
    if (status == EBPO_OK)
        status = ebpo_h5_put_count(out, group, "face", n->at.face, error);
    if (status == EBPO_OK)
        status = ebpo_h5_put_real(out, group, "weights", weights, 2, error);
    if (status == EBPO_OK)
        status = ebpo_h5_put_real(out, group, "place", n->at.place, 3, error);
    ebpo_h5_close_id(out, group);
    return status;
}

static ebpo_status put_group(ebpo_h5_out *out, const char *path, uint64_t links, ebpo_error *error)
{
    ebpo_h5_id group;
    ebpo_status status = ebpo_h5_make_group(out, path, (unsigned)links, &group, error);
    ebpo_h5_close_id(out, group);
    return status;
}

static ebpo_status put_column(ebpo_h5_out *out, const ebpo_paint *p, const ebpo_paint_column *c,
                              ebpo_error *error)
{
    ebpo_shape shape = ebpo_paint_column_shape(c, ebpo_paint_column_rows(p, c));
    size_t count = shape.rows * ebpo_shape_row_bytes(&shape);
    ebpo_h5_id array = -1;
    uint8_t *bytes = ebpo_alloc(count + 4, 1);
    if (!bytes)
        return ebpo_fail_memory(error, count + 4);
    ebpo_paint_column_write(p, c, bytes);
    ebpo_store32(bytes + count, ebpo_fletcher32(bytes, count));
    ebpo_status status = ebpo_h5_make_array(out, c->path, &shape, &array, error);
    if (status == EBPO_OK)
        status = ebpo_h5_put_chunk(out, c->path, array, &shape, 0, bytes, count + 4, error);
    ebpo_h5_close_id(out, array);
    free(bytes);
    return status;
}

static ebpo_status put_all(ebpo_h5_out *out, const ebpo_paint *p, ebpo_error *error)
{
    ebpo_status status = put_root(out, p, error);
    if (status == EBPO_OK && p->layer_count)
        status = put_group(out, "/layers", p->layer_count, error);
    for (uint64_t i = 0; i < p->layer_count && status == EBPO_OK; i++)
        status = put_layer(out, p, i, error);
    if (status == EBPO_OK && p->note_count)
        status = put_group(out, "/notes", p->note_count, error);
    for (uint64_t i = 0; i < p->note_count && status == EBPO_OK; i++)
        status = put_note(out, p, i, error);
    if (status == EBPO_OK && p->stroke_count)
        status = put_group(out, "/strokes", EBPO_PAINT_COLUMNS, error);
    if (status == EBPO_OK && p->point_count)
        status = put_group(out, "/points", EBPO_PAINT_COLUMNS, error);
    for (int i = 0; i < EBPO_PAINT_COLUMNS && status == EBPO_OK; i++)
        if (ebpo_paint_column_rows(p, &ebpo_paint_columns[i]))
            status = put_column(out, p, &ebpo_paint_columns[i], error);
    return status;
}

/* Returns an estimate of the bytes of all HDF5 headers of the file. */
static uint64_t header_bytes(const ebpo_paint *p)
{
    enum { GROUP = 700, ROOT = 8192 };
    uint64_t sum = ROOT + GROUP * (p->layer_count + p->note_count);
    for (uint64_t i = 0; i < p->layer_count; i++)
        sum += strlen(p->layer[i].text[EBPO_PAINT_BODY]);
    for (uint64_t i = 0; i < p->note_count; i++)
        sum += strlen(p->note[i].text[EBPO_PAINT_BODY]);
    return sum;
}

/* Stores the version of the saved file. The next save compares the file at `path` with this
 * version, to detect a change by another program. Takes ownership of `path` and of the open file
 * `fd`. */
static void remember_version(ebpo_paint_file *f, char *path, int fd)
{
    if (f->fd >= 0)
        close(f->fd);
    free(f->path);
    f->path = path;
    f->fd = fd;
    ebpo_publish_unlock(fd);
    f->version = ebpo_file_version_of(fd);
}

/* Saves the paint. checkpoint: keeps the lock of the paint's file, and does not wait for the disk.
 */
static ebpo_status save_locked(const ebpo_paint *p, const char *path, bool checkpoint,
                               ebpo_error *error)
{
    enum { LINKS = 4 };
    ebpo_paint_file *f = p->file;
    ebpo_publish publish = EBPO_PUBLISH_INIT;
    ebpo_h5_out out = EBPO_H5_OUT_INIT;
    char *target;
    int fd = -1;
    ebpo_status status = ebpo_target_path(path, &target, error);
    /* to_own_file: `path` is the file that was read or last saved; first: the annotations have no
     * file yet */
    bool to_own_file = target && f->path && strcmp(f->path, target) == 0, first = !f->path;
    if (status == EBPO_OK)
        status = ebpo_publish_begin(&publish, path, error);
    publish.unsynced = checkpoint;
    if (status == EBPO_OK && (to_own_file || first) &&
        (fd = fcntl(publish.fd, F_DUPFD_CLOEXEC, 3)) < 0)
        status = ebpo_fail_errno(error, path, "could not be written");
    if (status == EBPO_OK)
        status =
            ebpo_h5_create(&out, ebpo_publish_path(&publish), path, header_bytes(p), LINKS, error);
    if (status == EBPO_OK)
        status = put_all(&out, p, error);
    if (status == EBPO_OK)
        status = ebpo_h5_finish(&out, error);
    ebpo_h5_discard(&out);
    if (to_own_file)
        ebpo_publish_expect(&publish, &f->version, f->lock.fd >= 0);
    if (status == EBPO_OK)
        status = ebpo_publish_commit(&publish, error);
    ebpo_publish_abort(&publish);
    /* released after a failure, too: other programs may then change the file */
    if (to_own_file && !checkpoint)
        ebpo_file_lock_release(&f->lock);
    if (status == EBPO_OK && fd >= 0) {
        remember_version(f, target, fd);
    } else {
        free(target);
        if (fd >= 0)
            close(fd);
    }
    return status;
}

ebpo_status ebpo_paint_save(const ebpo_paint *p, const char *path, ebpo_error *error)
{
    pthread_mutex_lock(&p->file->mutex);
    ebpo_status status = save_locked(p, path, false, error);
    pthread_mutex_unlock(&p->file->mutex);
    return status;
}

ebpo_status ebpo_paint_checkpoint(const ebpo_paint *p, ebpo_error *error)
{
    ebpo_status status;
    pthread_mutex_lock(&p->file->mutex);
    char *path = p->file->path ? strdup(p->file->path) : NULL;
    if (path)
        status = save_locked(p, path, true, error);
    else
        status = p->file->path ? ebpo_fail_memory(error, strlen(p->file->path))
                               : ebpo_fail(error, EBPO_E_ARGUMENT,
                                           "the paint has no file yet; save it to a path first");
    pthread_mutex_unlock(&p->file->mutex);
    free(path);
    return status;
}
