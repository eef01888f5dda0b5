#include "shapes.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "noise.h"

static bool allocate(ebpo_mesh *out, uint64_t vertices, uint64_t faces)
{
    memset(out, 0, sizeof *out);
    if (vertices > UINT32_MAX - 1 || faces > UINT32_MAX - 1)
        return false;
    out->vertex_count = vertices;
    out->face_count = faces;
    out->xyz32 = malloc(vertices * 3 * sizeof *out->xyz32);
    out->faces = malloc(faces * 3 * sizeof *out->faces);
    if (out->xyz32 && out->faces)
        return true;
    ebpo_mesh_free(out);
    return false;
}

static void set3(float *p, double x, double y, double z)
{
    p[0] = (float)x, p[1] = (float)y, p[2] = (float)z;
}

bool ebpo_make_icosahedron(ebpo_mesh *out)
{
    static const uint32_t faces[20][3] = {
        /* 0 is the north pole, 11 the south pole, 1-5 and 6-10 two rings */
        { 0, 1, 2 },  { 0, 2, 3 },  { 0, 3, 4 },  { 0, 4, 5 },   { 0, 5, 1 },
        { 1, 6, 2 },  { 2, 6, 7 },  { 2, 7, 3 },  { 3, 7, 8 },   { 3, 8, 4 },
        { 4, 8, 9 },  { 4, 9, 5 },  { 5, 9, 10 }, { 5, 10, 1 },  { 1, 10, 6 },
        { 6, 11, 7 }, { 7, 11, 8 }, { 8, 11, 9 }, { 9, 11, 10 }, { 10, 11, 6 }
    };
    if (!allocate(out, 12, 20))
        return false;
    memcpy(out->faces, faces, sizeof faces);
    const double height = 1 / sqrt(5), ring = 2 / sqrt(5);
    set3(out->xyz32, 0, 0, 1);
    set3(out->xyz32 + 3 * 11, 0, 0, -1);
    for (int i = 0; i < 5; i++) {
        double c, s;
        ebpo_circle(i / 5.0, &c, &s);
        set3(out->xyz32 + 3 * (1 + i), ring * c, ring * s, height);
        ebpo_circle((i + 0.5) / 5.0, &c, &s);
        set3(out->xyz32 + 3 * (6 + i), ring * c, ring * s, -height);
    }
    return true;
}

bool ebpo_make_torus(ebpo_mesh *out, uint32_t n, uint32_t m)
{
    if (!allocate(out, (uint64_t)n * m, 2 * (uint64_t)n * m))
        return false;
    float *p = out->xyz32;
    uint32_t *f = out->faces;
    for (uint32_t i = 0; i < n; i++) {
        double ac, as, bc, bs;
        ebpo_circle((double)i / n, &ac, &as);
        for (uint32_t j = 0; j < m; j++, p += 3, f += 6) {
            ebpo_circle((double)j / m, &bc, &bs);
            double r = 1 + 0.4 * bc;
            set3(p, r * ac, r * as, 0.4 * bs);
            uint32_t i1 = i + 1 == n ? 0 : i + 1, j1 = j + 1 == m ? 0 : j + 1;
            uint32_t a = i * m + j, b = i1 * m + j, c = i1 * m + j1, d = i * m + j1;
            uint32_t two[6] = { a, b, c, a, c, d };
            memcpy(f, two, sizeof two);
        }
    }
    return true;
}

/* Hash table of the midpoints of edges: open addressing, at most 3/4 full. */
typedef struct midpoints {
    uint64_t *keys;
    uint32_t *vertices;
    uint64_t mask;
} midpoints;

static uint32_t midpoint(midpoints *t, ebpo_mesh *out, uint32_t a, uint32_t b)
{
    uint64_t key = a < b ? (uint64_t)a << 32 | b : (uint64_t)b << 32 | a,
             h = key * 0x9e3779b97f4a7c15u;
    for (h = (h ^ h >> 32) & t->mask; t->keys[h] && t->keys[h] != key; h = (h + 1) & t->mask)
        ;
    /* 0 marks a free slot; no key is 0, because the higher vertex of an edge is at least 1 */
    if (!t->keys[h]) {
        const float *p = out->xyz32 + 3 * (uint64_t)a, *q = out->xyz32 + 3 * (uint64_t)b;
        t->keys[h] = key;
        t->vertices[h] = (uint32_t)out->vertex_count;
        set3(out->xyz32 + 3 * out->vertex_count++, ((double)p[0] + q[0]) / 2,
             ((double)p[1] + q[1]) / 2, ((double)p[2] + q[2]) / 2);
    }
    return t->vertices[h];
}

static void cut_faces(const ebpo_mesh *mesh, ebpo_mesh *out, midpoints *t)
{
    uint32_t *to = out->faces;
    for (uint64_t f = 0; f < mesh->face_count; f++, to += 12) {
        const uint32_t *v = mesh->faces + 3 * f;
        uint32_t a = midpoint(t, out, v[0], v[1]), b = midpoint(t, out, v[1], v[2]),
                 c = midpoint(t, out, v[2], v[0]);
        uint32_t four[12] = { v[0], a, c, a, v[1], b, c, b, v[2], a, b, c };
        memcpy(to, four, sizeof four);
    }
}

bool ebpo_subdivide(ebpo_mesh *mesh)
{
    ebpo_mesh out;
    midpoints t = { .mask = 15 };
    uint64_t max_edges = 3 * mesh->face_count / 2; /* each edge is used at least twice */
    while (t.mask * 3 / 4 < max_edges)
        t.mask = 2 * t.mask + 1;
    if (!allocate(&out, mesh->vertex_count + max_edges, 4 * mesh->face_count))
        return false;
    out.vertex_count = mesh->vertex_count;
    memcpy(out.xyz32, mesh->xyz32, mesh->vertex_count * 3 * sizeof *out.xyz32);
    t.keys = calloc(t.mask + 1, sizeof *t.keys);
    t.vertices = malloc((t.mask + 1) * sizeof *t.vertices);
    bool ok = t.keys && t.vertices;
    if (ok) {
        cut_faces(mesh, &out, &t);
        ebpo_mesh_free(mesh);
        *mesh = out;
        float *smaller = realloc(mesh->xyz32, mesh->vertex_count * 3 * sizeof *smaller);
        mesh->xyz32 = smaller ? smaller : mesh->xyz32;
    } else {
        ebpo_mesh_free(&out);
    }
    free(t.keys);
    free(t.vertices);
    return ok;
}

void ebpo_to_unit_sphere(ebpo_mesh *mesh)
{
    for (uint64_t v = 0; v < mesh->vertex_count; v++) {
        float *p = mesh->xyz32 + 3 * v;
        double x = p[0], y = p[1], z = p[2], length = sqrt(x * x + y * y + z * z);
        set3(p, x / length, y / length, z / length);
    }
}

/* Sums over the faces around a vertex. Each face adds its two edges at the vertex. */
typedef struct vertex_sums {
    float normal[3]; /* sum of unit normals */
    float length;    /* sum of the lengths of these edges */
    uint32_t edges;
} vertex_sums;

static void sum_faces(const ebpo_mesh *mesh, vertex_sums *all)
{
    for (uint64_t f = 0; f < mesh->face_count; f++) {
        const uint32_t *v = mesh->faces + 3 * f;
        double e[3][3], n[3], length[3];
        for (int k = 0; k < 3; k++) {
            const float *p = mesh->xyz32 + 3 * (uint64_t)v[k],
                        *q = mesh->xyz32 + 3 * (uint64_t)v[(k + 1) % 3];
            for (int i = 0; i < 3; i++)
                e[k][i] = (double)q[i] - p[i];
            length[k] = sqrt(e[k][0] * e[k][0] + e[k][1] * e[k][1] + e[k][2] * e[k][2]);
        }
        n[0] = e[0][1] * e[1][2] - e[0][2] * e[1][1];
        n[1] = e[0][2] * e[1][0] - e[0][0] * e[1][2];
        n[2] = e[0][0] * e[1][1] - e[0][1] * e[1][0];
        double size = sqrt(n[0] * n[0] + n[1] * n[1] + n[2] * n[2]);
        for (int k = 0; k < 3; k++) {
            vertex_sums *a = &all[v[k]];
            for (int i = 0; i < 3 && size > 0; i++)
                a->normal[i] += (float)(n[i] / size);
            a->length += (float)(length[k] + length[(k + 2) % 3]);
            a->edges += 2;
        }
    }
}

static double extent(const ebpo_mesh *mesh)
{
    double low[3] = { INFINITY, INFINITY, INFINITY }, high[3] = { -INFINITY, -INFINITY, -INFINITY },
           longest = 0;
    for (uint64_t v = 0; v < mesh->vertex_count; v++)
        for (int k = 0; k < 3; k++) {
            double x = mesh->xyz32[3 * v + (unsigned)k];
            low[k] = x < low[k] ? x : low[k];
            high[k] = x > high[k] ? x : high[k];
        }
    for (int k = 0; k < 3; k++)
        longest = high[k] - low[k] > longest ? high[k] - low[k] : longest;
    return longest;
}

/* Returns the shortest wavelength that a model of this mean edge length can represent smoothly. */
static double fine_wave(const vertex_sums *all, uint64_t count)
{
    double sum = 0;
    uint64_t edges = 0;
    for (uint64_t v = 0; v < count; v++) {
        sum += all[v].length;
        edges += all[v].edges;
    }
    return edges ? 6 * sum / (double)edges : 1;
}

bool ebpo_displace(ebpo_mesh *mesh, double relief, double roughness, uint64_t seed)
{
    vertex_sums *all = calloc(mesh->vertex_count ? mesh->vertex_count : 1, sizeof *all);
    if (!all)
        return false;
    sum_faces(mesh, all);
    double size = extent(mesh), fine = fine_wave(all, mesh->vertex_count);
    for (uint64_t v = 0; v < mesh->vertex_count; v++) {
        const vertex_sums *a = &all[v];
        float *p = mesh->xyz32 + 3 * v;
        double at[3] = { p[0], p[1], p[2] }, n[3] = { a->normal[0], a->normal[1], a->normal[2] };
        double length = sqrt(n[0] * n[0] + n[1] * n[1] + n[2] * n[2]), displacement = 0;
        if (!(length > 0) || a->edges == 0)
            continue;
        if (relief > 0)
            displacement += relief * ebpo_noise_octaves(at, size / 4, size / 32, seed);
        if (roughness > 0)
            displacement += roughness * a->length / a->edges *
                            ebpo_noise_octaves(at, 4 * fine, fine, seed + 100);
        set3(p, at[0] + displacement * n[0] / length, at[1] + displacement * n[1] / length,
             at[2] + displacement * n[2] / length);
    }
    free(all);
    return true;
}
