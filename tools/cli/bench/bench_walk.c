/* Simulates a walk along the surface of a mesh, which returns the points of a continuous path. The
 * walk has a position in a face, and a direction in the plane of this face. */
#include "cli/bench/bench_walk.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

/* HOPS_MAX: maximum number of edges that one step crosses. SWING_STEPS: steps of one swing to both
 * sides of the surface. */
enum { HOPS_MAX = 100, SWING_STEPS = 1000 };

typedef struct walker {
    const ebpo_mesh *mesh;
    uint64_t *face_begin;   /* [vertex_count + 1] offsets into `vertex_faces` */
    uint32_t *vertex_faces; /* faces around each vertex */
    uint64_t random;
    uint64_t face;
    double corner[3][3], n[3]; /* corners of the face; unit normal */
    double p[3], d[3];         /* position; direction, a unit vector in the plane of the face */
    double turn;               /* radians per step, to the left */
    double side[3];            /* unit vector: mean of the normals along the path, smoothed */
} walker;

uint64_t bench_random(uint64_t *state)
{
    uint64_t z = *state += UINT64_C(0x9e3779b97f4a7c15);
    z = (z ^ z >> 30) * UINT64_C(0xbf58476d1ce4e5b9);
    z = (z ^ z >> 27) * UINT64_C(0x94d049bb133111eb);
    return z ^ z >> 31;
}

double bench_random_unit(uint64_t *state) { return (double)(bench_random(state) >> 11) * 0x1p-53; }

/* --- vectors --- */

static double dot_product(const double a[3], const double b[3])
{
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

static void cross_product(const double a[3], const double b[3], double out[3])
{
    out[0] = a[1] * b[2] - a[2] * b[1];
    out[1] = a[2] * b[0] - a[0] * b[2];
    out[2] = a[0] * b[1] - a[1] * b[0];
}

static void subtract_vectors(const double a[3], const double b[3], double out[3])
{
    for (int k = 0; k < 3; k++)
        out[k] = a[k] - b[k];
}

/* v += s w */
static void add_scaled(double v[3], double s, const double w[3])
{
    for (int k = 0; k < 3; k++)
        v[k] += s * w[k];
}

/* Makes the vector a unit vector. Returns false if it is 0 or not finite. */
static bool normalise_vector(double v[3])
{
    double most = fmax(fabs(v[0]), fmax(fabs(v[1]), fabs(v[2])));
    if (!(most > 0) || !isfinite(most))
        return false;
    for (int k = 0; k < 3; k++)
        v[k] /= most; /* so that squares neither vanish nor overflow */
    double length = sqrt(dot_product(v, v));
    for (int k = 0; k < 3; k++)
        v[k] /= length;
    return true;
}

/* --- the mesh --- */

static bool index_vertices(walker *w)
{
    const ebpo_mesh *m = w->mesh;
    uint64_t corners = 3 * m->face_count;
    w->face_begin = calloc(m->vertex_count + 2, sizeof *w->face_begin);
    w->vertex_faces = malloc(corners * sizeof *w->vertex_faces);
    if (!w->face_begin || !w->vertex_faces)
        return false;
    for (uint64_t i = 0; i < corners; i++)
        w->face_begin[m->faces[i] + 2]++;
    for (uint64_t v = 2; v < m->vertex_count + 2; v++)
        w->face_begin[v] += w->face_begin[v - 1];
    for (uint64_t i = 0; i < corners; i++)
        w->vertex_faces[w->face_begin[m->faces[i] + 1]++] = (uint32_t)(i / 3);
    return true;
}

static void read_vertex(const ebpo_mesh *m, uint32_t number, double out[3])
{
    for (int k = 0; k < 3; k++)
        out[k] = m->xyz32 ? (double)m->xyz32[3 * (uint64_t)number + (unsigned)k]
                          : m->xyz64[3 * (uint64_t)number + (unsigned)k];
}

/* Returns the corner of `face` (0 to 2) at which the edge from vertex a to vertex b starts; -1: the
 * face has no such edge. If `any`, an edge from b to a counts, too. */
static int edge_corner(const ebpo_mesh *m, uint64_t face, uint32_t a, uint32_t b, bool any)
{
    const uint32_t *f = m->faces + 3 * face;
    for (int i = 0; i < 3; i++)
        if ((f[i] == a && f[(i + 1) % 3] == b) || (any && f[i] == b && f[(i + 1) % 3] == a))
            return i;
    return -1;
}

/* The walk's face has an edge from vertex a to vertex b. Returns another face at this edge, or
 * UINT64_MAX if there is none. Prefers a face whose edge leads from b to a. *third: the vertex of
 * the returned face that is neither a nor b. */
static uint64_t find_neighbour(const walker *w, uint32_t a, uint32_t b, uint32_t *third)
{
    for (int any = 0; any < 2; any++)
        for (uint64_t i = w->face_begin[a]; i < w->face_begin[a + 1]; i++) {
            uint64_t face = w->vertex_faces[i];
            int at = face == w->face ? -1 : edge_corner(w->mesh, face, b, a, any);
            if (at >= 0) {
                *third = w->mesh->faces[3 * face + (unsigned)(at + 2) % 3];
                return face;
            }
        }
    return UINT64_MAX;
}

/* --- the walk --- */

/* Sets the face of the walk. Returns false if the face has no area. */
static bool enter_face(walker *w, uint64_t face)
{
    double e0[3], e1[3];
    w->face = face;
    for (int i = 0; i < 3; i++)
        read_vertex(w->mesh, w->mesh->faces[3 * face + (unsigned)i], w->corner[i]);
    subtract_vectors(w->corner[1], w->corner[0], e0);
    subtract_vectors(w->corner[2], w->corner[0], e1);
    cross_product(e0, e1, w->n);
    return normalise_vector(w->n);
}

/* Moves the walk to the middle of its face. The first edge of the face becomes the direction. */
static void place_on_face(walker *w)
{
    for (int k = 0; k < 3; k++)
        w->p[k] = w->corner[0][k] / 3 + w->corner[1][k] / 3 + w->corner[2][k] / 3;
    subtract_vectors(w->corner[1], w->corner[0], w->d);
    normalise_vector(w->d);
}

/* Moves to a random face with an area. Returns false if a thousand faces have no area. */
static bool place_randomly(walker *w)
{
    for (int i = 0; i < 1000; i++)
        if (enter_face(w, bench_random(&w->random) % w->mesh->face_count)) {
            place_on_face(w);
            return true;
        }
    return false;
}

/* Returns the distance to the edge i of the face in the direction of the walk; infinity: the walk
 * leads away from the edge. *inward: unit normal of the edge in the plane of the face. */
static double edge_distance(const walker *w, int i, double inward[3])
{
    double edge[3], from[3];
    subtract_vectors(w->corner[(i + 1) % 3], w->corner[i], edge);
    cross_product(w->n, edge, inward);
    if (!normalise_vector(inward))
        return INFINITY;
    subtract_vectors(w->p, w->corner[i], from);
    double rate = dot_product(w->d, inward);
    return rate < 0 ? fmax(0, dot_product(from, inward) / -rate) : INFINITY;
}

/* Crosses the edge i as if the two faces were in one plane; turns back at the end of the surface.
 */
static bool cross_edge(walker *w, int i)
{
    const uint32_t *f = w->mesh->faces + 3 * w->face;
    uint32_t third = 0;
    double edge[3], inward[3];
    uint64_t next = find_neighbour(w, f[i], f[(i + 1) % 3], &third);
    if (next == UINT64_MAX) {
        edge_distance(w, i, inward);
        add_scaled(w->d, -2 * dot_product(w->d, inward), inward);
        return normalise_vector(w->d);
    }
    double origin[3] = { w->corner[i][0], w->corner[i][1], w->corner[i][2] };
    subtract_vectors(w->corner[(i + 1) % 3], origin, edge);
    if (!normalise_vector(edge) || !enter_face(w, next))
        return place_randomly(w);
    read_vertex(w->mesh, third, inward);
    subtract_vectors(inward, origin, inward);
    add_scaled(inward, -dot_product(inward, edge), edge);
    if (!normalise_vector(inward))
        return place_randomly(w);
    double along = dot_product(w->d, edge), across = sqrt(fmax(0, 1 - along * along));
    for (int k = 0; k < 3; k++)
        w->d[k] = along * edge[k] + across * inward[k];
    return normalise_vector(w->d) || place_randomly(w);
}

/* Moves along the surface by the length `remaining`. Returns false if no face has an area. */
static bool advance_walker(walker *w, double remaining)
{
    for (int hop = 0; hop < HOPS_MAX; hop++) {
        int nearest = 0;
        double distance = INFINITY, ignored[3];
        for (int i = 0; i < 3; i++) {
            double to_edge = edge_distance(w, i, ignored);
            if (to_edge < distance) {
                distance = to_edge;
                nearest = i;
            }
        }
        double length = fmin(distance, remaining);
        add_scaled(w->p, length, w->d);
        remaining -= length;
        if (!(remaining > 0) || isinf(distance))
            return true;
        if (!cross_edge(w, nearest))
            return false;
    }
    place_on_face(w); /* the walk circles around a vertex */
    return true;
}

/* Changes the direction slowly and at random, and updates the smoothed normal. */
static void turn_walker(walker *w)
{
    double left[3], off[3];
    w->turn = 0.99 * w->turn + 0.0005 * (bench_random_unit(&w->random) - 0.5);
    cross_product(w->n, w->d, left);
    add_scaled(w->d, w->turn, left);
    add_scaled(w->d, -dot_product(w->d, w->n), w->n);
    if (!normalise_vector(w->d))
        place_on_face(w);
    subtract_vectors(w->p, w->corner[0], off);
    add_scaled(w->p, -dot_product(off, w->n),
               w->n); /* keeps p in the face's plane in spite of rounding errors */
    for (int k = 0; k < 3; k++)
        w->side[k] = 0.95 * w->side[k] + 0.05 * w->n[k];
    if (!normalise_vector(w->side))
        memcpy(w->side, w->n, sizeof w->side);
}

/* Returns a value from -1 to 1, like a sine, but with a period of 1. */
static double wave_height(double phase)
{
    double x = 2 * phase - 1;
    return 4 * x * (1 - fabs(x));
}

bool bench_walk(const ebpo_mesh *mesh, double mean_edge, double diagonal, uint64_t seed,
                uint64_t count, double *out)
{
    walker w = { .mesh = mesh, .random = seed };
    double step = mean_edge > 0 ? mean_edge / 10 : diagonal / 1000;
    bool placed = index_vertices(&w);
    if (placed && (placed = place_randomly(&w)))
        memcpy(w.side, w.n, sizeof w.side);
    for (uint64_t i = 0; i < count && placed; i++) {
        double swing = 0.01 * diagonal * wave_height((double)(i % SWING_STEPS) / SWING_STEPS);
        for (int k = 0; k < 3; k++)
            out[3 * i + (unsigned)k] = w.p[k] + swing * w.side[k];
        placed = advance_walker(&w, step);
        turn_walker(&w);
    }
    free(w.face_begin);
    free(w.vertex_faces);
    return placed;
}
