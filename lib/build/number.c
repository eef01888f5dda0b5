/* Final numbers: faces by the first leaf, depth first, that they touch; vertices by first use. */
#include "geom/strict_fp.h"

#include <stdlib.h>
#include <string.h>

#include "base/alloc.h"
#include "base/error.h"
#include "build/builder.h"

static void number_leaf(ebpo_builder *b, ebpo_branch *s, ebpo_build_detail *d, uint32_t *next)
{
    d->first = *next;
    for (uint64_t i = d->entry_begin; i < d->entry_end; i++) {
        uint32_t f = s->entries[i];
        if (b->number[f] == EBPO_NO_NUMBER)
            b->number[f] = (*next)++;
    }
    d->new_count = *next - d->first;
}

static void number_subtree(ebpo_builder *b, ebpo_branch *s, uint32_t index, uint32_t *next)
{
    const ebpo_build_node *node = &s->nodes[index];
    if (node->type == EBPO_LEAF)
        number_leaf(b, s, &s->details[node->detail], next);
    else if (node->type == EBPO_GRAY)
        for (uint32_t o = 0; o < 8; o++)
            number_subtree(b, s, node->child + o, next);
}

ebpo_status ebpo_build_number(ebpo_builder *b, ebpo_error *error)
{
    b->number = ebpo_alloc(b->face_count, sizeof *b->number);
    if (!b->number)
        return ebpo_fail_memory(error, b->face_count * sizeof *b->number);
    memset(b->number, 0xff, (size_t)b->face_count * sizeof *b->number);
    uint32_t next = 0;
    for (uint64_t i = 0; i < b->sub_count; i++)
        number_subtree(b, &b->sub[i], 0, &next);
    if (next != b->face_count)
        return ebpo_fail(error, EBPO_E_ARGUMENT, "internal: %u of %llu faces are in no leaf", (unsigned)(b->face_count - next),
                         (unsigned long long)b->face_count);
    return EBPO_OK;
}

/* order[i]: mesh vertex that gets final number i. */
static void order_vertices(const ebpo_builder *b, const ebpo_mesh *mesh, const uint32_t *face_at, uint32_t *order,
                           uint32_t *final)
{
    memset(final, 0xff, (size_t)mesh->vertex_count * sizeof *final);
    uint32_t next = 0;
    for (uint64_t i = 0; i < mesh->face_count; i++) {
        const uint32_t *f = mesh->faces + 3 * (uint64_t)b->face_source[face_at[i]];
        for (int k = 0; k < 3; k++)
            if (final[f[k]] == EBPO_NO_NUMBER) {
                order[next] = f[k];
                final[f[k]] = next++;
            }
    }
    for (uint64_t v = 0; v < mesh->vertex_count; v++)
        if (final[v] == EBPO_NO_NUMBER) {
            order[next] = (uint32_t)v;
            final[v] = next++;
        }
}

static void move_vertices(const ebpo_mesh *mesh, const uint32_t *order, ebpo_mesh *out)
{
    for (uint64_t i = 0; i < mesh->vertex_count; i++) {
        uint64_t from = 3 * (uint64_t)order[i];
        if (mesh->xyz64)
            memcpy(out->xyz64 + 3 * i, mesh->xyz64 + from, 3 * sizeof(double));
        else
            memcpy(out->xyz32 + 3 * i, mesh->xyz32 + from, 3 * sizeof(float));
    }
}

ebpo_status ebpo_build_mesh(ebpo_builder *b, ebpo_mesh *mesh, ebpo_tree *out, ebpo_error *error)
{
    uint64_t nv = mesh->vertex_count, nf = mesh->face_count;
    uint32_t *face_at = ebpo_alloc(nf, sizeof *face_at), *final = ebpo_alloc(nv, sizeof *final);
    ebpo_mesh *m = &out->mesh;
    *m = *mesh;
    m->xyz32 = mesh->xyz64 ? NULL : ebpo_alloc(nv, 3 * sizeof(float));
    m->xyz64 = mesh->xyz64 ? ebpo_alloc(nv, 3 * sizeof(double)) : NULL;
    m->faces = ebpo_alloc(nf, 3 * sizeof(uint32_t));
    out->vertex_source = ebpo_alloc(nv, sizeof(uint32_t));
    out->face_source = ebpo_alloc(nf, sizeof(uint32_t));
    ebpo_status status = EBPO_OK;
    if (!face_at || !final || (!m->xyz32 && !m->xyz64) || !m->faces || !out->vertex_source || !out->face_source) {
        status = ebpo_fail_memory(error, nv * 16 + nf * 16);
        goto done;
    }
    for (uint64_t f = 0; f < nf; f++)
        face_at[b->number[f]] = (uint32_t)f;
    order_vertices(b, mesh, face_at, out->vertex_source, final);
    move_vertices(mesh, out->vertex_source, m);
    for (uint64_t i = 0; i < nf; i++) {
        uint32_t source = b->face_source[face_at[i]];
        out->face_source[i] = source;
        for (uint64_t k = 0; k < 3; k++)
            m->faces[3 * i + k] = final[mesh->faces[3 * (uint64_t)source + k]];
    }
done:
    free(face_at);
    free(final);
    return status;
}
