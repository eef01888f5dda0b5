/* Finds the faces of the first operand near the other operands.
 *
 * Every other face of the first operand is outside all other operands. So either all these other
 * faces bound the result, or none of them does.
 *
 * The search begins with a box around the other operands. If the first operand has many faces in a
 * box, the box is halved, and a half that is outside all other operands is dropped. So a long
 * diagonal drill does not need all faces of its box. Long faces are in many boxes, so halving ends
 * when several times as many faces were read as the first operand has. */
#include "core/strict_fp.h"

#include "extras/boolean/base_faces.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "core/alloc.h"
#include "core/error.h"
#include "extras/boolean/operand_mesh.h"
#include "extras/boolean/world_cell.h"

/* FACES: a box with more faces than this is halved. DEPTH: maximum number of halvings. Boxes are
 * halved until READS * n + BOXES * FACES faces were read, if the first operand has n faces. */
enum { FACES = 1 << 10, DEPTH = 24, READS = 4, BOXES = 64 };

typedef struct gathering {
    const ebpo_boolean *boolean;
    uint64_t others; /* a bit for each other operand that the expression uses */
    ebpo_base_face *face;
    uint64_t count, capacity;
    uint64_t limit;            /* the search of a box stops when there are more faces than this */
    uint64_t left;             /* number of faces to read until boxes are no longer halved */
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
    return !g->full && g->count <= g->limit;
}

static int order_faces(const void *a, const void *b)
{
    const ebpo_base_face *x = a, *y = b;
    return (x->file_face > y->file_face) - (x->file_face < y->file_face);
}

/* Keeps one of several entries of a face, which is in several boxes. The entries are sorted. */
static void remove_repeated(gathering *g)
{
    uint64_t kept = 0;
    for (uint64_t i = 0; i < g->count; i++)
        if (kept == 0 || g->face[kept - 1].file_face != g->face[i].file_face)
            g->face[kept++] = g->face[i];
    g->count = kept;
}

/* Computes the box of the other operands. */
static void find_box(const gathering *g, double box[2][3])
{
    for (int k = 0; k < 3; k++) {
        box[0][k] = INFINITY;
        box[1][k] = -INFINITY;
        for (uint32_t i = 1; i < g->boolean->count; i++)
            if (g->others >> i & 1) {
                box[0][k] = fmin(box[0][k], g->boolean->solid[i].box[k]);
                box[1][k] = fmax(box[1][k], g->boolean->solid[i].box[3 + k]);
            }
    }
}

/* Tests a cube around a box. *out: the box is outside all other operands. *in: the box is inside
 * one of them. */
static ebpo_status test_box(const gathering *g, const double box[2][3], bool *out, bool *in,
                            ebpo_error *error)
{
    double centre[3], half = 0;
    ebpo_status status = EBPO_OK;
    for (int k = 0; k < 3; k++) {
        centre[k] = box[0][k] / 2 + box[1][k] / 2;
        half = fmax(half, fmax(centre[k] - box[0][k], box[1][k] - centre[k]) * (1 + 0x1p-50));
    }
    *out = true;
    *in = false;
    for (uint32_t i = 1; i < g->boolean->count && status == EBPO_OK && !*in; i++) {
        unsigned may, stage;
        ebpo_error cause = EBPO_ERROR_INIT;
        if (!(g->others >> i & 1))
            continue;
        status = ebpo_solid_in_cube(&g->boolean->solid[i], ebpo_boolean_context(g->boolean, 0, i),
                                    centre, half, &may, &stage, &cause);
        if (status != EBPO_OK)
            return ebpo_fail_operand(g->boolean->solid[i].model, i, &cause, error);
        *out = *out && may == EBPO_MAY_OUT;
        *in = may == EBPO_MAY_IN;
    }
    return status;
}

/* Halves a box across its longest side. Returns false if this is not possible. */
static bool halve_box(const double box[2][3], double half[2][2][3])
{
    int axis = 0;
    for (int k = 1; k < 3; k++)
        axis = box[1][k] - box[0][k] > box[1][axis] - box[0][axis] ? k : axis;
    double middle = box[0][axis] / 2 + box[1][axis] / 2;
    for (int i = 0; i < 2; i++) {
        memcpy(half[i], box, sizeof half[i]);
        half[i][1 - i][axis] = middle;
    }
    return middle > box[0][axis] && middle < box[1][axis];
}

/* Gathers the faces of the first operand that intersect a box, except in parts of the box that are
 * outside all other operands. depth: number of halvings that led to the box. */
static ebpo_status gather_in_box(gathering *g, const double box[2][3], int depth, ebpo_error *error)
{
    const ebpo_posed_solid *solid = &g->boolean->solid[0];
    double min[3], max[3], half[2][2][3];
    bool out, in;
    ebpo_error cause = EBPO_ERROR_INIT;
    uint64_t before = g->count;
    ebpo_status status = test_box(g, box, &out, &in, error);
    if (status != EBPO_OK || out)
        return status;
    bool whole = in || depth == DEPTH || g->left == 0 || !halve_box(box, half);
    g->limit = whole ? UINT64_MAX : before + FACES;
    ebpo_unpose_box(solid, box[0], box[1], min, max);
    status = ebpo_triangles_in_box(ebpo_boolean_context(g->boolean, 0, 0), min, max, take_triangles,
                                   g, &cause);
    if (status != EBPO_OK)
        return ebpo_fail_operand(solid->model, 0, &cause, error);
    if (g->full)
        return ebpo_fail_memory(error, (g->count + EBPO_TRIANGLES_MAX) * sizeof *g->face);
    uint64_t read = g->count - before;
    g->left -= read < g->left ? read : g->left;
    if (g->count <= g->limit)
        return EBPO_OK;
    g->count = before;
    for (int i = 0; i < 2 && status == EBPO_OK; i++)
        status = gather_in_box(g, (const double(*)[3])half[i], depth + 1, error);
    return status;
}

ebpo_status ebpo_base_faces_find(const ebpo_boolean *b, ebpo_base_face **out, uint64_t *count,
                                 ebpo_error *error)
{
    const ebpo_posing *posing = &b->solid[0].posing;
    gathering g = { .boolean = b, .posing = ebpo_moves_nothing(posing) ? NULL : posing };
    double box[2][3];
    g.others = ebpo_expression_operands(&b->expression) & ~UINT64_C(1);
    g.left = READS * b->solid[0].model->info->face_count + BOXES * FACES;
    find_box(&g, box);
    ebpo_status status = g.others ? gather_in_box(&g, (const double(*)[3])box, 0, error) : EBPO_OK;
    if (g.count) {
        qsort(g.face, g.count, sizeof *g.face, order_faces);
        remove_repeated(&g);
    }
    *out = g.face;
    *count = g.count;
    return status;
}
