/* Opening: the arrays of /attributes and what their heads say. */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "mesh/textures.h"
#include "core/alloc.h"
#include "core/error.h"
#include "core/sized.h"
#include "format/attribute_open.h"
#include "format/schema.h"
#include "format/head_facts.h"

static ebpo_status attribute_head_wrong(const ebpo_file *file, const char *path, const char *what,
                         ebpo_error *error)
{
    return ebpo_fail_at(error, EBPO_E_FORMAT, file->in.shown, path, -1,
                        "%s; get a fresh copy of the file", what);
}

/* A required attribute that is absent has no message yet. */
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
    return *type >= 0 ? EBPO_OK
                      : attribute_head_wrong(file, path, "a type of numbers is none that the format has", error);
}

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
        status = attribute_head_wrong(file, path, "a list's length is no whole number", error);
    if (status == EBPO_OK)
        status =
            required_value(file, path, ebpo_head_get_count(head, id, path, "different", &differ, error),
                     "different", error);
    if (status == EBPO_OK && differ > 1)
        status = attribute_head_wrong(file, path, "attribute different is neither 0 nor 1", error);
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
        status =
            required_value(file, path,
                     ebpo_head_get_text(head, id, path, "names", a->names, sizeof a->names, error),
                     "names", error);
    if (status == EBPO_OK)
        status = required_value(file, path, get_type(file, head, id, path, "type", &type, error), "type",
                          error);
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
    uint64_t most = ebpo_input_is_far(&file->in) || file->has_places ? 1 : UINT64_MAX;
    ebpo_status status =
        ebpo_head_read_array(head, a->path, most, ebpo_reader_rows_of_chunk(file, EBPO_A_ATTRIBUTE),
                             &a->shape, coding, &a->chunks, &a->stored_bytes, error);
    if (status != EBPO_OK)
        return status;
    a->coding = strcmp(coding, ebpo_coding_columns) == 0 ? ebpo_coding_columns : ebpo_coding_plain;
    a->present = true;
    if (!a->chunks)
        atomic_store(&file->located, false);
    if (strcmp(coding, a->coding) != 0)
        return attribute_head_wrong(file, a->path, "the array's coding is none that the format has for it", error);
    return a->shape.is_signed
               ? attribute_head_wrong(file, a->path, "the array has the wrong type or the wrong number of columns",
                       error)
               : EBPO_OK;
}

/* Shape of an array against what its head says. */
static const char *check_shape(const ebpo_file *file, const ebpo_array_in *array,
                               const ebpo_attribute_in *of)
{
    const ebpo_attribute *a = &of->head;
    uint32_t names = 1;
    for (const char *s = a->names; *s; s++) {
        names += *s == ' ';
        if (*s == ' ' && (s == a->names || s[1] == ' ' || !s[1]))
            return "names do not have one space between them";
    }
    if (!a->element[0] || strchr(a->element, ' ') || !a->names[0])
        return "the array has no names, or no element";
    bool list = a->list != EBPO_ATTRIBUTE_NO_LIST, flat = of->different || (!list && names == 1);
    if ((list && names != 1) || (array->shape.cols == 0) != flat ||
        array->shape.cols > EBPO_ATTRIBUTE_COLUMNS ||
        (!flat && !list && array->shape.cols != names))
        return "the array does not have a column for each name";
    if (array->shape.element_size != (of->different ? 8 : ebpo_attribute_bytes(a->type)))
        return "the array is not as wide as its type";
    bool vertex = ebpo_attribute_is_of(a, "vertex");
    if (ebpo_attribute_is_of_mesh(a) &&
        array->shape.rows != (vertex ? file->info.vertex_count : file->info.face_count))
        return "the array has not as many rows as the mesh";
    return NULL;
}

static const char *check_element(const ebpo_file *file, uint64_t n)
{
    const ebpo_attribute_in *all = file->attributes.head;
    for (uint64_t i = 0; i < n; i++)
        if (strcmp(all[i].head.element, all[n].head.element) == 0 &&
            all[i].head.rows != all[n].head.rows)
            return "the array has other rows than another one of its element";
    return NULL;
}

/* Texts of textures are read for a look at the file, so they are small. */
static const char *check_textures(const ebpo_attribute_in *of, const ebpo_array_in *items)
{
    bool texts = strcmp(of->head.names, ebpo_texture_array_name(EBPO_TEXTURE_BYTES)) != 0;
    if (!ebpo_attribute_is_of_textures(&of->head))
        return NULL;
    if (of->head.rows > EBPO_TEXTURES)
        return "there are more textures than a file can have";
    return texts && items->present && items->shape.rows > EBPO_TEXTURE_TEXTS
               ? "the texts of textures are longer than they can be"
               : NULL;
}

static ebpo_status open_items(ebpo_file *file, ebpo_head *head, uint64_t n, ebpo_error *error)
{
    const ebpo_array_in *items = &file->attributes.array[ebpo_items_number(n)];
    ebpo_status status = open_array(file, head, ebpo_items_number(n), error);
    if (status == EBPO_OK &&
        (items->shape.cols ||
         items->shape.element_size != ebpo_attribute_bytes(file->attributes.head[n].head.type)))
        status = attribute_head_wrong(file, items->path, "the array is not as wide as its type", error);
    return status;
}

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
    if (status == EBPO_OK && to->different && ebpo_head_look(head, path) != EBPO_HEAD_ABSENT)
        status = open_items(file, head, n, error);
    what = status == EBPO_OK ? check_textures(to, items) : NULL;
    return what ? attribute_head_wrong(file, values->path, what, error) : status;
}

static ebpo_status open_header(ebpo_file *file, ebpo_head *head, ebpo_error *error)
{
    const ebpo_array_in *header = &file->attributes.array[0];
    char path[EBPO_PATH_BYTES];
    ebpo_attribute_path(0, path);
    if (ebpo_head_look(head, path) == EBPO_HEAD_ABSENT)
        return EBPO_OK;
    ebpo_status status = open_array(file, head, 0, error);
    if (status == EBPO_OK &&
        (header->shape.cols || header->shape.element_size != 1 ||
         header->coding != ebpo_coding_plain || header->shape.rows > EBPO_ATTRIBUTE_HEADER))
        status = attribute_head_wrong(file, path, "the header is not of bytes, or longer than it can be", error);
    return status;
}

static ebpo_status open_group(ebpo_file *file, ebpo_head *head, ebpo_error *error)
{
    static const char path[] = "/attributes";
    ebpo_attributes_in *all = &file->attributes;
    ebpo_head_object id;
    ebpo_status status = ebpo_head_open_group(head, path, &id, error);
    if (status != EBPO_OK)
        return status;
    status = required_value(file, path, ebpo_head_get_count(head, id, path, "arrays", &all->count, error),
                      "arrays", error);
    if (status == EBPO_OK)
        status = ebpo_facts_get_digest(head, id, path, "sha256", all->sha256, error);
    if (status == EBPO_OK && all->count > EBPO_ATTRIBUTE_ARRAYS)
        status = attribute_head_wrong(file, path, "there are more arrays than there can be", error);
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

bool ebpo_file_attribute(const ebpo_file *file, unsigned n, ebpo_attribute_facts *out)
{
    if (n >= file->attributes.count)
        return false;
    const ebpo_attribute_in *of = &file->attributes.head[n];
    ebpo_attribute_facts facts = { .type = of->head.type,
                                   .rows = of->head.rows,
                                   .columns = of->different ? 0 : of->head.columns,
                                   .list = of->head.list != EBPO_ATTRIBUTE_NO_LIST,
                                   .has_range = of->has_range,
                                   .range = { of->range[0], of->range[1] } };
    snprintf(facts.element, sizeof facts.element, "%s", of->head.element);
    snprintf(facts.names, sizeof facts.names, "%s", of->head.names);
    for (int i = ebpo_values_number(n); i <= ebpo_items_number(n); i++)
        facts.stored_bytes += ebpo_reader_stored_bytes(file, &file->attributes.array[i]);
    return EBPO_GIVE(ebpo_attribute_facts, out, &facts) == EBPO_OK;
}

const char *ebpo_attribute_type_text(uint64_t type)
{
    return type <= EBPO_ATTRIBUTE_FLOAT64 ? ebpo_attribute_type_name((ebpo_attribute_type)type)
                                          : NULL;
}
