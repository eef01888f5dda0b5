/* Opens a file: reads the header, and checks that every array is present in the shape that the
 * counts in the header require. Before memory is allocated for the number of items that a count
 * states, head_facts.c checks the count. The decoded size of the arrays is limited relative to the
 * file size. The second part opens files that other programs have rewritten with another HDF5
 * layout. In a separate process, libhdf5 copies such a file, with limits of memory, time and bytes
 * written. The copy is opened like any other file. Source: format-spec/README.md, sections 4 and 5;
 * docs/develop/threats.md. */
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
#include "format/chunk_directory.h"
#include "format/chunk_layout.h"
#include "format/head_facts.h"
#include "format/read_attributes.h"
#include "format/reader.h"
#include "hdf5_read/head.h"
#include "hdf5_write/h5.h"
#include "io/byte_source.h"
#include "io/file_source.h"
#include "mesh/import.h"

/* Returns true if the format allows this coding for the array. Values of another coding would be
 * decoded wrongly. In files of version 1.0 and the first files of 1.1, the coding of leaf_skip is
 * called `delta` instead of `skips`. */
static bool coding_known(const ebpo_array_spec *spec, const char *word, bool gates)
{
    if (gates)
        return strcmp(word, EBPO_GATES_CODING) == 0;
    return strcmp(word, spec->coding) == 0 ||
           (spec == &ebpo_schema[EBPO_A_LEAF_SKIP] && strcmp(word, "delta") == 0);
}

/* Returns true if the array's type and columns are those of the schema. a->shape: shape in the
 * file, which is replaced by the shape of the decoded values. Sets a->gates (true: faces stored as
 * gates, that is, coded relative to edges of preceding faces; face_gates.h). */
static bool type_fits(const ebpo_info *info, ebpo_array_in *a, bool gates)
{
    const ebpo_array_spec *spec = &ebpo_schema[a->id];
    ebpo_shape values = a->shape;
    values.cols = ebpo_schema_cols(info, a->id);
    if (gates)
        values.element_size = spec->sizes;
    ebpo_shape stored = ebpo_stored_shape(&values, gates);
    bool fits = a->shape.cols == stored.cols && a->shape.element_size == stored.element_size &&
                spec->sizes & values.element_size && a->shape.is_signed == spec->is_signed;
    a->shape = values;
    a->gates = gates;
    return fits;
}

/* Returns the number of rows of a full chunk that the format requires. Returns 0 if the format does
 * not require a number: for all arrays of files without subtrees, and for most arrays of other
 * files. */
static uint32_t block_rows(const ebpo_info *info, ebpo_array_id id)
{
    if (!info->subtree_level)
        return 0;
    return id == EBPO_A_FACES            ? EBPO_FACE_BLOCK
           : id == EBPO_A_VERTICES       ? EBPO_VERTEX_BLOCK
           : id == EBPO_A_SUBTREE_COUNTS ? ebpo_subtree_rows(info)
                                         : 0;
}

/* Opens an array: checks its coding, rows, type and columns. Leaves it absent if the counts in the
 * header require no rows. */
static ebpo_status open_array(ebpo_file *file, ebpo_head *head, ebpo_array_id id, int level,
                              ebpo_error *error)
{
    const ebpo_array_spec *spec = &ebpo_schema[id];
    ebpo_array_in *a =
        id < EBPO_LEVEL_ARRAYS ? &file->level_array[level][id] : &file->root_array[id];
    uint64_t rows = ebpo_schema_rows(&file->info, id, level);
    bool gates = id == EBPO_A_FACES && file->info.gates;
    *a = (ebpo_array_in){ .id = id, .level = level };
    ebpo_schema_path(id, level, a->path);
    if (ebpo_schema_former(id) && ebpo_head_find_kind(head, a->path) == EBPO_HEAD_ABSENT &&
        ebpo_head_find_kind(head, ebpo_schema_former(id)) != EBPO_HEAD_ABSENT)
        snprintf(a->path, sizeof a->path, "%s", ebpo_schema_former(id));
    if (rows == 0 || (spec->if_needed && ebpo_head_find_kind(head, a->path) == EBPO_HEAD_ABSENT))
        return EBPO_OK;
    /* If the file is remote or has a chunk directory, the chunks of an array with more than one
     * chunk are located later, when they are needed. */
    uint64_t max_chunks = ebpo_input_is_remote(&file->in) || file->has_directory ? 1 : UINT64_MAX;
    char coding[EBPO_HEAD_CODING_BYTES];
    ebpo_status status =
        ebpo_head_read_array(head, a->path, max_chunks, ebpo_reader_rows_of_chunk(file, id),
                             &a->shape, coding, &a->chunks, &a->stored_bytes, error);
    if (status != EBPO_OK)
        return status;
    ebpo_check check = ebpo_reader_check(file, NULL);
    if (!coding_known(spec, coding, gates))
        return ebpo_check_fail(&check, -1, a->path,
                               "the array's coding is not valid for this array", error);
    if (a->shape.rows != rows && rows != EBPO_ROWS_STATED)
        return ebpo_check_fail(&check, -1, a->path,
                               "the array's length contradicts the counts in the header", error);
    if (!type_fits(&file->info, a, gates))
        return ebpo_check_fail(&check, -1, a->path,
                               "the array has the wrong type or the wrong number of columns",
                               error);
    uint32_t block = block_rows(&file->info, id);
    if (block && a->shape.chunk_rows != (rows < block ? rows : block))
        return ebpo_fail_at(error, EBPO_E_UNSUPPORTED, file->in.shown, a->path, -1,
                            "the array's chunks do not have the size that the format "
                            "requires, " EBPO_HEAD_FOREIGN);
    bool wide = file->info.double_coordinates;
    if ((id == EBPO_A_VERTICES || id == EBPO_A_BORDER_POINTS) &&
        a->shape.element_size != (wide ? 8 : 4))
        return ebpo_check_fail(&check, -1, a->path, "the array's type contradicts coordinate_type",
                               error);
    a->present = true;
    if (!a->chunks)
        atomic_store(&file->located, false);
    if (id < EBPO_LEVEL_ARRAYS && level < file->info.index_level &&
        ebpo_shape_chunks(&a->shape) > 1)
        file->info.index_level = level;
    return EBPO_OK;
}

/* Reads the HDF5 attributes of the levels' groups. */
static ebpo_status open_levels(ebpo_file *file, ebpo_head *head, ebpo_error *error)
{
    ebpo_head_object id;
    char path[EBPO_PATH_BYTES];
    ebpo_status status = ebpo_head_open_group(head, "/levels", &id, error);
    for (int level = 0; level < file->info.level_count && status == EBPO_OK; level++) {
        snprintf(path, sizeof path, "/levels/%02d", level);
        status = ebpo_head_open_group(head, path, &id, error);
        if (status == EBPO_OK)
            status = ebpo_facts_get_level(head, id, path, &file->info.level[level], error);
    }
    return status;
}

/* Checks that a group exists, if `required` is true. */
static ebpo_status check_group(ebpo_head *head, const char *path, bool required, ebpo_error *error)
{
    ebpo_head_object id;
    return required ? ebpo_head_open_group(head, path, &id, error) : EBPO_OK;
}

/* Checks that an array has the same HDF5 filters as the first array. */
static ebpo_status check_pipeline(const ebpo_file *file, const ebpo_array_in *a, ebpo_error *error)
{
    return !a->present || a->shape.pipeline == file->level_array[0][EBPO_A_TYPES].shape.pipeline
               ? EBPO_OK
               : ebpo_fail_at(error, EBPO_E_UNSUPPORTED, file->in.shown, a->path, -1,
                              "the array's filters differ from those of the file's first "
                              "array, " EBPO_HEAD_FOREIGN);
}

static ebpo_status check_pipelines(const ebpo_file *file, ebpo_error *error)
{
    ebpo_status status = EBPO_OK;
    for (int level = 0; level < file->info.level_count; level++)
        for (int id = 0; id < EBPO_LEVEL_ARRAYS && status == EBPO_OK; id++)
            status = check_pipeline(file, &file->level_array[level][id], error);
    for (int id = EBPO_LEVEL_ARRAYS; id < EBPO_ARRAYS && status == EBPO_OK; id++)
        if ((id != EBPO_A_CHUNK_CHECKSUMS && id != EBPO_A_CHECKSUM_INDEX) ||
            (file->has_checksums && id == (int)file->checksum_list))
            status = check_pipeline(file, &file->root_array[id], error);
    for (int i = 0; i < file->attributes.arrays && status == EBPO_OK; i++)
        status = check_pipeline(file, &file->attributes.array[i], error);
    return status;
}

/* Returns true if a list of all chunks has an attribute with the correct size of the file. If
 * another program has rewritten the file, the attribute is wrong or missing. */
static bool states_size(const ebpo_file *file, ebpo_head *head, const char *path)
{
    ebpo_head_object id;
    uint64_t bytes = 0;
    return ebpo_head_open_array(head, path, &id, NULL) == EBPO_OK &&
           ebpo_head_get_count(head, id, path, "file_bytes", &bytes, NULL) == EBPO_OK &&
           bytes == file->info.file_bytes;
}

/* Opens a list of all chunks. The list states the size of the file, and the list's own offset in
 * the file. *valid: true if both numbers are correct. If a number is wrong or missing, another
 * program has rewritten the file, and the list does not describe the present chunks. */
static ebpo_status open_list(ebpo_file *file, ebpo_head *head, ebpo_array_id list, bool *valid,
                             ebpo_error *error)
{
    const ebpo_array_in *a = &file->root_array[list];
    ebpo_head_object id;
    uint64_t bytes = 0, offset = 0;
    *valid = false;
    ebpo_status status = open_array(file, head, list, 0, error);
    if (status != EBPO_OK || !a->present)
        return status;
    status = ebpo_head_open_array(head, a->path, &id, error);
    if (status != EBPO_OK)
        return status;
    bool stated = ebpo_head_get_count(head, id, a->path, "file_bytes", &bytes, NULL) == EBPO_OK &&
                  ebpo_head_get_count(head, id, a->path, "offset", &offset, NULL) == EBPO_OK;
    *valid =
        stated && bytes == file->info.file_bytes && a->chunks && offset == a->chunks[0].address;
    return EBPO_OK;
}

/* Opens a list of chunk checksums. Ignores the list if its chunks have no HDF5 filters, because
 * then the last bytes of chunks are not checksums. Also ignores a list that does not state the
 * present size of the file, because another program has then rewritten the file. In this case, a
 * damaged list is not an error. */
static ebpo_status open_checksums(ebpo_file *file, ebpo_head *head, ebpo_array_id list,
                                  ebpo_error *error)
{
    ebpo_array_in *a = &file->root_array[list];
    file->checksum_list = list;
    ebpo_status status = open_list(file, head, list, &file->has_checksums, error);
    bool wrong = status == EBPO_E_FORMAT || status == EBPO_E_UNSUPPORTED;
    if (status == EBPO_OK && a->present && a->shape.pipeline == EBPO_PIPELINE_BARE)
        file->has_checksums = false;
    if (!wrong || states_size(file, head, a->path))
        return status;
    a->present = false;
    return EBPO_OK;
}

/* Opens the pages of checksums, which a file with the list of their checksums must have. */
static ebpo_status open_pages(ebpo_file *file, ebpo_head *head, ebpo_error *error)
{
    ebpo_array_in *a = &file->root_array[EBPO_A_CHECKSUM_PAGES];
    ebpo_check check = ebpo_reader_check(file, NULL);
    ebpo_status status = open_array(file, head, EBPO_A_CHECKSUM_PAGES, 0, error);
    return status != EBPO_OK || a->present
               ? status
               : ebpo_check_fail(&check, -1, a->path, "the array is missing", error);
}

static ebpo_status open_arrays(ebpo_file *file, ebpo_head *head, ebpo_error *error)
{
    ebpo_info *info = &file->info;
    info->index_level = info->level_count;
    info->file_bytes = file->in.source.size;
    ebpo_status status = check_group(head, "/subtrees", info->subtree_level != 0, error);
    if (status == EBPO_OK && info->subtree_level)
        status = open_list(file, head, EBPO_A_CHUNK_DIRECTORY, &file->has_directory, error);
    if (status == EBPO_OK)
        status = open_checksums(file, head, EBPO_A_CHECKSUM_INDEX, error);
    if (status == EBPO_OK && file->has_checksums)
        status = open_pages(file, head, error);
    else if (status == EBPO_OK)
        status = open_checksums(file, head, EBPO_A_CHUNK_CHECKSUMS, error);
    if (status == EBPO_OK)
        status = check_group(head, "/mesh", info->parts & EBPO_PART_MESH, error);
    if (status == EBPO_OK)
        status = check_group(head, "/maps", info->parts & EBPO_PART_MAPS, error);
    if (status == EBPO_OK)
        status = check_group(head, "/border", info->parts & EBPO_PART_BORDER, error);
    if (status == EBPO_OK)
        status = check_group(head, "/surface", info->parts & EBPO_PART_SURFACE, error);
    for (int level = 0; level < info->level_count; level++)
        for (int id = 0; id < EBPO_LEVEL_ARRAYS && status == EBPO_OK; id++) {
            const ebpo_array_in *a = &file->level_array[level][id];
            status = open_array(file, head, (ebpo_array_id)id, level, error);
            if (level == 0 && id == EBPO_A_TYPES && a->chunks)
                info->head_bytes = a->chunks[0].address; /* the first array in the file */
        }
    for (int id = EBPO_LEVEL_ARRAYS; id < EBPO_A_CHUNK_DIRECTORY && status == EBPO_OK; id++)
        status = open_array(file, head, (ebpo_array_id)id, 0, error);
    if (status == EBPO_OK)
        status = ebpo_attributes_open(file, head, error);
    ebpo_pipeline pipeline = file->level_array[0][EBPO_A_TYPES].shape.pipeline;
    info->codec = pipeline == EBPO_PIPELINE_BARE ? EBPO_CODEC_NONE : (ebpo_codec)pipeline;
    if (status == EBPO_OK)
        status = check_pipelines(file, error);
    return status == EBPO_OK ? ebpo_stored_check(file, error) : status;
}

/* Discards the stated location of HDF5's chunk indexes if it is impossible, as in files that other
 * programs have rewritten. The location only makes reading faster. */
static void discard_bad_index(ebpo_info *info, uint64_t size)
{
    enum { INDEX_BYTES_MAX = 64 << 20 }; /* limited, because the whole range is read at once */
    if (info->chunk_index_offset > size ||
        info->chunk_index_bytes > size - info->chunk_index_offset ||
        info->chunk_index_bytes > INDEX_BYTES_MAX)
        info->chunk_index_offset = info->chunk_index_bytes = 0;
}

/* Reads and checks the header: HDF5 attributes and the shapes of all arrays. */
static ebpo_status read_head(ebpo_file *file, ebpo_head *head, ebpo_error *error)
{
    ebpo_head_object root;
    file->end = head->end;
    ebpo_status status = ebpo_head_open_group(head, "/", &root, error);
    if (status == EBPO_OK)
        status = ebpo_facts_get(head, root, &file->info, error);
    discard_bad_index(&file->info, file->in.source.size);
    ebpo_head_hint_index(head, (ebpo_range){ file->info.chunk_index_offset,
                                             file->info.chunk_index_bytes });
    if (status == EBPO_OK &&
        (file->info.level_count < 1 || file->info.level_count > EBPO_LEVELS_MAX))
        status = ebpo_fail_at(error, EBPO_E_FORMAT, file->in.shown, "/", -1,
                              "level_count is not 1 to %d; get a fresh copy of the file",
                              EBPO_LEVELS_MAX);
    if (status == EBPO_OK)
        status = open_levels(file, head, error);
    if (status == EBPO_OK)
        status = ebpo_facts_check(&file->info, file->in.shown, EBPO_E_FORMAT, error);
    return status == EBPO_OK ? open_arrays(file, head, error) : status;
}

/* Compares the content checksum if the file's chunks have no checksums (`h5repack -f NONE` writes
 * such files); does nothing for other files. Called before any data are returned, because nothing
 * else detects a changed chunk without a checksum. */
static ebpo_status check_bare(const ebpo_file *file, ebpo_error *error)
{
    return file->level_array[0][EBPO_A_TYPES].shape.pipeline == EBPO_PIPELINE_BARE
               ? ebpo_file_check_content(file, NULL, error)
               : EBPO_OK;
}

/* Returns true if the first bytes identify HDF5 (byte 0x89), or another type that
 * ebpo_wrong_kind_of_file knows. In this case, the error of opening already names the type. */
static bool head_names_kind(const uint8_t *begin, uint64_t size)
{
    return (size && begin[0] == 0x89) || ebpo_wrong_kind_of_file(begin, size);
}

/* Returns the format of the mesh that begins with these bytes, or NULL. */
static const ebpo_import_format *mesh_format(const uint8_t *begin, uint64_t size,
                                             uint64_t whole_size)
{
    const ebpo_import_format *format = ebpo_import_recognise(begin, size, "");
    if (format && format->beginning_decides)
        return format;
    if (ebpo_stl_states_size(begin, size, whole_size)) /* binary STL may begin with any bytes */
        return &ebpo_import_stl;
    return head_names_kind(begin, size) ? NULL : format;
}

/* Returns a description, with advice, of a file type that users often confuse with this format. The
 * first bytes identify the type. Returns NULL if the type is unknown or the error already names it.
 */
static const char *other_kind(const uint8_t *begin, uint64_t size)
{
    return size == 0                      ? "an empty file; get a fresh copy of the file"
           : head_names_kind(begin, size) ? NULL
           : begin[0] == '{' /* JSON */
               ? "JSON; use 'ebpo scene' for a scene, or a command that reads a catalogue"
               : NULL;
}

/* If opening has failed and the file is of another known type, replaces the error by an error that
 * names this type. */
static ebpo_status name_kind(ebpo_file *file, ebpo_status status, ebpo_error *error)
{
    enum { BEGIN = 4096 };
    uint64_t size = file->in.source.size < BEGIN ? file->in.source.size : BEGIN;
    uint8_t begin[BEGIN];
    if (ebpo_input_read(&file->in, 0, size, begin, NULL) != EBPO_OK)
        return status;
    const ebpo_import_format *mesh = mesh_format(begin, size, file->in.source.size);
    if (mesh)
        return ebpo_fail_file(error, status, file->in.shown,
                              "is not an .ebpo.h5 file, but %s; convert it with 'ebpo convert'",
                              mesh->called);
    const char *kind = other_kind(begin, size);
    return kind ? ebpo_fail_file(error, status, file->in.shown, "is not an .ebpo.h5 file, but %s",
                                 kind)
                : status;
}

/* Opens a file from a source. Takes ownership of the source, also on failure. */
static ebpo_status open_source(ebpo_file **out, const ebpo_source *source, const char *name,
                               uint64_t max_expansion, ebpo_error *error)
{
    ebpo_file *file = ebpo_alloc_zero(1, sizeof *file);
    if (!file) {
        if (source->close)
            source->close(source->user);
        return ebpo_fail_memory(error, sizeof *file);
    }
    ebpo_head head = EBPO_HEAD_INIT;
    pthread_mutex_init(&file->lock, NULL);
    ebpo_idle_readers_make(&file->idle);
    atomic_init(&file->located, true);
    atomic_init(&file->checksums_read, false);
    atomic_init(&file->pages_ready, false);
    ebpo_status status = ebpo_input_open(&file->in, source, name, error);
    if (status == EBPO_OK) {
        status = ebpo_head_open(&head, &file->in, error);
        if (status == EBPO_OK)
            status = read_head(file, &head, error);
        status = ebpo_head_close(&head, status, error);
        if (status == EBPO_E_FORMAT)
            status = name_kind(file, status, error);
    }
    if (status == EBPO_OK)
        status = ebpo_stored_check_expansion(file, max_expansion, error);
    if (status == EBPO_OK)
        status = check_bare(file, error);
    if (status == EBPO_OK)
        *out = file;
    else
        ebpo_close(file);
    return status;
}

/* Checks a caller's source and opens it. */
static ebpo_status open_bytes(const ebpo_source *source, const char *name, uint64_t max_expansion,
                              ebpo_file **out, ebpo_error *error)
{
    ebpo_source own = EBPO_SOURCE_INIT;
    ebpo_status status = EBPO_TAKE(ebpo_source, &own, source, error);
    /* a source with unknown members (of a newer ebpo_source) is refused, but must be closed */
    if (status == EBPO_E_UNSUPPORTED && source->close)
        source->close(source->user);
    if (status != EBPO_OK)
        return status;
    if (own.read)
        return open_source(out, &own, name ? name : "source", max_expansion, error);
    if (own.close)
        own.close(own.user);
    return ebpo_fail_file(error, EBPO_E_ARGUMENT, name ? name : "source",
                          "the source has no read function; set one");
}

ebpo_status ebpo_open_with(const char *path, const ebpo_open_options *options, ebpo_file **out,
                           ebpo_error *error)
{
    EBPO_DEFAULT_FP;
    ebpo_open_options own = EBPO_OPEN_OPTIONS_INIT;
    ebpo_source source = EBPO_SOURCE_INIT;
    char shown[EBPO_SHOWN_BYTES];
    *out = NULL;
    ebpo_status status = EBPO_TAKE(ebpo_open_options, &own, options, error);
    if (status == EBPO_OK && own.source)
        return open_bytes(own.source, path, own.max_expansion, out, error);
    if (status == EBPO_OK)
        status = ebpo_is_url(path) ? ebpo_source_of_url(path, own.http, &source, error)
                                   : ebpo_source_of_path(&source, path, error);
    const char *name =
        status == EBPO_OK && ebpo_is_url(path) ? ebpo_url_redact(path, shown, sizeof shown) : path;
    return status == EBPO_OK ? open_source(out, &source, name, own.max_expansion, error) : status;
}

ebpo_status ebpo_open(const char *path, ebpo_file **out, ebpo_error *error)
{
    return ebpo_open_with(path, NULL, out, error);
}

ebpo_status ebpo_open_own(const char *path, ebpo_file **out, ebpo_error *error)
{
    ebpo_open_options no_limit = EBPO_OPEN_OPTIONS_INIT;
    no_limit.max_expansion = UINT64_MAX;
    return ebpo_open_with(path, &no_limit, out, error);
}

ebpo_status ebpo_open_url(const char *url, const ebpo_http_options *http, ebpo_file **out,
                          ebpo_error *error)
{
    EBPO_DEFAULT_FP;
    ebpo_source source = EBPO_SOURCE_INIT;
    char shown[EBPO_SHOWN_BYTES];
    *out = NULL;
    ebpo_status status = ebpo_source_of_url(url, http, &source, error);
    return status == EBPO_OK
               ? open_source(out, &source, ebpo_url_redact(url, shown, sizeof shown), 0, error)
               : status;
}

ebpo_status ebpo_open_memory(const void *data, uint64_t size, const char *name, ebpo_file **out,
                             ebpo_error *error)
{
    EBPO_DEFAULT_FP;
    *out = NULL;
    if (!data && size)
        return ebpo_fail_file(error, EBPO_E_ARGUMENT, name ? name : "memory",
                              "the pointer to the data is NULL; pass the file's bytes and their "
                              "number");
    ebpo_source source = ebpo_source_of_memory(data, size);
    return open_source(out, &source, name ? name : "memory", 0, error);
}

ebpo_status ebpo_open_source(const ebpo_source *source, const char *name, ebpo_file **out,
                             ebpo_error *error)
{
    EBPO_DEFAULT_FP;
    *out = NULL;
    return open_bytes(source, name, 0, out, error);
}

void ebpo_close(ebpo_file *file)
{
    if (!file)
        return;
    for (int i = 0; i < EBPO_LEVELS_MAX * EBPO_LEVEL_ARRAYS; i++)
        free(file->level_array[i / EBPO_LEVEL_ARRAYS][i % EBPO_LEVEL_ARRAYS].chunks);
    for (int i = 0; i < EBPO_ARRAYS; i++)
        free(file->root_array[i].chunks);
    free(file->checksums);
    free(file->page_value);
    free(file->page_read);
    ebpo_attributes_close(file);
    ebpo_input_close(&file->in);
    ebpo_idle_readers_free(&file->idle);
    pthread_mutex_destroy(&file->lock);
    free(file);
}

ebpo_status ebpo_file_get_stats(const ebpo_file *file, ebpo_file_stats *out)
{
    ebpo_file_stats stats = EBPO_FILE_STATS_INIT;
    stats.bytes_read = atomic_load(&file->in.bytes);
    stats.reads = atomic_load(&file->in.reads);
    return EBPO_GIVE(ebpo_file_stats, out, &stats);
}

ebpo_status ebpo_file_get_http_stats(const ebpo_file *file, ebpo_http_stats *out)
{
    ebpo_http_stats stats = EBPO_HTTP_STATS_INIT;
    bool reported = ebpo_source_http_stats(&file->in.source, &stats);
    ebpo_status status = EBPO_GIVE(ebpo_http_stats, out, &stats);
    return status == EBPO_OK && !reported ? EBPO_E_ABSENT : status;
}

const ebpo_info *ebpo_file_info(const ebpo_file *file) { return &file->info; }

ebpo_status ebpo_register_filters(ebpo_error *error) { return ebpo_h5_register(error); }

/* --- files that other programs have rewritten --- */

enum {
    PIECE = 4 << 20,         /* bytes of one read of a download */
    BYTES_A_SECOND = 4 << 20 /* speed of copying, in bytes, that the default time limit assumes */
};

/* A temporary file that libhdf5 opens by its name. fd: -1 if there is no file. */
typedef struct temporary {
    int fd;
    char name[PATH_MAX];
} temporary;

/* Creates an empty temporary file in TMPDIR. */
static ebpo_status make_temporary(temporary *t, const char *shown, ebpo_error *error)
{
    const char *folder = getenv("TMPDIR");
    snprintf(t->name, sizeof t->name, "%s/.ebpo-compat-XXXXXX",
             folder && *folder ? folder : "/tmp");
    t->fd = mkostemp(t->name, O_CLOEXEC);
    return t->fd >= 0
               ? EBPO_OK
               : ebpo_fail_errno(error, shown, "a temporary copy could not be created in TMPDIR");
}

static void remove_temporary(temporary *t)
{
    if (t->fd < 0)
        return;
    unlink(t->name); /* fails if ebpo_h5_clean_copy has removed the name */
    close(t->fd);
}

/* Writes bytes to the temporary copy at the offset `at`. */
static ebpo_status write_piece(int fd, const char *shown, uint64_t at, const uint8_t *data,
                               uint64_t bytes, ebpo_error *error)
{
    while (bytes > 0) {
        ssize_t done = pwrite(fd, data, (size_t)bytes, (off_t)at);
        if (done < 0 && errno == EINTR)
            continue;
        if (done <= 0)
            return ebpo_fail_errno(error, shown,
                                   "the temporary copy in TMPDIR could not be written");
        data += done;
        at += (uint64_t)done;
        bytes -= (uint64_t)done;
    }
    return EBPO_OK;
}

/* Downloads a complete file to the descriptor `to`. */
static ebpo_status fetch_url(const char *url, const ebpo_http_options *http, const char *shown,
                             int to, ebpo_error *error)
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

/* Sets *from to the name under which libhdf5 opens the file, and *bytes to the file's size.
 * Downloads a remote file first, to `fetched`. */
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

/* Opens the copy by its descriptor `to`, and checks its content checksum. The descriptor stays
 * open. */
static ebpo_status open_copy(int to, const char *shown, const ebpo_compat_options *o,
                             ebpo_file **out, ebpo_error *error)
{
    char name[32];
    ebpo_source source = EBPO_SOURCE_INIT;
    ebpo_read_options read = EBPO_READ_OPTIONS_INIT;
    ebpo_open_options open = EBPO_OPEN_OPTIONS_INIT;
    read.threads = o->threads;
    open.source = &source;
    open.max_expansion = o->max_expansion;
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

/* Returns true if the copy does not have the HDF5 object `object`, which an error names. */
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
    bool absent = status == EBPO_OK && ebpo_head_find_kind(&head, object) == EBPO_HEAD_ABSENT;
    (void)!ebpo_head_close(&head, status, NULL);
    ebpo_input_close(&input);
    return absent;
}

/* Opens a file that another program has rewritten: copies the file in a separate process, and opens
 * the copy. */
static ebpo_status open_foreign(const char *path, const ebpo_compat_options *o, ebpo_file **out,
                                ebpo_error *error)
{
    enum { EXTRA_BYTES = 64 << 20 }; /* the copy has at most twice the file's size plus this */
    char redacted[EBPO_SHOWN_BYTES];
    const char *shown = ebpo_is_url(path) ? ebpo_url_redact(path, redacted, sizeof redacted) : path;
    ebpo_process_limits limits = { o->memory_bytes, EXTRA_BYTES, o->seconds };
    temporary fetched = { .fd = -1 }, copy = { .fd = -1 };
    const char *from = NULL;
    uint64_t bytes = 0;
    ebpo_status status = find_from(path, o->http, shown, &fetched, &from, &bytes, error);
    if (status == EBPO_OK)
        status = make_temporary(&copy, shown, error);
    limits.file_bytes += 2 * bytes;
    if (!limits.seconds) /* enough: decoding and encoding a MiB take about 1/20 second */
        limits.seconds = 60 + (unsigned)(bytes / BYTES_A_SECOND);
    ebpo_error copy_error = EBPO_ERROR_INIT, open_error = EBPO_ERROR_INIT;
    if (status == EBPO_OK)
        status = ebpo_h5_clean_copy(from, fetched.fd >= 0, copy.name, shown,
                                    ebpo_rows_of_foreign_chunk, &limits, &copy_error, error);
    if (status == EBPO_OK && open_copy(copy.fd, shown, o, out, &open_error) != EBPO_OK)
        status = ebpo_fail_with(error,
                                *copy_error.message && copy_lacks(copy.fd, shown, open_error.object)
                                    ? &copy_error /* states why the copy lacks the object */
                                    : &open_error);
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
    open.max_expansion = own.max_expansion;
    open.http = own.http;
    status = ebpo_open_with(path, &open, out, &first);
    if (status == EBPO_E_UNSUPPORTED)
        return open_foreign(path, &own, out, error);
    return status == EBPO_OK ? EBPO_OK : ebpo_fail_with(error, &first);
}
