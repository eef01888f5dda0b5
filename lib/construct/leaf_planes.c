/* Computes the planes of a leaf's envelope from the leaf's faces (EBP 2017, 3.3.4). Readers derive
 * the same planes from the same faces, bit for bit, so most files do not store the planes of
 * leaves.
 *
 * A candidate is a plane that may be chosen. Its direction is a normal of the convex hull of the
 * leaf's points. The leaf's points are the corners of the faces' parts in the cell, and the cell's
 * corners that are inside the solid. If there are too many points, or if all are in one plane, the
 * directions are the normals of the faces. The offset of a plane with the normal n is its support,
 * which is the greatest n . x of all points, plus a bound of the rounding error. So no part of a
 * face in the cell is cut off. */
#include "core/strict_fp.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "construct/planes.h"
#include "core/hash.h"
#include "geometry/polytope.h"
#include "geometry/vec3.h"

/* LEAF_CANDIDATES: maximum number of candidates. LEAF_POINTS: maximum number of points. LEAF_TABLE:
 * size of the hash table of points. */
enum { LEAF_CANDIDATES = 64, LEAF_POINTS = 192, LEAF_TABLE = 512 };

/* The points whose hull contains the solid in the cell. */
typedef struct leaf_points {
    double at[LEAF_POINTS][3];
    double slack[LEAF_POINTS]; /* upper bounds of the rounding errors of a point's coordinates */
    int count;
    /* Hash table that finds equal points, because most corners of faces occur several times. A slot
     * has 1 + the index of a point, or 0 if the slot is empty. */
    uint8_t table[LEAF_TABLE];
} leaf_points;

/* Adds a candidate with this normal if no candidate has this normal yet. Returns false if no
 * further candidate can be added. */
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

static bool equal_points(const double a[3], const double b[3])
{
    return a[0] == b[0] && a[1] == b[1] && a[2] == b[2];
}

/* Adds a point. If there is an equal point already, raises the slack of that point to at least
 * `slack`. Returns false if there are too many points. */
static bool add_point(leaf_points *points, const double p[3], double slack)
{
    uint64_t bits[3], slot;
    memcpy(bits, p, sizeof bits);
    EBPO_HASH_FIND(slot, ebpo_hash_three(bits), LEAF_TABLE - 1,
                   !points->table[slot] || equal_points(points->at[points->table[slot] - 1], p));
    if (points->table[slot]) {
        int i = points->table[slot] - 1;
        points->slack[i] = fmax(points->slack[i], slack);
        return true;
    }
    if (points->count == LEAF_POINTS)
        return false;
    points->table[slot] = (uint8_t)(points->count + 1);
    for (int k = 0; k < 3; k++)
        points->at[points->count][k] = p[k];
    points->slack[points->count++] = slack;
    return true;
}

/* Collects the points. `inside`: bit i is set if corner i of the cell is in the solid. Returns
 * false if there are more than LEAF_POINTS points. */
static bool gather_points(const ebpo_box *box, ebpo_cell cell, const ebpo_triangle *faces,
                          uint64_t count, unsigned inside, leaf_points *points)
{
    points->count = 0;
    memset(points->table, 0, sizeof points->table);
    for (int i = 0; i < 8; i++)
        if (inside >> i & 1)
            (void)add_point(points, (const double[3]){ i & 1, i >> 1 & 1, i >> 2 & 1 }, 0);
    for (uint64_t i = 0; i < count; i++) {
        double p[9][3], slack;
        int corners = ebpo_clip_triangle(box, cell, &faces[i], p, &slack);
        for (int c = 0; c < corners; c++)
            if (!add_point(points, p[c], slack))
                return false;
    }
    return true;
}

/* Makes a candidate for each facet of the hull of the points, largest facets first if there are too
 * many. Supports are computed later. Returns the number of candidates. */
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

/* Makes candidates of the faces' normals (of every step-th face if there are many) and of the
 * opposite normals. If all faces are in one plane, the opposite normals bound the other side of the
 * envelope. Returns the number of candidates. */
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

/* Raises the support of each candidate, if needed, so that the half-space n . x <= support contains
 * the exact point. `n`: decoded normals of the candidates. `slack` bounds the error of each
 * coordinate of `p`. */
static void raise_supports(ebpo_candidate *c, double (*n)[3], int count, const double p[3],
                           double slack)
{
    double rounding = EBPO_NORMAL_NORM * slack;
    for (int j = 0; j < count; j++) {
        double s = ebpo_vec3_dot(n[j], p) + rounding;
        c[j].support = s > c[j].support ? s : c[j].support;
    }
}

static void decode_normals(const ebpo_candidate *c, int count, double (*n)[3])
{
    for (int j = 0; j < count; j++) {
        int32_t v[3], d;
        ebpo_plane_code_decode(c[j].normal, v, &d);
        for (int k = 0; k < 3; k++)
            n[j][k] = v[k];
    }
}

/* Computes the supports from the faces, if they have too many points for leaf_points. */
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

/* Makes the candidates of a leaf, with supports. Returns their number. */
static int leaf_candidates(const ebpo_box *box, ebpo_cell cell, const ebpo_triangle *faces,
                           uint64_t count, unsigned inside_corners,
                           ebpo_candidate out[LEAF_CANDIDATES])
{
    leaf_points points;
    double n[LEAF_CANDIDATES][3];
    bool has_all = gather_points(box, cell, faces, count, inside_corners, &points);
    int kept = has_all ? hull_normals(&points, out) : 0;
    if (kept == 0)
        kept = face_normals(box, faces, count, out);
    decode_normals(out, kept, n);
    if (!has_all)
        supports_of_faces(box, cell, faces, count, inside_corners, out, n, kept);
    for (int i = 0; has_all && i < points.count; i++)
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
                                                  .codes_max = EBPO_PLANES_MAX,
                                                  .epsilon = epsilon,
                                                  .needle_length = ebpo_needle },
                                  codes);
    return ebpo_select_all(envelope, candidates, kept, EBPO_PLANES_MAX, codes);
}
