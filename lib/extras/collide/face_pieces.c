/* Finds the pieces into which other faces cut a face, and an exact point of each piece.
 *
 * The face is projected along the axis on which its normal has the largest component; p and q are
 * the two other coordinates, which are GMP fractions. Other faces cut the face along segments, the
 * cuts. A value of p at which a cut begins, ends or crosses another cut is an event. Between
 * neighbouring events (in a strip) the cuts have one order in q, so they divide the strip into
 * parts. Two parts of neighbouring strips belong to one piece if their borders have an open
 * interval in common that no cut covers. For each point of a piece, the other faces that are in the
 * same plane and contain the point are counted by their orientation. See docs/develop/collision.md,
 * "Relation of two models". */
#include "core/strict_fp.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "core/alloc.h"
#include "core/error.h"
#include "extras/collide/face_pieces.h"
#include "geometry/predicates.h"

/* --- arrays of fractions: initialised once, then reused --- */

/* Makes space for one more cut, and initialises its fractions. Returns false if memory is short. */
static bool capacity_for_cut(ebpo_face_cuts *f)
{
    if (!ebpo_grow(&f->cut, &f->cut_capacity, f->cuts + 1, sizeof *f->cut))
        return false;
    for (; f->cuts_made <= f->cuts; f->cuts_made++) {
        ebpo_face_cut *c = &f->cut[f->cuts_made];
        mpq_inits(c->p[0], c->p[1], c->q[0], c->q[1], c->slope, NULL);
    }
    return true;
}

/* Adds a value of p to the events. Sets f->no_memory if memory is short. */
static void add_event(ebpo_face_cuts *f, const mpq_t p)
{
    if (!ebpo_grow(&f->event, &f->event_capacity, f->events + 1, sizeof *f->event)) {
        f->no_memory = true;
        return;
    }
    for (; f->events_made <= f->events; f->events_made++)
        mpq_init(f->event[f->events_made]);
    mpq_set(f->event[f->events++], p);
}

/* Adds the point (p, q) to the vertices if f->all_cuts. Sets f->no_memory if memory is short. */
static void add_vertex(ebpo_face_cuts *f, const mpq_t p, const mpq_t q)
{
    if (!f->all_cuts)
        return;
    if (!ebpo_grow(&f->vertex, &f->vertex_capacity, f->vertices + 1, sizeof *f->vertex)) {
        f->no_memory = true;
        return;
    }
    for (; f->vertices_made <= f->vertices; f->vertices_made++)
        mpq_inits(f->vertex[f->vertices_made][0], f->vertex[f->vertices_made][1], NULL);
    mpq_set(f->vertex[f->vertices][0], p);
    mpq_set(f->vertex[f->vertices++][1], q);
}

/* --- the face --- */

/* Chooses the axis of the projection, and the orientation of the projected corners. Among the axes
 * on which the normal's component is not 0, chooses the axis with the greatest component, computed
 * in doubles. */
static void choose_projection(ebpo_face_cuts *f)
{
    double most = -1;
    f->axis = -1;
    for (int k = 0; k < 3; k++) {
        int u = k == 2 ? 0 : k + 1, v = k == 0 ? 2 : k - 1;
        const double(*t)[3] = (const double(*)[3])f->corner;
        const double a[2] = { t[0][u], t[0][v] }, b[2] = { t[1][u], t[1][v] },
                     c[2] = { t[2][u], t[2][v] };
        double size = fabs((b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]));
        int turn = ebpo_orient2d(a, b, c);
        if (turn == 0 || (f->axis >= 0 && !(size > most)))
            continue;
        most = size;
        f->axis = k;
        f->u = u;
        f->v = v;
        f->turn = turn;
    }
}

/* Sets out to a - b, exactly. */
static void difference_of(mpq_t out, mpq_t scratch, double a, double b)
{
    mpq_set_d(out, a);
    mpq_set_d(scratch, b);
    mpq_sub(out, out, scratch);
}

/* Computes the face's plane, exactly. */
static void set_plane(ebpo_face_cuts *f)
{
    mpq_t *s = f->scratch;
    const double(*t)[3] = (const double(*)[3])f->corner;
    mpq_set_ui(f->offset, 0, 1);
    for (int k = 0; k < 3; k++) {
        int u = k == 2 ? 0 : k + 1, v = k == 0 ? 2 : k - 1;
        difference_of(s[0], s[4], t[1][u], t[0][u]);
        difference_of(s[1], s[4], t[2][v], t[0][v]);
        difference_of(s[2], s[4], t[1][v], t[0][v]);
        difference_of(s[3], s[4], t[2][u], t[0][u]);
        mpq_mul(s[0], s[0], s[1]);
        mpq_mul(s[2], s[2], s[3]);
        mpq_sub(f->normal[k], s[0], s[2]);
        mpq_set_d(s[5], t[0][k]);
        mpq_mul(s[5], s[5], f->normal[k]);
        mpq_add(f->offset, f->offset, s[5]);
    }
}

/* Completes the new cut f->cut[f->cuts], whose ends have been set: orders the ends by p, computes
 * the slope, and adds the events and vertices. A cut of length 0 adds only an event and a vertex.
 */
static void finish_cut(ebpo_face_cuts *f)
{
    ebpo_face_cut *c = &f->cut[f->cuts];
    int order = mpq_cmp(c->p[0], c->p[1]);
    if (order == 0 && mpq_equal(c->q[0], c->q[1])) {
        add_event(f, c->p[0]);
        add_vertex(f, c->p[0], c->q[0]);
        return;
    }
    if (order > 0) {
        mpq_swap(c->p[0], c->p[1]);
        mpq_swap(c->q[0], c->q[1]);
    }
    if (order != 0) {
        mpq_sub(c->slope, c->q[1], c->q[0]);
        mpq_sub(f->scratch[0], c->p[1], c->p[0]);
        mpq_div(c->slope, c->slope, f->scratch[0]);
    }
    for (int i = 0; i < 2; i++) {
        add_event(f, c->p[i]);
        add_vertex(f, c->p[i], c->q[i]);
    }
    f->cuts++;
}

/* Sets an end (0 or 1) of the new cut to the projection of x. */
static void set_end(ebpo_face_cuts *f, int end, const double x[3])
{
    mpq_set_d(f->cut[f->cuts].p[end], x[f->u]);
    mpq_set_d(f->cut[f->cuts].q[end], x[f->v]);
}

/* The first FACE_EDGES cuts are the edges of the face itself. */
enum { FACE_EDGES = 3 };

/* Adds the edges of t, which is the face itself or another face in the same plane, as cuts. */
static void cut_along_edges(ebpo_face_cuts *f, const double t[3][3])
{
    for (int i = 0; i < 3; i++) {
        if (!capacity_for_cut(f)) {
            f->no_memory = true;
            return;
        }
        set_end(f, 0, t[i]);
        set_end(f, 1, t[(i + 1) % 3]);
        finish_cut(f);
    }
}

void ebpo_face_cuts_begin(ebpo_face_cuts *f, const double corner[3][3], bool all_cuts)
{
    if (!f->made) {
        for (int i = 0; i < 8; i++)
            mpq_init(f->scratch[i]);
        mpq_inits(f->normal[0], f->normal[1], f->normal[2], f->offset, f->target[0], f->target[1],
                  NULL);
        f->made = true;
    }
    memcpy(f->corner, corner, sizeof f->corner);
    f->cuts = f->events = f->vertices = f->flats = 0;
    f->no_memory = f->has_target = false;
    f->all_cuts = all_cuts;
    choose_projection(f);
    set_plane(f);
    cut_along_edges(f, corner);
}

/* --- other faces --- */

/* Returns the side of the face's edge i on which the projection of x is: 1 for the inner side, -1
 * for the outer side, 0 for the edge's line. */
static int side_of_projection(const ebpo_face_cuts *f, int i, const double x[3])
{
    const double *a = f->corner[i], *b = f->corner[(i + 1) % 3];
    return f->turn * ebpo_orient2d((double[]){ a[f->u], a[f->v] }, (double[]){ b[f->u], b[f->v] },
                                   (double[]){ x[f->u], x[f->v] });
}

/* Returns true if the face has an edge that separates the face from t: all corners of t are on the
 * outer side or on the line of the edge. */
static bool beyond_an_edge(const ebpo_face_cuts *f, const double t[3][3])
{
    for (int i = 0; i < 3; i++)
        if (side_of_projection(f, i, t[0]) <= 0 && side_of_projection(f, i, t[1]) <= 0 &&
            side_of_projection(f, i, t[2]) <= 0)
            return true;
    return false;
}

/* Sets an end (0 or 1) of the new cut to the point where the edge from a to b pierces the face's
 * plane; a and b are on different sides of the plane. */
static void set_piercing(ebpo_face_cuts *f, int end, const double a[3], const double b[3])
{
    mpq_t *s = f->scratch;
    const double *const x[2] = { a, b };
    for (int i = 0; i < 2; i++) {
        mpq_neg(s[i], f->offset);
        for (int k = 0; k < 3; k++) {
            mpq_set_d(s[2], x[i][k]);
            mpq_mul(s[2], s[2], f->normal[k]);
            mpq_add(s[i], s[i], s[2]);
        }
    }
    mpq_sub(s[1], s[0], s[1]);
    mpq_div(s[0], s[0], s[1]); /* the fraction of the edge */
    for (int i = 0; i < 2; i++) {
        int k = i == 0 ? f->u : f->v;
        difference_of(s[2], s[4], b[k], a[k]);
        mpq_mul(s[2], s[2], s[0]);
        mpq_set_d(s[3], a[k]);
        mpq_add(i == 0 ? f->cut[f->cuts].p[end] : f->cut[f->cuts].q[end], s[2], s[3]);
    }
}

/* Adds the cut of a face t that intersects the plane of the cut face but is not in the plane. side:
 * sides of the plane on which the corners of t are. */
static void cut_across(ebpo_face_cuts *f, const double t[3][3], const int side[3])
{
    int ends = 0;
    for (int i = 0; i < 3 && ends < 2; i++) {
        int next = (i + 1) % 3;
        if (side[i] == 0)
            set_end(f, ends++, t[i]);
        else if (side[i] == -side[next])
            set_piercing(f, ends++, t[i], t[next]);
    }
    if (ends == 1) { /* only a corner is in the plane: a cut of length 0 */
        mpq_set(f->cut[f->cuts].p[1], f->cut[f->cuts].p[0]);
        mpq_set(f->cut[f->cuts].q[1], f->cut[f->cuts].q[0]);
    }
    finish_cut(f);
}

/* Adds a face t in the same plane, and its edges as cuts. */
static void add_flat(ebpo_face_cuts *f, const double t[3][3], int model)
{
    if (!ebpo_grow(&f->flat, &f->flat_capacity, f->flats + 1, sizeof *f->flat)) {
        f->no_memory = true;
        return;
    }
    ebpo_flat_face *flat = &f->flat[f->flats++];
    int turn =
        ebpo_orient2d((double[]){ t[0][f->u], t[0][f->v] }, (double[]){ t[1][f->u], t[1][f->v] },
                      (double[]){ t[2][f->u], t[2][f->v] });
    memcpy(flat->corner, t, sizeof flat->corner);
    flat->model = model;
    flat->same_direction = turn == f->turn;
    cut_along_edges(f, t);
}

void ebpo_face_cuts_add(ebpo_face_cuts *f, const double t[3][3], int model)
{
    int side[3];
    for (int i = 0; i < 3; i++)
        side[i] = ebpo_orient3d(f->corner[0], f->corner[1], f->corner[2], t[i]);
    if (side[0] != 0 && side[0] == side[1] && side[1] == side[2])
        return;
    if ((!f->all_cuts && beyond_an_edge(f, t)) || ebpo_zero_area(t[0], t[1], t[2]))
        return;
    if (!(side[0] | side[1] | side[2])) { /* t is in the plane */
        add_flat(f, t, model);
        return;
    }
    if (capacity_for_cut(f))
        cut_across(f, t, side);
    else
        f->no_memory = true;
}

/* Returns the side of (p, q) relative to the projected line from a to b: positive: left, negative:
 * right, 0: on the line. */
static int side_of_edge(ebpo_face_cuts *f, const double a[3], const double b[3], const mpq_t p,
                        const mpq_t q)
{
    mpq_t *s = f->scratch;
    difference_of(s[0], s[4], b[f->u], a[f->u]);
    difference_of(s[1], s[4], b[f->v], a[f->v]);
    mpq_set_d(s[2], a[f->u]);
    mpq_sub(s[2], p, s[2]);
    mpq_set_d(s[3], a[f->v]);
    mpq_sub(s[3], q, s[3]);
    mpq_mul(s[0], s[0], s[3]);
    mpq_mul(s[1], s[1], s[2]);
    return mpq_cmp(s[0], s[1]);
}

bool ebpo_face_cuts_target(ebpo_face_cuts *f, const mpq_t x[3])
{
    mpq_t *s = f->scratch;
    mpq_neg(s[0], f->offset);
    for (int k = 0; k < 3; k++) {
        mpq_mul(s[1], x[k], f->normal[k]);
        mpq_add(s[0], s[0], s[1]);
    }
    f->has_target = mpq_sgn(s[0]) == 0;
    for (int i = 0; i < 3 && f->has_target; i++)
        f->has_target =
            side_of_edge(f, f->corner[i], f->corner[(i + 1) % 3], x[f->u], x[f->v]) * f->turn >= 0;
    if (!f->has_target)
        return false;
    mpq_set(f->target[0], x[f->u]);
    mpq_set(f->target[1], x[f->v]);
    add_event(f, f->target[0]);
    return true;
}

void ebpo_face_cuts_free(ebpo_face_cuts *f)
{
    for (uint64_t i = 0; i < f->cuts_made; i++)
        mpq_clears(f->cut[i].p[0], f->cut[i].p[1], f->cut[i].q[0], f->cut[i].q[1], f->cut[i].slope,
                   NULL);
    for (uint64_t i = 0; i < f->events_made; i++)
        mpq_clear(f->event[i]);
    for (uint64_t i = 0; i < f->vertices_made; i++)
        mpq_clears(f->vertex[i][0], f->vertex[i][1], NULL);
    for (uint64_t i = 0; i < f->values_made; i++)
        mpq_clear(f->value[i]);
    for (int i = 0; i < 2; i++) {
        for (uint64_t k = 0; k < f->borders_made[i]; k++)
            mpq_clears(f->border[i][k].low, f->border[i][k].high, NULL);
        free(f->border[i]);
    }
    for (int i = 0; i < 8 && f->made; i++)
        mpq_clear(f->scratch[i]);
    if (f->made)
        mpq_clears(f->normal[0], f->normal[1], f->normal[2], f->offset, f->target[0], f->target[1],
                   NULL);
    free(f->cut);
    free(f->event);
    free(f->vertex);
    free(f->flat);
    free(f->value);
    free(f->order);
    *f = (ebpo_face_cuts){ 0 };
}

/* --- events --- */

/* Computes the q of a cut at p. */
static void value_of_cut(const ebpo_face_cut *c, const mpq_t p, mpq_t out)
{
    mpq_sub(out, p, c->p[0]);
    mpq_mul(out, out, c->slope);
    mpq_add(out, out, c->q[0]);
}

/* Returns true if the cut is parallel to the q axis. */
static bool is_upright(const ebpo_face_cut *c) { return mpq_equal(c->p[0], c->p[1]) != 0; }

/* Returns true if p is in the cut's interval of p. */
static bool cut_has(const ebpo_face_cut *c, const mpq_t p)
{
    return mpq_cmp(c->p[0], p) <= 0 && mpq_cmp(c->p[1], p) >= 0;
}

/* Adds an event and a vertex for the crossing of two cuts, if they cross. Neither cut may be
 * parallel to the q axis. */
static void cross_two(ebpo_face_cuts *f, const ebpo_face_cut *a, const ebpo_face_cut *b)
{
    mpq_t *s = f->scratch;
    mpq_sub(s[0], a->slope, b->slope);
    if (mpq_sgn(s[0]) == 0)
        return;
    mpq_mul(s[1], a->slope, a->p[0]);
    mpq_sub(s[1], s[1], a->q[0]);
    mpq_mul(s[2], b->slope, b->p[0]);
    mpq_sub(s[2], s[2], b->q[0]);
    mpq_sub(s[1], s[1], s[2]);
    mpq_div(s[1], s[1], s[0]);
    if (!cut_has(a, s[1]) || !cut_has(b, s[1])) /* s[1]: the p at which the lines cross */
        return;
    add_event(f, s[1]);
    value_of_cut(a, s[1], s[2]);
    add_vertex(f, s[1], s[2]);
}

/* Adds a vertex for the crossing of a cut with the line of a cut that is parallel to the q axis.
 * The p of the crossing is already an event. */
static void cross_upright(ebpo_face_cuts *f, const ebpo_face_cut *upright, const ebpo_face_cut *c)
{
    if (!f->all_cuts || is_upright(c) || !cut_has(c, upright->p[0]))
        return;
    value_of_cut(c, upright->p[0], f->scratch[2]);
    add_vertex(f, upright->p[0], f->scratch[2]);
}

/* Compares two fractions for qsort. */
static int by_value(const void *x, const void *y) { return mpq_cmp((mpq_srcptr)x, (mpq_srcptr)y); }

/* Adds events for the crossings of cuts, sorts the events, and removes equal events. The edges of
 * the face itself are not crossed with each other. */
static void find_events(ebpo_face_cuts *f)
{
    for (uint64_t i = 0; i < f->cuts && !f->no_memory; i++)
        for (uint64_t k = i < FACE_EDGES ? FACE_EDGES : i + 1; k < f->cuts; k++) {
            const ebpo_face_cut *a = &f->cut[i], *b = &f->cut[k];
            if (mpq_cmp(a->p[1], b->p[0]) < 0 || mpq_cmp(b->p[1], a->p[0]) < 0)
                continue;
            if (is_upright(a))
                cross_upright(f, a, b);
            else if (is_upright(b))
                cross_upright(f, b, a);
            else
                cross_two(f, a, b);
        }
    if (f->no_memory)
        return;
    qsort(f->event, f->events, sizeof *f->event, by_value);
    uint64_t n = 1;
    for (uint64_t i = 1; i < f->events; i++)
        if (!mpq_equal(f->event[i], f->event[n - 1]))
            mpq_swap(f->event[i], f->event[n++]);
    f->events = n;
}

/* --- strips --- */

/* Sets `out` to a fraction between `low` and `high`: if possible to a double, because a double has
 * few bits. */
static void fraction_between(const mpq_t low, const mpq_t high, mpq_t out)
{
    double middle = mpq_get_d(low) / 2 + mpq_get_d(high) / 2;
    mpq_set_d(out, middle);
    if (mpq_cmp(low, out) < 0 && mpq_cmp(out, high) < 0)
        return;
    mpq_add(out, low, high);
    mpq_div_2exp(out, out, 1);
}

/* Positions in a strip: its left border, a value of p in its interior, its right border. */
enum { LEFT, MIDDLE, RIGHT };

/* Returns the q of a cut at a position in the current strip: LEFT, MIDDLE or RIGHT. */
static mpq_t *value_at(const ebpo_face_cuts *f, uint32_t cut, int position)
{
    return &f->value[3 * (uint64_t)cut + (unsigned)position];
}

/* Makes space for the values, the order and the borders of all cuts. Returns false if memory is
 * short. */
static bool capacity_for_values(ebpo_face_cuts *f)
{
    if (!ebpo_grow(&f->value, &f->value_capacity, 3 * f->cuts, sizeof *f->value) ||
        !ebpo_grow(&f->order, &f->order_capacity, f->cuts, sizeof *f->order))
        return false;
    for (; f->values_made < 3 * f->cuts; f->values_made++)
        mpq_init(f->value[f->values_made]);
    for (int i = 0; i < 2; i++) {
        if (!ebpo_grow(&f->border[i], &f->border_capacity[i], f->cuts, sizeof *f->border[i]))
            return false;
        for (; f->borders_made[i] < f->cuts; f->borders_made[i]++)
            mpq_inits(f->border[i][f->borders_made[i]].low, f->border[i][f->borders_made[i]].high,
                      NULL);
    }
    return true;
}

/* Sets f->order to the cuts that cross the strip inside the face or along its edges, in the order
 * of q in the middle of the strip, and returns their number. p: values of p at the three positions.
 */
static uint64_t cuts_of_strip(ebpo_face_cuts *f, const mpq_t p[3])
{
    uint64_t n = 0, kept = 0;
    int low = -1, high = -1;
    for (uint32_t i = 0; i < f->cuts; i++) {
        const ebpo_face_cut *c = &f->cut[i];
        if (is_upright(c) || mpq_cmp(c->p[0], p[LEFT]) > 0 || mpq_cmp(c->p[1], p[RIGHT]) < 0)
            continue;
        value_of_cut(c, p[MIDDLE], *value_at(f, i, MIDDLE));
        uint64_t at = n++;
        for (;
             at > 0 && mpq_cmp(*value_at(f, f->order[at - 1], MIDDLE), *value_at(f, i, MIDDLE)) > 0;
             at--)
            f->order[at] = f->order[at - 1];
        f->order[at] = i;
    }
    for (uint64_t i = 0; i < n; i++)
        if (f->order[i] < FACE_EDGES) {
            low = low < 0 ? (int)i : low;
            high = (int)i;
        }
    /* A cut before the face's lower edge or after its upper edge in this order is outside the face
     * or coincides with the edge. */
    for (uint64_t i = (uint64_t)(low < 0 ? 0 : low); low >= 0 && i <= (uint64_t)high; i++) {
        f->order[kept++] = f->order[i];
        value_of_cut(&f->cut[f->order[kept - 1]], p[LEFT], *value_at(f, f->order[kept - 1], LEFT));
        value_of_cut(&f->cut[f->order[kept - 1]], p[RIGHT],
                     *value_at(f, f->order[kept - 1], RIGHT));
    }
    return kept;
}

/* Returns true if a part of the previous strip and this part have an open interval in common on the
 * border between both strips. previous: index of f->border for the previous strip. low, high: the
 * interval of this part on the border. */
static bool continues_piece(const ebpo_face_cuts *f, int previous, const mpq_t low,
                            const mpq_t high)
{
    for (uint64_t i = 0; i < f->borders[previous]; i++) {
        const ebpo_piece_border *b = &f->border[previous][i];
        if (mpq_cmp(b->low, high) < 0 && mpq_cmp(low, b->high) < 0)
            return true;
    }
    return false;
}

/* Returns true if there is a cut parallel to the q axis at p. */
static bool upright_at(const ebpo_face_cuts *f, const mpq_t p)
{
    for (uint64_t i = 0; i < f->cuts; i++)
        if (is_upright(&f->cut[i]) && mpq_equal(f->cut[i].p[0], p))
            return true;
    return false;
}

/* Computes the point x of the plane whose projection is (p, q). */
static void point_at(ebpo_face_cuts *f, const mpq_t p, const mpq_t q, mpq_t x[3])
{
    mpq_set(x[f->u], p);
    mpq_set(x[f->v], q);
    mpq_mul(x[f->axis], f->normal[f->u], p);
    mpq_sub(x[f->axis], f->offset, x[f->axis]);
    mpq_mul(f->scratch[0], f->normal[f->v], q);
    mpq_sub(x[f->axis], x[f->axis], f->scratch[0]);
    mpq_div(x[f->axis], x[f->axis], f->normal[f->axis]);
}

/* Returns true if (p, q) is in the interior of a face in the same plane. */
static bool is_in_flat(ebpo_face_cuts *f, const ebpo_flat_face *t, const mpq_t p, const mpq_t q)
{
    int turn = t->same_direction ? f->turn : -f->turn;
    for (int i = 0; i < 3; i++)
        if (side_of_edge(f, t->corner[i], t->corner[(i + 1) % 3], p, q) * turn <= 0)
            return false;
    return true;
}

/* Calls `visit` for the point (p, q) of a piece. x: workspace. at_target: value of
 * ebpo_piece.at_target. */
static ebpo_status visit_at(ebpo_face_cuts *f, const mpq_t p, const mpq_t q, mpq_t x[3],
                            bool at_target, ebpo_piece_fn visit, void *user, ebpo_error *error)
{
    ebpo_piece piece = { .x = (const mpq_t *)x, .at_target = at_target };
    for (uint64_t i = 0; i < f->flats; i++)
        if (is_in_flat(f, &f->flat[i], p, q)) {
            piece.covered[f->flat[i].model] = true;
            piece.jump[f->flat[i].model] += f->flat[i].same_direction ? 1 : -1;
        }
    point_at(f, p, q, x);
    return visit(user, &piece, error);
}

typedef struct strip_scratch {
    mpq_t p[3];    /* values of p at LEFT, MIDDLE and RIGHT of the current strip */
    mpq_t q, x[3]; /* temporary values */
} strip_scratch;

/* Returns true if the target is on the left or right border of the part between the cuts low and
 * high. */
static bool is_at_target(const ebpo_face_cuts *f, const mpq_t p[3], uint32_t low, uint32_t high)
{
    for (int side = LEFT; f->has_target && side <= RIGHT; side += RIGHT)
        if (mpq_equal(f->target[0], p[side]) &&
            mpq_cmp(*value_at(f, low, side), f->target[1]) <= 0 &&
            mpq_cmp(f->target[1], *value_at(f, high, side)) <= 0)
            return true;
    return false;
}

/* Visits a point of each part of a strip that begins a new piece; with all_cuts, of each part.
 * current: index of f->border for this strip. */
static ebpo_status visit_strip(ebpo_face_cuts *f, strip_scratch *s, int current,
                               ebpo_piece_fn visit, void *user, ebpo_error *error)
{
    ebpo_status status = EBPO_OK;
    bool border_has_cut = upright_at(f, s->p[LEFT]);
    uint64_t n = cuts_of_strip(f, (const mpq_t *)s->p);
    f->borders[current] = 0;
    for (uint64_t i = 0; i + 1 < n && status == EBPO_OK; i++) {
        uint32_t low = f->order[i], high = f->order[i + 1];
        if (mpq_equal(*value_at(f, low, MIDDLE), *value_at(f, high, MIDDLE)))
            continue;
        ebpo_piece_border *b = &f->border[current][f->borders[current]++];
        mpq_set(b->low, *value_at(f, low, RIGHT));
        mpq_set(b->high, *value_at(f, high, RIGHT));
        if (!border_has_cut && !f->all_cuts &&
            continues_piece(f, !current, *value_at(f, low, LEFT), *value_at(f, high, LEFT)))
            continue; /* the piece has been visited in the previous strip */
        fraction_between(*value_at(f, low, MIDDLE), *value_at(f, high, MIDDLE), s->q);
        status = visit_at(f, s->p[MIDDLE], s->q, s->x,
                          is_at_target(f, (const mpq_t *)s->p, low, high), visit, user, error);
    }
    return status;
}

ebpo_status ebpo_face_pieces_visit(ebpo_face_cuts *f, ebpo_piece_fn visit, void *user,
                                   ebpo_error *error)
{
    strip_scratch s;
    ebpo_status status = EBPO_OK;
    if (!f->no_memory)
        find_events(f);
    if (f->no_memory || !capacity_for_values(f))
        return ebpo_fail_memory(error, f->cuts * sizeof *f->cut);
    mpq_inits(s.p[0], s.p[1], s.p[2], s.q, s.x[0], s.x[1], s.x[2], NULL);
    f->borders[0] = f->borders[1] = 0;
    for (uint64_t i = 0; i + 1 < f->events && status == EBPO_OK; i++) {
        mpq_set(s.p[LEFT], f->event[i]);
        mpq_set(s.p[RIGHT], f->event[i + 1]);
        fraction_between(f->event[i], f->event[i + 1], s.p[MIDDLE]);
        status = visit_strip(f, &s, (int)(i % 2), visit, user, error);
    }
    mpq_clears(s.p[0], s.p[1], s.p[2], s.q, s.x[0], s.x[1], s.x[2], NULL);
    return status;
}

ebpo_status ebpo_face_pieces_vertices(ebpo_face_cuts *f, ebpo_vertex_fn visit, void *user,
                                      ebpo_error *error)
{
    mpq_t x[3];
    ebpo_status status = EBPO_OK;
    if (!f->no_memory)
        find_events(f);
    if (f->no_memory)
        return ebpo_fail_memory(error, f->cuts * sizeof *f->cut);
    mpq_inits(x[0], x[1], x[2], NULL);
    for (uint64_t i = 0; i < f->vertices && status == EBPO_OK; i++) {
        bool within = true;
        for (int k = 0; k < 3 && within; k++)
            within = side_of_edge(f, f->corner[k], f->corner[(k + 1) % 3], f->vertex[i][0],
                                  f->vertex[i][1]) *
                         f->turn >=
                     0;
        if (!within)
            continue;
        point_at(f, f->vertex[i][0], f->vertex[i][1], x);
        status = visit(user, (const mpq_t *)x, error);
    }
    mpq_clears(x[0], x[1], x[2], NULL);
    return status;
}
