/* Decides by winding numbers whether points are inside a mesh with holes. cap_tree.h explains the
 * rules and the winding numbers w = w_S and k.
 *
 * Bounds of w in doubles are refined until the rule gives the same result for all values between
 * the bounds. Doubles do not suffice if w equals a boundary s of the rule, or nearly so; s is an
 * even integer plus or minus the threshold t. In this case, the sign of w - s is found without any
 * arctangent. Half angles are arguments of complex numbers (geometry/solid_angle.h). So the product
 * z of these numbers, each to the power of its weight, has the argument 2 pi (w - k) up to whole
 * turns. Because w is close to s,
 *
 *   sign(w - s) = sign(Im(z exp(-2 pi i s))).
 *
 * The product is computed in 512 bits. Its relative error is the sum of the relative errors of its
 * factors, and the argument of z exp(-2 pi i s) is known within twice this error. exp(2 pi i t) is
 * the product of exp(2 pi i / 2^j) over the bits of t. Each of these factors follows from the
 * previous one by square roots (half angles). The last factor, which is at least 2^-64 of a turn,
 * has lost fewer than 100 bits. */
#include "core/strict_fp.h"

#include <math.h>

#include "geometry/cap_bounds.h"
#include "geometry/cap_triangles.h"

static const double INVERSE_TURN = 1 / (2 * EBPO_PI_LOW);

/* --- rules --- */

static bool rule_holds(const ebpo_cap_rule *r, double w)
{
    if (r->rule == EBPO_RULE_POSITIVE)
        return w > r->threshold;
    if (r->rule == EBPO_RULE_NONZERO)
        return fabs(w) > r->threshold;
    return fabs(w - 2 * nearbyint(w / 2)) > r->threshold;
}

/* Returns the boundary of the rule that is nearest to w: an even integer plus *side (1 or -1) times
 * the threshold. */
static double nearest_boundary(const ebpo_cap_rule *r, double w, int *side)
{
    double even = r->rule == EBPO_RULE_EVENODD ? 2 * nearbyint(w / 2) : 0;
    *side = r->rule != EBPO_RULE_POSITIVE && w < even ? -1 : 1;
    return even + *side * r->threshold;
}

int ebpo_cap_rule_result(const ebpo_cap_rule *rule, double low, double high)
{
    double t = rule->threshold, middle = low / 2 + high / 2,
           even = rule->rule == EBPO_RULE_EVENODD ? 2 * nearbyint(middle / 2) : 0;
    bool apart = low > even + t || high < even + t; /* true: no boundary is in [low, high] */
    if (rule->rule != EBPO_RULE_POSITIVE)
        apart = apart && (low > even - t || high < even - t);
    if (rule->rule == EBPO_RULE_EVENODD) /* the boundaries around the next even integers */
        apart = apart && low > even - 2 + t && high < even + 2 - t;
    return apart ? rule_holds(rule, middle) : -1;
}

/* --- bounds --- */

ebpo_bounded ebpo_cap_winding_of(ebpo_bounded angles, int32_t winding)
{
    double middle = winding + angles.middle * INVERSE_TURN;
    return (ebpo_bounded){ middle, (angles.error + 0x1p-50 * fabs(angles.middle)) * INVERSE_TURN *
                                           (1 + 0x1p-40) +
                                       0x1p-50 * fabs(middle) };
}

/* Returns the tolerance of the next pass. The tolerance of the last pass is 0: all triangles are
 * summed. After the last pass, returns -1. */
static double next_tolerance(double tolerance)
{
    return tolerance == 0 ? -1 : tolerance < 0x1p-40 ? 0 : tolerance * 0x1p-4;
}

ebpo_bounded ebpo_cap_winding(const ebpo_cap_tree *tree, const double p[3], int32_t winding,
                              double width)
{
    ebpo_bounded w = { winding, INFINITY };
    for (double t = 1; t >= 0 && !(w.error <= width / 2); t = next_tolerance(t))
        w = ebpo_cap_winding_of(ebpo_cap_tree_bound(tree, p, t), winding);
    return w;
}

/* --- 512 bits --- */

typedef struct exact_sum {
    ebpo_big_complex turn; /* product z, whose argument is the sum of the half angles */
    double error;          /* relative error of `turn` */
    ebpo_bounded angle;    /* sum of the half angles, in doubles */
} exact_sum;

/* Adds `weight` times a half angle to the sum, that is, multiplies z by a power of a->turn. */
static void multiply_power(exact_sum *s, const ebpo_exact_angle *a, uint32_t weight)
{
    ebpo_big_complex power = a->turn;
    for (uint32_t left = weight; left > 0; left >>= 1) {
        if (left & 1)
            s->turn = ebpo_big_complex_multiply(&s->turn, &power);
        if (left > 1)
            power = ebpo_big_complex_multiply(&power, &power);
    }
    s->error += (a->error + 0x1p-500) * weight;
    s->angle.middle += weight * a->angle;
    s->angle.error += weight * 0x1p-47 + 0x1p-52 * fabs(s->angle.middle);
}

/* Sums the half angles of all triangles. Returns false if p is a corner of a triangle, whose half
 * angle is then undefined, or if 512 bits do not suffice. */
static bool sum_exactly(const ebpo_cap_tree *t, const double p[3], exact_sum *s)
{
    *s = (exact_sum){ .turn = { ebpo_big_of(1), ebpo_big_of(0) } };
    for (uint64_t i = 0; i < t->node_count; i++) {
        const ebpo_cap_node *n = &t->node[i];
        ebpo_exact_angle angle;
        if (n->weight == 0)
            continue;
        if (!ebpo_half_angle_exact(p, t->position[n->from],
                                   t->position[ebpo_cap_middle(n->from, n->to)], t->position[n->to],
                                   &angle))
            return false;
        multiply_power(s, &angle, n->weight);
    }
    return true;
}

/* Returns exp(2 pi i t) for t in [2^-11, 1). `root` is exp(2 pi i / 2^j) for bit j of t. */
static ebpo_big_complex turn_of(double t)
{
    const ebpo_big one = ebpo_big_of(1);
    ebpo_big_complex out = { one, ebpo_big_of(0) }, root = { ebpo_big_of(-1), ebpo_big_of(0) };
    for (int j = 1; t > 0; j++) {
        if (j == 2) {
            root = (ebpo_big_complex){ ebpo_big_of(0), one };
        } else if (j > 2) {
            ebpo_big plus = ebpo_big_add(&one, &root.real),
                     minus = ebpo_big_subtract(&one, &root.real);
            plus = ebpo_big_scale(&plus, -1);
            minus = ebpo_big_scale(&minus, -1);
            root = (ebpo_big_complex){ ebpo_big_root(&plus), ebpo_big_root(&minus) };
        }
        t *= 2;
        if (t >= 1) {
            out = ebpo_big_complex_multiply(&out, &root);
            t -= 1;
        }
    }
    return out;
}

/* Returns the sign of w_S - b for the boundary b = even integer + side * threshold, which is near
 * w_S. `s`: the exact sum for w_S. Returns 0 if 512 bits do not suffice. */
static int sign_at_boundary(const exact_sum *s, int side, double threshold)
{
    ebpo_big_complex turn = turn_of(threshold);
    turn.imaginary.sign *= -side;
    turn = ebpo_big_complex_multiply(&s->turn, &turn);
    if (turn.real.sign <= 0)
        return 0;
    double sine = ebpo_big_double(&turn.imaginary, turn.real.exponent);
    double quarters = 4 * threshold,
           error = s->error + (quarters == floor(quarters) ? 0 : 0x1p-400);
    if (!(fabs(sine) > 4 * error))
        return 0;
    return sine > 0 ? 1 : -1;
}

/* Decides with numbers of 512 bits. */
static ebpo_cap_decision decide_exactly(const ebpo_cap_tree *tree, const double p[3],
                                        int32_t winding, const ebpo_cap_rule *rule)
{
    exact_sum s;
    if (!sum_exactly(tree, p, &s))
        return (ebpo_cap_decision){ false, true, ebpo_cap_winding(tree, p, winding, 0) };
    ebpo_bounded w = ebpo_cap_winding_of(s.angle, winding);
    int result = ebpo_cap_rule_result(rule, w.middle - w.error, w.middle + w.error), side;
    if (result >= 0)
        return (ebpo_cap_decision){ result, false, w };
    double boundary = nearest_boundary(rule, w.middle, &side);
    int sign = sign_at_boundary(&s, side, rule->threshold);
    bool inside = sign && rule_holds(rule, boundary + sign * 0x1p-20);
    return (ebpo_cap_decision){ inside, sign == 0, w };
}

/* --- decisions --- */

/* Returns the distance of w from the nearest boundary of the rule. */
static double boundary_distance(const ebpo_cap_rule *rule, double w)
{
    int side;
    return fabs(w - nearest_boundary(rule, w, &side));
}

/* A front is a set of tree nodes that together have all discs, with their bounds. Refines a front
 * until its bounds decide. Returns 1 (inside) or 0 (outside), or -1 if the finest bounds do not
 * decide, or if the errors that cannot be refined are too large to decide. */
static int decide_by_front(ebpo_cap_front *front, int32_t winding, const ebpo_cap_rule *rule,
                           ebpo_bounded *w)
{
    for (;;) {
        *w = ebpo_cap_winding_of(ebpo_cap_front_sum(front).all, winding);
        int result = ebpo_cap_rule_result(rule, w->middle - w->error, w->middle + w->error);
        if (result >= 0)
            return result;
        if (boundary_distance(rule, w->middle) < front->done.error * INVERSE_TURN ||
            !ebpo_cap_front_refine(front))
            return -1;
    }
}

/* Returns 1 (inside) or 0 (outside) if bounds in doubles decide, else -1. Sums with smaller and
 * smaller tolerances, each as small as the distance from the boundary requires. `first`: the first
 * tolerance. */
static int decide_by_bounds(const ebpo_cap_tree *tree, const double p[3], int32_t winding,
                            const ebpo_cap_rule *rule, double first, ebpo_bounded *w)
{
    int result = -1;
    for (double t = first; t >= 0 && result < 0;) {
        *w = ebpo_cap_winding_of(ebpo_cap_tree_bound(tree, p, t), winding);
        result = ebpo_cap_rule_result(rule, w->middle - w->error, w->middle + w->error);
        double wanted = t / 2 * boundary_distance(rule, w->middle) / w->error;
        t = t < 0x1p-40 ? next_tolerance(t) : fmax(fmin(t / 4, wanted), 0x1p-41);
    }
    return result;
}

/* The tolerance of a first sum without an estimate of w. */
static const double FIRST_TOLERANCE = 0x1p-5;

/* Decides by sums over the whole tree, and then by numbers of 512 bits. `first`: the tolerance of
 * the first sum. */
static ebpo_cap_decision decide_by_tree(const ebpo_cap_tree *tree, const double p[3],
                                        int32_t winding, const ebpo_cap_rule *rule, double first)
{
    ebpo_bounded w;
    int result = decide_by_bounds(tree, p, winding, rule, first, &w);
    return result >= 0 ? (ebpo_cap_decision){ result, false, w }
                       : decide_exactly(tree, p, winding, rule);
}

ebpo_cap_decision ebpo_cap_decide(const ebpo_cap_tree *tree, const double p[3], int32_t winding,
                                  const ebpo_cap_rule *rule)
{
    return decide_by_tree(tree, p, winding, rule, FIRST_TOLERANCE);
}

/* Returns the bounds of a field at the point x. */
static ebpo_cap_field field_at(const ebpo_near_field *f, const double x[3])
{
    ebpo_cap_field out = { .at_centre = { (double)f->middle, (double)f->error } };
    for (int k = 0; k < 3; k++)
        out.at_centre.middle += (double)f->slope[k] * (2 * x[k] - 1);
    return out;
}

ebpo_cap_decision ebpo_cap_decide_near(const ebpo_cap_tree *tree, const ebpo_near_cell *cell,
                                       const uint32_t *disc, const double p[3], const double x[3],
                                       int32_t winding, const ebpo_cap_rule *rule)
{
    const ebpo_cap_box point = ebpo_cap_point(p);
    const ebpo_cap_field far = field_at(&cell->far, x), most = field_at(&cell->most, x);
    ebpo_cap_front front;
    ebpo_bounded w;
    ebpo_cap_front_begin(&front, tree, &point, disc, cell->nearest, &most);
    int result = decide_by_front(&front, winding, rule, &w);
    if (result < 0 && cell->nearest < cell->count) {
        ebpo_cap_front_begin(&front, tree, &point, disc, cell->count, &far);
        result = decide_by_front(&front, winding, rule, &w);
    }
    if (result >= 0)
        return (ebpo_cap_decision){ result, false, w };
    /* The error of a sum is about proportional to the tolerance to the power of 0.7. This tolerance
     * most often gives an error just below the distance. */
    double distance = boundary_distance(rule, w.middle),
           first = fmax(fmin(distance * sqrt(distance) / 4, FIRST_TOLERANCE), 0x1p-41);
    return decide_by_tree(tree, p, winding, rule, first);
}
