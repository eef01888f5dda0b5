/* Separating axes (Gottschalk, Lin and Manocha, "OBBTree", 1996): the box' normals, the face's
 * normal, and the products of their edges; for a box and a triangle, also one without area, these
 * are all that is needed. */
#include "core/strict_fp.h"

#include "verify/touch.h"

#include <math.h>

static const double eps = 0x1p-53;
static const double slack = 0x1p-900; /* covers underflow */

typedef enum verdict { APART, MEET, UNSURE } verdict;

ebpo_frame ebpo_frame_make(const ebpo_box *box, ebpo_cell cell)
{
    ebpo_frame frame;
    for (int k = 0; k < 3; k++) {
        frame.low[k] = ebpo_wall(box, k, cell.level, cell.at[k]);
        frame.high[k] = ebpo_wall(box, k, cell.level, cell.at[k] + 1);
        frame.inverse[k] = 1 / (frame.high[k] - frame.low[k]);
    }
    return frame;
}

void ebpo_local_make(ebpo_local *out, const ebpo_frame *frame, const ebpo_corners *face)
{
    out->contained = 0;
    for (int k = 0; k < 3; k++)
        out->reach[k] = 1;
    for (int i = 0; i < 3; i++) {
        for (int k = 0; k < 3; k++) {
            double x = (face->at[i][k] - frame->low[k]) * frame->inverse[k];
            out->at[i][k] = x;
            out->reach[k] = fabs(x) > out->reach[k] ? fabs(x) : out->reach[k];
        }
        out->contained |= (unsigned)ebpo_corner_in_cell(frame, face->at[i]) << i;
    }
}

/* Intervals [a, b] of the face and [low, high] of the box on an axis; each end is off by at most
 * `error`. Not-a-number compares false: unsure. */
static verdict compare_intervals(double a, double b, double low, double high, double error)
{
    if (a > high + error || b < low - error)
        return APART;
    if (a <= high - error && b >= low + error)
        return MEET;
    return UNSURE;
}

/* (b - a) * inverse, 0 only when a and b are equal; not a number (and so never sure) where it is
 * too small to compute with. */
static double scaled_difference(double a, double b, double inverse)
{
    double x = (b - a) * inverse;
    return a != b && fabs(x) < 0x1p-400 ? NAN : x;
}

/* The axis edge x (unit vector k), edge from corner i to j, l being the third corner. */
static verdict edge_axis(const ebpo_local *p, const double edge[3], int i, int l, int k)
{
    int u = k == 2 ? 0 : k + 1, v = k == 0 ? 2 : k - 1;
    double eu = edge[u], ev = edge[v];
    if (eu == 0 && ev == 0)
        return MEET; /* the edge runs along k: no axis */
    double a = ev * p->at[i][u] - eu * p->at[i][v];
    double b = ev * p->at[l][u] - eu * p->at[l][v];
    double low = (ev < 0 ? ev : 0) - (eu > 0 ? eu : 0),
           high = (ev > 0 ? ev : 0) - (eu < 0 ? eu : 0);
    double error = 32 * eps * (fabs(ev) * p->reach[u] + fabs(eu) * p->reach[v]) + slack;
    return compare_intervals(a < b ? a : b, a < b ? b : a, low, high, error);
}

static verdict normal_axis(const ebpo_local *p, double edge[3][3])
{
    double value = 0, low = 0, high = 0, error = slack;
    for (int k = 0; k < 3; k++) {
        int u = k == 2 ? 0 : k + 1, v = k == 0 ? 2 : k - 1;
        double left = edge[0][u] * edge[1][v], right = edge[0][v] * edge[1][u];
        double n = left - right;
        value += n * p->at[0][k];
        low += n < 0 ? n : 0;
        high += n > 0 ? n : 0;
        error += 32 * eps * (fabs(left) + fabs(right)) * p->reach[k];
    }
    return compare_intervals(value, value, low, high, error);
}

/* The axes but the box' own, which the caller decided exactly. */
static verdict separating_axes(const ebpo_frame *frame, const ebpo_corners *face)
{
    ebpo_local p;
    ebpo_local_make(&p, frame, face);
    double edge[3][3];
    for (int i = 0; i < 3; i++)
        for (int k = 0; k < 3; k++)
            edge[i][k] =
                scaled_difference(face->at[i][k], face->at[(i + 1) % 3][k], frame->inverse[k]);
    verdict all = normal_axis(&p, edge);
    for (int i = 0; i < 3 && all != APART; i++)
        for (int k = 0; k < 3 && all != APART; k++) {
            verdict one = edge_axis(&p, edge[i], i, (i + 2) % 3, k);
            all = one == APART || all == MEET ? one : all;
        }
    return all;
}

bool ebpo_face_touches(const ebpo_frame *frame, const ebpo_corners *face, ebpo_tally *tally)
{
    for (int k = 0; k < 3; k++) {
        double a = face->at[0][k], b = face->at[1][k], c = face->at[2][k];
        if ((a < frame->low[k] && b < frame->low[k] && c < frame->low[k]) ||
            (a > frame->high[k] && b > frame->high[k] && c > frame->high[k]))
            return false;
    }
    for (int i = 0; i < 3; i++)
        if (ebpo_corner_in_cell(frame, face->at[i]))
            return true;
    verdict answer = separating_axes(frame, face);
    if (answer != UNSURE)
        return answer == MEET;
    tally->exact_touches++;
    return ebpo_exact_touches(frame->low, frame->high, face);
}
