/* What makes a leaf easy: a wall that no face meets, and faces whose planes alone decide.
 *
 * Kinds. Let P be the set of points of the cell below all planes of the leaf's faces. If every face
 * lies in P (all its corners below all planes), then each face lies on the boundary of P, so the
 * winding number is constant within P's interior; and it is constant in each component of the rest
 * of the cell. Every such component contains a corner of the cell: a point above plane i can move
 * to the corner that is farthest along that plane's normal and stays above. So when all corners of
 * the cell that do not lie in P's closure have the same winding number, and one point of P's
 * interior is known, the planes decide. The same holds with "above" for "below" (concave). */
#include "geom/strict_fp.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include <sched.h>

#include "base/alloc.h"
#include "geom/min_max.h"
#include "geom/predicates.h"
#include "accel/accel_parts.h"

enum { FACES_MAX = 64 };

/* The leaf in its cell's coordinates (0 .. 1), rounded: corners of faces whose box meets the cell.
 */
typedef struct leaf_faces {
    int count;
    double p[FACES_MAX][3][3];
    uint32_t slot[FACES_MAX];
    double low[3], size[3], inverse[3];
} leaf_faces;

/* The boxes of a block's faces, and those that meet the cell. */
typedef struct block_boxes {
    double least[3][EBPO_BLOCK], most[3][EBPO_BLOCK];
    unsigned near; /* a bit for each face */
} block_boxes;

/* Finds which of the faces listed in a block have boxes that meet the cell, and which walls these
 * boxes come to (bit 2 axis + side). Exact comparisons. */
static void bound_block(const ebpo_accel *s, const ebpo_listed_block *listed, const double low[3],
                        const double high[3], block_boxes *out, unsigned *walls)
{
    const ebpo_meshlet *m = ebpo_accel_meshlet(s, listed->block);
    int away[EBPO_BLOCK] = { 0 }, touches[EBPO_BLOCK] = { 0 };
    for (unsigned k = 0; k < 3; k++) {
        double x[3][EBPO_BLOCK];
        for (unsigned i = 0; i < 3; i++)
            for (unsigned lane = 0; lane < EBPO_BLOCK; lane++) {
                unsigned at = ebpo_meshlet_vertex(m, lane, i) + k * m->vertices;
                x[i][lane] =
                    s->wide ? ebpo_meshlet_doubles(m)[at] : (double)ebpo_meshlet_floats(m)[at];
            }
        for (int lane = 0; lane < EBPO_BLOCK; lane++) {
            double least = ebpo_min3(x[0][lane], x[1][lane], x[2][lane]),
                   most = ebpo_max3(x[0][lane], x[1][lane], x[2][lane]);
            out->least[k][lane] = least;
            out->most[k][lane] = most;
            away[lane] |= (least > high[k]) | (most < low[k]);
            touches[lane] |= (least <= low[k]) << 2 * k | (most >= high[k]) << (2 * k + 1);
        }
    }
    out->near = 0;
    for (int lane = 0; lane < EBPO_BLOCK; lane++) {
        bool near = listed->lanes >> lane & 1 && !away[lane];
        out->near |= (unsigned)near << lane;
        *walls |= near ? (unsigned)touches[lane] : 0;
    }
}

/* A coordinate in the cell, 0 .. EBPO_LISTED_CELLS, widened by far more than the rounding here and
 * in those that ask (2^-40). */
static uint8_t listed(double x, double low, double inverse, double widening)
{
    double cells = (x - low) * inverse * EBPO_LISTED_CELLS + widening;
    return cells < 0 ? 0 : cells < 255 ? (uint8_t)cells : 255;
}

static void set_listed_box(ebpo_listed_block *out, const block_boxes *b, const double low[3],
                           const double inverse[3])
{
    for (int k = 0; k < 3; k++) {
        double least = INFINITY, most = -INFINITY;
        for (int lane = 0; lane < EBPO_BLOCK; lane++)
            if (b->near >> lane & 1) {
                least = b->least[k][lane] < least ? b->least[k][lane] : least;
                most = b->most[k][lane] > most ? b->most[k][lane] : most;
            }
        out->low[k] = b->near ? listed(least, low[k], inverse[k], -0x1p-8) : 255;
        out->high[k] = b->near ? listed(most, low[k], inverse[k], 0x1p-8) : 0;
    }
}

static void add_face(const ebpo_accel *s, uint32_t slot, leaf_faces *f)
{
    double t[3][3];
    ebpo_accel_triangle(s, slot, t);
    for (int i = 0; i < 9; i++)
        f->p[f->count][i / 3][i % 3] = (t[i / 3][i % 3] - f->low[i % 3]) * f->inverse[i % 3];
    f->slot[f->count++] = slot;
}

/* Gathers the faces whose boxes meet the cell, the walls that they come to, and the boxes of the
 * list. False when they are not to be had: too many, or a cell too small for what follows. */
static bool gather(const ebpo_accel *s, const ebpo_accel_leaf *leaf, const double low[3],
                   const double high[3], leaf_faces *f, unsigned *walls)
{
    bool fine = true;
    f->count = 0;
    *walls = 0;
    for (int k = 0; k < 3; k++) {
        f->low[k] = low[k];
        f->size[k] = high[k] - low[k];
        f->inverse[k] = 1 / f->size[k];
        fine = fine && f->size[k] > 0x1p-900;
    }
    bool few = fine;
    for (uint32_t b = 0; b < leaf->blocks; b++) {
        ebpo_listed_block *block = &s->list[leaf->list + b];
        block_boxes boxes;
        bound_block(s, block, low, high, &boxes, walls);
        if (fine)
            set_listed_box(block, &boxes, low, f->inverse);
        for (unsigned near = boxes.near; near && few; near &= near - 1) {
            few = f->count < FACES_MAX;
            if (few)
                add_face(s, block->block * EBPO_BLOCK + (unsigned)__builtin_ctz(near), f);
        }
    }
    return few;
}

/* Crossings of the leaf's faces with a segment along an axis. */
static int32_t crossings(const ebpo_accel *s, const ebpo_accel_leaf *leaf, const double from[3],
                         double to, int axis)
{
    int32_t sum = 0;
    for (uint32_t b = 0; b < leaf->blocks; b++) {
        const ebpo_listed_block *listed = &s->list[leaf->list + b];
        for (unsigned lanes = listed->lanes; lanes; lanes &= lanes - 1) {
            double t[3][3];
            ebpo_accel_triangle(s, listed->block * EBPO_BLOCK + (unsigned)__builtin_ctz(lanes), t);
            sum += ebpo_axis_crossing(from, to, axis, t[0], t[1], t[2]);
        }
    }
    return sum;
}

/* From the lowest corner to any shifted point of the cell, axis by axis. */
static int32_t winding_at(const ebpo_accel *s, const ebpo_accel_leaf *leaf, int32_t at_corner,
                          const double low[3], const double p[3])
{
    double from[3] = { low[0], low[1], low[2] };
    for (int axis = 0; axis < 3; axis++) {
        if (p[axis] > from[axis])
            at_corner += crossings(s, leaf, from, p[axis], axis);
        from[axis] = p[axis];
    }
    return at_corner;
}

typedef struct plane {
    double n[3], d;
} plane;

/* The plane of a face in the cell's coordinates, 1-norm 1. False when rounding could have touched
 * it: a sliver, or corners far outside the cell. */
static bool face_plane(const ebpo_accel *s, const leaf_faces *f, int face, plane *out)
{
    const double(*p)[3] = (const double(*)[3])f->p[face];
    double t[3][3], e[3], g[3], norm = 0, products = 0, reach = 0;
    ebpo_accel_triangle(s, f->slot[face], t);
    for (int k = 0; k < 3; k++) { /* of the corners as they are: those in the cell's coordinates are
                                     rounded, which short edges do not stand */
        e[k] = (t[1][k] - t[0][k]) * f->inverse[k];
        g[k] = (t[2][k] - t[0][k]) * f->inverse[k];
    }
    for (int k = 0; k < 3; k++) {
        int u = k == 2 ? 0 : k + 1, v = k == 0 ? 2 : k - 1;
        double a = e[u] * g[v], b = e[v] * g[u];
        out->n[k] = a - b;
        norm += fabs(a - b);
        products += fabs(a) + fabs(b);
        reach = ebpo_max3(reach, ebpo_max3(fabs(p[0][k]), fabs(p[1][k]), fabs(p[2][k])), 0);
    }
    /* n is right to 2^-50 of the products, so to 2^-40 of its norm, and n . xi to 2^-33 for every
     * corner: less than what sides_of calls certain. */
    if (!(norm > products * 0x1p-10) || !(products > 0x1p-900) || !(reach < 64))
        return false;
    out->d = 0;
    for (int k = 0; k < 3; k++) {
        out->n[k] /= norm;
        out->d += out->n[k] * p[0][k];
    }
    return true;
}

/* Exact side of a corner of face j with regard to the plane of face i: -1 below, 1 above. */
static int exact_side(const ebpo_accel *s, uint32_t plane_slot, uint32_t point_slot, int corner)
{
    double a[3][3], b[3][3];
    ebpo_accel_triangle(s, plane_slot, a);
    ebpo_accel_triangle(s, point_slot, b);
    for (int i = 0; i < 3; i++) /* neighbours share corners */
        if (a[i][0] == b[corner][0] && a[i][1] == b[corner][1] && a[i][2] == b[corner][2])
            return 0;
    return ebpo_orient3d(a[0], a[1], a[2], b[corner]);
}

/* Adds up on which sides of plane i the faces lie: bit 0 some corner above, bit 1 some corner
 * below. */
static unsigned sides_of(const ebpo_accel *s, const leaf_faces *f, int i, const plane *q,
                         unsigned wanted)
{
    unsigned sides = 0;
    for (int j = 0; j < f->count; j++)
        for (int c = 0; c < 3 && j != i; c++) {
            double value =
                q->n[0] * f->p[j][c][0] + q->n[1] * f->p[j][c][1] + q->n[2] * f->p[j][c][2] - q->d;
            int side = value > 0x1p-26 ? 1 : value < -0x1p-26 ? -1 : 0;
            if (side == 0)
                side = exact_side(s, f->slot[i], f->slot[j], c);
            sides |= side > 0 ? 1 : side < 0 ? 2 : 0;
            if ((sides & wanted) == wanted)
                return sides;
        }
    return sides;
}

static bool same_plane(const ebpo_accel *s, const leaf_faces *f, int i, int j)
{
    for (int c = 0; c < 3; c++)
        if (exact_side(s, f->slot[i], f->slot[j], c) != 0)
            return false;
    return true;
}

/* All distinct planes of the leaf when it is convex (`flip` 1) or concave (-1, planes turned). The
 * number of planes, or 0. */
static int collect_planes(const ebpo_accel *s, const leaf_faces *f, plane *out, int *flip)
{
    int count = 0, of_face[EBPO_KIND_PLANES_MAX];
    unsigned allowed = 3; /* bit 0: convex is still possible, bit 1: concave */
    for (int i = 0; i < f->count; i++) {
        plane q;
        if (!face_plane(s, f, i, &q))
            return 0;
        unsigned sides = sides_of(s, f, i, &q, 3);
        allowed &= (sides & 1 ? 2u : 3u) & (sides & 2 ? 1u : 3u);
        if (!allowed)
            return 0;
        bool known = false;
        for (int k = 0; k < count && !known; k++)
            known = fabs(q.d - out[k].d) < 0x1p-20 &&
                    out[k].n[0] * q.n[0] + out[k].n[1] * q.n[1] + out[k].n[2] * q.n[2] > 0 &&
                    same_plane(s, f, of_face[k], i);
        if (known)
            continue;
        if (count == EBPO_KIND_PLANES_MAX)
            return 0;
        of_face[count] = i;
        out[count++] = q;
    }
    *flip = allowed & 1 ? 1 : -1;
    return count;
}

static bool below_all(const plane *planes, int count, int flip, const double xi[3], bool *certain)
{
    bool below = true;
    *certain = true;
    for (int i = 0; i < count; i++) {
        double value = flip * (planes[i].n[0] * xi[0] + planes[i].n[1] * xi[1] +
                               planes[i].n[2] * xi[2] - planes[i].d);
        if (value > 0x1p-18)
            return *certain = true, false;
        *certain = *certain && value < -0x1p-18;
    }
    return below;
}

static double within_cell(double x) { return x < 0 ? 0 : x > 1 ? 1 : x; }

/* Winding numbers in P and in the rest of the cell, from the cell's corners and, if none of them is
 * in P, from a point near the middle of the faces. False when that does not decide it. */
static bool find_windings(const ebpo_accel *s, ebpo_accel_leaf *leaf, int32_t at_corner,
                          const leaf_faces *f, const plane *planes, int count, int flip)
{
    bool have_inner = false, have_outer = false, certain;
    for (unsigned corner = 0; corner < 8; corner++) {
        double xi[3] = { corner & 1, corner >> 1 & 1, corner >> 2 }, p[3];
        bool below = below_all(planes, count, flip, xi, &certain);
        if (!certain)
            return false;
        for (int k = 0; k < 3; k++)
            p[k] = f->low[k] + xi[k] * f->size[k];
        int32_t w = winding_at(s, leaf, at_corner, f->low, p);
        int32_t *known = below ? &leaf->inner : &leaf->outer;
        bool *have = below ? &have_inner : &have_outer;
        if (*have && *known != w)
            return false;
        *known = w;
        *have = true;
    }
    if (!have_inner) {
        double xi[3] = { 0, 0, 0 }, p[3];
        for (int k = 0; k < 3; k++) {
            for (int i = 0; i < f->count; i++)
                xi[k] += (within_cell(f->p[i][0][k]) + within_cell(f->p[i][1][k]) +
                          within_cell(f->p[i][2][k])) /
                         (3 * f->count);
            p[k] = f->low[k] + xi[k] * f->size[k];
            /* in a cell of a few ulps the point has moved */
            xi[k] = (p[k] - f->low[k]) / f->size[k];
        }
        if (!below_all(planes, count, flip, xi, &certain) || !certain)
            return false;
        leaf->inner = winding_at(s, leaf, at_corner, f->low, p);
    }
    return have_outer;
}

/* --- planes of all leaves: pages, each twice as large as the one before, so that what has been
 * found stays where it is --- */

enum { FIRST_PAGE = 16 };

ebpo_leaf_kinds *ebpo_leaf_kinds_make(uint64_t groups_most)
{
    ebpo_leaf_kinds *k = ebpo_alloc_zero(1, sizeof *k);
    if (k)
        k->groups_most = groups_most;
    if (k)
        pthread_mutex_init(&k->lock, NULL);
    return k;
}

void ebpo_leaf_kinds_free(ebpo_leaf_kinds *k)
{
    if (!k)
        return;
    for (int i = 0; i < EBPO_KIND_PAGES; i++)
        free(k->page[i]);
    pthread_mutex_destroy(&k->lock);
    free(k);
}

/* A page for at least so many groups; false when there is none. */
static bool add_page(ebpo_leaf_kinds *k, uint64_t least)
{
    uint64_t size = (uint64_t)FIRST_PAGE << k->pages, left = k->groups_most - k->groups;
    size = size < left ? size : left;
    if (size < least || k->pages == EBPO_KIND_PAGES)
        return false;
    k->page[k->pages] = aligned_alloc(64, size * sizeof **k->page);
    if (!k->page[k->pages])
        return false;
    k->pages++;
    k->groups += size;
    k->used = 0;
    k->room = size;
    return true;
}

/* The number of the first of so many groups, which lie in one page, or EBPO_NO_PLANES. */
static uint32_t take_groups(ebpo_leaf_kinds *k, uint64_t groups)
{
    uint32_t number = EBPO_NO_PLANES;
    pthread_mutex_lock(&k->lock);
    if (k->used + groups <= k->room || add_page(k, groups)) {
        number = (k->pages - 1) << EBPO_KIND_PAGE_BITS | (uint32_t)k->used;
        k->used += groups;
    }
    pthread_mutex_unlock(&k->lock);
    return number;
}

/* The kind of a leaf with these planes; without memory for them it stays a general one. */
static ebpo_leaf_kind keep_planes(ebpo_leaf_kinds *kinds, ebpo_accel_leaf *leaf,
                                  const plane *planes, int count, int flip)
{
    uint64_t groups = (uint64_t)(count + 3) / 4;
    uint32_t first = take_groups(kinds, groups);
    if (first == EBPO_NO_PLANES)
        return EBPO_LEAF_GENERAL;
    ebpo_four_planes *to = EBPO_KIND_PLANE(kinds, first);
    leaf->first_plane = first;
    for (uint64_t i = 0; i < groups * 4; i++) {
        const plane *q = &planes[i < (uint64_t)count ? i : 0];
        for (int k = 0; k < 3; k++)
            to[i / 4].n[k][i % 4] = (float)(flip * q->n[k]);
        to[i / 4].d[i % 4] = (float)(flip * q->d);
    }
    leaf->planes = (uint16_t)count;
    return count == 1   ? EBPO_LEAF_ONE_PLANE
           : count == 2 ? EBPO_LEAF_TWO_PLANES
           : flip > 0   ? EBPO_LEAF_CONVEX
                        : EBPO_LEAF_CONCAVE;
}

/* --- a leaf --- */

/* A lower wall if there is one: its winding number is the corner's. */
static uint8_t choose_wall(unsigned walls)
{
    unsigned open = ~walls & 63;
    if (open & 21)
        return (uint8_t)__builtin_ctz(open & 21);
    return open ? (uint8_t)__builtin_ctz(open) : EBPO_NO_WALL;
}

static ebpo_leaf_kind classify(const ebpo_accel *s, ebpo_accel_leaf *leaf, const double low[3],
                               const double high[3])
{
    leaf_faces f;
    plane planes[EBPO_KIND_PLANES_MAX];
    int flip = 1, count = 0;
    int32_t at_corner = leaf->winding;
    unsigned walls;
    bool few = gather(s, leaf, low, high, &f, &walls);
    leaf->wall = choose_wall(walls);
    if (leaf->wall != EBPO_NO_WALL && leaf->wall % 2) {
        double p[3] = { low[0], low[1], low[2] };
        p[leaf->wall / 2] = high[leaf->wall / 2];
        leaf->winding = winding_at(s, leaf, at_corner, low, p);
    }
    if (few && f.count)
        count = collect_planes(s, &f, planes, &flip);
    return count && find_windings(s, leaf, at_corner, &f, planes, count, flip)
               ? keep_planes(s->kinds, leaf, planes, count, flip)
               : EBPO_LEAF_GENERAL;
}

bool ebpo_leaf_know(const ebpo_accel *s, ebpo_accel_leaf *leaf, const double low[3],
                    const double high[3])
{
    uint8_t unknown = EBPO_LEAF_UNKNOWN;
    if (!atomic_compare_exchange_strong(&leaf->kind, &unknown, EBPO_LEAF_IN_HAND)) {
        while (ebpo_leaf_kind_of(leaf) == EBPO_LEAF_IN_HAND) /* a microsecond of another thread's */
            sched_yield();
        return false;
    }
    ebpo_leaf_kind kind = classify(s, leaf, low, high);
    atomic_fetch_add(&s->kinds->of_kind[kind], 1);
    if (kind == EBPO_LEAF_GENERAL && leaf->wall != EBPO_NO_WALL)
        atomic_fetch_add(&s->kinds->one_wall, 1);
    atomic_store_explicit(&leaf->kind, (uint8_t)kind, memory_order_release);
    return true;
}
