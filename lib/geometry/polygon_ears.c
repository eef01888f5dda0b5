#include "core/strict_fp.h"

#include "geometry/polygon_ears.h"

#include <string.h>

#include "core/alloc.h"
#include "geometry/predicates.h"

#define NONE UINT32_MAX

enum {
    WORD = 64,
    LEVELS = 6,  /* of bits: 2^32 corners */
    BLOCK = 8,   /* corners of a leaf of the tree */
    SCANNED = 64 /* outlines up to this length have no tree */
};

typedef struct box {
    double low[2], high[2];
} box;

typedef struct outline {
    const double (*at)[2];
    bool touching;
    uint32_t n, left; /* corners in all, and not yet cut off */
    uint64_t work;

    uint32_t *next, *previous; /* next: NONE once cut off */

    /* [LEVELS][words] corners whose ears are to be tested; above, words that are not 0 */
    uint64_t *bits[LEVELS];
    uint64_t words[LEVELS];
    int levels;

    /* The corner that blocks an ear, and lists of the ears that a corner blocks. */
    uint32_t *blocker, *first_blocked, *next_blocked, *previous_blocked;

    /* [2 * leaves] boxes around runs of corners, from 1; corners left in each */
    box *boxes;
    uint32_t *corners;
    uint32_t leaves; /* a power of two; 0: no tree */
} outline;

/* The triangle that is looked at, and what was seen at its corner b. */
typedef struct ear {
    uint32_t corner[3];
    const double *at[3];
    double low[2], high[2];
    bool along_a, along_c; /* other edges run from b's place towards a; towards c */
} ear;

static int turn(const outline *o, uint32_t a, uint32_t b, uint32_t c)
{
    return ebpo_orient2d(o->at[a], o->at[b], o->at[c]);
}

static bool same_place(const double a[2], const double b[2])
{
    return a[0] == b[0] && a[1] == b[1];
}

/* ---- corners to be tested, in their order ---- */

static void set_bit(outline *o, uint64_t i)
{
    for (int l = 0; l < o->levels; l++, i /= WORD) {
        uint64_t *word = &o->bits[l][i / WORD], before = *word;
        *word |= UINT64_C(1) << i % WORD;
        if (before)
            return;
    }
}

static void clear_bit(outline *o, uint64_t i)
{
    for (int l = 0; l < o->levels; l++, i /= WORD) {
        uint64_t *word = &o->bits[l][i / WORD];
        *word &= ~(UINT64_C(1) << i % WORD);
        if (*word)
            return;
    }
}

/* Returns the first one from i on, or NONE. */
static uint32_t find_bit(const outline *o, uint64_t i)
{
    for (int l = 0; l < o->levels && i / WORD < o->words[l]; l++, i = i / WORD + 1) {
        uint64_t word = o->bits[l][i / WORD] & ~UINT64_C(0) << i % WORD;
        if (!word)
            continue;
        i = i / WORD * WORD + (uint64_t)__builtin_ctzll(word);
        while (l-- > 0)
            i = i * WORD + (uint64_t)__builtin_ctzll(o->bits[l][i]);
        return (uint32_t)i;
    }
    return NONE;
}

/* ---- ears that wait for a corner to go ---- */

static void unblock(outline *o, uint32_t b)
{
    uint32_t x = o->blocker[b];
    if (x == NONE)
        return;
    uint32_t before = o->previous_blocked[b], after = o->next_blocked[b];
    *(before == NONE ? &o->first_blocked[x] : &o->next_blocked[before]) = after;
    if (after != NONE)
        o->previous_blocked[after] = before;
    o->blocker[b] = NONE;
}

static void block(outline *o, uint32_t b, uint32_t x)
{
    uint32_t after = o->first_blocked[x];
    o->blocker[b] = x;
    o->previous_blocked[b] = NONE;
    o->next_blocked[b] = after;
    o->first_blocked[x] = b;
    if (after != NONE)
        o->previous_blocked[after] = b;
}

static void test_blocked_again(outline *o, uint32_t x)
{
    for (uint32_t b; (b = o->first_blocked[x]) != NONE; unblock(o, b))
        set_bit(o, b);
}

/* ---- the tree ---- */

static void join_box(box *b, const double low[2], const double high[2])
{
    for (int k = 0; k < 2; k++) {
        b->low[k] = low[k] < b->low[k] ? low[k] : b->low[k];
        b->high[k] = high[k] > b->high[k] ? high[k] : b->high[k];
    }
}

static void build_tree(outline *o)
{
    for (uint32_t node = 1; node < 2 * o->leaves; node++)
        o->corners[node] = 0;
    for (uint32_t i = 0; i < o->n; i++) {
        uint32_t node = o->leaves + i / BLOCK;
        if (o->corners[node]++ == 0) {
            memcpy(o->boxes[node].low, o->at[i], sizeof o->boxes->low);
            memcpy(o->boxes[node].high, o->at[i], sizeof o->boxes->high);
        } else
            join_box(&o->boxes[node], o->at[i], o->at[i]);
    }
    for (uint32_t node = o->leaves - 1; node > 0; node--) {
        const box *right = &o->boxes[2 * node + 1];
        o->corners[node] = o->corners[2 * node] + o->corners[2 * node + 1];
        o->boxes[node] = o->boxes[2 * node];
        if (o->corners[2 * node + 1])
            join_box(&o->boxes[node], right->low, right->high);
    }
}

/* Returns false where no corner of the box can block the ear. */
static bool may_block(const outline *o, const ear *e, const box *b)
{
    for (int k = 0; k < 2; k++)
        if (b->low[k] > e->high[k] || b->high[k] < e->low[k])
            return false;
    if (!o->touching && same_place(b->low, b->high))
        for (int k = 0; k < 3; k++)
            if (same_place(b->low, e->at[k]))
                return false;
    for (int k = 0; k < 3; k++) {
        const double *u = e->at[k], *v = e->at[(k + 1) % 3];
        const double farthest[2] = { v[1] < u[1] ? b->high[0] : b->low[0],
                                     v[0] > u[0] ? b->high[1] : b->low[1] };
        if (ebpo_orient2d(u, v, farthest) < 0)
            return false;
    }
    return true;
}

/* ---- what blocks an ear ---- */

/* Returns whether q is on the ray from b through a; b, a and q are collinear, a is elsewhere. */
static bool is_along(const double b[2], const double a[2], const double q[2])
{
    int k = a[0] == b[0];
    return a[k] > b[k] ? q[k] > b[k] : q[k] < b[k];
}

static void note_edges_along(const outline *o, ear *e, uint32_t i)
{
    const uint32_t *c = e->corner;
    const uint32_t beside[2] = { o->next[i], o->previous[i] };
    for (int k = 0; k < 2; k++) {
        const double *q = o->at[beside[k]];
        e->along_a |= turn(o, c[1], c[0], beside[k]) == 0 && is_along(e->at[1], e->at[0], q);
        e->along_c |= turn(o, c[1], c[2], beside[k]) == 0 && is_along(e->at[1], e->at[2], q);
    }
}

/* Returns whether the edge from a corner on the ear's border, where side[k] is 0, goes into it. */
static bool enters(const outline *o, const ear *e, const int side[3], uint32_t to)
{
    for (int k = 0; k < 3; k++)
        if (side[k] == 0 && turn(o, e->corner[k], e->corner[(k + 1) % 3], to) <= 0)
            return false;
    return true;
}

static bool blocks(const outline *o, ear *e, uint32_t i)
{
    const double *p = o->at[i];
    int side[3];
    if (p[0] < e->low[0] || p[0] > e->high[0] || p[1] < e->low[1] || p[1] > e->high[1] ||
        i == e->corner[0] || i == e->corner[1] || i == e->corner[2])
        return false;
    if (!o->touching &&
        (same_place(p, e->at[0]) || same_place(p, e->at[1]) || same_place(p, e->at[2])))
        return false;
    for (int k = 0; k < 3; k++)
        if ((side[k] = turn(o, e->corner[k], e->corner[(k + 1) % 3], i)) < 0)
            return false;
    if (!o->touching || (side[0] > 0 && side[1] > 0))
        return true;
    if (side[0] == 0 && side[1] == 0)
        note_edges_along(o, e, i);
    return enters(o, e, side, o->next[i]) || enters(o, e, side, o->previous[i]);
}

static uint32_t blocker_in_leaf(outline *o, ear *e, uint32_t leaf)
{
    uint32_t begin = leaf * BLOCK, end = o->n - begin < BLOCK ? o->n : begin + BLOCK;
    o->work += end - begin;
    for (uint32_t i = begin; i < end; i++)
        if (o->next[i] != NONE && blocks(o, e, i))
            return i;
    return NONE;
}

static uint32_t blocker_in_tree(outline *o, ear *e)
{
    uint32_t stack[64], open = 0;
    stack[open++] = 1;
    while (open) {
        uint32_t node = stack[--open], found;
        o->work++;
        if (!o->corners[node] || !may_block(o, e, &o->boxes[node]))
            continue;
        if (node < o->leaves) {
            stack[open++] = 2 * node + 1;
            stack[open++] = 2 * node;
        } else if ((found = blocker_in_leaf(o, e, node - o->leaves)) != NONE)
            return found;
    }
    return NONE;
}

static uint32_t find_blocker(outline *o, ear *e)
{
    if (o->leaves)
        return blocker_in_tree(o, e);
    o->work += o->left;
    for (uint32_t i = o->next[e->corner[2]]; i != e->corner[0]; i = o->next[i])
        if (blocks(o, e, i))
            return i;
    return NONE;
}

static double least(double a, double b, double c)
{
    return a < b ? (a < c ? a : c) : (b < c ? b : c);
}

static ear ear_at(const outline *o, uint32_t b)
{
    ear e = { .corner = { o->previous[b], b, o->next[b] } };
    for (int k = 0; k < 3; k++)
        e.at[k] = o->at[e.corner[k]];
    for (int k = 0; k < 2; k++) {
        e.low[k] = least(e.at[0][k], e.at[1][k], e.at[2][k]);
        e.high[k] = -least(-e.at[0][k], -e.at[1][k], -e.at[2][k]);
    }
    return e;
}

/* ---- which side of the outline an ear is on ---- */

/* Finds a point within the ear; false where rounding leaves none. */
static bool point_within(const ear *e, double out[2])
{
    for (int k = 0; k < 2; k++)
        out[k] = e->at[1][k] / 2 + (e->at[0][k] / 4 + e->at[2][k] / 4);
    for (int k = 0; k < 3; k++)
        if (ebpo_orient2d(e->at[k], e->at[(k + 1) % 3], out) <= 0)
            return false;
    return true;
}

/* Returns the winding number of what is left of the outline around q, which is not on it. */
static int64_t winding_around(outline *o, uint32_t start, const double q[2])
{
    int64_t winding = 0;
    uint32_t i = start;
    o->work += o->left;
    do {
        const double *p = o->at[i], *r = o->at[o->next[i]];
        if (p[1] <= q[1] && r[1] > q[1])
            winding += ebpo_orient2d(p, r, q) > 0;
        else if (p[1] > q[1] && r[1] <= q[1])
            winding -= ebpo_orient2d(p, r, q) < 0;
        i = o->next[i];
    } while (i != start);
    return winding;
}

/* Returns whether the ear is a bend of a passage without width, whose other side runs beside it:
 * nothing is within such an ear. */
static bool is_outside(outline *o, const ear *e)
{
    double q[2];
    return e->along_a && e->along_c && point_within(e, q) &&
           winding_around(o, e->corner[1], q) <= 0;
}

/* Returns whether b is the tip of a spike without area, or at the place of a neighbour. */
static bool is_spike(const outline *o, uint32_t b)
{
    uint32_t a = o->previous[b], c = o->next[b];
    if (turn(o, a, b, c) != 0)
        return false;
    return same_place(o->at[a], o->at[b]) || same_place(o->at[b], o->at[c]) ||
           is_along(o->at[b], o->at[a], o->at[c]);
}

static uint32_t find_spike(outline *o, uint32_t b)
{
    for (uint32_t i = 0; i < o->left; i++, b = o->next[b]) {
        o->work++;
        if (is_spike(o, b))
            return b;
    }
    return NONE;
}

/* ---- cutting ---- */

static void cut_off(outline *o, uint32_t b, uint32_t triangle[3])
{
    uint32_t a = o->previous[b], c = o->next[b];
    triangle[0] = a;
    triangle[1] = b;
    triangle[2] = c;
    o->next[a] = c;
    o->previous[c] = a;
    o->next[b] = NONE;
    o->left--;
    unblock(o, b);
    clear_bit(o, b);
    set_bit(o, a);
    set_bit(o, c);
    test_blocked_again(o, b);
    if (o->touching) { /* these have other edges now */
        test_blocked_again(o, a);
        test_blocked_again(o, c);
    }
    for (uint32_t node = o->leaves ? o->leaves + b / BLOCK : 0; node; node /= 2)
        o->corners[node]--;
}

/* Returns whether the ear at b may be cut; if not, it is tested again when that may change. */
static bool is_ear(outline *o, uint32_t b)
{
    ear e = ear_at(o, b);
    clear_bit(o, b);
    unblock(o, b);
    if (ebpo_orient2d(e.at[0], e.at[1], e.at[2]) <= 0)
        return false;
    uint32_t x = find_blocker(o, &e);
    if (x != NONE)
        block(o, b, x);
    return x == NONE && !is_outside(o, &e);
}

/* Goes around and cuts every ear, skipping one corner after each cut so that fans of slivers stay
 * short. */
static ebpo_ears cut_all(outline *o, uint32_t (*triangle)[3], uint64_t limit)
{
    uint32_t done = 0, b = 0;
    while (o->left > 3) {
        if (o->work++ > limit)
            return EBPO_EARS_WORK;
        uint32_t found = find_bit(o, b);
        if (found == NONE)
            found = find_bit(o, 0);
        if (found == NONE) {
            b = o->touching ? find_spike(o, b) : NONE;
            if (b == NONE)
                return EBPO_EARS_STUCK;
        } else if (b = found, !is_ear(o, b))
            continue;
        uint32_t c = o->next[b];
        cut_off(o, b, triangle[done++]);
        b = o->next[c];
    }
    if (turn(o, o->previous[b], b, o->next[b]) < 0)
        return EBPO_EARS_STUCK;
    cut_off(o, b, triangle[done]);
    return EBPO_EARS_CUT;
}

/* ---- scratch ---- */

uint64_t ebpo_ears_scratch_bytes(uint64_t n)
{
    /* a corner has six numbers, and at most 4 / BLOCK boxes and counts; bits take less than one
     * byte */
    const uint64_t each = 6 * sizeof(uint32_t) + 4 * (sizeof(box) + sizeof(uint32_t)) / BLOCK + 1;
    uint64_t bytes;
    return ebpo_mul_ok(n + WORD, each, &bytes) ? bytes : 0;
}

static void *take(char **at, uint64_t bytes)
{
    void *taken = *at;
    *at += bytes;
    return taken;
}

static void place_arrays(outline *o, void *scratch)
{
    char *at = scratch;
    uint64_t words = o->n;
    if (o->n > SCANNED)
        for (o->leaves = 1; (uint64_t)o->leaves * BLOCK < o->n;)
            o->leaves *= 2;
    o->boxes = take(&at, 2 * (uint64_t)o->leaves * sizeof *o->boxes);
    do {
        words = (words + WORD - 1) / WORD;
        o->words[o->levels] = words;
        o->bits[o->levels++] = take(&at, words * sizeof **o->bits);
    } while (words > 1);
    uint32_t **arrays[] = { &o->next,          &o->previous,     &o->blocker,
                            &o->first_blocked, &o->next_blocked, &o->previous_blocked };
    for (size_t i = 0; i < sizeof arrays / sizeof *arrays; i++)
        *arrays[i] = take(&at, o->n * sizeof **arrays[i]);
    o->corners = take(&at, 2 * (uint64_t)o->leaves * sizeof *o->corners);
}

ebpo_ears ebpo_ears_cut(uint32_t (*triangle)[3], const double (*at)[2], uint32_t n,
                        ebpo_ear_rule rule, uint64_t limit, void *scratch)
{
    outline o = { .at = at, .touching = rule == EBPO_EARS_TOUCHING, .n = n, .left = n };
    place_arrays(&o, scratch);
    for (int l = 0; l < o.levels; l++)
        memset(o.bits[l], 0, o.words[l] * sizeof **o.bits);
    for (uint32_t i = 0; i < n; i++) {
        o.next[i] = i + 1 < n ? i + 1 : 0;
        o.previous[i] = i ? i - 1 : n - 1;
        o.blocker[i] = o.first_blocked[i] = NONE;
        set_bit(&o, i);
    }
    if (o.leaves)
        build_tree(&o);
    return cut_all(&o, triangle, limit);
}
