/* Computes normals for the polygons of a level, for shading.
 *
 * A polygon on a plane of its node's envelope (a "plane polygon") is nearly parallel to the
 * surface, so its normal is the plane's normal. A polygon on a cell face is a step between two
 * envelopes and does not represent the surface, so its normal is computed from the plane polygons
 * around it.
 *
 * The normals of polygons on cell faces are computed in six passes, one for each side of cells
 * (lower x, upper x, ...). In each pass, every corner of every drawn cell gets a normal: the mean
 * of the normals, weighted by area, of the plane polygons of the nodes around the corner. The mean
 * includes only polygons whose normals point to the side of this pass, so polygons on the other
 * side of a thin part are ignored. A polygon on this side of a cell gets a normal that is
 * interpolated linearly from the normals at the cell's corners. */
#include "core/strict_fp.h"

#include <ebpo/lod.h>

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "core/alloc.h"
#include "core/error.h"
#include "core/hash.h"
#include "geometry/cells.h"
#include "geometry/vec3.h"

enum { SIDES = 6, ON_PLANE = SIDES, DEEPEST = EBPO_LEVELS_MAX - 1 };

static const uint32_t none = UINT32_MAX; /* no index of a corner */
/* A polygon faces a side if the cosine of the angle between the polygon's normal and the side's
 * outward normal is greater than this value. The value is below 0, so the angle may be slightly
 * more than 90 degrees. */
static const double least_cosine = -0.3;

typedef struct polygon {
    /* area vector: the polygon's normal, whose length is twice the polygon's area */
    double area[3];
    double middle[3];
    /* side of the cell: 2 * axis, plus 1 for the upper side; ON_PLANE: the polygon is on a plane */
    int side;
} polygon;

typedef struct lighting {
    ebpo_box box;
    /* areas are computed in units of 2^exponent, which is near the longest side of the box, so that
     * products neither overflow nor underflow */
    int exponent;
    const ebpo_lod_nodes *nodes;
    polygon *polygons;             /* [polygon_count] */
    uint32_t (*corner_of_node)[8]; /* [node_count] index of each corner of the node's cell */
    /* [corner_count] in the current pass: sum of area vectors (0 to 2), sum of their lengths (3) */
    double (*sum)[4];
    uint64_t *keys; /* [corner_count] positions (position_key) */
    uint64_t corner_count, key_capacity;
} lighting;

/* --- polygons --- */

/* Adds the area vector of a triangle to `area`: the triangle's normal, whose length is twice the
 * triangle's area. The unit of length is 2^exponent. */
static void add_triangle(const ebpo_mesh *mesh, const uint32_t *face, int exponent, double area[3])
{
    const double *a = mesh->xyz64 + 3 * (uint64_t)face[0], *b = mesh->xyz64 + 3 * (uint64_t)face[1],
                 *c = mesh->xyz64 + 3 * (uint64_t)face[2];
    double u[3], v[3];
    for (int k = 0; k < 3; k++) {
        u[k] = ldexp(b[k] - a[k], -exponent);
        v[k] = ldexp(c[k] - a[k], -exponent);
    }
    for (int k = 0; k < 3; k++) {
        int i = (k + 1) % 3, j = (k + 2) % 3;
        area[k] += u[i] * v[j] - u[j] * v[i];
    }
}

/* Returns corner i of a polygon. `face` is the first triangle of the polygon's fan. */
static const double *corner_of(const ebpo_mesh *mesh, const uint32_t *face, unsigned i)
{
    uint32_t v = i < 2 ? face[i] : face[3 * (i - 2) + 2];
    return mesh->xyz64 + 3 * (uint64_t)v;
}

/* Returns the side of the cell that contains a polygon, or ON_PLANE. Corners on a cell face have
 * exactly the cell face's coordinate. There is no neighbour beyond a side of the root cell, so
 * polygons on these sides count as plane polygons. */
static int side_of(const ebpo_box *box, ebpo_cell cell, const ebpo_mesh *mesh, const uint32_t *face,
                   unsigned corners)
{
    double cell_face[2][3];
    ebpo_cell_bounds(box, cell, cell_face[0], cell_face[1]);
    for (int side = 0; side < SIDES; side++) {
        int axis = side / 2;
        uint32_t outmost = side % 2 ? (1u << cell.level) - 1 : 0;
        bool on = cell.at[axis] != outmost;
        for (unsigned i = 0; i < corners && on; i++)
            on = corner_of(mesh, face, i)[axis] == cell_face[side % 2][axis];
        if (on)
            return side;
    }
    return ON_PLANE;
}

static void describe_polygons(lighting *l, const ebpo_mesh *mesh)
{
    const uint32_t *face = mesh->faces;
    polygon *p = l->polygons;
    const uint8_t *corners = l->nodes->corners;
    for (uint64_t i = 0; i < l->nodes->node_count; i++) {
        const ebpo_lod_node *node = &l->nodes->nodes[i];
        ebpo_cell cell = ebpo_cell_of_octcode(node->octcode);
        for (uint32_t k = 0; k < node->polygon_count; k++, p++, corners++) {
            unsigned n = *corners;
            *p = (polygon){ .side = side_of(&l->box, cell, mesh, face, n) };
            for (unsigned c = 0; c < n; c++)
                for (int axis = 0; axis < 3; axis++)
                    p->middle[axis] += corner_of(mesh, face, c)[axis] / n;
            for (; n > 2; n--, face += 3)
                add_triangle(mesh, face, l->exponent, p->area);
        }
    }
}

/* --- corners of cells --- */

/* Returns a number for the position of a cell's corner. The cells that share a corner get the same
 * number. */
static uint64_t position_key(ebpo_cell cell, unsigned corner)
{
    uint64_t key = 0;
    for (int k = 0; k < 3; k++)
        key = key << 21 | (uint64_t)(cell.at[k] + (corner >> k & 1)) << (DEEPEST - cell.level);
    return key;
}

/* Assigns an index to every position of a corner, and sets corner_of_node. Returns false when out
 * of memory. */
static bool number_corners(lighting *l)
{
    /* there are at most eight corners for each node, which fill at most three quarters of the slots
     */
    uint64_t count = l->nodes->node_count, slots = ebpo_hash_slots(count * 8 / 3 * 4 + 1), slot;
    uint32_t *table = ebpo_alloc(slots, sizeof *table);
    bool complete = table != NULL;
    if (complete)
        memset(table, 0xff, slots * sizeof *table);
    for (uint64_t i = 0; i < count && complete; i++) {
        ebpo_cell cell = ebpo_cell_of_octcode(l->nodes->nodes[i].octcode);
        for (unsigned c = 0; c < 8 && complete; c++) {
            uint64_t key = position_key(cell, c);
            EBPO_HASH_FIND(slot, ebpo_hash_number(key), slots - 1,
                           table[slot] == none || l->keys[table[slot]] == key);
            if (table[slot] == none) {
                complete =
                    l->corner_count < none &&
                    ebpo_grow(&l->keys, &l->key_capacity, l->corner_count + 1, sizeof *l->keys);
                if (complete)
                    l->keys[table[slot] = (uint32_t)l->corner_count++] = key;
            }
            l->corner_of_node[i][c] = table[slot];
        }
    }
    free(table);
    return complete;
}

/* --- normals at the corners, for one side of cells --- */

/* Sums over those plane polygons of a node that face a side. Sets out[0..2] to the sum of their
 * area vectors, and out[3] to the sum of the lengths of these vectors. */
static void sum_node(const polygon *p, uint32_t count, int side, double out[4])
{
    double sign = side % 2 ? 1 : -1;
    memset(out, 0, 4 * sizeof *out);
    for (uint32_t k = 0; k < count; k++, p++) {
        double length = sqrt(ebpo_vec3_dot(p->area, p->area));
        if (p->side != ON_PLANE || !(sign * p->area[side / 2] > least_cosine * length))
            continue;
        for (int axis = 0; axis < 3; axis++)
            out[axis] += p->area[axis];
        out[3] += length;
    }
}

/* Sets l->sum: for each corner, the sums of sum_node over all nodes around the corner. */
static void sum_side(lighting *l, int side)
{
    const polygon *p = l->polygons;
    memset(l->sum, 0, l->corner_count * sizeof *l->sum);
    for (uint64_t i = 0; i < l->nodes->node_count; i++) {
        double sum[4];
        sum_node(p, l->nodes->nodes[i].polygon_count, side, sum);
        p += l->nodes->nodes[i].polygon_count;
        for (int c = 0; c < 8 && sum[3] > 0; c++)
            for (int k = 0; k < 4; k++)
                l->sum[l->corner_of_node[i][c]][k] += sum[k];
    }
}

/* Interpolates the mean normals of a cell's corners at a point in the cell. */
static void direction_at(const lighting *l, ebpo_cell cell, const uint32_t corners[8],
                         const double point[3], double out[3])
{
    double low[3], high[3];
    ebpo_cell_bounds(&l->box, cell, low, high);
    memset(out, 0, 3 * sizeof *out);
    for (unsigned c = 0; c < 8; c++) {
        const double *sum = l->sum[corners[c]];
        double share = 1;
        for (int k = 0; k < 3; k++) {
            double x = (point[k] - low[k]) / (high[k] - low[k]);
            share *= c >> k & 1 ? x : 1 - x;
        }
        for (int k = 0; k < 3 && sum[3] > 0; k++)
            out[k] += share * sum[k] / sum[3];
    }
}

/* Sets `out` to the direction, scaled to a length of 1. If the direction has the length 0, does not
 * change `out`. */
static void put_normal(const double direction[3], float out[3])
{
    double length = sqrt(ebpo_vec3_dot(direction, direction));
    for (int k = 0; k < 3 && length > 0; k++)
        out[k] = (float)(direction[k] / length);
}

/* Computes the normals of the polygons on one side of their cells. */
static void light_side(const lighting *l, int side, float *out)
{
    const polygon *p = l->polygons;
    for (uint64_t i = 0; i < l->nodes->node_count; i++) {
        const ebpo_lod_node *node = &l->nodes->nodes[i];
        for (uint32_t k = 0; k < node->polygon_count; k++, p++, out += 3) {
            double direction[3];
            if (p->side != side)
                continue;
            direction_at(l, ebpo_cell_of_octcode(node->octcode), l->corner_of_node[i], p->middle,
                         direction);
            put_normal(direction, out);
        }
    }
}

static ebpo_status lighting_prepare(lighting *l, ebpo_error *error)
{
    uint64_t nodes = l->nodes->node_count, polygons = l->nodes->polygon_count;
    l->polygons = ebpo_alloc(polygons, sizeof *l->polygons);
    l->corner_of_node = ebpo_alloc(nodes, sizeof *l->corner_of_node);
    if (l->polygons && l->corner_of_node && number_corners(l))
        l->sum = ebpo_alloc(l->corner_count, sizeof *l->sum);
    return l->sum ? EBPO_OK
                  : ebpo_fail_memory(error,
                                     polygons * sizeof *l->polygons +
                                         nodes * (sizeof *l->corner_of_node + 8 * sizeof *l->sum));
}

/* Checks that the mesh has as many triangles as the polygons of the nodes. */
static ebpo_status check_nodes(const ebpo_mesh *mesh, const ebpo_lod_nodes *nodes,
                               ebpo_error *error)
{
    uint64_t triangles = 0;
    if (!mesh->xyz64 && mesh->face_count)
        return ebpo_fail(error, EBPO_E_ARGUMENT,
                         "the mesh has float coordinates, but meshes of levels have doubles; pass "
                         "the mesh that ebpo_lod_level_nodes returned with these nodes");
    for (uint64_t i = 0; i < nodes->polygon_count; i++)
        triangles += nodes->corners[i] - 2u;
    if (triangles == mesh->face_count)
        return EBPO_OK;
    return ebpo_fail(error, EBPO_E_ARGUMENT,
                     "the nodes have %llu triangles, but the mesh has %llu; pass nodes "
                     "and mesh of one level",
                     (unsigned long long)triangles, (unsigned long long)mesh->face_count);
}

ebpo_status ebpo_lod_normals(const ebpo_info *info, const ebpo_mesh *mesh,
                             const ebpo_lod_nodes *nodes, float *out, ebpo_error *error)
{
    lighting l = { .box = ebpo_root_box(info), .nodes = nodes };
    ebpo_status status = check_nodes(mesh, nodes, error);
    if (status == EBPO_OK)
        status = lighting_prepare(&l, error);
    (void)frexp(fmax(l.box.size[0], fmax(l.box.size[1], l.box.size[2])), &l.exponent);
    if (status == EBPO_OK) {
        describe_polygons(&l, mesh);
        memset(out, 0, nodes->polygon_count * 3 * sizeof *out);
        for (uint64_t i = 0; i < nodes->polygon_count; i++)
            put_normal(l.polygons[i].area, out + 3 * i);
    }
    for (int side = 0; side < SIDES && status == EBPO_OK; side++) {
        sum_side(&l, side);
        light_side(&l, side, out);
    }
    free(l.polygons);
    free(l.corner_of_node);
    free(l.keys);
    free(l.sum);
    return status;
}
