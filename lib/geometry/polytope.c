/* Cuts convex polytopes from the unit cube by half-spaces. In these coordinates, the unit cube is
 * the cell of a node.
 *
 * Half-spaces are stored as plane codes of 32 bits, which decode to integers, so that no reader
 * rounds. Polytopes have rounded vertices: they are used for volumes, for drawing and for the
 * choice of planes. Containment never depends on polytopes. Clipping works on the vertex loops of
 * the faces (BP 2008, section 3.4.3). If rounding would make the loops invalid, clipping leaves the
 * polytope as it is. So a polytope may be too large, but is never too small. An envelope is the
 * cell of a node, cut by the planes of its ancestors and by its own planes. */
#include "core/strict_fp.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "geometry/polytope.h"
#include "geometry/vec3.h"

/* --- plane codes --- */

bool ebpo_plane_code_decode(uint32_t code, int32_t n[3], int32_t *d)
{
    int32_t u = (int32_t)(code & 1023) - EBPO_NORMAL_NORM,
            v = (int32_t)(code >> 10 & 1023) - EBPO_NORMAL_NORM;
    int32_t q = (int32_t)(code >> 20);
    if (u > EBPO_NORMAL_NORM || v > EBPO_NORMAL_NORM || q >= EBPO_OFFSET_STEPS - 1)
        return false;
    int32_t w = EBPO_NORMAL_NORM - abs(u) - abs(v);
    n[0] = w >= 0 ? u : (u < 0 ? -1 : 1) * (EBPO_NORMAL_NORM - abs(v));
    n[1] = w >= 0 ? v : (v < 0 ? -1 : 1) * (EBPO_NORMAL_NORM - abs(u));
    n[2] = w;
    int32_t least = 0;
    for (int i = 0; i < 3; i++)
        least += n[i] < 0 ? n[i] : 0;
    *d = EBPO_OFFSET_STEPS * least + EBPO_NORMAL_NORM * (q + 1);
    return true;
}

/* Returns the greatest integer that is at most x. |x| must be below 2^31. (On machines without an
 * instruction for this, floor() is a function of the C library, which takes longer.) */
static int32_t floor_of(double x)
{
    int32_t i = (int32_t)x;
    return i - (x < i);
}

bool ebpo_plane_code_normal(const double direction[3], uint32_t *normal)
{
    double x = direction[0], y = direction[1], z = direction[2];
    /* most may be wrong if a coordinate is not a number, but then the sum of the coordinates is not
     * finite */
    double most = ebpo_max3(fabs(x), fabs(y), fabs(z));
    if (!(most > 0) || !isfinite(most) || !isfinite(x + y + z))
        return false;
    x /= most, y /= most, z /= most; /* prevents overflow and underflow of the sum below */
    double scale = EBPO_NORMAL_NORM / (fabs(x) + fabs(y) + fabs(z));
    double u = x * scale, v = y * scale;
    if (z < 0) {
        double fu = (EBPO_NORMAL_NORM - fabs(v)) * (u < 0 ? -1 : 1);
        double fv = (EBPO_NORMAL_NORM - fabs(u)) * (v < 0 ? -1 : 1);
        u = fu, v = fv;
    }
    int32_t iu = floor_of(u + 0.5), iv = floor_of(v + 0.5);
    iu = iu < -EBPO_NORMAL_NORM ? -EBPO_NORMAL_NORM : iu > EBPO_NORMAL_NORM ? EBPO_NORMAL_NORM : iu;
    iv = iv < -EBPO_NORMAL_NORM ? -EBPO_NORMAL_NORM : iv > EBPO_NORMAL_NORM ? EBPO_NORMAL_NORM : iv;
    *normal = (uint32_t)(iu + EBPO_NORMAL_NORM) | (uint32_t)(iv + EBPO_NORMAL_NORM) << 10;
    return true;
}

int ebpo_plane_code_offset(const int32_t n[3], double support)
{
    double least = 0;
    for (int i = 0; i < 3; i++)
        least += n[i] < 0 ? n[i] : 0;
    /* The values are below 2^21 and have relative errors of a few 2^-53. So the error is less than
     * 1e-8 steps. */
    double steps = (support - least) * ((double)EBPO_OFFSET_STEPS / EBPO_NORMAL_NORM) + 1e-8;
    if (!(steps <= EBPO_OFFSET_STEPS - 1))
        return -1;
    return steps <= 0 ? 0 : -floor_of(-steps) - 1;
}

/* --- polytopes and volumes --- */

/* A vertex within this distance from a plane is treated as on the plane. */
static const double tolerance = 1e-10;

void ebpo_polytope_cube(ebpo_polytope *p)
{
    /* The coordinates of vertex i are the bits of i: bit 0 is x, bit 1 y, bit 2 z. */
    static const uint16_t loops[6][4] = { { 0, 4, 6, 2 }, { 1, 3, 7, 5 }, { 0, 1, 5, 4 },
                                          { 2, 6, 7, 3 }, { 0, 2, 3, 1 }, { 4, 5, 7, 6 } };
    p->vertex_count = 8;
    p->face_count = 6;
    p->corner_count = 24;
    for (int i = 0; i < 8; i++)
        for (int k = 0; k < 3; k++)
            p->vertex[i][k] = i >> k & 1;
    for (int f = 0; f < 6; f++) {
        p->tag[f] = -1 - f;
        p->first[f] = (uint16_t)(4 * f);
        memcpy(p->corner + 4 * f, loops[f], sizeof loops[f]);
    }
    p->first[6] = 24;
}

void ebpo_polytope_copy(ebpo_polytope *to, const ebpo_polytope *from)
{
    to->vertex_count = from->vertex_count;
    to->face_count = from->face_count;
    to->corner_count = from->corner_count;
    memcpy(to->vertex, from->vertex, (size_t)from->vertex_count * sizeof from->vertex[0]);
    memcpy(to->tag, from->tag, (size_t)from->face_count * sizeof from->tag[0]);
    memcpy(to->first, from->first, (size_t)(from->face_count + 1) * sizeof from->first[0]);
    memcpy(to->corner, from->corner, (size_t)from->corner_count * sizeof from->corner[0]);
}

double ebpo_polytope_volume(const ebpo_polytope *p)
{
    const double *o = p->vertex[0];
    double sum = 0;
    for (int f = 0; f < p->face_count; f++) {
        const double *a = p->vertex[p->corner[p->first[f]]];
        double oa[3] = { a[0] - o[0], a[1] - o[1], a[2] - o[2] };
        for (int i = p->first[f] + 1; i + 1 < p->first[f + 1]; i++) {
            const double *b = p->vertex[p->corner[i]], *c = p->vertex[p->corner[i + 1]];
            double ob[3] = { b[0] - o[0], b[1] - o[1], b[2] - o[2] };
            double oc[3] = { c[0] - o[0], c[1] - o[1], c[2] - o[2] };
            double n[3];
            ebpo_vec3_cross(ob, oc, n);
            sum += ebpo_vec3_dot(oa, n);
        }
    }
    return sum / 6;
}

/* Computes the point where the edge from a to b crosses a plane. `da`, `db`: signed distances of a
 * and b from the plane. */
static void interpolate_crossing(const double a[3], double da, const double b[3], double db,
                                 double out[3])
{
    double t = da / (da - db);
    for (int k = 0; k < 3; k++)
        out[k] = a[k] + t * (b[k] - a[k]);
}

double ebpo_polytope_cap_bound(double volume, double width, double height)
{
    if (!(height > 1e-9) || !(width > 0))
        return 0;
    double remaining = height < width ? 1 - height / width : 0;
    return volume * (1 - remaining * remaining * remaining);
}

/* The part of a polytope beyond a plane. Its volume is computed as a sum of pyramids. All pyramids
 * have the same tip: the vertex farthest from the plane. One base is the cut, the polygon in which
 * the plane intersects the polytope. The area of the cut is computed from its edges, in any order.
 * The other bases are the parts of the polytope's faces beyond the plane. Each of these bases is
 * divided into a fan of triangles. A face with the farthest vertex is omitted, because its pyramid
 * has no volume. */
typedef struct beyond {
    const ebpo_polytope *p;
    double dist[EBPO_POLYTOPE_VERTICES];  /* signed distance of each vertex; positive: beyond */
    bool outside[EBPO_POLYTOPE_VERTICES]; /* true if the vertex is beyond the plane */
    double fans;                          /* six times the volume of the pyramids on the faces */
    double area[3];                       /* twice the area of the cut, as a vector */
    double origin[3];                     /* a point of the cut, valid if `started` */
    int farthest;                         /* vertex with the greatest distance */
    bool started;
} beyond;

static void point_between(const beyond *c, int out, int in, double x[3])
{
    /* always interpolates from the outer end, so that both faces at the edge get the same point */
    interpolate_crossing(c->p->vertex[out], c->dist[out], c->p->vertex[in], c->dist[in], x);
}

/* Adds an edge of the cut. */
static void add_edge(beyond *c, const double from[3], const double to[3])
{
    if (!c->started) {
        c->started = true;
        memcpy(c->origin, from, sizeof c->origin);
        return; /* the triangle of the origin and this edge has no area */
    }
    double u[3], v[3], n[3];
    ebpo_vec3_subtract(from, c->origin, u);
    ebpo_vec3_subtract(to, c->origin, v);
    ebpo_vec3_cross(u, v, n);
    for (int k = 0; k < 3; k++)
        c->area[k] += n[k];
}

/* Adds corner x to the fan of triangles of the part of a face beyond the plane. *kept: number of
 * corners of the fan so far. first, last: the first and the latest corner of the fan, relative to
 * the farthest vertex. */
static void add_to_fan(beyond *c, const double x[3], int *kept, double first[3], double last[3])
{
    double v[3], n[3];
    ebpo_vec3_subtract(x, c->p->vertex[c->farthest], v);
    if (*kept == 0)
        memcpy(first, v, sizeof v);
    else if (*kept > 1) {
        ebpo_vec3_cross(last, v, n);
        c->fans += ebpo_vec3_dot(first, n);
    }
    memcpy(last, v, sizeof v);
    ++*kept;
}

/* Adds the pyramid on the part of face `f` beyond the plane, and the edge that this face has in
 * common with the cut. */
static void face_beyond(beyond *c, int f)
{
    const ebpo_polytope *p = c->p;
    const uint16_t *loop = p->corner + p->first[f];
    int count = p->first[f + 1] - p->first[f], outside = 0, kept = 0;
    bool fan = true;
    for (int i = 0; i < count; i++) {
        outside += c->outside[loop[i]];
        fan &= loop[i] != c->farthest;
    }
    if (!outside)
        return;
    double enter[3] = { 0, 0, 0 }, leave[3] = { 0, 0, 0 }, first[3] = { 0, 0, 0 },
           last[3] = { 0, 0, 0 };
    for (int i = 0, a = loop[count - 1]; i < count; a = loop[i++]) {
        int b = loop[i];
        bool a_out = c->outside[a], b_out = c->outside[b];
        if (a_out != b_out) {
            point_between(c, a_out ? a : b, a_out ? b : a, a_out ? leave : enter);
            if (fan)
                add_to_fan(c, a_out ? leave : enter, &kept, first, last);
        }
        if (fan && b_out)
            add_to_fan(c, p->vertex[b], &kept, first, last);
    }
    if (outside < count)
        add_edge(c, enter, leave);
}

double ebpo_polytope_removed(const ebpo_polytope *p, const double n[3], double d, double volume,
                             double least)
{
    beyond c;
    double low = 1e300, high = -1e300;
    if (!p->vertex_count)
        return 0;
    for (int i = 0; i < p->vertex_count; i++) {
        double e = ebpo_vec3_dot(n, p->vertex[i]) - d;
        c.dist[i] = e;
        c.outside[i] = e > 0;
        low = e < low ? e : low;
        if (e > high)
            high = e, c.farthest = i;
    }
    if (!(high > 0) || (least > 0 && ebpo_polytope_cap_bound(volume, high - low, high) < least))
        return 0;
    c.p = p;
    c.fans = c.area[0] = c.area[1] = c.area[2] = 0;
    c.started = false;
    for (int f = 0; f < p->face_count; f++)
        face_beyond(&c, f);
    return (c.fans + high * fabs(ebpo_vec3_dot(n, c.area)) / ebpo_vec3_dot(n, n)) / 6;
}

/* --- clipping --- */

/* Positions of a vertex relative to the cutting plane, as bits, so that a face has the bits of all
 * its vertices. */
enum { VERTEX_KEPT = 1, VERTEX_ON = 2, VERTEX_REMOVED = 4 };

typedef struct cut {
    const ebpo_polytope *in;
    const double (*x)[3]; /* coordinates of the vertices of `in`; used in place of in->vertex */
    ebpo_polytope *out;
    double dist[EBPO_POLYTOPE_VERTICES]; /* signed distance of each vertex of `in` from the plane;
                                            positive: removed */
    uint8_t position[EBPO_POLYTOPE_VERTICES]; /* VERTEX_KEPT etc. of each vertex of `in` */
    uint16_t number[EBPO_POLYTOPE_VERTICES];  /* indices of kept vertices in `out` */
    bool on[EBPO_POLYTOPE_VERTICES]; /* true if the vertex of `out` is on the cutting plane */
    /* edges that the plane crosses. edge.in, edge.out: the kept and the removed vertex, as indices
     * in the polytope `in`; number: index of the new vertex in the polytope `out` */
    struct {
        uint16_t in, out, number;
    } edge[EBPO_POLYTOPE_FACES];
    int edges;
    /* rim edges: edges of kept loops that are on the plane */
    struct {
        uint16_t from, to;
    } rim[EBPO_POLYTOPE_CORNERS];
    int rims;
    bool full; /* the capacity of `out` is exceeded */
    /* true: some vertex of `in` is on the plane, so a rim edge may have kept faces on both sides */
    bool touched;
} cut;

static uint16_t add_vertex(cut *c, const double x[3], bool on)
{
    if (c->out->vertex_count == EBPO_POLYTOPE_VERTICES) {
        c->full = true;
        return 0;
    }
    int i = c->out->vertex_count++;
    memcpy(c->out->vertex[i], x, sizeof c->out->vertex[i]);
    c->on[i] = on;
    return (uint16_t)i;
}

/* Returns the vertex of c->out where the plane crosses the edge from the kept vertex `in` to the
 * removed vertex `out`. */
static uint16_t crossing_vertex(cut *c, uint16_t in, uint16_t out)
{
    if (c->position[in] == VERTEX_ON)
        return c->number[in];
    for (int i = 0; i < c->edges; i++)
        if (c->edge[i].in == in && c->edge[i].out == out)
            return c->edge[i].number;
    if (c->edges == EBPO_POLYTOPE_FACES) {
        c->full = true;
        return 0;
    }
    double x[3];
    interpolate_crossing(c->x[in], c->dist[in], c->x[out], c->dist[out], x);
    uint16_t number = add_vertex(c, x, true);
    c->edge[c->edges].in = in;
    c->edge[c->edges].out = out;
    c->edge[c->edges++].number = number;
    return number;
}

/* Adds a corner to the loop that begins at loop_start. Omits the corner if it equals the previous
 * corner. */
static void add_corner(cut *c, int loop_start, uint16_t v)
{
    ebpo_polytope *o = c->out;
    if (o->corner_count > loop_start && o->corner[o->corner_count - 1] == v)
        return;
    if (o->corner_count == EBPO_POLYTOPE_CORNERS) {
        c->full = true;
        return;
    }
    o->corner[o->corner_count++] = v;
}

/* Ends the loop that begins at `start`. A loop with fewer than three corners is removed. */
static void close_face(cut *c, int start, int32_t tag)
{
    ebpo_polytope *o = c->out;
    while (o->corner_count > start + 1 && o->corner[o->corner_count - 1] == o->corner[start])
        o->corner_count--;
    if (o->corner_count - start < 3 || o->corner_count - start > 255 ||
        o->face_count == EBPO_POLYTOPE_FACES) {
        /* users store corner counts in bytes */
        c->full |= o->corner_count - start > 255 || o->face_count == EBPO_POLYTOPE_FACES;
        o->corner_count = start;
        return;
    }
    o->tag[o->face_count] = tag;
    o->first[o->face_count++] = (uint16_t)start;
    o->first[o->face_count] = (uint16_t)o->corner_count;
}

/* Adds the loop of a face with at least one removed vertex. */
static void clip_loop(cut *c, const uint16_t *loop, int count, int start)
{
    for (int i = 0; i < count; i++) {
        uint16_t a = loop[i], b = loop[i + 1 < count ? i + 1 : 0];
        bool a_out = c->position[a] == VERTEX_REMOVED, b_out = c->position[b] == VERTEX_REMOVED;
        if (!a_out)
            add_corner(c, start, c->number[a]);
        if (a_out != b_out)
            add_corner(c, start, a_out ? crossing_vertex(c, b, a) : crossing_vertex(c, a, b));
    }
}

/* Adds the loop of a face without removed vertices. */
static void copy_loop(cut *c, const uint16_t *loop, int count)
{
    ebpo_polytope *o = c->out;
    if (o->corner_count + count > EBPO_POLYTOPE_CORNERS) {
        c->full = true;
        return;
    }
    for (int i = 0; i < count; i++)
        o->corner[o->corner_count++] = c->number[loop[i]];
}

static void clip_face(cut *c, int f)
{
    const ebpo_polytope *p = c->in;
    const uint16_t *loop = p->corner + p->first[f];
    int count = p->first[f + 1] - p->first[f], start = c->out->corner_count;
    unsigned positions = 0;
    for (int i = 0; i < count; i++)
        positions |= c->position[loop[i]];
    if (!(positions & VERTEX_KEPT))
        return;
    if (positions & VERTEX_REMOVED)
        clip_loop(c, loop, count, start);
    else
        copy_loop(c, loop, count);
    close_face(c, start, p->tag[f]);
    if (positions == VERTEX_KEPT)
        return; /* no corner is on the plane */
    for (int i = start; i < c->out->corner_count && !c->full; i++) {
        uint16_t a = c->out->corner[i],
                 b = c->out->corner[i + 1 < c->out->corner_count ? i + 1 : start];
        if (c->on[a] && c->on[b]) {
            c->rim[c->rims].from = a;
            c->rim[c->rims++].to = b;
        }
    }
}

/* Adds the face on the cutting plane, the cap. A rim edge is an edge of a kept face that is on this
 * plane. If a rim edge occurs in both directions, the faces on both sides are kept, so this edge
 * does not bound the cap. The other rim edges, in reverse direction, bound the cap. Returns false
 * if the edges of the cap do not form one closed loop. */
static bool close_cap(cut *c, int32_t tag)
{
    int16_t next[EBPO_POLYTOPE_VERTICES];
    memset(next, -1, (size_t)c->out->vertex_count * sizeof *next);
    int open = 0, begin = -1;
    for (int i = 0; i < c->rims; i++) {
        bool paired = false;
        for (int j = 0; c->touched && j < c->rims && !paired; j++)
            paired = c->rim[i].from == c->rim[j].to && c->rim[i].to == c->rim[j].from;
        if (paired)
            continue;
        if (next[c->rim[i].to] != -1)
            return false;
        next[c->rim[i].to] = c->rim[i].from;
        begin = c->rim[i].to;
        open++;
    }
    if (open < 3)
        return false;
    int start = c->out->corner_count, at = begin, steps = 0;
    do {
        add_corner(c, start, (uint16_t)at);
        at = next[at];
        steps++;
    } while (at != -1 && at != begin && steps <= open);
    if (at != begin || steps != open)
        return false;
    close_face(c, start, tag);
    return true;
}

/* Makes c->out from c->in, c->x and c->dist. Returns EBPO_CLIP_CUT; or returns another value, and
 * the contents of c->out are undefined. */
static ebpo_clip make_cut(cut *c, int32_t tag)
{
    const ebpo_polytope *p = c->in;
    ebpo_polytope *o = c->out;
    double most = -1e300, least = 1e300;
    for (int i = 0; i < p->vertex_count; i++) {
        double e = c->dist[i];
        most = e > most ? e : most;
        least = e < least ? e : least;
    }
    if (most <= tolerance)
        return EBPO_CLIP_NONE;
    if (least >= -1e-7) /* almost nothing would remain */
        return EBPO_CLIP_REFUSED;
    c->edges = c->rims = 0;
    c->full = c->touched = false;
    o->vertex_count = o->face_count = o->corner_count = 0;
    o->first[0] = 0;
    for (int i = 0; i < p->vertex_count; i++) {
        bool removed = c->dist[i] > tolerance, on = !removed && c->dist[i] >= -tolerance;
        c->position[i] = removed ? VERTEX_REMOVED : on ? VERTEX_ON : VERTEX_KEPT;
        c->touched |= on;
        if (!removed)
            c->number[i] = add_vertex(c, c->x[i], on);
    }
    for (int f = 0; f < p->face_count && !c->full; f++)
        clip_face(c, f);
    return c->full || !close_cap(c, tag) || c->full || o->face_count < 4 ? EBPO_CLIP_REFUSED
                                                                         : EBPO_CLIP_CUT;
}

ebpo_clip ebpo_polytope_clip(ebpo_polytope *p, const double n[3], double d, int32_t tag)
{
    cut c;
    ebpo_polytope out;
    c.in = p;
    c.x = (const double(*)[3])p->vertex;
    c.out = &out;
    for (int i = 0; i < p->vertex_count; i++)
        c.dist[i] = ebpo_vec3_dot(n, p->vertex[i]) - d;
    ebpo_clip clip = make_cut(&c, tag);
    if (clip == EBPO_CLIP_CUT)
        ebpo_polytope_copy(p, &out);
    return clip;
}

/* --- halves and children --- */

/* Not inlined in ebpo_polytope_child: there, a copy for each of three calls takes 25 KiB of stack.
 */
__attribute__((noinline)) bool ebpo_polytope_half(const ebpo_polytope *p, int axis, int side,
                                                  ebpo_polytope *out)
{
    cut c;
    double scaled[EBPO_POLYTOPE_VERTICES][3];
    c.in = p;
    c.x = (const double(*)[3])scaled;
    c.out = out;
    memcpy(scaled, p->vertex, (size_t)p->vertex_count * sizeof *scaled);
    for (int i = 0; i < p->vertex_count; i++) {
        double x = 2 * p->vertex[i][axis] - side;
        scaled[i][axis] = x;
        c.dist[i] = side ? -x : x - 1;
    }
    ebpo_clip clip = make_cut(&c, -1 - (2 * axis + !side));
    if (clip == EBPO_CLIP_NONE) {
        ebpo_polytope_copy(out, p);
        memcpy(out->vertex, scaled, (size_t)p->vertex_count * sizeof *scaled);
    } else if (clip == EBPO_CLIP_REFUSED)
        ebpo_polytope_cube(out);
    return clip != EBPO_CLIP_REFUSED;
}

bool ebpo_polytope_child(const ebpo_polytope *p, unsigned octant, ebpo_polytope *out)
{
    ebpo_polytope quarter;
    bool not_empty = ebpo_polytope_half(p, 2, octant >> 2 & 1, out);
    not_empty = ebpo_polytope_half(out, 1, octant >> 1 & 1, &quarter) && not_empty;
    return ebpo_polytope_half(&quarter, 0, octant & 1, out) && not_empty;
}

void ebpo_polytope_sides(const ebpo_polytope *p, uint8_t sides[EBPO_POLYTOPE_VERTICES])
{
    memset(sides, 0, EBPO_POLYTOPE_VERTICES);
    for (int f = 0; f < p->face_count; f++)
        for (int i = p->first[f]; p->tag[f] < 0 && i < p->first[f + 1]; i++)
            sides[p->corner[i]] |= (uint8_t)(1u << (-1 - p->tag[f]));
}

/* --- envelopes --- */

void ebpo_planes_cut(ebpo_polytope *envelope, const uint32_t *codes, uint64_t count)
{
    for (uint64_t i = 0; i < count; i++) {
        int32_t v[3], d;
        double n[3];
        if (!ebpo_plane_code_decode(codes[i], v, &d))
            continue;
        double offset = ebpo_plane_as_double(v, d, n);
        (void)ebpo_polytope_clip(envelope, n, offset, (int32_t)i);
    }
}

void ebpo_half_spaces_add(ebpo_half_spaces *s, const uint32_t *codes, uint64_t count)
{
    for (uint64_t i = 0; i < count && s->count < EBPO_HALF_SPACES_MAX; i++) {
        int32_t d;
        ebpo_half_space *next = &s->at[s->count];
        if (!ebpo_plane_code_decode(codes[i], next->n, &d))
            continue;
        next->d = d;
        s->count++;
    }
}

/* Returns true if the half-space contains the whole cell. */
static bool keeps_cell(const ebpo_half_space *h)
{
    int64_t most = 0;
    for (int k = 0; k < 3; k++)
        most += h->n[k] > 0 ? h->n[k] : 0;
    return EBPO_OFFSET_STEPS * most <= h->d;
}

void ebpo_half_spaces_to_child(ebpo_half_spaces *s, unsigned octant)
{
    int kept = 0;
    for (int i = 0; i < s->count; i++) {
        ebpo_half_space h = s->at[i];
        h.d = ebpo_plane_to_child(h.n, h.d, octant);
        if (!keeps_cell(&h))
            s->at[kept++] = h;
    }
    s->count = kept;
}

void ebpo_half_spaces_cut(const ebpo_half_spaces *s, double slack, ebpo_polytope *out)
{
    ebpo_polytope_cube(out);
    for (int i = 0; i < s->count; i++) {
        double n[3], d = ebpo_plane_as_double(s->at[i].n, s->at[i].d, n);
        (void)ebpo_polytope_clip(out, n, d + slack, i);
    }
}

const ebpo_polytope *ebpo_envelope_put(ebpo_envelope_stack *stack, ebpo_octcode octcode,
                                       const uint32_t *codes, uint64_t count)
{
    int level = ebpo_octcode_level(octcode);
    ebpo_polytope *envelope = &stack->at[level];
    if (level)
        (void)ebpo_polytope_child(&stack->at[level - 1], octcode & 7, envelope);
    else
        ebpo_polytope_cube(envelope);
    ebpo_planes_cut(envelope, codes, count);
    stack->octcode[level] = octcode;
    return envelope;
}

const ebpo_polytope *ebpo_envelope_put_cube(ebpo_envelope_stack *stack, ebpo_octcode octcode)
{
    int level = ebpo_octcode_level(octcode);
    ebpo_polytope_cube(&stack->at[level]);
    stack->octcode[level] = octcode;
    return &stack->at[level];
}
