/* Encodes, decodes, reads and checks patches of the simplified surface. A patch is a list of
 * triangles, which replaces the faces of one node.
 *
 * Most triangles are reached over an open edge: an edge of an earlier triangle to which the
 * neighbouring triangle is not yet known. A byte of the code states the third vertex. It is often
 * new, or the other end of an open edge beside the first. Vertices are numbered in the order in
 * which the triangles use them first. The position of a vertex is stored as the difference from a
 * prediction in the plane of the triangle on the other side of the edge, near the fourth corner of
 * a parallelogram. Source: format-spec/surface.md. */
#include "core/strict_fp.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "core/alloc.h"
#include "core/endian.h"
#include "core/error.h"
#include "core/fp_env.h"
#include "core/hash.h"
#include "format/reader.h"
#include "format/surface_patches.h"
#include "geometry/vec3.h"

#define NONE UINT32_MAX

/* A byte of code: the third vertex of the triangle at the last open edge. */
enum {
    NEW_VERTEX = 0,   /* a vertex that no triangle has used */
    LEFT_VERTEX = 1,  /* where the open edge before begins */
    RIGHT_VERTEX = 2, /* where the open edge after ends */
    NO_TRIANGLE = 3,  /* there is no triangle at the edge */
    FAR_VERTEX = 4    /* any other vertex, by a number */
};

/* Coordinates of a stored normal are 0 to NORMALS - 1. */
enum { NORMAL_STEPS = 63, NORMALS = 2 * NORMAL_STEPS + 1 };

/* --- state of encoder and decoder --- */

/* An edge, in the direction in which the next triangle at this edge uses it. */
typedef struct open_edge {
    uint32_t from, to, beyond; /* beyond: third vertex of the triangle that has the edge */
    /* indices of the open edges that end at `from` and begin at `to` on the border of the triangles
     * so far; NONE: unknown */
    uint32_t before, after;
    bool open; /* false: removed; the element stays until it is the last one */
} open_edge;

/* The open edges. After each triangle, they are equal in the encoder and the decoder. */
typedef struct open_edges {
    open_edge *edge; /* [triangles + 3] */
    uint32_t count;
    uint32_t *begins; /* [vertices] index of the last edge that was opened at a vertex, or NONE */
    bool *rim;        /* [vertices] true: the vertex is at an edge without a triangle */
} open_edges;

static bool make_edges(open_edges *s, uint64_t triangles, uint64_t vertices)
{
    s->edge = ebpo_alloc(triangles + 3, sizeof *s->edge);
    s->begins = ebpo_alloc(vertices, sizeof *s->begins);
    s->rim = ebpo_alloc_zero(vertices, sizeof *s->rim);
    if (s->begins)
        memset(s->begins, 0xff, vertices * sizeof *s->begins);
    return s->edge && s->begins && s->rim;
}

static void free_edges(open_edges *s)
{
    free(s->edge);
    free(s->begins);
    free(s->rim);
}

static void link_edges(open_edges *s, uint32_t before, uint32_t after)
{
    if (before != NONE)
        s->edge[before].after = after;
    if (after != NONE)
        s->edge[after].before = before;
}

static uint32_t add_edge(open_edges *s, uint32_t from, uint32_t to, uint32_t beyond)
{
    s->edge[s->count] = (open_edge){ from, to, beyond, NONE, NONE, true };
    return s->begins[from] = s->count++;
}

/* Removes the last open edge, which is returned in *out. Returns false if no edge is open. */
static bool take_edge(open_edges *s, open_edge *out)
{
    while (s->count) {
        *out = s->edge[--s->count];
        if (out->open)
            return true;
    }
    return false;
}

/* Adds the edges of a triangle that was reached over no open edge. A triangle with equal corners
 * has no edges. */
static void add_first_edges(open_edges *s, const uint32_t t[3])
{
    if (t[0] == t[1] || t[1] == t[2] || t[2] == t[0])
        return;
    uint32_t x = add_edge(s, t[1], t[0], t[2]), y = add_edge(s, t[0], t[2], t[1]),
             z = add_edge(s, t[2], t[1], t[0]);
    link_edges(s, x, y);
    link_edges(s, y, z);
    link_edges(s, z, x);
}

/* Notes that the edge `e`, which was removed, has no triangle. */
static void end_edge(open_edges *s, const open_edge *e)
{
    link_edges(s, e->before, NONE);
    link_edges(s, NONE, e->after);
    s->rim[e->from] = s->rim[e->to] = true;
}

/* Notes that the edges that are still open have no triangle. */
static void end_edges(open_edges *s)
{
    open_edge e;
    while (take_edge(s, &e))
        end_edge(s, &e);
}

/* Adds the other edges of the triangle (e->from, e->to, v) at the removed edge `e`, or removes them
 * if they are open on the other side. */
static void add_edges(open_edges *s, const open_edge *e, uint32_t v)
{
    uint32_t begins = NONE, ends = NONE; /* edges that begin and end at v */
    bool left = e->before != NONE && s->edge[e->before].from == v,
         right = e->after != NONE && s->edge[e->after].to == v;
    if (left) {
        ends = s->edge[e->before].before;
        s->edge[e->before].open = false;
    }
    if (right) {
        begins = s->edge[e->after].after;
        s->edge[e->after].open = false;
    }
    if (left && right) {
        link_edges(s, ends, begins);
    } else if (left) {
        uint32_t last = add_edge(s, v, e->to, e->from);
        link_edges(s, ends, last);
        link_edges(s, last, e->after);
    } else if (right) {
        uint32_t last = add_edge(s, e->from, v, e->to);
        link_edges(s, e->before, last);
        link_edges(s, last, begins);
    } else {
        uint32_t i = s->begins[v];
        if (i < s->count && s->edge[i].open && s->edge[i].from == v) {
            begins = i;
            ends = s->edge[i].before;
        }
        uint32_t first = add_edge(s, e->from, v, e->to), last = add_edge(s, v, e->to, e->from);
        link_edges(s, e->before, first);
        link_edges(s, last, e->after);
        link_edges(s, first, begins == NONE ? last : begins);
        if (begins != NONE)
            link_edges(s, ends, last);
    }
}

/* Vertices from which the position of a vertex is predicted. If `beyond` is NONE, the prediction is
 * the position of the vertex with the previous number. */
typedef struct prediction {
    uint32_t a, b, beyond;
} prediction;

/* A predicted position, and the normal of the triangle from which it was predicted. */
typedef struct predicted_point {
    int32_t at[3];
    double normal[3]; /* 0: no triangle */
    int steep;        /* axis on which the normal is longest */
} predicted_point;

/* Predicts the position of vertex v from the positions `point` of the vertices with lower numbers:
 * beyond the middle of a and b, by three quarters of the distance of `beyond` from there. */
static predicted_point predict_point(const int16_t *point, const prediction *p, uint32_t v)
{
    predicted_point out = { { 0, 0, 0 }, { 0, 0, 0 }, 2 };
    double from_a[3], from_b[3];
    for (uint32_t k = 0; k < 3 && v; k++) {
        if (p->beyond == NONE) {
            out.at[k] = point[3 * (v - 1) + k];
            continue;
        }
        int32_t a = point[3 * p->a + k], b = point[3 * p->b + k], c = point[3 * p->beyond + k];
        out.at[k] = (int32_t)floor((7 * (a + b) - 6 * c) / 8.0 + 0.5);
        from_a[k] = a - c;
        from_b[k] = b - c;
    }
    if (v && p->beyond != NONE) {
        const double *n = out.normal;
        ebpo_vec3_cross(from_a, from_b, out.normal);
        out.steep = fabs(n[0]) >= fabs(n[1]) && fabs(n[0]) >= fabs(n[2]) ? 0
                    : fabs(n[1]) >= fabs(n[2])                           ? 1
                                                                         : 2;
    }
    return out;
}

/* Returns the predicted coordinate i of `point`, whose coordinates except p->steep are known. On
 * the axis p->steep, the plane of the triangle at these coordinates is the prediction. All numbers
 * are integers below 2^53, so only the division and the last sum round; quotients are below 2^18
 * and divisors below 2^33, so this does not change the result. */
static int32_t predict_coordinate(const predicted_point *p, int i, const int16_t point[3])
{
    const double *n = p->normal;
    int u = (i + 1) % 3, w = (i + 2) % 3;
    if (i != p->steep || n[i] == 0)
        return p->at[i];
    double rise = n[u] * (point[u] - p->at[u]) + n[w] * (point[w] - p->at[w]);
    return p->at[i] - (int32_t)floor(rise / n[i] + 0.5);
}

/* Returns the vertex whose colour is subtracted from the colour of v. */
static uint32_t vertex_before(const prediction *p, uint32_t v)
{
    return p->beyond == NONE ? v - 1 : p->a;
}

/* --- encoding --- */

/* State of encoding a patch. */
typedef struct coder {
    const ebpo_patch_source *in;
    ebpo_patch_rows *out;
    open_edges edges;
    /* [slots] hash table of directed edges: index in in->triangle of the first corner where the
     * edge begins; NONE: a free slot */
    uint32_t *corner;
    uint64_t slots;
    uint32_t *same;   /* [triangles][3] next corner where the same directed edge begins, or NONE */
    bool *done;       /* [triangles] true: the triangle is encoded */
    uint32_t *number; /* [vertices] new number of each vertex of `in`; NONE: not used yet */
    uint32_t *vertex; /* [vertices] for each new number: the vertex of `in` */
    prediction *from; /* [vertices] for each new number: how the vertex's position is predicted */
    uint32_t next;    /* next new number */
    uint8_t *numbers; /* bytes of numbers, which end the code in reverse order */
    uint64_t number_bytes, number_capacity;
    bool short_of_memory;
} coder;

static void put_byte(coder *c, uint32_t byte)
{
    if (ebpo_grow(&c->out->code, &c->out->code_capacity, c->out->code_bytes + 1, 1))
        c->out->code[c->out->code_bytes++] = (uint8_t)byte;
    else
        c->short_of_memory = true;
}

/* Writes seven bits of the number in each byte, the lowest bits first. The highest bit of a byte is
 * 1 if more bytes follow. */
static void put_number(coder *c, uint32_t value)
{
    for (bool last = false; !last; value >>= 7) {
        last = value < 128;
        if (ebpo_grow(&c->numbers, &c->number_capacity, c->number_bytes + 1, 1))
            c->numbers[c->number_bytes++] = (uint8_t)(value | (last ? 0 : 128));
        else
            c->short_of_memory = true;
    }
}

/* Returns the corner after corner i in the same triangle. */
static uint32_t next_corner(uint32_t i) { return i - i % 3 + (i + 1) % 3; }

/* Returns the slot of a directed edge, or the free slot for it. */
static uint64_t find_edge(const coder *c, uint32_t from, uint32_t to)
{
    const uint32_t *t = c->in->triangle;
    uint64_t slot;
    EBPO_HASH_FIND(slot, ebpo_hash_number((uint64_t)from << 32 | to), c->slots - 1,
                   c->corner[slot] == NONE ||
                       (t[c->corner[slot]] == from && t[next_corner(c->corner[slot])] == to));
    return slot;
}

/* Enters the edges of all triangles into the hash table. Corners of the same edge are a list, in
 * ascending order, because a degenerate mesh can have one edge in all its triangles. */
static void enter_edges(coder *c)
{
    const uint32_t *t = c->in->triangle;
    for (uint32_t i = (uint32_t)(3 * c->in->triangle_count); i-- > 0;) {
        uint64_t slot = find_edge(c, t[i], t[next_corner(i)]);
        c->same[i] = c->corner[slot];
        c->corner[slot] = i;
    }
}

/* Returns the first corner at which a directed edge begins in a triangle that is not yet encoded,
 * or NONE. Removes the corners before it from the edge's list, so all calls together visit each
 * corner once. */
static uint32_t find_corner(const coder *c, uint32_t from, uint32_t to)
{
    uint32_t *first = &c->corner[find_edge(c, from, to)];
    while (*first != NONE && c->done[*first / 3] && c->same[*first] != NONE)
        *first = c->same[*first]; /* the last corner stays, because it occupies the slot */
    return *first != NONE && !c->done[*first / 3] ? *first : NONE;
}

/* Gives the vertex `former` of `in` the next new number, which is returned. */
static uint32_t new_number(coder *c, uint32_t former, prediction from)
{
    c->vertex[c->next] = former;
    c->from[c->next] = from;
    return c->number[former] = c->next++;
}

/* Encodes a triangle at the open edge `e`. i: corner of the triangle where this edge begins. */
static void put_attached(coder *c, const open_edge *e, uint32_t i)
{
    uint32_t former = c->in->triangle[i - i % 3 + (i + 2) % 3], v = c->number[former];
    if (v == NONE) {
        v = new_number(c, former, (prediction){ e->from, e->to, e->beyond });
        put_byte(c, NEW_VERTEX);
    } else if (e->before != NONE && c->edges.edge[e->before].from == v) {
        put_byte(c, LEFT_VERTEX);
    } else if (e->after != NONE && c->edges.edge[e->after].to == v) {
        put_byte(c, RIGHT_VERTEX);
    } else {
        put_byte(c, FAR_VERTEX);
        put_number(c, c->next - 1 - v);
    }
    add_edges(&c->edges, e, v);
}

/* Encodes a triangle when no edge is open. */
static void put_free(coder *c, uint64_t triangle)
{
    uint32_t t[3];
    for (int k = 0; k < 3; k++) {
        uint32_t former = c->in->triangle[3 * triangle + (uint64_t)k], v = c->number[former];
        put_number(c, v == NONE ? 0 : c->next - v);
        t[k] = v == NONE ? new_number(c, former, (prediction){ 0, 0, NONE }) : v;
    }
    add_first_edges(&c->edges, t);
}

/* Encodes all triangles. Each step takes a triangle that is not yet encoded, at the last open edge.
 * If no edge is open, the step takes the first triangle that is not yet encoded. Vertices without
 * triangles get the last numbers. */
static void put_triangles(coder *c)
{
    uint64_t first = 0;
    for (uint64_t remaining = c->in->triangle_count; remaining;) {
        open_edge e;
        uint64_t taken;
        if (take_edge(&c->edges, &e)) {
            uint32_t i = find_corner(c, c->vertex[e.from], c->vertex[e.to]);
            if (i == NONE) {
                put_byte(c, NO_TRIANGLE);
                end_edge(&c->edges, &e);
                continue;
            }
            put_attached(c, &e, i);
            taken = i / 3;
        } else {
            while (c->done[first])
                first++;
            put_free(c, first);
            taken = first;
        }
        c->done[taken] = true;
        remaining--;
    }
    end_edges(&c->edges);
    while (c->number_bytes)
        put_byte(c, c->numbers[--c->number_bytes]);
    for (uint32_t v = 0; v < c->in->vertex_count; v++)
        if (c->number[v] == NONE)
            c->edges.rim[new_number(c, v, (prediction){ 0, 0, NONE })] = true;
}

/* Returns false if the reader computes the normal of vertex v. */
static bool is_stored(const uint8_t *normal, uint64_t v)
{
    return normal[2 * v] || normal[2 * v + 1];
}

static double sign_of(double v) { return v < 0 ? -1 : 1; }

/* Projects a direction on an octahedron, which is unfolded to a square: returns two coordinates
 * from 0 to 2 NORMAL_STEPS, NORMAL_STEPS in the middle. */
static void encode_normal(const double n[3], uint8_t out[2])
{
    double sum = fabs(n[0]) + fabs(n[1]) + fabs(n[2]), x = n[0] / sum, y = n[1] / sum;
    if (n[2] < 0) {
        double folded = (1 - fabs(y)) * sign_of(x);
        y = (1 - fabs(x)) * sign_of(y);
        x = folded;
    }
    out[0] = (uint8_t)floor(x * NORMAL_STEPS + NORMAL_STEPS + 0.5);
    out[1] = (uint8_t)floor(y * NORMAL_STEPS + NORMAL_STEPS + 0.5);
}

/* Sets a normal to length 1. A normal of length 0 becomes (0, 0, 1). */
static void set_normal(const double n[3], float out[3])
{
    double length = ebpo_vec3_length(n);
    for (int k = 0; k < 3; k++)
        out[k] = length > 0 ? (float)(n[k] / length) : k == 2;
}

/* Decodes a normal. Its coordinates are 1 more than those of encode_normal. */
static void decode_normal(const uint8_t in[2], float out[3])
{
    double x = (double)(in[0] - 1 - NORMAL_STEPS) / NORMAL_STEPS,
           y = (double)(in[1] - 1 - NORMAL_STEPS) / NORMAL_STEPS, z = 1 - fabs(x) - fabs(y);
    if (z < 0) {
        double folded = (1 - fabs(y)) * sign_of(x);
        y = (1 - fabs(x)) * sign_of(y);
        x = folded;
    }
    set_normal((double[3]){ x, y, z }, out);
}

/* Returns the number that stands for a difference of 16 bits: 0, -1, 1, -2, ... become 0, 1, 2, 3,
 * ... */
static uint16_t encode_zigzag(int32_t value)
{
    int16_t wrapped = (int16_t)(uint16_t)value;
    return (uint16_t)((uint32_t)wrapped << 1 ^ (wrapped < 0 ? 0xffffu : 0));
}

static int32_t decode_zigzag(uint16_t code) { return code >> 1 ^ -(code & 1); }

/* Writes the normals, those at the rim first, because most of the others are not stored. */
static void put_normals(const coder *c)
{
    uint8_t last[2] = { 0, 0 }, *to = c->out->normal; /* last: the last stored normal */
    memset(to, 0, 2 * c->in->vertex_count);
    for (int rim = 1; rim >= 0; rim--) {
        for (uint32_t v = 0; v < c->in->vertex_count; v++) {
            const double *n = c->in->normal[c->vertex[v]];
            uint8_t normal[2];
            if (c->edges.rim[v] != rim)
                continue;
            if (n[0] != 0 || n[1] != 0 || n[2] != 0) {
                encode_normal(n, normal);
                for (int k = 0; k < 2; k++)
                    to[k] = (uint8_t)((normal[k] - last[k] + NORMALS) % NORMALS + 1);
                memcpy(last, normal, sizeof last);
            }
            to += 2;
        }
    }
}

/* Writes the rows of vertices, as differences. `point`: temporary memory for the vertices in the
 * order of their new numbers. */
static void put_vertices(const coder *c, int16_t *point)
{
    put_normals(c);
    for (uint32_t v = 0; v < c->in->vertex_count; v++) {
        uint32_t former = c->vertex[v], before = v ? vertex_before(&c->from[v], v) : 0;
        predicted_point predicted = predict_point(point, &c->from[v], v);
        int16_t *at = point + 3 * v;
        memcpy(at, c->in->point + 3 * former, 3 * sizeof *point);
        for (int k = 0; k < 3; k++)
            c->out->point[3 * v + (uint32_t)k] =
                encode_zigzag(at[k] - predict_coordinate(&predicted, k, at));
        for (uint32_t k = 0; k < 3 && c->out->colour; k++)
            c->out->colour[3 * v + k] =
                (uint8_t)(c->in->colour[3 * former + k] -
                          (v ? c->in->colour[3 * c->vertex[before] + k] : 0));
    }
}

void ebpo_patch_rows_free(ebpo_patch_rows *rows)
{
    free(rows->code);
    free(rows->point);
    free(rows->normal);
    free(rows->colour);
    memset(rows, 0, sizeof *rows);
}

ebpo_status ebpo_patch_encode(const ebpo_patch_source *source, ebpo_patch_rows *out,
                              ebpo_error *error)
{
    uint64_t vertices = source->vertex_count, triangles = source->triangle_count;
    coder c = { .in = source, .out = out, .slots = ebpo_hash_slots(6 * triangles) };
    memset(out, 0, sizeof *out);
    c.corner = ebpo_alloc(c.slots, sizeof *c.corner);
    c.same = ebpo_alloc(triangles, 3 * sizeof *c.same);
    c.done = ebpo_alloc_zero(triangles, sizeof *c.done);
    c.number = ebpo_alloc(vertices, sizeof *c.number);
    c.vertex = ebpo_alloc(vertices, sizeof *c.vertex);
    c.from = ebpo_alloc(vertices, sizeof *c.from);
    int16_t *point = ebpo_alloc(vertices, 3 * sizeof *point);
    out->point = ebpo_alloc(vertices, 3 * sizeof *out->point);
    out->normal = ebpo_alloc(vertices, 2);
    out->colour = source->colour ? ebpo_alloc(vertices, 3) : NULL;
    bool made = make_edges(&c.edges, triangles, vertices) && c.corner && c.same && c.done &&
                c.number && c.vertex && c.from && point && out->point && out->normal &&
                (out->colour || !source->colour);
    if (made) {
        memset(c.corner, 0xff, c.slots * sizeof *c.corner);
        memset(c.number, 0xff, vertices * sizeof *c.number);
        enter_edges(&c);
        put_triangles(&c);
        put_vertices(&c, point);
    }
    free_edges(&c.edges);
    free(c.corner);
    free(c.same);
    free(c.done);
    free(c.number);
    free(c.vertex);
    free(c.from);
    free(c.numbers);
    free(point);
    return made && !c.short_of_memory ? EBPO_OK : ebpo_fail_memory(error, vertices * 32);
}

/* --- decoding --- */

/* State of decoding a patch. The functions below return false for a wrong code. */
typedef struct decoder {
    const uint8_t *code, *end; /* the next byte; the end of the bytes that are left */
    open_edges edges;
    uint32_t next, vertices; /* number of vertices so far, and of the patch */
    prediction *from;        /* [vertices] how the position of each vertex is predicted */
} decoder;

static bool get_number(decoder *d, uint32_t *out)
{
    *out = 0;
    for (unsigned shift = 0; shift < 28 && d->code < d->end; shift += 7) {
        uint8_t byte = *--d->end;
        *out |= (uint32_t)(byte & 127) << shift;
        if (!(byte & 128))
            return true;
    }
    return false;
}

/* Begins a new vertex, whose number is returned in *out. */
static bool take_new(decoder *d, prediction from, uint32_t *out)
{
    if (d->next >= d->vertices)
        return false;
    d->from[d->next] = from;
    *out = d->next++;
    return true;
}

/* Decodes a triangle when no edge is open. */
static bool get_free(decoder *d, uint32_t t[3])
{
    for (int k = 0; k < 3; k++) {
        uint32_t back;
        if (!get_number(d, &back) || back > d->next)
            return false;
        t[k] = d->next - back;
        if (back == 0 && !take_new(d, (prediction){ 0, 0, NONE }, &t[k]))
            return false;
    }
    add_first_edges(&d->edges, t);
    return true;
}

/* Decodes the third vertex of the triangle at the open edge `e`. `byte`: the first byte. */
static bool get_third(decoder *d, const open_edge *e, unsigned byte, uint32_t *out)
{
    uint32_t back;
    switch (byte) {
    case NEW_VERTEX: return take_new(d, (prediction){ e->from, e->to, e->beyond }, out);
    case LEFT_VERTEX: *out = e->before == NONE ? e->from : d->edges.edge[e->before].from; break;
    case RIGHT_VERTEX: *out = e->after == NONE ? e->from : d->edges.edge[e->after].to; break;
    case FAR_VERTEX:
        if (!get_number(d, &back) || back >= d->next)
            return false;
        *out = d->next - 1 - back;
        break;
    default: return false;
    }
    return *out != e->from && *out != e->to;
}

/* Decodes the next triangle. t: the numbers of its vertices. */
static bool get_triangle(decoder *d, uint32_t t[3])
{
    open_edge e;
    while (take_edge(&d->edges, &e)) {
        if (d->code == d->end)
            return false;
        unsigned byte = *d->code++;
        if (byte == NO_TRIANGLE) {
            end_edge(&d->edges, &e);
            continue;
        }
        t[0] = e.from;
        t[1] = e.to;
        if (!get_third(d, &e, byte, &t[2]))
            return false;
        add_edges(&d->edges, &e, t[2]);
        return true;
    }
    return get_free(d, t);
}

double ebpo_patch_error_step(const ebpo_info *info)
{
    const double *size = info->box_size;
    return fmax(size[0], fmax(size[1], size[2])) * 0x1p-32;
}

void ebpo_patch_position(const ebpo_box *box, ebpo_cell cell, const int16_t point[3], double out[3])
{
    double step = ebpo_half_power(cell.level + EBPO_PATCH_GRID);
    for (int k = 0; k < 3; k++)
        out[k] = box->origin[k] +
                 ((double)cell.at[k] * (1 << EBPO_PATCH_GRID) + point[k]) * (box->size[k] * step);
}

/* Rows of a patch in the arrays of a surface. */
typedef struct patch_rows {
    const uint8_t *code, *normal, *colour;
    const uint16_t *point;
} patch_rows;

/* Replaces the stored normals' differences by their coordinates, 0, 0 where none is stored, in the
 * order of the vertices. */
static void take_normals(const bool *rim, const uint8_t *row, uint64_t vertices, uint8_t *out)
{
    uint8_t last[2] = { 0, 0 };
    for (int pass = 1; pass >= 0; pass--) {
        for (uint64_t v = 0; v < vertices; v++) {
            if (rim[v] != pass)
                continue;
            for (int k = 0; k < 2; k++) {
                if (is_stored(row, 0))
                    last[k] = (uint8_t)((last[k] + row[k] + NORMALS - 1) % NORMALS);
                out[2 * v + (uint64_t)k] = is_stored(row, 0) ? last[k] + 1 : 0;
            }
            row += 2;
        }
    }
}

/* Adds the normal of each triangle, weighted by area, to the normals of its vertices that are not
 * stored. point: [vertices][3] steps of the grid. */
static void add_triangle_normals(const ebpo_info *info, const uint8_t *stored, const int16_t *point,
                                 ebpo_patch *out)
{
    double longest = ebpo_patch_error_step(info) * 0x1p32, scale[3];
    for (int k = 0; k < 3; k++)
        scale[k] = info->box_size[k] / longest;
    for (uint64_t i = 0; i < out->triangle_count; i++) {
        const uint32_t *t = out->triangles + 3 * i;
        double u[3], w[3], n[3];
        for (int k = 0; k < 3; k++) {
            u[k] = (point[3 * (uint64_t)t[1] + (uint64_t)k] -
                    point[3 * (uint64_t)t[0] + (uint64_t)k]) *
                   scale[k];
            w[k] = (point[3 * (uint64_t)t[2] + (uint64_t)k] -
                    point[3 * (uint64_t)t[0] + (uint64_t)k]) *
                   scale[k];
        }
        ebpo_vec3_cross(u, w, n);
        for (int c = 0; c < 3; c++)
            for (int k = 0; k < 3 && !is_stored(stored, t[c]); k++)
                out->normals[3 * (uint64_t)t[c] + (uint64_t)k] += (float)n[k];
    }
}

/* Sets the normals. stored: result of take_normals. point: [vertices][3] steps of the grid. */
static void decode_normals(const ebpo_info *info, const uint8_t *stored, const int16_t *point,
                           ebpo_patch *out)
{
    memset(out->normals, 0, out->vertex_count * 3 * sizeof *out->normals);
    add_triangle_normals(info, stored, point, out);
    for (uint64_t v = 0; v < out->vertex_count; v++) {
        float *n = out->normals + 3 * v;
        if (is_stored(stored, v))
            decode_normal(stored + 2 * v, n);
        else
            set_normal((double[3]){ (double)n[0], (double)n[1], (double)n[2] }, n);
    }
}

/* Sets positions, normals and colours. `point`, [vertices][3], and `normal`, [vertices][2], are
 * temporary memory. */
static void decode_vertices(const ebpo_info *info, const patch_rows *rows, const decoder *d,
                            int16_t *point, uint8_t *normal, ebpo_patch *out)
{
    ebpo_box box = ebpo_root_box(info);
    ebpo_cell cell = { out->level, { out->at[0], out->at[1], out->at[2] } };
    for (uint32_t v = 0; v < out->vertex_count; v++) {
        uint32_t before = v ? vertex_before(&d->from[v], v) : 0;
        predicted_point predicted = predict_point(point, &d->from[v], v);
        int16_t *at = point + 3 * v;
        for (int i = 1; i <= 3; i++) {
            int k = (predicted.steep + i) % 3;
            int32_t step = decode_zigzag(rows->point[3 * v + (uint32_t)k]);
            at[k] = (int16_t)(uint16_t)(uint32_t)(predict_coordinate(&predicted, k, at) + step);
        }
        for (uint32_t k = 0; k < 3 && out->colours; k++)
            out->colours[3 * v + k] =
                (uint8_t)(rows->colour[3 * v + k] + (v ? out->colours[3 * before + k] : 0));
        ebpo_patch_position(&box, cell, at, out->xyz + 3 * v);
    }
    take_normals(d->edges.rim, rows->normal, out->vertex_count, normal);
    decode_normals(info, normal, point, out);
}

void ebpo_patch_free(ebpo_patch *patch)
{
    if (!patch)
        return;
    free(patch->xyz);
    free(patch->normals);
    free(patch->colours);
    free(patch->triangles);
    memset(patch, 0, sizeof *patch);
}

/* Decodes triangles to `triangle`, or only checks the code if `triangle` is NULL. Returns false if
 * the code is wrong. */
static bool decode_triangles(decoder *d, uint64_t count, uint32_t *triangle)
{
    uint32_t t[3];
    for (uint64_t i = 0; i < count; i++) {
        if (!get_triangle(d, t))
            return false;
        if (triangle)
            memcpy(triangle + 3 * i, t, sizeof t);
    }
    end_edges(&d->edges);
    /* vertices that no triangle uses come last */
    for (; d->next < d->vertices; d->next++) {
        d->from[d->next] = (prediction){ 0, 0, NONE };
        d->edges.rim[d->next] = true;
    }
    return d->code == d->end;
}

ebpo_status ebpo_patch_code_fails(ebpo_status as, const char *file, ebpo_error *error)
{
    return ebpo_fail_at(error, as, file, "/surface/triangles", -1,
                        "the code of a patch is wrong: an earlier version of ebpo wrote it, or it "
                        "is damaged; 'ebpo subset --parts=-surface' removes all patches, and 'ebpo "
                        "repack --parts=+surface' makes them again");
}

static ebpo_status decode_patch(const ebpo_info *info, const patch_rows *rows, uint64_t code_bytes,
                                ebpo_patch *out, ebpo_error *error)
{
    uint64_t vertices = out->vertex_count;
    decoder d = { .code = rows->code,
                  .end = rows->code + code_bytes,
                  .vertices = (uint32_t)vertices };
    bool made = make_edges(&d.edges, out->triangle_count, vertices);
    d.from = ebpo_alloc(vertices, sizeof *d.from);
    int16_t *point = ebpo_alloc(vertices, 3 * sizeof *point);
    uint8_t *normal = ebpo_alloc(vertices, 2);
    out->xyz = ebpo_alloc(vertices, 3 * sizeof *out->xyz);
    out->normals = ebpo_alloc(vertices, 3 * sizeof *out->normals);
    out->colours = rows->colour ? ebpo_alloc(vertices, 3) : NULL;
    out->triangles = ebpo_alloc(out->triangle_count, 3 * sizeof *out->triangles);
    ebpo_status status = EBPO_OK;
    if (!made || !d.from || !point || !normal || !out->xyz || !out->normals || !out->triangles ||
        (rows->colour && !out->colours))
        status = ebpo_fail_memory(error, vertices * 48);
    if (status == EBPO_OK && !decode_triangles(&d, out->triangle_count, out->triangles))
        status = ebpo_patch_code_fails(EBPO_E_FORMAT, "", error);
    if (status == EBPO_OK)
        decode_vertices(info, rows, &d, point, normal, out);
    free_edges(&d.edges);
    free(d.from);
    free(point);
    free(normal);
    return status;
}

/* Sets *vertex and *code to the first vertex and the first byte of code of a patch. */
static void find_first(const ebpo_surface *surface, uint64_t index, uint64_t *vertex,
                       uint64_t *code)
{
    *vertex = surface->first ? surface->first[2 * index] : 0;
    *code = surface->first ? surface->first[2 * index + 1] : 0;
    for (uint64_t i = 0; i < index && !surface->first; i++) {
        *vertex += surface->patch[EBPO_PATCH_COLUMNS * i + EBPO_PATCH_VERTICES];
        *code += surface->patch[EBPO_PATCH_COLUMNS * i + EBPO_PATCH_CODE_BYTES];
    }
}

ebpo_status ebpo_surface_decode(const ebpo_surface *surface, const ebpo_info *info, uint64_t index,
                                ebpo_patch *out, ebpo_error *error)
{
    EBPO_DEFAULT_FP;
    uint64_t vertex, code;
    *out = (ebpo_patch)EBPO_PATCH_INIT;
    if (index >= surface->patch_count)
        return ebpo_fail(error, EBPO_E_ARGUMENT, "patch %llu: there are only %llu patches",
                         (unsigned long long)index, (unsigned long long)surface->patch_count);
    const uint64_t *row = surface->patch + EBPO_PATCH_COLUMNS * index;
    find_first(surface, index, &vertex, &code);
    patch_rows rows = { surface->code + code, surface->normal + 2 * vertex,
                        surface->colour ? surface->colour + 3 * vertex : NULL,
                        surface->point + 3 * vertex };
    ebpo_cell cell = ebpo_cell_of_octcode(row[EBPO_PATCH_OCTCODE]);
    out->level = cell.level;
    memcpy(out->at, cell.at, sizeof out->at);
    out->first_face = row[EBPO_PATCH_FIRST_FACE];
    out->face_count = row[EBPO_PATCH_FACES];
    out->error = (double)row[EBPO_PATCH_ERROR] * ebpo_patch_error_step(info);
    out->vertex_count = row[EBPO_PATCH_VERTICES];
    out->triangle_count = row[EBPO_PATCH_TRIANGLES];
    ebpo_status status = decode_patch(info, &rows, row[EBPO_PATCH_CODE_BYTES], out, error);
    if (status != EBPO_OK)
        ebpo_patch_free(out);
    return status;
}

bool ebpo_patch_mark_border(const uint32_t *triangle, uint64_t triangles, uint64_t vertices,
                            bool *border)
{
    uint64_t slots = ebpo_hash_slots(6 * triangles);
    uint64_t *edge = ebpo_alloc(slots, sizeof *edge); /* lower vertex, higher vertex */
    uint8_t *uses = ebpo_alloc_zero(slots, 1);
    for (uint64_t v = 0; v < vertices; v++)
        border[v] = true;
    for (uint64_t i = 0; i < 3 * triangles; i++)
        border[triangle[i]] = false;
    for (uint64_t i = 0; i < 3 * triangles && edge && uses; i++) {
        uint32_t a = triangle[i], b = triangle[i - i % 3 + (i + 1) % 3];
        uint64_t key = a < b ? (uint64_t)a << 32 | b : (uint64_t)b << 32 | a,
                 s = ebpo_hash_number(key) & (slots - 1);
        while (uses[s] && edge[s] != key)
            s = (s + 1) & (slots - 1);
        edge[s] = key;
        uses[s] = uses[s] < 2 ? uses[s] + 1 : 2;
    }
    for (uint64_t s = 0; s < slots && edge && uses; s++)
        if (uses[s] == 1)
            border[edge[s] >> 32] = border[(uint32_t)edge[s]] = true;
    bool made = edge && uses;
    free(edge);
    free(uses);
    return made;
}

/* --- checks --- */

void ebpo_surface_free(ebpo_surface *surface)
{
    if (!surface)
        return;
    free(surface->patch);
    free(surface->code);
    free(surface->point);
    free(surface->normal);
    free(surface->colour);
    free(surface->first);
    memset(surface, 0, sizeof *surface);
}

bool ebpo_surface_add_up(ebpo_surface *surface)
{
    uint64_t vertex = 0, code = 0, *first = ebpo_alloc(surface->patch_count, 2 * sizeof *first);
    for (uint64_t i = 0; i < surface->patch_count && first; i++) {
        const uint64_t *row = surface->patch + EBPO_PATCH_COLUMNS * i;
        first[2 * i] = vertex;
        first[2 * i + 1] = code;
        vertex += row[EBPO_PATCH_VERTICES];
        code += row[EBPO_PATCH_CODE_BYTES];
    }
    surface->first = first;
    return first != NULL;
}

void ebpo_surface_summarise(const ebpo_surface *surface, ebpo_info *info)
{
    info->surface_patches = surface->patch_count;
    info->surface_triangles = surface->triangle_count;
    info->surface_vertices = surface->vertex_count;
    info->surface_code_bytes = surface->code_bytes;
    info->surface_colours = surface->colour_count;
}

/* Checks a row of the table of patches. `before`: octcode of the previous row. Returns the error's
 * text or NULL. */
static const char *find_row_fault(const ebpo_info *info, const uint64_t *row, uint64_t before)
{
    uint64_t code = row[EBPO_PATCH_OCTCODE], triangles = row[EBPO_PATCH_TRIANGLES];
    /* a subset keeps the face numbers of the original file */
    uint64_t most_faces = info->pruned ? UINT32_MAX : info->face_count;
    if (!ebpo_octcode_valid(code) || ebpo_octcode_level(code) > EBPO_PATCH_LEVEL ||
        ebpo_octcode_level(code) >= info->level_count)
        return "an octcode is invalid, or its level cannot have patches";
    if (code <= before)
        return "the octcodes are not ascending";
    if (row[EBPO_PATCH_FACES] == 0 || row[EBPO_PATCH_FIRST_FACE] > most_faces ||
        row[EBPO_PATCH_FACES] > most_faces - row[EBPO_PATCH_FIRST_FACE])
        return "the faces of a patch are not faces of the model";
    if (triangles == 0 || triangles > row[EBPO_PATCH_FACES] ||
        row[EBPO_PATCH_CODE_BYTES] < triangles || row[EBPO_PATCH_VERTICES] < 3 ||
        row[EBPO_PATCH_VERTICES] > 3 * row[EBPO_PATCH_FACES] ||
        row[EBPO_PATCH_VERTICES] >= INT32_MAX / 4)
        return "the counts of a patch are impossible";
    if (row[EBPO_PATCH_ERROR] > UINT64_C(1) << 34)
        return "the error of a patch is greater than the model";
    return NULL;
}

const char *ebpo_surface_fault(const ebpo_info *info, const ebpo_surface *surface)
{
    uint64_t triangles = 0, vertices = 0, bytes = 0, before = 0;
    for (uint64_t i = 0; i < surface->patch_count; i++) {
        const uint64_t *row = surface->patch + EBPO_PATCH_COLUMNS * i;
        const char *fault = find_row_fault(info, row, before);
        if (fault)
            return fault;
        if (row[EBPO_PATCH_VERTICES] > surface->vertex_count - vertices ||
            row[EBPO_PATCH_CODE_BYTES] > surface->code_bytes - bytes ||
            row[EBPO_PATCH_TRIANGLES] > surface->triangle_count - triangles)
            return "the patches do not add up to the counts in the header";
        before = row[EBPO_PATCH_OCTCODE];
        triangles += row[EBPO_PATCH_TRIANGLES];
        vertices += row[EBPO_PATCH_VERTICES];
        bytes += row[EBPO_PATCH_CODE_BYTES];
    }
    return triangles == surface->triangle_count && vertices == surface->vertex_count &&
                   bytes == surface->code_bytes
               ? NULL
               : "the patches do not add up to the counts in the header";
}

/* Checks the triangle codes of all patches by decoding them. */
static ebpo_status check_codes(const ebpo_check *check, const ebpo_surface *surface,
                               ebpo_error *error)
{
    const uint8_t *code = surface->code;
    prediction *from = NULL;
    uint64_t capacity = 0;
    ebpo_status status = EBPO_OK;
    for (uint64_t i = 0; i < surface->patch_count && status == EBPO_OK; i++) {
        const uint64_t *row = surface->patch + EBPO_PATCH_COLUMNS * i;
        decoder d = { .code = code,
                      .end = code + row[EBPO_PATCH_CODE_BYTES],
                      .vertices = (uint32_t)row[EBPO_PATCH_VERTICES] };
        bool made = make_edges(&d.edges, row[EBPO_PATCH_TRIANGLES], row[EBPO_PATCH_VERTICES]) &&
                    ebpo_grow(&from, &capacity, row[EBPO_PATCH_VERTICES], sizeof *from);
        d.from = from;
        if (!made)
            status = ebpo_fail_memory(error, row[EBPO_PATCH_VERTICES] * 32);
        else if (!decode_triangles(&d, row[EBPO_PATCH_TRIANGLES], NULL))
            status = ebpo_patch_code_fails(check->as, check->shown, error);
        free_edges(&d.edges);
        code += row[EBPO_PATCH_CODE_BYTES];
    }
    free(from);
    return status;
}

ebpo_status ebpo_check_surface(const ebpo_check *check, const ebpo_info *info,
                               const ebpo_surface *surface, ebpo_error *error)
{
    bool missing = !surface->patch || !surface->code || !surface->point || !surface->normal ||
                   (surface->colour_count && !surface->colour);
    const char *fault = missing || surface->patch_count != info->surface_patches ||
                                surface->triangle_count != info->surface_triangles ||
                                surface->vertex_count != info->surface_vertices ||
                                surface->code_bytes != info->surface_code_bytes ||
                                surface->colour_count != info->surface_colours
                            ? "patches are missing"
                            : ebpo_surface_fault(info, surface);
    return fault ? ebpo_check_fail(check, -1, "/surface/patches", fault, error)
                 : check_codes(check, surface, error);
}

/* --- files --- */

/* Rows that are copied from the chunks of an array. */
typedef struct taking {
    void *to;            /* receives the rows [first, end) */
    unsigned size;       /* bytes of an element, in the file and in memory */
    uint64_t first, end; /* rows to copy */
} taking;

/* Copies the wanted rows of a chunk, in native byte order. The chunk has the rows [row, row +
 * rows).
 */
static void take_rows(const taking *t, const ebpo_array_in *array, uint64_t row, uint64_t rows,
                      const uint8_t *bytes)
{
    uint64_t cols = array->shape.cols ? array->shape.cols : 1, row_bytes = cols * t->size;
    uint64_t from = row > t->first ? row : t->first,
             end = row + rows < t->end ? row + rows : t->end;
    if (from >= end)
        return;
    const uint8_t *at = bytes + (from - row) * row_bytes;
    uint8_t *to = (uint8_t *)t->to + (from - t->first) * row_bytes;
    for (uint64_t i = 0; i < (end - from) * cols; i++, at += t->size, to += t->size) {
        uint64_t wide = t->size == 8 ? ebpo_load64(at) : 0;
        uint16_t narrow = (uint16_t)(t->size == 2 ? at[0] | at[1] << 8 : 0);
        memcpy(to,
               t->size == 8   ? (void *)&wide
               : t->size == 2 ? (void *)&narrow
                              : (void *)at,
               t->size);
    }
}

/* Reads rows [first, end) of an array to new memory. */
static ebpo_status read_rows(const ebpo_file *file, ebpo_array_id id, uint64_t first, uint64_t end,
                             void *out, ebpo_error *error)
{
    const ebpo_array_in *array = ebpo_reader_array(file, id, 0);
    taking t = { .size = array->shape.element_size, .first = first, .end = end };
    uint64_t cols = array->shape.cols ? array->shape.cols : 1, rows = array->shape.chunk_rows;
    t.to = ebpo_alloc((end - first) * cols, t.size);
    memcpy(out, &t.to, sizeof t.to);
    ebpo_idle_reader *reader = ebpo_idle_readers_take(&ebpo_reader_own(file)->idle);
    ebpo_status status =
        t.to && reader ? EBPO_OK : ebpo_fail_memory(error, (end - first) * cols * t.size);
    for (uint64_t k = first / rows; first < end && k * rows < end && status == EBPO_OK; k++) {
        status = ebpo_reader_chunk(file, array, k, &reader->reader, reader->raw, error);
        uint64_t remaining = array->shape.rows - k * rows;
        if (status == EBPO_OK)
            take_rows(&t, array, k * rows, remaining < rows ? remaining : rows, reader->raw);
    }
    ebpo_idle_readers_give(&ebpo_reader_own(file)->idle, reader);
    return status;
}

/* Keeps only the patches of levels first_level to last_level in the table. Sets *vertex and *code
 * to the first vertex and the first byte of code of these patches. */
static void select_levels(ebpo_surface *s, int first_level, int last_level, uint64_t *vertex,
                          uint64_t *code)
{
    uint64_t count = 0;
    ebpo_surface out = { .patch = s->patch };
    *vertex = *code = 0;
    for (uint64_t i = 0; i < s->patch_count; i++) {
        const uint64_t *row = s->patch + EBPO_PATCH_COLUMNS * i;
        int level = ebpo_octcode_level(row[EBPO_PATCH_OCTCODE]);
        if (level < first_level) {
            *vertex += row[EBPO_PATCH_VERTICES];
            *code += row[EBPO_PATCH_CODE_BYTES];
        } else if (level <= last_level) {
            out.triangle_count += row[EBPO_PATCH_TRIANGLES];
            out.vertex_count += row[EBPO_PATCH_VERTICES];
            out.code_bytes += row[EBPO_PATCH_CODE_BYTES];
            memmove(s->patch + EBPO_PATCH_COLUMNS * count++, row, EBPO_PATCH_COLUMNS * sizeof *row);
        }
    }
    out.patch_count = count;
    out.colour_count = s->colour_count ? out.vertex_count : 0;
    *s = out;
}

static void hint_rows(ebpo_hints *hints, const ebpo_file *file, ebpo_array_id id, uint64_t first,
                      uint64_t end)
{
    const ebpo_array_in *array = ebpo_reader_array(file, id, 0);
    uint64_t rows = array->shape.chunk_rows;
    if (array->present && first < end)
        ebpo_hint_chunks(hints, array, first / rows, (end - 1) / rows + 1);
}

/* Reads and checks the table of patches. */
static ebpo_status read_table(const ebpo_file *file, ebpo_surface *out, ebpo_error *error)
{
    const ebpo_info *info = &file->info;
    ebpo_check check = ebpo_reader_check(file, NULL);
    ebpo_status status =
        read_rows(file, EBPO_A_SURFACE_PATCHES, 0, info->surface_patches, &out->patch, error);
    if (status != EBPO_OK)
        return status;
    out->patch_count = info->surface_patches;
    out->triangle_count = info->surface_triangles;
    out->vertex_count = info->surface_vertices;
    out->code_bytes = info->surface_code_bytes;
    out->colour_count = info->surface_colours;
    const char *fault = ebpo_surface_fault(info, out);
    return fault ? ebpo_check_fail(&check, -1, "/surface/patches", fault, error) : EBPO_OK;
}

static ebpo_status read_surface(const ebpo_file *file, int first_level, int last_level,
                                ebpo_surface *out, ebpo_error *error)
{
    ebpo_check check = ebpo_reader_check(file, NULL);
    ebpo_hints hints = EBPO_HINTS_INIT(file);
    uint64_t vertex, code;
    ebpo_status status = read_table(file, out, error);
    if (status != EBPO_OK)
        return status;
    select_levels(out, first_level, last_level, &vertex, &code);
    if (!ebpo_surface_add_up(out))
        return ebpo_fail_memory(error, out->patch_count * 2 * sizeof *out->first);
    uint64_t vertex_end = vertex + out->vertex_count;
    hint_rows(&hints, file, EBPO_A_SURFACE_TRIANGLES, code, code + out->code_bytes);
    hint_rows(&hints, file, EBPO_A_SURFACE_POINTS, vertex, vertex_end);
    hint_rows(&hints, file, EBPO_A_SURFACE_NORMALS, vertex, vertex_end);
    hint_rows(&hints, file, EBPO_A_SURFACE_COLOURS, vertex, vertex_end);
    ebpo_hint_all(&hints);
    status =
        read_rows(file, EBPO_A_SURFACE_TRIANGLES, code, code + out->code_bytes, &out->code, error);
    if (status == EBPO_OK)
        status = read_rows(file, EBPO_A_SURFACE_POINTS, vertex, vertex_end, &out->point, error);
    if (status == EBPO_OK)
        status = read_rows(file, EBPO_A_SURFACE_NORMALS, vertex, vertex_end, &out->normal, error);
    if (status == EBPO_OK && out->colour_count)
        status = read_rows(file, EBPO_A_SURFACE_COLOURS, vertex, vertex_end, &out->colour, error);
    return status == EBPO_OK ? check_codes(&check, out, error) : status;
}

ebpo_status ebpo_surface_absent(const ebpo_file *file, ebpo_error *error)
{
    return ebpo_fail_file(error, EBPO_E_ABSENT, file->in.shown,
                          "the file was written without its simplified surface; add it with "
                          "'ebpo repack --parts=+surface'");
}

ebpo_status ebpo_file_read_patches(const ebpo_file *file, ebpo_surface *out, ebpo_error *error)
{
    memset(out, 0, sizeof *out);
    if (!(file->info.parts & EBPO_PART_SURFACE))
        return ebpo_surface_absent(file, error);
    ebpo_status status = read_table(file, out, error);
    if (status != EBPO_OK)
        ebpo_surface_free(out);
    return status;
}

ebpo_status ebpo_file_read_surface(const ebpo_file *file, int first_level, int last_level,
                                   ebpo_surface *out, ebpo_error *error)
{
    memset(out, 0, sizeof *out);
    if (!(file->info.parts & EBPO_PART_SURFACE))
        return ebpo_surface_absent(file, error);
    ebpo_status status = read_surface(file, first_level, last_level, out, error);
    if (status != EBPO_OK)
        ebpo_surface_free(out);
    return status;
}
