/* Builds the part `surface` of a file (format-spec/surface.md). A patch is a coarse surface for the
 * faces below a node. The root has a patch, and so have the children of each node that has a patch
 * and many faces.
 *
 * The faces that are new below a node (no earlier leaf lists them) are a range of the model's
 * faces. If there are no patches below a node, the node's patch is made from these faces; otherwise
 * it is made from the patches of the node's children. Each patch has about a quarter as many
 * triangles as the faces or patches that it is made from. It has fewer if the grid of its points
 * does not show the difference, and more if collapses would move its vertices as far as those on
 * its border move (below).
 *
 * A vertex is on the border of a patch if faces that do not belong to the patch also use the
 * vertex. Each border vertex is replaced by the vertex of its cell. Its cell is the cell that
 * contains the border vertex, EBPO_PATCH_CELLS levels below the level of the node. The vertex of a
 * cell is at the mean of the model's vertices that are in the cell and on borders at the node's
 * level. This mean depends on the model only, so neighbouring patches have the same vertex.
 * Vertices on borders do not move when a patch is simplified.
 *
 * The error of a patch is an upper bound of its distance from the model. It is the sum of two
 * terms: the distance between the patch and the surface from which the patch is made, in both
 * directions, and the error of that surface. The model's faces have the error 0. Nodes with at most
 * TASK_FACES faces, and all nodes below them, are built in parallel; then the nodes above them are
 * built. */
#include "core/strict_fp.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include <ebpo/build.h>

#include "construct/construct_stages.h"
#include "construct/simplify.h"
#include "core/alloc.h"
#include "core/error.h"
#include "core/fp_env.h"
#include "core/hash.h"
#include "core/parallel.h"
#include "core/workspace.h"
#include "format/surface_patches.h"
#include "format/write_file.h"
#include "geometry/level_nodes.h"
#include "geometry/vec3.h"
#include "mesh/attributes.h"
#include "mesh/mesh_parts.h"

enum {
    LEAST_FACES = 2048,   /* a model with fewer faces has no patches */
    ROOT_FACES = 8192,    /* a model with more faces has patches below the root */
    MOST_FACES = 32768,   /* any other node with more faces has patches below it */
    TASK_FACES = 1 << 18, /* greatest number of faces of a parallel task */
    /* number of triangles before simplification, divided by the number afterwards */
    REDUCTION = 4,
    LEVELS = EBPO_PATCH_LEVEL + 1 /* number of levels with patches */
};
static const double LEAST_WEIGHT = 1e-12; /* weight of a face without area */

/* A node with a patch. The array of nodes is in depth-first order. */
typedef struct patch_node {
    ebpo_cell cell;
    uint64_t first, end;  /* faces first .. end - 1 are new below the node */
    uint64_t after;       /* index of the next node that is not below this one */
    ebpo_patch_mesh mesh; /* the patch, until the parent's patch is made */
    ebpo_patch_rows rows; /* the encoded patch, as the file stores it */
    /* in scaled coordinates (surface_builder.exponent); INFINITY: the node has no patch */
    double error;
    uint64_t triangles, vertices; /* their numbers in `rows` */
    bool made;                    /* the node was processed */
    bool stored;                  /* the file stores the patch */
    bool collapsed;               /* all triangles vanished, so the patch is a point (add_point) */
} patch_node;

/* The vertex that replaces the border vertices in a cell. Its fields are sums over all corners of
 * faces at these border vertices, weighted by the faces' areas. */
typedef struct cell_vertex {
    uint64_t key; /* cell_key; UINT64_MAX: an empty slot */
    double at[3]; /* weighted sum of positions; coordinates are 0 to 1 in the root cell */
    double normal[3], colour[3], weight;
} cell_vertex;

/* Hash table of the vertices of cells. */
typedef struct cell_table {
    cell_vertex *slot;
    uint64_t slots, count;
} cell_table;

/* A range of the model's faces, for one level: the faces of a node with a patch, or the faces
 * between two such nodes. No border between patches of this level is inside the range. */
typedef struct face_interval {
    uint64_t first, end;
} face_interval;

typedef struct surface_builder {
    ebpo_tree *tree;
    ebpo_box box;
    /* scaled coordinates are relative to the box's origin and divided by 2^exponent, so the longest
     * side of the box is 1 to 2 */
    int exponent;
    double size[3]; /* scaled size of the box */
    unsigned threads;
    patch_node *node; /* [count] */
    uint64_t count, capacity;
    face_interval *interval[LEVELS]; /* ascending; together they contain all faces */
    uint64_t interval_count[LEVELS];
    /* [level] vertices of the cells that contain border vertices of patches of this level */
    cell_table table[LEVELS];
    uint32_t *highest; /* [vertices] last face that uses the vertex */
    uint32_t *lowest;  /* [vertices] first face that uses the vertex */
    ebpo_colour_column colour[EBPO_COLOUR_CHANNELS];
    bool coloured, by_face; /* by_face: `colour` has the colours of faces, not of vertices */
    /* [task_count] indices of nodes; a parallel task builds such a node with all nodes below */
    uint64_t *task;
    uint64_t task_count;
    /* [level] indices of the next group and of the next leaf, while list_nodes runs */
    uint64_t group[EBPO_LEVELS_MAX], leaf[EBPO_LEVELS_MAX];
    bool short_of_memory;
} surface_builder;

/* --- nodes --- */

/* Adds a node. Returns false when out of memory. */
static bool add_node(surface_builder *b, ebpo_cell cell, uint64_t first, uint64_t end)
{
    if (!ebpo_grow(&b->node, &b->capacity, b->count + 1, sizeof *b->node)) {
        b->short_of_memory = true;
        return false;
    }
    patch_node *made = &b->node[b->count++];
    *made = (patch_node){ .cell = cell, .first = first, .end = end, .after = b->count };
    return true;
}

/* Lists a gray node if it has faces. If it has more than MOST_FACES faces, also lists the nodes
 * with faces below it. `first`: first new face of the node. Returns the end of the node's range of
 * new faces. The function is recursive; its depth is the number of levels. */
static uint64_t list_nodes(surface_builder *b, ebpo_cell cell, uint64_t first)
{
    int below = cell.level + 1;
    const ebpo_level *level = &b->tree->level[below];
    uint64_t self = b->count, end = first;
    uint16_t types = level->types[b->group[below]++];
    if (!add_node(b, cell, first, first))
        return first;
    for (unsigned octant = 0; octant < 8 && !b->short_of_memory; octant++) {
        ebpo_node_type type = ebpo_group_type(types, octant);
        ebpo_cell child = ebpo_cell_child(cell, octant);
        uint64_t from = end;
        if (type == EBPO_GRAY)
            end = list_nodes(b, child, end);
        else if (type == EBPO_LEAF)
            end += level->leaf_new[b->leaf[below]++];
        if (type == EBPO_LEAF && end > from)
            add_node(b, child, from, end);
    }
    b->node[self].end = end;
    if (end - first <= (cell.level ? MOST_FACES : ROOT_FACES) || cell.level == EBPO_PATCH_LEVEL)
        b->count = end > first ? self + 1 : self;
    b->node[self].after = b->count;
    return end;
}

/* --- borders --- */

/* Lists the intervals of all levels. Returns false when out of memory. */
static bool list_intervals(surface_builder *b)
{
    uint64_t faces = b->tree->info.face_count;
    for (int level = 0; level < LEVELS; level++) {
        uint64_t capacity = 0, at = 0, *count = &b->interval_count[level];
        for (uint64_t i = 0; i <= b->count; i++) {
            bool last = i == b->count;
            if (!last && b->node[i].cell.level != level)
                continue;
            uint64_t first = last ? faces : b->node[i].first;
            if (!ebpo_grow(&b->interval[level], &capacity, *count + 2, sizeof **b->interval))
                return false;
            if (at < first)
                b->interval[level][(*count)++] = (face_interval){ at, first };
            if (!last)
                b->interval[level][(*count)++] = (face_interval){ first, b->node[i].end };
            at = last ? faces : b->node[i].end;
        }
    }
    return true;
}

/* Returns the key of the cell with the indices `at` along the axes; each index takes 21 bits. */
static uint64_t cell_key(const uint32_t at[3])
{
    return (uint64_t)at[2] << 42 | (uint64_t)at[1] << 21 | at[0];
}

/* Returns the key of the cell that contains a point, EBPO_PATCH_CELLS levels below node_level. The
 * coordinates of the point are 0 to 1 in the root cell. */
static uint64_t key_of_point(const double unit[3], int node_level)
{
    double cells = ldexp(1, node_level + EBPO_PATCH_CELLS);
    uint32_t at[3];
    for (int k = 0; k < 3; k++)
        at[k] = (uint32_t)fmin(fmax(floor(unit[k] * cells), 0), cells - 1);
    return cell_key(at);
}

/* Returns the cell's slot, or the empty slot (key UINT64_MAX) where the cell can be inserted. */
static cell_vertex *find_cell(const cell_table *table, uint64_t key)
{
    uint64_t i = ebpo_hash_number(key) & (table->slots - 1);
    while (table->slot[i].key != UINT64_MAX && table->slot[i].key != key)
        i = (i + 1) & (table->slots - 1);
    return &table->slot[i];
}

/* Moves the vertices to a table with more slots. Returns false when out of memory. */
static bool resize_table(cell_table *table, uint64_t slots)
{
    cell_table larger = { .slots = slots, .count = table->count };
    larger.slot = ebpo_alloc(slots, sizeof *larger.slot);
    if (!larger.slot)
        return false;
    for (uint64_t i = 0; i < slots; i++)
        larger.slot[i].key = UINT64_MAX;
    for (uint64_t i = 0; i < table->slots; i++)
        if (table->slot[i].key != UINT64_MAX)
            *find_cell(&larger, table->slot[i].key) = table->slot[i];
    free(table->slot);
    *table = larger;
    return true;
}

/* Returns the vertex of a cell, which is inserted if needed; NULL when out of memory. */
static cell_vertex *enter_cell(cell_table *table, uint64_t key)
{
    if (4 * (table->count + 1) > 3 * table->slots &&
        !resize_table(table, table->slots ? 2 * table->slots : 1024))
        return NULL;
    cell_vertex *found = find_cell(table, key);
    if (found->key == UINT64_MAX) {
        *found = (cell_vertex){ .key = key };
        table->count++;
    }
    return found;
}

/* A face of the model. */
typedef struct scaled_face {
    double corner[3][3]; /* scaled coordinates */
    double unit[3][3];   /* coordinates in the root cell, 0 to 1 */
    double normal[3];    /* the length of this vector is twice the face's area */
    double weight;       /* length of `normal` plus LEAST_WEIGHT */
} scaled_face;

static void get_face(const surface_builder *b, uint64_t face, scaled_face *out)
{
    const ebpo_mesh *mesh = &b->tree->mesh;
    double p[3], u[3], v[3];
    for (int i = 0; i < 3; i++) {
        ebpo_mesh_position(mesh, mesh->faces[3 * face + (uint64_t)i], p);
        for (int k = 0; k < 3; k++) {
            double from_origin = p[k] - b->box.origin[k];
            out->corner[i][k] = ldexp(from_origin, -b->exponent);
            out->unit[i][k] = from_origin / b->box.size[k];
        }
    }
    ebpo_vec3_subtract(out->corner[1], out->corner[0], u);
    ebpo_vec3_subtract(out->corner[2], out->corner[0], v);
    ebpo_vec3_cross(u, v, out->normal);
    out->weight = ebpo_vec3_length(out->normal) + LEAST_WEIGHT;
}

/* Sets `out` to the colour of `vertex`, or of `face` if b->by_face is true. If the model has no
 * colours, sets it to zeros. */
static void get_colour(const surface_builder *b, uint64_t face, uint32_t vertex, double out[3])
{
    for (int k = 0; k < 3; k++)
        out[k] = b->coloured ? ebpo_colour_byte(&b->colour[k], b->by_face ? face : vertex) : 0;
}

/* Returns true if a face that is not in the interval uses the vertex. */
static bool is_on_border(const surface_builder *b, uint32_t vertex, face_interval inside)
{
    return b->lowest[vertex] < inside.first || b->highest[vertex] >= inside.end;
}

/* Adds corner k of a face to the vertex of the cell that contains this corner. Returns false when
 * out of memory. */
static bool add_corner(surface_builder *b, int level, uint64_t face, const scaled_face *f, int k)
{
    cell_vertex *cell = enter_cell(&b->table[level], key_of_point(f->unit[k], level));
    double colour[3];
    if (!cell)
        return false;
    get_colour(b, face, b->tree->mesh.faces[3 * face + (uint64_t)k], colour);
    for (int i = 0; i < 3; i++) {
        cell->at[i] += f->weight * f->unit[k][i];
        cell->normal[i] += f->normal[i];
        cell->colour[i] += f->weight * colour[i];
    }
    cell->weight += f->weight;
    return true;
}

/* For each level, adds all corners of faces that are on a border between patches of this level to
 * the vertices of their cells. Returns false when out of memory. */
static bool add_borders(surface_builder *b)
{
    const ebpo_mesh *mesh = &b->tree->mesh;
    uint64_t current[LEVELS] = { 0 }; /* [level] index of the interval that contains the face */
    EBPO_FOR_ITEMS(b->tree->workspace, face, 0, mesh->face_count) {
        const uint32_t *corner = mesh->faces + 3 * face;
        scaled_face f;
        bool known = false;
        for (int level = 0; level < LEVELS; level++) {
            if (b->interval_count[level] == 1)
                continue;
            while (b->interval[level][current[level]].end <= face)
                current[level]++;
            for (int k = 0; k < 3; k++) {
                if (!is_on_border(b, corner[k], b->interval[level][current[level]]))
                    continue;
                if (!known)
                    get_face(b, face, &f);
                known = true;
                if (!add_corner(b, level, face, &f, k))
                    return false;
            }
        }
    }
    return true;
}

/* Finds the first and the last face that use each vertex. Returns false when out of memory. */
static bool find_uses(surface_builder *b)
{
    const ebpo_mesh *mesh = &b->tree->mesh;
    ebpo_workspace *workspace = b->tree->workspace;
    b->lowest = ebpo_array_alloc(workspace, mesh->vertex_count, sizeof *b->lowest);
    b->highest = ebpo_array_zero(workspace, mesh->vertex_count, sizeof *b->highest);
    if (!b->lowest || !b->highest)
        return false;
    ebpo_array_fill(workspace, b->lowest, 0xff, mesh->vertex_count * sizeof *b->lowest);
    EBPO_FOR_ITEMS(workspace, i, 0, 3 * mesh->face_count) {
        uint32_t v = mesh->faces[i], face = (uint32_t)(i / 3);
        b->lowest[v] = face < b->lowest[v] ? face : b->lowest[v];
        b->highest[v] = face > b->highest[v] ? face : b->highest[v];
    }
    return true;
}

/* --- the surface that a patch is made from --- */

/* Hash table from keys to vertices of a mesh, or of its triangles. */
typedef struct key_table {
    uint32_t *slot; /* index of a vertex or triangle; UINT32_MAX: empty */
    uint64_t slots;
} key_table;

/* This bit is 1 in keys of vertices of the model, and 0 in keys of cells. */
static const uint64_t MODEL_VERTEX = UINT64_C(1) << 63;

/* Makes a table with twice as many slots for the mesh's vertices. Returns false when out of memory.
 */
static bool grow_keys(key_table *table, const ebpo_patch_mesh *mesh)
{
    uint64_t slots = table->slots ? 2 * table->slots : 4096;
    free(table->slot);
    table->slots = slots;
    table->slot = ebpo_alloc(slots, sizeof *table->slot);
    if (!table->slot)
        return false;
    memset(table->slot, 0xff, slots * sizeof *table->slot);
    for (uint64_t v = 0; v < mesh->vertex_count; v++) {
        if (mesh->vertex[v].key == UINT64_MAX)
            continue;
        uint64_t i = ebpo_hash_number(mesh->vertex[v].key) & (slots - 1);
        while (table->slot[i] != UINT32_MAX)
            i = (i + 1) & (slots - 1);
        table->slot[i] = (uint32_t)v;
    }
    return true;
}

/* Returns the vertex that has the key. If no vertex has the key, or if the key is UINT64_MAX (for a
 * vertex that is on no border), adds a vertex. Sets *is_new to true if a vertex was added. Returns
 * NULL when out of memory. */
static ebpo_patch_vertex *enter_vertex(ebpo_patch_mesh *mesh, key_table *table, uint64_t key,
                                       bool *is_new)
{
    if (!ebpo_grow(&mesh->vertex, &mesh->vertex_capacity, mesh->vertex_count + 1,
                   sizeof *mesh->vertex))
        return NULL;
    *is_new = true;
    if (key != UINT64_MAX) {
        if (2 * (mesh->vertex_count + 1) > table->slots && !grow_keys(table, mesh))
            return NULL;
        uint64_t i = ebpo_hash_number(key) & (table->slots - 1);
        while (table->slot[i] != UINT32_MAX && mesh->vertex[table->slot[i]].key != key)
            i = (i + 1) & (table->slots - 1);
        *is_new = table->slot[i] == UINT32_MAX;
        if (!*is_new)
            return &mesh->vertex[table->slot[i]];
        table->slot[i] = (uint32_t)mesh->vertex_count;
    }
    ebpo_patch_vertex *made = &mesh->vertex[mesh->vertex_count++];
    *made = (ebpo_patch_vertex){ .key = key, .lowest = UINT64_MAX };
    return made;
}

/* Appends a triangle. Returns false when out of memory. */
static bool add_triangle(ebpo_patch_mesh *mesh, const uint32_t t[3])
{
    if (!ebpo_grow(&mesh->triangle, &mesh->triangle_capacity, mesh->triangle_count + 1,
                   3 * sizeof *mesh->triangle))
        return false;
    memcpy(mesh->triangle + 3 * mesh->triangle_count++, t, 3 * sizeof *t);
    return true;
}

/* Copies position, normal and colour from the vertex of a cell to `v`. `key`: key of the cell. */
static void set_cell_vertex(const surface_builder *b, ebpo_patch_vertex *v, int node_level,
                            uint64_t key)
{
    const cell_vertex *cell = find_cell(&b->table[node_level], key);
    uint32_t at[3] = { key & 0x1fffff, key >> 21 & 0x1fffff, (uint32_t)(key >> 42) };
    const int shift = EBPO_PATCH_GRID - EBPO_PATCH_CELLS;
    double steps = ldexp(1, node_level + EBPO_PATCH_GRID);
    for (int k = 0; k < 3; k++) {
        /* the coordinate is rounded to the grid of the patch, and stays within the cell */
        double least = (double)((uint64_t)at[k] << shift), greatest = least + (1 << shift) - 1,
               on_grid = floor(cell->at[k] / cell->weight * steps + 0.5);
        on_grid = fmin(fmax(on_grid, least), greatest);
        v->at[k] = on_grid / steps * b->size[k];
        v->normal[k] = cell->normal[k];
        v->colour[k] = cell->colour[k];
    }
    v->weight = cell->weight;
}

/* Extends the range of faces that use a vertex. */
static void widen_uses(ebpo_patch_vertex *v, uint64_t lowest, uint64_t highest)
{
    v->lowest = lowest < v->lowest ? lowest : v->lowest;
    v->highest = highest > v->highest ? highest : v->highest;
}

/* Returns true if each corner of triangle p is a corner of triangle q. */
static bool is_within(const uint32_t p[3], const uint32_t q[3])
{
    bool within = true;
    for (int k = 0; k < 3; k++)
        within = within && (p[k] == q[0] || p[k] == q[1] || p[k] == q[2]);
    return within;
}

/* Returns true if a triangle of the mesh in the hash table `seen` has the same corners as t, in any
 * order. Otherwise enters the next triangle of the mesh. */
static bool is_repeated(const ebpo_patch_mesh *mesh, key_table *seen, const uint32_t t[3])
{
    uint64_t i = ebpo_hash_number(t[0]) + ebpo_hash_number(t[1]) + ebpo_hash_number(t[2]);
    for (i &= seen->slots - 1; seen->slot[i] != UINT32_MAX; i = (i + 1) & (seen->slots - 1)) {
        const uint32_t *other = mesh->triangle + 3 * (uint64_t)seen->slot[i];
        if (is_within(t, other) && is_within(other, t))
            return true;
    }
    seen->slot[i] = (uint32_t)mesh->triangle_count;
    return false;
}

/* Adds the faces first .. end - 1 of the model to a mesh. Also adds faces with repeated corners,
 * because the error of the patch must bound the distance of these faces, too. Of faces with the
 * same corners, such as the two sides of a wall without thickness, adds the first only: they are
 * the same points, and no edge of both could collapse. Returns false when out of memory. */
static bool add_faces(const surface_builder *b, ebpo_patch_mesh *mesh, uint64_t first, uint64_t end)
{
    const uint32_t *corner = b->tree->mesh.faces + 3 * first;
    key_table table = { NULL, 0 }, seen = { NULL, ebpo_hash_slots(2 * (end - first)) };
    bool made, is_new;
    seen.slot = ebpo_alloc(seen.slots, sizeof *seen.slot);
    made = seen.slot != NULL;
    if (made)
        memset(seen.slot, 0xff, seen.slots * sizeof *seen.slot);
    for (uint64_t face = first; face < end && made; face++, corner += 3) {
        scaled_face f;
        uint32_t t[3] = { 0, 0, 0 };
        get_face(b, face, &f);
        for (int k = 0; k < 3 && made; k++) {
            ebpo_patch_vertex *to = enter_vertex(mesh, &table, corner[k] | MODEL_VERTEX, &is_new);
            made = to != NULL;
            if (!made)
                break;
            double colour[3];
            t[k] = (uint32_t)(to - mesh->vertex);
            to->lowest = b->lowest[corner[k]];
            to->highest = b->highest[corner[k]];
            memcpy(to->at, f.corner[k], sizeof to->at);
            get_colour(b, face, corner[k], colour);
            for (int i = 0; i < 3; i++) {
                to->normal[i] += f.normal[i];
                to->colour[i] += f.weight * colour[i];
            }
            to->weight += f.weight;
        }
        made = made && (is_repeated(mesh, &seen, t) || add_triangle(mesh, t));
    }
    free(table.slot);
    free(seen.slot);
    return made;
}

/* Adds the patch of a child to a mesh. Returns false when out of memory. */
static bool add_patch(ebpo_patch_mesh *mesh, key_table *table, const ebpo_patch_mesh *from)
{
    uint32_t *new_index = ebpo_alloc(from->vertex_count, sizeof *new_index);
    bool made = new_index != NULL, is_new;
    for (uint64_t v = 0; v < from->vertex_count && made; v++) {
        const ebpo_patch_vertex *old = &from->vertex[v];
        ebpo_patch_vertex *to = enter_vertex(mesh, table, old->key, &is_new);
        made = to != NULL;
        if (!made)
            break;
        if (is_new)
            *to = *old;
        widen_uses(to, old->lowest, old->highest);
        to->fixed = false;
        new_index[v] = (uint32_t)(to - mesh->vertex);
    }
    for (uint64_t i = 0; i < from->triangle_count && made; i++) {
        const uint32_t *t = from->triangle + 3 * i;
        made =
            add_triangle(mesh, (uint32_t[3]){ new_index[t[0]], new_index[t[1]], new_index[t[2]] });
    }
    free(new_index);
    return made;
}

/* Returns true if a node has a patch with triangles. Returns false if there is no patch, or if all
 * triangles vanished when border vertices were replaced by vertices of cells. */
static bool has_patch(const patch_node *node) { return isfinite(node->error) && !node->collapsed; }

/* Adds the faces of the children for which has_patch is false to `mesh`. The node's patch is made
 * without these faces, but its error must also bound their distance from the patch, and the error
 * is measured from `mesh`. Returns false when out of memory. */
static bool add_collapsed_children(const surface_builder *b, const patch_node *node,
                                   ebpo_patch_mesh *mesh)
{
    bool made = true;
    for (uint64_t i = (uint64_t)(node - b->node) + 1; i < node->after && made; i = b->node[i].after)
        if (!has_patch(&b->node[i]))
            made = add_faces(b, mesh, b->node[i].first, b->node[i].end);
    return made;
}

/* Makes the surface from which a node's patch is made: the node's faces, or the patches of its
 * children. Frees the children's patches. Sets *error to the greatest error of these patches.
 * Returns false when out of memory. */
static bool gather_surface(surface_builder *b, const patch_node *node, ebpo_patch_mesh *mesh,
                           double *error)
{
    key_table table = { NULL, 0 };
    uint64_t i = (uint64_t)(node - b->node) + 1;
    bool made = true;
    *error = 0;
    if (i == node->after)
        return add_faces(b, mesh, node->first, node->end);
    for (; i < node->after && made; i = b->node[i].after) {
        patch_node *child = &b->node[i];
        made = add_patch(mesh, &table, &child->mesh);
        if (has_patch(child))
            *error = fmax(*error, child->error);
        ebpo_patch_mesh_free(&child->mesh);
    }
    free(table.slot);
    return made;
}

/* --- patches --- */

/* Returns the key of the cell that contains a vertex of the model. */
static uint64_t key_of_vertex(const surface_builder *b, uint32_t vertex, int node_level)
{
    double p[3];
    ebpo_mesh_position(&b->tree->mesh, vertex, p);
    for (int k = 0; k < 3; k++)
        p[k] = (p[k] - b->box.origin[k]) / b->box.size[k];
    return key_of_point(p, node_level);
}

/* Copies the mesh `from` to `to`, and replaces the vertices on the border of the node's patch by
 * the vertices of their cells. Omits triangles that have repeated corners after the replacement.
 * Returns false when out of memory. */
static bool snap_border(surface_builder *b, const patch_node *node, const ebpo_patch_mesh *from,
                        ebpo_patch_mesh *to)
{
    key_table table = { NULL, 0 };
    uint32_t *new_index = ebpo_alloc(from->vertex_count, sizeof *new_index);
    bool made = new_index != NULL, is_new;
    for (uint64_t v = 0; v < from->vertex_count && made; v++) {
        const ebpo_patch_vertex *old = &from->vertex[v];
        bool border = old->lowest < node->first || old->highest >= node->end;
        uint64_t key = UINT64_MAX;
        if (border && old->key & MODEL_VERTEX) {
            key = key_of_vertex(b, (uint32_t)old->key, node->cell.level);
        } else if (border) { /* the old key is the key of a cell one level deeper; the new key is
                              * the key of this cell's parent */
            uint32_t at[3] = { (old->key & 0x1fffff) >> 1, (old->key >> 21 & 0x1fffff) >> 1,
                               (uint32_t)(old->key >> 43) };
            key = cell_key(at);
        }
        ebpo_patch_vertex *made_vertex = enter_vertex(to, &table, key, &is_new);
        made = made_vertex != NULL;
        if (!made)
            break;
        new_index[v] = (uint32_t)(made_vertex - to->vertex);
        if (!border)
            *made_vertex = *old;
        else if (is_new)
            set_cell_vertex(b, made_vertex, node->cell.level, key);
        made_vertex->key = key;
        made_vertex->fixed = border;
        if (border)
            widen_uses(made_vertex, old->lowest, old->highest);
    }
    for (uint64_t i = 0; i < from->triangle_count && made; i++) {
        const uint32_t *t = from->triangle + 3 * i;
        uint32_t p = new_index[t[0]], q = new_index[t[1]], r = new_index[t[2]];
        if (p != q && q != r && r != p)
            made = add_triangle(to, (uint32_t[3]){ p, q, r });
    }
    free(new_index);
    free(table.slot);
    return made;
}

/* Rounds the vertices to the grid of the patch. Sets `point` to their coordinates in steps of this
 * grid, relative to the lowest corner of the node's cell. Returns false if a vertex is too far from
 * the node for 16 bits. */
static bool move_to_grid(const surface_builder *b, const patch_node *node, ebpo_patch_mesh *mesh,
                         int16_t *point)
{
    double steps = ldexp(1, node->cell.level + EBPO_PATCH_GRID);
    bool near = true;
    for (uint64_t v = 0; v < mesh->vertex_count; v++) {
        double *at = mesh->vertex[v].at;
        for (int k = 0; k < 3; k++) {
            double on_grid = b->size[k] > 0 ? floor(at[k] / b->size[k] * steps + 0.5) : 0,
                   local = on_grid - ldexp(node->cell.at[k], EBPO_PATCH_GRID);
            near = near && local >= -INT16_MAX && local <= INT16_MAX;
            point[3 * v + (uint64_t)k] = (int16_t)(near ? local : 0);
            at[k] = on_grid / steps * b->size[k];
        }
    }
    return near;
}

/* Sets node->rows to the encoded patch, as the file stores it. `point`: result of move_to_grid. */
static ebpo_status encode_rows(const surface_builder *b, patch_node *node, const int16_t *point,
                               ebpo_error *error)
{
    const ebpo_patch_mesh *mesh = &node->mesh;
    double(*normal)[3] = ebpo_alloc(mesh->vertex_count, sizeof *normal);
    uint8_t *colour = b->coloured ? ebpo_alloc(mesh->vertex_count, 3) : NULL;
    ebpo_status status = normal && (colour || !b->coloured)
                             ? EBPO_OK
                             : ebpo_fail_memory(error, mesh->vertex_count * sizeof *normal);
    for (uint64_t v = 0; v < mesh->vertex_count && status == EBPO_OK; v++) {
        const ebpo_patch_vertex *from = &mesh->vertex[v];
        /* Neighbouring patches need equal normals at their border. The mean of the patch's
         * triangles is nearly as good elsewhere. */
        for (int k = 0; k < 3; k++)
            normal[v][k] = from->fixed ? from->normal[k] : 0;
        for (int k = 0; k < 3 && colour; k++)
            colour[3 * v + (uint64_t)k] =
                (uint8_t)fmin(255, floor(from->colour[k] / from->weight + 0.5));
    }
    node->triangles = mesh->triangle_count;
    node->vertices = mesh->vertex_count;
    if (status == EBPO_OK)
        status = ebpo_patch_encode(&(ebpo_patch_source){ mesh->vertex_count, mesh->triangle_count,
                                                         mesh->triangle, point,
                                                         (const double(*)[3])normal, colour },
                                   &node->rows, error);
    free(normal);
    free(colour);
    return status;
}

/* Returns half a step of the grid of a node's patch. Rounding to the grid changes the patch by
 * about as much. */
static double fine_of(const patch_node *node)
{
    return ldexp(1, -node->cell.level - EBPO_PATCH_GRID - 1);
}

/* Sets the error of a node's patch. `from`: the surface from which the patch was made. `before`:
 * the error of this surface. */
static ebpo_status bound_error(const surface_builder *b, patch_node *node,
                               const ebpo_patch_mesh *from, double before, ebpo_error *error)
{
    double fine = fine_of(node), there = 0, back = 0,
           greatest = 0; /* greatest: the greatest absolute coordinate of the box */
    ebpo_status status = ebpo_bound_distance(from, &node->mesh, fine, 0, &back, error);
    if (status == EBPO_OK)
        status = ebpo_bound_distance(&node->mesh, from, fine, back, &there, error);
    for (int k = 0; k < 3; k++)
        greatest = fmax(greatest, fabs(b->box.origin[k]) + b->box.size[k]);
    /* a reader rounds each coordinate of a vertex by at most 2^-52 of `greatest`; the last term is
     * more than the rounding errors of scaled positions and of their distances */
    node->error = before + fmax(there, back) + ldexp(greatest, -b->exponent) * 0x1p-50 + 0x1p-40;
    return status;
}

/* Readers find the border vertices of a patch by edges that have only one triangle. If all edges of
 * a border vertex have two triangles, this function adds a vertex without triangles at the same
 * position. Readers treat vertices without triangles as border vertices, too. Returns false when
 * out of memory. */
static bool add_hidden_vertices(ebpo_patch_mesh *mesh)
{
    uint64_t count = mesh->vertex_count;
    bool *border = ebpo_alloc(count, sizeof *border);
    bool made =
        border && ebpo_patch_mark_border(mesh->triangle, mesh->triangle_count, count, border);
    for (uint64_t v = 0; v < count && made; v++) {
        if (border[v] || !mesh->vertex[v].fixed)
            continue;
        made = ebpo_grow(&mesh->vertex, &mesh->vertex_capacity, mesh->vertex_count + 1,
                         sizeof *mesh->vertex);
        if (made)
            mesh->vertex[mesh->vertex_count++] = mesh->vertex[v];
    }
    free(border);
    return made;
}

/* Makes a patch that is a point: a triangle with three equal corners. It is called if all triangles
 * of a patch vanish because their corners are replaced by vertices of cells. The node needs a
 * patch, because patches of siblings are stored only if all siblings have one. */
static bool add_point(ebpo_patch_mesh *mesh)
{
    bool made = add_triangle(mesh, (uint32_t[3]){ 0, 0, 0 }) && add_hidden_vertices(mesh);
    while (made && mesh->vertex_count < 3) { /* a patch has at least three vertices */
        made = ebpo_grow(&mesh->vertex, &mesh->vertex_capacity, mesh->vertex_count + 1,
                         sizeof *mesh->vertex);
        if (made)
            mesh->vertex[mesh->vertex_count++] = mesh->vertex[0];
    }
    return made;
}

/* Makes the patch of a node from its faces or from its children's patches. */
static ebpo_status make_patch(surface_builder *b, patch_node *node, ebpo_error *error)
{
    ebpo_patch_mesh from = { 0 };
    int16_t *point = NULL;
    double before = 0;
    ebpo_status status = EBPO_OK;
    if (!gather_surface(b, node, &from, &before) || !snap_border(b, node, &from, &node->mesh))
        status = ebpo_fail_memory(error, from.vertex_count * sizeof *from.vertex);
    if (status == EBPO_OK)
        status = ebpo_simplify(&node->mesh, from.triangle_count / REDUCTION, fine_of(node), error);
    if (status == EBPO_OK && !add_collapsed_children(b, node, &from))
        status = ebpo_fail_memory(error, from.triangle_count * 3 * sizeof *from.triangle);
    uint64_t vertices = node->mesh.vertex_count;
    node->collapsed = node->mesh.triangle_count == 0 && vertices && node != b->node;
    bool made = status != EBPO_OK ||
                (node->collapsed ? add_point(&node->mesh) : add_hidden_vertices(&node->mesh));
    if (!made)
        status = ebpo_fail_memory(error, node->mesh.vertex_count * sizeof *from.vertex);
    if (status == EBPO_OK) {
        point = ebpo_alloc(node->mesh.vertex_count, 3 * sizeof *point);
        status = point ? EBPO_OK : ebpo_fail_memory(error, node->mesh.vertex_count * 6);
    }
    node->made = true;
    node->error = INFINITY;
    if (status == EBPO_OK && node->mesh.triangle_count) {
        node->stored = move_to_grid(b, node, &node->mesh, point);
        status = bound_error(b, node, &from, before, error);
        if (status == EBPO_OK && node->stored)
            status = encode_rows(b, node, point, error);
    }
    if (node->collapsed) { /* the parent's patch is made without this point */
        node->mesh.triangle_count = 0;
        node->mesh.vertex_count = vertices;
    }
    free(point);
    ebpo_patch_mesh_free(&from);
    return status;
}

/* Makes the patches of a node and of all nodes below it. The function is recursive; its depth is
 * the number of levels. */
static ebpo_status make_below(surface_builder *b, uint64_t i, ebpo_error *error)
{
    patch_node *node = &b->node[i];
    ebpo_status status = EBPO_OK;
    for (uint64_t k = i + 1; k < node->after && status == EBPO_OK; k = b->node[k].after)
        if (!b->node[k].made)
            status = make_below(b, k, error);
    return status == EBPO_OK ? make_patch(b, node, error) : status;
}

static ebpo_status run_tasks(void *context, uint64_t begin, uint64_t end, unsigned worker,
                             ebpo_error *error)
{
    surface_builder *b = context;
    ebpo_status status = EBPO_OK;
    (void)worker;
    for (uint64_t i = begin; i < end && status == EBPO_OK; i++)
        status = make_below(b, b->task[i], error);
    return status;
}

/* Lists the highest nodes with at most TASK_FACES faces. Returns false when out of memory. */
static bool list_tasks(surface_builder *b)
{
    b->task = ebpo_alloc(b->count, sizeof *b->task);
    for (uint64_t i = 0; i < b->count && b->task;) {
        bool small = b->node[i].end - b->node[i].first <= TASK_FACES;
        if (small)
            b->task[b->task_count++] = i;
        i = small ? b->node[i].after : i + 1;
    }
    return b->task != NULL;
}

/* --- the part --- */

static int by_octcode(const void *a, const void *b)
{
    ebpo_octcode x = ebpo_octcode_of_cell((*(patch_node *const *)a)->cell),
                 y = ebpo_octcode_of_cell((*(patch_node *const *)b)->cell);
    return (x > y) - (x < y);
}

/* Appends a patch to the arrays of `to`. `step`: unit of errors in the file, in scaled coordinates.
 */
static void copy_patch(ebpo_surface *to, const patch_node *node, double step)
{
    uint64_t *row = to->patch + EBPO_PATCH_COLUMNS * to->patch_count++, v = to->vertex_count;
    row[EBPO_PATCH_OCTCODE] = ebpo_octcode_of_cell(node->cell);
    row[EBPO_PATCH_FIRST_FACE] = node->first;
    row[EBPO_PATCH_FACES] = node->end - node->first;
    row[EBPO_PATCH_TRIANGLES] = node->triangles;
    row[EBPO_PATCH_VERTICES] = node->vertices;
    row[EBPO_PATCH_CODE_BYTES] = node->rows.code_bytes;
    row[EBPO_PATCH_ERROR] = (uint64_t)ceil(node->error / step);
    memcpy(to->code + to->code_bytes, node->rows.code, node->rows.code_bytes);
    memcpy(to->point + 3 * v, node->rows.point, node->vertices * 3 * sizeof *to->point);
    memcpy(to->normal + 2 * v, node->rows.normal, node->vertices * 2);
    if (to->colour)
        memcpy(to->colour + 3 * v, node->rows.colour, node->vertices * 3);
    to->code_bytes += node->rows.code_bytes;
    to->triangle_count += node->triangles;
    to->vertex_count += node->vertices;
}

/* Decides if the file stores the patches of node i and of the nodes below. Clears `stored` of node
 * i if `wanted` is false or if the error is too large for the file. The patches of its children are
 * stored only if node i is stored and all children have patches that can be stored. */
static void select_patches(const surface_builder *b, uint64_t i, double step, bool wanted)
{
    bool all = wanted;
    patch_node *node = &b->node[i];
    node->stored = wanted && node->stored && node->error / step < 0x1p34;
    for (uint64_t k = i + 1; k < node->after; k = b->node[k].after)
        all = all && b->node[k].stored && b->node[k].error / step < 0x1p34;
    for (uint64_t k = i + 1; k < node->after; k = b->node[k].after)
        select_patches(b, k, step, all && node->stored);
}

/* Makes the arrays of the part from the stored patches, in the order of octcodes. */
static ebpo_status collect_patches(const surface_builder *b, ebpo_surface *out, ebpo_error *error)
{
    uint64_t vertices = 0, bytes = 0, count = 0;
    patch_node **order = ebpo_alloc(b->count, sizeof *order);
    double step = ldexp(ebpo_patch_error_step(&b->tree->info), -b->exponent);
    select_patches(b, 0, step, true);
    for (uint64_t i = 0; i < b->count && order; i++) {
        if (!b->node[i].stored)
            continue;
        order[count++] = &b->node[i];
        vertices += b->node[i].vertices;
        bytes += b->node[i].rows.code_bytes;
    }
    memset(out, 0, sizeof *out);
    out->patch = ebpo_alloc(count, EBPO_PATCH_COLUMNS * sizeof *out->patch);
    out->code = ebpo_alloc(bytes, 1);
    out->point = ebpo_alloc(vertices, 3 * sizeof *out->point);
    out->normal = ebpo_alloc(vertices, 2);
    out->colour = b->coloured ? ebpo_alloc(vertices, 3) : NULL;
    bool made = order && out->patch && out->code && out->point && out->normal &&
                (out->colour || !b->coloured);
    if (made)
        qsort(order, count, sizeof *order, by_octcode);
    for (uint64_t i = 0; i < count && made; i++)
        copy_patch(out, order[i], step);
    out->colour_count = out->colour ? out->vertex_count : 0;
    free(order);
    made = made && ebpo_surface_add_up(out);
    if (made)
        return EBPO_OK;
    ebpo_surface_free(out);
    return ebpo_fail_memory(error, bytes + 8 * vertices);
}

static void free_builder(surface_builder *b)
{
    for (uint64_t i = 0; i < b->count; i++) {
        ebpo_patch_mesh_free(&b->node[i].mesh);
        ebpo_patch_rows_free(&b->node[i].rows);
    }
    for (int level = 0; level < LEVELS; level++) {
        free(b->interval[level]);
        free(b->table[level].slot);
    }
    free(b->node);
    free(b->task);
    ebpo_array_free(b->tree->workspace, b->lowest);
    ebpo_array_free(b->tree->workspace, b->highest);
}

ebpo_status ebpo_build_surface(ebpo_tree *tree, unsigned threads, const ebpo_progress *progress,
                               ebpo_error *error)
{
    surface_builder b = { .tree = tree, .box = ebpo_root_box(&tree->info) };
    const ebpo_attributes *attributes = tree->mesh.attributes;
    ebpo_status status = EBPO_OK;
    frexp(ebpo_patch_error_step(&tree->info), &b.exponent);
    /* the longest side of the box is 2^32 steps of the error, so its scaled length is 1 to 2 */
    b.exponent += 31;
    for (int k = 0; k < 3; k++)
        b.size[k] = ldexp(b.box.size[k], -b.exponent);
    b.threads = ebpo_thread_count(threads);
    b.coloured = ebpo_attributes_coloured(attributes);
    if (b.coloured)
        b.by_face = !ebpo_colour_columns(attributes, "vertex", b.colour) &&
                    ebpo_colour_columns(attributes, "face", b.colour);
    if (tree->info.level_count > 1 && tree->info.face_count >= LEAST_FACES) {
        b.group[0] = 1;
        list_nodes(&b, (ebpo_cell){ 0, { 0, 0, 0 } }, 0);
    }
    bool made = !b.short_of_memory;
    if (made && b.count)
        made = list_intervals(&b) && find_uses(&b) && add_borders(&b) && list_tasks(&b);
    if (!made)
        status = ebpo_workspace_fail(tree->workspace, tree->info.vertex_count * 8, error);
    if (status == EBPO_OK && b.count)
        status = ebpo_parallel_for(b.threads, tree->workspace, b.task_count, 1, run_tasks, &b,
                                   progress, "surface", error);
    if (status == EBPO_OK && b.count && !b.node[0].made)
        status = make_below(&b, 0, error);
    if (status == EBPO_OK && b.count) {
        ebpo_surface_free(&tree->surface);
        status = collect_patches(&b, &tree->surface, error);
    }
    free_builder(&b);
    if (status == EBPO_OK && tree->surface.patch_count) {
        ebpo_surface_summarise(&tree->surface, &tree->info);
        tree->info.parts |= EBPO_PART_SURFACE;
    }
    return status;
}

/* --- files --- */

/* Adds the surface to a tree that has the mesh and no pruned nodes, unless the tree already has its
 * surface. */
static ebpo_status add_surface(ebpo_tree *tree, const ebpo_write_options *options,
                               ebpo_error *error)
{
    const ebpo_info *info = &tree->info;
    bool possible = !info->pruned && info->parts & EBPO_PART_MESH;
    return possible && !(info->parts & EBPO_PART_SURFACE)
               ? ebpo_build_surface(tree, options->threads, &options->progress, error)
               : EBPO_OK;
}

ebpo_status ebpo_file_add_surface(const ebpo_file *file, const char *path,
                                  const ebpo_read_options *read, const ebpo_write_options *write,
                                  ebpo_error *error)
{
    EBPO_DEFAULT_FP;
    return ebpo_repack_with(file, path, read, write, add_surface, error);
}
