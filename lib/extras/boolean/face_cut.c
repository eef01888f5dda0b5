/* Cuts one face along its intersections with other faces.
 *
 * If two faces are in different planes, they intersect in a segment or a point on the common line
 * of the planes. Each face has an interval on this line; the exact ends of both intervals are
 * compared. If two faces are in one plane, the edges of the other face are clipped to the face. All
 * segments and the edges of the face are divided at the points where they intersect. The face is
 * triangulated so that the parts between these points are edges of triangles.
 *
 * Both faces of a pair get the same points. So the triangles on both sides of a cut, and on both
 * sides of a common edge of two faces, have equal vertices. If several faces in one plane contain a
 * triangle, only the first of these faces keeps the triangle, and notes the other faces. */
#include "core/strict_fp.h"

#include "extras/boolean/face_cut.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "core/alloc.h"
#include "geometry/predicates.h"
#include "geometry/vec3.h"

void ebpo_face_cutter_init(ebpo_face_cutter *cutter, const ebpo_face_list *faces, int unit)
{
    *cutter = (ebpo_face_cutter){ .faces = faces, .unit = unit };
    ebpo_arrangement_2d_init(&cutter->arrangement);
    for (int i = 0; i < 2; i++) {
        ebpo_exact_plane_init(&cutter->plane[i]);
        for (int k = 0; k < 3; k++)
            ebpo_exact_point_init(&cutter->corner[i][k]);
        for (int k = 0; k < 2; k++)
            ebpo_exact_point_init(&cutter->end[i][k]);
    }
    ebpo_exact_point_init(&cutter->copy);
}

void ebpo_face_cutter_free(ebpo_face_cutter *cutter)
{
    ebpo_arrangement_2d_free(&cutter->arrangement);
    ebpo_triangulation_free(&cutter->triangulation);
    for (int i = 0; i < 2; i++) {
        ebpo_exact_plane_clear(&cutter->plane[i]);
        for (int k = 0; k < 3; k++)
            ebpo_exact_point_clear(&cutter->corner[i][k]);
        for (int k = 0; k < 2; k++)
            ebpo_exact_point_clear(&cutter->end[i][k]);
    }
    ebpo_exact_point_clear(&cutter->copy);
    free(cutter->coplanar);
    free(cutter->kept);
    free(cutter->cover);
    free(cutter->box);
}

void ebpo_face_pieces_free(ebpo_face_pieces *pieces)
{
    for (uint32_t i = 0; i < pieces->points; i++)
        ebpo_exact_point_clear(&pieces->point[i]);
    free(pieces->point);
    free(pieces->triangle);
    free(pieces->cover);
    *pieces = (ebpo_face_pieces){ 0 };
}

static inline int next_index(int i) { return i == 2 ? 0 : i + 1; }

static void copy_point(ebpo_exact_point *out, const ebpo_exact_point *p)
{
    for (int k = 0; k < 4; k++)
        mpz_set(out->x[k], p->x[k]);
    memcpy(out->at, p->at, sizeof out->at);
    out->exact = p->exact;
}

/* Adds a copy of a point to the arrangement. */
static bool add_point(ebpo_face_cutter *c, const ebpo_exact_point *p, uint32_t *number)
{
    copy_point(&c->copy, p);
    return ebpo_point_set_add(&c->arrangement.set, &c->copy, number);
}

/* Sets the corners of the face that is cut (which: 0) or of the other face (which: 1). */
static void set_corners(ebpo_face_cutter *c, int which, uint32_t face)
{
    for (int i = 0; i < 3; i++)
        ebpo_exact_point_set(&c->corner[which][i], ebpo_face_list_corner(c->faces, face, i),
                             c->unit);
}

/* --- faces in different planes --- */

/* Computes the ends, in order, of the part of a face that is in the other face's plane. which: 0
 * for the face that is cut, 1 for the other face. side: the sides of the other face's plane on
 * which the corners are, not all 0. Returns false if no point of the face is in that plane. */
static bool find_ends(ebpo_face_cutter *c, int which, const int side[3])
{
    ebpo_exact_point *end = c->end[which], *corner = c->corner[which];
    int n = 0;
    for (int i = 0; i < 3; i++)
        if (side[i] == 0)
            copy_point(&end[n++], &corner[i]);
    for (int i = 0; i < 3 && n < 2; i++)
        if (side[i] * side[next_index(i)] < 0)
            ebpo_exact_intersect(&end[n++], &c->plane[!which], &corner[i], &corner[next_index(i)],
                                 c->unit);
    if (n == 1)
        copy_point(&end[1], &end[0]);
    else if (n == 2 && ebpo_exact_order(&end[0], &end[1]) > 0)
        ebpo_exact_point_swap(&end[0], &end[1]);
    return n > 0;
}

/* Adds the segment in which two faces in different planes intersect, if they do. side: on
 * which side of the other face's plane each corner of the face is. other_side: the same for the
 * corners of the other face and the plane of the face. */
static bool cut_through(ebpo_face_cutter *c, const int side[3], const int other_side[3])
{
    uint32_t from, to;
    ebpo_exact_plane_through(&c->plane[1], c->corner[1]);
    if (!find_ends(c, 0, side) || !find_ends(c, 1, other_side))
        return true;
    /* the intersection of both intervals: it begins at the later of both first ends, and ends at
     * the earlier of both last ends */
    const ebpo_exact_point *first = &c->end[ebpo_exact_order(&c->end[0][0], &c->end[1][0]) < 0][0];
    const ebpo_exact_point *last = &c->end[ebpo_exact_order(&c->end[0][1], &c->end[1][1]) > 0][1];
    if (ebpo_exact_order(first, last) > 0)
        return true;
    return add_point(c, first, &from) && add_point(c, last, &to) &&
           ebpo_arrangement_2d_add(&c->arrangement, from, to);
}

/* --- faces in one plane --- */

/* Adds a point of an edge. range: the first and the last added point in the order along the edge.
 * *count: number of added points. */
static bool note_edge_point(ebpo_face_cutter *c, const ebpo_exact_point *p, uint32_t range[2],
                            int *count)
{
    uint32_t number;
    if (!add_point(c, p, &number))
        return false;
    const ebpo_exact_point *point = c->arrangement.set.point;
    if (*count == 0 || ebpo_exact_order(&point[number], &point[range[0]]) < 0)
        range[0] = number;
    if (*count == 0 || ebpo_exact_order(&point[number], &point[range[1]]) > 0)
        range[1] = number;
    ++*count;
    return true;
}

/* Adds the part of an edge that is in the face. p, q: ends of the edge, which is an edge of another
 * face in the same plane. */
static bool clip_edge(ebpo_face_cutter *c, const ebpo_exact_point *p, const ebpo_exact_point *q)
{
    int of_p[3], of_q[3], count = 0; /* of_p[i]: side of edge i of the face on which p is: 1 inner,
                                        -1 outer, 0: on the edge's line */
    bool added = true, p_in = true, q_in = true;
    uint32_t range[2] = { 0, 0 };
    for (int i = 0; i < 3; i++) {
        const ebpo_exact_point *a = &c->corner[0][i], *b = &c->corner[0][next_index(i)];
        of_p[i] = ebpo_exact_turn(c->axis, a, b, p) * c->orientation;
        of_q[i] = ebpo_exact_turn(c->axis, a, b, q) * c->orientation;
        p_in = p_in && of_p[i] >= 0;
        q_in = q_in && of_q[i] >= 0;
        if (of_p[i] < 0 && of_q[i] < 0)
            return true;
    }
    if (p_in)
        added = note_edge_point(c, p, range, &count);
    if (q_in)
        added = added && note_edge_point(c, q, range, &count);
    for (int i = 0; i < 3 && added; i++) {
        const ebpo_exact_point *a = &c->corner[0][i], *b = &c->corner[0][next_index(i)];
        int of_a = ebpo_exact_turn(c->axis, p, q, a), of_b = ebpo_exact_turn(c->axis, p, q, b);
        bool before = ebpo_exact_order(p, a) < 0, after = ebpo_exact_order(a, q) < 0;
        if (of_a == 0 && before == after)
            added = note_edge_point(c, a, range, &count);
        if (of_a * of_b < 0 && of_p[i] * of_q[i] < 0) {
            ebpo_exact_plane_along(&c->arrangement.line, c->axis, a, b);
            ebpo_exact_intersect(&c->end[0][0], &c->arrangement.line, p, q, c->unit);
            added = added && note_edge_point(c, &c->end[0][0], range, &count);
        }
    }
    return added && (count == 0 || ebpo_arrangement_2d_add(&c->arrangement, range[0], range[1]));
}

/* Adds those parts of the other face's edges that are in the face. Both faces are in one plane. */
static bool cut_in_plane(ebpo_face_cutter *c, uint32_t other)
{
    if (!ebpo_grow(&c->coplanar, &c->coplanar_capacity, c->coplanar_count + 1, sizeof *c->coplanar))
        return false;
    c->coplanar[c->coplanar_count++] = other;
    for (int i = 0; i < 3; i++)
        if (!clip_edge(c, &c->corner[1][i], &c->corner[1][next_index(i)]))
            return false;
    return true;
}

/* --- all partners --- */

static bool cut_by_face(ebpo_face_cutter *c, uint32_t other)
{
    int side[3], other_side[3];
    const double *p[3], *q[3];
    for (int i = 0; i < 3; i++) {
        p[i] = ebpo_face_list_corner(c->faces, c->face, i);
        q[i] = ebpo_face_list_corner(c->faces, other, i);
    }
    for (int i = 0; i < 3; i++) {
        side[i] = ebpo_orient3d(q[0], q[1], q[2], p[i]);
        other_side[i] = ebpo_orient3d(p[0], p[1], p[2], q[i]);
    }
    set_corners(c, 1, other);
    if (side[0] == 0 && side[1] == 0 && side[2] == 0)
        return cut_in_plane(c, other);
    return cut_through(c, side, other_side);
}

/* Chooses the axis along which the face appears largest. */
static void choose_axis(ebpo_face_cutter *c)
{
    const double *p[3];
    double edge[2][3], normal[3], most = -1;
    for (int i = 0; i < 3; i++)
        p[i] = ebpo_face_list_corner(c->faces, c->face, i);
    ebpo_vec3_subtract(p[1], p[0], edge[0]);
    ebpo_vec3_subtract(p[2], p[0], edge[1]);
    ebpo_vec3_cross(edge[0], edge[1], normal);
    for (int k = 0; k < 3; k++) {
        int sign = ebpo_normal_sign(k, p[0], p[1], p[2]);
        if (sign == 0 || fabs(normal[k]) <= most)
            continue;
        most = fabs(normal[k]);
        c->axis = k;
        c->orientation = sign;
    }
}

static bool begin_face(ebpo_face_cutter *c, uint32_t face)
{
    uint32_t number[3];
    c->face = face;
    c->coplanar_count = c->covers = 0;
    choose_axis(c);
    ebpo_arrangement_2d_begin(&c->arrangement, c->axis, c->unit);
    set_corners(c, 0, face);
    ebpo_exact_plane_through(&c->plane[0], c->corner[0]);
    for (int i = 0; i < 3; i++)
        if (!add_point(c, &c->corner[0][i], &number[i]))
            return false;
    for (int i = 0; i < 3; i++)
        if (!ebpo_arrangement_2d_add(&c->arrangement, number[i], number[next_index(i)]))
            return false;
    return true;
}

static bool triangulate_face(ebpo_face_cutter *c)
{
    ebpo_arrangement_2d *a = &c->arrangement;
    if (!ebpo_arrangement_2d_divide(a) ||
        !ebpo_triangulate_points(&c->triangulation, c->axis, a->set.point, (uint32_t)a->set.count))
        return false;
    for (uint64_t i = 0; i < a->edges; i++)
        if (!ebpo_triangulation_insert(&c->triangulation, a->edge[i].from, a->edge[i].to))
            return false;
    return ebpo_grow(&c->kept, &c->kept_capacity, c->triangulation.count, sizeof *c->kept);
}

/* --- covers --- */

/* A box of a triangle's rounded coordinates on the two axes of the projection. */
typedef struct ebpo_triangle_box {
    double low[2], high[2];
    uint32_t triangle;
} ebpo_triangle_box;

static void bound_points(int axis, const ebpo_exact_point *const p[3], ebpo_triangle_box *out)
{
    const int seen[2] = { axis == 2 ? 0 : axis + 1, axis == 0 ? 2 : axis - 1 };
    for (int k = 0; k < 2; k++) {
        out->low[k] = ebpo_min3(p[0]->at[seen[k]], p[1]->at[seen[k]], p[2]->at[seen[k]]);
        out->high[k] = ebpo_max3(p[0]->at[seen[k]], p[1]->at[seen[k]], p[2]->at[seen[k]]);
    }
}

static int order_boxes(const void *a, const void *b)
{
    const ebpo_triangle_box *x = a, *y = b;
    if (x->low[0] != y->low[0])
        return x->low[0] < y->low[0] ? -1 : 1;
    return (x->triangle > y->triangle) - (x->triangle < y->triangle);
}

static bool bound_triangles(ebpo_face_cutter *c)
{
    const ebpo_exact_point *point = c->arrangement.set.point;
    uint64_t count = c->triangulation.count;
    if (!ebpo_grow(&c->box, &c->box_capacity, count, sizeof *c->box))
        return false;
    for (uint64_t i = 0; i < count; i++) {
        const uint32_t *corner = c->triangulation.triangle[i].corner;
        const ebpo_exact_point *p[3] = { &point[corner[0]], &point[corner[1]], &point[corner[2]] };
        bound_points(c->axis, p, &c->box[i]);
        c->box[i].triangle = (uint32_t)i;
    }
    qsort(c->box, count, sizeof *c->box, order_boxes);
    return true;
}

/* Returns true if the other face contains the triangle. The triangle does not cross edges of the
 * other face, so it is in that face if its corners are. orientation: 1 if the other face is seen
 * counter-clockwise, -1 if clockwise. */
static bool is_covered(const ebpo_face_cutter *c, uint32_t triangle, int orientation)
{
    const uint32_t *corner = c->triangulation.triangle[triangle].corner;
    const ebpo_exact_point *q = c->corner[1];
    for (int i = 0; i < 9; i++)
        if (ebpo_exact_turn(c->axis, &q[i / 3], &q[next_index(i / 3)],
                            &c->arrangement.set.point[corner[i % 3]]) *
                orientation <
            0)
            return false;
    return true;
}

/* Returns the index of the first box whose lower end on the first axis is at least `low`. */
static uint64_t find_box(const ebpo_face_cutter *c, double low)
{
    uint64_t begin = 0, end = c->triangulation.count;
    while (begin < end) {
        uint64_t middle = begin + (end - begin) / 2;
        if (c->box[middle].low[0] < low)
            begin = middle + 1;
        else
            end = middle;
    }
    return begin;
}

/* Notes the triangles that another face of the plane covers. */
static bool note_covers(ebpo_face_cutter *c, uint32_t other)
{
    set_corners(c, 1, other);
    const ebpo_exact_point *q = c->corner[1], *const corners[3] = { &q[0], &q[1], &q[2] };
    int orientation = ebpo_exact_turn(c->axis, &q[0], &q[1], &q[2]);
    ebpo_triangle_box face;
    bound_points(c->axis, corners, &face);
    for (uint64_t i = find_box(c, face.low[0]);
         i < c->triangulation.count && c->box[i].low[0] <= face.high[0]; i++) {
        const ebpo_triangle_box *box = &c->box[i];
        if (box->high[0] > face.high[0] || box->low[1] < face.low[1] ||
            box->high[1] > face.high[1] || !is_covered(c, box->triangle, orientation))
            continue;
        if (other < c->face)
            c->kept[box->triangle] = 0;
        if (!ebpo_grow(&c->cover, &c->cover_capacity, c->covers + 1, sizeof *c->cover))
            return false;
        c->cover[c->covers++] = (ebpo_cover){ box->triangle, other, orientation != c->orientation };
    }
    return true;
}

static int order_covers(const void *a, const void *b)
{
    const ebpo_cover *x = a, *y = b;
    if (x->triangle != y->triangle)
        return x->triangle < y->triangle ? -1 : 1;
    return (x->face > y->face) - (x->face < y->face);
}

/* Finds the covers of all triangles, and numbers the triangles that are kept. */
static bool find_covers(ebpo_face_cutter *c)
{
    uint32_t count = 0, covers = 0;
    for (uint64_t i = 0; i < c->triangulation.count; i++)
        c->kept[i] = 1;
    if (c->coplanar_count && !bound_triangles(c))
        return false;
    for (uint64_t i = 0; i < c->coplanar_count; i++)
        if (!note_covers(c, c->coplanar[i]))
            return false;
    for (uint64_t i = 0; i < c->triangulation.count; i++)
        if (c->kept[i])
            c->kept[i] = ++count;
    for (uint64_t i = 0; i < c->covers; i++)
        if (c->kept[c->cover[i].triangle]) {
            c->cover[covers] = c->cover[i];
            c->cover[covers++].triangle = c->kept[c->cover[i].triangle] - 1;
        }
    c->covers = covers;
    if (covers)
        qsort(c->cover, covers, sizeof *c->cover, order_covers);
    return true;
}

static bool copy_pieces(ebpo_face_cutter *c, ebpo_face_pieces *out)
{
    ebpo_point_set *set = &c->arrangement.set;
    out->point = ebpo_alloc(set->count, sizeof *out->point);
    out->triangle = ebpo_alloc(c->triangulation.count, sizeof *out->triangle);
    out->cover = ebpo_alloc(c->covers, sizeof *out->cover);
    if (!out->point || !out->triangle || !out->cover)
        return false;
    for (uint64_t i = 0; i < set->count; i++) { /* the pieces take over the points */
        ebpo_exact_point_init(&out->point[i]);
        ebpo_exact_point_swap(&out->point[i], &set->point[i]);
    }
    out->points = (uint32_t)set->count;
    for (uint64_t i = 0; i < c->triangulation.count; i++) {
        const uint32_t *from = c->triangulation.triangle[i].corner;
        uint32_t *to = out->triangle[out->triangles];
        if (!c->kept[i])
            continue;
        memcpy(to, from, 3 * sizeof *to);
        if (c->orientation < 0) {
            to[1] = from[2];
            to[2] = from[1];
        }
        out->triangles++;
    }
    if (c->covers)
        memcpy(out->cover, c->cover, c->covers * sizeof *out->cover);
    out->covers = (uint32_t)c->covers;
    return true;
}

bool ebpo_face_cut(ebpo_face_cutter *cutter, uint32_t face, ebpo_face_pieces *out)
{
    const ebpo_face_list *faces = cutter->faces;
    *out = (ebpo_face_pieces){ 0 };
    bool added = begin_face(cutter, face);
    for (uint64_t i = faces->begin[face]; i < faces->begin[face + 1] && added; i++)
        added = cut_by_face(cutter, faces->partner[i]);
    added = added && triangulate_face(cutter) && find_covers(cutter) && copy_pieces(cutter, out);
    if (!added)
        ebpo_face_pieces_free(out);
    return added;
}
