/* Finds the faces of the first operand near the surfaces of the other operands.
 *
 * The search begins with the common part of the boxes of the first operand and of the others. If
 * the first operand has many faces in a box, the box is halved. If a box does not intersect the
 * surface of any other operand, all faces in the box stay, or all are removed, or all are reversed.
 * Reversed faces are gathered. Other faces are not gathered, but get a bit if they do not have the
 * state of the faces outside all other operands. So a long diagonal drill does not need all faces
 * of its box, and a plane does not need the faces behind it. Long faces are in many boxes, so
 * halving ends when several times as many faces were read as the first operand has. */
#include "core/strict_fp.h"

#include "extras/boolean/base_faces.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "core/alloc.h"
#include "core/error.h"
#include "core/parallel.h"
#include "extras/boolean/operand_mesh.h"
#include "extras/boolean/world_cell.h"

/* FACES: a box with more faces than this is halved. DEPTH: maximum number of halvings. Boxes are
 * halved until READS * n + BOXES * FACES faces were read, if the first operand has n faces. */
enum { FACES = 1 << 7, DEPTH = 24, READS = 4, BOXES = 512 };

typedef struct gathering {
    const ebpo_boolean *boolean;
    const ebpo_progress *progress;
    uint64_t others; /* a bit for each other operand that the expression uses */
    uint64_t base;   /* a bit for the first operand, and for each operand that is equal to it */
    bool keeps_base; /* faces outside all other operands stay; otherwise they are removed */
    ebpo_base_face *face;
    uint64_t count, capacity;
    uint64_t limit;            /* the search of a box stops when there are more faces than this */
    uint64_t left;             /* number of faces to read until boxes are no longer halved */
    const ebpo_posing *posing; /* NULL: coordinates stay as they are */
    uint64_t *differs;         /* a bit for each face of the file; NULL: all are 0 */
    uint64_t done;             /* searched part of the first box, of 2^DEPTH */
    bool full;                 /* there was not enough memory for a face */
    bool cancelled;            /* the caller has cancelled; *error has the message */
    ebpo_error *error;
} gathering;

/* Counts faces that were read, and reports progress. Returns false if the caller cancels. */
static bool count_read(gathering *g, uint64_t faces)
{
    g->left -= faces < g->left ? faces : g->left;
    g->cancelled = !ebpo_progress_step(g->progress, "find changed faces", g->done,
                                       UINT64_C(1) << DEPTH, g->error);
    return !g->cancelled;
}

/* Gathers triangles of the first operand; stops when there are more than the limit. */
static bool take_triangles(void *user, const ebpo_triangles *triangles)
{
    gathering *g = user;
    uint64_t most = g->limit + 1 - g->count,
             count = triangles->count < most ? triangles->count : most;
    g->full = !ebpo_grow(&g->face, &g->capacity, g->count + count, sizeof *g->face);
    for (uint64_t i = 0; i < count && !g->full; i++) {
        ebpo_base_face *f = &g->face[g->count++];
        f->file_face = (uint32_t)triangles->file_faces[i];
        f->source = (uint32_t)triangles->faces[i];
        for (int k = 0; k < 3; k++)
            if (g->posing)
                ebpo_posing_apply(g->posing, triangles->corners[i][k], f->corner[k]);
            else
                memcpy(f->corner[k], triangles->corners[i][k], sizeof f->corner[k]);
    }
    return count_read(g, count) && !g->full && g->count <= g->limit;
}

/* Sets the bits of triangles of the first operand. */
static bool mark_triangles(void *user, const ebpo_triangles *triangles)
{
    gathering *g = user;
    for (uint64_t i = 0; i < triangles->count; i++)
        ebpo_set_bit(g->differs, triangles->file_faces[i]);
    return count_read(g, triangles->count);
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

/* Computes the part of the first operand's box that is in the box of the other operands. Returns
 * false if there is no such part. */
static bool find_box(const gathering *g, double box[2][3])
{
    const ebpo_posed_solid *solid = g->boolean->solid;
    bool found = true;
    for (int k = 0; k < 3; k++) {
        box[0][k] = INFINITY;
        box[1][k] = -INFINITY;
        for (uint32_t i = 1; i < g->boolean->count; i++)
            if (g->others >> i & 1) {
                box[0][k] = fmin(box[0][k], solid[i].box[k]);
                box[1][k] = fmax(box[1][k], solid[i].box[3 + k]);
            }
        box[0][k] = fmax(box[0][k], solid[0].box[k]);
        box[1][k] = fmin(box[1][k], solid[0].box[3 + k]);
        found = found && box[0][k] <= box[1][k];
    }
    return found;
}

/* Tests a cube around a box. Returns in *uniform if no other operand has a face in the box. *sign:
 * if the box is uniform, 1 if faces of the first operand in the box stay, 0 if they are removed, -1
 * if they are reversed. */
static ebpo_status test_box(const gathering *g, const double box[2][3], bool *uniform, int *sign,
                            ebpo_error *error)
{
    const ebpo_boolean *b = g->boolean;
    double centre[3], half = 0;
    uint64_t in = 0;
    ebpo_status status = EBPO_OK;
    for (int k = 0; k < 3; k++) {
        centre[k] = box[0][k] / 2 + box[1][k] / 2;
        half = fmax(half, fmax(centre[k] - box[0][k], box[1][k] - centre[k]) * (1 + 0x1p-50));
    }
    *uniform = true;
    for (uint32_t i = 1; i < b->count && status == EBPO_OK && *uniform; i++) {
        unsigned may, stage;
        ebpo_error cause = EBPO_ERROR_INIT;
        if (!(g->others >> i & 1))
            continue;
        status = ebpo_solid_in_cube(&b->solid[i], ebpo_boolean_context(b, 0, i), centre, half, &may,
                                    &stage, &cause);
        if (status != EBPO_OK)
            return ebpo_fail_operand(b->solid[i].model, i, &cause, error);
        *uniform = may != EBPO_MAY_BOTH;
        in |= (uint64_t)(may == EBPO_MAY_IN) << i;
    }
    *sign = ebpo_boolean_holds(b, in | g->base) - ebpo_boolean_holds(b, in & ~g->base);
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

/* Passes the faces of the first operand in a box to `take`. */
static ebpo_status read_box(gathering *g, const double box[2][3], ebpo_triangles_fn take,
                            ebpo_error *error)
{
    const ebpo_posed_solid *solid = &g->boolean->solid[0];
    double min[3], max[3];
    ebpo_error cause = EBPO_ERROR_INIT;
    ebpo_unpose_box(solid, box[0], box[1], min, max);
    ebpo_status status =
        ebpo_triangles_in_box(ebpo_boolean_context(g->boolean, 0, 0), min, max, take, g, &cause);
    if (status != EBPO_OK)
        return ebpo_fail_operand(solid->model, 0, &cause, error);
    if (g->full)
        return ebpo_fail_memory(error, (g->count + EBPO_TRIANGLES_MAX) * sizeof *g->face);
    return g->cancelled ? EBPO_E_CANCELLED : EBPO_OK;
}

/* Sets the bits of the faces of the first operand in a box. */
static ebpo_status mark_box(gathering *g, const double box[2][3], ebpo_error *error)
{
    uint64_t words = g->boolean->solid[0].model->info->face_count / 64 + 1;
    if (!g->differs)
        g->differs = ebpo_alloc_zero(words, sizeof *g->differs);
    return g->differs ? read_box(g, box, mark_triangles, error)
                      : ebpo_fail_memory(error, words * sizeof *g->differs);
}

/* Gathers or marks the faces of the first operand that intersect a box. depth: number of halvings
 * that led to the box. */
static ebpo_status gather_in_box(gathering *g, const double box[2][3], int depth, ebpo_error *error)
{
    double half[2][2][3];
    bool uniform;
    int sign = 0;
    uint64_t before = g->count;
    ebpo_status status = test_box(g, box, &uniform, &sign, error);
    if (status != EBPO_OK)
        return status;
    if (uniform && sign >= 0) {
        g->done += (UINT64_C(1) << DEPTH) >> depth;
        return sign == g->keeps_base ? EBPO_OK : mark_box(g, box, error);
    }
    bool whole = uniform || depth == DEPTH || g->left == 0 || !halve_box(box, half);
    g->limit = whole ? UINT64_MAX - 1 : before + FACES;
    status = read_box(g, box, take_triangles, error);
    if (status != EBPO_OK)
        return status;
    if (g->count <= g->limit) {
        g->done += (UINT64_C(1) << DEPTH) >> depth;
        return EBPO_OK;
    }
    g->count = before;
    for (int i = 0; i < 2 && status == EBPO_OK; i++)
        status = gather_in_box(g, (const double(*)[3])half[i], depth + 1, error);
    return status;
}

ebpo_status ebpo_base_faces_find(const ebpo_boolean *b, uint64_t base,
                                 const ebpo_progress *progress, ebpo_base_faces *out,
                                 ebpo_error *error)
{
    const ebpo_posing *posing = &b->solid[0].posing;
    gathering g = { .boolean = b,
                    .progress = progress,
                    .base = base,
                    .keeps_base = ebpo_boolean_holds(b, base),
                    .error = error,
                    .posing = ebpo_moves_nothing(posing) ? NULL : posing };
    double box[2][3];
    g.others = ebpo_expression_operands(&b->expression) & ~UINT64_C(1);
    g.left = READS * b->solid[0].model->info->face_count + BOXES * FACES;
    find_box(&g, box);
    ebpo_status status = g.others ? gather_in_box(&g, (const double(*)[3])box, 0, error) : EBPO_OK;
    if (g.count) {
        qsort(g.face, g.count, sizeof *g.face, order_faces);
        remove_repeated(&g);
    }
    *out = (ebpo_base_faces){ g.face, g.count, g.differs };
    return status;
}

void ebpo_base_faces_free(ebpo_base_faces *faces)
{
    free(faces->face);
    free(faces->differs);
}
