/* Builds the mesh for the readers of OBJ, OFF and STL. Stores positions, triangulates polygons,
 * merges vertices at equal positions, and makes attributes from the values of corners. */
#include "core/strict_fp.h"

#include <inttypes.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "core/alloc.h"
#include "core/workspace.h"
#include "core/error.h"
#include "core/hash.h"
#include "geometry/decimal.h"
#include "geometry/polygon.h"
#include "mesh/attributes.h"
#include "mesh/import_build.h"

static ebpo_status fail_many(const ebpo_import_build *b)
{
    return ebpo_fail_file(b->error, EBPO_E_LIMIT, b->name,
                          "more than 2^32 - 2 vertices, triangles or values of one kind; split the "
                          "model");
}

static ebpo_status fail_memory(const ebpo_import_build *b, uint64_t bytes)
{
    return ebpo_workspace_fail(b->mesh->workspace, bytes, b->error);
}

unsigned ebpo_import_columns(ebpo_import_sort sort) { return sort == EBPO_IMPORT_TEXTURE ? 2 : 3; }

ebpo_status ebpo_import_begin(ebpo_import_build *b, ebpo_mesh *mesh, const char *name,
                              bool attributes, bool doubles, ebpo_error *error)
{
    *b = (ebpo_import_build){ .name = name,
                              .error = error,
                              .mesh = mesh,
                              .attributes = attributes,
                              .doubles = doubles,
                              .position_size = 3 * (doubles ? sizeof(double) : sizeof(float)) };
    b->c_locale = newlocale(LC_ALL_MASK, "C", (locale_t)0);
    return b->c_locale ? EBPO_OK : ebpo_fail_memory(error, 0);
}

/* --- numbers --- */

bool ebpo_import_coordinate(ebpo_import_build *b, double *value, const char *s, size_t n)
{
    float narrow;
    bool kept;
    if (b->doubles)
        return ebpo_number_double(value, s, n, b->c_locale);
    if (!ebpo_number_float_kept(&narrow, &kept, s, n, b->c_locale))
        return false;
    b->loses_digits |= !kept;
    *value = (double)narrow;
    return true;
}

void ebpo_import_quotient(ebpo_import_build *b, double *value, const char *s, size_t n,
                          double weight)
{
    double number = 0;
    (void)ebpo_number_double(&number, s, n, b->c_locale);
    *value = number / weight;
    b->loses_digits |= (double)(float)*value != *value;
}

bool ebpo_import_value(ebpo_import_build *b, float *value, const char *s, size_t n)
{
    bool kept;
    bool good = ebpo_number_float_kept(value, &kept, s, n, b->c_locale);
    b->rounded += !kept;
    return good;
}

/* --- vertices and rows --- */

ebpo_status ebpo_import_position(ebpo_import_build *b, const double xyz[3])
{
    if (b->loses_digits && !b->doubles)
        return EBPO_E_UNSUPPORTED;
    if (b->vertices == EBPO_IMPORT_MAX)
        return fail_many(b);
    if (!ebpo_array_grow(b->mesh->workspace, &b->xyz, &b->vertex_capacity, b->vertices + 1,
                         b->position_size))
        return fail_memory(b, (b->vertices + 1) * b->position_size);
    char *to = (char *)b->xyz + b->vertices++ * b->position_size;
    if (b->doubles) {
        memcpy(to, xyz, 3 * sizeof *xyz);
    } else {
        const float narrow[3] = { (float)xyz[0], (float)xyz[1], (float)xyz[2] };
        memcpy(to, narrow, sizeof narrow);
    }
    return EBPO_OK;
}

ebpo_status ebpo_import_vertex(ebpo_import_build *b, const float xyz[3])
{
    const double wide[3] = { (double)xyz[0], (double)xyz[1], (double)xyz[2] };
    return ebpo_import_position(b, wide);
}

ebpo_status ebpo_import_row(ebpo_import_build *b, ebpo_import_sort sort, const float *values)
{
    ebpo_import_table *t = &b->table[sort];
    size_t bytes = ebpo_import_columns(sort) * sizeof *values;
    if (t->rows == EBPO_IMPORT_MAX)
        return fail_many(b);
    if (!ebpo_array_grow(b->mesh->workspace, &t->values, &t->capacity, t->rows + 1, bytes))
        return fail_memory(b, (t->rows + 1) * bytes);
    memcpy((char *)t->values + t->rows++ * bytes, values, bytes);
    return EBPO_OK;
}

ebpo_status ebpo_import_faces(ebpo_import_build *b)
{
    ebpo_mesh *mesh = b->mesh;
    b->use = ebpo_array_alloc(mesh->workspace, b->vertices, sizeof *b->use);
    void *xyz = ebpo_array_alloc(mesh->workspace, b->vertices, b->position_size);
    if (b->doubles)
        mesh->xyz64 = xyz;
    else
        mesh->xyz32 = xyz;
    if (!b->use || !xyz)
        return fail_memory(b, b->vertices * b->position_size);
    ebpo_array_fill(mesh->workspace, b->use, 0xff, b->vertices * sizeof *b->use);
    return EBPO_OK;
}

/* --- polygons --- */

ebpo_import_corner *ebpo_import_add_corner(ebpo_import_build *b)
{
    if (!ebpo_grow(&b->corner, &b->corner_capacity, b->corners + 1, sizeof *b->corner))
        return NULL;
    return &b->corner[b->corners++];
}

static void *positions_of(const ebpo_mesh *mesh)
{
    return mesh->xyz32 ? (void *)mesh->xyz32 : (void *)mesh->xyz64;
}

/* Numbers those vertices of a polygon that no earlier polygon uses. */
static void number_vertices(ebpo_import_build *b)
{
    ebpo_mesh *mesh = b->mesh;
    for (uint64_t i = 0; i < b->corners; i++) {
        uint32_t vertex = b->corner[i].vertex;
        uint64_t from = 3 * (uint64_t)vertex, to = 3 * mesh->vertex_count;
        if (b->use[vertex] != EBPO_IMPORT_NONE)
            continue;
        if (b->doubles)
            memcpy(mesh->xyz64 + to, (const double *)b->xyz + from, 3 * sizeof *mesh->xyz64);
        else
            memcpy(mesh->xyz32 + to, (const float *)b->xyz + from, 3 * sizeof *mesh->xyz32);
        b->use[vertex] = (uint32_t)mesh->vertex_count++;
    }
}

/* Reserves space for the corners of `faces` faces in a table. The corners of faces that precede the
 * table's first row have no value. */
static bool reserve_space_in(ebpo_import_build *b, ebpo_import_table *t, uint64_t faces)
{
    ebpo_workspace *workspace = b->mesh->workspace;
    bool first = !t->index;
    if (!ebpo_array_grow(workspace, &t->index, &t->index_capacity, faces, 3 * sizeof *t->index))
        return false;
    if (first)
        ebpo_array_fill(workspace, t->index, 0xff, b->mesh->face_count * 3 * sizeof *t->index);
    return true;
}

static ebpo_status reserve_space(ebpo_import_build *b, uint64_t more)
{
    ebpo_mesh *mesh = b->mesh;
    uint64_t need = mesh->face_count + more;
    if (more > EBPO_IMPORT_MAX - mesh->face_count)
        return fail_many(b);
    bool enough = ebpo_array_grow(mesh->workspace, &mesh->faces, &b->face_capacity, need,
                                  3 * sizeof *mesh->faces);
    for (int i = 0; i < EBPO_IMPORT_SORTS && enough; i++)
        enough = !b->attributes || !b->table[i].rows || reserve_space_in(b, &b->table[i], need);
    return enough ? EBPO_OK : fail_memory(b, need * 3 * sizeof *mesh->faces);
}

/* Adds a triangle of corners of the current polygon. */
static void put_triangle(ebpo_import_build *b, uint32_t first, uint32_t second, uint32_t third)
{
    const uint32_t corner[3] = { first, second, third };
    uint64_t at = 3 * b->mesh->face_count++;
    for (uint64_t k = 0; k < 3; k++) {
        const ebpo_import_corner *c = &b->corner[corner[k]];
        b->mesh->faces[at + k] = b->use[c->vertex];
        for (int i = 0; i < EBPO_IMPORT_SORTS; i++) {
            ebpo_import_table *t = &b->table[i];
            if (t->index)
                t->index[at + k] = c->row[i];
            t->named |= c->row[i] != EBPO_IMPORT_NONE;
        }
    }
}

/* Reserves scratch memory for corner positions, triangles and the workspace of the triangulation,
 * in this order. */
static ebpo_status reserve_scratch(ebpo_import_build *b, uint64_t n)
{
    uint64_t bytes;
    if (!ebpo_mul_ok(n, 3 * sizeof(double) + 4 * sizeof(uint32_t), &bytes) ||
        __builtin_add_overflow(bytes, ebpo_polygon_scratch_bytes(n), &bytes) ||
        !ebpo_grow(&b->scratch, &b->scratch_capacity, bytes, 1))
        return ebpo_fail_memory(b->error, n * 40); /* 24 + 16 bytes a corner */
    return EBPO_OK;
}

static void load_position(const ebpo_import_build *b, uint64_t vertex, double xyz[3])
{
    const float *narrow = b->xyz;
    const double *wide = b->xyz;
    for (uint64_t k = 0; k < 3; k++)
        xyz[k] = b->doubles ? wide[3 * vertex + k] : (double)narrow[3 * vertex + k];
}

/* Triangulates the current polygon of n > 3 corners. */
static ebpo_status cut_polygon(ebpo_import_build *b, uint32_t n)
{
    ebpo_status status = reserve_scratch(b, n);
    if (status != EBPO_OK)
        return status;
    double(*corner)[3] = b->scratch;
    uint32_t(*triangle)[3] = (uint32_t(*)[3])(corner + n);
    void *scratch = triangle + n + (n & 1); /* keeps doubles aligned */
    for (uint32_t i = 0; i < n; i++)
        load_position(b, b->corner[i].vertex, corner[i]);
    ebpo_polygon_kind kind =
        ebpo_polygon_triangulate(triangle, (const double(*)[3])corner, n, scratch);
    if (kind == EBPO_POLYGON_NO_MEMORY)
        return ebpo_fail_memory(b->error, n * sizeof *corner);
    if (kind == EBPO_POLYGON_TOO_LARGE)
        return ebpo_fail_file(b->error, EBPO_E_LIMIT, b->name,
                              "a concave polygon of %" PRIu32
                              " corners could not be triangulated; triangulate it in the source",
                              n);
    b->mesh->polygons_triangulated++;
    b->mesh->polygons_concave += kind == EBPO_POLYGON_CONCAVE;
    if (kind == EBPO_POLYGON_GUESSED && b->mesh->polygons_guessed++ == 0)
        b->mesh->first_guessed_face = b->mesh->face_count;
    for (uint32_t i = 0; i < n - 2; i++)
        put_triangle(b, triangle[i][0], triangle[i][1], triangle[i][2]);
    return EBPO_OK;
}

ebpo_status ebpo_import_polygon(ebpo_import_build *b)
{
    uint64_t n = b->corners;
    ebpo_status status = EBPO_OK;
    if (n < 3) {
        b->mesh->polygons_dropped++;
    } else {
        number_vertices(b);
        status = reserve_space(b, n - 2);
        if (status == EBPO_OK && n == 3)
            put_triangle(b, 0, 1, 2);
        else if (status == EBPO_OK)
            status = cut_polygon(b, (uint32_t)n);
    }
    b->corners = 0;
    return status;
}

/* --- the end --- */

/* Frees unused capacity. Arrays have unused capacity because each growth adds half of the size, and
 * because vertices may have been merged. */
static void trim_arrays(ebpo_mesh *mesh, size_t position_size)
{
    if (mesh->workspace)
        return;
    void *xyz = ebpo_realloc(positions_of(mesh), mesh->vertex_count, position_size);
    uint32_t *faces = ebpo_realloc(mesh->faces, mesh->face_count, 3 * sizeof *faces);
    if (xyz && mesh->xyz32)
        mesh->xyz32 = xyz;
    else if (xyz)
        mesh->xyz64 = xyz;
    mesh->faces = faces ? faces : mesh->faces;
}

ebpo_status ebpo_import_end(ebpo_import_build *b)
{
    ebpo_mesh *mesh = b->mesh;
    ebpo_workspace *workspace = mesh->workspace;
    if (!mesh->face_count)
        return ebpo_fail_file(b->error, EBPO_E_FORMAT, b->name,
                              mesh->polygons_dropped
                                  ? "no face has three corners; the file contains no mesh"
                                  : "has no faces; the file contains no mesh");
    ebpo_array_free(workspace, b->use);
    ebpo_array_free(workspace, b->xyz);
    b->use = NULL;
    b->xyz = NULL;
    uint32_t *map = ebpo_array_alloc(workspace, mesh->vertex_count, sizeof *map);
    if (!map)
        return fail_memory(b, mesh->vertex_count * sizeof *map);
    ebpo_status status = ebpo_import_weld(positions_of(mesh), b->doubles, mesh->vertex_count, map,
                                          &mesh->vertex_count, b->error);
    if (status == EBPO_OK)
        EBPO_FOR_ITEMS_SCATTERED(workspace, i, 0, 3 * mesh->face_count)
            mesh->faces[i] = map[mesh->faces[i]];
    ebpo_array_free(workspace, map);
    if (status == EBPO_OK)
        trim_arrays(mesh, b->position_size);
    return status;
}

void ebpo_import_word_text(char text[EBPO_IMPORT_WORD_TEXT], const char *s, size_t n)
{
    n = n < EBPO_IMPORT_WORD_TEXT ? n : EBPO_IMPORT_WORD_TEXT - 1;
    for (size_t i = 0; i < n; i++)
        text[i] = s[i] < ' ' || s[i] > '~' ? '?' : s[i];
    text[n] = 0;
}

void ebpo_import_runs_free(ebpo_import_runs *runs)
{
    free(runs->run);
    *runs = (ebpo_import_runs){ 0 };
}

void ebpo_import_free(ebpo_import_build *b)
{
    ebpo_workspace *workspace = b->mesh->workspace;
    for (int i = 0; i < EBPO_IMPORT_SORTS; i++) {
        ebpo_array_free(workspace, b->table[i].values);
        ebpo_array_free(workspace, b->table[i].index);
    }
    ebpo_array_free(workspace, b->xyz);
    ebpo_array_free(workspace, b->use);
    free(b->corner);
    free(b->scratch);
    if (b->c_locale)
        freelocale(b->c_locale);
}

/* For each table: the names of its columns, and the name of the attribute that lists the values of
 * a face's three corners. */
static const struct {
    const char *names, *list_name;
} attribute_names[EBPO_IMPORT_SORTS] = { { "red green blue", "color" },
                                         { "nx ny nz", "normal" },
                                         { "s t", "texcoord" } };

/* A table whose values become an attribute. */
typedef struct placing {
    const ebpo_import_build *b;
    const ebpo_import_table *table;
    ebpo_import_sort sort;
    size_t bytes; /* bytes of a row as stored */
} placing;

/* Returns an attribute without values, which will have one row for each vertex or face. */
static ebpo_attribute head_of(const placing *p, const char *element)
{
    ebpo_attribute head = { .list = EBPO_ATTRIBUTE_NO_LIST };
    head.type = p->table->bytes ? EBPO_ATTRIBUTE_UINT8 : EBPO_ATTRIBUTE_FLOAT32;
    head.columns = ebpo_import_columns(p->sort);
    snprintf(head.element, sizeof head.element, "%s", element);
    snprintf(head.names, sizeof head.names, "%s", attribute_names[p->sort].names);
    return head;
}

static ebpo_status add_attribute(const placing *p, ebpo_attribute *head, ebpo_attribute **out)
{
    const ebpo_mesh *mesh = p->b->mesh;
    size_t bytes = head->columns * (size_t)ebpo_attribute_bytes(head->type);
    head->rows = strcmp(head->element, "face") == 0 ? mesh->face_count : mesh->vertex_count;
    *out = ebpo_attributes_add(mesh->attributes, head);
    if (!*out)
        return ebpo_fail_memory(p->b->error, sizeof **out);
    (*out)->values = ebpo_array_alloc(mesh->workspace, head->rows, bytes);
    return (*out)->values ? EBPO_OK
                          : ebpo_workspace_fail(mesh->workspace, head->rows * bytes, p->b->error);
}

/* Removes the last attribute. */
static void drop_attribute(const placing *p)
{
    ebpo_attributes_remove(p->b->mesh->attributes, p->b->mesh->attributes->count - 1);
}

/* Returns the values of a corner, or zeros if the corner has no values. */
static const void *value_at(const placing *p, uint64_t corner)
{
    static const float none[3] = { 0, 0, 0 };
    uint32_t row = p->table->index[corner];
    return row == EBPO_IMPORT_NONE ? (const char *)none
                                   : (const char *)p->table->values + row * p->bytes;
}

/* Adds the values as an attribute of vertices, if all corners at each vertex have equal values.
 * *fits: true if the attribute was added. */
static ebpo_status place_on_vertices(const placing *p, bool *fits)
{
    const ebpo_mesh *mesh = p->b->mesh;
    ebpo_attribute head = head_of(p, "vertex"), *a;
    ebpo_status status = add_attribute(p, &head, &a);
    *fits = status == EBPO_OK;
    if (!*fits)
        return status;
    EBPO_FOR_ITEMS_SCATTERED(mesh->workspace, i, 0, 3 * mesh->face_count)
        memcpy(a->values + mesh->faces[i] * p->bytes, value_at(p, i), p->bytes);
    EBPO_FOR_ITEMS_SCATTERED(mesh->workspace, i, 0, 3 * mesh->face_count) {
        *fits = memcmp(a->values + mesh->faces[i] * p->bytes, value_at(p, i), p->bytes) == 0;
        if (!*fits)
            break;
    }
    if (!*fits)
        drop_attribute(p);
    return EBPO_OK;
}

/* Adds the values as an attribute of faces, if all corners of each face have equal values. *fits:
 * true if the attribute was added. */
static ebpo_status place_on_faces(const placing *p, bool *fits)
{
    const ebpo_mesh *mesh = p->b->mesh;
    ebpo_attribute head = head_of(p, "face"), *a;
    ebpo_status status = add_attribute(p, &head, &a);
    *fits = status == EBPO_OK;
    for (uint64_t f = 0; f < mesh->face_count && *fits; f++) {
        const void *first = value_at(p, 3 * f);
        *fits = memcmp(first, value_at(p, 3 * f + 1), p->bytes) == 0 &&
                memcmp(first, value_at(p, 3 * f + 2), p->bytes) == 0;
        memcpy(a->values + f * p->bytes, first, p->bytes);
    }
    if (status == EBPO_OK && !*fits)
        drop_attribute(p);
    return status;
}

/* Adds the values as an attribute of faces, with the values of the three corners in each row. */
static ebpo_status place_in_lists(const placing *p)
{
    ebpo_attribute head = head_of(p, "face"), *a;
    head.columns *= 3;
    head.list = EBPO_ATTRIBUTE_UINT8;
    snprintf(head.names, sizeof head.names, "%s", attribute_names[p->sort].list_name);
    ebpo_status status = add_attribute(p, &head, &a);
    for (uint64_t i = 0; status == EBPO_OK && i < 3 * p->b->mesh->face_count; i++)
        memcpy(a->values + i * p->bytes, value_at(p, i), p->bytes);
    return status;
}

/* Converts values to bytes in the same memory. Byte i is stored in values[i / 4], which has already
 * been read. */
static void make_bytes(ebpo_import_table *t, size_t columns)
{
    uint8_t *to = (uint8_t *)t->values;
    for (uint64_t i = 0; i < t->rows * columns; i++)
        to[i] = (uint8_t)t->values[i];
}

ebpo_status ebpo_import_attributes(ebpo_import_build *b)
{
    ebpo_status status = EBPO_OK;
    for (int i = 0; i < EBPO_IMPORT_SORTS && status == EBPO_OK; i++) {
        placing p = { b, &b->table[i], (ebpo_import_sort)i, 0 };
        bool fits = false;
        if (!p.table->index || !p.table->named)
            continue;
        p.bytes = ebpo_import_columns(p.sort);
        if (p.table->bytes)
            make_bytes(&b->table[i], p.bytes);
        else
            p.bytes *= sizeof(float);
        status = p.table->of_face ? EBPO_OK : place_on_vertices(&p, &fits);
        if (status == EBPO_OK && !fits)
            status = place_on_faces(&p, &fits);
        if (status == EBPO_OK && !fits)
            status = place_in_lists(&p);
    }
    if (b->rounded)
        ebpo_attributes_lose(b->mesh->attributes,
                             "digits of colours, normals or texture coordinates, which are "
                             "floats: %" PRIu64,
                             b->rounded);
    return status;
}

#define EMPTY UINT32_MAX /* a free slot of the hash table */

/* Returns the bits of a coordinate of `size` bytes; -0 becomes 0. */
static inline uint64_t bits_of(const char *at, size_t size)
{
    uint32_t narrow;
    uint64_t wide;
    if (size == sizeof narrow) {
        memcpy(&narrow, at, sizeof narrow);
        return narrow << 1 ? narrow : 0;
    }
    memcpy(&wide, at, sizeof wide);
    return wide << 1 ? wide : 0;
}

static inline bool has_key(const char *xyz, size_t size, const uint64_t key[3])
{
    return bits_of(xyz, size) == key[0] && bits_of(xyz + size, size) == key[1] &&
           bits_of(xyz + 2 * size, size) == key[2];
}

/* Implements ebpo_import_weld for coordinates of `size` bytes; returns the number of positions.
 * Callers pass a constant size, for which the compiler specialises this function. */
static inline uint64_t weld_positions(char *xyz, size_t size, uint64_t count, uint32_t *map,
                                      uint32_t *table, uint64_t slots)
{
    uint32_t kept = 0;
    for (uint64_t i = 0; i < count; i++) {
        const char *position = xyz + 3 * size * i;
        const uint64_t key[3] = { bits_of(position, size), bits_of(position + size, size),
                                  bits_of(position + 2 * size, size) };
        uint64_t at; /* slot of a vertex at the same position, or the free slot for i */
        EBPO_HASH_FIND(at, ebpo_hash_three(key), slots - 1,
                       table[at] == EMPTY || has_key(xyz + 3 * size * table[at], size, key));
        if (table[at] == EMPTY) {
            memmove(xyz + 3 * size * kept, position, 3 * size);
            table[at] = kept++;
        }
        map[i] = table[at];
    }
    return kept;
}

ebpo_status ebpo_import_weld(void *xyz, bool doubles, uint64_t count, uint32_t *map,
                             uint64_t *welded, ebpo_error *error)
{
    uint64_t slots = ebpo_hash_slots(count + count / 2);
    uint32_t *table = ebpo_alloc(slots, sizeof *table);
    if (!table)
        return ebpo_fail_memory(error, slots * sizeof *table);
    memset(table, 0xff, (size_t)slots * sizeof *table);
    *welded = doubles ? weld_positions(xyz, sizeof(double), count, map, table, slots)
                      : weld_positions(xyz, sizeof(float), count, map, table, slots);
    free(table);
    return EBPO_OK;
}
