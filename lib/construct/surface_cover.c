/* Bounds the distance of a triangle T from a surface without cutting T.
 *
 * The function collects triangles of the surface that are connected and reach into the prism over
 * T. This prism contains all points whose projections along the normal of T are in T. Suppose that
 * the collected triangles cover T in this projection. Then each point of T has a point of the
 * surface above or below it, and the greatest height of the collected triangles over T, within the
 * prism, is an upper bound of the distance.
 *
 * The proof that they cover T counts modulo 2. The border of the collected triangles consists of
 * the edges that an odd number of them use. If the border does not enter the prism, all points
 * inside T are covered by an even number of triangles, or all by an odd number. So it is sufficient
 * to count for one point, the centre: along a ray from the centre, the number of crossings of the
 * border is odd exactly if the centre is covered. No orientation is needed, and edges may have more
 * than two triangles.
 *
 * At the border of the surface itself, edges inside the prism have no neighbour. A strip is added
 * to each of these edges: the edge, moved out of the prism in a direction that is the same for all
 * of them. A point of a strip has at most this distance from the surface. The strips of
 * neighbouring edges share a side, which counts as other edges do.
 *
 * Computed projections have rounding errors of less than 2^-43. The prism is enlarged by MARGIN,
 * and MARGIN is added to the bound. */
#include "core/strict_fp.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "construct/surface_cover.h"
#include "core/alloc.h"
#include "core/hash.h"
#include "geometry/vec3.h"

#define NONE UINT32_MAX
/* MOST_TRIANGLES: maximum number of collected triangles. MOST_OPEN: maximum number of edges with
 * strips. MOST_STEPS: maximum number of steps from a guess to the triangle. CORNERS: maximum number
 * of corners of a triangle that was clipped by three sides. Rounding errors may make a thin polygon
 * cross a side several times; each side adds at most half of the corners. */
enum { MOST_TRIANGLES = 128, MOST_OPEN = 16, MOST_STEPS = 16, CORNERS = 9 };
/* THIN: least ratio of a triangle's height and longest edge. TINY: least square of the longest
 * edge, above which nothing underflows. */
static const double MARGIN = 0x1p-42, THIN = 0x1p-6, TINY = 0x1p-200;

/* --- the surface --- */

/* Pairs the edges that have the same vertices. Returns false when out of memory. */
static bool find_neighbours(const ebpo_patch_mesh *m, uint32_t *across)
{
    uint64_t corners = 3 * m->triangle_count, slots = ebpo_hash_slots(2 * corners);
    uint32_t *single = ebpo_alloc(slots, sizeof *single); /* edges without a partner */
    if (!single)
        return false;
    memset(single, 0xff, slots * sizeof *single);
    memset(across, 0xff, corners * sizeof *across);
    for (uint64_t c = 0; c < corners; c++) {
        uint32_t p = m->triangle[c], q = m->triangle[c % 3 == 2 ? c - 2 : c + 1];
        uint64_t low = p < q ? p : q, high = p < q ? q : p,
                 i = ebpo_hash_number(low << 32 | high) & (slots - 1);
        for (; single[i] != NONE; i = (i + 1) & (slots - 1)) {
            uint32_t d = single[i], r = m->triangle[d], s = m->triangle[d % 3 == 2 ? d - 2 : d + 1];
            if (!((p == r && q == s) || (p == s && q == r)))
                continue;
            if (across[d] != NONE) /* both have partners, so the slot is used for this edge */
                break;
            across[d] = (uint32_t)(c / 3);
            across[c] = d / 3;
            break;
        }
        if (across[c] == NONE)
            single[i] = (uint32_t)c;
    }
    free(single);
    return true;
}

bool ebpo_cover_make(ebpo_cover *cover, const ebpo_patch_mesh *surface)
{
    *cover = (ebpo_cover){ .surface = surface };
    cover->across = ebpo_alloc(surface->triangle_count, 3 * sizeof *cover->across);
    cover->seen = ebpo_alloc_zero(surface->triangle_count, sizeof *cover->seen);
    cover->vertex = ebpo_alloc_zero(surface->vertex_count, sizeof *cover->vertex);
    return cover->across && cover->seen && cover->vertex && find_neighbours(surface, cover->across);
}

void ebpo_cover_free(ebpo_cover *cover)
{
    free(cover->across);
    free(cover->seen);
    free(cover->vertex);
}

/* --- the frame of a triangle --- */

/* Sets the frame to that of a triangle. Returns false if the triangle is too thin or too small for
 * the bound of rounding errors. */
static bool set_frame(ebpo_cover *c, const double p[3][3])
{
    double edge[3], other[3], normal[3], longest = 0, at[3][2] = { { 0 } };
    for (int k = 0; k < 3; k++) {
        ebpo_vec3_subtract(p[(k + 1) % 3], p[k], edge);
        longest = fmax(longest, ebpo_vec3_dot(edge, edge));
    }
    ebpo_vec3_subtract(p[1], p[0], edge);
    ebpo_vec3_subtract(p[2], p[0], other);
    ebpo_vec3_cross(edge, other, normal);
    double area = ebpo_vec3_length(normal), length = ebpo_vec3_length(edge);
    if (!(longest > TINY) || !(area > THIN * longest))
        return false;
    for (int k = 0; k < 3; k++) {
        c->axis[0][k] = edge[k] / length;
        c->axis[2][k] = normal[k] / area;
    }
    ebpo_vec3_cross(c->axis[2], c->axis[0], c->axis[1]);
    ebpo_vec3_copy(p[0], c->origin);
    at[1][0] = length;
    at[2][0] = ebpo_vec3_dot(other, c->axis[0]);
    at[2][1] = ebpo_vec3_dot(other, c->axis[1]);
    for (int k = 0; k < 3; k++) {
        const double *from = at[k], *to = at[(k + 1) % 3];
        double x = to[1] - from[1], y = from[0] - to[0], size = sqrt(x * x + y * y);
        x /= size;
        y /= size;
        c->side[k] = (ebpo_cover_side){ x, y, x * from[0] + y * from[1] + MARGIN };
    }
    for (int k = 0; k < 2; k++)
        c->centre[k] = (at[0][k] + at[1][k] + at[2][k]) / 3;
    c->turn++;
    return true;
}

/* Returns how far a projected point is outside of a side; negative: inside. */
static double distance_outside(const ebpo_cover_side *side, const double at[2])
{
    return side->x * at[0] + side->y * at[1] - side->most;
}

/* Returns a vertex of the surface in the frame of the current triangle. */
static const ebpo_cover_vertex *project_vertex(ebpo_cover *c, uint32_t vertex)
{
    ebpo_cover_vertex *v = &c->vertex[vertex];
    if (v->turn == c->turn)
        return v;
    double from_origin[3];
    ebpo_vec3_subtract(c->surface->vertex[vertex].at, c->origin, from_origin);
    *v = (ebpo_cover_vertex){ .turn = c->turn };
    for (int k = 0; k < 3; k++)
        v->at[k] = ebpo_vec3_dot(from_origin, c->axis[k]);
    for (unsigned k = 0; k < 3; k++)
        v->outside |= (distance_outside(&c->side[k], v->at) > 0 ? 1u : 0u) << k;
    return v;
}

/* Projects the corners of triangle t. Returns true if all are outside of the same side. */
static bool is_outside(ebpo_cover *c, uint64_t t, const ebpo_cover_vertex *corner[3])
{
    const uint32_t *v = c->surface->triangle + 3 * t;
    for (int k = 0; k < 3; k++)
        corner[k] = project_vertex(c, v[k]);
    return (corner[0]->outside & corner[1]->outside & corner[2]->outside) != 0;
}

/* Walks from triangle t towards the centre. Returns the first triangle that is not outside; NONE if
 * the walk ends before. */
static uint32_t walk_to_centre(ebpo_cover *c, uint32_t t)
{
    const ebpo_cover_vertex *corner[3];
    for (int step = 0; step < MOST_STEPS && t != NONE && is_outside(c, t, corner); step++) {
        /* twice the areas of the triangles of the centre and the edges; the walk crosses the edge
         * whose area has the wrong sign */
        double area[3], sum = 0;
        for (int k = 0; k < 3; k++) {
            const double *p = corner[k]->at, *q = corner[(k + 1) % 3]->at;
            area[k] = (p[0] - c->centre[0]) * (q[1] - c->centre[1]) -
                      (p[1] - c->centre[1]) * (q[0] - c->centre[0]);
            sum += area[k];
        }
        unsigned least = 0;
        for (unsigned k = 1; k < 3; k++)
            if (sum > 0 ? area[k] < area[least] : area[k] > area[least])
                least = k;
        t = c->across[3 * (uint64_t)t + least];
    }
    return t != NONE && !is_outside(c, t, corner) ? t : NONE;
}

/* --- heights --- */

/* A part of a triangle of the surface. */
typedef struct clipped {
    int count;
    double at[CORNERS][3];
} clipped;

/* Removes the part of a polygon that is outside of a side. */
static void clip_polygon(clipped *p, const ebpo_cover_side *side)
{
    clipped old;
    double beyond[CORNERS];
    old.count = p->count;
    memcpy(old.at, p->at, (size_t)p->count * sizeof *p->at);
    for (int i = 0; i < old.count; i++)
        beyond[i] = distance_outside(side, old.at[i]);
    p->count = 0;
    for (int i = 0; i < old.count; i++) {
        int next = i + 1 == old.count ? 0 : i + 1;
        if (beyond[i] <= 0)
            memcpy(p->at[p->count++], old.at[i], sizeof *old.at);
        if ((beyond[i] > 0) == (beyond[next] > 0))
            continue;
        double share = beyond[i] / (beyond[i] - beyond[next]);
        for (int k = 0; k < 3; k++)
            p->at[p->count][k] = old.at[i][k] + (old.at[next][k] - old.at[i][k]) * share;
        p->count++;
    }
}

/* Returns the greatest absolute height of a triangle of the surface within the prism, and sets
 * `highest` to the projection of the point with this height. May return a greater value that is at
 * most `least`; then `highest` does not change. */
static double height_inside(const ebpo_cover *c, const ebpo_cover_vertex *const corner[3],
                            double least, double highest[2])
{
    double height =
        ebpo_max3(fabs(corner[0]->at[2]), fabs(corner[1]->at[2]), fabs(corner[2]->at[2]));
    if (height <= least)
        return height;
    clipped p;
    p.count = 3;
    for (int k = 0; k < 3; k++)
        memcpy(p.at[k], corner[k]->at, sizeof *p.at);
    for (unsigned k = 0; k < 3; k++)
        if ((corner[0]->outside | corner[1]->outside | corner[2]->outside) >> k & 1)
            clip_polygon(&p, &c->side[k]);
    height = 0;
    for (int i = 0; i < p.count; i++)
        if (fabs(p.at[i][2]) > height) {
            height = fabs(p.at[i][2]);
            memcpy(highest, p.at[i], 2 * sizeof *highest);
        }
    return height;
}

/* --- borders --- */

/* Returns true if a segment crosses the ray from the centre along the first axis. */
static bool crosses_ray(const ebpo_cover *c, const double from[2], const double to[2])
{
    if ((from[1] > c->centre[1]) == (to[1] > c->centre[1]))
        return false;
    double share = (c->centre[1] - from[1]) / (to[1] - from[1]);
    return from[0] + (to[0] - from[0]) * share > c->centre[0];
}

/* Edges of the surface that have no neighbour and may be inside the prism. */
typedef struct open_edges {
    unsigned count;
    const ebpo_cover_vertex *end[MOST_OPEN][2];
} open_edges;

/* Moves a point by `shift` in the direction of a side. */
static void move_out(const double at[2], const ebpo_cover_side *side, double shift, double to[2])
{
    to[0] = at[0] + shift * side->x;
    to[1] = at[1] + shift * side->y;
}

/* Adds strips to open edges, by moving them out of a side. `odd`: the number of crossings of the
 * other border is odd. Returns an upper bound of the distance of the strips from the surface;
 * INFINITY if a border of the strips is inside the prism, or if the centre is not covered. */
static double add_strips(const ebpo_cover *c, const open_edges *open, const ebpo_cover_side *side,
                         bool odd)
{
    const ebpo_cover_vertex *const *end = open->end[0];
    double shift = 0, height = 0, to[2][2];
    for (unsigned i = 0; i < 2 * open->count; i++) {
        shift = fmax(shift, -distance_outside(side, end[i]->at));
        height = fmax(height, fabs(end[i]->at[2]));
    }
    shift += MARGIN;
    for (unsigned i = 0; i < 2 * open->count; i++) {
        unsigned before = 0, uses = 0;
        for (unsigned k = 0; k < 2 * open->count; k++) {
            uses += end[k] == end[i];
            before += k < i && end[k] == end[i];
        }
        if (before || uses % 2 == 0)
            continue;
        bool outside = false; /* the side of a strip that no other strip shares */
        move_out(end[i]->at, side, shift, to[0]);
        for (int k = 0; k < 3; k++)
            outside = outside || (distance_outside(&c->side[k], end[i]->at) > 0 &&
                                  distance_outside(&c->side[k], to[0]) > 0);
        if (!outside)
            return INFINITY;
        odd ^= crosses_ray(c, end[i]->at, to[0]);
    }
    for (unsigned i = 0; i < open->count; i++) {
        for (int k = 0; k < 2; k++)
            move_out(open->end[i][k]->at, side, shift, to[k]);
        odd ^= crosses_ray(c, to[0], to[1]);
    }
    return odd ? sqrt(height * height + shift * shift) : INFINITY;
}

/* Returns a triangle that is not outside: a guess, or one near the last guess. */
static uint32_t find_first(ebpo_cover *c, const uint64_t guess[EBPO_COVER_GUESSES])
{
    const ebpo_cover_vertex *corner[3];
    for (int i = EBPO_COVER_GUESSES; i-- > 0;)
        if (guess[i] != UINT64_MAX && !is_outside(c, guess[i], corner))
            return (uint32_t)guess[i];
    for (int i = EBPO_COVER_GUESSES; i-- > 0;)
        if (guess[i] != UINT64_MAX)
            return walk_to_centre(c, (uint32_t)guess[i]);
    return NONE;
}

double ebpo_cover_bound(ebpo_cover *c, const double p[3][3],
                        const uint64_t guess[EBPO_COVER_GUESSES], double least, uint64_t *near,
                        double far[3])
{
    uint32_t list[MOST_TRIANGLES];
    unsigned count = 1;
    bool odd = false;
    double bound = 0, highest[2];
    open_edges open;
    open.count = 0;
    if (!set_frame(c, p))
        return INFINITY;
    list[0] = find_first(c, guess);
    if (list[0] == NONE)
        return INFINITY;
    c->seen[list[0]] = c->turn;
    memcpy(highest, c->centre, sizeof highest);
    for (unsigned i = 0; i < count; i++) {
        const ebpo_cover_vertex *corner[3], *other[3];
        (void)is_outside(c, list[i], corner);
        bound = fmax(bound, height_inside(c, corner, fmax(bound, least), highest));
        for (unsigned k = 0; k < 3; k++) {
            const ebpo_cover_vertex *from = corner[k], *to = corner[(k + 1) % 3];
            uint32_t next = c->across[3 * (uint64_t)list[i] + k];
            if (next != NONE && !is_outside(c, next, other)) {
                if (c->seen[next] == c->turn)
                    continue;
                if (count == MOST_TRIANGLES)
                    return INFINITY;
                c->seen[next] = c->turn;
                list[count++] = next;
            } else if (next == NONE && !(from->outside & to->outside)) {
                if (open.count == MOST_OPEN)
                    return INFINITY;
                open.end[open.count][0] = from;
                open.end[open.count++][1] = to;
            } else {
                odd ^= crosses_ray(c, from->at, to->at);
            }
        }
    }
    double strips = open.count || !odd ? INFINITY : 0;
    for (int k = 0; k < 3 && open.count; k++)
        strips = fmin(strips, add_strips(c, &open, &c->side[k], odd));
    if (strips == INFINITY)
        return INFINITY;
    bound = fmax(bound, strips);
    *near = list[0];
    for (int k = 0; k < 3; k++)
        far[k] = c->origin[k] + highest[0] * c->axis[0][k] + highest[1] * c->axis[1][k];
    return bound + MARGIN;
}
