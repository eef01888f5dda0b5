/* Carries attributes of operands over to the mesh of the result.
 *
 * Arrays of two operands with equal names and types become one array. A vertex on the cut of two
 * operands gets the values of the first operand that has the array. Values at a new vertex are
 * interpolated on its face. Normals are rotated with the operand, and reversed with the face. */
#include "core/strict_fp.h"

#include "extras/boolean/result_attributes.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "core/alloc.h"
#include "core/error.h"
#include "core/workspace.h"
#include "extras/boolean/operand_mesh.h"
#include "format/read_attributes.h"
#include "geometry/vec3.h"
#include "query/sample_attributes.h"

/* --- arrays --- */

/* Returns the index of the column at which the words begin in a list of names; -1: not found. */
static int find_names(const char *names, const char *words)
{
    size_t n = strlen(words);
    for (int column = 0; *names; column++) {
        if (strncmp(names, words, n) == 0 && (names[n] == ' ' || !names[n]))
            return column;
        names += strcspn(names, " ");
        names += *names == ' ';
    }
    return -1;
}

static bool same_layout(const ebpo_attribute *a, const ebpo_attribute *b)
{
    return a->type == b->type && a->columns == b->columns && a->list == b->list &&
           strcmp(a->element, b->element) == 0 && strcmp(a->names, b->names) == 0;
}

/* Returns true if the mesh of the result cannot get the array. One reason is that the mesh has a
 * column with the same element and the same name. The other reason is that the array has colours,
 * and the faces of the result have colours by operand. */
static bool is_taken(const ebpo_carrying *c, const ebpo_attribute *like)
{
    const ebpo_attributes *all = c->mesh->attributes;
    if (c->coloured && find_names(like->names, "red") >= 0)
        return true;
    for (uint64_t i = 0; i < all->count; i++) {
        if (strcmp(all->array[i].element, like->element) != 0)
            continue;
        for (const char *at = all->array[i].names; *at;) {
            char word[EBPO_ATTRIBUTE_NAMES_BYTES];
            size_t n = strcspn(at, " ");
            memcpy(word, at, n);
            word[n] = 0;
            if (find_names(like->names, word) >= 0)
                return true;
            at += n + (at[n] == ' ');
        }
    }
    return false;
}

static ebpo_carried *find_carried(const ebpo_carrying *c, const ebpo_attribute *like)
{
    for (uint64_t i = 0; i < c->count; i++)
        if (same_layout(&c->mesh->attributes->array[c->item[i].array], like))
            return &c->item[i];
    return NULL;
}

static ebpo_status add_array(ebpo_carrying *c, const ebpo_attribute *like, uint64_t rows,
                             ebpo_error *error)
{
    ebpo_attributes *all = c->mesh->attributes;
    ebpo_attribute empty = { .type = like->type, .columns = like->columns, .list = like->list };
    memcpy(empty.element, like->element, sizeof empty.element);
    memcpy(empty.names, like->names, sizeof empty.names);
    ebpo_attribute *a = ebpo_attributes_add(all, &empty);
    if (!a || !ebpo_attribute_reserve(c->mesh->workspace, a, rows + 1, 0) ||
        !ebpo_grow(&c->item, &c->capacity, c->count + 1, sizeof *c->item))
        return ebpo_workspace_fail(c->mesh->workspace, rows * ebpo_attribute_row_bytes(&empty),
                                   error);
    bool colour = like->type == EBPO_ATTRIBUTE_UINT8 && find_names(like->names, "red") >= 0;
    ebpo_array_fill(c->mesh->workspace, a->values, colour ? 0xff : 0,
                    rows * ebpo_attribute_row_bytes(a));
    ebpo_carried *item = &c->item[c->count++];
    *item = (ebpo_carried){ .array = all->count - 1, .normal = find_names(a->names, "nx ny nz") };
    item->of_faces = ebpo_attribute_is_of(a, "face");
    item->filled = item->of_faces ? NULL : ebpo_alloc_zero(rows / 64 + 1, sizeof *item->filled);
    if (!item->of_faces && !item->filled)
        return ebpo_fail_memory(error, rows / 8);
    if (!ebpo_attribute_is_float(a->type))
        item->normal = -1; /* integers named nx ny nz are copied, not rotated */
    return EBPO_OK;
}

/* Adds the arrays of an operand, except those that an earlier operand has. */
static ebpo_status add_arrays(ebpo_carrying *c, const ebpo_file *file, uint64_t vertices,
                              uint64_t faces, ebpo_error *error)
{
    ebpo_attributes *all = c->mesh->attributes, *from;
    ebpo_read_options options = EBPO_READ_OPTIONS_INIT;
    ebpo_status status = ebpo_attributes_read_head(file, &options, &from, error);
    for (uint64_t i = 0; status == EBPO_OK && from && i < from->count; i++) {
        const ebpo_attribute *a = &from->array[i];
        if (find_carried(c, a))
            continue;
        if (!ebpo_attribute_is_of_mesh(a) || a->list != EBPO_ATTRIBUTE_NO_LIST)
            ebpo_attributes_lose(all, "%s of %s of %s (a list, or not of vertices or faces)",
                                 a->names, a->element, file->in.shown);
        else if (is_taken(c, a))
            ebpo_attributes_lose(all, "%s of %s of %s (the name is taken)", a->names, a->element,
                                 file->in.shown);
        else
            status = add_array(c, a, ebpo_attribute_is_of(a, "face") ? faces : vertices, error);
    }
    if (status == EBPO_OK)
        ebpo_attributes_free(from);
    return status;
}

ebpo_status ebpo_carrying_begin(ebpo_carrying *c, const ebpo_boolean *b, ebpo_mesh *mesh,
                                bool coloured, uint64_t vertices, uint64_t faces, ebpo_error *error)
{
    uint64_t used = ebpo_expression_operands(&b->expression);
    c->mesh = mesh;
    c->coloured = coloured;
    ebpo_status status = ebpo_mesh_need_attributes(mesh, error);
    for (uint32_t i = 0; i < b->given && status == EBPO_OK; i++) {
        ebpo_error cause = EBPO_ERROR_INIT;
        if (used >> i & 1 &&
            add_arrays(c, b->solid[i].model->file, vertices, faces, &cause) != EBPO_OK)
            status = ebpo_fail_operand(b->solid[i].model, i, &cause, error);
    }
    return status;
}

void ebpo_carrying_operand(ebpo_carrying *c, const ebpo_posed_solid *solid, const ebpo_mesh *mesh)
{
    memcpy(c->rotation, solid->rotation, sizeof c->rotation);
    for (uint64_t i = 0; i < c->count; i++)
        c->item[i].from = NULL;
    for (uint64_t i = 0; mesh->attributes && i < mesh->attributes->count; i++) {
        ebpo_carried *item = find_carried(c, &mesh->attributes->array[i]);
        if (item)
            item->from = &mesh->attributes->array[i];
    }
}

/* --- values --- */

/* Stores a number. If the type is an integer, the nearest integer in its range is stored. */
static void store_number(uint8_t *at, ebpo_attribute_type type, double x)
{
    /* [type] ranges of the integer types, in the order of ebpo_attribute_type */
    static const double least[] = { INT8_MIN, 0, INT16_MIN, 0, INT32_MIN, 0 }, most[] = {
        INT8_MAX, UINT8_MAX, INT16_MAX, UINT16_MAX, INT32_MAX, UINT32_MAX
    };
    float narrow = (float)x;
    if (type == EBPO_ATTRIBUTE_FLOAT64) {
        memcpy(at, &x, sizeof x);
    } else if (type == EBPO_ATTRIBUTE_FLOAT32) {
        memcpy(at, &narrow, sizeof narrow);
    } else {
        int64_t whole = (int64_t)fmin(fmax(rint(x), least[type]), most[type]);
        int8_t b1 = (int8_t)whole;
        int16_t b2 = (int16_t)whole;
        int32_t b4 = (int32_t)whole;
        unsigned bytes = ebpo_attribute_bytes(type);
        memcpy(at, bytes == 1 ? (void *)&b1 : bytes == 2 ? (void *)&b2 : (void *)&b4, bytes);
    }
}

static double number_at(const ebpo_attribute *a, uint64_t row, uint32_t column)
{
    return ebpo_attribute_number(a->values +
                                     (row * a->columns + column) * ebpo_attribute_bytes(a->type),
                                 a->type);
}

/* Rotates the normal of a row with the operand, and reverses it if sign is -1. An interpolated
 * normal gets the length 1. */
static void turn_normal(const ebpo_carrying *c, const ebpo_carried *item, uint64_t row,
                        bool interpolated, int sign)
{
    const ebpo_attribute *a = &c->mesh->attributes->array[item->array];
    double before[3], after[3], scale = sign;
    for (int k = 0; k < 3; k++)
        before[k] = number_at(a, row, (uint32_t)(item->normal + k));
    for (int k = 0; k < 3; k++)
        after[k] = ebpo_vec3_dot(c->rotation[k], before);
    double length = sqrt(ebpo_vec3_dot(after, after));
    if (interpolated && length > 0)
        scale /= length;
    for (int k = 0; k < 3; k++)
        store_number(a->values + (row * a->columns + (uint32_t)(item->normal + k)) *
                                     ebpo_attribute_bytes(a->type),
                     a->type, scale * after[k]);
}

/* Returns true if the operand's rotation leaves all directions as they are. */
static bool keeps_directions(const ebpo_carrying *c)
{
    for (int i = 0; i < 9; i++)
        if (c->rotation[i / 3][i % 3] != (i % 4 == 0))
            return false;
    return true;
}

static void finish_row(const ebpo_carrying *c, const ebpo_carried *item, uint64_t row,
                       bool interpolated, int sign)
{
    if (item->normal >= 0 && (interpolated || sign < 0 || !keeps_directions(c)))
        turn_normal(c, item, row, interpolated, sign);
}

static void copy_row(const ebpo_carrying *c, const ebpo_carried *item, uint64_t row, uint64_t from,
                     int sign)
{
    const ebpo_attribute *to = &c->mesh->attributes->array[item->array];
    uint64_t bytes = ebpo_attribute_row_bytes(to);
    memcpy(to->values + row * bytes, item->from->values + from * bytes, bytes);
    finish_row(c, item, row, false, sign);
}

static void blend_rows(const ebpo_carrying *c, const ebpo_carried *item, uint64_t row,
                       const uint32_t corner[3], const double weight[3], int sign)
{
    const ebpo_attribute *to = &c->mesh->attributes->array[item->array];
    uint64_t bytes = ebpo_attribute_row_bytes(to);
    for (uint32_t i = 0; i < to->columns; i++) {
        double value[3];
        for (int k = 0; k < 3; k++)
            value[k] = number_at(item->from, corner[k], i);
        store_number(to->values + row * bytes + i * ebpo_attribute_bytes(to->type), to->type,
                     ebpo_blend_values(weight, value));
    }
    finish_row(c, item, row, true, sign);
}

void ebpo_carry_vertex(ebpo_carrying *c, uint64_t row, const uint32_t corner[3],
                       const double weight[3], int sign)
{
    for (uint64_t i = 0; i < c->count; i++) {
        ebpo_carried *item = &c->item[i];
        if (!item->from || item->of_faces || ebpo_has_bit(item->filled, row))
            continue;
        ebpo_set_bit(item->filled, row);
        int single = weight[0] == 1 ? 0 : weight[1] == 1 ? 1 : weight[2] == 1 ? 2 : -1;
        if (single >= 0)
            copy_row(c, item, row, corner[single], sign);
        else
            blend_rows(c, item, row, corner, weight, sign);
    }
}

void ebpo_carry_face(ebpo_carrying *c, uint64_t row, uint64_t face, int sign)
{
    for (uint64_t i = 0; i < c->count; i++)
        if (c->item[i].from && c->item[i].of_faces)
            copy_row(c, &c->item[i], row, face, sign);
}

void ebpo_carrying_end(ebpo_carrying *c)
{
    for (uint64_t i = 0; i < c->count; i++)
        c->mesh->attributes->array[c->item[i].array].rows =
            c->item[i].of_faces ? c->mesh->face_count : c->mesh->vertex_count;
}

void ebpo_carrying_free(ebpo_carrying *c)
{
    for (uint64_t i = 0; i < c->count; i++)
        free(c->item[i].filled);
    free(c->item);
}
