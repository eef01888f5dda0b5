/* Generates the degenerate and ill-conditioned cases. */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "degenerate.h"

/* approximately a rotation, with entries that are exact doubles */
static const double turn[3][3] = { { 0.75, -0.5, 0.4375 },
                                   { 0.5, 0.8125, -0.3125 },
                                   { -0.25, 0.375, 0.8125 } };

static uint32_t vertex(ebpo_mesh *m, double x, double y, double z)
{
    return ebpo_test_append_vertex(m, x, y, z);
}

static void face(ebpo_mesh *m, uint32_t a, uint32_t b, uint32_t c)
{
    ebpo_test_append_face(m, a, b, c);
}

static void add(ebpo_mesh *m, ebpo_mesh other)
{
    ebpo_test_append(m, &other);
    ebpo_mesh_free(&other);
}

static void scale_and_shift(ebpo_mesh *m, double factor, double x, double y, double z)
{
    const double shift[3] = { x, y, z };
    for (uint64_t i = 0; i < 3 * m->vertex_count; i++)
        m->xyz64[i] = m->xyz64[i] * factor + shift[i % 3];
}

static ebpo_mesh box(double x0, double y0, double z0, double x1, double y1, double z1, uint32_t n)
{
    double low[3] = { x0, y0, z0 }, high[3] = { x1, y1, z1 };
    return ebpo_test_box(low, high, n);
}

ebpo_mesh degenerate_named(const degenerate_case *c) { return query_solid_by_name(c->solid); }

ebpo_mesh degenerate_shells(const degenerate_case *c)
{
    ebpo_mesh m = query_solid_by_name("touching_shells");
    scale_and_shift(&m, c->a[0], c->a[2], c->a[2], c->a[2]);
    if (c->a[1] != 0)
        ebpo_test_to_float(&m);
    return m;
}

ebpo_mesh degenerate_torus(const degenerate_case *c)
{
    ebpo_mesh m = ebpo_test_torus(c->a[0], c->a[1], 32, 16);
    const double shift[3] = { c->a[2], -c->a[2], c->a[2] / 4 };
    ebpo_test_transform(&m, turn, shift);
    if (c->a[3] != 0)
        ebpo_test_to_float(&m);
    return m;
}

ebpo_mesh degenerate_ring(const degenerate_case *c)
{
    return ebpo_test_torus(c->a[0], c->a[1], (uint32_t)c->a[2], (uint32_t)c->a[3]);
}

ebpo_mesh degenerate_box(const degenerate_case *c)
{
    return box(0, 0, 0, c->a[0], c->a[1], c->a[2], (uint32_t)c->a[3]);
}

ebpo_mesh degenerate_turned_box(const degenerate_case *c)
{
    static const double nowhere[3] = { 0, 0, 0 };
    ebpo_mesh m = degenerate_box(c);
    ebpo_test_transform(&m, turn, nowhere);
    return m;
}

ebpo_mesh degenerate_sphere(const degenerate_case *c)
{
    double centre[3] = { c->a[2], -c->a[2], c->a[2] / 2 };
    return ebpo_test_sphere(centre, c->a[0], (uint32_t)c->a[1]);
}

ebpo_mesh degenerate_cone(const degenerate_case *c)
{
    return ebpo_test_cone(1, 1, (uint32_t)c->a[0]);
}

/* --- prisms: a profile (x, z) that is completely visible from its first point, along y from 0 to
 * `length` --- */

static ebpo_mesh prism(const double (*profile)[2], uint32_t n, double length)
{
    ebpo_mesh m = { 0 };
    for (uint32_t side = 0; side < 2; side++)
        for (uint32_t i = 0; i < n; i++)
            vertex(&m, profile[i][0], side * length, profile[i][1]);
    for (uint32_t i = 1; i < n; i++) { /* the first point is in the middle, the others
                                          counter-clockwise around it as seen from -y */
        uint32_t j = i + 1 < n ? i + 1 : 1;
        face(&m, 0, i, j);
        face(&m, n, n + j, n + i);
        face(&m, i, n + i, n + j);
        face(&m, i, n + j, j);
    }
    return m;
}

ebpo_mesh degenerate_cylinder(const degenerate_case *c)
{
    uint32_t n = (uint32_t)c->a[0];
    double(*p)[2] = query_alloc(n + 1, sizeof *p);
    p[0][0] = p[0][1] = 0;
    for (uint32_t i = 0; i < n; i++)
        ebpo_test_circle(i, n, &p[i + 1][0], &p[i + 1][1]);
    ebpo_mesh m = prism((const double(*)[2])p, n + 1, 3);
    free(p);
    return m;
}

ebpo_mesh degenerate_dome(const degenerate_case *c)
{
    uint32_t n = (uint32_t)c->a[0];
    double(*p)[2] = query_alloc(n + 4, sizeof *p), step = c->a[1] / n, half = c->a[1] / 2;
    p[0][0] = 0, p[0][1] = -half;
    for (uint32_t i = 0; i <= n; i++) { /* a parabola: slopes grow by equal steps */
        double x = half - i * step;
        p[i + 1][0] = x, p[i + 1][1] = -x * x / 2;
    }
    p[n + 2][0] = -half, p[n + 2][1] = -2 * half;
    p[n + 3][0] = half, p[n + 3][1] = -2 * half;
    ebpo_mesh m = prism((const double(*)[2])p, n + 4, c->a[1]);
    free(p);
    return m;
}

ebpo_mesh degenerate_lantern(const degenerate_case *c)
{
    uint32_t n = (uint32_t)c->a[0], rows = (uint32_t)c->a[1];
    ebpo_mesh m = { 0 };
    for (uint32_t j = 0; j <= rows; j++)
        for (uint32_t i = 0; i < n; i++) {
            double x, y;
            ebpo_test_circle(2 * i + j % 2, 2 * n, &x, &y);
            vertex(&m, x, y, (double)j / rows);
        }
    uint32_t low = vertex(&m, 0, 0, 0), high = vertex(&m, 0, 0, 1);
    for (uint32_t i = 0; i < n; i++) {
        uint32_t next = (i + 1) % n;
        for (uint32_t j = 0; j < rows; j++) {
            uint32_t a = j * n + i, b = j * n + next, up = (j + 1) * n + i,
                     up_next = (j + 1) * n + next;
            if (j % 2 == 0) {
                face(&m, a, b, up);
                face(&m, b, up_next, up);
            } else {
                face(&m, a, b, up_next);
                face(&m, a, up_next, up);
            }
        }
        face(&m, low, next, i);
        face(&m, high, rows * n + i, rows * n + next);
    }
    return m;
}

ebpo_mesh degenerate_wedge(const degenerate_case *c)
{
    uint32_t n = (uint32_t)c->a[0];
    ebpo_mesh m = { 0 };
    uint32_t o = vertex(&m, 0, 0, 0), top = vertex(&m, 0, 0, 1);
    for (uint32_t i = 0; i <= n; i++)
        vertex(&m, 1, i * c->a[1], 0.25);
    for (uint32_t r = 2; r < 2 + n; r++) {
        face(&m, r, r + 1, top);
        face(&m, r + 1, r, o);
    }
    face(&m, o, 2, top);
    face(&m, top, 2 + n, o);
    return m;
}

/* --- meshes with defects --- */

ebpo_mesh degenerate_split_edges(const degenerate_case *c)
{
    double side = 2 * c->a[0];
    ebpo_mesh m = box(0, 0, 0, side, side, side, (uint32_t)c->a[0]);
    uint64_t count = m.face_count;
    for (uint64_t f = 0; f < count; f++) {
        uint32_t a = m.faces[3 * f], b = m.faces[3 * f + 1], corner = m.faces[3 * f + 2];
        const double *p = m.xyz64 + 3 * (uint64_t)a, *q = m.xyz64 + 3 * (uint64_t)b;
        uint32_t middle = vertex(&m, (p[0] + q[0]) / 2, (p[1] + q[1]) / 2, (p[2] + q[2]) / 2);
        m.faces[3 * f + 1] = middle;
        face(&m, middle, b, corner);
        face(&m, a, b, middle);
    }
    return m;
}

ebpo_mesh degenerate_t_junctions(const degenerate_case *c)
{
    ebpo_mesh m = box(0, 0, 0, 1, 1, 1, (uint32_t)c->a[0]);
    uint64_t kept = 0;
    uint32_t corner[4] = { 0 };
    for (uint64_t v = 0; v < m.vertex_count; v++) {
        const double *p = m.xyz64 + 3 * v;
        if (p[2] == 1 && (p[0] == 0 || p[0] == 1) && (p[1] == 0 || p[1] == 1))
            corner[p[1] == 0 ? p[0] == 1 : 3 - (p[0] == 1)] = (uint32_t)v;
    }
    for (uint64_t f = 0; f < m.face_count; f++) {
        bool top = true;
        for (int i = 0; i < 3; i++)
            top &= m.xyz64[3 * (uint64_t)m.faces[3 * f + (uint64_t)i] + 2] == 1;
        if (!top)
            memmove(m.faces + 3 * kept++, m.faces + 3 * f, 3 * sizeof *m.faces);
    }
    m.face_count = kept;
    face(&m, corner[0], corner[1], corner[2]);
    face(&m, corner[0], corner[2], corner[3]);
    return m;
}

ebpo_mesh degenerate_repeated(const degenerate_case *c)
{
    ebpo_mesh m = box(0, 0, 0, 1, 1, 1, 1), again = box(0, 0, 0, 1, 1, 1, 1);
    for (uint32_t i = 1; i < (uint32_t)c->a[0]; i++)
        for (uint64_t f = 0; f < again.face_count; f++)
            face(&m, again.faces[3 * f], again.faces[3 * f + 1], again.faces[3 * f + 2]);
    ebpo_mesh_free(&again);
    return m;
}

ebpo_mesh degenerate_minus_zero(const degenerate_case *c)
{
    ebpo_mesh m = ebpo_test_tetrahedron(c->a[0]);
    for (uint64_t i = 0; i < 3 * m.vertex_count; i++)
        if (m.xyz64[i] == 0)
            m.xyz64[i] = i % 2 ? -0.0 : 0.0;
    return m;
}

ebpo_mesh degenerate_repeated_fan(const degenerate_case *c)
{
    uint32_t n = (uint32_t)c->a[0], times = (uint32_t)c->a[1], ring = n * times;
    ebpo_mesh m = { 0 };
    for (uint32_t i = 0; i < ring; i++) {
        double x, y;
        ebpo_test_circle(i / times, n, &x, &y);
        vertex(&m, x, y, 0);
    }
    uint32_t low = vertex(&m, 0, 0, -1), high = vertex(&m, 0, 0, 1);
    for (uint32_t i = 0; i < ring; i++) {
        face(&m, i, (i + 1) % ring, high);
        face(&m, (i + 1) % ring, i, low);
    }
    return m;
}

ebpo_mesh degenerate_jittered(const degenerate_case *c)
{
    ebpo_mesh m = box(-1, -1, -1, 1, 1, 1, (uint32_t)c->a[0]);
    uint64_t state = 3;
    for (uint64_t i = 0; i < 3 * m.vertex_count; i++)
        m.xyz64[i] = nextafter(m.xyz64[i], ebpo_test_random(&state) % 2 ? INFINITY : -INFINITY);
    return m;
}

ebpo_mesh degenerate_soup(const degenerate_case *c)
{
    ebpo_mesh m = { 0 };
    uint64_t state = 11;
    for (uint32_t f = 0; f < (uint32_t)c->a[0]; f++) {
        double p[3];
        for (int k = 0; k < 3; k++)
            p[k] = ebpo_test_random_unit(&state);
        for (int i = 0; i < 3; i++) {
            double q[3];
            for (int k = 0; k < 3; k++)
                q[k] = p[k] + 0.125 * ebpo_test_random_unit(&state);
            vertex(&m, q[0], q[1], q[2]);
        }
        face(&m, 3 * f, 3 * f + 1, 3 * f + 2);
    }
    return m;
}

ebpo_mesh degenerate_broken(const degenerate_case *c)
{
    ebpo_mesh m = ebpo_test_tetrahedron(1);
    m.xyz64[3] = c->a[0];
    if (c->a[1] != 0)
        m.faces[1] = (uint32_t)c->a[1];
    if (c->a[2] != 0)
        m.face_count = 0;
    return m;
}

ebpo_mesh degenerate_triangle(const degenerate_case *c)
{
    ebpo_mesh m = { 0 };
    vertex(&m, 0.5, 0.5, 0.5);
    vertex(&m, 0.5 + c->a[0], 0.5, 0.5);
    vertex(&m, 0.5, 0.5 + c->a[1], 0.5);
    face(&m, 0, 1, 2);
    return m;
}

/* --- solids of many parts --- */

ebpo_mesh degenerate_staircase(const degenerate_case *c)
{
    uint32_t n = (uint32_t)c->a[0];
    ebpo_mesh m = { 0 };
    /* for each x: the bottom, the lower and the higher end of the riser; on both sides */
    for (uint32_t y = 0; y < 2; y++)
        for (uint32_t x = 0; x <= n; x++) {
            vertex(&m, x, y, 0);
            vertex(&m, x, y, x);
            vertex(&m, x, y, x < n ? x + 1 : x);
        }
    uint32_t back = 3 * (n + 1);
    for (uint32_t x = 0; x < n; x++) {
        uint32_t a = x == 0 ? 1 : 3 * x, low = 3 * x + 1, high = 3 * x + 2, b = 3 * x + 3,
                 top = 3 * x + 4;
        for (uint32_t y = 0; y < 2; y++) { /* in the first column, a is the lower end */
            uint32_t s = y * back, polygon[5] = { top + s, high + s, low + s, a + s, b + s };
            if (x == 0)
                polygon[3] = b + s;
            for (uint32_t i = 1; i + 1 < (x == 0 ? 4u : 5u); i++)
                face(&m, polygon[0], polygon[y ? i + 1 : i], polygon[y ? i : i + 1]);
        }
        face(&m, a, a + back, b + back); /* the bottom */
        face(&m, a, b + back, b);
        face(&m, high, top, top + back); /* the step */
        face(&m, high, top + back, high + back);
        face(&m, low, high, high + back); /* the riser */
        face(&m, low, high + back, low + back);
    }
    uint32_t b = 3 * n, top = 3 * n + 1;
    face(&m, b, b + back, top + back);
    face(&m, b, top + back, top);
    return m;
}

ebpo_mesh degenerate_dust(const degenerate_case *c)
{
    ebpo_mesh m = ebpo_test_tetrahedron(1000), dust = ebpo_test_tetrahedra((uint32_t)c->a[0]);
    scale_and_shift(&dust, 0x1p-7, 100, 100, -2);
    add(&m, dust);
    return m;
}

ebpo_mesh degenerate_tetrahedra(const degenerate_case *c)
{
    return ebpo_test_tetrahedra((uint32_t)c->a[0]);
}

ebpo_mesh degenerate_nested(const degenerate_case *c)
{
    ebpo_mesh m = { 0 };
    for (double i = 1; i <= c->a[0]; i++)
        add(&m, box(-i, -i, -i, i, i, i, 1));
    return m;
}

ebpo_mesh degenerate_menger(const degenerate_case *c)
{
    uint32_t n = 1;
    for (int i = 0; i < (int)c->a[0]; i++)
        n *= 3;
    uint8_t *filled = query_alloc((uint64_t)n * n * n, 1);
    for (uint32_t z = 0; z < n; z++)
        for (uint32_t y = 0; y < n; y++)
            for (uint32_t x = 0; x < n; x++) {
                bool in = true;
                for (uint32_t p = 1; p < n; p *= 3)
                    in &= (x / p % 3 == 1) + (y / p % 3 == 1) + (z / p % 3 == 1) < 2;
                filled[((size_t)z * n + y) * n + x] = in;
            }
    ebpo_mesh m = ebpo_test_voxels(filled, n, 1);
    free(filled);
    return m;
}

ebpo_mesh degenerate_checkers(const degenerate_case *c)
{
    uint32_t n = (uint32_t)c->a[0];
    uint8_t *filled = query_alloc((uint64_t)n * n * n, 1);
    for (uint32_t i = 0; i < n * n * n; i++)
        filled[i] = (i % n + i / n % n + i / n / n) % 2;
    ebpo_mesh m = ebpo_test_voxels(filled, n, 1);
    free(filled);
    return m;
}

ebpo_mesh degenerate_needles(const degenerate_case *c)
{
    ebpo_mesh m = { 0 };
    uint64_t state = 17;
    for (uint32_t i = 0; i < (uint32_t)c->a[0]; i++) {
        ebpo_mesh needle = ebpo_test_tetrahedron(c->a[1]);
        double *tip = needle.xyz64 + 9; /* keeps the tip in the half-space that preserves the
                                         * orientation */
        for (int k = 0; k < 3; k++)
            tip[k] = k == 2 ? 0.125 + ebpo_test_random_unit(&state)
                            : 2 * ebpo_test_random_unit(&state) - 1;
        add(&m, needle);
    }
    return m;
}

ebpo_mesh degenerate_book(const degenerate_case *c)
{
    uint32_t n = (uint32_t)c->a[0];
    ebpo_mesh m = { 0 };
    uint32_t low = vertex(&m, 0, 0, -1), high = vertex(&m, 0, 0, 1);
    for (uint32_t i = 0; i < n; i++) {
        double x, y;
        ebpo_test_circle(3 * i, 3 * n, &x, &y);
        uint32_t a = vertex(&m, x, y, 0);
        ebpo_test_circle(3 * i + 1, 3 * n, &x, &y);
        uint32_t b = vertex(&m, x, y, 0);
        face(&m, a, b, high);
        face(&m, b, a, low);
        face(&m, low, a, high);
        face(&m, b, low, high);
    }
    return m;
}

ebpo_mesh degenerate_plates(const degenerate_case *c)
{
    ebpo_mesh m = { 0 };
    for (uint32_t i = 0; i < (uint32_t)c->a[0]; i++)
        add(&m, box(0, 0, i * c->a[2], 1, 1, i * c->a[2] + c->a[1], 1));
    return m;
}

ebpo_mesh degenerate_ball_and_face(const degenerate_case *c)
{
    double centre[3] = { 0.25, 0.25, -c->a[1] };
    ebpo_mesh m = ebpo_test_tetrahedron(1);
    add(&m, ebpo_test_sphere(centre, c->a[0], 3));
    return m;
}
