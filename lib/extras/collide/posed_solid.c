/* Computes the winding number of a posed solid at a point of the world, exactly for posed
 * coordinates.
 *
 * The query point is transformed into the model's coordinates with an error bound. If no face is
 * within the bound of the transformed point, the result is the model's winding number at this
 * point. Otherwise the faces close to the point are posed. A segment parallel to an axis leads from
 * an anchor to the query point. The anchor is a point farther away, whose winding number is known.
 * The segment's crossings with posed faces are counted exactly. If the coordinates of the query
 * point are fractions, three segments parallel to axes lead to the query point from the point whose
 * coordinates are the nearest doubles.
 *
 * Functions do not change a posed solid: several threads may use the same posed solid, each thread
 * with a separate context.
 * Proofs: docs/develop/booleans.md and docs/develop/collision.md, "Relation of two models". */
#include "core/strict_fp.h"

#include <ebpo/collide.h>

#include <math.h>
#include <string.h>

#include "core/error.h"
#include "core/fp_env.h"
#include "extras/collide/posed_solid.h"
#include "geometry/integer_vectors.h"
#include "geometry/vec3.h"
#include "geometry/predicates.h"
#include "query/query_model.h"

void ebpo_model_extent(const ebpo_model *m, double max_coordinate[3])
{
    for (int k = 0; k < 3; k++) {
        double low = m->info->box_origin[k], high = low + m->info->box_size[k];
        max_coordinate[k] = fmax(fabs(low), fabs(high)) * (1 + 0x1p-50);
    }
}

double ebpo_posed_extent(const ebpo_posing *p, const double max_coordinate[3])
{
    double most = 0;
    for (int i = 0; i < 3; i++) {
        double size = fabs(p->translation[i]);
        for (int k = 0; k < 3; k++)
            size += fabs(p->matrix[i][k]) * max_coordinate[k];
        most = fmax(most, size);
    }
    return most * (1 + 0x1p-50);
}

ebpo_status ebpo_pose_check(const ebpo_model *model, const ebpo_pose *pose, ebpo_error *error)
{
    EBPO_DEFAULT_FP;
    ebpo_posing posing;
    double max_coordinate[3];
    ebpo_model_extent(model, max_coordinate);
    return ebpo_posing_make(&posing, pose, max_coordinate, error);
}

bool ebpo_same_model(const ebpo_model *a, const ebpo_model *b)
{
    const ebpo_info *x = a->info, *y = b->info;
    return memcmp(x->content_sha256, y->content_sha256, sizeof x->content_sha256) == 0 &&
           x->solid == y->solid && x->rule == y->rule;
}

/* --- points in the coordinates of the model --- */

/* Factor by which bounds are widened, because of the rounding errors of their computation. */
static const double margin_factor = 1 + 0x1p-40;

/* Sets the box of all posed vertices. */
static void bound_box(ebpo_posed_solid *s)
{
    const ebpo_info *info = s->model->info;
    for (int i = 0; i < 3; i++) {
        double low = s->posing.translation[i], high = low, size = fabs(low);
        for (int k = 0; k < 3; k++) {
            double a = info->box_origin[k], b = a + info->box_size[k], m = s->posing.matrix[i][k];
            low += fmin(m * a, m * b);
            high += fmax(m * a, m * b);
            size += fmax(fabs(m * a), fabs(m * b));
        }
        double rounding = 16 * 0x1p-53 * size + 0x1p-1070;
        s->box[i] = low - rounding;
        s->box[3 + i] = high + rounding;
    }
}

ebpo_status ebpo_posed_solid_make(ebpo_posed_solid *out, ebpo_model *model, const ebpo_pose *pose,
                                  ebpo_error *error)
{
    double max_coordinate[3];
    *out = (ebpo_posed_solid){ .model = model };
    memcpy(out->rotation, pose->rotation, sizeof out->rotation);
    ebpo_model_extent(model, max_coordinate);
    ebpo_status status = ebpo_check_mesh(model, error);
    if (status == EBPO_OK)
        status = ebpo_posing_make(&out->posing, pose, max_coordinate, error);
    if (status != EBPO_OK)
        return status;
    /* No sum overflows, because max_coordinate is at most 2^1000. 1.7321 is more than the root
     * of 3. */
    out->moved = 1.7321 * ebpo_posing_error(&out->posing, (max_coordinate[0] + max_coordinate[1] +
                                                           max_coordinate[2]) *
                                                              margin_factor);
    bound_box(out);
    if (!(out->moved / out->posing.scale <= 0x1p990))
        return ebpo_fail(error, EBPO_E_ARGUMENT,
                         "pose: the model is too small for its position: rounding moves it by "
                         "%.3g in the model's unit; move the model closer to the origin",
                         out->moved / out->posing.scale);
    return EBPO_OK;
}

bool ebpo_posed_solid_near(const ebpo_posed_solid *s, const double w[3], double margin)
{
    for (int k = 0; k < 3; k++)
        if ((s->box[k] - w[k]) * (1 - 0x1p-50) > margin ||
            (w[k] - s->box[3 + k]) * (1 - 0x1p-50) > margin)
            return false;
    return true;
}

void ebpo_unpose(const ebpo_posed_solid *s, const double w[3], double p[3], double *uncertainty)
{
    double y[3], length = 0, scale = s->posing.scale;
    for (int i = 0; i < 3; i++) {
        y[i] = w[i] - s->posing.translation[i];
        length += fabs(y[i]);
    }
    for (int k = 0; k < 3; k++)
        p[k] = ((s->rotation[0][k] * y[0] + s->rotation[1][k] * y[1]) + s->rotation[2][k] * y[2]) /
               scale;
    double error_bound = s->moved + length * (2 * s->posing.error_bound + 8 * 0x1p-53) + 0x1p-1060;
    *uncertainty = error_bound / scale * margin_factor + 0x1p-1060;
}

void ebpo_unpose_box(const ebpo_posed_solid *s, const double a[3], const double b[3], double low[3],
                     double high[3])
{
    double middle[3], half[3], sum = 0, p[3], uncertainty;
    for (int k = 0; k < 3; k++) {
        middle[k] = a[k] / 2 + b[k] / 2;
        half[k] = fmax(fabs(a[k] - middle[k]), fabs(b[k] - middle[k])) * (1 + 0x1p-50);
        sum += half[k];
    }
    ebpo_unpose(s, middle, p, &uncertainty);
    for (int k = 0; k < 3; k++) {
        double half_width = 2 * s->posing.error_bound * sum;
        for (int i = 0; i < 3; i++)
            half_width += fabs(s->rotation[i][k]) * half[i];
        half_width = half_width / s->posing.scale * (1 + 0x1p-40) + uncertainty;
        low[k] = nextafter(p[k] - half_width, -INFINITY);
        high[k] = nextafter(p[k] + half_width, INFINITY);
    }
}

/* Sets *clear to true if certainly no face of the model is within `uncertainty` of p. */
static ebpo_status is_clear_of_faces(ebpo_context *context, const double p[3], double uncertainty,
                                     bool *clear, ebpo_error *error)
{
    double low[3], high[3];
    const uint64_t *faces;
    uint64_t count;
    for (int k = 0; k < 3; k++) {
        low[k] = nextafter(p[k] - uncertainty, -INFINITY);
        high[k] = nextafter(p[k] + uncertainty, INFINITY);
    }
    ebpo_status status = ebpo_faces_in_box(context, low, high, &faces, &count, error);
    *clear = status == EBPO_OK && count == 0;
    return status;
}

/* --- sides of a point --- */

/* The segment between the query point w and the anchor. */
typedef struct side_segment {
    const ebpo_posed_solid *solid;
    const double *w;   /* [3] the query point */
    int axis;          /* the segment is parallel to this axis */
    double low[3], to; /* the segment's lower end; the coordinate of its upper end on the axis */
    int32_t crossed;   /* winding number at the upper end minus winding number at the lower end */
    int32_t jump;      /* winding number above w minus winding number below w */
    ebpo_posed_sides *out;
} side_segment;

/* Returns the axis that separates the two sides of a face: the first axis that is not parallel to
 * the face's plane; -1: the face has no area. */
static int side_axis(const double t[3][3])
{
    for (int k = 0; k < 3; k++)
        if (ebpo_normal_sign(k, t[0], t[1], t[2]) != 0)
            return k;
    return -1;
}

/* Returns true if the face t is in the plane of the face `plane`. */
static bool in_plane(const double plane[3][3], const double t[3][3])
{
    return ebpo_orient3d(plane[0], plane[1], plane[2], t[0]) == 0 &&
           ebpo_orient3d(plane[0], plane[1], plane[2], t[1]) == 0 &&
           ebpo_orient3d(plane[0], plane[1], plane[2], t[2]) == 0;
}

/* Updates the result by a face that contains w. */
static void add_face_at_point(side_segment *l, const double t[3][3])
{
    int axis = side_axis(t);
    if (axis < 0)
        return; /* a face without area bounds nothing */
    if (!l->out->on)
        memcpy(l->out->plane, t, sizeof l->out->plane);
    else if (!in_plane((const double(*)[3])l->out->plane, t))
        l->out->flat = false;
    l->out->on = true;
    double from[3] = { l->w[0], l->w[1], l->w[2] };
    from[axis] = nextafter(from[axis], -INFINITY);
    l->jump += ebpo_axis_crossing(from, nextafter(l->w[axis], INFINITY), axis, t[0], t[1], t[2]);
}

/* Updates l->crossed and the result by the faces close to the segment. Returns true, so that all
 * faces are visited. */
static bool receive_near_triangles(void *user, const ebpo_triangles *triangles)
{
    side_segment *l = user;
    for (uint64_t i = 0; i < triangles->count; i++) {
        double t[3][3];
        for (int c = 0; c < 3; c++)
            ebpo_posing_apply(&l->solid->posing, triangles->corners[i][c], t[c]);
        l->crossed += ebpo_axis_crossing(l->low, l->to, l->axis, t[0], t[1], t[2]);
        if (ebpo_point_on_triangle(l->w, t[0], t[1], t[2]))
            add_face_at_point(l, (const double(*)[3])t);
    }
    return true;
}

/* --- the anchor: a point that is certainly far enough from faces --- */

/* A point with a known winding number. */
typedef struct anchor {
    double at[3];    /* position in the world */
    int axis;        /* axis along which the anchor is displaced from w */
    int32_t winding; /* winding number at the anchor */
} anchor;

/* Sets *found to true, and sets a->winding, if a->at is certainly far enough from faces. */
static ebpo_status try_anchor(const ebpo_posed_solid *s, ebpo_context *context, anchor *a,
                              bool *found, ebpo_error *error)
{
    double p[3], uncertainty;
    ebpo_inside_result inside = { 0 };
    *found = !ebpo_posed_solid_near(s, a->at, 0);
    a->winding = 0;
    if (*found)
        return EBPO_OK;
    ebpo_unpose(s, a->at, p, &uncertainty);
    ebpo_status status = is_clear_of_faces(context, p, uncertainty, found, error);
    if (status == EBPO_OK && *found)
        status = ebpo_inside(context, p, NULL, &inside, error);
    a->winding = inside.winding;
    return status;
}

/* Finds an anchor: tries points at increasing distances from w, beginning with `step`. A point
 * beyond the solid's box is always an anchor. */
static ebpo_status find_anchor(const ebpo_posed_solid *s, ebpo_context *context, const double w[3],
                               double step, anchor *a, ebpo_error *error)
{
    for (;; step *= 4)
        for (int side = 0; side < 6; side++) {
            bool found;
            memcpy(a->at, w, sizeof a->at);
            a->axis = side / 2;
            a->at[a->axis] += side % 2 ? -step : step;
            ebpo_status status = try_anchor(s, context, a, &found, error);
            if (status != EBPO_OK || found)
                return status;
        }
}

/* Computes the winding numbers around w by a segment from an anchor. uncertainty: result of
 * ebpo_unpose for w. */
static ebpo_status decide_by_faces(const ebpo_posed_solid *s, ebpo_context *context,
                                   const double w[3], double uncertainty, ebpo_posed_sides *out,
                                   ebpo_error *error)
{
    anchor a;
    double low[3], high[3];
    side_segment l = { .solid = s, .w = w, .out = out };
    ebpo_status status = find_anchor(s, context, w, 8 * uncertainty * s->posing.scale, &a, error);
    if (status != EBPO_OK)
        return status;
    bool upward = a.at[a.axis] > w[a.axis]; /* the segment begins at w */
    l.axis = a.axis;
    memcpy(l.low, upward ? w : a.at, sizeof l.low);
    l.to = upward ? a.at[a.axis] : w[a.axis];
    ebpo_unpose_box(s, w, a.at, low, high);
    status = ebpo_triangles_in_box(context, low, high, receive_near_triangles, &l, error);
    if (status != EBPO_OK)
        return status;
    out->above = upward ? a.winding - l.crossed : a.winding + l.crossed;
    out->below = out->above - l.jump;
    return EBPO_OK;
}

ebpo_status ebpo_posed_solid_sides(const ebpo_posed_solid *s, ebpo_context *context,
                                   const double w[3], ebpo_posed_sides *out, ebpo_error *error)
{
    double p[3], uncertainty;
    bool clear = false;
    ebpo_inside_result inside;
    *out = (ebpo_posed_sides){ .flat = true };
    if (!ebpo_posed_solid_near(s, w, 0))
        return EBPO_OK;
    ebpo_unpose(s, w, p, &uncertainty);
    ebpo_status status = is_clear_of_faces(context, p, uncertainty, &clear, error);
    if (status == EBPO_OK && !clear)
        return decide_by_faces(s, context, w, uncertainty, out, error);
    if (status == EBPO_OK)
        status = ebpo_inside(context, p, NULL, &inside, error);
    if (status == EBPO_OK)
        out->above = out->below = inside.winding;
    return status;
}

/* --- winding numbers at points whose coordinates are fractions --- */

/* A path from w to x, where w has the doubles nearest to the coordinates of x. The path consists of
 * three segments parallel to the axes. Points and corners have integer coordinates, in the unit
 * 2^unit / denominator. */
typedef struct path {
    const ebpo_posed_solid *solid;
    const mpq_t *x;         /* [3] the query point */
    double w[3];            /* the first point of the path */
    mpz_t denominator;      /* a common denominator of the coordinates of x */
    mpz_t number[4];        /* temporary values */
    ebpo_vectorz at[4];     /* points of the path: at[0] is w; at[i] is x on axes 0 to i - 1 */
    ebpo_vectorz corner[3]; /* corners of the current face */
    int32_t crossed;        /* winding number at x minus winding number at w */
} path;

/* Initialises the integers of a path whose x and w are set. */
static void make_path(path *p)
{
    mpz_init_set_ui(p->denominator, 1);
    for (int i = 0; i < 4; i++)
        mpz_init(p->number[i]);
    for (int i = 0; i < 4; i++)
        ebpo_vectorz_init(&p->at[i]);
    for (int i = 0; i < 3; i++) {
        ebpo_vectorz_init(&p->corner[i]);
        mpz_lcm(p->denominator, p->denominator, mpq_denref(p->x[i]));
    }
}

static void clear_path(path *p)
{
    mpz_clear(p->denominator);
    for (int i = 0; i < 4; i++)
        mpz_clear(p->number[i]);
    for (int i = 0; i < 4; i++)
        ebpo_vectorz_clear(&p->at[i]);
    for (int i = 0; i < 3; i++)
        ebpo_vectorz_clear(&p->corner[i]);
}

/* Converts the corners of the face t and the points of the path to integers. unit: 0 or less. */
static void set_points(path *p, const double t[3][3], int unit)
{
    for (int i = 0; i < 3; i++)
        for (int k = 0; k < 3; k++) {
            ebpo_set_integer(p->corner[i].x[k], t[i][k], unit);
            mpz_mul(p->corner[i].x[k], p->corner[i].x[k], p->denominator);
        }
    for (int k = 0; k < 3; k++) {
        ebpo_set_integer(p->number[0], p->w[k], unit);
        mpz_mul(p->number[0], p->number[0], p->denominator);
        mpz_divexact(p->number[1], p->denominator, mpq_denref(p->x[k]));
        mpz_mul(p->number[1], p->number[1], mpq_numref(p->x[k]));
        mpz_mul_2exp(p->number[1], p->number[1], (mp_bitcnt_t)-unit);
        for (int i = 0; i < 4; i++)
            mpz_set(p->at[i].x[k], p->number[i > k]);
    }
}

/* Returns the orientation (1, 0 or -1) of a, b, c in the projection along the axis. p->number[0] is
 * set to the determinant. */
static int orientation_of(path *p, int axis, const ebpo_vectorz *a, const ebpo_vectorz *b,
                          const ebpo_vectorz *c)
{
    int u = axis == 2 ? 0 : axis + 1, v = axis == 0 ? 2 : axis - 1;
    mpz_sub(p->number[0], b->x[u], a->x[u]);
    mpz_sub(p->number[1], c->x[v], a->x[v]);
    mpz_mul(p->number[0], p->number[0], p->number[1]);
    mpz_sub(p->number[2], b->x[v], a->x[v]);
    mpz_sub(p->number[3], c->x[u], a->x[u]);
    mpz_submul(p->number[0], p->number[2], p->number[3]);
    return mpz_sgn(p->number[0]);
}

/* Returns the side (1 or -1) of the line of edge i on which the point `at` is, in the projection
 * along the axis. The point is shifted by the infinitesimal vector of
 * geometry/triangle_predicates.c. Returns 0 if the edge has no length in the projection. */
static int side_of_line(path *p, int axis, int i, const ebpo_vectorz *at)
{
    const ebpo_vectorz *a = &p->corner[i], *b = &p->corner[i == 2 ? 0 : i + 1];
    int u = axis == 2 ? 0 : axis + 1, v = axis == 0 ? 2 : axis - 1;
    int sign = orientation_of(p, axis, a, b, at);
    if (sign != 0)
        return sign;
    int by_u = mpz_cmp(a->x[v], b->x[v]), by_v = mpz_cmp(b->x[u], a->x[u]);
    int first = u < v ? by_u : by_v, second = u < v ? by_v : by_u;
    sign = first ? first : second;
    return (sign > 0) - (sign < 0);
}

/* Returns the side (1 or -1) of the face's plane on which the shifted point `at` is. */
static int side_of_plane(path *p, const ebpo_vectorz *at)
{
    const ebpo_vectorz *a = &p->corner[0];
    mpz_t sum;
    mpz_init(sum);
    for (int k = 0; k < 3; k++) {
        (void)orientation_of(p, k, a, &p->corner[1], &p->corner[2]);
        mpz_sub(p->number[1], at->x[k], a->x[k]);
        mpz_addmul(sum, p->number[0], p->number[1]);
    }
    int sign = mpz_sgn(sum);
    mpz_clear(sum);
    for (int k = 0; k < 3 && sign == 0; k++)
        sign = orientation_of(p, k, a, &p->corner[1], &p->corner[2]);
    return sign;
}

/* Returns the change of the winding number that the face causes along a segment parallel to the
 * axis. `to` is above `from` on the axis. */
static int count_crossing(path *p, int axis, const ebpo_vectorz *from, const ebpo_vectorz *to)
{
    int turn = side_of_line(p, axis, 0, from);
    if (turn == 0 || side_of_line(p, axis, 1, from) != turn ||
        side_of_line(p, axis, 2, from) != turn || side_of_plane(p, from) == turn ||
        side_of_plane(p, to) != turn)
        return 0;
    return -turn;
}

/* Updates p->crossed by the faces close to the path. Returns true, so that all faces are visited.
 */
static bool receive_path_triangles(void *user, const ebpo_triangles *triangles)
{
    path *p = user;
    for (uint64_t i = 0; i < triangles->count; i++) {
        double t[3][3];
        int unit = 0;
        for (int c = 0; c < 3; c++)
            ebpo_posing_apply(&p->solid->posing, triangles->corners[i][c], t[c]);
        unit = ebpo_common_unit(&t[0][0], 9, ebpo_common_unit(p->w, 3, unit));
        set_points(p, (const double(*)[3])t, unit);
        for (int k = 0; k < 3; k++) {
            int up = mpz_cmp(p->at[k + 1].x[k], p->at[k].x[k]);
            if (up > 0)
                p->crossed += count_crossing(p, k, &p->at[k], &p->at[k + 1]);
            else if (up < 0)
                p->crossed -= count_crossing(p, k, &p->at[k + 1], &p->at[k]);
        }
    }
    return true;
}

ebpo_status ebpo_exact_winding(const ebpo_posed_solid *s, ebpo_context *context, const mpq_t x[3],
                               int32_t *winding, ebpo_error *error)
{
    path p = { .solid = s, .x = x };
    double low[3], high[3], corner[2][3];
    ebpo_posed_sides sides;
    bool is_exact = true;
    mpq_t w;
    mpq_init(w);
    for (int k = 0; k < 3; k++) {
        p.w[k] = mpq_get_d(x[k]);
        mpq_set_d(w, p.w[k]);
        is_exact &= mpq_equal(w, x[k]) != 0;
        corner[0][k] = nextafter(p.w[k], -INFINITY);
        corner[1][k] = nextafter(p.w[k], INFINITY);
    }
    mpq_clear(w);
    ebpo_status status = ebpo_posed_solid_sides(s, context, p.w, &sides, error);
    *winding = sides.above;
    if (status != EBPO_OK || is_exact)
        return status;
    make_path(&p);
    ebpo_unpose_box(s, corner[0], corner[1], low, high);
    status = ebpo_triangles_in_box(context, low, high, receive_path_triangles, &p, error);
    *winding += p.crossed;
    clear_path(&p);
    return status;
}
