#include "core/strict_fp.h"

#include "mesh/edge_faces.h"

#include <stdlib.h>

#include "core/alloc.h"
#include "core/sort.h"
#include "geometry/predicates.h"

typedef struct edge {
    double v[3], w[3];
} edge;

bool ebpo_edge_faces_add(ebpo_edge_faces *e, uint32_t face, uint8_t out, uint64_t patch)
{
    if (!ebpo_grow(&e->face, &e->capacity, e->count + 1, sizeof *e->face))
        return false;
    e->face[e->count++] = (ebpo_edge_face){ .patch = patch, .face = face, .out = out };
    return true;
}

static int compare_patches(const void *x, const void *y)
{
    const ebpo_edge_face *a = x, *b = y;
    return a->patch < b->patch ? -1 : a->patch > b->patch;
}

void ebpo_edge_faces_sort(ebpo_edge_faces *e)
{
    if (e->count > 1)
        qsort(e->face, e->count, sizeof *e->face, compare_patches);
}

/* Returns the sign of the first component of the normal of v, w, p that is not 0. */
static int normal_sign(const edge *e, const double p[3], int *axis)
{
    for (*axis = 0; *axis < 3; ++*axis) {
        int sign = ebpo_normal_sign(*axis, e->v, e->w, p);
        if (sign)
            return sign;
    }
    return 0;
}

/* Returns less than 0 where a comes first, and 0 where both are in one plane. */
static int compare_angles(const ebpo_edge_face *a, const ebpo_edge_face *b, const edge *e)
{
    if (a->quarter != b->quarter)
        return a->quarter < b->quarter ? -1 : 1;
    return a->quarter % 2 ? -ebpo_orient3d(e->v, e->w, a->at, b->at) : 0;
}

static int compare_turn(const void *x, const void *y, void *context)
{
    const ebpo_edge_face *a = x, *b = y;
    int by_angle = compare_angles(a, b, context);
    if (by_angle)
        return by_angle;
    int by_number = a->source < b->source ? -1 : a->source > b->source;
    return a->reversed ? -by_number : by_number;
}

bool ebpo_edge_faces_turn(ebpo_edge_faces *e, const ebpo_mesh *mesh, uint32_t v, uint32_t w)
{
    edge of;
    int first_sign = 0, first_axis = 0;
    ebpo_mesh_position(mesh, v, of.v);
    ebpo_mesh_position(mesh, w, of.w);
    for (uint64_t i = 0; i < e->count; i++) {
        ebpo_edge_face *f = &e->face[i];
        const uint32_t *corner = mesh->faces + 3 * (uint64_t)f->face;
        int k = 0, axis;
        while (corner[k] == v || corner[k] == w)
            k++;
        ebpo_mesh_position(mesh, corner[k], f->at);
        int sign = normal_sign(&of, f->at, &axis);
        if (!sign)
            return false;
        if (i == 0)
            first_sign = sign, first_axis = axis;
        int side = ebpo_orient3d(of.v, of.w, e->face[0].at, f->at);
        bool beside = ebpo_normal_sign(first_axis, of.v, of.w, f->at) == first_sign;
        f->quarter = side > 0 ? 1 : side < 0 ? 3 : beside ? 0 : 2;
        f->reversed = sign < 0;
        f->source = ebpo_mesh_source_face(mesh, f->face);
    }
    if (e->count > 1)
        ebpo_sort_with(e->face, e->count, sizeof *e->face, compare_turn, &of);
    for (uint64_t i = 1; i < e->count; i++)
        e->face[i].layered = compare_angles(&e->face[i - 1], &e->face[i], &of) == 0;
    return true;
}

/* Returns whether every layer has as many faces along the edge as its places say, of which the
 * first is along it when `first` is 1. */
static bool alternate_from(const ebpo_edge_faces *e, unsigned first)
{
    int64_t surplus = 0;
    for (uint64_t i = 0; i < e->count; i++) {
        if (!e->face[i].layered && surplus)
            return false;
        surplus += (int64_t)e->face[i].out - (int64_t)((i + first) % 2);
    }
    return surplus == 0;
}

bool ebpo_edge_faces_alternate(const ebpo_edge_faces *e)
{
    return alternate_from(e, 0) || alternate_from(e, 1);
}
