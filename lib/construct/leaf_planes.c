/* Incremental: each point beyond the hull takes the place of the facets that it sees. Points that
 * are extreme in some directions come first, so that most others never are. */
#include "core/strict_fp.h"

#include <math.h>
#include <stdbool.h>
#include <stdlib.h>
#include <string.h>

#include "construct/planes.h"
#include "construct/construct_stages.h"
#include "construct/sweep.h"
#include "core/hash.h"
#include "geometry/polytope.h"

static const double flat = 1e-9; /* what is nearer to a plane lies in it */

_Static_assert((int)EBPO_HULL_FACETS <= (int)EBPO_SWEEP_PLANES, "sweeps have room for the facets");

enum { ROOM = EBPO_HULL_FACETS, WAYS = 14, VISIBLE = 192 };

/* Planes by coordinate: each point is tested against all of them. */
typedef struct hull {
    const ebpo_sweep *sweep;
    const double (*p)[3];
    /* behind the last one, up to a full four: planes that nothing sees */
    double nx[ROOM + 4], ny[ROOM + 4], nz[ROOM + 4], d[ROOM + 4];
    double length[ROOM], beyond;
    uint16_t corner[ROOM][3];
    int count, capacity;
} hull;

static void cross_of(const double (*p)[3], int a, int b, int c, double n[3])
{
    double u[3], v[3];
    for (int k = 0; k < 3; k++) {
        u[k] = p[b][k] - p[a][k];
        v[k] = p[c][k] - p[a][k];
    }
    n[0] = u[1] * v[2] - u[2] * v[1];
    n[1] = u[2] * v[0] - u[0] * v[2];
    n[2] = u[0] * v[1] - u[1] * v[0];
}

static double hull_directions_square(const double n[3])
{
    return n[0] * n[0] + n[1] * n[1] + n[2] * n[2];
}

static void set_plane(hull *h, int i, const double n[3], double d)
{
    h->nx[i] = n[0];
    h->ny[i] = n[1];
    h->nz[i] = n[2];
    h->d[i] = d;
}

/* The facet at place i; false when it has no area. */
static bool make_facet(hull *h, int i, int a, int b, int c)
{
    double n[3];
    cross_of(h->p, a, b, c, n);
    double length = sqrt(hull_directions_square(n));
    if (!(length > 1e-18))
        return false;
    const double *p = h->p[a];
    for (int k = 0; k < 3; k++)
        n[k] /= length;
    set_plane(h, i, n, n[0] * p[0] + n[1] * p[1] + n[2] * p[2]);
    h->length[i] = length;
    h->corner[i][0] = (uint16_t)a;
    h->corner[i][1] = (uint16_t)b;
    h->corner[i][2] = (uint16_t)c;
    return true;
}

static void move_facet(hull *h, int to, int from)
{
    set_plane(h, to, (const double[3]){ h->nx[from], h->ny[from], h->nz[from] }, h->d[from]);
    h->length[to] = h->length[from];
    memcpy(h->corner[to], h->corner[from], sizeof h->corner[to]);
}

static void set_count(hull *h, int count)
{
    static const double none[3];
    h->count = count;
    for (int i = count; i % 4; i++)
        set_plane(h, i, none, 1e300);
}

/* --- where to begin --- */

/* The most extreme points along the axes and the diagonals, both ways. */
static void hull_directions_extremes(const double (*p)[3], int count, int at[WAYS])
{
    double best[WAYS];
    for (int w = 0; w < WAYS; w++)
        best[w] = -INFINITY, at[w] = 0;
    for (int i = 0; i < count; i++) {
        double x = p[i][0], y = p[i][1], z = p[i][2],
               v[WAYS / 2] = { x, y, z, x + y + z, x + y - z, x - y + z, x - y - z };
        for (int w = 0; w < WAYS / 2; w++) {
            if (v[w] > best[2 * w])
                best[2 * w] = v[w], at[2 * w] = i;
            if (-v[w] > best[2 * w + 1])
                best[2 * w + 1] = -v[w], at[2 * w + 1] = i;
        }
    }
}

static double hull_directions_distance2(const double a[3], const double b[3])
{
    double d[3] = { a[0] - b[0], a[1] - b[1], a[2] - b[2] };
    return hull_directions_square(d);
}

static double hull_directions_height(const double n[3], const double from[3], const double p[3])
{
    return n[0] * (p[0] - from[0]) + n[1] * (p[1] - from[1]) + n[2] * (p[2] - from[2]);
}

/* Four points far from each other; false when there are none that span a volume. */
static bool first_four(const double (*p)[3], int count, const int ways[WAYS], int corner[4])
{
    double best = -1, n[3];
    for (int w = 0; w < 6; w += 2)
        if (hull_directions_distance2(p[ways[w]], p[ways[w + 1]]) > best)
            best = hull_directions_distance2(p[ways[w]], p[ways[w + 1]]), corner[0] = ways[w + 1],
            corner[1] = ways[w];
    best = 0;
    corner[2] = corner[3] = 0;
    for (int i = 0; i < count; i++) {
        cross_of(p, corner[0], corner[1], i, n);
        if (hull_directions_square(n) > best)
            best = hull_directions_square(n), corner[2] = i;
    }
    if (!(best > flat * flat))
        return false;
    cross_of(p, corner[0], corner[1], corner[2], n);
    double length = sqrt(hull_directions_square(n)), side = 0;
    for (int i = 0; i < count; i++) {
        double h = hull_directions_height(n, p[corner[0]], p[i]);
        if (fabs(h) > fabs(side))
            side = h, corner[3] = i;
    }
    if (side > 0) { /* the fourth lies behind the first three */
        int swap = corner[1];
        corner[1] = corner[2];
        corner[2] = swap;
    }
    return fabs(side) > flat * length;
}

static bool first_facets(hull *h, const int c[4])
{
    static const int sides[4][3] = { { 0, 1, 2 }, { 0, 3, 1 }, { 1, 3, 2 }, { 2, 3, 0 } };
    for (int i = 0; i < 4; i++)
        if (!make_facet(h, i, c[sides[i][0]], c[sides[i][1]], c[sides[i][2]]))
            return false;
    set_count(h, 4);
    return true;
}

/* --- one more point --- */

/* Edges as from << 16 | to, and turned around; to a multiple of four, with what is none. */
static int edges_of(const hull *h, const uint16_t *visible, int seen, uint32_t *edges,
                    uint32_t *twins)
{
    int listed = 0;
    for (int i = 0; i < seen; i++) {
        const uint16_t *corner = h->corner[visible[i]];
        for (int e = 0; e < 3; e++) {
            uint32_t from = corner[e], to = corner[e == 2 ? 0 : e + 1];
            edges[listed] = from << 16 | to;
            twins[listed++] = to << 16 | from;
        }
    }
    for (int i = listed; i % 4; i++)
        edges[i] = 0;
    return listed;
}

/* No early exit from the loop, so that compilers vectorise it. */
static bool hull_directions_has(const uint32_t *edges, int fours, uint32_t edge)
{
    uint32_t found = 0;
    for (int i = 0; i < 4 * fours; i++)
        found |= edges[i] == edge;
    return found;
}

/* Slots that got no new facet are filled from the end. */
static void close_gaps(hull *h, const uint16_t *place, int from, int to, int count)
{
    for (int i = to - 1; i >= from; i--) /* places ascend */
        if (place[i] != --count)
            move_facet(h, place[i], count);
    set_count(h, count);
}

/* False when no more points are to be added: too much in one step. (Then facets may overlap; they
 * still give directions.) */
static bool hull_directions_add_point(hull *h, int point)
{
    uint16_t visible[VISIBLE];
    uint32_t edges[3 * VISIBLE], twins[3 * VISIBLE];
    const ebpo_sweep_planes planes = { h->nx, h->ny, h->nz, h->d, (h->count + 3) / 4 };
    int seen = h->sweep->seen(&planes, h->p[point], h->beyond, flat, visible, VISIBLE), made = 0,
        count = h->count;
    if (seen == 0)
        return true;
    if (seen > VISIBLE)
        return false;
    int listed = edges_of(h, visible, seen, edges, twins);
    for (int i = 0; i < listed; i++) {
        if (hull_directions_has(edges, (listed + 3) / 4, twins[i]))
            continue;
        if (made >= seen && count == h->capacity)
            return false;
        int place = made < seen ? visible[made] : count;
        if (!make_facet(h, place, (int)(edges[i] >> 16), (int)(edges[i] & 0xffff), point))
            continue;
        count += made++ >= seen;
    }
    if (made < seen)
        close_gaps(h, visible, made, seen, count);
    else
        set_count(h, count);
    return true;
}

static void grow_hull(hull *h, int count, const int ways[WAYS])
{
    for (int w = 0; w < WAYS; w++)
        if (!hull_directions_add_point(h, ways[w]))
            return;
    for (int i = 0; i < count; i++)
        if (!hull_directions_add_point(h, i))
            return;
}

int ebpo_hull_facets(const double (*points)[3], int count, double tolerance,
                     ebpo_hull_facet *facets, int capacity)
{
    hull h;
    int corner[4] = { 0 }, ways[WAYS];
    h.sweep = ebpo_sweep_best();
    h.p = points;
    h.count = 0;
    h.capacity = capacity < ROOM ? capacity : ROOM;
    h.beyond = tolerance;
    if (count < 4 || capacity < 4 || count > EBPO_HULL_POINTS)
        return 0;
    hull_directions_extremes(points, count, ways);
    if (!first_four(points, count, ways, corner) || !first_facets(&h, corner))
        return 0;
    grow_hull(&h, count, ways);
    for (int i = 0; i < h.count; i++)
        facets[i] = (ebpo_hull_facet){ .corner = { h.corner[i][0], h.corner[i][1], h.corner[i][2] },
                                       .n = { h.nx[i], h.ny[i], h.nz[i] },
                                       .d = h.d[i],
                                       .area = h.length[i] / 2 };
    return h.count;
}

int ebpo_hull_by_area(const void *a, const void *b)
{
    const ebpo_hull_facet *f = a, *g = b;
    if (f->area != g->area)
        return f->area < g->area ? 1 : -1;
    for (int i = 0; i < 3; i++)
        if (f->corner[i] != g->corner[i])
            return f->corner[i] < g->corner[i] ? -1 : 1;
    return 0;
}

/* A face against a cell: which octants it may touch, and its part in the cell. Everything errs on
 * the safe side by a bound on the rounding, so that no exact arithmetic is needed: including a
 * neighbour costs nothing, missing one is a bug. */

/* Cell coordinates: one rounding in the subtraction, one in the division; corners and sizes of
 * cells are exact. */
static double to_cell(const ebpo_box *box, ebpo_cell cell, const ebpo_triangle *face,
                      double x[3][3])
{
    double most = 1;
    for (int k = 0; k < 3; k++) {
        double corner = ebpo_wall(box, k, cell.level, cell.at[k]);
        double size = box->size[k] / (double)(1u << cell.level);
        for (int i = 0; i < 3; i++) {
            x[i][k] = (face->corner[i][k] - corner) / size;
            double a = fabs(x[i][k]);
            most = a > most ? a : most;
        }
    }
    return most;
}

/* With coordinates up to M: 2.01 u M from to_cell, and at most 8 u M for each of six clips; 128 u M
 * covers their sum. One value for all faces that do not reach far: then the points that two faces
 * share come out the same from both. */
static double slack_for(double most) { return most <= 2 ? 0x1p-45 : most * 0x1p-46; }

static int clip_wall(double in[9][3], int count, int axis, double sign, double limit,
                     double out[9][3])
{
    int kept = 0;
    for (int i = 0; i < count; i++) {
        const double *a = in[i], *b = in[i + 1 < count ? i + 1 : 0];
        double da = sign * a[axis] - limit, db = sign * b[axis] - limit;
        if (da <= 0) {
            for (int k = 0; k < 3; k++)
                out[kept][k] = a[k];
            kept++;
        }
        if ((da < 0 && db > 0) || (da > 0 && db < 0)) {
            bool back = da > 0; /* from the inner end, whichever way the face runs along its edge */
            const double *from = back ? b : a, *to = back ? a : b;
            double t = back ? db / (db - da) : da / (da - db);
            for (int k = 0; k < 3; k++)
                out[kept][k] = from[k] + t * (to[k] - from[k]);
            out[kept][axis] = sign * limit;
            kept++;
        }
    }
    return kept;
}

int ebpo_clip_triangle(const ebpo_box *box, ebpo_cell cell, const ebpo_triangle *face,
                       double points[9][3], double *slack)
{
    double x[3][3], other[9][3], e = slack_for(to_cell(box, cell, face, x));
    *slack = e;
    int count = 3;
    for (int i = 0; i < 3; i++)
        for (int k = 0; k < 3; k++)
            points[i][k] = x[i][k];
    for (int k = 0; k < 3; k++) {
        double low = fmin(x[0][k], fmin(x[1][k], x[2][k])),
               high = fmax(x[0][k], fmax(x[1][k], x[2][k]));
        if (low > 1 + e || high < -e)
            return 0;
        if (high <= 1 + e && low >= -e)
            continue;
        int n = clip_wall(points, count, k, 1, 1 + e, other);
        count = clip_wall(other, n, k, -1, e, points);
    }
    return count;
}

typedef struct separation {
    double x[3][3], edge[3][3], normal[3];
    double most;
} separation;

static void triangle_cell_prepare(separation *s)
{
    for (int i = 0; i < 3; i++)
        for (int k = 0; k < 3; k++)
            s->edge[i][k] = s->x[(i + 1) % 3][k] - s->x[i][k];
    const double *a = s->edge[0], *b = s->edge[1];
    s->normal[0] = a[1] * b[2] - a[2] * b[1];
    s->normal[1] = a[2] * b[0] - a[0] * b[2];
    s->normal[2] = a[0] * b[1] - a[1] * b[0];
}

/* True when the plane of the face or a cross product of one of its edges with an axis separates it
 * from the cube around `centre`. Errors: edges 4 u M; cross terms below 64 u M^2; the plane's below
 * 512 u M^3 (u = 2^-53). */
static bool triangle_cell_separated(const separation *s, const double centre[3], double half)
{
    double m = s->most, tolerance = 0x1p-44 * m * m * m;
    double distance = 0, radius = 0;
    for (int k = 0; k < 3; k++) {
        distance += s->normal[k] * (s->x[0][k] - centre[k]);
        radius += fabs(s->normal[k]);
    }
    if (fabs(distance) > half * radius + tolerance)
        return true;
    tolerance = 0x1p-46 * m * m;
    for (int i = 0; i < 3; i++) {
        const double *p = s->x[i], *q = s->x[(i + 2) % 3], *e = s->edge[i];
        for (int k = 0; k < 3; k++) {
            int a = (k + 1) % 3, b = (k + 2) % 3;
            double dp = e[a] * (p[b] - centre[b]) - e[b] * (p[a] - centre[a]);
            double dq = e[a] * (q[b] - centre[b]) - e[b] * (q[a] - centre[a]);
            double r = half * (fabs(e[a]) + fabs(e[b])) + tolerance;
            if ((dp > r && dq > r) || (dp < -r && dq < -r))
                return true;
        }
    }
    return false;
}

/* By the walls between the octants, which are exact. */
static unsigned octants_of_bounds(const ebpo_box *box, ebpo_cell cell, const ebpo_triangle *face)
{
    static const unsigned low_side[3] = { 0x55, 0x33, 0x0f };
    unsigned mask = 255;
    for (int k = 0; k < 3; k++) {
        double wall = ebpo_wall(box, k, cell.level + 1, 2 * cell.at[k] + 1), a = face->corner[0][k],
               b = face->corner[1][k], c = face->corner[2][k];
        if (a > wall && b > wall && c > wall)
            mask &= ~low_side[k];
        if (a < wall && b < wall && c < wall)
            mask &= low_side[k];
    }
    return mask;
}

unsigned ebpo_octants_touched(const ebpo_box *box, ebpo_cell cell, const ebpo_triangle *face)
{
    unsigned mask = octants_of_bounds(box, cell, face);
    if ((mask & (mask - 1)) == 0)
        return mask;
    separation s;
    s.most = to_cell(box, cell, face, s.x);
    triangle_cell_prepare(&s);
    for (unsigned octant = 0; octant < 8; octant++) {
        if (!(mask >> octant & 1))
            continue;
        double centre[3];
        for (int k = 0; k < 3; k++)
            centre[k] = octant >> k & 1 ? 0.75 : 0.25;
        if (triangle_cell_separated(&s, centre, 0.25))
            mask &= ~(1u << octant);
    }
    return mask;
}

bool ebpo_triangle_misses_cell(const ebpo_box *box, ebpo_cell cell, const ebpo_triangle *face)
{
    separation s;
    s.most = to_cell(box, cell, face, s.x);
    double e = slack_for(s.most);
    for (int k = 0; k < 3; k++)
        if (fmin(s.x[0][k], fmin(s.x[1][k], s.x[2][k])) > 1 + e ||
            fmax(s.x[0][k], fmax(s.x[1][k], s.x[2][k])) < -e)
            return true;
    triangle_cell_prepare(&s);
    return triangle_cell_separated(&s, (const double[3]){ 0.5, 0.5, 0.5 }, 0.5);
}

bool ebpo_face_normal_code(const ebpo_box *box, const ebpo_triangle *face, uint32_t *normal)
{
    /* In coordinates scaled by the root box, which has the same shape as every cell, the normal
     * needs no further scaling. */
    separation s;
    s.most = to_cell(box, (ebpo_cell){ 0, { 0, 0, 0 } }, face, s.x);
    triangle_cell_prepare(&s);
    return ebpo_plane_code_normal(s.normal, normal);
}

/* The envelope of a leaf, from its faces: the directions of the hull of what they leave in the
 * cell. */

enum { LEAF_CANDIDATES = 64, LEAF_POINTS = 192, LEAF_TABLE = 512 };

/* Extreme points of the solid in the cell, and what rounding may add to a coordinate. */
typedef struct leaf_points {
    double at[LEAF_POINTS][3], slack[LEAF_POINTS];
    int count;
    /* by hash: 1 + place of the point; most corners of faces come several times */
    uint8_t number[LEAF_TABLE];
} leaf_points;

static bool add_candidate(uint32_t normal, ebpo_candidate *out, int *count)
{
    for (int i = 0; i < *count; i++)
        if (out[i].normal == normal)
            return true;
    if (*count < LEAF_CANDIDATES)
        out[(*count)++] = (ebpo_candidate){ .normal = normal, .support = -1e300 };
    return *count < LEAF_CANDIDATES;
}

/* --- few points: their hull --- */

static bool is_point(const double a[3], const double b[3])
{
    return a[0] == b[0] && a[1] == b[1] && a[2] == b[2];
}

static bool leaf_planes_add_point(leaf_points *points, const double p[3], double slack)
{
    uint64_t bits[3], place;
    memcpy(bits, p, sizeof bits);
    EBPO_HASH_FIND(place, ebpo_hash_three(bits), LEAF_TABLE - 1,
                   !points->number[place] || is_point(points->at[points->number[place] - 1], p));
    if (points->number[place]) {
        int i = points->number[place] - 1;
        points->slack[i] = fmax(points->slack[i], slack);
        return true;
    }
    if (points->count == LEAF_POINTS)
        return false;
    points->number[place] = (uint8_t)(points->count + 1);
    for (int k = 0; k < 3; k++)
        points->at[points->count][k] = p[k];
    points->slack[points->count++] = slack;
    return true;
}

/* False when there are more than fit. */
static bool gather_points(const ebpo_box *box, ebpo_cell cell, const ebpo_triangle *faces,
                          uint64_t count, unsigned inside, leaf_points *points)
{
    points->count = 0;
    memset(points->number, 0, sizeof points->number);
    for (int i = 0; i < 8; i++)
        if (inside >> i & 1)
            (void)leaf_planes_add_point(points, (const double[3]){ i & 1, i >> 1 & 1, i >> 2 & 1 },
                                        0);
    for (uint64_t i = 0; i < count; i++) {
        double p[9][3], slack;
        int corners = ebpo_clip_triangle(box, cell, &faces[i], p, &slack);
        for (int c = 0; c < corners; c++)
            if (!leaf_planes_add_point(points, p[c], slack))
                return false;
    }
    return true;
}

static int hull_normals(const leaf_points *points, ebpo_candidate *out)
{
    ebpo_hull_facet facets[2 * LEAF_POINTS];
    int count = ebpo_hull_facets((const double(*)[3])points->at, points->count, 1e-9, facets,
                                 2 * LEAF_POINTS),
        kept = 0;
    if (count > LEAF_CANDIDATES)
        qsort(facets, (size_t)count, sizeof *facets, ebpo_hull_by_area);
    for (int i = 0; i < count; i++) {
        uint32_t normal;
        if (ebpo_plane_code_normal(facets[i].n, &normal) && !add_candidate(normal, out, &kept))
            break;
    }
    return kept;
}

/* --- many points, or all of them in a plane: the faces' directions --- */

/* Distinct normals of the faces, of many an even sample; and the opposite ones, for solids and
 * surfaces without thickness. */
static int face_normals(const ebpo_box *box, const ebpo_triangle *faces, uint64_t count,
                        ebpo_candidate *out)
{
    int kept = 0;
    uint64_t step = count / (LEAF_CANDIDATES / 2) + 1;
    for (uint64_t i = 0; i < count; i += step) {
        uint32_t normal;
        if (!ebpo_face_normal_code(box, &faces[i], &normal))
            continue;
        int32_t n[3], d;
        ebpo_plane_code_decode(normal, n, &d);
        if (!add_candidate(normal, out, &kept))
            break;
        if (ebpo_plane_code_normal((const double[3]){ -n[0], -n[1], -n[2] }, &normal) &&
            !add_candidate(normal, out, &kept))
            break;
    }
    return kept;
}

/* --- offsets --- */

static void raise_supports(ebpo_candidate *c, double (*n)[3], int count, const double p[3],
                           double slack)
{
    double rounding = EBPO_NORMAL_NORM * slack;
    for (int j = 0; j < count; j++) {
        double s = n[j][0] * p[0] + n[j][1] * p[1] + n[j][2] * p[2] + rounding;
        c[j].support = s > c[j].support ? s : c[j].support;
    }
}

static void leaf_planes_decode(const ebpo_candidate *c, int count, double (*n)[3])
{
    for (int j = 0; j < count; j++) {
        int32_t v[3], d;
        ebpo_plane_code_decode(c[j].normal, v, &d);
        for (int k = 0; k < 3; k++)
            n[j][k] = v[k];
    }
}

static void supports_of_faces(const ebpo_box *box, ebpo_cell cell, const ebpo_triangle *faces,
                              uint64_t count, unsigned inside, ebpo_candidate *c, double (*n)[3],
                              int kept)
{
    for (uint64_t i = 0; i < count; i++) {
        double p[9][3], slack;
        int corners = ebpo_clip_triangle(box, cell, &faces[i], p, &slack);
        for (int k = 0; k < corners; k++)
            raise_supports(c, n, kept, p[k], slack);
    }
    for (int i = 0; i < 8; i++)
        if (inside >> i & 1)
            raise_supports(c, n, kept, (const double[3]){ i & 1, i >> 1 & 1, i >> 2 & 1 }, 0);
}

static int leaf_candidates(const ebpo_box *box, ebpo_cell cell, const ebpo_triangle *faces,
                           uint64_t count, unsigned inside_corners,
                           ebpo_candidate out[LEAF_CANDIDATES])
{
    leaf_points points;
    double n[LEAF_CANDIDATES][3];
    bool few = gather_points(box, cell, faces, count, inside_corners, &points);
    int kept = few ? hull_normals(&points, out) : 0;
    if (kept == 0)
        kept = face_normals(box, faces, count, out);
    leaf_planes_decode(out, kept, n);
    if (!few)
        supports_of_faces(box, cell, faces, count, inside_corners, out, n, kept);
    for (int i = 0; few && i < points.count; i++)
        raise_supports(out, n, kept, points.at[i], points.slack[i]);
    return kept;
}

int ebpo_leaf_planes(const ebpo_box *box, ebpo_cell cell, const ebpo_triangle *faces,
                     uint64_t count, unsigned inside_corners, double epsilon,
                     ebpo_polytope *envelope, uint32_t codes[EBPO_PLANES_MAX])
{
    ebpo_candidate candidates[LEAF_CANDIDATES];
    int kept = leaf_candidates(box, cell, faces, count, inside_corners, candidates);
    if (epsilon > 0)
        return ebpo_select_greedy(envelope,
                                  &(ebpo_choice){ .candidates = candidates,
                                                  .count = kept,
                                                  .most = EBPO_PLANES_MAX,
                                                  .epsilon = epsilon,
                                                  .reach = ebpo_needle },
                                  codes);
    return ebpo_select_all(envelope, candidates, kept, EBPO_PLANES_MAX, codes);
}
