/* Encodes the modes ATTRIBUTES and TRIANGLES of EXT_meshopt_compression. Source: Khronos, "glTF
 * extension EXT_meshopt_compression", appendix A. */
#include "derive/meshopt_codec.h"

#include <string.h>

#include "core/alloc.h"

/* --- attributes --- */

enum {
    ATTRIBUTES_HEADER = 0xa0,
    /* number of elements of a group; store_group chooses how one byte of each element is stored */
    GROUP = 16,
    BLOCK_MAX = 256,    /* maximum number of elements of a block */
    BLOCK_BYTES = 8192, /* maximum number of bytes of a block's elements */
    /* the data end with the first element, preceded by zeros if it has fewer bytes than this */
    TAIL_BYTES = 32
};

/* Returns the number of elements of a full block. */
static uint64_t block_elements(unsigned stride)
{
    uint64_t n = BLOCK_BYTES / stride & ~(uint64_t)(GROUP - 1);
    return n < BLOCK_MAX ? n : BLOCK_MAX;
}

uint64_t ebpo_meshopt_attributes_bound(uint64_t count, unsigned stride)
{
    uint64_t groups = (count + GROUP - 1) / GROUP, blocks = count / block_elements(stride) + 1;
    return 1 + stride * (groups * (GROUP + 1) + blocks) +
           (stride < TAIL_BYTES ? TAIL_BYTES : stride);
}

/* Stores 16 differences: first `bits` bits for each difference, then whole bytes for large
 * differences. A difference is large if it is at least 2^bits - 1. Its bits are then all 1, and the
 * difference itself is stored as a whole byte. */
static uint8_t *pack_group(const uint8_t *difference, unsigned bits, uint8_t *out)
{
    unsigned each = 8 / bits;
    uint8_t most = (uint8_t)((1 << bits) - 1);
    for (unsigned i = 0; i < GROUP; i += each) {
        unsigned byte = 0;
        for (unsigned k = 0; k < each; k++)
            byte = byte << bits | (difference[i + k] < most ? difference[i + k] : most);
        *out++ = (uint8_t)byte;
    }
    for (unsigned i = 0; i < GROUP; i++)
        if (difference[i] >= most)
            *out++ = difference[i];
    return out;
}

/* Stores a group in the shortest of four ways, and sets *way to the number of this way. 0: all
 * differences are 0, nothing is stored; 1: 2 bits each; 2: 4 bits each; 3: a byte each. */
static uint8_t *store_group(const uint8_t *difference, unsigned *way, uint8_t *out)
{
    unsigned zeros = 0, large2 = 0, large4 = 0;
    for (unsigned i = 0; i < GROUP; i++) {
        zeros += difference[i] == 0;
        large2 += difference[i] >= 3;
        large4 += difference[i] >= 15;
    }
    unsigned bytes2 = GROUP / 4 + large2, bytes4 = GROUP / 2 + large4;
    *way = zeros == GROUP ? 0 : bytes2 <= bytes4 && bytes2 < GROUP ? 1 : bytes4 < GROUP ? 2 : 3;
    if (*way == 0)
        return out;
    if (*way != 3)
        return pack_group(difference, *way == 1 ? 2 : 4, out);
    memcpy(out, difference, GROUP);
    return out + GROUP;
}

/* Stores one byte of each element of a block, as its difference from the same byte of the previous
 * element. `last`: this byte in the element before the block. */
static uint8_t *store_byte(const uint8_t *elements, uint64_t count, unsigned stride, uint8_t last,
                           uint8_t *out)
{
    uint64_t groups = (count + GROUP - 1) / GROUP;
    uint8_t *ways = out;
    memset(ways, 0, (groups + 3) / 4);
    out += (groups + 3) / 4;
    for (uint64_t g = 0; g < groups; g++) {
        uint8_t difference[GROUP] = { 0 };
        unsigned way;
        for (uint64_t i = g * GROUP; i < count && i < (g + 1) * GROUP; i++) {
            uint8_t byte = elements[i * stride], change = (uint8_t)(byte - last);
            difference[i % GROUP] = (uint8_t)(change << 1) ^ (uint8_t)(change & 0x80 ? 0xff : 0);
            last = byte;
        }
        out = store_group(difference, &way, out);
        ways[g / 4] |= (uint8_t)(way << 2 * (g % 4));
    }
    return out;
}

uint64_t ebpo_meshopt_attributes(const uint8_t *elements, uint64_t count, unsigned stride,
                                 uint8_t *out)
{
    uint8_t *to = out;
    uint64_t most = block_elements(stride);
    const uint8_t *last = elements; /* the first element is the base of the first differences */
    *to++ = ATTRIBUTES_HEADER;
    for (uint64_t i = 0; i < count; i += most) {
        uint64_t n = count - i < most ? count - i : most;
        const uint8_t *block = elements + i * stride;
        for (unsigned k = 0; k < stride; k++)
            to = store_byte(block + k, n, stride, last[k], to);
        last = block + (n - 1) * stride;
    }
    unsigned padding = stride < TAIL_BYTES ? TAIL_BYTES - stride : 0;
    memset(to, 0, padding);
    memcpy(to + padding, elements, stride);
    return (uint64_t)(to - out) + padding + stride;
}

/* --- triangles --- */

enum {
    TRIANGLES_HEADER = 0xe1,
    RECENT = 16,      /* number of entries of the list of edges, and of the list of vertices */
    EDGES_USED = 15,  /* a code can name one of the latest 15 edges */
    BESIDE_EDGE = 12, /* for a triangle at a recent edge, a code can name recent vertices 1 to 12 */
    BESIDE_NONE = 14, /* for other triangles, a code can name recent vertices 0 to 13 */
    /* codes of a vertex that is not named as a recent vertex */
    CODE_NEW = 0,     /* the next vertex that was not used */
    CODE_BEFORE = 13, /* the vertex before triangle_encoder.last */
    CODE_AFTER = 14,  /* the vertex after triangle_encoder.last */
    CODE_OTHER = 15,  /* any other vertex, stored by store_vertex */
    TABLE_BYTES = 16, /* size of the table of codes at the end */
    NUMBER_MAX = 5    /* maximum number of bytes that store_vertex writes */
};

typedef struct triangle_encoder {
    uint32_t edge[RECENT][2], vertex[RECENT];
    /* index of the next entry in each list; the oldest entry is overwritten */
    unsigned edges, vertices;
    uint32_t next; /* first vertex that was not used */
    uint32_t last; /* vertex last stored by store_vertex, CODE_BEFORE or CODE_AFTER */
    uint8_t *data;
} triangle_encoder;

uint64_t ebpo_meshopt_triangles_bound(uint64_t count)
{
    return 1 + count * (2 + 3 * NUMBER_MAX) + TABLE_BYTES;
}

static void push_edge(triangle_encoder *e, uint32_t a, uint32_t b)
{
    e->edge[e->edges][0] = a;
    e->edge[e->edges][1] = b;
    e->edges = (e->edges + 1) % RECENT;
}

static void push_vertex(triangle_encoder *e, uint32_t v)
{
    e->vertex[e->vertices] = v;
    e->vertices = (e->vertices + 1) % RECENT;
}

/* Searches the list of recent edges, latest edge first, for an edge of the triangle. Returns the
 * number of the edge (0: the latest), and sets *corner to the edge's first corner. Returns
 * EDGES_USED if no edge is found. */
static unsigned find_edge(const triangle_encoder *e, const uint32_t *t, unsigned *corner)
{
    for (unsigned i = 0; i < EDGES_USED; i++) {
        const uint32_t *edge = e->edge[(e->edges + RECENT - 1 - i) % RECENT];
        for (*corner = 0; *corner < 3; ++*corner)
            if (edge[0] == t[*corner] && edge[1] == t[(*corner + 1) % 3])
                return i;
    }
    return EDGES_USED;
}

/* Returns the number of a vertex in the list of recent vertices (0: the latest vertex), or RECENT
 * if the vertex is not in the list. */
static unsigned find_recent(const triangle_encoder *e, uint32_t v)
{
    unsigned i = 0;
    while (i < RECENT && e->vertex[(e->vertices + RECENT - 1 - i) % RECENT] != v)
        i++;
    return i;
}

/* Stores a vertex as its difference from e->last. */
static void store_vertex(triangle_encoder *e, uint32_t v)
{
    uint32_t change = v - e->last, left = change << 1 ^ (change >> 31 ? UINT32_MAX : 0);
    for (; left > 0x7f; left >>= 7)
        *e->data++ = (uint8_t)(0x80 | (left & 0x7f));
    *e->data++ = (uint8_t)left;
    e->last = v;
}

/* Encodes the triangle (a, b, c) at the recent edge from a to b, which has number `edge`. Returns
 * the triangle's code. */
static uint8_t encode_at_edge(triangle_encoder *e, unsigned edge, uint32_t a, uint32_t b,
                              uint32_t c)
{
    unsigned recent = find_recent(e, c), code = recent;
    if (c == e->next) {
        code = CODE_NEW;
        e->next++;
    } else if (recent < 1 || recent > BESIDE_EDGE) {
        code = c == e->last - 1 ? CODE_BEFORE : c == e->last + 1 ? CODE_AFTER : CODE_OTHER;
        if (code == CODE_OTHER)
            store_vertex(e, c);
        e->last = c;
    }
    push_edge(e, c, b);
    push_edge(e, a, c);
    if (code == CODE_NEW || code >= CODE_BEFORE)
        push_vertex(e, c);
    return (uint8_t)(edge << 4 | code);
}

/* Returns how a vertex of a triangle without a recent edge is stored: CODE_NEW; 1 to 14, a
 * recent vertex; or CODE_OTHER. */
static unsigned code_of(triangle_encoder *e, uint32_t v)
{
    unsigned recent = find_recent(e, v);
    if (v == e->next) {
        e->next++;
        return CODE_NEW;
    }
    return recent < BESIDE_NONE ? recent + 1 : CODE_OTHER;
}

/* Encodes a triangle without a recent edge; returns the triangle's code. */
static uint8_t encode_apart(triangle_encoder *e, uint32_t a, uint32_t b, uint32_t c)
{
    uint8_t code = 0xff;
    if (a == e->next) {
        e->next++;
        code = 0xfe;
    }
    unsigned b_code = code_of(e, b), c_code = code_of(e, c);
    if (code == 0xfe && !b_code && !c_code) {
        code = 0xf0; /* the first entry of the table: all three vertices are new */
    } else {
        /* This byte is never 0. A byte 0 would make the decoder restart its vertex numbers. The
         * byte would be 0 only if b and c were new and a were not new. But triangles are rotated so
         * that a is new if b or c is new. */
        *e->data++ = (uint8_t)(b_code << 4 | c_code);
    }
    if (code == 0xff)
        store_vertex(e, a);
    if (b_code == CODE_OTHER)
        store_vertex(e, b);
    if (c_code == CODE_OTHER)
        store_vertex(e, c);
    push_edge(e, b, a);
    push_edge(e, c, b);
    push_edge(e, a, c);
    push_vertex(e, a);
    if (!b_code || b_code == CODE_OTHER)
        push_vertex(e, b);
    if (!c_code || c_code == CODE_OTHER)
        push_vertex(e, c);
    return code;
}

uint64_t ebpo_meshopt_triangles(const uint32_t *triangles, uint64_t count, uint8_t *out)
{
    triangle_encoder e = { .data = out + 1 + count };
    memset(e.edge, 0xff, sizeof e.edge);
    memset(e.vertex, 0xff, sizeof e.vertex);
    out[0] = TRIANGLES_HEADER;
    for (uint64_t i = 0; i < count; i++) {
        const uint32_t *t = triangles + 3 * i;
        unsigned first, edge = find_edge(&e, t, &first);
        if (edge == EDGES_USED) /* if a corner is a new vertex, it becomes the first corner */
            first = t[1] == e.next ? 1 : t[2] == e.next ? 2 : 0;
        if (edge == EDGES_USED && t[0] == e.next)
            first = 0;
        uint32_t a = t[first], b = t[(first + 1) % 3], c = t[(first + 2) % 3];
        out[1 + i] =
            edge < EDGES_USED ? encode_at_edge(&e, edge, a, b, c) : encode_apart(&e, a, b, c);
    }
    memset(e.data, 0, TABLE_BYTES); /* a table whose first entry stands for three new vertices */
    return (uint64_t)(e.data - out) + TABLE_BYTES;
}
