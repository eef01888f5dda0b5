/* Implements the coding "gates" of format-spec/gates.md. The code of a corner is its vertex
 * relative to the newest vertex (coding.h). Most faces share an edge with an earlier face. This
 * edge is the gate of the face, and the face is written as its gate and its third vertex. An edge
 * of an earlier face is open if the face on its other side has not been written yet. The gate is
 * one of the newest open edges. Open edges are kept in a short list, the newest last. Encoder and
 * decoder keep the same list, so the decoder restores all codes. The decoder rejects bytes that do
 * not represent faces. Time is proportional to the number of faces. */
#include "hdf5_read/face_gates.h"

#include <string.h>

#include "core/endian.h"
#include "hdf5_read/chunk.h"

enum {
    OPEN_MAX = 64,        /* maximum length of the list of open edges */
    NEAR = 32,            /* pass_edge compares only the newest NEAR edges */
    SPACE = 4 * OPEN_MAX, /* size of the list's array */
    FACE_MAX = 3          /* maximum number of edges that a face opens */
};
/* Kinds of the third vertex of a face with the gate from a to b. */
enum {
    IS_NEW,    /* the next vertex that no face has used */
    IS_LEFT,   /* end of the newest open edge that starts at b */
    IS_RIGHT,  /* start of the newest open edge that ends at a */
    BY_NUMBER, /* a number follows in the stream `low` */
    AT_OPEN    /* AT_OPEN + n: start of an open edge; n counts from the newest edge, n = 0 */
};
/* Meaning of the first byte of a vertex number, which is in the stream `low`. A byte below LOW_END
 * is the number. With a byte from LOW_END to TWO_BYTES_END - 1, a second byte follows in the stream
 * `more`. With the byte TWO_BYTES_END, four bytes follow in `more`. */
enum { LOW_END = 224, TWO_BYTES_END = 240 };
enum { AS_CODES = 1 }; /* first byte of a chunk that has the codes of corners instead of gates */

/* Open edges, newest last. (a, b) means that the face on the other side of the edge, if it exists,
 * has a side from a to b. Vertices are counted from the first new vertex of the chunk, modulo 2^32,
 * as the codes count them. */
typedef struct open_edges {
    uint64_t edge[SPACE]; /* see edge_of */
    uint32_t begin, end;  /* range of the open edges in `edge` */
    uint32_t seen;        /* number of new vertices so far */
} open_edges;

static uint64_t edge_of(uint32_t from, uint32_t to) { return from | (uint64_t)to << 32; }
static uint32_t edge_from(uint64_t e) { return (uint32_t)e; }
static uint32_t edge_to(uint64_t e) { return (uint32_t)(e >> 32); }

static void start_edges(open_edges *o) { o->begin = o->end = o->seen = 0; }

/* Moves the list to the front of its array if there is no space after the list for the edges of a
 * face. Called before each face. */
static void reserve_space(open_edges *o)
{
    if (o->end + FACE_MAX <= SPACE)
        return;
    o->end -= o->begin;
    memmove(o->edge, o->edge + o->begin, o->end * sizeof *o->edge);
    o->begin = 0;
}

/* Adds an open edge. If the list is too long, drops the oldest edge. */
static void push_edge(open_edges *o, uint64_t e)
{
    o->edge[o->end++] = e;
    o->begin += o->end - o->begin > OPEN_MAX;
}

static void drop_edge(open_edges *o, uint32_t at)
{
    o->end--;
    for (; at < o->end; at++)
        o->edge[at] = o->edge[at + 1];
}

/* These two functions return the position of the newest edge that starts, or ends, at v. They
 * return o->end if there is no such edge. */
static uint32_t find_starting(const open_edges *o, uint32_t v)
{
    for (uint32_t i = o->end; i > o->begin; i--)
        if (edge_from(o->edge[i - 1]) == v)
            return i - 1;
    return o->end;
}

static uint32_t find_ending(const open_edges *o, uint32_t v)
{
    for (uint32_t i = o->end; i > o->begin; i--)
        if (edge_to(o->edge[i - 1]) == v)
            return i - 1;
    return o->end;
}

/* Returns true if one of eight edges is the wanted edge. Compilers vectorise this loop. */
static bool any_of_eight(const uint64_t *edges, uint64_t wanted)
{
    bool any = false;
    for (int i = 0; i < 8; i++)
        any |= edges[i] == wanted;
    return any;
}

/* Processes the side of a face from a to b. If the open edge (a, b) is among the NEAR newest edges,
 * closes this edge. Otherwise opens the reverse edge (b, a). */
static void pass_edge(open_edges *o, uint32_t a, uint32_t b)
{
    uint64_t wanted = edge_of(a, b);
    uint32_t first_near = o->end - o->begin > NEAR ? o->end - NEAR : o->begin, i = o->end;
    while (i >= first_near + 8 && !any_of_eight(o->edge + i - 8, wanted))
        i -= 8;
    while (i > first_near && o->edge[i - 1] != wanted)
        i--;
    if (i > first_near)
        drop_edge(o, i - 1);
    else
        push_edge(o, edge_of(b, a));
}

/* Opens all edges of a face. */
static void open_all(open_edges *o, const uint32_t *face)
{
    for (int k = 0; k < 3; k++)
        push_edge(o, edge_of(face[(k + 1) % 3], face[k]));
}

/* Updates the open edges after the face (a, b, c). The gate (a, b) of this face is already closed.
 * `kind`: kind of the vertex c. `at`: for IS_LEFT and IS_RIGHT, the position of the open edge that
 * gave c; this edge is also closed. */
static void go_through(open_edges *o, uint32_t kind, uint32_t at, uint32_t a, uint32_t b,
                       uint32_t c)
{
    if (kind == IS_NEW) {
        push_edge(o, edge_of(c, b));
        push_edge(o, edge_of(a, c));
        return;
    }
    if (kind == IS_LEFT || kind == IS_RIGHT)
        drop_edge(o, at);
    if (kind != IS_LEFT)
        pass_edge(o, b, c);
    if (kind != IS_RIGHT)
        pass_edge(o, c, a);
}

/* ---- writing ---- */

/* State of encoding. The output has four streams. `gate` has a byte for each face: the position of
 * the gate, counted from the end of the list, or 0 if the face has no gate. `third` has a byte for
 * each face with a gate: 3 * kind of the third vertex + index of the corner where the gate begins.
 * `low` and `more` have the bytes of vertex numbers. */
typedef struct writing {
    uint8_t *gate, *third, *low, *more; /* next byte of each stream */
    open_edges open;
} writing;

/* Writes a vertex number to the streams `low` and `more`. */
static void put_number(writing *w, uint32_t number)
{
    if (number < LOW_END) {
        *w->low++ = (uint8_t)number;
    } else if (number - LOW_END < 256 * (TWO_BYTES_END - LOW_END)) {
        *w->low++ = (uint8_t)(LOW_END + ((number - LOW_END) >> 8));
        *w->more++ = (uint8_t)(number - LOW_END);
    } else {
        *w->low++ = TWO_BYTES_END;
        ebpo_store32(w->more, number);
        w->more += 4;
    }
}

/* Returns the position of the newest open edge that is a side of the face, or o->end if there is
 * none. *first: the corner at which this side starts. */
static uint32_t gate_of(const open_edges *o, const uint32_t *face, int *first)
{
    uint64_t side[3];
    for (int k = 0; k < 3; k++)
        side[k] = edge_of(face[k], face[(k + 1) % 3]);
    for (uint32_t i = o->end; i > o->begin; i--)
        for (int k = 0; k < 3; k++)
            if (o->edge[i - 1] == side[k]) {
                *first = k;
                return i - 1;
            }
    return o->end;
}

/* Returns the kind of c, the third vertex of a face with the gate (a, b). *at: position of the open
 * edge that gives c; undefined for IS_NEW and BY_NUMBER. */
static uint32_t kind_of(const open_edges *o, uint32_t a, uint32_t b, uint32_t c, uint32_t *at)
{
    if (c == o->seen)
        return IS_NEW;
    *at = find_starting(o, b);
    if (*at < o->end && edge_to(o->edge[*at]) == c)
        return IS_LEFT;
    *at = find_ending(o, a);
    if (*at < o->end && edge_from(o->edge[*at]) == c)
        return IS_RIGHT;
    *at = find_starting(o, c);
    return *at < o->end ? AT_OPEN + o->end - 1 - *at : BY_NUMBER;
}

static void write_face(writing *w, const uint32_t *code, const uint32_t *face)
{
    open_edges *o = &w->open;
    int k = 0;
    reserve_space(o);
    uint32_t at = gate_of(o, face, &k);
    *w->gate++ = (uint8_t)(o->end - at);
    if (at == o->end) {
        for (k = 0; k < 3; k++)
            put_number(w, code[k]);
        open_all(o, face);
        return;
    }
    uint32_t a = face[k], b = face[(k + 1) % 3], c = face[(k + 2) % 3];
    drop_edge(o, at);
    uint32_t kind = kind_of(o, a, b, c, &at);
    *w->third++ = (uint8_t)(3 * kind + (uint32_t)k);
    if (kind == BY_NUMBER)
        put_number(w, o->seen - c);
    go_through(o, kind, at, a, b, c);
}

/* Writes the codes of corners instead of gates. The output is AS_CODES, then byte 0 of all codes,
 * then byte 1 of all codes, and so on. */
static void write_codes(const uint8_t *codes, uint32_t rows, uint8_t *out,
                        size_t ends[EBPO_GATES_ENDS])
{
    size_t plane = 3 * (size_t)rows;
    *out = AS_CODES;
    ebpo_shuffle(codes, 4 * plane, 4, out + 1);
    for (size_t i = 0; i < EBPO_GATES_ENDS; i++)
        ends[i] = 1 + (i + 1) * plane;
}

/* Removes the gaps between the streams, and sets the ends of the streams. Before, the streams begin
 * at 0, rows, 2 * rows and 5 * rows. There they cannot overlap, because `third` takes at most one
 * byte for each face, and `low` at most three. */
static void join_streams(const writing *w, uint32_t rows, uint8_t *out,
                         size_t ends[EBPO_GATES_ENDS])
{
    size_t n = rows, low = (size_t)(w->low - out) - 2 * n, more = (size_t)(w->more - out) - 5 * n;
    ends[0] = n;
    ends[1] = (size_t)(w->third - out);
    ends[2] = ends[1] + low;
    ends[3] = ends[2] + more;
    memmove(out + ends[1], out + 2 * n, low);
    memmove(out + ends[2], out + 5 * n, more);
}

void ebpo_gates_encode(const uint8_t *codes, uint32_t rows, uint8_t *out,
                       size_t ends[EBPO_GATES_ENDS])
{
    enum { MORE_OF_FACE = 12 }; /* maximum bytes of a face in `more`: three numbers of four bytes */
    size_t bytes = (size_t)rows * EBPO_GATES_COLS;
    writing w = { out, out + rows, out + 2 * (size_t)rows, out + 5 * (size_t)rows, { .end = 0 } };
    start_edges(&w.open);
    for (uint32_t i = 0; i < rows; i++) {
        uint32_t code[3], face[3], seen = w.open.seen;
        for (int k = 0; k < 3; k++) {
            code[k] = ebpo_load32(codes + 4 * (3 * (size_t)i + (size_t)k));
            face[k] = seen - code[k];
            seen += code[k] == 0;
        }
        if ((size_t)(w.more - out) + MORE_OF_FACE > bytes)
            break; /* no space; write_codes encodes the chunk instead */
        write_face(&w, code, face);
        w.open.seen = seen;
    }
    if ((size_t)(w.gate - out) == rows)
        join_streams(&w, rows, out, ends);
    else
        write_codes(codes, rows, out, ends);
    memset(out + ends[EBPO_GATES_ENDS - 1], 0, bytes - ends[EBPO_GATES_ENDS - 1]);
}

/* ---- reading ---- */

/* State of decoding. The streams have the same meaning as in `writing`. */
typedef struct reading {
    const uint8_t *gate, *third, *low, *more; /* next byte of each stream */
    const uint8_t *end;                       /* end of the stream `more` */
    open_edges open;
} reading;

/* Reads a vertex by its number. Does not check the end of the stream `low`, because find_streams
 * has counted the numbers in it. Returns false if `more` is too short. */
static bool get_vertex(reading *r, uint32_t seen, uint32_t *vertex)
{
    uint32_t number = *r->low++;
    if (number == TWO_BYTES_END) {
        if (r->end - r->more < 4)
            return false;
        number = ebpo_load32(r->more);
        r->more += 4;
    } else if (number >= LOW_END) {
        if (number > TWO_BYTES_END || r->more == r->end)
            return false;
        number = LOW_END + ((number - LOW_END) << 8) + *r->more++;
    }
    *vertex = seen - number;
    return true;
}

/* Finds the third vertex of a face with the gate (a, b). Reads its number if necessary. Returns
 * false if `kind` is not possible here, or if the number cannot be read. */
static bool get_third(reading *r, uint32_t kind, uint32_t a, uint32_t b, uint32_t *at, uint32_t *c)
{
    const open_edges *o = &r->open;
    if (kind == IS_NEW) {
        *c = o->seen;
        return true;
    }
    if (kind == BY_NUMBER)
        return get_vertex(r, o->seen, c);
    if (kind >= AT_OPEN && kind - AT_OPEN >= o->end - o->begin)
        return false;
    *at = kind == IS_LEFT    ? find_starting(o, b)
          : kind == IS_RIGHT ? find_ending(o, a)
                             : o->end - 1 - (kind - AT_OPEN);
    if (*at == o->end)
        return false;
    *c = kind == IS_LEFT ? edge_to(o->edge[*at]) : edge_from(o->edge[*at]);
    return true;
}

/* Reads a face with a gate. */
static bool read_across(reading *r, uint32_t gate, uint32_t *face)
{
    static const uint8_t next[5] = { 0, 1, 2, 0, 1 }; /* remainders modulo 3 */
    open_edges *o = &r->open;
    if (gate > o->end - o->begin)
        return false;
    uint32_t third = *r->third++, at = o->end - gate, c;
    uint32_t a = edge_from(o->edge[at]), b = edge_to(o->edge[at]), kind = third / 3, k = third % 3;
    drop_edge(o, at);
    if (!get_third(r, kind, a, b, &at, &c))
        return false;
    face[k] = a;
    face[next[k + 1]] = b;
    face[next[k + 2]] = c;
    go_through(o, kind, at, a, b, c);
    return true;
}

/* Reads a face without a gate. */
static bool read_without_gate(reading *r, uint32_t *face)
{
    uint32_t seen = r->open.seen;
    for (int k = 0; k < 3; k++) {
        if (!get_vertex(r, seen, &face[k]))
            return false;
        seen += face[k] == seen;
    }
    open_all(&r->open, face);
    return true;
}

/* Writes the codes of a face. `seen`: number of new vertices before the face. Returns this number
 * after the face. */
static uint32_t put_codes(const uint32_t *face, uint32_t seen, uint8_t *codes)
{
    for (int k = 0; k < 3; k++) {
        uint32_t code = seen - face[k];
        ebpo_store32(codes + 4 * k, code);
        seen += code == 0;
    }
    return seen;
}

/* Finds the beginnings of the streams. The zeros in the stream `gate` give the number of faces
 * without a gate. This number determines the length of `third`. This number and the kinds in
 * `third` determine the length of `low`. */
static void find_streams(reading *r, const uint8_t *in, uint32_t rows)
{
    size_t without_gate = 0, numbers = 0, bytes = (size_t)rows * EBPO_GATES_COLS;
    for (uint32_t i = 0; i < rows; i++)
        without_gate += in[i] == 0;
    size_t thirds = rows - without_gate;
    r->gate = in;
    r->third = in + rows;
    r->low = r->third + thirds;
    for (size_t i = 0; i < thirds; i++)
        numbers += r->third[i] / 3 == BY_NUMBER;
    /* the streams before `more` take at most 5 bytes for each face */
    r->more = r->low + 3 * without_gate + numbers;
    r->end = in + bytes;
    start_edges(&r->open);
}

static bool is_zero(const uint8_t *begin, const uint8_t *end)
{
    unsigned any = 0;
    for (; begin < end; begin++)
        any |= *begin;
    return !any;
}

/* Reads a chunk that write_codes has written. */
static bool read_codes(const uint8_t *in, uint32_t rows, uint8_t *codes)
{
    size_t bytes = 12 * (size_t)rows;
    ebpo_unshuffle(in + 1, bytes, 4, codes);
    return is_zero(in + 1 + bytes, in + EBPO_GATES_COLS * (size_t)rows);
}

bool ebpo_gates_decode(const uint8_t *in, uint32_t rows, uint8_t *codes)
{
    reading r;
    if (*in == AS_CODES)
        return read_codes(in, rows, codes);
    find_streams(&r, in, rows);
    for (uint32_t i = 0; i < rows; i++, codes += 12) {
        uint32_t face[3], gate = *r.gate++;
        reserve_space(&r.open);
        if (gate ? !read_across(&r, gate, face) : !read_without_gate(&r, face))
            return false;
        r.open.seen = put_codes(face, r.open.seen, codes);
    }
    return is_zero(r.more, r.end);
}
