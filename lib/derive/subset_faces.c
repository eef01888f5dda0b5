/* Copies the faces, vertices, maps and attributes of a subset, with new indices. As the
 * specification requires, the new indices are given in a depth-first walk through the remaining
 * leaves. The arrays that map old indices to new indices have an entry for each face or vertex of
 * the original file. For a small subset, these arrays still take little memory. Pages that are
 * never written take no memory, and few pages are written, because faces that are close in space
 * have close indices. Source: format-spec/README.md, section 7. */
#include "core/strict_fp.h"

#include <stdlib.h>
#include <string.h>

#include "mesh/attributes.h"
#include "core/alloc.h"
#include "core/error.h"
#include "format/read_attributes.h"
#include "geometry/level_nodes.h"
#include "derive/subset_parts.h"

typedef struct numbering {
    ebpo_cutting *c;
    uint32_t *new_plus_one; /* [faces of the original file] new index + 1; 0: none yet */
    uint32_t *old_index;    /* [count] old index of each new face */
    uint64_t count, capacity;
    /* for each level: index of the next group, and of the next leaf */
    uint64_t group[EBPO_LEVELS_MAX], leaf[EBPO_LEVELS_MAX];
    /* for each level: number of references read so far, and written so far */
    uint64_t read[EBPO_LEVELS_MAX], written[EBPO_LEVELS_MAX];
    bool no_memory; /* true: an allocation failed */
} numbering;

/* Gives a face the next new index; returns false when out of memory. */
static bool add_new(numbering *n, uint32_t face)
{
    n->no_memory = !ebpo_grow(&n->old_index, &n->capacity, n->count + 1, sizeof *n->old_index);
    if (n->no_memory)
        return false;
    n->old_index[n->count++] = face;
    n->new_plus_one[face] = (uint32_t)n->count;
    return true;
}

static int compare_indices(const void *a, const void *b)
{
    uint32_t x = *(const uint32_t *)a, y = *(const uint32_t *)b;
    return (x > y) - (x < y);
}

/* Gives the faces of a leaf new indices. In a file, the *new* faces of a leaf are the faces that no
 * earlier leaf lists; the other listed faces are its *references*. If the subset contains none of
 * the earlier leaves that list a reference, the reference becomes a new face of this leaf. These
 * former references get the first new indices of the leaf. The faces that were new faces of the
 * leaf in the original file get the next indices. Both sets keep the order of their old indices.
 * All other references stay references; their new indices are written over the old indices. */
static ebpo_status number_leaf(numbering *n, int level)
{
    ebpo_level *l = &n->c->out->level[level];
    uint64_t i = n->leaf[level]++, begin = n->count, kept = 0;
    uint32_t *refs = l->leaf_refs + n->read[level], *to = l->leaf_refs + n->written[level];
    /* is_sorted: the new indices of the references that stay references ascend */
    bool is_sorted = true, valid = true;
    for (uint64_t k = 0; k < l->leaf_ref_count[i] && valid; k++) {
        uint32_t face = refs[k];
        if (n->new_plus_one[face] && n->new_plus_one[face] <= begin) {
            to[kept++] = n->new_plus_one[face] - 1;
            is_sorted = is_sorted && (kept == 1 || to[kept - 2] < to[kept - 1]);
        } else {
            valid = n->new_plus_one[face] == 0 && add_new(n, face);
        }
    }
    for (uint64_t k = 0; k < l->leaf_new[i] && valid; k++)
        valid = n->new_plus_one[l->leaf_first[i] + k] == 0 &&
                add_new(n, (uint32_t)(l->leaf_first[i] + k));
    if (n->no_memory)
        return ebpo_fail_memory(n->c->error, n->count * sizeof *n->old_index);
    if (!valid)
        return ebpo_fail(n->c->error, EBPO_E_FORMAT,
                         "level %d: a leaf lists a face twice, or lists a face as new that an "
                         "earlier leaf lists; run ebpo verify",
                         level);
    if (!is_sorted)
        qsort(to, kept, sizeof *to, compare_indices);
    n->read[level] += l->leaf_ref_count[i];
    n->written[level] += kept;
    l->leaf_first[i] = begin;
    l->leaf_new[i] = (uint32_t)(n->count - begin);
    l->leaf_ref_count[i] = (uint32_t)kept;
    return EBPO_OK;
}

/* Gives new indices to the faces of all leaves at or below the next group of this level. */
static ebpo_status number_group(numbering *n, int level)
{
    const ebpo_tree *tree = n->c->out;
    uint16_t types = tree->level[level].types[n->group[level]++];
    ebpo_status status = EBPO_OK;
    for (unsigned octant = 0; octant < ebpo_group_octants(level) && status == EBPO_OK; octant++) {
        ebpo_node_type type = ebpo_group_type(types, octant);
        if (type == EBPO_GRAY && level + 1 < tree->info.level_count)
            status = number_group(n, level + 1);
        else if (type == EBPO_LEAF)
            status = number_leaf(n, level);
    }
    return status;
}

/* --- vertices --- */

typedef struct vertices {
    uint32_t *new_plus_one, *old_index; /* as in `numbering`, but for vertices */
    uint64_t count, capacity;
} vertices;

/* Gives the vertices new indices, in the order of their first use by a face, and sets the vertices
 * of the faces to these indices. */
static ebpo_status number_vertices(ebpo_cutting *c, vertices *v)
{
    ebpo_mesh *mesh = &c->out->mesh;
    v->new_plus_one = ebpo_alloc_zero(c->from->vertex_count, sizeof *v->new_plus_one);
    bool valid = v->new_plus_one;
    for (uint64_t i = 0; i < 3 * mesh->face_count && valid; i++) {
        uint32_t vertex = mesh->faces[i];
        if (v->new_plus_one[vertex] == 0) {
            valid = ebpo_grow(&v->old_index, &v->capacity, v->count + 1, sizeof *v->old_index);
            if (valid)
                v->old_index[v->count++] = vertex;
            v->new_plus_one[vertex] = (uint32_t)v->count;
        }
        mesh->faces[i] = v->new_plus_one[vertex] - 1;
    }
    for (uint64_t i = 0; i < c->from->vertex_count && valid && !c->out->info.pruned;
         i++) /* if nothing was pruned, vertices that no face uses are kept */
        if (v->new_plus_one[i] == 0) {
            valid = ebpo_grow(&v->old_index, &v->capacity, v->count + 1, sizeof *v->old_index);
            if (valid)
                v->old_index[v->count++] = (uint32_t)i;
        }
    return valid ? EBPO_OK
                 : ebpo_fail_memory(c->error, c->from->vertex_count * sizeof *v->new_plus_one);
}

/* Begins the attributes of the subset. If nothing was pruned, reads all attributes. Otherwise reads
 * the textures; copy_attributes adds the attributes of the remaining vertices and faces.
 * Attributes of other elements are omitted, because their values may refer to removed elements. */
static ebpo_status begin_attributes(ebpo_cutting *c)
{
    ebpo_read_options read = ebpo_read_threads(c->options->threads);
    ebpo_attributes **to = &c->out->mesh.attributes;
    if (!c->out->info.pruned)
        return ebpo_attributes_read(c->file, &read, to, c->error);
    ebpo_status status = ebpo_attributes_read_head(c->file, &read, to, c->error);
    return status == EBPO_OK ? ebpo_attributes_read_textures(c->file, &read, *to, c->error)
                             : status;
}

/* If nodes were pruned, copies these rows of the attributes of an element ("vertex" or "face"). */
static ebpo_status copy_attributes(ebpo_cutting *c, const char *element, const uint32_t *rows,
                                   uint64_t count)
{
    ebpo_attributes *to = c->out->mesh.attributes;
    return to && c->out->info.pruned ? ebpo_pick_attributes(c->chunks, to, element, rows, count,
                                                            c->options->threads, c->error)
                                     : EBPO_OK;
}

static ebpo_status copy_vertices(ebpo_cutting *c)
{
    ebpo_tree *out = c->out;
    vertices v = { NULL, NULL, 0, 0 };
    ebpo_status status = number_vertices(c, &v);
    free(v.new_plus_one);
    if (status == EBPO_OK) {
        size_t size = c->from->double_coordinates ? 3 * sizeof(double) : 3 * sizeof(float);
        void *xyz = ebpo_alloc(v.count, size);
        ebpo_vertices_hint(c->chunks, v.old_index, v.count, c->parts);
        out->info.vertex_count = out->mesh.vertex_count = v.count;
        out->mesh.xyz32 = c->from->double_coordinates ? NULL : xyz;
        out->mesh.xyz64 = c->from->double_coordinates ? xyz : NULL;
        status = xyz ? ebpo_pick_rows(c->chunks, EBPO_A_VERTICES, v.old_index, v.count,
                                      c->options->threads, xyz, c->error)
                     : ebpo_fail_memory(c->error, v.count * size);
    }
    if (status == EBPO_OK && c->parts & EBPO_PART_MAPS) {
        out->vertex_source = ebpo_alloc(v.count, sizeof *out->vertex_source);
        status = out->vertex_source
                     ? ebpo_pick_rows(c->chunks, EBPO_A_VERTEX_SOURCE, v.old_index, v.count,
                                      c->options->threads, out->vertex_source, c->error)
                     : ebpo_fail_memory(c->error, v.count * sizeof *out->vertex_source);
    }
    if (status == EBPO_OK)
        status = copy_attributes(c, "vertex", v.old_index, v.count);
    free(v.old_index);
    return status;
}

static ebpo_status copy_faces(ebpo_cutting *c, const numbering *n)
{
    ebpo_tree *out = c->out;
    out->info.face_count = out->mesh.face_count = n->count;
    ebpo_hints hints = EBPO_HINTS_INIT(c->chunks->file);
    ebpo_faces_hint(c->chunks, &hints, n->old_index, n->count, c->parts);
    ebpo_hint_all(&hints);
    out->mesh.faces = ebpo_alloc(n->count, 3 * sizeof *out->mesh.faces);
    ebpo_status status = out->mesh.faces
                             ? ebpo_pick_rows(c->chunks, EBPO_A_FACES, n->old_index, n->count,
                                              c->options->threads, out->mesh.faces, c->error)
                             : ebpo_fail_memory(c->error, n->count * 3 * sizeof *out->mesh.faces);
    if (status == EBPO_OK && c->parts & EBPO_PART_MAPS) {
        out->face_source = ebpo_alloc(n->count, sizeof *out->face_source);
        status = out->face_source
                     ? ebpo_pick_rows(c->chunks, EBPO_A_FACE_SOURCE, n->old_index, n->count,
                                      c->options->threads, out->face_source, c->error)
                     : ebpo_fail_memory(c->error, n->count * sizeof *out->face_source);
    }
    if (status == EBPO_OK && c->parts & EBPO_PART_ATTRIBUTES)
        status = begin_attributes(c);
    if (status == EBPO_OK)
        status = copy_attributes(c, "face", n->old_index, n->count);
    return status == EBPO_OK ? copy_vertices(c) : status;
}

/* Removes the mesh with its maps and attributes, because no leaf of the subset lists a face. */
static void drop_lists(ebpo_cutting *c)
{
    c->parts &= ~(uint32_t)(EBPO_PART_MESH | EBPO_PART_MAPS | EBPO_PART_ATTRIBUTES);
    for (int i = 0; i < c->out->info.level_count; i++) {
        ebpo_level *l = &c->out->level[i];
        ebpo_level_drop(l, EBPO_NEEDS_MESH);
        l->new_count = l->ref_count = 0;
    }
}

ebpo_status ebpo_cut_faces(ebpo_cutting *c)
{
    numbering n = { .c = c };
    n.new_plus_one = ebpo_alloc_zero(c->from->face_count, sizeof *n.new_plus_one);
    ebpo_status status =
        n.new_plus_one ? number_group(&n, 0)
                       : ebpo_fail_memory(c->error, c->from->face_count * sizeof *n.new_plus_one);
    free(n.new_plus_one);
    for (int i = 0; i < c->out->info.level_count && status == EBPO_OK; i++) {
        ebpo_level *l = &c->out->level[i];
        l->ref_count = n.written[i];
        l->new_count = 0;
        for (uint64_t k = 0; k < l->leaf_count; k++)
            l->new_count += l->leaf_new[k];
    }
    if (status == EBPO_OK && n.count)
        status = copy_faces(c, &n);
    else if (status == EBPO_OK)
        drop_lists(c);
    if (c->out->info.pruned)
        ebpo_attributes_drop_others(c->out->mesh.attributes);
    free(n.old_index);
    return status;
}
