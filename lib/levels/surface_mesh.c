/* Joins patches of the simplified surface to one mesh without cracks. A patch approximates the
 * faces below a node (format/surface_patches.h).
 *
 * The border cells of a patch are the cells of the octree that are EBPO_PATCH_CELLS levels deeper
 * than the patch's node. On its border, a patch has at most one vertex in each border cell. Patches
 * are joined from coarse to fine. For each vertex on the border of a finer patch, the border cells
 * of the coarser patches that contain this vertex are searched, from coarse to fine. If a cell has
 * a vertex of a coarser patch, the search ends, and the cell's vertex replaces the vertex of the
 * finer patch. On a common border, the coarser patch has a vertex in each border cell that contains
 * a vertex of the model. So both patches get the same vertices. Vertices of the model's faces are
 * replaced in the same way. Source: format-spec/surface.md.
 *
 * At a crease, the normal of a vertex would light the triangles of all sides alike. So a vertex is
 * repeated, once for each side, with the mean normal of the triangles on this side. */
#include "core/strict_fp.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include <ebpo/lod.h>

#include "core/alloc.h"
#include "core/error.h"
#include "core/fp_env.h"
#include "core/hash.h"
#include "format/surface_patches.h"
#include "geometry/cells.h"
#include "geometry/vec3.h"
#include "levels/surface_mesh.h"

#define NONE UINT32_MAX

/* cosine of 30 degrees: greatest angle between triangles that share a normal at a crease */
static const double LEAST_COSINE = 0.866;

typedef struct joiner {
    const ebpo_patch_reader *reader;
    ebpo_box box;
    ebpo_surface_mesh *out;
    uint64_t vertices, triangles; /* numbers of vertices and triangles in `out` so far */
    uint32_t *slot;               /* [slots] hash table: the vertex of a border cell, or NONE */
    uint64_t *key;                /* [slots] the border cell (make_key) */
    uint64_t slots;
    bool level_used[EBPO_PATCH_LEVEL + 1]; /* true: a patch of this level was joined */
    bool alone; /* one patch without faces: its vertices stay, so that its error stays right */
} joiner;

/* Returns the key of a border cell: the level of the patch's node, and 20 bits (EBPO_PATCH_LEVEL +
 * EBPO_PATCH_CELLS) for each coordinate. */
static uint64_t make_key(int node_level, const uint32_t cell[3])
{
    return (uint64_t)node_level << 60 | (uint64_t)cell[2] << 40 | (uint64_t)cell[1] << 20 | cell[0];
}

/* Returns the slot of a key, or the empty slot where the key belongs. */
static uint64_t find_slot(const joiner *j, uint64_t key)
{
    uint64_t i = ebpo_hash_number(key) & (j->slots - 1);
    while (j->slot[i] != NONE && j->key[i] != key)
        i = (i + 1) & (j->slots - 1);
    return i;
}

/* Appends vertex v of a patch to the mesh; returns its new index. */
static uint32_t add_vertex(joiner *j, const ebpo_patch *patch, uint64_t v)
{
    uint32_t to = (uint32_t)j->vertices++;
    memcpy(j->out->mesh.xyz64 + 3 * (uint64_t)to, patch->xyz + 3 * v, 3 * sizeof(double));
    memcpy(j->out->normals + 3 * (uint64_t)to, patch->normals + 3 * v, 3 * sizeof(float));
    if (j->out->colours.vertex)
        memset(j->out->colours.vertex + 4 * (uint64_t)to, 0, 4);
    if (j->out->colours.vertex && patch->colours) {
        memcpy(j->out->colours.vertex + 4 * (uint64_t)to, patch->colours + 3 * v, 3);
        j->out->colours.vertex[4 * (uint64_t)to + 3] = 255;
    }
    return to;
}

/* Searches the border cells of patches of levels 0 to `levels` - 1 that contain the point p, from
 * coarse to fine. Returns the vertex of the first cell that has a vertex, or NONE. */
static uint32_t find_vertex(const joiner *j, const double p[3], int levels)
{
    for (int level = 0; level < levels; level++) {
        uint32_t cell[3];
        double cells = ldexp(1, level + EBPO_PATCH_CELLS);
        if (!j->level_used[level])
            continue;
        for (int k = 0; k < 3; k++)
            cell[k] =
                (uint32_t)fmin(fmax(floor((p[k] - j->box.origin[k]) / j->box.size[k] * cells), 0),
                               cells - 1);
        uint64_t i = find_slot(j, make_key(level, cell));
        if (j->slot[i] != NONE)
            return j->slot[i];
    }
    return NONE;
}

/* Returns the vertex of the mesh that replaces vertex v on the border of a patch. */
static uint32_t join_vertex(joiner *j, const ebpo_patch *patch, uint64_t v)
{
    const int shift = EBPO_PATCH_GRID - EBPO_PATCH_CELLS;    /* from grid steps to border cells */
    double steps = ldexp(1, patch->level + EBPO_PATCH_GRID); /* grid steps along the root cell */
    uint32_t cell[3];
    for (int k = 0; k < 3; k++) {
        double at = (patch->xyz[3 * v + (uint64_t)k] - j->box.origin[k]) / j->box.size[k] * steps;
        cell[k] = (uint32_t)fmin(fmax(floor(at + 0.5), 0), steps - 1) >> shift;
    }
    for (int level = 0; level < patch->level; level++) {
        if (!j->level_used[level])
            continue;
        int levels_up = patch->level - level;
        uint32_t coarse[3] = { cell[0] >> levels_up, cell[1] >> levels_up, cell[2] >> levels_up };
        uint64_t i = find_slot(j, make_key(level, coarse));
        if (j->slot[i] != NONE)
            return j->slot[i];
    }
    uint64_t key = make_key(patch->level, cell), i = find_slot(j, key);
    if (j->slot[i] == NONE) {
        j->slot[i] = add_vertex(j, patch, v);
        j->key[i] = key;
    }
    return j->slot[i];
}

/* Adds the triangles of a patch to the mesh. Omits triangles with two corners that have become the
 * same vertex. `mesh_vertex`: [vertex of the patch] index of the vertex in the mesh. */
static void add_triangles(joiner *j, const ebpo_patch *patch, const uint32_t *mesh_vertex)
{
    for (uint64_t i = 0; i < patch->triangle_count; i++) {
        const uint32_t *t = patch->triangles + 3 * i;
        uint32_t joined[3] = { mesh_vertex[t[0]], mesh_vertex[t[1]], mesh_vertex[t[2]] };
        if (joined[0] != joined[1] && joined[1] != joined[2] && joined[2] != joined[0])
            memcpy(j->out->mesh.faces + 3 * j->triangles++, joined, sizeof joined);
    }
    j->out->error = fmax(j->out->error, patch->error);
}

static void add_patch(joiner *j, const ebpo_patch *patch, const bool *border, uint32_t *mesh_vertex)
{
    for (uint64_t v = 0; v < patch->vertex_count; v++)
        mesh_vertex[v] =
            border[v] && !j->alone ? join_vertex(j, patch, v) : add_vertex(j, patch, v);
    j->level_used[patch->level] = true;
    add_triangles(j, patch, mesh_vertex);
}

static ebpo_status join_patch(joiner *j, uint64_t index, ebpo_error *error)
{
    ebpo_patch patch = EBPO_PATCH_INIT;
    ebpo_status status = j->reader->read(j->reader->user, index, &patch, error);
    if (status != EBPO_OK)
        return status;
    bool *border = ebpo_alloc(patch.vertex_count, sizeof *border);
    uint32_t *mesh_vertex = ebpo_alloc(patch.vertex_count, sizeof *mesh_vertex);
    if (border && mesh_vertex &&
        ebpo_patch_mark_border(patch.triangles, patch.triangle_count, patch.vertex_count, border))
        add_patch(j, &patch, border, mesh_vertex);
    else
        status = ebpo_fail_memory(error, patch.vertex_count * 16); /* approximate bytes */
    free(border);
    free(mesh_vertex);
    ebpo_patch_free(&patch);
    return status;
}

/* Adds faces of the model to the mesh. A vertex may stay in the mesh although no triangle uses it.
 */
static ebpo_status join_faces(joiner *j, const ebpo_patch *faces, ebpo_error *error)
{
    uint32_t *mesh_vertex = ebpo_alloc(faces->vertex_count, sizeof *mesh_vertex);
    if (!mesh_vertex)
        return ebpo_fail_memory(error, faces->vertex_count * sizeof *mesh_vertex);
    for (uint64_t v = 0; v < faces->vertex_count; v++) {
        mesh_vertex[v] = find_vertex(j, faces->xyz + 3 * v, EBPO_PATCH_LEVEL + 1);
        if (mesh_vertex[v] == NONE)
            mesh_vertex[v] = add_vertex(j, faces, v);
    }
    add_triangles(j, faces, mesh_vertex);
    j->out->faces = faces->triangle_count;
    free(mesh_vertex);
    return EBPO_OK;
}

/* Computes the normal of a triangle, in proportion to its area. The unit of length is a power of
 * two near the size of the model, so that products neither overflow nor underflow. */
static void area_normal(const joiner *j, const uint32_t t[3], double out[3])
{
    const double *xyz = j->out->mesh.xyz64;
    int exponent;
    double u[3], v[3];
    (void)frexp(fmax(j->box.size[0], fmax(j->box.size[1], j->box.size[2])), &exponent);
    ebpo_vec3_subtract(xyz + 3 * (uint64_t)t[1], xyz + 3 * (uint64_t)t[0], u);
    ebpo_vec3_subtract(xyz + 3 * (uint64_t)t[2], xyz + 3 * (uint64_t)t[0], v);
    for (int k = 0; k < 3; k++) {
        u[k] = ldexp(u[k], -exponent);
        v[k] = ldexp(v[k], -exponent);
    }
    ebpo_vec3_cross(u, v, out);
}

/* Returns true if the triangle with normal n, of any length, is on the side of a crease with this
 * unit normal. */
static bool is_on_side(const double n[3], const float normal[3])
{
    double m[3] = { (double)normal[0], (double)normal[1], (double)normal[2] };
    return ebpo_vec3_dot(n, m) >= LEAST_COSINE * ebpo_vec3_length(n);
}

/* The vertices at creases. */
typedef struct sides {
    double (*sum)[3]; /* [vertices] sum of the normals of the triangles on the vertex's side */
    uint32_t *next;   /* [vertices] the same vertex for the next side, or NONE */
    bool *sharp;      /* [vertices] the vertex is at a crease */
} sides;

/* Returns the vertex that replaces v for a triangle with normal n; adds the vertex if needed. A
 * side first has the normal of its first triangle. */
static uint32_t find_side(joiner *j, const sides *s, uint32_t v, const double n[3])
{
    ebpo_surface_mesh *out = j->out;
    double length = ebpo_vec3_length(n);
    uint32_t side = v, last = NONE;
    while (side != NONE && ebpo_vec3_length(s->sum[side]) > 0 &&
           !is_on_side(n, out->normals + 3 * (uint64_t)side)) {
        last = side;
        side = s->next[side];
    }
    if (side == NONE) {
        side = s->next[last] = (uint32_t)j->vertices++;
        memcpy(out->mesh.xyz64 + 3 * (uint64_t)side, out->mesh.xyz64 + 3 * (uint64_t)v,
               3 * sizeof *out->mesh.xyz64);
        if (out->colours.vertex)
            memcpy(out->colours.vertex + 4 * (uint64_t)side, out->colours.vertex + 4 * (uint64_t)v,
                   4);
        s->next[side] = NONE;
        s->sharp[side] = true;
        memset(s->sum[side], 0, sizeof *s->sum);
    }
    if (!(ebpo_vec3_length(s->sum[side]) > 0))
        for (int k = 0; k < 3; k++)
            out->normals[3 * (uint64_t)side + (uint64_t)k] = (float)(n[k] / length);
    for (int k = 0; k < 3; k++)
        s->sum[side][k] += n[k];
    return side;
}

/* Repeats the vertices at creases. `s` has space for each corner at such a vertex. */
static void separate_sides(joiner *j, const sides *s)
{
    double n[3];
    for (uint64_t c = 0; c < 3 * j->triangles; c++) {
        uint32_t *corner = j->out->mesh.faces + c;
        if (!s->sharp[*corner])
            continue;
        area_normal(j, j->out->mesh.faces + c / 3 * 3, n);
        if (ebpo_vec3_length(n) > 0)
            *corner = find_side(j, s, *corner, n);
    }
    for (uint64_t v = 0; v < j->vertices; v++) {
        double length = s->sharp[v] ? ebpo_vec3_length(s->sum[v]) : 0;
        for (int k = 0; k < 3 && length > 0; k++)
            j->out->normals[3 * v + (uint64_t)k] = (float)(s->sum[v][k] / length);
    }
}

/* Marks the vertices at creases. Returns the number of corners of triangles at these vertices. */
static uint64_t mark_creases(const joiner *j, bool *sharp)
{
    const uint32_t *corner = j->out->mesh.faces;
    uint64_t count = 0;
    double n[3];
    for (uint64_t c = 0; c < 3 * j->triangles; c++) {
        if (c % 3 == 0)
            area_normal(j, corner + c, n);
        sharp[corner[c]] |= !is_on_side(n, j->out->normals + 3 * (uint64_t)corner[c]);
    }
    for (uint64_t c = 0; c < 3 * j->triangles; c++)
        count += sharp[corner[c]];
    return count;
}

/* Separates the sides of creases. */
static ebpo_status light_creases(joiner *j, ebpo_error *error)
{
    ebpo_surface_mesh *out = j->out;
    uint64_t most = j->vertices + 3 * j->triangles, room = 0;
    sides s = { .sharp = ebpo_alloc_zero(most, sizeof *s.sharp) };
    bool made = s.sharp != NULL;
    if (made) {
        room = j->vertices + mark_creases(j, s.sharp);
        uint64_t places = j->vertices, normals = j->vertices, colours = j->vertices;
        s.sum = ebpo_alloc_zero(room, sizeof *s.sum);
        s.next = ebpo_alloc(room, sizeof *s.next);
        made = s.sum && s.next &&
               ebpo_grow(&out->mesh.xyz64, &places, room, 3 * sizeof *out->mesh.xyz64) &&
               ebpo_grow(&out->normals, &normals, room, 3 * sizeof *out->normals) &&
               (!out->colours.vertex || ebpo_grow(&out->colours.vertex, &colours, room, 4));
    }
    ebpo_status status = EBPO_OK;
    if (!made)
        status = ebpo_fail_memory(error, most + room * 64);
    else if (room >= NONE)
        status = ebpo_fail(error, EBPO_E_LIMIT, "the patches have more than 2^32 - 2 vertices");
    if (status == EBPO_OK) {
        memset(s.next, 0xff, room * sizeof *s.next);
        separate_sides(j, &s);
    }
    free(s.sum);
    free(s.next);
    free(s.sharp);
    return status;
}

void ebpo_surface_mesh_free(ebpo_surface_mesh *mesh)
{
    if (!mesh)
        return;
    ebpo_mesh_free(&mesh->mesh);
    ebpo_colours_free(&mesh->colours);
    free(mesh->normals);
    memset(mesh, 0, sizeof *mesh);
}

/* Checks the indices of the patches, counts vertices and triangles, and allocates the arrays. */
static ebpo_status begin_mesh(joiner *j, const uint64_t *patches, uint64_t count,
                              const ebpo_patch *faces, ebpo_error *error)
{
    ebpo_surface_mesh *out = j->out;
    uint64_t vertices = faces ? faces->vertex_count : 0,
             triangles = faces ? faces->triangle_count : 0;
    for (uint64_t i = 0; i < count; i++) {
        if (patches[i] >= j->reader->count || (i && patches[i] <= patches[i - 1]))
            return ebpo_fail(error, EBPO_E_ARGUMENT, "patches: not ascending numbers of patches");
        const uint64_t *row = j->reader->row + EBPO_PATCH_COLUMNS * patches[i];
        vertices += row[EBPO_PATCH_VERTICES];
        triangles += row[EBPO_PATCH_TRIANGLES];
    }
    if (vertices >= NONE)
        return ebpo_fail(error, EBPO_E_LIMIT, "the patches have more than 2^32 - 2 vertices");
    j->slots = ebpo_hash_slots(2 * vertices);
    j->slot = ebpo_alloc(j->slots, sizeof *j->slot);
    j->key = ebpo_alloc(j->slots, sizeof *j->key);
    out->mesh.xyz64 = ebpo_alloc(vertices, 3 * sizeof *out->mesh.xyz64);
    out->mesh.faces = ebpo_alloc(triangles, 3 * sizeof *out->mesh.faces);
    out->normals = ebpo_alloc(vertices, 3 * sizeof *out->normals);
    out->colours.vertex = j->reader->coloured ? ebpo_alloc(vertices, 4) : NULL;
    if (!j->slot || !j->key || !out->mesh.xyz64 || !out->mesh.faces || !out->normals ||
        (j->reader->coloured && !out->colours.vertex))
        return ebpo_fail_memory(error, vertices * 48);
    memset(j->slot, 0xff, j->slots * sizeof *j->slot);
    return EBPO_OK;
}

ebpo_status ebpo_patches_join(const ebpo_patch_reader *reader, const uint64_t *patches,
                              uint64_t count, const ebpo_patch *faces, ebpo_surface_mesh *out,
                              ebpo_error *error)
{
    EBPO_DEFAULT_FP;
    joiner j = { .reader = reader,
                 .box = ebpo_root_box(reader->info),
                 .out = out,
                 .alone = count == 1 && !faces };
    memset(out, 0, sizeof *out);
    out->pixels = NAN;
    ebpo_status status = begin_mesh(&j, patches, count, faces, error);
    for (uint64_t i = 0; i < count && status == EBPO_OK; i++)
        status = join_patch(&j, patches[i], error);
    if (status == EBPO_OK && faces)
        status = join_faces(&j, faces, error);
    if (status == EBPO_OK)
        status = light_creases(&j, error);
    out->mesh.vertex_count = j.vertices;
    out->mesh.face_count = j.triangles;
    out->patches = count;
    free(j.slot);
    free(j.key);
    if (status != EBPO_OK)
        ebpo_surface_mesh_free(out);
    return status;
}

/* Patches of a surface in memory. */
typedef struct decoding {
    const ebpo_surface *surface;
    const ebpo_info *info;
} decoding;

static ebpo_status decode_patch(const void *user, uint64_t patch, ebpo_patch *out,
                                ebpo_error *error)
{
    const decoding *d = user;
    return ebpo_surface_decode(d->surface, d->info, patch, out, error);
}

ebpo_status ebpo_surface_join(const ebpo_surface *surface, const ebpo_info *info,
                              const uint64_t *patches, uint64_t count, ebpo_surface_mesh *out,
                              ebpo_error *error)
{
    decoding d = { surface, info };
    ebpo_patch_reader reader = { info,           decode_patch,         &d,
                                 surface->patch, surface->patch_count, surface->colour != NULL };
    return ebpo_patches_join(&reader, patches, count, NULL, out, error);
}

/* Patches of a file. */
typedef struct reading {
    const ebpo_patch_table *table;
    ebpo_chunks *chunks;
} reading;

static ebpo_status read_patch(const void *user, uint64_t patch, ebpo_patch *out, ebpo_error *error)
{
    const reading *r = user;
    return ebpo_patch_read(r->table, r->chunks, patch, out, error);
}

ebpo_status ebpo_table_join(const ebpo_patch_table *table, ebpo_chunks *chunks,
                            const uint64_t *patches, uint64_t count, const ebpo_patch *faces,
                            ebpo_surface_mesh *out, ebpo_error *error)
{
    reading r = { table, chunks };
    const ebpo_info *info = &chunks->file->info;
    ebpo_patch_reader reader = { info,       read_patch,   &r,
                                 table->row, table->count, info->surface_colours > 0 };
    return ebpo_patches_join(&reader, patches, count, faces, out, error);
}

ebpo_status ebpo_surface_select(const ebpo_surface *surface, int level, uint64_t **patches,
                                uint64_t *count, ebpo_error *error)
{
    uint64_t child = 0;
    *count = 0;
    *patches = ebpo_alloc(surface->patch_count, sizeof **patches);
    if (!*patches)
        return ebpo_fail_memory(error, surface->patch_count * sizeof **patches);
    for (uint64_t i = 0; i < surface->patch_count; i++) {
        ebpo_octcode code = surface->patch[EBPO_PATCH_COLUMNS * i + EBPO_PATCH_OCTCODE];
        int patch_level = ebpo_octcode_level(code);
        /* Patches are sorted by octcode, so the children of patch i follow the children of patch
         * i - 1. `child` is the first patch that is a child of patch i or of a later patch. */
        while (child < surface->patch_count &&
               ebpo_octcode_parent(
                   surface->patch[EBPO_PATCH_COLUMNS * child + EBPO_PATCH_OCTCODE]) < code)
            child++;
        bool divided = child < surface->patch_count &&
                       ebpo_octcode_parent(
                           surface->patch[EBPO_PATCH_COLUMNS * child + EBPO_PATCH_OCTCODE]) == code;
        if (patch_level == level || (patch_level < level && !divided))
            (*patches)[(*count)++] = i;
    }
    return EBPO_OK;
}
