/* Joins patches of the simplified surface to one mesh without cracks.
 *
 * On the borders of the patches of a level there is one vertex for each cell, EBPO_PATCH_CELLS
 * levels below the patches' nodes. Patches are joined from coarse to fine: a vertex on the border
 * of a finer patch is replaced by the vertex of the coarsest cell that contains it and has a
 * vertex. Both sides of a border then have the same vertices, as each vertex of the model on the
 * border is in a cell with a vertex. Source: format-spec/surface.md. */
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

#define NONE UINT32_MAX

typedef struct joiner {
    const ebpo_surface *surface;
    const ebpo_info *info;
    ebpo_box box;
    ebpo_surface_mesh *out;
    uint64_t vertices, triangles; /* so far */
    uint32_t *slot;               /* hash table of the vertices of cells */
    uint64_t *key;                /* [slots] level and cell */
    uint64_t slots;
    bool level_used[EBPO_PATCH_LEVEL + 1];
} joiner;

static uint64_t make_key(int node_level, const uint32_t cell[3])
{
    return (uint64_t)node_level << 58 | (uint64_t)cell[2] << 38 | (uint64_t)cell[1] << 19 | cell[0];
}

/* Returns the slot of a key, or the empty slot where the key belongs. */
static uint64_t find_slot(const joiner *j, uint64_t key)
{
    uint64_t i = ebpo_hash_number(key) & (j->slots - 1);
    while (j->slot[i] != NONE && j->key[i] != key)
        i = (i + 1) & (j->slots - 1);
    return i;
}

static uint32_t add_vertex(joiner *j, const ebpo_patch *patch, uint64_t v)
{
    uint32_t to = (uint32_t)j->vertices++;
    memcpy(j->out->mesh.xyz64 + 3 * (uint64_t)to, patch->xyz + 3 * v, 3 * sizeof(double));
    memcpy(j->out->normals + 3 * (uint64_t)to, patch->normals + 3 * v, 3 * sizeof(float));
    if (patch->colours) {
        memcpy(j->out->colours.vertex + 4 * (uint64_t)to, patch->colours + 3 * v, 3);
        j->out->colours.vertex[4 * (uint64_t)to + 3] = 255;
    }
    return to;
}

/* Returns the vertex that replaces a vertex on the border of a patch. */
static uint32_t join_vertex(joiner *j, const ebpo_patch *patch, uint64_t v)
{
    const int shift = EBPO_PATCH_GRID - EBPO_PATCH_CELLS;
    double steps = ldexp(1, patch->level + EBPO_PATCH_GRID);
    uint32_t cell[3];
    for (int k = 0; k < 3; k++) {
        double at = (patch->xyz[3 * v + (uint64_t)k] - j->box.origin[k]) / j->box.size[k] * steps;
        cell[k] = (uint32_t)fmin(fmax(floor(at + 0.5), 0), steps - 1) >> shift;
    }
    for (int level = 0; level < patch->level; level++) {
        if (!j->level_used[level])
            continue;
        int up = patch->level - level;
        uint64_t i = find_slot(j, make_key(level, (uint32_t[3]){ cell[0] >> up, cell[1] >> up,
                                                                 cell[2] >> up }));
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

static void add_patch(joiner *j, const ebpo_patch *patch, const bool *border, uint32_t *number)
{
    for (uint64_t v = 0; v < patch->vertex_count; v++)
        number[v] = border[v] ? join_vertex(j, patch, v) : add_vertex(j, patch, v);
    j->level_used[patch->level] = true;
    for (uint64_t i = 0; i < patch->triangle_count; i++) {
        const uint32_t *t = patch->triangles + 3 * i;
        uint32_t joined[3] = { number[t[0]], number[t[1]], number[t[2]] };
        if (joined[0] != joined[1] && joined[1] != joined[2] && joined[2] != joined[0])
            memcpy(j->out->mesh.faces + 3 * j->triangles++, joined, sizeof joined);
    }
    j->out->error = fmax(j->out->error, patch->error);
}

static ebpo_status join_patch(joiner *j, uint64_t index, ebpo_error *error)
{
    ebpo_patch patch = EBPO_PATCH_INIT;
    ebpo_status status = ebpo_surface_decode(j->surface, j->info, index, &patch, error);
    if (status != EBPO_OK)
        return status;
    bool *border = ebpo_alloc(patch.vertex_count, sizeof *border);
    uint32_t *number = ebpo_alloc(patch.vertex_count, sizeof *number);
    if (border && number &&
        ebpo_patch_mark_border(patch.triangles, patch.triangle_count, patch.vertex_count, border))
        add_patch(j, &patch, border, number);
    else
        status = ebpo_fail_memory(error, patch.vertex_count * 16);
    free(border);
    free(number);
    ebpo_patch_free(&patch);
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

ebpo_status ebpo_surface_join(const ebpo_surface *surface, const ebpo_info *info,
                              const uint64_t *patches, uint64_t count, ebpo_surface_mesh *out,
                              ebpo_error *error)
{
    EBPO_DEFAULT_FP;
    joiner j = { .surface = surface, .info = info, .box = ebpo_root_box(info), .out = out };
    uint64_t vertices = 0, triangles = 0;
    memset(out, 0, sizeof *out);
    for (uint64_t i = 0; i < count; i++) {
        if (patches[i] >= surface->patch_count || (i && patches[i] <= patches[i - 1]))
            return ebpo_fail(error, EBPO_E_ARGUMENT, "patches: not ascending numbers of patches");
        const uint64_t *row = surface->patch + EBPO_PATCH_COLUMNS * patches[i];
        vertices += row[EBPO_PATCH_VERTICES];
        triangles += row[EBPO_PATCH_TRIANGLES];
    }
    if (vertices >= NONE)
        return ebpo_fail(error, EBPO_E_LIMIT, "the patches have more than 2^32 - 2 vertices");
    j.slots = ebpo_hash_slots(2 * vertices);
    j.slot = ebpo_alloc(j.slots, sizeof *j.slot);
    j.key = ebpo_alloc(j.slots, sizeof *j.key);
    out->mesh.xyz64 = ebpo_alloc(vertices, 3 * sizeof *out->mesh.xyz64);
    out->mesh.faces = ebpo_alloc(triangles, 3 * sizeof *out->mesh.faces);
    out->normals = ebpo_alloc(vertices, 3 * sizeof *out->normals);
    out->colours.vertex = surface->colour ? ebpo_alloc(vertices, 4) : NULL;
    ebpo_status status = EBPO_OK;
    if (!j.slot || !j.key || !out->mesh.xyz64 || !out->mesh.faces || !out->normals ||
        (surface->colour && !out->colours.vertex))
        status = ebpo_fail_memory(error, vertices * 48);
    else
        memset(j.slot, 0xff, j.slots * sizeof *j.slot);
    for (uint64_t i = 0; i < count && status == EBPO_OK; i++)
        status = join_patch(&j, patches[i], error);
    out->mesh.vertex_count = j.vertices;
    out->mesh.face_count = j.triangles;
    free(j.slot);
    free(j.key);
    if (status != EBPO_OK)
        ebpo_surface_mesh_free(out);
    return status;
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
        int of_node = ebpo_octcode_level(code);
        while (child < surface->patch_count &&
               ebpo_octcode_parent(
                   surface->patch[EBPO_PATCH_COLUMNS * child + EBPO_PATCH_OCTCODE]) < code)
            child++;
        bool divided = child < surface->patch_count &&
                       ebpo_octcode_parent(
                           surface->patch[EBPO_PATCH_COLUMNS * child + EBPO_PATCH_OCTCODE]) == code;
        if (of_node == level || (of_node < level && !divided))
            (*patches)[(*count)++] = i;
    }
    return EBPO_OK;
}
