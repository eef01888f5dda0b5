#include "core/strict_fp.h"

#include "query/query_model.h"

#include <stdlib.h>
#include <string.h>

#include "core/alloc.h"
#include "core/hash.h"

/* Most have 1 to 3 KB. */
enum { SLOTS = 256 };

/* Behind it what is in use of the arrays, in the order of ebpo_polytope. */
typedef struct kept {
    ebpo_cell cell;
    int vertices, faces, corners;
    double vertex[][3];
} kept;

struct ebpo_kept_envelopes {
    kept *slot[SLOTS];
};

static unsigned slot_of(ebpo_cell cell)
{
    uint64_t key[3] = { (uint64_t)cell.level << 32 | cell.at[0], cell.at[1], cell.at[2] };
    return (unsigned)(ebpo_hash_three(key) % SLOTS);
}

static bool same_cell(ebpo_cell a, ebpo_cell b)
{
    return a.level == b.level && a.at[0] == b.at[0] && a.at[1] == b.at[1] && a.at[2] == b.at[2];
}

bool ebpo_kept_envelopes_get(const ebpo_kept_envelopes *k, ebpo_cell cell, ebpo_polytope *out)
{
    const kept *from = k ? k->slot[slot_of(cell)] : NULL;
    if (!from || !same_cell(from->cell, cell))
        return false;
    const int32_t *tag = (const void *)(from->vertex + from->vertices);
    const uint16_t *first = (const void *)(tag + from->faces);
    out->vertex_count = from->vertices;
    out->face_count = from->faces;
    out->corner_count = from->corners;
    memcpy(out->vertex, from->vertex, (size_t)from->vertices * sizeof out->vertex[0]);
    memcpy(out->tag, tag, (size_t)from->faces * sizeof *tag);
    memcpy(out->first, first, (size_t)(from->faces + 1) * sizeof *first);
    memcpy(out->corner, first + from->faces + 1, (size_t)from->corners * sizeof *first);
    return true;
}

static kept *copy_of(ebpo_cell cell, const ebpo_polytope *p)
{
    size_t vertices = (size_t)p->vertex_count, faces = (size_t)p->face_count,
           corners = (size_t)p->corner_count;
    kept *to =
        ebpo_alloc(1, sizeof *to + vertices * sizeof to->vertex[0] + faces * sizeof p->tag[0] +
                          (faces + 1 + corners) * sizeof p->first[0]);
    if (!to)
        return NULL;
    to->cell = cell;
    to->vertices = p->vertex_count;
    to->faces = p->face_count;
    to->corners = p->corner_count;
    int32_t *tag = (void *)(to->vertex + vertices);
    uint16_t *first = (void *)(tag + faces);
    memcpy(to->vertex, p->vertex, vertices * sizeof to->vertex[0]);
    memcpy(tag, p->tag, faces * sizeof *tag);
    memcpy(first, p->first, (faces + 1) * sizeof *first);
    memcpy(first + faces + 1, p->corner, corners * sizeof *first);
    return to;
}

void ebpo_kept_envelopes_put(ebpo_kept_envelopes **k, ebpo_cell cell, const ebpo_polytope *envelope)
{
    if (!*k)
        *k = ebpo_alloc_zero(1, sizeof **k);
    kept *made = *k ? copy_of(cell, envelope) : NULL;
    if (!made)
        return;
    kept **slot = &(*k)->slot[slot_of(cell)];
    free(*slot);
    *slot = made;
}

void ebpo_kept_envelopes_free(ebpo_kept_envelopes *k)
{
    for (int i = 0; k && i < SLOTS; i++)
        free(k->slot[i]);
    free(k);
}
