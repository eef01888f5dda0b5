/* How far the part of a face in its cell reaches in direction n is a linear program; by weak
 * duality, for any vector m n . x <= max over the face's corners of (n - m) . v  +  max over the
 * unit cube of m . x, and some m makes it an equality: 0, or one that levels n on an edge of the
 * face by one wall, or on the face by two walls. So rounded m still give certain bounds, and
 * nothing has to be clipped. What stays undecided is clipped in rationals. */
#include "core/strict_fp.h"

#include "verify/containment.h"

#include <math.h>

static const double eps = 0x1p-53;

void ebpo_half_spaces_of(ebpo_half_spaces *out, const ebpo_twin_tree *view,
                         const ebpo_twin_node *node)
{
    uint32_t count;
    const uint32_t *codes = ebpo_twin_planes(view, node, &count);
    out->count = 0;
    for (uint32_t i = 0; i < count; i++) {
        int at = out->count;
        if (!ebpo_plane_decode(codes[i], out->normal[at], &out->d[at]))
            continue;
        for (int k = 0; k < 3; k++)
            out->n[at][k] = out->normal[at][k];
        out->bound[at] = out->d[at] / 4096.0;
        out->number[at] = i;
        out->count++;
    }
}

static double dot(const double a[3], const double b[3])
{
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

static double highest(const ebpo_local *face, const double n[3])
{
    double a = dot(n, face->at[0]), b = dot(n, face->at[1]), c = dot(n, face->at[2]);
    return fmax(a, fmax(b, c));
}

/* The bound above for one m, rounding included. */
static bool certified(const ebpo_local *face, const double n[3], const double m[3], double bound)
{
    double rest[3], cube = 0, size = 0;
    for (int k = 0; k < 3; k++) {
        rest[k] = n[k] - m[k];
        cube += m[k] > 0 ? m[k] : 0;
        size += (fabs(n[k]) + fabs(m[k])) * face->reach[k];
    }
    return highest(face, rest) + cube + 16 * eps * size <= bound;
}

/* m along one axis, so that n - m is level along an edge. */
static bool certified_by_wall(const ebpo_local *face, const double n[3], double bound)
{
    for (int i = 0; i < 3; i++) {
        const double *a = face->at[i], *b = face->at[(i + 1) % 3];
        double edge[3] = { b[0] - a[0], b[1] - a[1], b[2] - a[2] };
        double rise = dot(n, edge);
        for (int k = 0; k < 3; k++) {
            double m[3] = { 0, 0, 0 };
            m[k] = rise / edge[k];
            if (edge[k] != 0 && certified(face, n, m, bound))
                return true;
        }
    }
    return false;
}

/* m along two axes, so that n - m is normal to the face. */
static bool certified_by_two_walls(const ebpo_local *face, const double n[3], double bound)
{
    double p[3], q[3], normal[3];
    for (int k = 0; k < 3; k++) {
        p[k] = face->at[1][k] - face->at[0][k];
        q[k] = face->at[2][k] - face->at[0][k];
    }
    for (int k = 0; k < 3; k++)
        normal[k] = p[(k + 1) % 3] * q[(k + 2) % 3] - p[(k + 2) % 3] * q[(k + 1) % 3];
    for (int j = 0; j < 3; j++) {
        double m[3], factor = n[j] / normal[j];
        for (int k = 0; k < 3; k++)
            m[k] = k == j ? 0 : n[k] - factor * normal[k];
        if (normal[j] != 0 && certified(face, n, m, bound))
            return true;
    }
    return false;
}

/* A corner of the face in the cell and surely beyond the plane: no need for rationals. */
static bool corner_beyond(const ebpo_local *face, const double n[3], double bound, double error)
{
    for (int i = 0; i < 3; i++)
        if ((face->contained >> i & 1) && dot(n, face->at[i]) > bound + error)
            return true;
    return false;
}

static bool face_keeps(ebpo_tally *tally, const ebpo_half_spaces *planes, int i,
                       const ebpo_frame *frame, const ebpo_corners *face, const ebpo_local *local)
{
    const double *n = planes->n[i];
    double bound = planes->bound[i],
           error = 16 * eps * 511 * fmax(local->reach[0], fmax(local->reach[1], local->reach[2]));
    if (highest(local, n) <= bound - error)
        return true;
    if (corner_beyond(local, n, bound, error))
        return false;
    if (certified_by_wall(local, n, bound) || certified_by_two_walls(local, n, bound))
        return true;
    tally->exact_half_spaces++;
    return ebpo_exact_half_space(frame->low, frame->high, face, planes->normal[i], planes->d[i]);
}

void ebpo_check_face_contained(ebpo_tally *tally, const ebpo_half_spaces *planes,
                               const ebpo_twin_node *node, const ebpo_frame *frame,
                               const ebpo_corners *face, uint64_t number)
{
    ebpo_local local;
    ebpo_local_make(&local, frame, face);
    tally->checks[EBPO_VERIFY_CONTAINMENT] += (uint64_t)planes->count;
    for (int i = 0; i < planes->count; i++)
        if (!face_keeps(tally, planes, i, frame, face, &local))
            ebpo_tally_violation(tally, EBPO_VERIFY_CONTAINMENT,
                                 &(ebpo_verify_place){ node->code, number, planes->number[i] },
                                 "the plane cuts off a part of the face in the cell");
}

void ebpo_check_corners_contained(ebpo_tally *tally, const ebpo_half_spaces *planes,
                                  const ebpo_twin_node *node, unsigned corners)
{
    for (int i = 0; i < planes->count; i++)
        for (unsigned corner = 0; corner < 8; corner++) {
            if (!(corners >> corner & 1))
                continue;
            const int32_t *n = planes->normal[i];
            int32_t value = 0;
            for (int k = 0; k < 3; k++)
                value += corner >> k & 1 ? n[k] : 0;
            tally->checks[EBPO_VERIFY_CONTAINMENT]++;
            if (4096 * value > planes->d[i])
                ebpo_tally_violation(
                    tally, EBPO_VERIFY_CONTAINMENT,
                    &(ebpo_verify_place){ node->code, EBPO_NO_FACE, planes->number[i] },
                    "the plane cuts off corner %u of the cell, which lies in the solid", corner);
        }
}
