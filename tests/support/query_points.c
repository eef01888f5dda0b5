/* Generates difficult points and rays. */
#include "query_support.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

static uint64_t pick(uint64_t *state, uint64_t below) { return ebpo_test_random(state) % below; }

static void vertex_of_face(const query_model *m, uint64_t face, uint64_t i, double out[3])
{
    ebpo_test_point(&m->mesh, m->mesh.faces[3 * face + i % 3], out);
}

static void random_vertex(const query_model *m, uint64_t *state, double out[3])
{
    uint64_t face = pick(state, m->mesh.face_count);
    vertex_of_face(m, face, pick(state, 3), out);
}

/* Uses multiples of 1/8 along the edge: exact for grids, else close to the edge or face. */
static void edge_point(const query_model *m, uint64_t *state, double out[3])
{
    double a[3], b[3];
    uint64_t face = pick(state, m->mesh.face_count), i = pick(state, 3);
    double s = (double)pick(state, 9) / 8;
    vertex_of_face(m, face, i, a);
    vertex_of_face(m, face, i + 1, b);
    for (int k = 0; k < 3; k++)
        out[k] = a[k] + (b[k] - a[k]) * s;
}

static void face_point(const query_model *m, uint64_t *state, double out[3])
{
    double a[3], b[3], c[3];
    uint64_t face = pick(state, m->mesh.face_count), i = pick(state, 3), n = pick(state, 8) + 1,
             j = pick(state, n + 1);
    double s = (double)j / 8, t = (double)(n - j) / 8;
    vertex_of_face(m, face, i, a);
    vertex_of_face(m, face, i + 1, b);
    vertex_of_face(m, face, i + 2, c);
    for (int k = 0; k < 3; k++)
        out[k] = a[k] + (b[k] - a[k]) * s + (c[k] - a[k]) * t;
}

static double cell_face(const query_model *m, uint64_t *state, int k, int level)
{
    return m->info.box_origin[k] + (double)pick(state, (UINT64_C(1) << level) + 1) *
                                       (m->info.box_size[k] / (double)(1u << level));
}

/* Makes a point with all (`corner`) or some coordinates on cell faces of one level. */
static void cell_point(const query_model *m, uint64_t *state, bool corner, double out[3])
{
    int top =
        m->info.level_count + 1 < m->info.grid_level ? m->info.level_count + 1 : m->info.grid_level;
    int level = (int)pick(state, (uint64_t)top + 1);
    face_point(m, state, out);
    for (int k = 0; k < 3; k++)
        if (corner || pick(state, 2))
            out[k] = cell_face(m, state, k, level);
}

/* Makes a point on the cell face next to a point of the surface, where cells are deep. */
static void cell_face_near_surface(const query_model *m, uint64_t *state, double out[3])
{
    int level = m->info.level_count - 1 - (int)pick(state, 2), axis = (int)pick(state, 3);
    level = level < 0 ? 0 : level;
    face_point(m, state, out);
    for (int k = 0; k < 3; k++)
        if (k == axis || pick(state, 3) == 0) {
            double cell = m->info.box_size[k] / (double)(1u << level);
            out[k] = m->info.box_origin[k] + round((out[k] - m->info.box_origin[k]) / cell) * cell;
        }
}

static void near_surface(const query_model *m, uint64_t *state, double out[3])
{
    double step = m->size;
    for (uint64_t i = pick(state, 17); i > 0; i--)
        step /= 10;
    if (pick(state, 2))
        face_point(m, state, out);
    else
        edge_point(m, state, out);
    for (int k = 0; k < 3; k++)
        out[k] += step * (2 * ebpo_test_random_unit(state) - 1);
}

static void in_box(const query_model *m, uint64_t *state, double factor, double out[3])
{
    for (int k = 0; k < 3; k++) {
        double middle =
                   m->info.box_origin[k] / 2 + (m->info.box_origin[k] + m->info.box_size[k]) / 2,
               side = fmax(m->info.box_size[k], m->size);
        if (factor <= 1)
            side = m->info.box_size[k];
        out[k] = middle + factor * side * (ebpo_test_random_unit(state) - 0.5);
    }
}

static void mixed(const query_model *m, uint64_t *state, double out[3])
{
    for (int k = 0; k < 3; k++) {
        double v[3];
        random_vertex(m, state, v);
        out[k] = v[k];
    }
}

static void middle(const query_model *m, uint64_t *state, double out[3])
{
    double a[3], b[3];
    random_vertex(m, state, a);
    random_vertex(m, state, b);
    for (int k = 0; k < 3; k++)
        out[k] = a[k] / 2 + b[k] / 2;
}

static void one_point(const query_model *m, uint64_t *state, double out[3])
{
    switch (pick(state, 16)) {
    case 0: random_vertex(m, state, out); break;
    case 1:
    case 2: edge_point(m, state, out); break;
    case 3:
    case 4: face_point(m, state, out); break;
    case 5: cell_point(m, state, true, out); break;
    case 6: cell_point(m, state, false, out); break;
    case 7: cell_face_near_surface(m, state, out); break;
    case 8: mixed(m, state, out); break;
    case 9: middle(m, state, out); break;
    case 10:
    case 11:
    case 12: near_surface(m, state, out); break;
    case 13:
    case 14: in_box(m, state, 1, out); break;
    default: in_box(m, state, pick(state, 4) ? 3 : 1e6, out); break;
    }
    if (pick(state, 2))
        return;
    for (int k = 0; k < 3; k++)
        switch (pick(state, 4)) {
        case 0: out[k] = nextafter(out[k], INFINITY); break;
        case 1: out[k] = nextafter(out[k], -INFINITY); break;
        default: break;
        }
}

void query_make_points(const query_model *m, uint64_t count, uint64_t seed, double *out)
{
    uint64_t state = seed;
    for (uint64_t i = 0; i < count; i++)
        one_point(m, &state, out + 3 * i);
}

void query_make_ray(const query_model *m, uint64_t *state, double origin[3], double direction[3],
                    double *t_max)
{
    static const double ends[] = { INFINITY, INFINITY, 1, 2, 0.5, 0, 1e-3, 1e9 };
    double to[3];
    uint64_t kind = pick(state, 8);
    one_point(m, state, origin);
    one_point(m, state, to);
    if (kind == 0) { /* along an edge, from one of its ends or before it */
        uint64_t face = pick(state, m->mesh.face_count), i = pick(state, 3);
        vertex_of_face(m, face, i, origin);
        vertex_of_face(m, face, i + 1, to);
    } else if (kind == 1) { /* within a face, through a vertex */
        uint64_t face = pick(state, m->mesh.face_count);
        double c[3];
        vertex_of_face(m, face, 0, origin);
        vertex_of_face(m, face, 1, to);
        vertex_of_face(m, face, 2, c);
        for (int k = 0; k < 3; k++)
            to[k] = to[k] / 2 + c[k] / 2;
    }
    bool any = false;
    for (int k = 0; k < 3; k++)
        direction[k] = to[k] - origin[k];
    if (kind < 2 && pick(state, 2))
        for (int k = 0; k < 3; k++)
            origin[k] -= direction[k];
    if (kind == 2 || kind == 3) { /* along an axis or a diagonal */
        for (int k = 0; k < 3; k++)
            direction[k] = (double)pick(state, 3) - 1;
    }
    for (int k = 0; k < 3; k++)
        any |= direction[k] != 0;
    if (!any)
        direction[pick(state, 3)] = pick(state, 2) ? 1 : -1;
    *t_max = ends[pick(state, sizeof ends / sizeof *ends)];
}
