/* Finds the faces of the first operand near the other operands.
 *
 * Every other face of the first operand is outside all other operands. So either all these other
 * faces bound the result, or none of them does. */
#include "core/strict_fp.h"

#include "extras/boolean/base_faces.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "core/alloc.h"
#include "core/error.h"
#include "extras/boolean/operand_mesh.h"

typedef struct gathering {
    ebpo_base_face *face;
    uint64_t count, capacity;
    const ebpo_posing *posing; /* NULL: coordinates stay as they are */
    bool full;                 /* there was not enough memory for a face */
} gathering;

static bool take_triangles(void *user, const ebpo_triangles *triangles)
{
    gathering *g = user;
    g->full = !ebpo_grow(&g->face, &g->capacity, g->count + triangles->count, sizeof *g->face);
    for (uint64_t i = 0; i < triangles->count && !g->full; i++) {
        ebpo_base_face *f = &g->face[g->count++];
        f->file_face = (uint32_t)triangles->file_faces[i];
        f->source = (uint32_t)triangles->faces[i];
        for (int k = 0; k < 3; k++)
            if (g->posing)
                ebpo_posing_apply(g->posing, triangles->corners[i][k], f->corner[k]);
            else
                memcpy(f->corner[k], triangles->corners[i][k], sizeof f->corner[k]);
    }
    return !g->full;
}

static int order_faces(const void *a, const void *b)
{
    const ebpo_base_face *x = a, *y = b;
    return (x->file_face > y->file_face) - (x->file_face < y->file_face);
}

/* Computes the box of the other operands. Returns false if there are none. */
static bool find_box(const ebpo_boolean *b, double low[3], double high[3])
{
    uint64_t used = ebpo_expression_operands(&b->expression) & ~UINT64_C(1);
    for (int k = 0; k < 3; k++) {
        low[k] = INFINITY;
        high[k] = -INFINITY;
        for (uint32_t i = 1; i < b->count; i++)
            if (used >> i & 1) {
                low[k] = fmin(low[k], b->solid[i].box[k]);
                high[k] = fmax(high[k], b->solid[i].box[3 + k]);
            }
    }
    return used != 0;
}

ebpo_status ebpo_base_faces_find(const ebpo_boolean *b, ebpo_base_face **out, uint64_t *count,
                                 ebpo_error *error)
{
    const ebpo_posed_solid *solid = &b->solid[0];
    gathering g = { .posing = ebpo_moves_nothing(&solid->posing) ? NULL : &solid->posing };
    double low[3], high[3], min[3], max[3];
    ebpo_status status = EBPO_OK;
    if (find_box(b, low, high)) {
        ebpo_unpose_box(solid, low, high, min, max);
        status = ebpo_triangles_in_box(ebpo_boolean_context(b, 0, 0), min, max, take_triangles, &g,
                                       error);
    }
    if (status == EBPO_OK && g.full)
        status = ebpo_fail_memory(error, (g.count + EBPO_TRIANGLES_MAX) * sizeof *g.face);
    if (g.count)
        qsort(g.face, g.count, sizeof *g.face, order_faces);
    *out = g.face;
    *count = g.count;
    return status;
}
