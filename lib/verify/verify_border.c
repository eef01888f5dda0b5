/* Verifies the border of a surface, and the winding numbers of the surface together with its caps
 * (triangles that close the holes).
 *
 * - The loops must be the boundary of the faces. For each edge, count how often faces use the edge
 *   in one direction, minus how often they use it in the other direction. This number must be equal
 *   to the sum of the weights of the loops that contain the edge. For this check, each directed
 *   edge gets a pseudo-random value, computed from the positions of its ends. The value of the
 *   opposite edge is its negative. Two sums must be equal: the sum of the values over the edges
 *   of all faces, and the sum over the edges of all loops, each value times the weight of its loop.
 *   If the loops are wrong, the sums are equal with a probability of only 2^-64.
 * - The area of the caps must be the area that the header states.
 * - Winding numbers are compared with rays through all faces and all caps. This file computes the
 *   caps from the loops, by a method that shares nothing with the builder. */
#include "core/strict_fp.h"

#include <float.h>
#include <inttypes.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "core/alloc.h"
#include "core/error.h"
#include "core/hash.h"
#include "core/workspace.h"
#include "mesh/mesh_parts.h"
#include "verify/verify_labels.h"
#include "verify/verify_parts.h"

/* Returns a pseudo-random value for a position. */
static uint64_t value_of_position(const double p[3])
{
    uint64_t value = 0;
    for (int k = 0; k < 3; k++) {
        double x = p[k] + 0.0; /* -0 and 0 are one position */
        uint64_t bits;
        memcpy(&bits, &x, sizeof bits);
        value = ebpo_random_mix(value ^ bits) + (uint64_t)k;
    }
    return value;
}

/* Returns a pseudo-random value for the edge from a to b. The value of the opposite edge is its
 * negative. */
static uint64_t value_of_edge(const double a[3], const double b[3])
{
    uint64_t from = value_of_position(a), to = value_of_position(b);
    return ebpo_random_mix(from + 3 * ebpo_random_mix(to)) -
           ebpo_random_mix(to + 3 * ebpo_random_mix(from));
}

/* Returns the sum of the values of all edges of all faces. */
static uint64_t value_of_faces(const ebpo_mesh *mesh)
{
    uint64_t sum = 0;
    EBPO_FOR_ITEMS(mesh->workspace, f, 0, mesh->face_count) {
        double p[3][3];
        for (uint64_t i = 0; i < 3; i++)
            ebpo_mesh_position(mesh, mesh->faces[3 * f + i], p[i]);
        for (int i = 0; i < 3; i++)
            sum += value_of_edge(p[i], p[(i + 1) % 3]);
    }
    return sum;
}

/* Returns the sum over all edges of the loops: the value of the edge, times the weight of the loop.
 */
static uint64_t value_of_loops(const ebpo_border_loops *loops)
{
    uint64_t sum = 0, first = 0;
    for (uint64_t i = 0; i < loops->loop_count; first += loops->loop[2 * i++]) {
        uint64_t count = loops->loop[2 * i], of_loop = 0;
        for (uint64_t k = 0; k < count; k++)
            of_loop += value_of_edge(loops->point + 3 * (first + k),
                                     loops->point + 3 * (first + (k + 1) % count));
        sum += loops->loop[2 * i + 1] * of_loop;
    }
    return sum;
}

/* --- caps --- */

/* A list of caps. */
typedef struct cap_list {
    const ebpo_border_loops *loops;
    uint32_t *corner; /* [count][3] indices of points of the loops */
    uint64_t count, capacity;
    double area;    /* sum of the areas of all caps */
    bool no_memory; /* true: out of memory, so caps are missing */
} cap_list;

/* Returns the area of a triangle; INFINITY if it is beyond the doubles. Edges are multiplied by a
 * power of two, so that no product overflows. Other factors would round them: in a narrow triangle,
 * an error of an edge is a far greater error of the area. */
static double area_of(const double *a, const double *b, const double *c)
{
    double u[3], v[3], most = 0, x[3];
    int power;
    for (int k = 0; k < 3; k++) {
        u[k] = b[k] / 4 - a[k] / 4;
        v[k] = c[k] / 4 - a[k] / 4;
        most = fmax(most, fmax(fabs(u[k]), fabs(v[k])));
    }
    frexp(most, &power);
    for (int k = 0; k < 3; k++) {
        int i = (k + 1) % 3, j = (k + 2) % 3;
        x[k] =
            ldexp(u[i], -power) * ldexp(v[j], -power) - ldexp(u[j], -power) * ldexp(v[i], -power);
    }
    return ldexp(hypot(hypot(x[0], x[1]), x[2]), 2 * power + 3);
}

/* Lists the caps between the path of a loop from point `first` to point `last` and the straight
 * segment between these two points. Each cap is listed `weight` times, with the orientation
 * opposite to the loop. The depth of recursion is at most 32. */
static void list_caps(cap_list *c, uint64_t first, uint64_t last, uint32_t weight)
{
    if (last < first + 2 || c->no_memory)
        return;
    uint64_t middle = (first + last) / 2;
    const double *p = c->loops->point;
    c->area =
        fmin(c->area + weight * area_of(p + 3 * first, p + 3 * middle, p + 3 * last), DBL_MAX);
    for (uint32_t i = 0; i < weight; i++) {
        if (!ebpo_grow(&c->corner, &c->capacity, c->count + 1, 3 * sizeof *c->corner)) {
            c->no_memory = true;
            return;
        }
        uint32_t *corner = c->corner + 3 * c->count++;
        corner[0] = (uint32_t)last;
        corner[1] = (uint32_t)middle;
        corner[2] = (uint32_t)first;
    }
    list_caps(c, first, middle, weight);
    list_caps(c, middle, last, weight);
}

/* --- the checks --- */

#define CHECK(...) ebpo_tally_check(tally, EBPO_VERIFY_STRUCTURE, __VA_ARGS__)

/* Lists all caps. ebpo_check_border_loops has checked the loops, so their weights are at most the
 * number of faces. */
static ebpo_status list_all_caps(cap_list *c, ebpo_error *error)
{
    uint64_t first = 0;
    for (uint64_t i = 0; i < c->loops->loop_count; first += c->loops->loop[2 * i++])
        list_caps(c, first, first + c->loops->loop[2 * i] - 1, c->loops->loop[2 * i + 1]);
    return c->no_memory ? ebpo_fail_memory(error, c->count * 3 * sizeof *c->corner) : EBPO_OK;
}

bool ebpo_check_border_loops(ebpo_tally *tally, const ebpo_tree *tree)
{
    const ebpo_border_loops *loops = &tree->border;
    uint64_t points = 0, longest = 0, weights = 0;
    bool valid = loops->loop_count == tree->info.border_loops &&
                 loops->point_count == tree->info.border_points;
    for (uint64_t i = 0; i < loops->loop_count && valid; i++) {
        uint64_t count = loops->loop[2 * i], weight = loops->loop[2 * i + 1];
        valid = count >= 3 && weight >= 1 && count <= loops->point_count - points;
        points += count;
        weights += count * weight;
        longest = count > longest ? count : longest;
    }
    if (!CHECK(valid && points == loops->point_count && longest == tree->info.border_longest,
               "the loops of the border contradict the header") ||
        !CHECK(weights <= 1 << 28, "the weights of the loops are too large"))
        return false;
    if (tree->info.pruned)
        return true;
    return CHECK(weights <= 3 * tree->mesh.face_count &&
                     value_of_faces(&tree->mesh) == value_of_loops(loops),
                 "the loops are not the border of the faces");
}

ebpo_status ebpo_check_border_rays(ebpo_tally *tally, ebpo_ray_points *points,
                                   const ebpo_reference_tree *view, unsigned threads,
                                   const ebpo_progress *progress, ebpo_error *error)
{
    const ebpo_tree *tree = view->tree;
    cap_list caps = { .loops = &tree->border };
    ebpo_status status = list_all_caps(&caps, error);
    if (status == EBPO_OK && caps.count) {
        CHECK(fabs(caps.area - tree->info.border_area) <= 1e-9 * caps.area + DBL_MIN,
              "the caps have an area of %.17g, the header states %.17g", caps.area,
              tree->info.border_area);
        ebpo_mesh mesh = { .vertex_count = tree->border.point_count,
                           .face_count = caps.count,
                           .xyz64 = tree->border.point,
                           .faces = caps.corner };
        status = ebpo_rays_follow(points, &mesh, &view->box, threads, progress, error);
        for (uint64_t i = 0; i < points->count && status == EBPO_OK; i++)
            /* `found` is the winding number of the caps; `stored` is now the winding number of the
             * faces */
            points->point[i].stored -= points->point[i].found;
    }
    free(caps.corner);
    return status;
}
