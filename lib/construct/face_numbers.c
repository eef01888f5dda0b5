/* Assigns final indices to faces and vertices, and sorts the mesh by these indices.
 *
 * Leaves are visited depth first. A face gets the next index in the first leaf that lists it, and a
 * vertex gets the next index in the first face that uses it. So the new faces of a leaf (no earlier
 * leaf lists them) are one range in the file, and only the leaf's other faces need references. A
 * piece (a subtree that one thread builds) assigns indices to its *fresh* faces, which no earlier
 * piece lists. The first index of each piece is known in advance, so the pieces can be processed in
 * any order. Attributes move with their vertices and faces. format-spec/README.md describes the
 * order. */
#include "core/strict_fp.h"

#include "construct/construct_stages.h"

#include <stdlib.h>
#include <string.h>

#include "mesh/attributes.h"
#include "core/alloc.h"
#include "core/error.h"
#include "core/parallel.h"

/* Assigns final indices to the new faces of a leaf. *next: the next index. */
static void number_leaf(ebpo_builder *b, const ebpo_branch *s, ebpo_build_detail *d, uint32_t *next)
{
    d->first = *next;
    for (uint64_t i = d->entry_begin; i < d->entry_end; i++) {
        uint32_t entry = s->entries[i], f = s->list[entry];
        if (s->fresh[entry / 8] >> entry % 8 & 1 && b->final_index[f] == EBPO_NO_INDEX)
            b->final_index[f] = (*next)++;
    }
    d->new_count = *next - d->first;
}

/* Assigns final indices to the new faces of all leaves of a subtree. */
static void number_node(ebpo_builder *b, ebpo_branch *s, uint32_t index, uint32_t *next)
{
    const ebpo_build_node *node = &s->nodes[index];
    if (index % EBPO_ITEMS_SCATTERED == 0)
        ebpo_release_pages(b->workspace);
    if (node->type == EBPO_LEAF)
        number_leaf(b, s, &s->details[node->detail], next);
    else if (node->type == EBPO_GRAY)
        for (uint32_t o = 0; o < 8; o++)
            number_node(b, s, node->child + o, next);
}

ebpo_status ebpo_build_number(ebpo_builder *b, ebpo_branch *s, ebpo_error *error)
{
    uint32_t next = (uint32_t)s->first;
    number_node(b, s, 0, &next);
    uint64_t numbered = next - s->first;
    if (numbered != s->fresh_count)
        return ebpo_fail(error, EBPO_E_ARGUMENT,
                         "internal: %llu faces of a piece of the tree are in none of its leaves",
                         (unsigned long long)(s->fresh_count - numbered));
    return EBPO_OK;
}

/* Sets order[i] to the vertex that gets the final index i, and final[v] to the final index of
 * vertex v. face_at[i]: the face that has the final index i. Vertices and faces are indices in
 * `mesh`, which is sorted along the Morton curve (arrange.h). */
static void order_vertices(const ebpo_builder *b, const ebpo_mesh *mesh, const uint32_t *face_at,
                           uint32_t *order, uint32_t *final)
{
    ebpo_array_fill(b->workspace, final, 0xff, mesh->vertex_count * sizeof *final);
    uint32_t next = 0;
    EBPO_FOR_ITEMS_SCATTERED(b->workspace, i, 0, mesh->face_count) {
        const uint32_t *f = mesh->faces + 3 * (uint64_t)face_at[i];
        for (int k = 0; k < 3; k++)
            if (final[f[k]] == EBPO_NO_INDEX) {
                order[next] = f[k];
                final[f[k]] = next++;
            }
    }
    EBPO_FOR_ITEMS_SCATTERED(b->workspace, v, 0, mesh->vertex_count) {
        if (final[v] == EBPO_NO_INDEX) {
            order[next] = (uint32_t)v;
            final[v] = next++;
        }
    }
}

/* Input and output of the parallel tasks that move the mesh's data into the final order. */
typedef struct moving {
    const ebpo_builder *b;
    const ebpo_mesh *mesh; /* sorted along the Morton curve */
    const uint32_t *final; /* [vertex] final index */
    uint32_t *face_at;     /* [final index] face of `mesh` */
    /* result. Before move_vertices runs, out->vertex_source contains indices of vertices of `mesh`;
     * move_vertices replaces them by source indices. */
    ebpo_tree *out;
} moving;

enum { MOVE_GRAIN = 1 << 14 }; /* number of vertices or faces of a task */

/* Sets face_at, the inverse of final_index, for a range of faces. */
static ebpo_status invert_final_indices(void *context, uint64_t begin, uint64_t end,
                                        unsigned worker, ebpo_error *error)
{
    moving *m = context;
    (void)worker, (void)error;
    EBPO_FOR_ITEMS_SCATTERED(m->b->workspace, f, begin, end)
        m->face_at[m->b->final_index[f]] = (uint32_t)f;
    return EBPO_OK;
}

static ebpo_status move_vertices(void *context, uint64_t begin, uint64_t end, unsigned worker,
                                 ebpo_error *error)
{
    moving *m = context;
    const ebpo_mesh *mesh = m->mesh;
    ebpo_tree *out = m->out;
    (void)worker, (void)error;
    EBPO_FOR_ITEMS_SCATTERED(m->b->workspace, i, begin, end) {
        uint64_t v = out->vertex_source[i];
        if (mesh->xyz64)
            memcpy(out->mesh.xyz64 + 3 * i, mesh->xyz64 + 3 * v, 3 * sizeof(double));
        else
            memcpy(out->mesh.xyz32 + 3 * i, mesh->xyz32 + 3 * v, 3 * sizeof(float));
        out->vertex_source[i] = mesh->arrangement->vertex_source[v];
    }
    return EBPO_OK;
}

static ebpo_status move_faces(void *context, uint64_t begin, uint64_t end, unsigned worker,
                              ebpo_error *error)
{
    moving *m = context;
    (void)worker, (void)error;
    EBPO_FOR_ITEMS_SCATTERED(m->b->workspace, i, begin, end) {
        uint64_t f = m->face_at[i];
        m->out->face_source[i] = m->mesh->arrangement->face_source[f];
        for (uint64_t k = 0; k < 3; k++)
            m->out->mesh.faces[3 * i + k] = m->final[m->mesh->faces[3 * f + k]];
    }
    return EBPO_OK;
}

/* Moves faces and vertices into the final order. `final`: space for moving.final. */
static ebpo_status move_all(moving *m, uint32_t *final, ebpo_error *error)
{
    const ebpo_builder *b = m->b;
    static const char stage[] = "numbering vertices";
    uint64_t faces = m->mesh->face_count, vertices = m->mesh->vertex_count,
             all = 3 * faces + vertices;
    ebpo_pass invert_pass = { &b->options->progress, 0, faces, all },
              vertex_pass = { invert_pass.to, 2 * faces, 2 * faces + vertices, all },
              face_pass = { invert_pass.to, 2 * faces + vertices, all, all };
    ebpo_progress progress = ebpo_pass_progress(&invert_pass);
    ebpo_status status = ebpo_parallel_for(b->threads, NULL, faces, MOVE_GRAIN,
                                           invert_final_indices, m, &progress, stage, error);
    if (status != EBPO_OK)
        return status;
    order_vertices(b, m->mesh, m->face_at, m->out->vertex_source, final);
    m->final = final;
    progress = ebpo_pass_progress(&vertex_pass);
    status = ebpo_parallel_for(b->threads, NULL, vertices, MOVE_GRAIN, move_vertices, m, &progress,
                               stage, error);
    progress = ebpo_pass_progress(&face_pass);
    return status == EBPO_OK ? ebpo_parallel_for(b->threads, NULL, faces, MOVE_GRAIN, move_faces, m,
                                                 &progress, stage, error)
                             : status;
}

ebpo_status ebpo_build_mesh(ebpo_builder *b, ebpo_mesh *mesh, ebpo_tree *out, ebpo_error *error)
{
    uint64_t nv = mesh->vertex_count, nf = mesh->face_count;
    uint32_t *face_at = ebpo_array_alloc(b->workspace, nf, sizeof *face_at),
             *final = ebpo_array_alloc(b->workspace, nv, sizeof *final);
    ebpo_mesh *m = &out->mesh;
    *m = *mesh;
    m->arrangement = NULL;
    mesh->attributes = NULL; /* owned by the tree */
    m->xyz32 = mesh->xyz64 ? NULL : ebpo_array_alloc(b->workspace, nv, 3 * sizeof(float));
    m->xyz64 = mesh->xyz64 ? ebpo_array_alloc(b->workspace, nv, 3 * sizeof(double)) : NULL;
    m->faces = ebpo_array_alloc(b->workspace, nf, 3 * sizeof(uint32_t));
    out->vertex_source = ebpo_array_alloc(b->workspace, nv, sizeof(uint32_t));
    out->face_source = ebpo_array_alloc(b->workspace, nf, sizeof(uint32_t));
    moving job = { .b = b, .mesh = mesh, .face_at = face_at, .out = out };
    ebpo_status status;
    if (!face_at || !final || (!m->xyz32 && !m->xyz64) || !m->faces || !out->vertex_source ||
        !out->face_source)
        status = ebpo_workspace_fail(b->workspace, nv * 16 + nf * 16, error);
    else
        status = move_all(&job, final, error);
    if (status == EBPO_OK)
        status = ebpo_attributes_pick(m->attributes, "vertex", out->vertex_source, nv, error);
    if (status == EBPO_OK)
        status = ebpo_attributes_pick(m->attributes, "face", out->face_source, nf, error);
    ebpo_array_free(b->workspace, face_at);
    ebpo_array_free(b->workspace, final);
    return status;
}
