#include "geom/strict_fp.h"

#include "import/import_build.h"

#include <inttypes.h>
#include <stdlib.h>
#include <string.h>

#include "attributes/attributes.h"
#include "base/alloc.h"
#include "base/arrays.h"
#include "base/error.h"
#include "geom/polygon.h"
#include "import/corner_weld.h"

static ebpo_status fail_many(const import_build *b)
{
    return ebpo_fail_file(b->error, EBPO_E_LIMIT, b->name,
                          "more than 2^32 - 2 vertices, triangles or values of one kind; split the "
                          "model");
}

static ebpo_status fail_memory(const import_build *b, uint64_t bytes)
{
    return ebpo_workspace_fail(b->mesh->workspace, bytes, b->error);
}

unsigned ebpo_import_columns(import_sort sort) { return sort == IMPORT_TEXTURE ? 2 : 3; }

ebpo_status ebpo_import_begin(import_build *b, ebpo_mesh *mesh, const char *name, bool attributes,
                              ebpo_error *error)
{
    *b = (import_build){ .name = name, .error = error, .mesh = mesh, .attributes = attributes };
    b->c_locale = newlocale(LC_ALL_MASK, "C", (locale_t)0);
    return b->c_locale ? EBPO_OK : ebpo_fail_memory(error, 0);
}

ebpo_status ebpo_import_vertex(import_build *b, const float xyz[3])
{
    if (b->vertices == IMPORT_MOST)
        return fail_many(b);
    if (!ebpo_array_grow(b->mesh->workspace, &b->xyz, &b->vertex_capacity, b->vertices + 1,
                         3 * sizeof *b->xyz))
        return fail_memory(b, (b->vertices + 1) * 3 * sizeof *b->xyz);
    memcpy(b->xyz + 3 * b->vertices++, xyz, 3 * sizeof *xyz);
    return EBPO_OK;
}

ebpo_status ebpo_import_row(import_build *b, import_sort sort, const float *values)
{
    import_table *t = &b->table[sort];
    size_t bytes = ebpo_import_columns(sort) * sizeof *values;
    if (t->rows == IMPORT_MOST)
        return fail_many(b);
    if (!ebpo_array_grow(b->mesh->workspace, &t->values, &t->capacity, t->rows + 1, bytes))
        return fail_memory(b, (t->rows + 1) * bytes);
    memcpy((char *)t->values + t->rows++ * bytes, values, bytes);
    return EBPO_OK;
}

ebpo_status ebpo_import_faces(import_build *b)
{
    ebpo_mesh *mesh = b->mesh;
    b->use = ebpo_array_alloc(mesh->workspace, b->vertices, sizeof *b->use);
    mesh->xyz32 = ebpo_array_alloc(mesh->workspace, b->vertices, 3 * sizeof *mesh->xyz32);
    if (!b->use || !mesh->xyz32)
        return fail_memory(b, b->vertices * 3 * sizeof *mesh->xyz32);
    ebpo_array_fill(mesh->workspace, b->use, 0xff, b->vertices * sizeof *b->use);
    return EBPO_OK;
}

/* --- polygons --- */

import_corner *ebpo_import_corner(import_build *b)
{
    if (!ebpo_grow(&b->corner, &b->corner_capacity, b->corners + 1, sizeof *b->corner))
        return NULL;
    return &b->corner[b->corners++];
}

/* The first polygon that names a vertex gives it its number. */
static void number_vertices(import_build *b)
{
    ebpo_mesh *mesh = b->mesh;
    for (uint64_t i = 0; i < b->corners; i++) {
        uint32_t vertex = b->corner[i].vertex;
        if (b->use[vertex] != IMPORT_NONE)
            continue;
        memcpy(mesh->xyz32 + 3 * mesh->vertex_count, b->xyz + 3 * (uint64_t)vertex,
               3 * sizeof *b->xyz);
        b->use[vertex] = (uint32_t)mesh->vertex_count++;
    }
}

/* Faces before the first row have none. */
static bool make_room_in(import_build *b, import_table *t, uint64_t faces)
{
    ebpo_workspace *workspace = b->mesh->workspace;
    bool first = !t->index;
    if (!ebpo_array_grow(workspace, &t->index, &t->index_capacity, faces, 3 * sizeof *t->index))
        return false;
    if (first)
        ebpo_array_fill(workspace, t->index, 0xff, b->mesh->face_count * 3 * sizeof *t->index);
    return true;
}

static ebpo_status make_room(import_build *b, uint64_t more)
{
    ebpo_mesh *mesh = b->mesh;
    uint64_t need = mesh->face_count + more;
    if (more > IMPORT_MOST - mesh->face_count)
        return fail_many(b);
    bool fine = ebpo_array_grow(mesh->workspace, &mesh->faces, &b->face_capacity, need,
                                3 * sizeof *mesh->faces);
    for (int i = 0; i < IMPORT_SORTS && fine; i++)
        fine = !b->attributes || !b->table[i].rows || make_room_in(b, &b->table[i], need);
    return fine ? EBPO_OK : fail_memory(b, need * 3 * sizeof *mesh->faces);
}

static void put_triangle(import_build *b, uint32_t a, uint32_t second, uint32_t third)
{
    const uint32_t corner[3] = { a, second, third };
    uint64_t at = 3 * b->mesh->face_count++;
    for (uint64_t k = 0; k < 3; k++) {
        const import_corner *c = &b->corner[corner[k]];
        b->mesh->faces[at + k] = b->use[c->vertex];
        for (int i = 0; i < IMPORT_SORTS; i++) {
            import_table *t = &b->table[i];
            if (t->index)
                t->index[at + k] = c->row[i];
            t->named |= c->row[i] != IMPORT_NONE;
        }
    }
}

/* Scratch holds, one behind the other: positions of corners, triangles, and what cutting asks for.
 */
static ebpo_status reserve_scratch(import_build *b, uint64_t n)
{
    uint64_t bytes;
    if (!ebpo_mul_ok(n, 3 * sizeof(double) + 4 * sizeof(uint32_t), &bytes) ||
        __builtin_add_overflow(bytes, ebpo_polygon_scratch_bytes(n), &bytes) ||
        !ebpo_grow(&b->scratch, &b->scratch_capacity, bytes, 1))
        return ebpo_fail_memory(b->error, n * 40);
    return EBPO_OK;
}

static ebpo_status cut(import_build *b, uint32_t n)
{
    ebpo_status status = reserve_scratch(b, n);
    if (status != EBPO_OK)
        return status;
    double(*position)[3] = b->scratch;
    uint32_t(*triangle)[3] = (uint32_t(*)[3])(position + n);
    void *scratch = triangle + n + (n & 1); /* stays aligned for doubles */
    for (uint32_t i = 0; i < n; i++)
        for (uint64_t k = 0; k < 3; k++)
            position[i][k] = (double)b->xyz[3 * (uint64_t)b->corner[i].vertex + k];
    ebpo_polygon_kind kind =
        ebpo_polygon_triangulate(triangle, (const double(*)[3])position, n, scratch);
    if (kind == EBPO_POLYGON_NO_MEMORY)
        return ebpo_fail_memory(b->error, n * sizeof *position);
    if (kind == EBPO_POLYGON_TOO_LARGE)
        return ebpo_fail_file(
            b->error, EBPO_E_LIMIT, b->name,
            "a concave polygon of %" PRIu32
            " corners is too intricate to be cut into triangles here; triangulate it in the source",
            n);
    b->mesh->polygons_triangulated++;
    b->mesh->polygons_concave += kind == EBPO_POLYGON_CONCAVE;
    if (kind == EBPO_POLYGON_GUESSED && b->mesh->polygons_guessed++ == 0)
        b->mesh->first_guessed_face = b->mesh->face_count;
    for (uint32_t i = 0; i < n - 2; i++)
        put_triangle(b, triangle[i][0], triangle[i][1], triangle[i][2]);
    return EBPO_OK;
}

ebpo_status ebpo_import_polygon(import_build *b)
{
    uint64_t n = b->corners;
    ebpo_status status = EBPO_OK;
    if (n < 3) {
        b->mesh->polygons_dropped++;
    } else {
        number_vertices(b);
        status = make_room(b, n - 2);
        if (status == EBPO_OK && n == 3)
            put_triangle(b, 0, 1, 2);
        else if (status == EBPO_OK)
            status = cut(b, (uint32_t)n);
    }
    b->corners = 0;
    return status;
}

/* --- the end --- */

/* Arrays grew by halves, and vertices may be fewer. */
static void trim(ebpo_mesh *mesh)
{
    if (mesh->workspace)
        return;
    float *xyz = ebpo_realloc(mesh->xyz32, mesh->vertex_count, 3 * sizeof *xyz);
    uint32_t *faces = ebpo_realloc(mesh->faces, mesh->face_count, 3 * sizeof *faces);
    mesh->xyz32 = xyz ? xyz : mesh->xyz32;
    mesh->faces = faces ? faces : mesh->faces;
}

ebpo_status ebpo_import_end(import_build *b)
{
    ebpo_mesh *mesh = b->mesh;
    ebpo_workspace *workspace = mesh->workspace;
    if (!mesh->face_count)
        return ebpo_fail_file(b->error, EBPO_E_FORMAT, b->name,
                              mesh->polygons_dropped
                                  ? "none of its faces has three corners; there is no mesh in it"
                                  : "has no faces; there is no mesh in this file");
    ebpo_array_free(workspace, b->use);
    ebpo_array_free(workspace, b->xyz);
    b->use = NULL;
    b->xyz = NULL;
    uint32_t *map = ebpo_array_alloc(workspace, mesh->vertex_count, sizeof *map);
    if (!map)
        return fail_memory(b, mesh->vertex_count * sizeof *map);
    ebpo_status status =
        ebpo_import_weld(mesh->xyz32, mesh->vertex_count, map, &mesh->vertex_count, b->error);
    if (status == EBPO_OK)
        EBPO_FOR_ITEMS_SCATTERED(workspace, i, 0, 3 * mesh->face_count)
            mesh->faces[i] = map[mesh->faces[i]];
    ebpo_array_free(workspace, map);
    if (status == EBPO_OK)
        trim(mesh);
    return status;
}

ebpo_status ebpo_import_notes(import_build *b)
{
    ebpo_mesh *mesh = b->mesh;
    if (!mesh->attributes && !(mesh->attributes = ebpo_attributes_make(mesh->workspace)))
        return ebpo_fail_memory(b->error, sizeof *mesh->attributes);
    return EBPO_OK;
}

void ebpo_import_word_text(char text[IMPORT_WORD_TEXT], const char *s, size_t n)
{
    n = n < IMPORT_WORD_TEXT ? n : IMPORT_WORD_TEXT - 1;
    for (size_t i = 0; i < n; i++)
        text[i] = s[i] < ' ' || s[i] > '~' ? '?' : s[i];
    text[n] = 0;
}

void ebpo_import_free(import_build *b)
{
    ebpo_workspace *workspace = b->mesh->workspace;
    for (int i = 0; i < IMPORT_SORTS; i++) {
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
