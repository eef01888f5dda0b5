#include "core/strict_fp.h"

#include "extras/collide/face_cuts.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "core/alloc.h"
#include "geometry/predicates.h"

/* --- arrays of fractions: made once, used again --- */

static bool room_for_cut(ebpo_face_cuts *f)
{
    if (!ebpo_grow(&f->cut, &f->cut_capacity, f->cuts + 1, sizeof *f->cut))
        return false;
    for (; f->cuts_made <= f->cuts; f->cuts_made++) {
        ebpo_face_cut *c = &f->cut[f->cuts_made];
        mpq_inits(c->p[0], c->p[1], c->q[0], c->q[1], c->slope, NULL);
    }
    return true;
}

void ebpo_face_add_event(ebpo_face_cuts *f, const mpq_t p)
{
    if (!ebpo_grow(&f->event, &f->event_capacity, f->events + 1, sizeof *f->event)) {
        f->no_memory = true;
        return;
    }
    for (; f->events_made <= f->events; f->events_made++)
        mpq_init(f->event[f->events_made]);
    mpq_set(f->event[f->events++], p);
}

void ebpo_face_add_vertex(ebpo_face_cuts *f, const mpq_t p, const mpq_t q)
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

/* Along the axis on which the normal is longest, as far as doubles tell, and not 0. */
static void choose_view(ebpo_face_cuts *f)
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

static void difference(mpq_t out, mpq_t scratch, double a, double b)
{
    mpq_set_d(out, a);
    mpq_set_d(scratch, b);
    mpq_sub(out, out, scratch);
}

static void set_plane(ebpo_face_cuts *f)
{
    mpq_t *s = f->scratch;
    const double(*t)[3] = (const double(*)[3])f->corner;
    mpq_set_ui(f->offset, 0, 1);
    for (int k = 0; k < 3; k++) {
        int u = k == 2 ? 0 : k + 1, v = k == 0 ? 2 : k - 1;
        difference(s[0], s[4], t[1][u], t[0][u]);
        difference(s[1], s[4], t[2][v], t[0][v]);
        difference(s[2], s[4], t[1][v], t[0][v]);
        difference(s[3], s[4], t[2][u], t[0][u]);
        mpq_mul(s[0], s[0], s[1]);
        mpq_mul(s[2], s[2], s[3]);
        mpq_sub(f->normal[k], s[0], s[2]);
        mpq_set_d(s[5], t[0][k]);
        mpq_mul(s[5], s[5], f->normal[k]);
        mpq_add(f->offset, f->offset, s[5]);
    }
}

/* The cut's ends are in cut[cuts]: turns it, and adds it. */
static void finish_cut(ebpo_face_cuts *f)
{
    ebpo_face_cut *c = &f->cut[f->cuts];
    int order = mpq_cmp(c->p[0], c->p[1]);
    if (order == 0 && mpq_equal(c->q[0], c->q[1])) {
        ebpo_face_add_event(f, c->p[0]);
        ebpo_face_add_vertex(f, c->p[0], c->q[0]);
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
        ebpo_face_add_event(f, c->p[i]);
        ebpo_face_add_vertex(f, c->p[i], c->q[i]);
    }
    f->cuts++;
}

static void set_end(ebpo_face_cuts *f, int end, const double x[3])
{
    mpq_set_d(f->cut[f->cuts].p[end], x[f->u]);
    mpq_set_d(f->cut[f->cuts].q[end], x[f->v]);
}

static void cut_along_edges(ebpo_face_cuts *f, const double t[3][3])
{
    for (int i = 0; i < 3; i++) {
        if (!room_for_cut(f)) {
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
    choose_view(f);
    set_plane(f);
    cut_along_edges(f, corner);
}

/* --- other faces --- */

static int side_in_view(const ebpo_face_cuts *f, int i, const double x[3])
{
    const double *a = f->corner[i], *b = f->corner[(i + 1) % 3];
    return f->turn * ebpo_orient2d((double[]){ a[f->u], a[f->v] }, (double[]){ b[f->u], b[f->v] },
                                   (double[]){ x[f->u], x[f->v] });
}

/* All of it lies beyond an edge of the face, or on the edge. */
static bool beyond_an_edge(const ebpo_face_cuts *f, const double t[3][3])
{
    for (int i = 0; i < 3; i++)
        if (side_in_view(f, i, t[0]) <= 0 && side_in_view(f, i, t[1]) <= 0 &&
            side_in_view(f, i, t[2]) <= 0)
            return true;
    return false;
}

/* Where the edge from a to b, on both sides of the plane, goes through it. */
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
    mpq_div(s[0], s[0], s[1]); /* the share of the edge */
    for (int i = 0; i < 2; i++) {
        int k = i == 0 ? f->u : f->v;
        difference(s[2], s[4], b[k], a[k]);
        mpq_mul(s[2], s[2], s[0]);
        mpq_set_d(s[3], a[k]);
        mpq_add(i == 0 ? f->cut[f->cuts].p[end] : f->cut[f->cuts].q[end], s[2], s[3]);
    }
}

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
    if (ends == 1) {
        mpq_set(f->cut[f->cuts].p[1], f->cut[f->cuts].p[0]);
        mpq_set(f->cut[f->cuts].q[1], f->cut[f->cuts].q[0]);
    }
    finish_cut(f);
}

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
    flat->same_way = turn == f->turn;
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
    if (!(side[0] | side[1] | side[2])) {
        add_flat(f, t, model);
        return;
    }
    if (room_for_cut(f))
        cut_across(f, t, side);
    else
        f->no_memory = true;
}

int ebpo_face_side_of_edge(ebpo_face_cuts *f, const double a[3], const double b[3], const mpq_t p,
                           const mpq_t q)
{
    mpq_t *s = f->scratch;
    difference(s[0], s[4], b[f->u], a[f->u]);
    difference(s[1], s[4], b[f->v], a[f->v]);
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
            ebpo_face_side_of_edge(f, f->corner[i], f->corner[(i + 1) % 3], x[f->u], x[f->v]) *
                f->turn >=
            0;
    if (!f->has_target)
        return false;
    mpq_set(f->target[0], x[f->u]);
    mpq_set(f->target[1], x[f->v]);
    ebpo_face_add_event(f, f->target[0]);
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
        for (uint64_t k = 0; k < f->ends_made[i]; k++)
            mpq_clears(f->end[i][k].low, f->end[i][k].high, NULL);
        free(f->end[i]);
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
