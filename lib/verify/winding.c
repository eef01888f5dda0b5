/* Seen along the axis, a face winds around the ray once or not at all: the edges that cross a half-line beside the point are counted. The half-line
 * runs along the axis of the larger shift, so that the smaller shift decides which end of an edge lies where, and the larger one every tie
 * that is left. */
#include "geom/strict_fp.h"

#include "verify/winding.h"

#include <stdlib.h>

#include "base/alloc.h"
#include "base/error.h"
#include "geom/predicates.h"
#include "mesh/mesh.h"

enum { ENTRIES_PER_FACE = 8, SIDE_MAX = 4096 };

void ebpo_face_corners(const ebpo_mesh *mesh, uint64_t face, ebpo_corners *out)
{
    for (uint64_t i = 0; i < 3; i++)
        ebpo_mesh_position(mesh, mesh->faces[3 * face + i], out->at[i]);
}

static int orient_in(int u, int v, const double a[3], const double b[3], const double c[3])
{
    return ebpo_orient2d((double[2]){a[u], a[v]}, (double[2]){b[u], b[v]}, (double[2]){c[u], c[v]});
}

/* Turns of the face around p seen in the plane (u, v), counter-clockwise positive. */
static int turns(const double p[3], int u, int v, const ebpo_corners *face)
{
    int sum = 0;
    for (int i = 0; i < 3; i++) {
        const double *s = face->at[i], *t = face->at[i == 2 ? 0 : i + 1];
        bool start_above = s[v] > p[v], end_above = t[v] > p[v];
        if (start_above == end_above)
            continue;
        int side = orient_in(u, v, s, t, p);
        if (end_above)
            sum += side > 0;
        else
            sum -= side < 0;
    }
    return sum;
}

/* Side of the shifted p of the face's plane: a tie goes to the first component of the normal that is not 0. */
static int shifted_side(const double p[3], const ebpo_corners *face)
{
    const double *a = face->at[0], *b = face->at[1], *c = face->at[2];
    int side = ebpo_orient3d(a, b, c, p);
    if (side == 0)
        side = orient_in(1, 2, a, b, c);
    if (side == 0)
        side = orient_in(2, 0, a, b, c);
    return side != 0 ? side : orient_in(0, 1, a, b, c);
}

static bool outside(const double p[3], int k, const ebpo_corners *face)
{
    double a = face->at[0][k], b = face->at[1][k], c = face->at[2][k];
    return (a > p[k] && b > p[k] && c > p[k]) || (a <= p[k] && b <= p[k] && c <= p[k]);
}

int ebpo_ray_hit(const double p[3], int axis, const ebpo_corners *face)
{
    int u = axis == 0 ? 1 : 0, v = axis == 2 ? 1 : 2;
    if (outside(p, u, face) || outside(p, v, face))
        return 0;
    double a = face->at[0][axis], b = face->at[1][axis], c = face->at[2][axis], x = p[axis];
    if (a <= x && b <= x && c <= x)
        return 0;
    int turn = turns(p, u, v, face);
    if (axis == 1)
        turn = -turn; /* (x, z) is left-handed seen along y */
    if (turn == 0 || (a > x && b > x && c > x))
        return turn;
    return shifted_side(p, face) == -turn ? turn : 0;
}

/* Monotone, so that a point in a face's range of coordinates falls into its range of columns. */
static uint64_t column_of(const ebpo_columns *c, int i, double x)
{
    double at = (x - c->low[i]) * c->scale[i] * (double)c->side;
    return at >= (double)c->side ? c->side - 1 : at > 0 ? (uint64_t)at : 0;
}

typedef struct column_range {
    uint64_t from[2], to[2];
} column_range;

static column_range columns_of_face(const ebpo_columns *c, uint64_t face)
{
    ebpo_corners corners;
    ebpo_face_corners(c->mesh, face, &corners);
    column_range range;
    for (int i = 0; i < 2; i++) {
        double low = corners.at[0][i + 1], high = low;
        for (int j = 1; j < 3; j++) {
            double x = corners.at[j][i + 1];
            low = x < low ? x : low;
            high = x > high ? x : high;
        }
        range.from[i] = column_of(c, i, low);
        range.to[i] = column_of(c, i, high);
    }
    return range;
}

/* The finest grid whose entries stay within the promised memory. */
static void choose_side(ebpo_columns *c)
{
    uint64_t faces = c->mesh->face_count;
    c->side = 1;
    while (c->side < SIDE_MAX && c->side * c->side * 2 < faces)
        c->side *= 2;
    for (; c->side > 1; c->side /= 2) {
        uint64_t entries = 0;
        for (uint64_t f = 0; f < faces && entries <= ENTRIES_PER_FACE * faces; f++) {
            column_range r = columns_of_face(c, f);
            entries += (r.to[0] - r.from[0] + 1) * (r.to[1] - r.from[1] + 1);
        }
        if (entries <= ENTRIES_PER_FACE * faces)
            return;
    }
}

/* Counts (faces NULL) or writes the entries; `first` ends up one column ahead while writing. */
static void enter_faces(ebpo_columns *c)
{
    for (uint64_t f = 0; f < c->mesh->face_count; f++) {
        column_range r = columns_of_face(c, f);
        for (uint64_t z = r.from[1]; z <= r.to[1]; z++)
            for (uint64_t y = r.from[0]; y <= r.to[0]; y++) {
                uint64_t *at = &c->first[z * c->side + y];
                if (c->faces)
                    c->faces[*at] = (uint32_t)f;
                ++*at;
            }
    }
}

ebpo_status ebpo_columns_make(ebpo_columns *out, const ebpo_mesh *mesh, const ebpo_box *box, ebpo_error *error)
{
    *out = (ebpo_columns){.mesh = mesh};
    for (int i = 0; i < 2; i++) {
        out->low[i] = box->origin[i + 1];
        out->scale[i] = 1 / box->size[i + 1];
    }
    choose_side(out);
    uint64_t count = out->side * out->side, sum = 0;
    out->first = ebpo_alloc_zero(count + 1, sizeof *out->first);
    if (!out->first)
        return ebpo_fail_memory(error, (count + 1) * sizeof *out->first);
    enter_faces(out);
    for (uint64_t i = 0; i <= count; i++) {
        uint64_t entries = out->first[i];
        out->first[i] = sum;
        sum += entries;
    }
    out->faces = ebpo_alloc(sum, sizeof *out->faces);
    if (!out->faces) {
        ebpo_columns_free(out);
        return ebpo_fail_memory(error, sum * sizeof *out->faces);
    }
    enter_faces(out);
    for (uint64_t i = count; i > 0; i--)
        out->first[i] = out->first[i - 1];
    out->first[0] = 0;
    return EBPO_OK;
}

void ebpo_columns_free(ebpo_columns *columns)
{
    free(columns->first);
    free(columns->faces);
    *columns = (ebpo_columns){0};
}

int64_t ebpo_columns_winding(const ebpo_columns *columns, const double p[3])
{
    uint64_t at = column_of(columns, 1, p[2]) * columns->side + column_of(columns, 0, p[1]);
    int64_t sum = 0;
    for (uint64_t i = columns->first[at]; i < columns->first[at + 1]; i++) {
        ebpo_corners face;
        ebpo_face_corners(columns->mesh, columns->faces[i], &face);
        sum += ebpo_ray_hit(p, 0, &face);
    }
    return sum;
}
