/* Finds and stores the kind of a leaf during queries.
 *
 * The first query finds a free cell face (a cell face that no face intersects) and the boxes of the
 * leaf's list. After many queries the leaf is classified: one plane, two planes, convex or concave
 * (then the signs of planes decide), or general (accel.h). While one thread classifies the leaf,
 * the other threads treat it as general. Kinds never change results.
 *
 * Proof that the planes of some leaves decide: a point is below a plane if n . xi < d (leaf_plane).
 * Let P be the set of points of the cell below all planes of the leaf's faces. Suppose that every
 * face is in the closure of P (no corner of a face is above a plane). Under this assumption, each
 * face is on the boundary of P, so the winding number is constant within P's interior. The winding
 * number is also constant in each component of the cell outside P's closure. Every such component
 * contains a corner of the cell, because a point above plane i can move to the corner that is
 * farthest along that plane's normal. On the whole way, the point is above plane i. So if all
 * corners of the cell outside P's closure have the same winding number, and the winding number at
 * one point of P's interior is known, the planes decide. The same is true with "above" in place of
 * "below" (concave). */
#include "core/strict_fp.h"

#include <math.h>
#include <stdlib.h>

#include "core/alloc.h"
#include "geometry/cells.h"
#include "geometry/vec3.h"
#include "geometry/predicates.h"
#include "query/accel_parts.h"

/* --- planes that decide --- */

/* The plane n . xi - d = 0 in the cell's coordinates (0 .. 1 on each axis); the 1-norm of n is 1.
 */
typedef struct leaf_plane {
    double n[3], d;
} leaf_plane;

/* Planes of a convex leaf (`flip` 1) or of a concave leaf (`flip` -1: all planes are reversed).
 * `inner` is the winding number below all planes, `outer` the winding number elsewhere in the cell.
 */
typedef struct deciding_planes {
    int count, flip;
    int32_t inner, outer;
    leaf_plane plane[EBPO_KIND_PLANES_MAX];
} deciding_planes;

/* A leaf with more faces is general. */
enum { FACES_MAX = 64 };

/* The faces that a leaf lists and whose boxes intersect the leaf's cell. */
typedef struct leaf_faces {
    int count;
    double p[FACES_MAX][3][3]; /* corners in the coordinates of the cell (0 .. 1), rounded */
    uint32_t slot[FACES_MAX];  /* slot of the face: its position in the blocks of the accel */
    double low[3], size[3], inverse[3]; /* lowest corner and size of the cell; 1 / size */
} leaf_faces;

/* Returns true if the triangle's box intersects the cell from `low` to `high`. */
static bool box_intersects_cell(const double t[3][3], const double low[3], const double high[3])
{
    for (int k = 0; k < 3; k++)
        if (ebpo_min3(t[0][k], t[1][k], t[2][k]) > high[k] ||
            ebpo_max3(t[0][k], t[1][k], t[2][k]) < low[k])
            return false;
    return true;
}

static void add_face(uint32_t slot, const double t[3][3], leaf_faces *f)
{
    for (int i = 0; i < 9; i++)
        f->p[f->count][i / 3][i % 3] = (t[i / 3][i % 3] - f->low[i % 3]) * f->inverse[i % 3];
    f->slot[f->count++] = slot;
}

/* Gathers the faces whose boxes intersect the cell. Returns false if there are more than FACES_MAX,
 * or if the cell is so small that later products would underflow. */
static bool gather_faces(const ebpo_accel *s, const ebpo_accel_leaf *leaf, ebpo_cell cell,
                         leaf_faces *f)
{
    double low[3], high[3];
    ebpo_cell_bounds(&s->box, cell, low, high);
    f->count = 0;
    for (int k = 0; k < 3; k++) {
        f->low[k] = low[k];
        f->size[k] = high[k] - low[k];
        f->inverse[k] = 1 / f->size[k];
        if (!(f->size[k] > 0x1p-900))
            return false;
    }
    for (const ebpo_listed_block *at = s->list + leaf->list;; at++) {
        uint64_t listed = ebpo_listed(at);
        for (unsigned lanes = ebpo_listed_lanes(listed); lanes; lanes &= lanes - 1) {
            uint32_t slot =
                ebpo_listed_number(listed) * EBPO_BLOCK + (unsigned)__builtin_ctz(lanes);
            double t[3][3];
            ebpo_accel_triangle(s, slot, t);
            if (!box_intersects_cell((const double(*)[3])t, low, high))
                continue;
            if (f->count == FACES_MAX)
                return false;
            add_face(slot, (const double(*)[3])t, f);
        }
        if (listed & EBPO_LISTED_LAST)
            return true;
    }
}

/* Returns the sum of the signed crossings of the leaf's faces with a segment along an axis. Skips
 * blocks whose list entry has any bit of `excluded`. `excluded` has the bits of the lower sides of
 * boxes on the axes on which the segment is at the lower side of the cell. A box with such a bit
 * begins above the segment. */
static int32_t leaf_crossings(const ebpo_accel *s, const ebpo_accel_leaf *leaf,
                              const double from[3], double to, int axis, uint64_t excluded)
{
    int32_t sum = 0;
    for (const ebpo_listed_block *at = s->list + leaf->list;; at++) {
        uint64_t listed = ebpo_listed(at);
        for (unsigned lanes = listed & excluded ? 0 : ebpo_listed_lanes(listed); lanes;
             lanes &= lanes - 1) {
            double t[3][3];
            ebpo_accel_triangle(
                s, ebpo_listed_number(listed) * EBPO_BLOCK + (unsigned)__builtin_ctz(lanes), t);
            sum += ebpo_axis_crossing(from, to, axis, t[0], t[1], t[2]);
        }
        if (listed & EBPO_LISTED_LAST)
            return sum;
    }
}

/* Returns the winding number at a point of the cell, after the infinitesimal shift of format-spec,
 * section 10. Adds the crossings on the way from the lowest corner, along one axis after another.
 */
static int32_t winding_at(const ebpo_accel *s, const ebpo_accel_leaf *leaf, const double low[3],
                          const double p[3])
{
    double from[3] = { low[0], low[1], low[2] };
    int32_t winding = leaf->winding;
    for (int axis = 0; axis < 3; axis++) {
        if (p[axis] > from[axis])
            winding += leaf_crossings(s, leaf, from, p[axis], axis, 0);
        from[axis] = p[axis];
    }
    return winding;
}

/* Computes the plane of a face in the cell's coordinates, with a normal of 1-norm 1. Returns false
 * if rounding may matter, because the face is very thin or has corners far outside the cell. */
static bool face_plane(const ebpo_accel *s, const leaf_faces *f, int face, leaf_plane *out)
{
    const double(*p)[3] = (const double(*)[3])f->p[face];
    double t[3][3], e[3], g[3], norm = 0, products = 0, greatest = 0;
    ebpo_accel_triangle(s, f->slot[face], t);
    /* The edges e and g are computed from the exact corners t, because the rounded corners p are
     * not exact enough for short edges. */
    for (int k = 0; k < 3; k++) {
        e[k] = (t[1][k] - t[0][k]) * f->inverse[k];
        g[k] = (t[2][k] - t[0][k]) * f->inverse[k];
    }
    for (int k = 0; k < 3; k++) {
        int u = k == 2 ? 0 : k + 1, v = k == 0 ? 2 : k - 1;
        double a = e[u] * g[v], b = e[v] * g[u];
        out->n[k] = a - b;
        norm += fabs(a - b);
        products += fabs(a) + fabs(b);
        greatest = ebpo_max3(greatest, ebpo_max3(fabs(p[0][k]), fabs(p[1][k]), fabs(p[2][k])), 0);
    }
    /* The error of n is at most 2^-50 of the products, so at most 2^-40 of the norm of n. The error
     * of n . xi is at most 2^-33 for every corner, which is less than the margin of sides_of
     * (2^-26). */
    if (!(norm > products * 0x1p-10) || !(products > 0x1p-900) || !(greatest < 64))
        return false;
    out->d = 0;
    for (int k = 0; k < 3; k++) {
        out->n[k] /= norm;
        out->d += out->n[k] * p[0][k];
    }
    return true;
}

/* Returns the exact side of a corner of the face at point_slot, relative to the plane of the face
 * at plane_slot: -1 below, 0 in the plane, 1 above. */
static int exact_side(const ebpo_accel *s, uint32_t plane_slot, uint32_t point_slot, int corner)
{
    double a[3][3], b[3][3];
    ebpo_accel_triangle(s, plane_slot, a);
    ebpo_accel_triangle(s, point_slot, b);
    for (int i = 0; i < 3; i++) /* neighbouring faces share corners, which are in the plane */
        if (a[i][0] == b[corner][0] && a[i][1] == b[corner][1] && a[i][2] == b[corner][2])
            return 0;
    return ebpo_orient3d(a[0], a[1], a[2], b[corner]);
}

/* Returns the sides of face i's plane q on which other faces have corners: bit 0: above, bit 1:
 * below. Stops when it has found all sides of `wanted`. */
static unsigned sides_of(const ebpo_accel *s, const leaf_faces *f, int i, const leaf_plane *q,
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

/* Returns true if face j is in the plane of face i. */
static bool is_in_plane(const ebpo_accel *s, const leaf_faces *f, int i, int j)
{
    for (int c = 0; c < 3; c++)
        if (exact_side(s, f->slot[i], f->slot[j], c) != 0)
            return false;
    return true;
}

/* Returns false if the planes are certainly different, or their normals are opposite. */
static bool may_be_equal(const leaf_plane *a, const leaf_plane *b)
{
    return fabs(a->d - b->d) < 0x1p-20 &&
           a->n[0] * b->n[0] + a->n[1] * b->n[1] + a->n[2] * b->n[2] > 0;
}

/* Collects all different planes of a convex or concave leaf. Returns false if the leaf is neither
 * convex nor concave, or has more than EBPO_KIND_PLANES_MAX planes. */
static bool collect_planes(const ebpo_accel *s, const leaf_faces *f, deciding_planes *out)
{
    int of_face[EBPO_KIND_PLANES_MAX]; /* for each plane, a face in it */
    unsigned allowed = 3;              /* bit 0: convex is still possible, bit 1: concave */
    out->count = 0;
    for (int i = 0; i < f->count; i++) {
        leaf_plane q;
        if (!face_plane(s, f, i, &q))
            return false;
        unsigned sides = sides_of(s, f, i, &q, 3);
        allowed &= (sides & 1 ? 2u : 3u) & (sides & 2 ? 1u : 3u);
        if (!allowed)
            return false;
        bool known = false;
        for (int k = 0; k < out->count && !known; k++)
            known = may_be_equal(&out->plane[k], &q) && is_in_plane(s, f, of_face[k], i);
        if (known)
            continue;
        if (out->count == EBPO_KIND_PLANES_MAX)
            return false;
        of_face[out->count] = i;
        out->plane[out->count++] = q;
    }
    out->flip = allowed & 1 ? 1 : -1;
    return true;
}

/* Returns true if xi is below all planes (after the reversal by planes->flip). Sets *certain to
 * false if rounding may change the result. */
static bool below_all(const deciding_planes *planes, const double xi[3], bool *certain)
{
    *certain = true;
    for (int i = 0; i < planes->count; i++) {
        const leaf_plane *q = &planes->plane[i];
        double value = planes->flip * (q->n[0] * xi[0] + q->n[1] * xi[1] + q->n[2] * xi[2] - q->d);
        if (value > 0x1p-18)
            return *certain = true, false;
        *certain = *certain && value < -0x1p-18;
    }
    return true;
}

static double within_cell(double x) { return x < 0 ? 0 : x > 1 ? 1 : x; }

/* Finds the winding numbers below all planes (in the set P of the proof above) and elsewhere in the
 * cell. Uses the winding numbers at the cell's corners and, if no corner is in P, at the mean of
 * the faces' corners. Returns false if these points are not sufficient. */
static bool find_windings(const ebpo_accel *s, const ebpo_accel_leaf *leaf, const leaf_faces *f,
                          deciding_planes *out)
{
    bool have_inner = false, have_outer = false, certain;
    for (unsigned corner = 0; corner < 8; corner++) {
        double xi[3] = { corner & 1, corner >> 1 & 1, corner >> 2 }, p[3];
        bool below = below_all(out, xi, &certain);
        if (!certain)
            return false;
        for (int k = 0; k < 3; k++)
            p[k] = f->low[k] + xi[k] * f->size[k];
        int32_t w = winding_at(s, leaf, f->low, p);
        int32_t *known = below ? &out->inner : &out->outer;
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
            /* repeat the conversion: if the cell's size is a few ulps, p is a different point */
            xi[k] = (p[k] - f->low[k]) / f->size[k];
        }
        if (!below_all(out, xi, &certain) || !certain)
            return false;
        out->inner = winding_at(s, leaf, f->low, p);
    }
    return have_outer;
}

/* Finds the planes and winding numbers of a leaf. Returns false if the planes do not decide. */
static bool leaf_find_planes(const ebpo_accel *s, const ebpo_accel_leaf *leaf, ebpo_cell cell,
                             deciding_planes *out)
{
    leaf_faces f;
    return gather_faces(s, leaf, cell, &f) && f.count && collect_planes(s, &f, out) &&
           find_windings(s, leaf, &f, out);
}

/* --- rows of all leaves: pages, each twice as large as the page before, so that stored rows do not
 * move --- */

/* FIRST_PAGE: rows of the first page; a leaf has at most 1 + 4 * 4 rows. PAGE_BYTES: the size of a
 * page is a multiple of this number, which is also its alignment. */
enum { FIRST_PAGE = 32, PAGE_BYTES = 64 };

ebpo_leaf_kinds *ebpo_leaf_kinds_make(uint64_t rows_max)
{
    ebpo_leaf_kinds *k = ebpo_alloc_zero(1, sizeof *k);
    if (k)
        k->rows_max = rows_max;
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

/* Adds a page with space for at least `least` rows. Returns false when out of memory, or if there
 * would be too many pages or rows. */
static bool add_page(ebpo_leaf_kinds *k, uint64_t least)
{
    uint64_t size = (uint64_t)FIRST_PAGE << k->pages, unused = k->rows_max - k->rows;
    size = size < unused ? size : unused;
    if (size < least || k->pages == EBPO_KIND_PAGES ||
        size > (PTRDIFF_MAX - PAGE_BYTES) / sizeof **k->page)
        return false;
    size_t bytes = ((size_t)size * sizeof **k->page + PAGE_BYTES - 1) / PAGE_BYTES * PAGE_BYTES;
    k->page[k->pages] = aligned_alloc(PAGE_BYTES, bytes);
    if (!k->page[k->pages])
        return false;
    k->pages++;
    k->rows += size;
    k->used = 0;
    k->space = size;
    return true;
}

/* Reserves `rows` rows in one page. Returns the number of the first one, or EBPO_NO_ROWS if there
 * is no space. */
static uint32_t reserve_rows(ebpo_leaf_kinds *k, uint64_t rows)
{
    uint32_t number = EBPO_NO_ROWS;
    pthread_mutex_lock(&k->lock);
    if (k->used + rows <= k->space || add_page(k, rows)) {
        number = (k->pages - 1) << EBPO_KIND_PAGE_BITS | (uint32_t)k->used;
        k->used += rows;
    }
    pthread_mutex_unlock(&k->lock);
    return number;
}

/* Stores the planes of a leaf and returns its kind. If there is no space for the planes, the leaf
 * is general. */
static ebpo_leaf_kind keep_planes(ebpo_leaf_kinds *kinds, ebpo_accel_leaf *leaf,
                                  const deciding_planes *planes)
{
    int count = planes->count, flip = planes->flip, fours = (count + 3) / 4;
    uint32_t first = reserve_rows(kinds, 1 + 4 * (uint64_t)fours);
    if (first == EBPO_NO_ROWS)
        return EBPO_LEAF_GENERAL;
    ebpo_kind_row *row = EBPO_KIND_ROW(kinds, first);
    *row++ = (ebpo_kind_row){ .head = { planes->inner, planes->outer, (uint32_t)fours } };
    for (int i = 0; i < 4 * fours; i++) {
        const leaf_plane *q = &planes->plane[i < count ? i : 0];
        for (int k = 0; k < 4; k++)
            row[i / 4 * 4 + k].of_four[i % 4] = (float)(flip * (k < 3 ? q->n[k] : q->d));
    }
    leaf->rows = first;
    return count == 1   ? EBPO_LEAF_ONE_PLANE
           : count == 2 ? EBPO_LEAF_TWO_PLANES
           : flip > 0   ? EBPO_LEAF_CONVEX
                        : EBPO_LEAF_CONCAVE;
}

/* --- a leaf --- */

/* Returns a free cell face (2 * axis + side), or EBPO_NO_CELL_FACE. `cell_faces` has a bit for each
 * cell face that is not free. Prefers a lower cell face (bits 0, 2, 4), because the leaf's lowest
 * corner is on it, so the winding number on this cell face is known. */
static uint8_t choose_cell_face(unsigned cell_faces)
{
    unsigned is_free = ~cell_faces & 63;
    if (is_free & 21)
        return (uint8_t)__builtin_ctz(is_free & 21);
    return is_free ? (uint8_t)__builtin_ctz(is_free) : EBPO_NO_CELL_FACE;
}

static ebpo_leaf_kind classify_leaf(const ebpo_accel *s, ebpo_accel_leaf *leaf, ebpo_cell cell)
{
    deciding_planes planes;
    return leaf_find_planes(s, leaf, cell, &planes) ? keep_planes(s->kinds, leaf, &planes)
                                                    : EBPO_LEAF_GENERAL;
}

/* Finds the free cell face, the winding number on it, and the boxes of the leaf's list. */
static void bound_leaf(const ebpo_accel *s, ebpo_accel_leaf *leaf, ebpo_cell cell,
                       ebpo_cell_faces_fn *cell_faces)
{
    uint8_t cell_face = choose_cell_face(cell_faces(s, s->list + leaf->list, cell));
    int32_t step = 0;
    if (cell_face != EBPO_NO_CELL_FACE && cell_face % 2) {
        double low[3], high[3];
        uint64_t at_corner = UINT64_C(0x0f0f0f) & ~(UINT64_C(255) << 8 * (cell_face / 2));
        ebpo_cell_bounds(&s->box, cell, low, high);
        step = leaf_crossings(s, leaf, low, high[cell_face / 2], cell_face / 2,
                              at_corner << EBPO_LISTED_BOX);
    }
    bool small = step >= INT8_MIN && step <= INT8_MAX;
    leaf->cell_face = small ? cell_face : EBPO_NO_CELL_FACE;
    leaf->cell_face_step = (int8_t)(small ? step : 0);
}

/* Changes the leaf's kind from `from` to `to`. Returns false if the kind is not `from`, because
 * another thread has changed it. */
static bool begin_kind(ebpo_accel_leaf *leaf, ebpo_leaf_kind from, ebpo_leaf_kind to)
{
    uint8_t expected = (uint8_t)from;
    return atomic_compare_exchange_strong(&leaf->kind, &expected, (uint8_t)to);
}

/* Sets the kind. Everything that this thread wrote before becomes visible to threads that read the
 * kind. */
static void end_kind(ebpo_accel_leaf *leaf, ebpo_leaf_kind kind)
{
    atomic_store_explicit(&leaf->kind, (uint8_t)kind, memory_order_release);
}

/* Finds the free cell face and the boxes, if no thread has found them or is finding them. */
static void find_cell_face(const ebpo_accel *s, ebpo_accel_leaf *leaf, ebpo_cell cell,
                           ebpo_cell_faces_fn *cell_faces)
{
    /* The first test is one read, and its result is false in most queries. */
    if (ebpo_leaf_kind_of(leaf) == EBPO_LEAF_UNKNOWN &&
        begin_kind(leaf, EBPO_LEAF_UNKNOWN, EBPO_LEAF_CLAIMED)) {
        bound_leaf(s, leaf, cell, cell_faces);
        end_kind(leaf, EBPO_LEAF_BOUNDED);
    }
}

/* Finds the kind. Returns false if another thread has found it or is finding it. */
static bool find_kind(const ebpo_accel *s, ebpo_accel_leaf *leaf, ebpo_cell cell)
{
    if (!begin_kind(leaf, EBPO_LEAF_BOUNDED, EBPO_LEAF_SORTED))
        return false;
    ebpo_leaf_kind kind = classify_leaf(s, leaf, cell);
    atomic_fetch_add(&s->kinds->of_kind[kind], 1);
    if (kind == EBPO_LEAF_GENERAL && leaf->cell_face != EBPO_NO_CELL_FACE)
        atomic_fetch_add(&s->kinds->one_cell_face, 1);
    end_kind(leaf, kind);
    return true;
}

bool ebpo_leaf_query(const ebpo_accel *s, ebpo_accel_leaf *leaf, ebpo_cell cell,
                     ebpo_cell_faces_fn *cell_faces)
{
    /* Threads may overwrite each other's counts. Then the kind is found slightly later. */
    int queries = atomic_load_explicit(&leaf->queries, memory_order_relaxed) + 1;
    bool found = false;
    if (queries >= EBPO_LEAF_CELL_FACE_QUERIES)
        find_cell_face(s, leaf, cell, cell_faces);
    if (queries >= EBPO_LEAF_KIND_QUERIES)
        found = find_kind(s, leaf, cell);
    else
        atomic_store_explicit(&leaf->queries, (uint8_t)queries, memory_order_relaxed);
    return found;
}
