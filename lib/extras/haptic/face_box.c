#include "core/strict_fp.h"

#include "extras/haptic/face_box.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "core/alloc.h"
#include "core/error.h"
#include "extras/haptic/vectors.h"

uint64_t ebpo_face_box_leaves(uint64_t count)
{
    uint64_t leaves = 1;
    while (leaves * EBPO_FACE_BOX_LEAF < count)
        leaves *= 2;
    return leaves;
}

uint64_t ebpo_face_box_bytes(uint64_t capacity)
{
    return capacity * (sizeof(double[3][3]) + sizeof(uint64_t)) +
           2 * ebpo_face_box_leaves(capacity) * sizeof(ebpo_extent);
}

/* All pages are written here, so that no tick is the first to use one. */
ebpo_status ebpo_face_box_new(ebpo_face_box *out, uint64_t capacity, ebpo_error *error)
{
    *out = (ebpo_face_box){ .capacity = capacity, .leaves = 1 };
    uint64_t nodes = 2 * ebpo_face_box_leaves(capacity);
    out->corner = ebpo_alloc(capacity, sizeof *out->corner);
    out->face = ebpo_alloc(capacity, sizeof *out->face);
    out->node = ebpo_alloc(nodes, sizeof *out->node);
    if (!out->corner || !out->face || !out->node) {
        ebpo_face_box_free(out);
        return ebpo_fail_memory(error, ebpo_face_box_bytes(capacity));
    }
    memset(out->corner, 0xff, capacity * sizeof *out->corner);
    memset(out->face, 0xff, capacity * sizeof *out->face);
    memset(out->node, 0xff, nodes * sizeof *out->node); /* NAN: meets nothing */
    for (int i = 0; i < 3; i++)
        out->centres.min[i] = out->centres.max[i] = NAN; /* contains nothing */
    return EBPO_OK;
}

void ebpo_face_box_free(ebpo_face_box *box)
{
    free(box->corner);
    free(box->face);
    free(box->node);
    *box = (ebpo_face_box){ 0 };
}

typedef struct loading {
    ebpo_face_box *box;
    bool fits;
} loading;

static bool take(void *user, const ebpo_triangles *triangles)
{
    loading *l = user;
    ebpo_face_box *box = l->box;
    l->fits = triangles->count <= box->capacity - box->count;
    if (!l->fits)
        return false;
    memcpy(box->corner + box->count, triangles->corners, triangles->count * sizeof *box->corner);
    memcpy(box->face + box->count, triangles->faces, triangles->count * sizeof *box->face);
    box->count += triangles->count;
    return true;
}

static void widen(ebpo_extent *e, const double min[3], const double max[3])
{
    for (int i = 0; i < 3; i++) {
        e->min[i] = fmin(e->min[i], min[i]);
        e->max[i] = fmax(e->max[i], max[i]);
    }
}

static void make_tree(ebpo_face_box *box)
{
    static const ebpo_extent nothing = { { INFINITY, INFINITY, INFINITY },
                                         { -INFINITY, -INFINITY, -INFINITY } };
    box->leaves = ebpo_face_box_leaves(box->count);
    for (uint64_t leaf = 0; leaf < box->leaves; leaf++) {
        ebpo_extent *e = &box->node[box->leaves + leaf];
        *e = nothing;
        for (uint64_t f = leaf * EBPO_FACE_BOX_LEAF;
             f < box->count && f < (leaf + 1) * EBPO_FACE_BOX_LEAF; f++)
            for (int k = 0; k < 3; k++)
                widen(e, box->corner[f][k], box->corner[f][k]);
    }
    for (uint64_t n = box->leaves - 1; n > 0; n--) {
        box->node[n] = box->node[2 * n];
        widen(&box->node[n], box->node[2 * n + 1].min, box->node[2 * n + 1].max);
    }
}

ebpo_status ebpo_face_box_load(ebpo_face_box *box, ebpo_context *context,
                               const ebpo_extent *centres, double margin, bool *fits,
                               ebpo_error *error)
{
    loading l = { box, true };
    double min[3], max[3];
    box->count = 0;
    box->centres = *centres;
    for (int i = 0; i < 3; i++) {
        min[i] = centres->min[i] - margin;
        max[i] = centres->max[i] + margin;
    }
    copy(min, box->loaded.min);
    copy(max, box->loaded.max);
    ebpo_status status = ebpo_triangles_in_box(context, min, max, take, &l, error);
    *fits = l.fits;
    if (status == EBPO_OK && l.fits)
        make_tree(box);
    return status;
}

static bool meet(const ebpo_extent *a, const ebpo_extent *b)
{
    for (int i = 0; i < 3; i++)
        if (!(a->min[i] <= b->max[i] && a->max[i] >= b->min[i]))
            return false;
    return true;
}

static bool face_meets(const double face[3][3], const ebpo_extent *around)
{
    ebpo_extent e;
    copy(face[0], e.min);
    copy(face[0], e.max);
    widen(&e, face[1], face[1]);
    widen(&e, face[2], face[2]);
    return meet(&e, around);
}

bool ebpo_face_box_find(const ebpo_face_box *box, const ebpo_extent *around, uint32_t *found,
                        uint32_t most, uint32_t *visits, uint32_t *count)
{
    uint64_t stack[64]; /* a level leaves one behind */
    int depth = 0;
    *count = 0;
    stack[depth++] = 1;
    while (depth > 0) {
        uint64_t n = stack[--depth];
        if (*visits == 0)
            return false;
        --*visits;
        if (!meet(&box->node[n], around))
            continue;
        if (n < box->leaves) {
            stack[depth++] = 2 * n + 1;
            stack[depth++] = 2 * n;
            continue;
        }
        uint64_t f = (n - box->leaves) * EBPO_FACE_BOX_LEAF, end = f + EBPO_FACE_BOX_LEAF;
        for (; f < end && f < box->count; f++)
            if (face_meets((const double(*)[3])box->corner[f], around)) {
                if (*count == most)
                    return false;
                found[(*count)++] = (uint32_t)f;
            }
    }
    return true;
}

/* Squared. */
static double between(const ebpo_extent *a, const ebpo_extent *b)
{
    double square = 0;
    for (int i = 0; i < 3; i++) {
        double d = fmax(0, fmax(a->min[i] - b->max[i], b->min[i] - a->max[i]));
        square += d * d;
    }
    return square;
}

static double closest_of_leaf(const ebpo_face_box *box, uint64_t leaf, const ebpo_extent *around)
{
    double least = INFINITY;
    uint64_t f = leaf * EBPO_FACE_BOX_LEAF, end = f + EBPO_FACE_BOX_LEAF;
    for (; f < end && f < box->count; f++) {
        ebpo_extent e;
        copy(box->corner[f][0], e.min);
        copy(box->corner[f][0], e.max);
        widen(&e, box->corner[f][1], box->corner[f][1]);
        widen(&e, box->corner[f][2], box->corner[f][2]);
        least = fmin(least, between(&e, around));
    }
    return least;
}

static double find_square(const ebpo_face_box *box, const ebpo_extent *around, uint32_t most_visits,
                          uint64_t *visits)
{
    struct {
        uint64_t node;
        double lower;
    } stack[64]; /* a level leaves one behind */
    int depth = 0;
    double least = INFINITY;
    if (box->count == 0)
        return INFINITY;
    stack[depth].node = 1;
    stack[depth++].lower = between(&box->node[1], around);
    for (uint32_t n = 0; depth > 0; n++) {
        uint64_t node = stack[--depth].node;
        double lower = stack[depth].lower;
        if (!(lower < least))
            continue;
        ++*visits;
        if (n >= most_visits) {
            least = lower;
        } else if (node >= box->leaves) {
            least = fmin(least, closest_of_leaf(box, node - box->leaves, around));
        } else {
            double l = between(&box->node[2 * node], around);
            double r = between(&box->node[2 * node + 1], around);
            bool first = l <= r; /* is looked at first, so goes on last */
            stack[depth].node = 2 * node + first;
            stack[depth++].lower = first ? r : l;
            stack[depth].node = 2 * node + !first;
            stack[depth++].lower = first ? l : r;
        }
    }
    return least;
}

double ebpo_face_box_clearance(const ebpo_face_box *box, const ebpo_extent *around,
                               uint32_t most_visits, uint64_t *visits)
{
    return sqrt(find_square(box, around, most_visits, visits)) * (1 - 0x1p-48);
}
