#include "mesh/same_faces.h"

#include <stdlib.h>

#include "core/workspace.h"

enum { INSERTION_LIMIT = 48 };

static int compare(const void *a, const void *b)
{
    const ebpo_same_face *x = a, *y = b;
    if (x->corners != y->corners)
        return x->corners < y->corners ? -1 : 1;
    return x->source < y->source ? -1 : x->source > y->source;
}

static void sort(ebpo_same_face *item, uint64_t count)
{
    if (count > INSERTION_LIMIT) {
        qsort(item, count, sizeof *item, compare);
        return;
    }
    for (uint64_t i = 1; i < count; i++) {
        ebpo_same_face x = item[i];
        uint64_t j = i;
        for (; j > 0 && compare(&item[j - 1], &x) > 0; j--)
            item[j] = item[j - 1];
        item[j] = x;
    }
}

bool ebpo_same_faces_gather(ebpo_same_faces *out, const ebpo_stars *stars, const ebpo_mesh *mesh,
                            uint32_t v)
{
    uint64_t begin = stars->first[v], end = stars->first[v + (uint64_t)1];
    out->workspace = mesh->workspace;
    out->count = 0;
    if (!ebpo_array_grow_late(mesh->workspace, &out->item, &out->capacity, end - begin,
                              sizeof *out->item))
        return false;
    for (uint64_t i = begin; i < end; i++) {
        uint32_t f = stars->face[i];
        const uint32_t *c = mesh->faces + 3 * (uint64_t)f;
        if (c[0] < v || c[1] < v || c[2] < v || ebpo_face_repeats_index(c))
            continue;
        uint32_t p = c[0] == v ? c[1] : c[0], q = c[2] == v ? c[1] : c[2];
        out->item[out->count++] =
            (ebpo_same_face){ p < q ? (uint64_t)p << 32 | q : (uint64_t)q << 32 | p,
                              (uint32_t)ebpo_mesh_source_face(mesh, f), f };
    }
    sort(out->item, out->count);
    return true;
}

void ebpo_same_faces_free(ebpo_same_faces *faces)
{
    ebpo_array_free(faces->workspace, faces->item);
}
