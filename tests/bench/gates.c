#include "gates.h"

enum { OPEN_MOST = 64, NEAR = 32 };
enum { GATE, THIRD, LOW, MORE };                        /* streams */
enum { IS_NEW, IS_LEFT, IS_RIGHT, BY_NUMBER, AT_OPEN }; /* third corners */
enum { LOW_END = 224, TWO_BYTES_END = 240 };            /* of what a byte of LOW is by itself */

/* Open edges, newest last: (a, b) where a face on the other side would run from a to b. */
typedef struct open_edges {
    uint64_t edge[OPEN_MOST + 3 * GATES_ROWS_MOST];
    uint32_t begin, end;
} open_edges;

static uint64_t edge(uint32_t from, uint32_t to) { return from | (uint64_t)to << 32; }
static uint32_t from(uint64_t e) { return (uint32_t)e; }
static uint32_t to(uint64_t e) { return (uint32_t)(e >> 32); }

static void push(open_edges *o, uint64_t e)
{
    o->edge[o->end++] = e;
    o->begin += o->end - o->begin > OPEN_MOST;
}

static void drop(open_edges *o, uint32_t at)
{
    o->end--;
    for (; at < o->end; at++)
        o->edge[at] = o->edge[at + 1];
}

/* The newest that starts or ends at v; o->end: none. */
static uint32_t starting(const open_edges *o, uint32_t v)
{
    for (uint32_t i = o->end; i > o->begin; i--)
        if (from(o->edge[i - 1]) == v)
            return i - 1;
    return o->end;
}

static uint32_t ending(const open_edges *o, uint32_t v)
{
    for (uint32_t i = o->end; i > o->begin; i--)
        if (to(o->edge[i - 1]) == v)
            return i - 1;
    return o->end;
}

/* Eight at a time, since as a rule none is. */
static bool any_of_eight(const uint64_t *edges, uint64_t wanted)
{
    bool any = false;
    for (int i = 0; i < 8; i++)
        any |= edges[i] == wanted;
    return any;
}

/* Side from a to b of a face: closes that edge if it is among the newest, else opens the other
 * way's. */
static void side(open_edges *o, uint32_t a, uint32_t b)
{
    uint64_t wanted = edge(a, b);
    uint32_t least = o->end - o->begin > NEAR ? o->end - NEAR : o->begin, i = o->end;
    while (i >= least + 8 && !any_of_eight(o->edge + i - 8, wanted))
        i -= 8;
    while (i > least && o->edge[i - 1] != wanted)
        i--;
    if (i > least)
        drop(o, i - 1);
    else
        push(o, edge(b, a));
}

static void open_all(open_edges *o, const uint32_t *face)
{
    for (int k = 0; k < 3; k++)
        push(o, edge(face[(k + 1) % 3], face[k]));
}

static void put(gates *s, int stream, uint32_t byte)
{
    s->stream[stream][s->bytes[stream]++] = (uint8_t)byte;
}

static void put_number(gates *s, uint32_t number)
{
    if (number < LOW_END) {
        put(s, LOW, number);
    } else if (number - LOW_END < 256 * (TWO_BYTES_END - LOW_END)) {
        put(s, LOW, LOW_END + ((number - LOW_END) >> 8));
        put(s, MORE, number - LOW_END);
    } else {
        put(s, LOW, TWO_BYTES_END);
        for (int k = 0; k < 4; k++)
            put(s, MORE, number >> 8 * k);
    }
}

static uint32_t gate_of(const open_edges *o, const uint32_t *face, int *first)
{
    for (uint32_t i = o->end; i > o->begin; i--)
        for (int k = 0; k < 3; k++)
            if (o->edge[i - 1] == edge(face[k], face[(k + 1) % 3])) {
                *first = k;
                return i - 1;
            }
    return o->end;
}

/* Which third corner c is; its edge in *at. */
static uint32_t kind_of(const open_edges *o, uint32_t a, uint32_t b, uint32_t c, uint64_t seen,
                        uint32_t *at)
{
    *at = starting(o, b);
    if (c == seen)
        return IS_NEW;
    if (*at < o->end && to(o->edge[*at]) == c)
        return IS_LEFT;
    *at = ending(o, a);
    if (*at < o->end && from(o->edge[*at]) == c)
        return IS_RIGHT;
    *at = starting(o, c);
    return *at < o->end ? AT_OPEN + o->end - 1 - *at : BY_NUMBER;
}

/* What is open after face (a, b, c) across (a, b), which is open no longer. */
static void go_through(open_edges *o, uint32_t kind, uint32_t at, uint32_t a, uint32_t b,
                       uint32_t c)
{
    if (kind == IS_NEW) {
        push(o, edge(c, b));
        push(o, edge(a, c));
        return;
    }
    if (kind == IS_LEFT || kind == IS_RIGHT)
        drop(o, at);
    if (kind != IS_LEFT)
        side(o, b, c);
    if (kind != IS_RIGHT)
        side(o, c, a);
}

void gates_encode(const uint32_t *faces, uint32_t rows, uint64_t seen, gates *s)
{
    static _Thread_local open_edges o;
    o.begin = o.end = 0;
    for (int i = 0; i < GATES_STREAMS; i++) {
        s->stream[i] = s->room[i];
        s->bytes[i] = 0;
    }
    for (const uint32_t *f = faces; f < faces + 3 * (uint64_t)rows; f += 3) {
        int k = 0;
        uint32_t at = gate_of(&o, f, &k);
        put(s, GATE, o.end - at);
        if (at == o.end) {
            for (k = 0; k < 3; k++) {
                put_number(s, (uint32_t)(seen - f[k]));
                seen += f[k] == seen;
            }
            open_all(&o, f);
            continue;
        }
        uint32_t a = f[k], b = f[(k + 1) % 3], c = f[(k + 2) % 3];
        drop(&o, at);
        uint32_t kind = kind_of(&o, a, b, c, seen, &at);
        put(s, THIRD, 3 * kind + (uint32_t)k);
        if (kind == BY_NUMBER)
            put_number(s, (uint32_t)(seen - c));
        seen += kind == IS_NEW;
        go_through(&o, kind, at, a, b, c);
    }
}

typedef struct reading {
    const uint8_t *next[GATES_STREAMS], *end[GATES_STREAMS];
    uint64_t seen;
    open_edges open;
} reading;

static bool get(reading *r, int stream, uint32_t *byte)
{
    if (r->next[stream] == r->end[stream])
        return false;
    *byte = *r->next[stream]++;
    return true;
}

static bool get_vertex(reading *r, uint32_t *vertex)
{
    uint32_t number, more;
    if (!get(r, LOW, &number) || number > TWO_BYTES_END)
        return false;
    if (number == TWO_BYTES_END) {
        number = 0;
        for (int k = 0; k < 4; k++, number |= more << 8 * (k - 1))
            if (!get(r, MORE, &more))
                return false;
    } else if (number >= LOW_END) {
        if (!get(r, MORE, &more))
            return false;
        number = LOW_END + ((number - LOW_END) << 8) + more;
    }
    *vertex = (uint32_t)(r->seen - number);
    r->seen += number == 0;
    return number <= r->seen;
}

static bool get_third(reading *r, uint32_t kind, uint32_t a, uint32_t b, uint32_t *at, uint32_t *c)
{
    const open_edges *o = &r->open;
    if (kind == BY_NUMBER)
        return get_vertex(r, c);
    if (kind == IS_NEW) {
        *c = (uint32_t)r->seen++;
        return true;
    }
    if (kind >= AT_OPEN && kind - AT_OPEN >= o->end - o->begin)
        return false;
    *at = kind == IS_LEFT    ? starting(o, b)
          : kind == IS_RIGHT ? ending(o, a)
                             : o->end - 1 - (kind - AT_OPEN);
    if (*at == o->end)
        return false;
    *c = kind == IS_LEFT ? to(o->edge[*at]) : from(o->edge[*at]);
    return true;
}

static bool across(reading *r, uint32_t gate, uint32_t *face)
{
    static const uint8_t next[5] = { 0, 1, 2, 0, 1 };
    open_edges *o = &r->open;
    uint32_t third, at = o->end - gate, c;
    if (gate > o->end - o->begin || !get(r, THIRD, &third))
        return false;
    uint32_t a = from(o->edge[at]), b = to(o->edge[at]), kind = third / 3, k = third % 3;
    drop(o, at);
    if (!get_third(r, kind, a, b, &at, &c))
        return false;
    face[k] = a;
    face[next[k + 1]] = b;
    face[next[k + 2]] = c;
    go_through(o, kind, at, a, b, c);
    return true;
}

bool gates_decode(const gates *s, uint32_t rows, uint64_t seen, uint32_t *faces)
{
    static _Thread_local reading r;
    r.seen = seen;
    r.open.begin = r.open.end = 0;
    for (int i = 0; i < GATES_STREAMS; i++) {
        r.next[i] = s->stream[i];
        r.end[i] = s->stream[i] + s->bytes[i];
    }
    for (uint32_t *f = faces; f < faces + 3 * (uint64_t)rows; f += 3) {
        uint32_t gate;
        if (!get(&r, GATE, &gate))
            return false;
        if (gate && !across(&r, gate, f))
            return false;
        if (!gate) {
            if (!get_vertex(&r, &f[0]) || !get_vertex(&r, &f[1]) || !get_vertex(&r, &f[2]))
                return false;
            open_all(&r.open, f);
        }
    }
    return true;
}
