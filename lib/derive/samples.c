/* Points by area on the level's polygons. One counts if a point a little outside of its polygon is
 * in no other envelope. */
#include "core/strict_fp.h"

#include "derive/samples.h"

#include <float.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include <ebpo/lod.h>

#include "core/alloc.h"
#include "core/error.h"
#include "core/parallel.h"
#include "core/random.h"
#include "derive/frame.h"
#include "geometry/octcode.h"
#include "query/query_model.h"

typedef struct sampling {
    const ebpo_deviation_options *o;
    int level;
    ebpo_box box;
    ebpo_cell_frame frame; /* of the root cell: the unit of areas and distances */
    ebpo_mesh mesh;
    ebpo_lod_nodes nodes;
    uint64_t *first_triangle; /* [node_count + 1] */
    uint32_t *triangle;       /* [samples] */
    double *distance;         /* [samples]; NAN: not on the surface */
    ebpo_context **contexts;  /* [threads] */
    unsigned threads;
} sampling;

/* Every number of the stream from its place. */
static double random_unit(uint64_t seed, uint64_t place)
{
    uint64_t number = seed * UINT64_C(0xd1342543de82ef95) + place + 1;
    return ebpo_random_unit(ebpo_random_mix(number * EBPO_RANDOM_STEP));
}

static const double *triangle_corner(const sampling *s, uint64_t triangle, int i)
{
    return s->mesh.xyz64 + 3 * (uint64_t)s->mesh.faces[3 * triangle + (uint64_t)i];
}

static double triangle_area(const sampling *s, uint64_t triangle)
{
    double u[3], v[3], n[3];
    for (int k = 0; k < 3; k++) {
        u[k] = ebpo_cell_frame_length(&s->frame,
                                      triangle_corner(s, triangle, 1)[k] - triangle_corner(s, triangle, 0)[k]);
        v[k] = ebpo_cell_frame_length(&s->frame,
                                      triangle_corner(s, triangle, 2)[k] - triangle_corner(s, triangle, 0)[k]);
    }
    for (int k = 0; k < 3; k++)
        n[k] = u[(k + 1) % 3] * v[(k + 2) % 3] - u[(k + 2) % 3] * v[(k + 1) % 3];
    return .5 * sqrt(n[0] * n[0] + n[1] * n[1] + n[2] * n[2]);
}

/* One sample in each of `samples` equal parts of the area. */
static void share_out(sampling *s)
{
    double total = 0, below = 0;
    uint64_t t = 0;
    for (uint64_t i = 0; i < s->mesh.face_count; i++)
        total += triangle_area(s, i);
    double next = s->mesh.face_count ? triangle_area(s, 0) : 0;
    for (uint64_t i = 0; i < s->o->samples; i++) {
        double at = ((double)i + random_unit(s->o->seed, 3 * i)) / (double)s->o->samples * total;
        while (below + next <= at && t + 1 < s->mesh.face_count) {
            below += next;
            next = triangle_area(s, ++t);
        }
        s->triangle[i] = (uint32_t)t;
    }
}

/* --- which envelope holds a point --- */

static uint64_t node_of_triangle(const sampling *s, uint64_t triangle)
{
    uint64_t low = 0, high = s->nodes.node_count;
    while (high - low > 1) {
        uint64_t middle = low + (high - low) / 2;
        *(s->first_triangle[middle] <= triangle ? &low : &high) = middle;
    }
    return low;
}

/* The node at its octcode, or node_count. Nodes ascend. */
static uint64_t find_node(const sampling *s, uint64_t octcode)
{
    uint64_t low = 0, high = s->nodes.node_count;
    while (low < high) {
        uint64_t middle = low + (high - low) / 2;
        *(s->nodes.nodes[middle].octcode < octcode ? &low : &high) =
            s->nodes.nodes[middle].octcode < octcode ? middle + 1 : middle;
    }
    return low < s->nodes.node_count && s->nodes.nodes[low].octcode == octcode
               ? low
               : s->nodes.node_count;
}

/* A triangle's normal in root cell coordinates, of length 1; false without area. */
static bool unit_normal(const sampling *s, uint64_t triangle, double n[3])
{
    double u[3], v[3], length = 0;
    for (int k = 0; k < 3; k++) {
        u[k] = (triangle_corner(s, triangle, 1)[k] - triangle_corner(s, triangle, 0)[k]) / s->box.size[k];
        v[k] = (triangle_corner(s, triangle, 2)[k] - triangle_corner(s, triangle, 0)[k]) / s->box.size[k];
    }
    for (int k = 0; k < 3; k++)
        n[k] = u[(k + 1) % 3] * v[(k + 2) % 3] - u[(k + 2) % 3] * v[(k + 1) % 3];
    length = sqrt(n[0] * n[0] + n[1] * n[1] + n[2] * n[2]);
    for (int k = 0; k < 3 && length > 0; k++)
        n[k] /= length;
    return length > 0;
}

static bool node_holds(const sampling *s, uint64_t node, const double p[3])
{
    double slack = 1e-9 * ebpo_half_power(s->level);
    for (uint64_t t = s->first_triangle[node]; t < s->first_triangle[node + 1]; t++) {
        double n[3], out = 0;
        if (!unit_normal(s, t, n))
            continue;
        for (int k = 0; k < 3; k++)
            out += n[k] * ((p[k] - triangle_corner(s, t, 0)[k]) / s->box.size[k]);
        if (out > slack)
            return false;
    }
    return true;
}

static bool in_another(const sampling *s, uint64_t own, const double p[3])
{
    double xi[3];
    for (int k = 0; k < 3; k++) {
        xi[k] = (p[k] - s->box.origin[k]) / s->box.size[k];
        if (!(xi[k] >= 0 && xi[k] < 1))
            return false;
    }
    for (int level = 0; level <= s->level; level++) {
        ebpo_cell cell = { level, { 0, 0, 0 } };
        for (int k = 0; k < 3; k++)
            cell.at[k] = (uint32_t)(xi[k] * (double)(1u << level));
        uint64_t node = find_node(s, ebpo_octcode_of_cell(cell));
        if (node < s->nodes.node_count)
            return node != own && node_holds(s, node, p);
    }
    return false;
}

/* --- --- */

static ebpo_status measure_sample(sampling *s, uint64_t i, ebpo_context *context, ebpo_error *error)
{
    double a = sqrt(random_unit(s->o->seed, 3 * i + 1)), b = random_unit(s->o->seed, 3 * i + 2),
           p[3], n[3], q[3];
    uint64_t t = s->triangle[i];
    s->distance[i] = NAN;
    if (!unit_normal(s, t, n))
        return EBPO_OK;
    for (int k = 0; k < 3; k++) {
        double step =
            fmax(1e-6 * ebpo_half_power(s->level) * s->box.size[k],
                 16 * DBL_EPSILON *
                     fmax(fabs(s->box.origin[k]), fabs(s->box.origin[k] + s->box.size[k])));
        p[k] = (1 - a) * triangle_corner(s, t, 0)[k] +
               a * ((1 - b) * triangle_corner(s, t, 1)[k] + b * triangle_corner(s, t, 2)[k]);
        q[k] = p[k] + n[k] * step;
    }
    if (in_another(s, node_of_triangle(s, t), q))
        return EBPO_OK;
    ebpo_distance_result result;
    ebpo_status status = ebpo_distance(context, p, NULL, &result, error);
    s->distance[i] = fmax(0, ebpo_cell_frame_length(&s->frame, result.distance));
    return status;
}

static ebpo_status sample_some(void *context, uint64_t begin, uint64_t end, unsigned worker,
                               ebpo_error *error)
{
    sampling *s = context;
    ebpo_status status = EBPO_OK;
    for (uint64_t i = begin; i < end && status == EBPO_OK; i++)
        status = measure_sample(s, i, s->contexts[worker], error);
    return status;
}

static void sum_up(const sampling *s, ebpo_deviation *out)
{
    double sum = 0, squares = 0;
    for (uint64_t i = 0; i < s->o->samples; i++)
        if (!isnan(s->distance[i])) {
            out->samples++;
            sum += s->distance[i];
            squares += s->distance[i] * s->distance[i];
        }
    if (!out->samples)
        return;
    out->mean = ldexp(sum / (double)out->samples, s->frame.exponent);
    out->rms = ldexp(sqrt(squares / (double)out->samples), s->frame.exponent);
}

static ebpo_status make_room(sampling *s, ebpo_model *model, ebpo_error *error)
{
    uint64_t triangles = 0, polygon = 0;
    s->first_triangle = ebpo_alloc(s->nodes.node_count + 1, sizeof *s->first_triangle);
    s->triangle = ebpo_alloc(s->o->samples, sizeof *s->triangle);
    s->distance = ebpo_alloc(s->o->samples, sizeof *s->distance);
    s->contexts = ebpo_alloc_zero(s->threads, sizeof *s->contexts);
    if (!s->first_triangle || !s->triangle || !s->distance || !s->contexts)
        return ebpo_fail_memory(error, s->nodes.node_count * 8 + s->o->samples * 12);
    for (uint64_t i = 0; i < s->nodes.node_count; i++) {
        s->first_triangle[i] = triangles;
        for (uint32_t k = 0; k < s->nodes.nodes[i].polygon_count; k++)
            triangles += s->nodes.corners[polygon++] - 2u;
    }
    s->first_triangle[s->nodes.node_count] = triangles;
    ebpo_status status = EBPO_OK;
    for (unsigned i = 0; i < s->threads && status == EBPO_OK; i++)
        status = ebpo_context_new(model, &s->contexts[i], error);
    return status;
}

ebpo_status ebpo_deviation_sample(ebpo_model *model, const ebpo_file *file, int level,
                                  const ebpo_deviation_options *options, ebpo_deviation *out,
                                  ebpo_error *error)
{
    sampling s = { .o = options,
                   .level = level,
                   .box = ebpo_model_box(model),
                   .threads = ebpo_thread_count(options->threads) };
    ebpo_lod_options lod = EBPO_LOD_OPTIONS_INIT;
    lod.threads = options->threads;
    ebpo_cell_frame_make(&s.frame, &s.box, (ebpo_cell){ 0, { 0, 0, 0 } });
    ebpo_status status = ebpo_lod_level_nodes(file, level, &lod, &s.mesh, &s.nodes, NULL, error);
    if (status == EBPO_OK)
        status = make_room(&s, model, error);
    if (status == EBPO_OK && s.mesh.face_count) {
        share_out(&s);
        status = ebpo_parallel_for(s.threads, NULL, options->samples, 64, sample_some, &s,
                                   &options->progress, "sampling the level's surface", error);
        if (status == EBPO_OK)
            sum_up(&s, out);
    }
    for (unsigned i = 0; s.contexts && i < s.threads; i++)
        ebpo_context_free(s.contexts[i]);
    free(s.contexts);
    free(s.first_triangle);
    free(s.triangle);
    free(s.distance);
    ebpo_lod_nodes_free(&s.nodes);
    ebpo_mesh_free(&s.mesh);
    return status;
}
