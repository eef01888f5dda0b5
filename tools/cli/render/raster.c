/* Rasterizes in two steps. First each sample gets the nearest triangle, by a z-buffer of 1/depth,
 * which is linear on the screen. Then pixels are shaded from their samples. */
#include "cli/render/raster.h"

#include <math.h>
#include <pthread.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "cli/command.h"

enum { OCCLUSION_STEPS = 10, THREADS_MAX = 64 };
#define OUTLINE_BIT UINT32_C(0x80000000)

typedef struct sample {
    float inverse;     /* 1 / depth; 0: background */
    uint32_t triangle; /* index of the triangle; OUTLINE_BIT: on an outline */
} sample;

/* A vertex in camera axes (x right, y up, z depth) and on the screen. */
typedef struct projected {
    double x, y, inverse;
} projected;

typedef struct raster {
    const camera *view;
    const ebpo_mesh *mesh;
    const raster_style *style;
    int width, height;           /* size of the picture in samples */
    int side;                    /* samples across a pixel */
    double focal, inverse_focal; /* samples per unit of x / depth; 1 / focal */
    sample *samples;
    float (*normal)[3]; /* normal of each triangle, in camera axes, towards the eye */
    /* positions for ambient occlusion: a spiral in the unit disk, and rotations of the spiral as
     * (cosine, sine) */
    double spiral[OCCLUSION_STEPS][2], turn[256][2];
    double linear[256]; /* [sRGB value] linear light */
} raster;

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

/* Converts vertex i to camera axes: x right, y up, z towards the eye, from the target. */
static void to_camera(const raster *r, uint64_t i, double out[3])
{
    double v[3];
    for (uint64_t k = 0; k < 3; k++)
        v[k] = (r->mesh->xyz32 ? (double)r->mesh->xyz32[3 * i + k] : r->mesh->xyz64[3 * i + k]) -
               r->view->target[k];
    out[0] = dot_product(v, r->view->right);
    out[1] = dot_product(v, r->view->up);
    out[2] = dot_product(v, r->view->back);
}

static projected project_point(const raster *r, const double v[3])
{
    double inverse = 1 / (r->view->distance - v[2]);
    return (projected){ r->width / 2.0 + r->focal * v[0] * inverse,
                        r->height / 2.0 - r->focal * v[1] * inverse, inverse };
}

static bool unit_normal(double (*c)[3], double out[3])
{
    double u[3], v[3];
    for (int k = 0; k < 3; k++) {
        u[k] = c[1][k] - c[0][k];
        v[k] = c[2][k] - c[0][k];
    }
    cross_product(u, v, out);
    double length = sqrt(dot_product(out, out));
    for (int k = 0; k < 3; k++)
        out[k] /= length;
    return length > 0;
}

/* --- first step --- */

/* Returns the sides of a triangle that are outlines of its polygon, as bits. Bit i is the side from
 * corner i to the next corner. ebpo_lod_level divides a polygon into a fan of consecutive triangles
 * with the same first corner. A side between two triangles of a fan in one plane is no outline. */
static unsigned outline_sides(const raster *r, uint64_t face, const double normal[3])
{
    const uint32_t *f = r->mesh->faces + 3 * face;
    unsigned sides = 7;
    for (int step = -1; step <= 1; step += 2) {
        if ((step < 0 && face == 0) || (step > 0 && face + 1 == r->mesh->face_count))
            continue;
        const uint32_t *g = f + 3 * step;
        double c[3][3], other[3];
        bool fan = g[0] == f[0] && (step > 0 ? g[1] == f[2] : g[2] == f[1]);
        if (!fan)
            continue;
        for (int i = 0; i < 3; i++)
            to_camera(r, g[i], c[i]);
        if (!unit_normal(c, other) || dot_product(normal, other) > 1 - 1e-9)
            sides &= step > 0 ? ~4u : ~1u;
    }
    return sides;
}

/* The sides of a triangle on the screen. Side i leads from corner i to the next corner. a[i] x +
 * b[i] y + c[i] is the distance of a sample from side i, in samples; it is 0 or more inside the
 * triangle. */
typedef struct sides {
    double a[3], b[3], c[3];
} sides;

static bool make_sides(const projected p[3], sides *out)
{
    double area = (p[1].x - p[0].x) * (p[2].y - p[0].y) - (p[1].y - p[0].y) * (p[2].x - p[0].x);
    if (!(fabs(area) > 1e-12))
        return false;
    double sign = area > 0 ? 1 : -1;
    for (int i = 0; i < 3; i++) {
        const projected *s = &p[i], *t = &p[(i + 1) % 3];
        double dx = t->x - s->x, dy = t->y - s->y, length = sqrt(dx * dx + dy * dy);
        out->a[i] = -dy * sign / length;
        out->b[i] = dx * sign / length;
        out->c[i] = -(out->a[i] * s->x + out->b[i] * s->y);
    }
    return true;
}

static int clamp_index(double v, int most) { return v < 0 ? 0 : v > most ? most : (int)v; }

/* Stores a triangle in all samples that it covers, except those that have a nearer triangle.
 * outlines: sides that are outlines, as bits. */
static void fill_triangle(raster *r, const projected p[3], uint32_t triangle, unsigned outlines)
{
    sides s;
    if (!make_sides(p, &s))
        return;
    double line = 0.42 * r->side; /* half the outline's width */
    double det = (p[1].x - p[0].x) * (p[2].y - p[0].y) - (p[1].y - p[0].y) * (p[2].x - p[0].x);
    double gx = ((p[1].inverse - p[0].inverse) * (p[2].y - p[0].y) -
                 (p[2].inverse - p[0].inverse) * (p[1].y - p[0].y)) /
                det;
    double gy = ((p[2].inverse - p[0].inverse) * (p[1].x - p[0].x) -
                 (p[1].inverse - p[0].inverse) * (p[2].x - p[0].x)) /
                det;
    int x0 = clamp_index(fmin(p[0].x, fmin(p[1].x, p[2].x)), r->width),
        x1 = clamp_index(fmax(p[0].x, fmax(p[1].x, p[2].x)) + 1, r->width);
    int y0 = clamp_index(fmin(p[0].y, fmin(p[1].y, p[2].y)), r->height),
        y1 = clamp_index(fmax(p[0].y, fmax(p[1].y, p[2].y)) + 1, r->height);
    for (int y = y0; y < y1; y++)
        for (int x = x0; x < x1; x++) {
            double sx = x + 0.5, sy = y + 0.5, d[3];
            for (int i = 0; i < 3; i++)
                d[i] = s.a[i] * sx + s.b[i] * sy + s.c[i];
            if (d[0] < 0 || d[1] < 0 || d[2] < 0)
                continue;
            float inverse = (float)(p[0].inverse + gx * (sx - p[0].x) + gy * (sy - p[0].y));
            sample *at = &r->samples[(size_t)y * (size_t)r->width + (size_t)x];
            if (inverse <= at->inverse)
                continue;
            bool on_line = (outlines & 1 && d[0] < line) || (outlines & 2 && d[1] < line) ||
                           (outlines & 4 && d[2] < line);
            *at = (sample){ inverse, triangle | (on_line ? OUTLINE_BIT : 0) };
        }
}

/* Replaces n by the normal of the style for a face, in camera axes, if the style has one. */
static void style_normal(const raster *r, uint64_t face, double n[3])
{
    const float *given = r->style->normals ? r->style->normals + 3 * face : NULL;
    if (!given || (given[0] == 0 && given[1] == 0 && given[2] == 0))
        return;
    double v[3] = { (double)given[0], (double)given[1], (double)given[2] };
    n[0] = dot_product(v, r->view->right);
    n[1] = dot_product(v, r->view->up);
    n[2] = dot_product(v, r->view->back);
}

static void draw_face(raster *r, uint64_t face)
{
    double c[3][3], n[3];
    for (int i = 0; i < 3; i++)
        to_camera(r, r->mesh->faces[3 * face + (uint64_t)i], c[i]);
    if (!unit_normal(c, n))
        return;
    double to_eye[3] = { -c[0][0], -c[0][1], r->view->distance - c[0][2] };
    bool front = dot_product(n, to_eye) > 0;
    if (!front && r->style->closed)
        return;
    if (front && r->style->paint && r->style->paint[face] & RASTER_HOLLOW)
        return;
    unsigned outlines = r->style->edges ? outline_sides(r, face, n) : 0;
    style_normal(r, face, n);
    for (int k = 0; k < 3; k++)
        r->normal[face][k] = (float)(front ? n[k] : -n[k]);
    projected p[3] = { project_point(r, c[0]), project_point(r, c[1]), project_point(r, c[2]) };
    fill_triangle(r, p, (uint32_t)face, outlines);
}

/* --- second step --- */

/* Computes the position of a sample with this 1/depth, in camera axes. */
static void sample_position(const raster *r, int x, int y, double inverse, double out[3])
{
    double depth = 1 / inverse, scale = depth * r->inverse_focal;
    out[0] = (x + 0.5 - r->width / 2.0) * scale;
    out[1] = -(y + 0.5 - r->height / 2.0) * scale;
    out[2] = r->view->distance - depth;
}

/* Returns the hidden share of the sky near a sample, 0 .. 1. The estimate uses samples on a spiral
 * around this sample, if they are above the plane of this sample. max_distance: radius of the
 * spiral, in the unit of the model. */
static double sky_hidden(const raster *r, int x, int y, const sample *at, const float n[3],
                         double max_distance)
{
    double p[3], sum = 0;
    sample_position(r, x, y, at->inverse, p);
    uint32_t hash = ((uint32_t)x * 73856093u ^ (uint32_t)y * 19349663u) * 2654435761u;
    const double *turn = r->turn[hash >> 24];
    double radius = max_distance * r->focal * at->inverse, tx = radius * turn[0],
           ty = radius * turn[1];
    for (int i = 0; i < OCCLUSION_STEPS; i++) {
        const double *s = r->spiral[i];
        int qx = x + (int)(tx * s[0] - ty * s[1]), qy = y + (int)(tx * s[1] + ty * s[0]);
        if (qx < 0 || qy < 0 || qx >= r->width || qy >= r->height)
            continue;
        const sample *other = &r->samples[(size_t)qy * (size_t)r->width + (size_t)qx];
        if (other->inverse <= 0)
            continue;
        double q[3];
        sample_position(r, qx, qy, other->inverse, q);
        double v[3] = { q[0] - p[0], q[1] - p[1], q[2] - p[2] };
        double height = (double)n[0] * v[0] + (double)n[1] * v[1] + (double)n[2] * v[2];
        if (height <= 0)
            continue;
        double square = dot_product(v, v), above = height / sqrt(square) - 0.08;
        if (above > 0)
            sum += above / (1 + square / (max_distance * max_distance));
    }
    double hidden = 2.4 * sum / OCCLUSION_STEPS;
    return hidden > 1 ? 1 : hidden;
}

/* Computes the weights of a face's corners at a point `p` of its plane, in camera axes. */
static void corner_weights(const raster *r, uint32_t face, const double p[3], double out[3])
{
    double c[3][3], from[3][3], n[3], part[3], sum = 0;
    for (int i = 0; i < 3; i++) {
        to_camera(r, r->mesh->faces[3 * (uint64_t)face + (uint64_t)i], c[i]);
        for (int k = 0; k < 3; k++)
            from[i][k] = c[i][k] - p[k];
    }
    for (int k = 0; k < 3; k++)
        n[k] = (double)r->normal[face][k];
    for (int i = 0; i < 3; i++) {
        cross_product(from[(i + 1) % 3], from[(i + 2) % 3], part);
        sum += out[i] = fabs(dot_product(part, n));
    }
    for (int i = 0; i < 3; i++)
        out[i] = sum > 0 ? out[i] / sum : 1.0 / 3;
}

/* Computes the linear colour of a face at a sample. */
static void colour_at(const raster *r, int x, int y, const sample *at, double out[3])
{
    static const double other[3] = { 0.30, 0.48, 0.66 }, red[3] = { 0.85, 0.04, 0.03 };
    const raster_style *style = r->style;
    uint32_t face = at->triangle & ~OUTLINE_BIT;
    int paint = style->paint ? style->paint[face] : RASTER_PLAIN;
    memcpy(out,
           paint & RASTER_RED     ? red
           : paint & RASTER_OTHER ? other
                                  : style->colour,
           sizeof red);
    for (int k = 0; k < 3 && style->face_colours; k++)
        out[k] = r->linear[style->face_colours[4 * (uint64_t)face + (uint64_t)k]];
    if (!style->vertex_colours)
        return;
    double p[3], shares[3];
    const uint32_t *corner = r->mesh->faces + 3 * (uint64_t)face;
    sample_position(r, x, y, (double)at->inverse, p);
    corner_weights(r, face, p, shares);
    for (unsigned k = 0; k < 3; k++) {
        out[k] = 0;
        for (int i = 0; i < 3; i++)
            out[k] += shares[i] * r->linear[style->vertex_colours[4 * (uint64_t)corner[i] + k]];
    }
}

/* Computes the normal for the light of a sample: the normal of the face, or the mean of the normals
 * of its vertices. */
static void normal_at(const raster *r, int x, int y, const sample *at, double out[3])
{
    uint32_t face = at->triangle & ~OUTLINE_BIT;
    const float *given = r->style->vertex_normals, *flat = r->normal[face];
    for (int k = 0; k < 3; k++)
        out[k] = (double)flat[k];
    if (!given)
        return;
    double p[3], shares[3], v[3] = { 0, 0, 0 }, n[3];
    sample_position(r, x, y, (double)at->inverse, p);
    corner_weights(r, face, p, shares);
    for (int i = 0; i < 3; i++)
        for (int k = 0; k < 3; k++)
            v[k] += shares[i] *
                    (double)given[3 * (uint64_t)r->mesh->faces[3 * (uint64_t)face + (uint64_t)i] +
                                  (uint64_t)k];
    n[0] = dot_product(v, r->view->right);
    n[1] = dot_product(v, r->view->up);
    n[2] = dot_product(v, r->view->back);
    double length = sqrt(dot_product(n, n)), side = dot_product(n, out) < 0 ? -1 : 1;
    for (int k = 0; k < 3 && length > 0; k++)
        out[k] = side * n[k] / length;
}

/* Computes the linear light of a sample: a key light from the upper left, a weak fill light from
 * the right, the sky above, and a gloss. */
static void light_sample(const raster *r, int x, int y, const sample *at, double hidden,
                         double out[3])
{
    double colour[3];
    colour_at(r, x, y, at, colour);
    static const double key[3] = { -0.46, 0.62, 0.635 }, fill[3] = { 0.86, 0.10, 0.50 },
                        half[3] = { -0.254, 0.343, 0.904 };
    double m[3];
    normal_at(r, x, y, at, m);
    double k = fmax(0, dot_product(m, key)), f = fmax(0, dot_product(m, fill)),
           sky = 0.5 + 0.5 * m[1];
    double gloss = fmax(0, dot_product(m, half));
    for (int i = 0; i < 5; i++) /* the 32nd power */
        gloss *= gloss;
    gloss *= 0.12;
    double open = 1 - 0.85 * hidden, direct = 1 - 0.45 * hidden;
    static const double warm[3] = { 1.0, 0.97, 0.92 }, cool[3] = { 0.90, 0.95, 1.0 };
    for (int i = 0; i < 3; i++) {
        double ambient = (0.07 + 0.22 * sky) * cool[i] * open;
        out[i] = colour[i] * (ambient + direct * (0.95 * k * warm[i] + 0.16 * f * cool[i])) +
                 gloss * direct;
    }
}

static double to_linear(int v)
{
    double s = v / 255.0;
    return s <= 0.04045 ? s / 12.92 : pow((s + 0.055) / 1.055, 2.4);
}

static void make_tables(raster *r)
{
    for (int i = 0; i < OCCLUSION_STEPS; i++) {
        double radius = (i + 0.5) / OCCLUSION_STEPS;
        double angle = i * 2.399963; /* the golden angle */
        r->spiral[i][0] = radius * cos(angle);
        r->spiral[i][1] = radius * sin(angle);
    }
    for (int i = 0; i < 256; i++) {
        r->turn[i][0] = cos(i * M_PI / 128);
        r->turn[i][1] = sin(i * M_PI / 128);
        r->linear[i] = to_linear(i);
    }
}

static uint8_t to_srgb(double v)
{
    double s = v <= 0.0031308 ? 12.92 * v : 1.055 * pow(v, 1 / 2.4) - 0.055;
    return (uint8_t)(s <= 0 ? 0 : s >= 1 ? 255 : s * 255 + 0.5);
}

/* Sets a pixel to the mean of the light of its samples. Samples without a triangle keep the colour
 * that the pixel has. */
static void resolve_pixel(const raster *r, int x, int y, double max_distance, uint8_t *rgb)
{
    static const double ink[3] = { 0.03, 0.04, 0.06 };
    double sum[3] = { 0, 0, 0 };
    for (int j = y * r->side; j < (y + 1) * r->side; j++)
        for (int i = x * r->side; i < (x + 1) * r->side; i++) {
            const sample *at = &r->samples[(size_t)j * (size_t)r->width + (size_t)i];
            double c[3] = { r->linear[rgb[0]], r->linear[rgb[1]], r->linear[rgb[2]] };
            if (at->inverse > 0) {
                uint32_t face = at->triangle & ~OUTLINE_BIT;
                light_sample(r, i, j, at, sky_hidden(r, i, j, at, r->normal[face], max_distance),
                             c);
                for (int k = 0; k < 3 && at->triangle & OUTLINE_BIT; k++)
                    c[k] = 0.45 * c[k] + 0.55 * ink[k];
            }
            for (int k = 0; k < 3; k++)
                sum[k] += c[k];
        }
    for (int k = 0; k < 3; k++)
        rgb[k] = to_srgb(sum[k] / (r->side * r->side));
}

/* The rows of one thread in the second step: number, number + threads, and so on. */
typedef struct thread_rows {
    const raster *r;
    picture *out;
    int x, y, width, height;
    unsigned number, threads;
    pthread_t thread;
} thread_rows;

static void *resolve_rows(void *argument)
{
    const thread_rows *s = argument;
    double max_distance = 0.10 * s->r->view->distance * s->r->view->tangent;
    for (int j = (int)s->number; j < s->height; j += (int)s->threads)
        for (int i = 0; i < s->width; i++)
            resolve_pixel(s->r, i, j, max_distance,
                          s->out->rgb + 3 * ((size_t)(s->y + j) * (size_t)s->out->width +
                                             (size_t)(s->x + i)));
    return NULL;
}

static void resolve_picture(const raster *r, picture *out, int x, int y, int width, int height,
                            unsigned threads)
{
    thread_rows shares[THREADS_MAX];
    unsigned count = threads < 1 ? 1 : threads < THREADS_MAX ? threads : THREADS_MAX, started = 1;
    for (unsigned i = 0; i < count; i++)
        shares[i] = (thread_rows){ .r = r,
                                   .out = out,
                                   .x = x,
                                   .y = y,
                                   .width = width,
                                   .height = height,
                                   .number = i,
                                   .threads = count };
    while (started < count &&
           command_thread(&shares[started].thread, resolve_rows, &shares[started]) == 0)
        started++;
    resolve_rows(&shares[0]);
    for (unsigned i = started; i < count; i++) /* rows of threads that could not be started */
        resolve_rows(&shares[i]);
    for (unsigned i = 1; i < started; i++)
        pthread_join(shares[i].thread, NULL);
}

ebpo_status raster_draw(picture *out, int x, int y, int width, int height, const camera *view,
                        const ebpo_mesh *mesh, const raster_style *style, unsigned threads,
                        ebpo_error *error)
{
    if (mesh->face_count >= OUTLINE_BIT) {
        snprintf(error->message, sizeof error->message,
                 "more than 2147483647 faces cannot be drawn; choose a coarser level");
        return error->status = EBPO_E_LIMIT;
    }
    int side = (int64_t)width * height > 4000000 ? 2 : 3;
    raster r = { .view = view,
                 .mesh = mesh,
                 .style = style,
                 .width = side * width,
                 .height = side * height,
                 .side = side };
    r.focal = r.height / 2.0 / view->tangent;
    r.inverse_focal = 1 / r.focal;
    r.samples = calloc((size_t)r.width * (size_t)r.height, sizeof *r.samples);
    r.normal = malloc((mesh->face_count ? mesh->face_count : 1) * sizeof *r.normal);
    ebpo_status status = EBPO_OK;
    if (!r.samples || !r.normal) {
        status = error->status = EBPO_E_MEMORY;
        snprintf(error->message, sizeof error->message,
                 "not enough memory for a picture of %d x %d; choose a smaller --size", width,
                 height);
        goto done;
    }
    for (uint64_t face = 0; face < mesh->face_count; face++)
        draw_face(&r, face);
    make_tables(&r);
    resolve_picture(&r, out, x, y, width, height, threads);
done:
    free(r.samples);
    free(r.normal);
    return status;
}
