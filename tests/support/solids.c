#include "solids.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#define PI 3.14159265358979323846

static void *checked(void *block)
{
    if (!block) {
        fprintf(stderr, "out of memory in a test solid\n");
        abort();
    }
    return block;
}

/* ---- building ---- */

static uint32_t vertex(ebpo_mesh *m, double x, double y, double z)
{
    if ((m->vertex_count & (m->vertex_count - 1)) == 0) /* arrays are full at each power of two */
        m->xyz64 = checked(
            realloc(m->xyz64, (m->vertex_count ? 2 * m->vertex_count : 1) * 3 * sizeof *m->xyz64));
    double *p = m->xyz64 + 3 * m->vertex_count;
    p[0] = x, p[1] = y, p[2] = z;
    return (uint32_t)m->vertex_count++;
}

static void face(ebpo_mesh *m, uint32_t a, uint32_t b, uint32_t c)
{
    if ((m->face_count & (m->face_count - 1)) == 0)
        m->faces = checked(
            realloc(m->faces, (m->face_count ? 2 * m->face_count : 1) * 3 * sizeof *m->faces));
    uint32_t *f = m->faces + 3 * m->face_count++;
    f[0] = a, f[1] = b, f[2] = c;
}

/* Adds the two faces of a quadrilateral; a, b, c, d are counter-clockwise. */
static void quad(ebpo_mesh *m, uint32_t a, uint32_t b, uint32_t c, uint32_t d)
{
    face(m, a, b, c);
    face(m, a, c, d);
}

static ebpo_mesh empty(void)
{
    ebpo_mesh m;
    memset(&m, 0, sizeof m);
    return m;
}

/* ---- tools ---- */

uint64_t ebpo_test_random(uint64_t *state)
{
    uint64_t z = *state += 0x9e3779b97f4a7c15u;
    z = (z ^ z >> 30) * 0xbf58476d1ce4e5b9u;
    z = (z ^ z >> 27) * 0x94d049bb133111ebu;
    return z ^ z >> 31;
}

double ebpo_test_scale(void)
{
    const char *text = getenv("EBPO_TEST_SCALE");
    return text ? atof(text) : 1;
}

uint64_t ebpo_test_scaled(uint64_t count)
{
    double n = (double)count * ebpo_test_scale();
    return n >= 1 ? (uint64_t)n : 1;
}

bool ebpo_test_wanted(int turn)
{
    double s = ebpo_test_scale();
    return s >= 1 || turn == 0 || (long)(turn * s) != (long)((turn - 1) * s);
}

double ebpo_test_random_unit(uint64_t *state)
{
    return (double)(ebpo_test_random(state) >> 11) * 0x1p-53;
}

void ebpo_test_circle(uint32_t i, uint32_t n, double *cosine, double *sine)
{
    /* the turn is between eighth / 8 and that + 1/8; odd eighths are measured from their end */
    uint64_t eighth = 8 * (uint64_t)(i % n) / n, odd = eighth % 2;
    double part = odd ? (double)((eighth + 1) * n - 8 * (uint64_t)(i % n))
                      : (double)(8 * (uint64_t)(i % n) - eighth * n);
    double x = part / n * (PI / 4), x2 = x * x, c = 0, s = 0;
    for (int k = 20; k > 0; k -= 2) { /* Taylor series, from the smallest term */
        c = (1 + c) * (-x2 / (k * (k - 1)));
        s = (1 + s) * (-x2 / (k * (k + 1)));
    }
    c = 1 + c, s = odd ? -x * (1 + s) : x * (1 + s);
    switch ((eighth + odd) / 2 % 4) {
    case 0: *cosine = c, *sine = s; break;
    case 1: *cosine = -s, *sine = c; break;
    case 2: *cosine = -c, *sine = -s; break;
    default: *cosine = s, *sine = -c; break;
    }
}

void ebpo_test_point(const ebpo_mesh *m, uint64_t v, double out[3])
{
    for (int k = 0; k < 3; k++)
        out[k] = m->xyz32 ? (double)m->xyz32[3 * v + (unsigned)k] : m->xyz64[3 * v + (unsigned)k];
}

/* Allocates the powers of two for the counts: vertex and face allocate only at powers of two. */
static void regrow(ebpo_mesh *m, uint64_t vertices, uint64_t faces)
{
    uint64_t v = 1, f = 1;
    while (v < vertices)
        v *= 2;
    while (f < faces)
        f *= 2;
    m->xyz64 = checked(realloc(m->xyz64, v * 3 * sizeof *m->xyz64));
    m->faces = checked(realloc(m->faces, f * 3 * sizeof *m->faces));
}

void ebpo_test_append(ebpo_mesh *m, const ebpo_mesh *other)
{
    regrow(m, m->vertex_count + other->vertex_count, m->face_count + other->face_count);
    for (uint64_t v = 0; v < other->vertex_count; v++)
        ebpo_test_point(other, v, m->xyz64 + 3 * (m->vertex_count + v));
    for (uint64_t i = 0; i < 3 * other->face_count; i++)
        m->faces[3 * m->face_count + i] = other->faces[i] + (uint32_t)m->vertex_count;
    m->vertex_count += other->vertex_count;
    m->face_count += other->face_count;
}

void ebpo_test_append_face(ebpo_mesh *m, uint32_t a, uint32_t b, uint32_t c)
{
    m->faces = checked(realloc(m->faces, (m->face_count + 1) * 3 * sizeof *m->faces));
    uint32_t *f = m->faces + 3 * m->face_count++;
    f[0] = a, f[1] = b, f[2] = c;
}

uint32_t ebpo_test_append_vertex(ebpo_mesh *m, double x, double y, double z)
{
    m->xyz64 = checked(realloc(m->xyz64, (m->vertex_count + 1) * 3 * sizeof *m->xyz64));
    double *p = m->xyz64 + 3 * m->vertex_count;
    p[0] = x, p[1] = y, p[2] = z;
    return (uint32_t)m->vertex_count++;
}

void ebpo_test_turn_face(ebpo_mesh *m, uint64_t face_number)
{
    uint32_t *f = m->faces + 3 * face_number, t = f[1];
    f[1] = f[2];
    f[2] = t;
}

void ebpo_test_reverse(ebpo_mesh *m)
{
    for (uint64_t f = 0; f < m->face_count; f++)
        ebpo_test_turn_face(m, f);
}

void ebpo_test_to_float(ebpo_mesh *m)
{
    if (m->xyz32)
        return;
    m->xyz32 = checked(malloc((m->vertex_count + 1) * 3 * sizeof *m->xyz32));
    for (uint64_t i = 0; i < 3 * m->vertex_count; i++)
        m->xyz32[i] = (float)m->xyz64[i];
    free(m->xyz64);
    m->xyz64 = NULL;
}

void ebpo_test_transform(ebpo_mesh *m, const double matrix[3][3], const double offset[3])
{
    for (uint64_t v = 0; v < m->vertex_count; v++) {
        double *p = m->xyz64 + 3 * v, q[3];
        for (int k = 0; k < 3; k++)
            q[k] = matrix[k][0] * p[0] + matrix[k][1] * p[1] + matrix[k][2] * p[2] + offset[k];
        memcpy(p, q, sizeof q);
    }
}

static uint32_t *permutation(uint64_t n, uint64_t *state)
{
    uint32_t *p = checked(malloc((n + 1) * sizeof *p));
    for (uint64_t i = 0; i < n; i++)
        p[i] = (uint32_t)i;
    for (uint64_t i = n; i > 1; i--) {
        uint64_t j = ebpo_test_random(state) % i;
        uint32_t t = p[i - 1];
        p[i - 1] = p[j];
        p[j] = t;
    }
    return p;
}

void ebpo_test_shuffle(ebpo_mesh *m, uint64_t seed)
{
    size_t size = 3 * (m->xyz32 ? sizeof *m->xyz32 : sizeof *m->xyz64);
    char *from = m->xyz32 ? (char *)m->xyz32 : (char *)m->xyz64,
         *to = checked(malloc(m->vertex_count * size + 1));
    uint32_t *vertices = permutation(m->vertex_count, &seed),
             *order = permutation(m->face_count, &seed);
    uint32_t *faces = checked(malloc((m->face_count * 3 + 1) * sizeof *faces));
    for (uint64_t v = 0; v < m->vertex_count; v++)
        memcpy(to + vertices[v] * size, from + v * size, size);
    for (uint64_t f = 0; f < m->face_count; f++) {
        unsigned shift = (unsigned)(ebpo_test_random(&seed) % 3);
        for (unsigned k = 0; k < 3; k++)
            faces[3 * (uint64_t)order[f] + (k + shift) % 3] = vertices[m->faces[3 * f + k]];
    }
    memcpy(from, to, m->vertex_count * size);
    memcpy(m->faces, faces, m->face_count * 3 * sizeof *faces);
    free(to);
    free(vertices);
    free(order);
    free(faces);
}

void ebpo_test_split_vertices(ebpo_mesh *m)
{
    uint64_t corners = 3 * m->face_count;
    size_t size = 3 * (m->xyz32 ? sizeof *m->xyz32 : sizeof *m->xyz64);
    char *from = m->xyz32 ? (char *)m->xyz32 : (char *)m->xyz64,
         *to = checked(malloc(corners * size + 1));
    for (uint64_t i = 0; i < corners; i++) {
        memcpy(to + i * size, from + m->faces[i] * size, size);
        m->faces[i] = (uint32_t)i;
    }
    free(from);
    if (m->xyz32)
        m->xyz32 = (float *)(void *)to;
    else
        m->xyz64 = (double *)(void *)to;
    m->vertex_count = corners;
}

/* ---- shapes with parameters ---- */

ebpo_mesh ebpo_test_tetrahedron(double size)
{
    ebpo_mesh m = empty();
    uint32_t o = vertex(&m, 0, 0, 0), x = vertex(&m, size, 0, 0), y = vertex(&m, 0, size, 0),
             z = vertex(&m, 0, 0, size);
    face(&m, o, y, x);
    face(&m, o, x, z);
    face(&m, o, z, y);
    face(&m, x, y, z);
    return m;
}

/* Lattice points in a box; each becomes a vertex at its first use. */
typedef struct lattice {
    ebpo_mesh *mesh;
    uint32_t n;
    uint32_t *index; /* [(n + 1)^3], 0: not made yet */
    double low[3], high[3];
} lattice;

static uint32_t lattice_vertex(lattice *l, const uint32_t at[3])
{
    size_t side = (size_t)l->n + 1;
    uint32_t *slot = &l->index[(at[2] * side + at[1]) * side + at[0]];
    double p[3];
    for (int k = 0; k < 3; k++)
        p[k] = at[k] == l->n ? l->high[k] : l->low[k] + (l->high[k] - l->low[k]) * at[k] / l->n;
    if (*slot == 0)
        *slot = vertex(l->mesh, p[0], p[1], p[2]) + 1;
    return *slot - 1;
}

/* Adds the lattice square at `at` across `axis`, facing up or down that axis. */
static void lattice_square(lattice *l, const uint32_t at[3], int axis, bool up)
{
    int u = (axis + 1) % 3, v = (axis + 2) % 3;
    uint32_t c[4], p[3] = { at[0], at[1], at[2] };
    c[0] = lattice_vertex(l, p);
    p[u]++;
    c[1] = lattice_vertex(l, p);
    p[v]++;
    c[2] = lattice_vertex(l, p);
    p[u]--;
    c[3] = lattice_vertex(l, p);
    if (up)
        quad(l->mesh, c[0], c[1], c[2], c[3]);
    else
        quad(l->mesh, c[0], c[3], c[2], c[1]);
}

static lattice lattice_begin(ebpo_mesh *m, uint32_t n, const double low[3], const double high[3])
{
    size_t side = (size_t)n + 1;
    lattice l = { .mesh = m,
                  .n = n,
                  .index = checked(calloc(side * side * side, sizeof(uint32_t))) };
    memcpy(l.low, low, sizeof l.low);
    memcpy(l.high, high, sizeof l.high);
    return l;
}

ebpo_mesh ebpo_test_box(const double low[3], const double high[3], uint32_t n)
{
    ebpo_mesh m = empty();
    lattice l = lattice_begin(&m, n, low, high);
    for (int axis = 0; axis < 3; axis++)
        for (uint32_t i = 0; i < n; i++)
            for (uint32_t j = 0; j < n; j++)
                for (int up = 0; up < 2; up++) {
                    uint32_t at[3];
                    at[axis] = up ? n : 0;
                    at[(axis + 1) % 3] = i;
                    at[(axis + 2) % 3] = j;
                    lattice_square(&l, at, axis, up);
                }
    free(l.index);
    return m;
}

static bool is_filled(const uint8_t *filled, uint32_t n, const uint32_t at[3], int axis, int step)
{
    int64_t p[3] = { at[0], at[1], at[2] };
    p[axis] += step;
    if (p[axis] < 0 || p[axis] >= (int64_t)n)
        return false;
    return filled[((uint64_t)p[2] * n + (uint64_t)p[1]) * n + (uint64_t)p[0]] != 0;
}

ebpo_mesh ebpo_test_voxels(const uint8_t *filled, uint32_t n, double cell)
{
    ebpo_mesh m = empty();
    double low[3] = { 0, 0, 0 }, high[3] = { n * cell, n * cell, n * cell };
    lattice l = lattice_begin(&m, n, low, high);
    uint32_t at[3];
    for (at[2] = 0; at[2] < n; at[2]++)
        for (at[1] = 0; at[1] < n; at[1]++)
            for (at[0] = 0; at[0] < n; at[0]++)
                for (int axis = 0; axis < 3 && is_filled(filled, n, at, 0, 0); axis++) {
                    uint32_t above[3] = { at[0], at[1], at[2] };
                    above[axis]++;
                    if (!is_filled(filled, n, at, axis, -1))
                        lattice_square(&l, at, axis, false);
                    if (!is_filled(filled, n, at, axis, 1))
                        lattice_square(&l, above, axis, true);
                }
    free(l.index);
    return m;
}

/* Splits each face into four. Midpoints of edges are found by a hash table. */
static ebpo_mesh subdivide(const ebpo_mesh *m)
{
    ebpo_mesh out = empty();
    uint64_t slots = 4;
    while (slots < 6 * m->face_count)
        slots *= 2;
    uint64_t *keys = checked(calloc(slots, sizeof *keys));
    uint32_t *middles = checked(calloc(slots, sizeof *middles));
    for (uint64_t v = 0; v < m->vertex_count; v++)
        vertex(&out, m->xyz64[3 * v], m->xyz64[3 * v + 1], m->xyz64[3 * v + 2]);
    for (uint64_t f = 0; f < m->face_count; f++) {
        const uint32_t *v = m->faces + 3 * f;
        uint32_t mid[3];
        for (int k = 0; k < 3; k++) {
            uint32_t a = v[k], b = v[(k + 1) % 3];
            uint64_t key = a < b ? (uint64_t)a << 32 | b : (uint64_t)b << 32 | a,
                     h = key * 0x9e3779b97f4a7c15u >> 20;
            for (h &= slots - 1; keys[h] && keys[h] != key; h = (h + 1) & (slots - 1))
                ;
            if (!keys[h]) {
                const double *p = m->xyz64 + 3 * (uint64_t)a, *q = m->xyz64 + 3 * (uint64_t)b;
                keys[h] = key; /* never 0: the higher end is at least 1 */
                middles[h] = vertex(&out, (p[0] + q[0]) / 2, (p[1] + q[1]) / 2, (p[2] + q[2]) / 2);
            }
            mid[k] = middles[h];
        }
        face(&out, v[0], mid[0], mid[2]);
        face(&out, mid[0], v[1], mid[1]);
        face(&out, mid[2], mid[1], v[2]);
        face(&out, mid[0], mid[1], mid[2]);
    }
    free(keys);
    free(middles);
    return out;
}

static ebpo_mesh icosahedron(void)
{
    static const uint8_t faces[20][3] = { { 0, 11, 5 },  { 0, 5, 1 },  { 0, 1, 7 },  { 0, 7, 10 },
                                          { 0, 10, 11 }, { 1, 5, 9 },  { 5, 11, 4 }, { 11, 10, 2 },
                                          { 10, 7, 6 },  { 7, 1, 8 },  { 3, 9, 4 },  { 3, 4, 2 },
                                          { 3, 2, 6 },   { 3, 6, 8 },  { 3, 8, 9 },  { 4, 9, 5 },
                                          { 2, 4, 11 },  { 6, 2, 10 }, { 8, 6, 7 },  { 9, 8, 1 } };
    const double t = (1 + sqrt(5)) / 2;
    ebpo_mesh m = empty();
    for (int axis = 0; axis < 3; axis++) /* three golden rectangles */
        for (int i = 0; i < 4; i++) {
            double p[3];
            p[(axis + 0) % 3] = i & 1 ? 1 : -1;
            p[(axis + 1) % 3] = i & 2 ? -t : t;
            p[(axis + 2) % 3] = 0;
            vertex(&m, p[0], p[1], p[2]);
        }
    /* axis 0: (-+1, +-t, 0); axis 1: (0, -+1, +-t); axis 2: (+-t, 0, -+1) */
    for (int f = 0; f < 20; f++)
        face(&m, faces[f][0], faces[f][1], faces[f][2]);
    return m;
}

ebpo_mesh ebpo_test_sphere(const double centre[3], double radius, uint32_t subdivisions)
{
    ebpo_mesh m = icosahedron();
    for (uint32_t s = 0; s < subdivisions; s++) {
        ebpo_mesh finer = subdivide(&m);
        ebpo_mesh_free(&m);
        m = finer;
    }
    for (uint64_t v = 0; v < m.vertex_count; v++) {
        double *p = m.xyz64 + 3 * v, scale = radius / sqrt(p[0] * p[0] + p[1] * p[1] + p[2] * p[2]);
        for (int k = 0; k < 3; k++)
            p[k] = centre[k] + p[k] * scale;
    }
    return m;
}

ebpo_mesh ebpo_test_torus(double radius, double tube, uint32_t n, uint32_t m)
{
    ebpo_mesh out = empty();
    for (uint32_t i = 0; i < n; i++)
        for (uint32_t j = 0; j < m; j++) {
            double ca, sa, cb, sb;
            ebpo_test_circle(i, n, &ca, &sa);
            ebpo_test_circle(j, m, &cb, &sb);
            double r = radius + tube * cb;
            vertex(&out, r * ca, r * sa, tube * sb);
        }
    for (uint32_t i = 0; i < n; i++)
        for (uint32_t j = 0; j < m; j++) {
            uint32_t i1 = (i + 1) % n, j1 = (j + 1) % m;
            quad(&out, i * m + j, i1 * m + j, i1 * m + j1, i * m + j1);
        }
    return out;
}

ebpo_mesh ebpo_test_cone(double radius, double height, uint32_t n)
{
    ebpo_mesh m = empty();
    uint32_t base = vertex(&m, 0, 0, 0), apex = vertex(&m, 0, 0, height);
    for (uint32_t i = 0; i < n; i++) {
        double c, s;
        ebpo_test_circle(i, n, &c, &s);
        vertex(&m, radius * c, radius * s, 0);
    }
    for (uint32_t i = 0; i < n; i++) {
        face(&m, 2 + i, 2 + (i + 1) % n, apex);
        face(&m, 2 + (i + 1) % n, 2 + i, base);
    }
    return m;
}

ebpo_mesh ebpo_test_tetrahedra(uint32_t count)
{
    ebpo_mesh m = empty();
    uint32_t side = 1;
    while (side * side * side < count)
        side++;
    for (uint32_t i = 0; i < count; i++) {
        double x = 2 * (i % side), y = 2 * (i / side % side), z = 2 * (i / side / side);
        uint32_t o = vertex(&m, x, y, z), a = vertex(&m, x + 1, y, z), b = vertex(&m, x, y + 1, z);
        uint32_t c = vertex(&m, x, y, z + 1);
        face(&m, o, b, a);
        face(&m, o, a, c);
        face(&m, o, c, b);
        face(&m, a, b, c);
    }
    return m;
}

ebpo_mesh ebpo_test_blob(uint32_t n, uint32_t percent, uint64_t seed)
{
    size_t cells = (size_t)n * n * n;
    uint8_t *filled = checked(malloc(cells + 1));
    for (size_t i = 0; i < cells; i++)
        filled[i] = ebpo_test_random(&seed) % 100 < percent;
    ebpo_mesh m = ebpo_test_voxels(filled, n, 0.5);
    free(filled);
    return m;
}

ebpo_mesh ebpo_test_staircase(uint32_t n)
{
    uint8_t *filled = checked(calloc((size_t)n * n * n + 1, 1));
    for (uint32_t x = 0; x < n; x++)
        for (uint32_t z = 0; z <= x; z++)
            filled[(size_t)z * n * n + x] = 1;
    ebpo_mesh m = ebpo_test_voxels(filled, n, 1);
    free(filled);
    return m;
}

ebpo_mesh ebpo_test_band(uint32_t n, bool twisted)
{
    ebpo_mesh m = empty();
    for (uint32_t i = 0; i < n; i++) {
        double c, s, c_half = 1, s_half = 0;
        ebpo_test_circle(i, n, &c, &s);
        if (twisted)
            ebpo_test_circle(i, 2 * n, &c_half, &s_half);
        for (int side = -1; side <= 1; side += 2) {
            double r = 2 + side * 0.5 * s_half;
            vertex(&m, r * c, r * s, side * 0.5 * c_half);
        }
    }
    for (uint32_t i = 0; i < n; i++) {
        uint32_t next = (i + 1) % n, swap = twisted && next == 0;
        quad(&m, 2 * i, 2 * next + swap, 2 * next + 1 - swap, 2 * i + 1);
    }
    return m;
}

ebpo_mesh ebpo_test_sheet(double size, uint32_t n)
{
    ebpo_mesh m = empty();
    for (uint32_t y = 0; y <= n; y++)
        for (uint32_t x = 0; x <= n; x++)
            vertex(&m, size * x / n, size * y / n, 0);
    for (uint32_t y = 0; y < n; y++)
        for (uint32_t x = 0; x < n; x++) {
            uint32_t a = y * (n + 1) + x;
            quad(&m, a, a + 1, a + n + 2, a + n + 1);
        }
    return m;
}
