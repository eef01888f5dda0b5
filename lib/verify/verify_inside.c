/* Verifies that the envelopes of a surface with holes contain its inside (border_inside).
 *
 * The inside is the set of points with a generalized winding number w that satisfies the file's
 * rule with the threshold 1/2. Here w is the sum of the solid angles of all faces at the point,
 * divided by 4 pi, computed directly, with a bound of its error. Points whose w is too near to 1/2
 * are omitted. A point that is inside must satisfy all planes of each node on the path from the
 * root to the node that has no children, and this node must be a leaf. Neither the border nor the
 * caps, which the builder uses, occur in this computation.
 *
 * The points have integer coordinates on a fine grid of the root cell, so planes are tested
 * exactly. They are corners, centres and random points of random cells, points just beyond planes,
 * and points near triangles of three points of a loop of the border, because there w may be near
 * 1/2. */
#include "core/strict_fp.h"

#include <math.h>
#include <stdlib.h>

#include "core/alloc.h"
#include "core/error.h"
#include "core/hash.h"
#include "core/parallel.h"
#include "core/workspace.h"
#include "mesh/mesh_parts.h"
#include "verify/verify_geometry.h"
#include "verify/verify_parts.h"

enum {
    GRID = 20,            /* level of the grid of the points */
    POINTS_MAX = 4096,    /* number of points for a small mesh */
    POINTS_MIN = 64,      /* number of points for a large mesh */
    TERMS_LOG2 = 26,      /* number of solid angles between these two numbers of points */
    FACE_BLOCK = 1 << 14, /* number of faces for each call of a thread's function */
    KINDS_OF_POINTS = 6
};

static const double pi = 0x1.921fb54442d18p1, eps = 0x1p-53;

/* A point, and the sum of the half angles (halves of solid angles) of all faces. */
typedef struct inside_point {
    uint32_t at[3]; /* on the grid */
    double p[3];
    double sum, error;
} inside_point;

/* The sums of one thread. */
typedef struct angle_sum {
    double sum, error;
} angle_sum;

typedef struct inside_check {
    ebpo_tally *tally;
    const ebpo_reference_tree *view;
    inside_point *point;
    uint64_t count;
    angle_sum *part; /* [block of faces][count] */
} inside_check;

/* --- points --- */

static uint32_t random_below(uint64_t *state, uint32_t limit)
{
    return (uint32_t)(ebpo_random_unit(ebpo_random_next(state)) * limit);
}

/* Sets the point to the point of the grid that is nearest to x, which has coordinates of the root
 * cell (0 to 1). */
static void set_point(const inside_check *c, inside_point *point, const double x[3])
{
    for (int k = 0; k < 3; k++) {
        double at = fmin(fmax(x[k], 0), 1) * (1 << GRID);
        point->at[k] = (uint32_t)(at < (1 << GRID) ? at : (1 << GRID) - 1);
        point->p[k] =
            c->view->box.origin[k] + point->at[k] * (c->view->box.size[k] * 0x1p-20 /* GRID */);
    }
}

/* Walks from the root to a random node that has children or is a leaf. */
static ebpo_reference_node random_node(const inside_check *c, uint64_t *state)
{
    ebpo_reference_node node = ebpo_reference_root(c->view);
    uint32_t depth = random_below(state, (uint32_t)c->view->tree->info.level_count);
    for (uint32_t i = 0; i < depth && node.type == EBPO_GRAY; i++) {
        unsigned first = random_below(state, 8);
        ebpo_reference_node next = node;
        for (unsigned o = 0; o < 8; o++) {
            ebpo_reference_node child = ebpo_reference_child(c->view, &node, (first + o) & 7);
            if (o == 0 || (next.type != EBPO_GRAY && child.type == EBPO_GRAY))
                next = child;
        }
        node = next;
    }
    return node;
}

/* Chooses a point in a random node, or just beyond one of the node's planes. */
static void choose_in_node(const inside_check *c, inside_point *point, unsigned kind,
                           uint64_t *state)
{
    ebpo_reference_node node = random_node(c, state);
    double x[3], side = ebpo_half_power(node.cell.level);
    for (int k = 0; k < 3; k++)
        x[k] = kind == 0   ? random_below(state, 2)
               : kind == 1 ? 0.5
                           : ebpo_random_unit(ebpo_random_next(state));
    ebpo_node_planes planes;
    if (kind == 3) {
        ebpo_node_planes_of(&planes, c->view, &node);
        int i = planes.count ? (int)random_below(state, (uint32_t)planes.count) : 0;
        double excess = 0, norm = 0;
        for (int k = 0; k < 3 && planes.count; k++) {
            excess += planes.n[i][k] * x[k];
            norm += planes.n[i][k] * planes.n[i][k];
        }
        for (int k = 0; k < 3 && planes.count; k++)
            x[k] =
                fmin(fmax(x[k] + planes.n[i][k] * ((planes.bound[i] - excess) / norm + 0.004 / 511),
                          0),
                     1);
    }
    for (int k = 0; k < 3; k++)
        x[k] = (node.cell.at[k] + x[k]) * side;
    set_point(c, point, x);
}

/* Chooses a point near a triangle of three points of a loop of the border. */
static void choose_at_border(const inside_check *c, inside_point *point, uint64_t *state)
{
    const ebpo_border_loops *loops = &c->view->tree->border;
    uint64_t loop = random_below(state, (uint32_t)loops->loop_count), first = 0;
    for (uint64_t i = 0; i < loop; i++)
        first += loops->loop[2 * i];
    double x[3] = { 0 }, weight[3], sum = 0;
    for (int i = 0; i < 3; i++)
        sum += weight[i] = ebpo_random_unit(ebpo_random_next(state)) + 0x1p-30;
    for (int i = 0; i < 3; i++) {
        const double *p = loops->point + 3 * (first + random_below(state, loops->loop[2 * loop]));
        for (int k = 0; k < 3; k++)
            x[k] += weight[i] / sum * (p[k] - c->view->box.origin[k]) / c->view->box.size[k];
    }
    double away = ebpo_half_power((int)random_below(state, 12) + 1);
    for (int k = 0; k < 3; k++)
        x[k] += away * (ebpo_random_unit(ebpo_random_next(state)) - 0.5);
    set_point(c, point, x);
}

static void choose_points(inside_check *c)
{
    uint64_t state = c->view->tree->info.face_count;
    for (uint64_t i = 0; i < c->count; i++) {
        unsigned kind = i % KINDS_OF_POINTS;
        if (kind < 4 || c->view->tree->border.loop_count == 0)
            choose_in_node(c, &c->point[i], kind, &state);
        else
            choose_at_border(c, &c->point[i], &state);
    }
}

/* --- winding numbers --- */

static double dot_product(const double a[3], const double b[3])
{
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

/* Adds the half angle of a face at p (van Oosterom and Strackee, 1983): the argument of the complex
 * number d + i det. Its rounding error is at most the error of this number divided by its absolute
 * value. */
static void add_half_angle(angle_sum *sum, const double p[3], const ebpo_corners *face)
{
    double v[3][3], length[3];
    for (int i = 0; i < 3; i++) {
        for (int k = 0; k < 3; k++)
            v[i][k] = face->at[i][k] - p[k];
        length[i] = sqrt(dot_product(v[i], v[i]));
    }
    const double *a = v[0], *b = v[1], *c = v[2];
    double det = a[0] * (b[1] * c[2] - b[2] * c[1]) + a[1] * (b[2] * c[0] - b[0] * c[2]) +
                 a[2] * (b[0] * c[1] - b[1] * c[0]),
           product = length[0] * length[1] * length[2],
           d = product + dot_product(a, b) * length[2] + dot_product(b, c) * length[0] +
               dot_product(c, a) * length[1],
           size = sqrt(det * det + d * d);
    if (!(size > 256 * eps * product)) { /* p is on an edge, or nearly */
        sum->error += pi;
        return;
    }
    double angle = atan2(det, d);
    sum->sum += angle;
    sum->error += 128 * eps * product / size + 8 * eps * (fabs(angle) + fabs(sum->sum));
}

static ebpo_status sum_block(void *context, uint64_t begin, uint64_t end, unsigned worker,
                             ebpo_error *error)
{
    inside_check *c = context;
    angle_sum *part = c->part + begin / FACE_BLOCK * c->count;
    (void)worker, (void)error;
    for (uint64_t f = begin; f < end; f++) {
        ebpo_corners face;
        ebpo_face_corners(&c->view->tree->mesh, f, &face);
        for (uint64_t i = 0; i < c->count; i++)
            add_half_angle(&part[i], c->point[i].p, &face);
    }
    return EBPO_OK;
}

/* Returns true if w is certainly beyond 1/2. */
static bool is_inside(const inside_check *c, const inside_point *point)
{
    double w = point->sum / (2 * pi), error = point->error / 6 + 0x1p-40;
    switch (c->view->tree->info.rule) {
    case EBPO_RULE_POSITIVE: return w - error > 0.5;
    case EBPO_RULE_EVENODD: return fabs(w - 2 * rint(w / 2)) - error > 0.5;
    default: return fabs(w) - error > 0.5;
    }
}

/* --- envelopes --- */

#define CHECK(holds, node, plane, ...)                                                      \
    do {                                                                                    \
        c->tally->checks[EBPO_VERIFY_CONTAINMENT]++;                                        \
        if (!(holds))                                                                       \
            ebpo_tally_violation(c->tally, EBPO_VERIFY_CONTAINMENT,                         \
                                 &(ebpo_verify_place){ (node)->code, EBPO_NO_FACE, plane }, \
                                 __VA_ARGS__);                                              \
    } while (0)

/* Checks the planes of a node: 4096 n . x <= d, with x = i / 2^(GRID - level) in the node's cell.
 */
static void check_planes(const inside_check *c, const inside_point *point,
                         const ebpo_reference_node *node)
{
    uint32_t count;
    const uint32_t *codes = ebpo_reference_planes(c->view, node, &count);
    int up = GRID - node->cell.level;
    for (uint32_t i = 0; i < count; i++) {
        int32_t n[3], d;
        int64_t value = 0;
        if (!ebpo_plane_decode(codes[i], n, &d))
            continue;
        for (int k = 0; k < 3; k++)
            value += (int64_t)n[k] * ((int64_t)point->at[k] - ((int64_t)node->cell.at[k] << up));
        CHECK(4096 * value <= (int64_t)d * (INT64_C(1) << up), node, i,
              "the plane cuts off (%.17g, %.17g, %.17g), which is inside", point->p[0], point->p[1],
              point->p[2]);
    }
}

/* Checks that a point that is inside is in the envelopes of all nodes on its path. */
static void check_path(const inside_check *c, const inside_point *point)
{
    ebpo_reference_node node = ebpo_reference_root(c->view);
    check_planes(c, point, &node);
    while (node.type == EBPO_GRAY && !ebpo_reference_is_pruned(c->view, &node)) {
        unsigned octant = ebpo_octant_at(point->at, GRID - 1 - node.cell.level);
        node = ebpo_reference_child(c->view, &node, octant);
        check_planes(c, point, &node);
    }
    CHECK(node.type != EBPO_WHITE, &node, EBPO_NO_PLANE,
          "(%.17g, %.17g, %.17g) is inside, but the node is white", point->p[0], point->p[1],
          point->p[2]);
}

ebpo_status ebpo_check_inside(ebpo_tally *tally, const ebpo_reference_tree *view, unsigned threads,
                              const ebpo_progress *progress, ebpo_error *error)
{
    const ebpo_tree *tree = view->tree;
    inside_check c = { .tally = tally, .view = view };
    uint64_t faces = tree->mesh.face_count, blocks = (faces + FACE_BLOCK - 1) / FACE_BLOCK;
    if (!tree->info.border_inside || !view->has_mesh || tree->info.pruned || faces == 0)
        return EBPO_OK;
    c.count = (UINT64_C(1) << TERMS_LOG2) / faces;
    c.count = c.count < POINTS_MIN ? POINTS_MIN : c.count > POINTS_MAX ? POINTS_MAX : c.count;
    c.point = ebpo_alloc_zero(c.count, sizeof *c.point);
    c.part = ebpo_alloc_zero(blocks * c.count, sizeof *c.part);
    ebpo_status status =
        c.point && c.part ? EBPO_OK : ebpo_fail_memory(error, blocks * c.count * sizeof *c.part);
    if (status == EBPO_OK) {
        choose_points(&c);
        status = ebpo_parallel_for(threads, view->workspace, faces, FACE_BLOCK, sum_block, &c,
                                   progress, "winding numbers", error);
    }
    for (uint64_t i = 0; i < c.count && status == EBPO_OK; i++) {
        for (uint64_t block = 0; block < blocks; block++) {
            c.point[i].sum += c.part[block * c.count + i].sum;
            c.point[i].error += c.part[block * c.count + i].error;
        }
        c.point[i].error += 2 * (double)blocks * eps * (fabs(c.point[i].sum) + pi);
        if (is_inside(&c, &c.point[i]))
            check_path(&c, &c.point[i]);
    }
    free(c.point);
    free(c.part);
    return status;
}
