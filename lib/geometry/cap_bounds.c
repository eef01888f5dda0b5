/* Bounds the winding number w_D of the discs of a border, at points and in boxes. The discs are
 * triangles that close the holes of a mesh S. cap_tree.h explains S, its discs, the nodes of their
 * tree, and the winding numbers k, w_S and w_D. A half angle is half of a solid angle. An entry is
 * the index of a node, or of a node's own triangle (cap_bounds.h).
 *
 * Discs. Let the triangles of a node be in a ball of centre c and radius R. Let a be the sum of
 * their areas and V the sum of their vector areas, each times the weight of the triangle. With r =
 * |x - p|, the solid angle at p is the integral of f . dA over the triangles, where f(x) = (x - p)
 * / r^3. The norm of f is 1 / r^2, and the norm of its derivative is 2 / r^3. Let a box have the
 * centre q and half the diagonal s, and a distance g > 0 from the ball. For every p in the box, the
 * half angle is at most a / (2 g^2). The half angle differs from V . f(c) / 2 at q by at most a (R
 * + s) / g^3, because the differences x - p form a convex set, in which the norm is at least g. The
 * half angle of a triangle is also at most pi.
 *
 * Second order. Let X = c - q, d = |X| >= g, and f' the derivative of f at X, a symmetric matrix.
 * Its product with V has the norm sqrt(|V|^2 + 3 (V . X / d)^2) / d^3. The norm of the difference
 * between x - p and X is at most |x - c| + s, and the norm of the second derivative of f is at most
 * 6 / g^4. So the half angle differs from half of V . f(X) + I - (f' V) . (p - q), where I is the
 * integral of (f' (x - c)) . dA, by at most 1.5 a (D + s)^2 / g^4. D is the root mean square of |x
 * - c| over the area. With e = (R + s) / d < 1, a point at the part t of the way from X to x - p
 * has a norm of at least d (1 - t e). The integral of (1 - t) 6 / (d (1 - t e))^4 over t gives
 * another bound of the same difference, a (D + s)^2 (3 - 2 e) / (2 d^4 (1 - e)^2). f' V = (V - 3 (V
 * . u) u) / d^3 with u = X / d. With the matrix M = `moment`, I = a R (trace M - 3 X^T M X / d^2) /
 * d^3.
 *
 * Border edges. Away from the faces of S, w_S is smooth, also on caps. The gradient of 4 pi w_S is
 * the integral of (x - p) x dx / r^3 along the border (the law of Biot and Savart). An edge of
 * length l at the distance d contributes at most l / d^2, and at most 2 / d, the value of a whole
 * line. So in a box that no face touches, 2 pi w_S varies by at most s / 2 times the sum of the
 * contributions of all edges. For a whole loop the variation is also at most a s / g^3, by the
 * bound of the derivative of f.
 *
 * Rounding. Each quantity is computed with a relative error below 2^-45, except V; `slack` bounds
 * the error of V, so it changes I by at most 5 `slack` / d^2, and (f' V) . (p - q) by at most 2 s
 * `slack` / d^3. Each addition of a slope to a field adds the rounding of the addition
 * (add_sloped). A front adds at most 257 slopes; their norms are at most a / d^3, so the 2^-40 a s
 * / d^3 that each slope adds to its error covers the rounding of these sums. Rounding to float
 * changes I by at most 2^-20 a R / d^3. Radii, areas and errors are enlarged by a factor of 1 +
 * 2^-40. Distances are used only between 2^-300 and 2^300. Lengths below 2^-500 and areas below
 * 2^-900 may underflow. They change the results by less than the constants TINY and 2^-500, which
 * are added.
 */
#include "core/strict_fp.h"

#include <math.h>
#include <string.h>

#include "core/alloc.h"
#include "geometry/cap_bounds.h"
#include "geometry/cap_triangles.h"
#include "geometry/vec3.h"

static const double ENLARGE = 1 + 0x1p-40;
static const double DISTANCE_MIN = 0x1p-300, DISTANCE_MAX = 0x1p300, TINY = 0x1p-250;
/* Discs are far from a box if the sum of both radii is at most FAR times their distance. */
static const double FAR = 0.5;

/* Capacity of a stack of entries. A walk goes down at most 32 levels of groups and 32 levels of
 * stretches, and each level adds at most three entries. */
enum { STACK = 224 };

ebpo_cap_box ebpo_cap_box_of(const double low[3], const double high[3])
{
    ebpo_cap_box box;
    for (int k = 0; k < 3; k++) {
        box.centre[k] = low[k] / 2 + high[k] / 2;
        box.half[k] = fmax(high[k] - box.centre[k], box.centre[k] - low[k]) * ENLARGE;
    }
    box.radius = ebpo_vec3_length(box.half) * ENLARGE + 0x1p-500;
    return box;
}

/* --- one disc --- */

/* Returns a lower bound of the distance between a box and the ball of a node. */
static double gap_between(const ebpo_cap_node *n, const ebpo_cap_box *q, const double x[3],
                          double distance)
{
    if (q->radius > 0) {
        double apart[3];
        for (int k = 0; k < 3; k++) {
            double outside = fabs(x[k]) * (1 - 0x1p-50) - q->half[k];
            apart[k] = outside > 0 ? outside : 0;
        }
        distance = ebpo_vec3_length(apart);
    }
    return distance * (1 - 0x1p-40) - n->radius * ENLARGE;
}

/* The position of a node's ball relative to a box. */
typedef struct placed {
    double x[3];       /* the ball's centre minus the box's centre */
    double d2, d, gap; /* |x|^2, |x|, and a lower bound of the distance between ball and box */
} placed;

static placed place_ball(const ebpo_cap_node *n, const ebpo_cap_box *q)
{
    placed at;
    ebpo_vec3_subtract(n->centre, q->centre, at.x);
    at.d2 = ebpo_vec3_dot(at.x, at.x);
    at.d = sqrt(at.d2);
    at.gap = gap_between(n, q, at.x, at.d);
    return at;
}

/* bound_first_order and bound_second_order bound the sum of the half angles of a node's triangles.
 * `inverse`: 1 / gap^2. */
static ebpo_bounded bound_first_order(const ebpo_cap_node *n, const ebpo_cap_box *q,
                                      const placed *at, double inverse)
{
    double ball = (n->radius + q->radius) * ENLARGE;
    return (ebpo_bounded){ ebpo_vec3_dot(n->vector, at->x) / (at->d2 * at->d) / 2,
                           (n->area * (ball / at->gap + 0x1p-44) + n->slack) * inverse };
}

/* Returns the bounds at the centre of the box. The sum has the slope `slope` in the box. */
static ebpo_bounded bound_second_order(const ebpo_cap_node *n, const ebpo_cap_box *q,
                                       const placed *at, double inverse, double slope[3])
{
    const float *m = n->moment;
    double u[3], unit = 1 / at->d, square = unit * unit / 2, ratio = n->radius * unit,
                 spread = n->spread * n->radius + q->radius, reach = q->radius * unit;
    for (int k = 0; k < 3; k++)
        u[k] = at->x[k] * unit;
    double along = ebpo_vec3_dot(n->vector, u),
           moment = (double)m[0] + m[1] + m[2] -
                    3 * (m[0] * u[0] * u[0] + m[1] * u[1] * u[1] + m[2] * u[2] * u[2] +
                         2 * (m[3] * u[0] * u[1] + m[4] * u[1] * u[2] + m[5] * u[2] * u[0]));
    if (q->radius > 0)
        for (int k = 0; k < 3; k++)
            slope[k] = (3 * along * u[k] - n->vector[k]) * square * unit;
    double rounding =
        n->area * (0x1p-21 * ratio + 0x1p-40 * (1 + reach)) + (4 + 2 * reach) * n->slack;
    /* two bounds of the remainder: by the gap, and by the distance of the centres */
    double remainder = n->area * (1.5 * spread * spread * inverse) * inverse,
           e = (ratio + reach) * ENLARGE, part = spread * unit / (1 - e),
           by_centres = n->area * (part * part * (3 - 2 * e)) * square;
    if (e < 0.75 && by_centres < remainder)
        remainder = by_centres;
    return (ebpo_bounded){ (along + n->area * ratio * moment) * square,
                           remainder + rounding * inverse };
}

/* Bounds the same sum by the bound of the tree's order, the area and the weights. The slope is set
 * if the box is not a point. */
static ebpo_bounded bound_placed(const ebpo_cap_tree *t, const ebpo_cap_node *n,
                                 const ebpo_cap_box *q, const placed *at, double slope[3])
{
    const ebpo_bounded unknown = { 0, n->most };
    bool has_slope = t->second_order && q->radius > 0;
    ebpo_bounded b = unknown;
    if (at->gap > DISTANCE_MIN && at->d < DISTANCE_MAX) {
        double inverse = 1 / (at->gap * at->gap), simple = n->area * inverse / 2;
        b = t->second_order ? bound_second_order(n, q, at, inverse, slope)
                            : bound_first_order(n, q, at, inverse);
        if (!(b.error < simple)) {
            b = (ebpo_bounded){ 0, simple };
            has_slope = false;
        }
        b.error = b.error * ENLARGE + TINY;
        if (!(b.error < n->most && fabs(b.middle) <= 2 * n->most)) {
            b = unknown;
            has_slope = false;
        }
    } else
        has_slope = false;
    if (!has_slope && q->radius > 0)
        slope[0] = slope[1] = slope[2] = 0;
    return b;
}

static ebpo_bounded bound_node(const ebpo_cap_tree *t, const ebpo_cap_node *n,
                               const ebpo_cap_box *q, double slope[3])
{
    const placed at = place_ball(n, q);
    return bound_placed(t, n, q, &at, slope);
}

/* Bounds the half angle of a stretch's triangle at a point. Computes in 512 bits if doubles do not
 * suffice, which happens next to an edge. */
static ebpo_bounded bound_triangle(const ebpo_cap_tree *t, const ebpo_cap_node *n,
                                   const double p[3])
{
    const double *a = t->position[n->from], *c = t->position[n->to],
                 *b = t->position[ebpo_cap_middle(n->from, n->to)], weight = n->weight;
    ebpo_bounded half = ebpo_half_angle(p, a, b, c);
    ebpo_exact_angle exact;
    if (half.error > 0x1p-10 && ebpo_half_angle_exact(p, a, b, c, &exact))
        half = (ebpo_bounded){ exact.angle, 0x1p-46 };
    return (ebpo_bounded){ weight * half.middle, weight * half.error };
}

/* Adds a term to a sum. The error of the sum then includes the rounding of these additions. */
static inline void add_bounded(ebpo_bounded *sum, ebpo_bounded term)
{
    sum->middle += term.middle;
    sum->error += term.error + 0x1p-52 * (fabs(sum->middle) + fabs(term.middle) + sum->error);
}

/* --- entries --- */

/* Returns the node of an entry. If the entry is a single triangle, makes a node of this triangle in
 * *own. */
static const ebpo_cap_node *node_of(const ebpo_cap_tree *t, uint32_t entry, ebpo_cap_node *own)
{
    const ebpo_cap_node *n = &t->node[entry & ~EBPO_CAP_TRIANGLE];
    if (!(entry & EBPO_CAP_TRIANGLE))
        return n;
    ebpo_cap_triangle_node(t, n, own);
    return own;
}

/* Returns true if an entry has parts, that is, more than one triangle. */
static bool has_parts(const ebpo_cap_tree *t, uint32_t entry)
{
    const ebpo_cap_node *n = &t->node[entry & ~EBPO_CAP_TRIANGLE];
    return !(entry & EBPO_CAP_TRIANGLE) && (n->weight == 0 || n->to - n->from > 2);
}

/* Writes the parts of a node. The parts of a group are its two nodes. A stretch is a path along a
 * border loop. Its parts are its triangle and its two halves; a half without triangles is omitted.
 * Returns the number of parts. */
static uint32_t find_parts(const ebpo_cap_tree *t, uint32_t entry, uint32_t part[3])
{
    const ebpo_cap_node *n = &t->node[entry];
    uint32_t count = 0;
    if (n->weight == 0) {
        part[0] = n->from;
        part[1] = n->to;
        return 2;
    }
    uint64_t m = ebpo_cap_middle(n->from, n->to), first = ebpo_cap_count(n->from, m);
    part[count++] = entry | EBPO_CAP_TRIANGLE;
    if (first)
        part[count++] = entry + 1;
    if (ebpo_cap_count(m, n->to))
        part[count++] = (uint32_t)(entry + 1 + first);
    return count;
}

/* --- points --- */

ebpo_bounded ebpo_cap_tree_bound(const ebpo_cap_tree *tree, const double p[3], double tolerance)
{
    uint32_t stack[STACK], count = 0;
    ebpo_bounded sum = { 0, 0 };
    const ebpo_cap_box q = ebpo_cap_point(p);
    if (tree->node_count > 0)
        stack[count++] = 0;
    while (count > 0) {
        uint32_t entry = stack[--count];
        const ebpo_cap_node *n = &tree->node[entry & ~EBPO_CAP_TRIANGLE];
        bool triangle = entry & EBPO_CAP_TRIANGLE;
        ebpo_bounded b = triangle ? bound_triangle(tree, n, p) : bound_node(tree, n, &q, NULL);
        if (triangle || b.error <= tolerance)
            add_bounded(&sum, b);
        else
            count += find_parts(tree, entry, stack + count);
    }
    return sum;
}

/* --- lists --- */

static inline void add_slope(double sum[3], const double term[3])
{
    for (int k = 0; k < 3; k++)
        sum[k] += term[k];
}

/* Adds a term with a slope in the box to a sum. The error of the sum then includes the rounding of
 * these additions at all points of the box. */
static void add_sloped(ebpo_bounded *sum, double sum_slope[3], const ebpo_cap_box *box,
                       ebpo_bounded term, const double slope[3])
{
    add_slope(sum_slope, slope);
    for (int k = 0; k < 3; k++)
        term.error += 0x1p-52 * fabs(sum_slope[k]) * box->half[k];
    add_bounded(sum, term);
}

/* Expresses the same bounds with another centre. */
static void move_field(ebpo_cap_field *f, const double centre[3])
{
    double most = 0, sum = 0;
    for (int k = 0; k < 3; k++) {
        double term = f->slope[k] * (centre[k] - f->centre[k]);
        f->centre[k] = centre[k];
        most += fabs(term);
        sum += term;
    }
    if (most > 0) {
        f->at_centre.middle += sum;
        f->at_centre.error += 0x1p-48 * (fabs(f->at_centre.middle) + most + f->at_centre.error);
    }
}

bool ebpo_cap_field_add(ebpo_cap_field *sum, const ebpo_cap_tree *tree, const ebpo_cap_box *box,
                        uint32_t entry, double error)
{
    ebpo_cap_node own;
    double slope[3];
    ebpo_bounded b = bound_node(tree, node_of(tree, entry, &own), box, slope);
    if (!(b.error <= error))
        return false;
    add_sloped(&sum->at_centre, sum->slope, box, b, slope);
    return true;
}

ebpo_status ebpo_cap_lists_narrow(ebpo_cap_lists *lists, const ebpo_cap_tree *tree,
                                  const ebpo_cap_box *box, uint64_t begin, uint64_t end,
                                  uint64_t most, ebpo_cap_field *far)
{
    uint32_t stack[STACK];
    uint64_t before = lists->count;
    move_field(far, box->centre);
    if (begin < end)
        ebpo_cap_list_prefetch(tree, lists->entry + begin, end - begin);
    for (uint64_t i = begin; i < end; i++) {
        uint32_t count = 1;
        stack[0] = lists->entry[i];
        while (count > 0) {
            uint32_t entry = stack[--count];
            ebpo_cap_node own;
            const ebpo_cap_node *n = node_of(tree, entry, &own);
            const placed at = place_ball(n, box);
            ebpo_bounded b = { 0, n->most };
            double slope[3];
            if (n->radius + box->radius <= FAR * at.gap)
                b = bound_placed(tree, n, box, &at, slope);
            if (b.error < n->most) {
                add_sloped(&far->at_centre, far->slope, box, b, slope);
            } else if (n->radius > box->radius && has_parts(tree, entry)) {
                count += find_parts(tree, entry, stack + count);
            } else {
                bool is_full = lists->count - before == most;
                if (is_full ||
                    !ebpo_array_grow_late(lists->workspace, &lists->entry, &lists->capacity,
                                          lists->count + 1, sizeof *lists->entry)) {
                    lists->count = before;
                    return is_full ? EBPO_E_LIMIT : EBPO_E_MEMORY;
                }
                lists->entry[lists->count++] = entry;
            }
        }
    }
    return EBPO_OK;
}

/* --- refined sums --- */

static ebpo_bounded bound_entry(const ebpo_cap_front *f, uint32_t entry, double slope[3])
{
    ebpo_cap_node own;
    return bound_node(f->tree, node_of(f->tree, entry, &own), &f->box, slope);
}

/* Adds an entry to the front. */
static void add_entry(ebpo_cap_front *f, uint32_t entry)
{
    f->entry[f->count] = entry;
    f->bound[f->count] = bound_entry(f, entry, f->slope[f->count]);
    f->count++;
}

void ebpo_cap_front_begin(ebpo_cap_front *front, const ebpo_cap_tree *tree, const ebpo_cap_box *box,
                          const uint32_t *entry, uint64_t count, const ebpo_cap_field *far)
{
    front->tree = tree;
    front->box = *box;
    front->done = far->at_centre;
    ebpo_vec3_copy(far->slope, front->done_slope);
    front->count = 0;
    front->touched = count > EBPO_CAP_FRONT;
    ebpo_cap_list_prefetch(tree, entry, count);
    for (uint64_t i = 0; i < count; i++) {
        double slope[3];
        if (box->radius == 0 && entry[i] & EBPO_CAP_TRIANGLE) {
            const ebpo_cap_node *n = &tree->node[entry[i] & ~EBPO_CAP_TRIANGLE];
            add_bounded(&front->done, bound_triangle(tree, n, box->centre));
        } else if (!front->touched) {
            add_entry(front, entry[i]);
        } else {
            ebpo_bounded b = bound_entry(front, entry[i], slope);
            if (box->radius > 0)
                add_sloped(&front->done, front->done_slope, box, b, slope);
            else
                add_bounded(&front->done, b);
        }
    }
}

void ebpo_cap_front_begin_all(ebpo_cap_front *front, const ebpo_cap_tree *tree,
                              const ebpo_cap_box *box)
{
    const uint32_t root = 0;
    const ebpo_cap_field none = { .at_centre = { 0, 0 } };
    ebpo_cap_front_begin(front, tree, box, &root, tree->node_count > 0, &none);
}

ebpo_cap_sum ebpo_cap_front_sum(const ebpo_cap_front *front)
{
    ebpo_cap_sum sum = { front->done, 0, !front->touched };
    bool point = front->box.radius == 0;
    double slope[3], reach = 0;
    ebpo_vec3_copy(front->done_slope, slope);
    for (uint32_t i = 0; i < front->count; i++) {
        const ebpo_cap_node *n = &front->tree->node[front->entry[i] & ~EBPO_CAP_TRIANGLE];
        double most = front->entry[i] & EBPO_CAP_TRIANGLE ? n->weight * EBPO_PI_LOW : n->most;
        sum.apart = sum.apart && front->bound[i].error < most;
        add_bounded(&sum.all, front->bound[i]);
        if (!point)
            add_slope(slope, front->slope[i]);
    }
    if (point)
        return sum;
    for (int k = 0; k < 3; k++)
        reach += fabs(slope[k]) * front->box.half[k];
    sum.spread = reach * (1 - 0x1p-30) - sum.all.error;
    sum.all.error += reach * ENLARGE;
    return sum;
}

/* Replaces entry i by its parts. */
static void refine_entry(ebpo_cap_front *f, uint32_t i)
{
    uint32_t part[3], count = 1, entry = f->entry[i];
    f->count--;
    f->entry[i] = f->entry[f->count];
    f->bound[i] = f->bound[f->count];
    if (f->box.radius > 0)
        ebpo_vec3_copy(f->slope[f->count], f->slope[i]);
    if (has_parts(f->tree, entry))
        count = find_parts(f->tree, entry, part);
    else /* The node has one triangle, and the box is a point. For points, bound_triangle is more
            accurate than bound_node. */
        part[0] = entry | EBPO_CAP_TRIANGLE;
    for (uint32_t k = 0; k < count; k++) {
        if (f->box.radius == 0 && part[k] & EBPO_CAP_TRIANGLE) {
            const ebpo_cap_node *n = &f->tree->node[part[k] & ~EBPO_CAP_TRIANGLE];
            add_bounded(&f->done, bound_triangle(f->tree, n, f->box.centre));
        } else {
            add_entry(f, part[k]);
        }
    }
}

bool ebpo_cap_front_refine(ebpo_cap_front *front)
{
    bool point = front->box.radius == 0, refined = false;
    double most = 0;
    front->stuck = front->done.error;
    for (uint32_t i = 0; i < front->count; i++)
        if (point || has_parts(front->tree, front->entry[i]))
            most = fmax(most, front->bound[i].error);
        else
            front->stuck += front->bound[i].error;
    if (!(most > 0) || !(front->stuck < EBPO_PI_LOW))
        return false;
    for (uint32_t i = front->count;
         i-- >
         0;) /* refine_entry moves the last entry to i; the loop has visited that entry before */
        if (front->bound[i].error >= most / 4 && front->count + 2 < EBPO_CAP_FRONT &&
            (point || has_parts(front->tree, front->entry[i]))) {
            refine_entry(front, i);
            refined = true;
        }
    return refined;
}

/* --- variation --- */

typedef struct varying {
    const ebpo_cap_tree *tree;
    const ebpo_cap_box *box;
    double sum;  /* upper bound of the variation of 2 pi w_S so far */
    double most; /* the computation ends when `sum` is not below `most` */
} varying;

/* Adds a bound of the variation that a border edge causes. */
static void vary_by_edge(varying *v, uint64_t i, uint64_t j, double weight)
{
    double from[3], edge[3];
    ebpo_vec3_subtract(v->tree->position[i], v->box->centre, from);
    ebpo_vec3_subtract(v->tree->position[j], v->tree->position[i], edge);
    double square = ebpo_vec3_dot(edge, edge), length = sqrt(square),
           rounding = 0x1p-40 * (ebpo_vec3_length(from) + length),
           at = square > 0 ? fmin(fmax(-ebpo_vec3_dot(from, edge) / square, 0), 1) : 0;
    for (int k = 0; k < 3; k++)
        from[k] += at * edge[k];
    double distance = ebpo_vec3_length(from) * (1 - 0x1p-40) - rounding - v->box->radius;
    if (distance > DISTANCE_MIN && distance < DISTANCE_MAX)
        v->sum += weight * v->box->radius *
                      (fmin(2, (length + 0x1p-500) / distance) / distance / 2) * ENLARGE +
                  TINY;
    else
        v->sum = INFINITY;
}

/* Returns true if the distance of a node's ball from the box is greater than the ball's radius, and
 * between DISTANCE_MIN and DISTANCE_MAX. *gap: lower bound of this distance. */
static bool is_apart(const ebpo_cap_box *box, const ebpo_cap_node *n, double *gap)
{
    double x[3];
    ebpo_vec3_subtract(n->centre, box->centre, x);
    double distance = ebpo_vec3_length(x);
    *gap = gap_between(n, box, x, distance);
    return *gap > n->radius && *gap > DISTANCE_MIN && distance < DISTANCE_MAX;
}

/* Adds a bound of the variation that the path of a stretch causes. `at`: node of the stretch.
 * Recursive, at most 32 deep. */
static void vary_by_path(varying *v, uint64_t at)
{
    const ebpo_cap_node *n = &v->tree->node[at];
    double gap;
    if (is_apart(v->box, n, &gap)) {
        v->sum += n->length * v->box->radius / (gap * gap) / 2 * ENLARGE + TINY;
        return;
    }
    uint64_t m = ebpo_cap_middle(n->from, n->to), first = ebpo_cap_count(n->from, m);
    if (first)
        vary_by_path(v, at + 1);
    else
        vary_by_edge(v, n->from, m, n->weight);
    if (!(v->sum < v->most))
        return;
    if (ebpo_cap_count(m, n->to))
        vary_by_path(v, at + 1 + first);
    else
        vary_by_edge(v, m, n->to, n->weight);
}

/* Adds a bound of the variation that the loops of a node cause. Recursive, at most 32 deep. */
static void vary_by_loops(varying *v, uint64_t at)
{
    const ebpo_cap_node *n = &v->tree->node[at];
    double gap;
    if (is_apart(v->box, n, &gap)) {
        double s = v->box->radius, inverse = 1 / (gap * gap);
        v->sum += fmin(n->length / 2, n->area / gap) * inverse * s * ENLARGE + TINY;
    } else if (n->weight) {
        vary_by_path(v, at);
        vary_by_edge(v, n->to, n->from, n->weight);
    } else {
        vary_by_loops(v, n->from);
        if (v->sum < v->most)
            vary_by_loops(v, n->to);
    }
}

double ebpo_cap_variation(const ebpo_cap_tree *tree, const ebpo_cap_box *box, const uint32_t *entry,
                          uint64_t count, double most)
{
    varying v = { tree, box, 0, most };
    for (uint64_t i = 0; i < count && v.sum < most; i++)
        if (!(entry[i] & EBPO_CAP_TRIANGLE))
            (tree->node[entry[i]].weight ? vary_by_path : vary_by_loops)(&v, entry[i]);
    if (!(v.sum < most))
        return INFINITY;
    v.sum = 0;
    if (tree->node_count > 0)
        vary_by_loops(&v, 0);
    v.sum = v.sum * ENLARGE + TINY;
    return v.sum < most ? v.sum : INFINITY;
}
