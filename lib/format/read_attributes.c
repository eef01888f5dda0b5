/* Reads attributes of vertices, faces and other elements of the source. When a file is opened, the
 * arrays of /attributes are located, and their HDF5 attributes (names, types, ranges, lists of
 * different lengths) are checked. Values are read later, as whole arrays; ebpo_attributes_check
 * compares them with the part's checksum. A row of an array may be a list. For lists of different
 * lengths, one array has the ends of the lists, and another array has their items. Source:
 * format-spec/attributes.md. */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "core/alloc.h"
#include "core/workspace.h"
#include "core/error.h"
#include "core/checksum.h"
#include "format/content_checksum.h"
#include "format/head_facts.h"
#include "format/read_attributes.h"
#include "format/reader.h"
#include "format/schema.h"
#include "hdf5_read/coding.h"
#include "mesh/textures.h"

/* Returns EBPO_E_FORMAT for a wrong array or HDF5 attribute at `path`. */
static ebpo_status attribute_head_wrong(const ebpo_file *file, const char *path, const char *what,
                                        ebpo_error *error)
{
    return ebpo_fail_at(error, EBPO_E_FORMAT, file->in.shown, path, -1,
                        "%s; get a fresh copy of the file", what);
}

/* Turns EBPO_E_ABSENT, the status of reading a required HDF5 attribute, into an error that names
 * the attribute. Returns any other status unchanged. */
static ebpo_status required_value(const ebpo_file *file, const char *path, ebpo_status status,
                                  const char *name, ebpo_error *error)
{
    char what[64];
    if (status != EBPO_E_ABSENT)
        return status;
    snprintf(what, sizeof what, "attribute %s is missing", name);
    return attribute_head_wrong(file, path, what, error);
}

static ebpo_status get_type(ebpo_file *file, ebpo_head *head, ebpo_head_object id, const char *path,
                            const char *name, int *type, ebpo_error *error)
{
    char word[16];
    ebpo_status status = ebpo_head_get_text(head, id, path, name, word, sizeof word, error);
    if (status != EBPO_OK)
        return status;
    *type = ebpo_attribute_type_of(word);
    return *type >= 0 ? EBPO_OK : attribute_head_wrong(file, path, "unknown number type", error);
}

/* Reads the HDF5 attributes of lists. Sets a->list to the type of the lists' lengths in the source,
 * or to EBPO_ATTRIBUTE_NO_LIST if rows are not lists. *different: true if the lengths differ. */
static ebpo_status get_list(ebpo_file *file, ebpo_head *head, ebpo_head_object id, const char *path,
                            ebpo_attribute *a, bool *different, ebpo_error *error)
{
    uint64_t differ = 0;
    a->list = EBPO_ATTRIBUTE_NO_LIST;
    *different = false;
    ebpo_status status = get_type(file, head, id, path, "list", &a->list, error);
    if (status == EBPO_E_ABSENT)
        return EBPO_OK;
    if (status == EBPO_OK && a->list >= EBPO_ATTRIBUTE_FLOAT32)
        status = attribute_head_wrong(file, path, "a list length is not an integer", error);
    if (status == EBPO_OK)
        status = ebpo_head_get_count(head, id, path, "lengths_differ", &differ, error);
    if (status == EBPO_E_ABSENT) /* the former name */
        status = ebpo_head_get_count(head, id, path, "different", &differ, error);
    status = required_value(file, path, status, "lengths_differ", error);
    if (status == EBPO_OK && differ > 1)
        status =
            attribute_head_wrong(file, path, "attribute lengths_differ is neither 0 nor 1", error);
    *different = differ;
    return status;
}

static ebpo_status get_head(ebpo_file *file, ebpo_head *head, const char *path,
                            ebpo_attribute_in *to, ebpo_error *error)
{
    ebpo_attribute *a = &to->head;
    ebpo_head_object id;
    int type = 0;
    ebpo_status status = ebpo_head_open_array(head, path, &id, error);
    if (status == EBPO_OK)
        status = required_value(file, path,
                                ebpo_head_get_text(head, id, path, "element", a->element,
                                                   sizeof a->element, error),
                                "element", error);
    if (status == EBPO_OK)
        status = ebpo_head_get_text(head, id, path, "columns", a->names, sizeof a->names, error);
    if (status == EBPO_E_ABSENT) /* the former name */
        status = ebpo_head_get_text(head, id, path, "names", a->names, sizeof a->names, error);
    status = required_value(file, path, status, "columns", error);
    if (status == EBPO_OK)
        status = required_value(file, path, get_type(file, head, id, path, "type", &type, error),
                                "type", error);
    a->type = (ebpo_attribute_type)type;
    if (status == EBPO_OK)
        status = get_list(file, head, id, path, a, &to->different, error);
    if (status == EBPO_OK)
        to->has_range = ebpo_head_get_real(head, id, path, "range", to->range, 2, NULL) == EBPO_OK;
    return status;
}

static ebpo_status open_array(ebpo_file *file, ebpo_head *head, int number, ebpo_error *error)
{
    ebpo_array_in *a = &file->attributes.array[number];
    char coding[EBPO_HEAD_CODING_BYTES];
    *a = (ebpo_array_in){ .id = EBPO_A_ATTRIBUTE, .level = number };
    ebpo_attribute_path(number, a->path);
    /* in remote files and files with a chunk directory, several chunks are located later */
    uint64_t max_chunks = ebpo_input_is_remote(&file->in) || file->has_directory ? 1 : UINT64_MAX;
    ebpo_status status =
        ebpo_head_read_array(head, a->path, max_chunks,
                             ebpo_reader_rows_of_chunk(file, EBPO_A_ATTRIBUTE), &a->shape, coding,
                             &a->chunks, &a->stored_bytes, error);
    if (status != EBPO_OK)
        return status;
    if (strcmp(coding, EBPO_CODING_COLUMNS_FORMER) == 0)
        snprintf(coding, sizeof coding, "%s", ebpo_coding_columns);
    a->coding = strcmp(coding, ebpo_coding_columns) == 0 ? ebpo_coding_columns : ebpo_coding_plain;
    a->present = true;
    if (!a->chunks)
        atomic_store(&file->located, false);
    if (strcmp(coding, a->coding) != 0) /* neither of the two codings */
        return attribute_head_wrong(file, a->path, "the array's coding is not valid for this array",
                                    error);
    return a->shape.is_signed
               ? attribute_head_wrong(file, a->path,
                                      "the array has the wrong type or the wrong number of columns",
                                      error)
               : EBPO_OK;
}

/* Checks the shape of an array against its HDF5 attributes. Returns the error's text or NULL. */
static const char *check_shape(const ebpo_file *file, const ebpo_array_in *array,
                               const ebpo_attribute_in *attribute)
{
    const ebpo_attribute *a = &attribute->head;
    uint32_t names = 1; /* number of names, which single spaces separate */
    for (const char *s = a->names; *s; s++) {
        names += *s == ' ';
        if (*s == ' ' && (s == a->names || s[1] == ' ' || !s[1]))
            return "the names are not separated by single spaces";
    }
    if (!a->element[0] || strchr(a->element, ' ') || !a->names[0])
        return "the array has no names, or no element";
    /* flat: the array has one dimension */
    bool list = a->list != EBPO_ATTRIBUTE_NO_LIST,
         flat = attribute->different || (!list && names == 1);
    if ((list && names != 1) || (array->shape.cols == 0) != flat ||
        array->shape.cols > EBPO_ATTRIBUTE_COLUMNS ||
        (!flat && !list && array->shape.cols != names))
        return "the array does not have a column for each name";
    if (array->shape.element_size != (attribute->different ? 8 : ebpo_attribute_bytes(a->type)))
        return "the array's element size does not match its type";
    bool vertex = ebpo_attribute_is_of(a, "vertex");
    if (ebpo_attribute_is_of_mesh(a) &&
        array->shape.rows != (vertex ? file->info.vertex_count : file->info.face_count))
        return "the array's row count differs from the mesh";
    return NULL;
}

/* Checks that attribute array n has as many rows as each preceding array of its element ("vertex",
 * "material"). Returns the error's text or NULL. */
static const char *check_element(const ebpo_file *file, uint64_t n)
{
    const ebpo_attribute_in *all = file->attributes.head;
    for (uint64_t i = 0; i < n; i++)
        if (strcmp(all[i].head.element, all[n].head.element) == 0 &&
            all[i].head.rows != all[n].head.rows)
            return "the array's row count differs from another array of its element";
    return NULL;
}

/* Checks the sizes of an array of textures. Texts must be small, because `ebpo info` reads them.
 * Returns the error's text or NULL. */
static const char *check_textures(const ebpo_attribute_in *attribute, const ebpo_array_in *items)
{
    bool texts = strcmp(attribute->head.names, ebpo_texture_array_name(EBPO_TEXTURE_BYTES)) != 0;
    if (!ebpo_attribute_is_of_textures(&attribute->head))
        return NULL;
    if (attribute->head.rows > EBPO_TEXTURES)
        return "too many textures";
    return texts && items->present && items->shape.rows > EBPO_TEXTURE_TEXTS
               ? "the texts of textures are too long"
               : NULL;
}

/* Opens the array with the items of the lists of attribute array n. */
static ebpo_status open_items(ebpo_file *file, ebpo_head *head, uint64_t n, ebpo_error *error)
{
    const ebpo_array_in *items = &file->attributes.array[ebpo_items_number(n)];
    ebpo_status status = open_array(file, head, ebpo_items_number(n), error);
    if (status == EBPO_OK &&
        (items->shape.cols ||
         items->shape.element_size != ebpo_attribute_bytes(file->attributes.head[n].head.type)))
        status = attribute_head_wrong(file, items->path,
                                      "the array's element size does not match its type", error);
    return status;
}

/* Opens and checks attribute array n. */
static ebpo_status open_one(ebpo_file *file, ebpo_head *head, uint64_t n, ebpo_error *error)
{
    ebpo_attribute_in *to = &file->attributes.head[n];
    const ebpo_array_in *values = &file->attributes.array[ebpo_values_number(n)],
                        *items = &file->attributes.array[ebpo_items_number(n)];
    char path[EBPO_PATH_BYTES];
    ebpo_status status = open_array(file, head, ebpo_values_number(n), error);
    if (status == EBPO_OK)
        status = get_head(file, head, values->path, to, error);
    const char *what = status == EBPO_OK ? check_shape(file, values, to) : NULL;
    to->head.rows = values->shape.rows;
    to->head.columns = values->shape.cols ? values->shape.cols : 1;
    if (status == EBPO_OK && !what)
        what = check_element(file, n);
    if (what)
        return attribute_head_wrong(file, values->path, what, error);
    ebpo_attribute_path(ebpo_items_number(n), path);
    if (status == EBPO_OK && to->different && ebpo_head_find_kind(head, path) != EBPO_HEAD_ABSENT)
        status = open_items(file, head, n, error);
    what = status == EBPO_OK ? check_textures(to, items) : NULL;
    return what ? attribute_head_wrong(file, values->path, what, error) : status;
}

/* Opens the array with the source's header text, if the file has it. */
static ebpo_status open_header(ebpo_file *file, ebpo_head *head, ebpo_error *error)
{
    const ebpo_array_in *header = &file->attributes.array[0];
    char path[EBPO_PATH_BYTES];
    ebpo_attribute_path(0, path);
    if (ebpo_head_find_kind(head, path) == EBPO_HEAD_ABSENT)
        return EBPO_OK;
    ebpo_status status = open_array(file, head, 0, error);
    if (status == EBPO_OK &&
        (header->shape.cols || header->shape.element_size != 1 ||
         header->coding != ebpo_coding_plain || header->shape.rows > EBPO_ATTRIBUTE_HEADER))
        status =
            attribute_head_wrong(file, path, "the header does not consist of bytes, or is too long",
                                 error);
    return status;
}

/* Reads the HDF5 attributes of the group /attributes, and allocates file->attributes. */
static ebpo_status open_group(ebpo_file *file, ebpo_head *head, ebpo_error *error)
{
    static const char path[] = "/attributes";
    ebpo_attributes_in *all = &file->attributes;
    ebpo_head_object id;
    ebpo_status status = ebpo_head_open_group(head, path, &id, error);
    if (status != EBPO_OK)
        return status;
    status = required_value(file, path,
                            ebpo_head_get_count(head, id, path, "arrays", &all->count, error),
                            "arrays", error);
    if (status == EBPO_OK)
        status = ebpo_facts_get_digest(head, id, path, "sha256", all->sha256, error);
    if (status == EBPO_OK && all->count > EBPO_ATTRIBUTE_ARRAYS)
        status = attribute_head_wrong(file, path, "too many arrays", error);
    if (status != EBPO_OK)
        return status;
    all->array = ebpo_alloc_zero(1 + 2 * all->count, sizeof *all->array);
    all->head = ebpo_alloc_zero(all->count, sizeof *all->head);
    if (!all->array || !all->head)
        return ebpo_fail_memory(error, (1 + 2 * all->count) * sizeof *all->array);
    all->arrays = (int)(1 + 2 * all->count);
    return EBPO_OK;
}

ebpo_status ebpo_attributes_open(ebpo_file *file, ebpo_head *head, ebpo_error *error)
{
    if (!(file->info.parts & EBPO_PART_ATTRIBUTES))
        return EBPO_OK;
    ebpo_status status = open_group(file, head, error);
    if (status == EBPO_OK)
        status = open_header(file, head, error);
    for (uint64_t n = 0; n < file->attributes.count && status == EBPO_OK; n++)
        status = open_one(file, head, n, error);
    return status;
}

void ebpo_attributes_close(ebpo_file *file)
{
    for (int i = 0; i < file->attributes.arrays; i++)
        free(file->attributes.array[i].chunks);
    free(file->attributes.array);
    free(file->attributes.head);
}

/* Describes an array. `different`: its rows are lists of different lengths. */
static ebpo_attribute_facts facts_of(const ebpo_attribute *a, bool different)
{
    ebpo_attribute_facts facts = { .type = a->type,
                                   .rows = a->rows,
                                   .columns = different ? 0 : a->columns,
                                   .list = a->list != EBPO_ATTRIBUTE_NO_LIST };
    snprintf(facts.element, sizeof facts.element, "%s", a->element);
    snprintf(facts.names, sizeof facts.names, "%s", a->names);
    return facts;
}

bool ebpo_mesh_attribute(const ebpo_mesh *mesh, unsigned n, ebpo_attribute_facts *out,
                         ebpo_attribute_values *values)
{
    if (!mesh->attributes || n >= mesh->attributes->count)
        return false;
    const ebpo_attribute *a = &mesh->attributes->array[n];
    ebpo_attribute_facts facts = facts_of(a, a->ends != NULL);
    if (EBPO_GIVE(ebpo_attribute_facts, out, &facts) != EBPO_OK)
        return false;
    *values = (ebpo_attribute_values){ .values = a->values,
                                       .ends = a->ends,
                                       .count = ebpo_attribute_value_count(a) };
    return true;
}

bool ebpo_file_attribute(const ebpo_file *file, unsigned n, ebpo_attribute_facts *out)
{
    if (n >= file->attributes.count)
        return false;
    const ebpo_attribute_in *attribute = &file->attributes.head[n];
    ebpo_attribute_facts facts = facts_of(&attribute->head, attribute->different);
    facts.has_range = attribute->has_range;
    memcpy(facts.range, attribute->range, sizeof facts.range);
    for (int i = ebpo_values_number(n); i <= ebpo_items_number(n); i++)
        facts.stored_bytes += ebpo_reader_stored_bytes(file, &file->attributes.array[i]);
    return EBPO_GIVE(ebpo_attribute_facts, out, &facts) == EBPO_OK;
}

const char *ebpo_attribute_type_text(uint64_t type)
{
    return type <= EBPO_ATTRIBUTE_FLOAT64 ? ebpo_attribute_type_name((ebpo_attribute_type)type)
                                          : NULL;
}

/* --- reading whole arrays, and checking the part's checksum --- */

/* Returns true if an array of /attributes contains floating-point numbers. Array 0 is the header;
 * odd numbers are values (or ends of lists), even numbers are items of lists. */
static bool floats_in(const ebpo_file *file, const ebpo_array_in *array)
{
    if (array->level == 0)
        return false;
    const ebpo_attribute_in *attribute = &file->attributes.head[(array->level - 1) / 2];
    bool ends = array->level % 2 && attribute->different;
    return !ends && ebpo_attribute_is_float(attribute->head.type);
}

void ebpo_attribute_decode(const ebpo_file *file, const ebpo_array_in *array, uint64_t rows,
                           const uint8_t *raw, void *values)
{
    unsigned size = array->shape.element_size;
    uint32_t cols = array->shape.cols ? array->shape.cols : 1;
    if (array->coding == ebpo_coding_columns)
        ebpo_columns_decode(raw, size, floats_in(file, array), rows, cols, values);
    else
        ebpo_integers_decode(raw, size, false, rows * cols, values, size);
}

/* Memory for the decoded values of an array. */
typedef struct target {
    const ebpo_file *file;
    uint8_t *values;
} target;

static ebpo_status decode_attribute_rows(void *context, const ebpo_array_in *array, uint64_t chunk,
                                         uint64_t row, uint64_t rows, const uint8_t *bytes,
                                         ebpo_error *error)
{
    const target *t = context;
    (void)chunk, (void)error;
    ebpo_attribute_decode(t->file, array, rows, bytes,
                          t->values + row * ebpo_shape_row_bytes(&array->shape));
    return EBPO_OK;
}

/* Reads array `number` of /attributes into new memory. *values is NULL if the array is absent. */
static ebpo_status read_array(const ebpo_file *file, int number, const ebpo_read_options *read,
                              uint8_t **values, ebpo_error *error)
{
    const ebpo_array_in *array = &file->attributes.array[number];
    *values = NULL;
    if (!array->present)
        return EBPO_OK;
    uint64_t bytes = array->shape.rows * ebpo_shape_row_bytes(&array->shape);
    *values = ebpo_array_alloc(read->workspace, bytes, 1);
    if (!*values)
        return ebpo_workspace_fail(read->workspace, bytes, error);
    target t = { file, *values };
    return ebpo_reader_rows(file, array, read, decode_attribute_rows, &t, error);
}

/* Checks that the ends of the lists ascend and that the last end is the number of items. */
static ebpo_status check_ends(const ebpo_file *file, uint64_t n, const ebpo_attribute *a,
                              ebpo_workspace *workspace, ebpo_error *error)
{
    const ebpo_array_in *items = &file->attributes.array[ebpo_items_number(n)],
                        *ends = &file->attributes.array[ebpo_values_number(n)];
    uint64_t before = 0;
    bool good = true;
    EBPO_FOR_ITEMS(workspace, i, 0, a->rows) {
        good = good && a->ends[i] >= before;
        before = a->ends[i];
    }
    ebpo_check check = ebpo_reader_check(file, NULL);
    return good && before == (items->present ? items->shape.rows : 0)
               ? EBPO_OK
               : ebpo_check_fail(&check, -1, ends->path,
                                 "the ends of the lists do not match their items", error);
}

/* Reads the values of attribute array n into a->values. For lists of different lengths, reads the
 * ends into a->ends and, if `ends_only` is false, the items into a->values. */
static ebpo_status read_parts(const ebpo_file *file, uint64_t n, const ebpo_read_options *read,
                              bool ends_only, ebpo_attribute *a, ebpo_error *error)
{
    uint8_t *values;
    if (ends_only && !file->attributes.head[n].different)
        return EBPO_OK;
    ebpo_status status = read_array(file, ebpo_values_number(n), read, &values, error);
    if (!file->attributes.head[n].different) {
        a->values = values;
        return status;
    }
    a->ends = (uint64_t *)(void *)values;
    if (status == EBPO_OK)
        status = check_ends(file, n, a, read->workspace, error);
    return status == EBPO_OK && !ends_only
               ? read_array(file, ebpo_items_number(n), read, &a->values, error)
               : status;
}

/* Reads attribute array n. */
static ebpo_status read_one(const ebpo_file *file, uint64_t n, const ebpo_read_options *read,
                            ebpo_attribute *a, ebpo_error *error)
{
    return read_parts(file, n, read, false, a, error);
}

static ebpo_status read_header(const ebpo_file *file, ebpo_attributes *to, ebpo_error *error)
{
    const ebpo_array_in *array = &file->attributes.array[0];
    if (!array->present)
        return EBPO_OK;
    to->header_bytes = array->shape.rows;
    to->header = ebpo_alloc(to->header_bytes, 1);
    if (!to->header)
        return ebpo_fail_memory(error, to->header_bytes);
    target t = { file, (uint8_t *)to->header };
    ebpo_read_options read = ebpo_read_threads(1);
    return ebpo_reader_rows(file, array, &read, decode_attribute_rows, &t, error);
}

ebpo_status ebpo_attributes_read_head(const ebpo_file *file, const ebpo_read_options *read,
                                      ebpo_attributes **out, ebpo_error *error)
{
    *out = NULL;
    if (!(file->info.parts & EBPO_PART_ATTRIBUTES))
        return EBPO_OK;
    ebpo_attributes *made = ebpo_attributes_make(read->workspace);
    ebpo_status status =
        made ? read_header(file, made, error) : ebpo_fail_memory(error, sizeof *made);
    for (uint64_t n = 0; n < file->attributes.count && status == EBPO_OK; n++)
        if (!ebpo_attributes_add(made, &file->attributes.head[n].head))
            status = ebpo_fail_memory(error, sizeof *made->array);
    if (status == EBPO_OK)
        *out = made;
    else
        ebpo_attributes_free(made);
    return status;
}

ebpo_status ebpo_attributes_read(const ebpo_file *file, const ebpo_read_options *read,
                                 ebpo_attributes **out, ebpo_error *error)
{
    ebpo_attributes *made;
    ebpo_status status = ebpo_attributes_read_head(file, read, &made, error);
    *out = NULL;
    for (uint64_t n = 0; made && n < made->count && status == EBPO_OK; n++)
        status = read_one(file, n, read, &made->array[n], error);
    if (status == EBPO_OK)
        *out = made;
    else
        ebpo_attributes_free(made);
    return status;
}

static ebpo_status fail_images(const ebpo_file *file, ebpo_error *error)
{
    return ebpo_fail_at(error, EBPO_E_FORMAT, file->in.shown, "/attributes", -1,
                        "an image does not match its digest; get a fresh copy of the file");
}

ebpo_status ebpo_attributes_read_textures(const ebpo_file *file, const ebpo_read_options *read,
                                          ebpo_attributes *to, ebpo_error *error)
{
    ebpo_status status = EBPO_OK;
    for (uint64_t n = 0; to && n < to->count && status == EBPO_OK; n++)
        if (ebpo_attribute_is_of_textures(&to->array[n]))
            status = read_one(file, n, read, &to->array[n], error);
    return status;
}

void ebpo_attribute_values_free(ebpo_attribute_values *values)
{
    if (!values)
        return;
    ebpo_array_free(values->workspace, values->values);
    ebpo_array_free(values->workspace, values->ends);
    memset(values, 0, sizeof *values);
}

/* Checks the digests of the texture images. */
static ebpo_status check_images(const ebpo_file *file, const ebpo_read_options *read,
                                ebpo_error *error)
{
    ebpo_attributes *all;
    ebpo_status status = ebpo_attributes_read_head(file, read, &all, error);
    if (status == EBPO_OK)
        status = ebpo_attributes_read_textures(file, read, all, error);
    if (status == EBPO_OK && !ebpo_textures_good(all))
        status = fail_images(file, error);
    ebpo_attributes_free(all);
    return status;
}

/* Checks a caller's arguments and reads attribute array n. Also checks the images before it returns
 * their bytes. */
static ebpo_status read_public(const ebpo_file *file, unsigned n, const ebpo_read_options *options,
                               bool ends_only, ebpo_attribute_values *out, ebpo_error *error)
{
    ebpo_read_options read = EBPO_READ_OPTIONS_INIT;
    ebpo_status status = EBPO_TAKE(ebpo_read_options, &read, options, error);
    memset(out, 0, sizeof *out);
    if (status == EBPO_OK && n >= file->attributes.count)
        status = ebpo_fail_file(error, EBPO_E_ABSENT, file->in.shown,
                                "the file has no attribute array number %u", n);
    if (status != EBPO_OK)
        return status;
    ebpo_attribute a = file->attributes.head[n].head;
    if (!ends_only && ebpo_attribute_is_of_textures(&a) &&
        strcmp(a.names, ebpo_texture_array_name(EBPO_TEXTURE_BYTES)) == 0)
        status = check_images(file, &read, error);
    if (status == EBPO_OK)
        status = read_parts(file, n, &read, ends_only, &a, error);
    *out = (ebpo_attribute_values){ a.values, a.ends, 0, read.workspace };
    if (status == EBPO_OK)
        out->count = ebpo_attribute_value_count(&a);
    else
        ebpo_attribute_values_free(out);
    return status;
}

ebpo_status ebpo_file_read_attribute(const ebpo_file *file, unsigned n,
                                     const ebpo_read_options *options, ebpo_attribute_values *out,
                                     ebpo_error *error)
{
    return read_public(file, n, options, false, out, error);
}

ebpo_status ebpo_file_attribute_ends(const ebpo_file *file, unsigned n,
                                     const ebpo_read_options *options, ebpo_attribute_values *out,
                                     ebpo_error *error)
{
    return read_public(file, n, options, true, out, error);
}

/* Reads all attributes into memory, without a limit, because they are small compared to the mesh.
 */
ebpo_status ebpo_attributes_check(const ebpo_file *file, const ebpo_read_options *read,
                                  ebpo_error *error)
{
    uint8_t digest[32];
    ebpo_attributes *all;
    ebpo_status status = ebpo_attributes_read(file, read, &all, error);
    if (status != EBPO_OK || !all)
        return status;
    status = ebpo_attributes_digest(all, digest, error);
    bool textures = ebpo_textures_good(all);
    ebpo_attributes_free(all);
    if (status == EBPO_OK && ebpo_digest_differs(file->attributes.sha256, digest))
        status = ebpo_fail_at(error, EBPO_E_FORMAT, file->in.shown, "/attributes", -1,
                              "the attributes do not match the attribute sha256: the file was "
                              "changed; get a fresh copy");
    if (status == EBPO_OK && !textures)
        status = fail_images(file, error);
    return status;
}
