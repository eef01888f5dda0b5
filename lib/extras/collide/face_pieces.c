/* Cuts are segments in the face's plane, seen along an axis. Between neighbouring events (ends and
 * crossings of cuts) strips have the same order of cuts all along: a point in the middle of each
 * part of a strip is one of each piece. Parts of neighbouring strips that have an open interval in
 * common belong to one piece. */
#include "core/strict_fp.h"

#include "extras/collide/face_pieces.h"

#include <stdlib.h>

#include "core/alloc.h"
#include "core/error.h"

/* --- events --- */

static void at_p(const ebpo_face_cut *c, const mpq_t p, mpq_t out)
{
    mpq_sub(out, p, c->p[0]);
    mpq_mul(out, out, c->slope);
    mpq_add(out, out, c->q[0]);
}

static bool is_upright(const ebpo_face_cut *c) { return mpq_equal(c->p[0], c->p[1]) != 0; }

static bool reaches(const ebpo_face_cut *c, const mpq_t p)
{
    return mpq_cmp(c->p[0], p) <= 0 && mpq_cmp(c->p[1], p) >= 0;
}

/* Both are not upright. */
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
    if (!reaches(a, s[1]) || !reaches(b, s[1]))
        return;
    ebpo_face_add_event(f, s[1]);
    at_p(a, s[1], s[2]);
    ebpo_face_add_vertex(f, s[1], s[2]);
}

/* Its p is an event already. */
static void cross_upright(ebpo_face_cuts *f, const ebpo_face_cut *upright, const ebpo_face_cut *c)
{
    if (!f->all_cuts || is_upright(c) || !reaches(c, upright->p[0]))
        return;
    at_p(c, upright->p[0], f->scratch[2]);
    ebpo_face_add_vertex(f, upright->p[0], f->scratch[2]);
}

static int by_value(const void *x, const void *y) { return mpq_cmp((mpq_srcptr)x, (mpq_srcptr)y); }

static void find_events(ebpo_face_cuts *f)
{
    for (uint64_t i = 0; i < f->cuts && !f->no_memory; i++)
        for (uint64_t k = i < 3 ? 3 : i + 1; k < f->cuts; k++) {
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

/* A fraction between both, with few bits where a double is. */
static void between(const mpq_t low, const mpq_t high, mpq_t out)
{
    double middle = mpq_get_d(low) / 2 + mpq_get_d(high) / 2;
    mpq_set_d(out, middle);
    if (mpq_cmp(low, out) < 0 && mpq_cmp(out, high) < 0)
        return;
    mpq_add(out, low, high);
    mpq_div_2exp(out, out, 1);
}

enum { LEFT, MIDDLE, RIGHT };

static mpq_t *value(const ebpo_face_cuts *f, uint32_t cut, int where)
{
    return &f->value[3 * (uint64_t)cut + (unsigned)where];
}

static bool room_for_values(ebpo_face_cuts *f)
{
    if (!ebpo_grow(&f->value, &f->value_capacity, 3 * f->cuts, sizeof *f->value) ||
        !ebpo_grow(&f->order, &f->order_capacity, f->cuts, sizeof *f->order))
        return false;
    for (; f->values_made < 3 * f->cuts; f->values_made++)
        mpq_init(f->value[f->values_made]);
    for (int i = 0; i < 2; i++) {
        if (!ebpo_grow(&f->end[i], &f->end_capacity[i], f->cuts, sizeof *f->end[i]))
            return false;
        for (; f->ends_made[i] < f->cuts; f->ends_made[i]++)
            mpq_inits(f->end[i][f->ends_made[i]].low, f->end[i][f->ends_made[i]].high, NULL);
    }
    return true;
}

/* Cuts that go through the strip between two events within the face, in the order of q in the
 * middle. */
static uint64_t cuts_of_strip(ebpo_face_cuts *f, const mpq_t p[3])
{
    uint64_t n = 0, kept = 0;
    int low = -1, high = -1;
    for (uint32_t i = 0; i < f->cuts; i++) {
        const ebpo_face_cut *c = &f->cut[i];
        if (is_upright(c) || mpq_cmp(c->p[0], p[LEFT]) > 0 || mpq_cmp(c->p[1], p[RIGHT]) < 0)
            continue;
        at_p(c, p[MIDDLE], *value(f, i, MIDDLE));
        uint64_t at = n++;
        for (; at > 0 && mpq_cmp(*value(f, f->order[at - 1], MIDDLE), *value(f, i, MIDDLE)) > 0;
             at--)
            f->order[at] = f->order[at - 1];
        f->order[at] = i;
    }
    for (uint64_t i = 0; i < n; i++)
        if (f->order[i] < 3) {
            low = low < 0 ? (int)i : low;
            high = (int)i;
        }
    /* an edge of the face may stand after an equal cut: nothing is between them */
    for (uint64_t i = (uint64_t)(low < 0 ? 0 : low); low >= 0 && i <= (uint64_t)high; i++) {
        f->order[kept++] = f->order[i];
        at_p(&f->cut[f->order[kept - 1]], p[LEFT], *value(f, f->order[kept - 1], LEFT));
        at_p(&f->cut[f->order[kept - 1]], p[RIGHT], *value(f, f->order[kept - 1], RIGHT));
    }
    return kept;
}

/* A part of the strip before has an open interval of the border in common with this one. */
static bool goes_on(const ebpo_face_cuts *f, int before, const mpq_t low, const mpq_t high)
{
    for (uint64_t i = 0; i < f->ends[before]; i++) {
        const ebpo_piece_end *e = &f->end[before][i];
        if (mpq_cmp(e->low, high) < 0 && mpq_cmp(low, e->high) < 0)
            return true;
    }
    return false;
}

static bool upright_at(const ebpo_face_cuts *f, const mpq_t p)
{
    for (uint64_t i = 0; i < f->cuts; i++)
        if (is_upright(&f->cut[i]) && mpq_equal(f->cut[i].p[0], p))
            return true;
    return false;
}

/* x in the plane at p, q. */
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

static bool is_in_flat(ebpo_face_cuts *f, const ebpo_flat_face *t, const mpq_t p, const mpq_t q)
{
    int turn = t->same_way ? f->turn : -f->turn;
    for (int i = 0; i < 3; i++)
        if (ebpo_face_side_of_edge(f, t->corner[i], t->corner[(i + 1) % 3], p, q) * turn <= 0)
            return false;
    return true;
}

static ebpo_status visit_at(ebpo_face_cuts *f, const mpq_t p, const mpq_t q, mpq_t x[3],
                            bool at_target, ebpo_piece_fn visit, void *user, ebpo_error *error)
{
    ebpo_piece piece = { .x = (const mpq_t *)x, .at_target = at_target };
    for (uint64_t i = 0; i < f->flats; i++)
        if (is_in_flat(f, &f->flat[i], p, q)) {
            piece.covered[f->flat[i].model] = true;
            piece.jump[f->flat[i].model] += f->flat[i].same_way ? 1 : -1;
        }
    point_at(f, p, q, x);
    return visit(user, &piece, error);
}

typedef struct strip_scratch {
    mpq_t p[3], q, x[3];
} strip_scratch;

/* The target is on the border of the part between two cuts. */
static bool is_at_target(const ebpo_face_cuts *f, const mpq_t p[3], uint32_t low, uint32_t high)
{
    for (int where = LEFT; f->has_target && where <= RIGHT; where += RIGHT)
        if (mpq_equal(f->target[0], p[where]) &&
            mpq_cmp(*value(f, low, where), f->target[1]) <= 0 &&
            mpq_cmp(f->target[1], *value(f, high, where)) <= 0)
            return true;
    return false;
}

static ebpo_status visit_strip(ebpo_face_cuts *f, strip_scratch *s, int now, ebpo_piece_fn visit,
                               void *user, ebpo_error *error)
{
    ebpo_status status = EBPO_OK;
    bool wall = upright_at(f, s->p[LEFT]);
    uint64_t n = cuts_of_strip(f, (const mpq_t *)s->p);
    f->ends[now] = 0;
    for (uint64_t i = 0; i + 1 < n && status == EBPO_OK; i++) {
        uint32_t low = f->order[i], high = f->order[i + 1];
        if (mpq_equal(*value(f, low, MIDDLE), *value(f, high, MIDDLE)))
            continue;
        ebpo_piece_end *e = &f->end[now][f->ends[now]++];
        mpq_set(e->low, *value(f, low, RIGHT));
        mpq_set(e->high, *value(f, high, RIGHT));
        if (!wall && !f->all_cuts && goes_on(f, !now, *value(f, low, LEFT), *value(f, high, LEFT)))
            continue;
        between(*value(f, low, MIDDLE), *value(f, high, MIDDLE), s->q);
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
    if (f->no_memory || !room_for_values(f))
        return ebpo_fail_memory(error, f->cuts * sizeof *f->cut);
    mpq_inits(s.p[0], s.p[1], s.p[2], s.q, s.x[0], s.x[1], s.x[2], NULL);
    f->ends[0] = f->ends[1] = 0;
    for (uint64_t i = 0; i + 1 < f->events && status == EBPO_OK; i++) {
        mpq_set(s.p[LEFT], f->event[i]);
        mpq_set(s.p[RIGHT], f->event[i + 1]);
        between(f->event[i], f->event[i + 1], s.p[MIDDLE]);
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
            within = ebpo_face_side_of_edge(f, f->corner[k], f->corner[(k + 1) % 3],
                                            f->vertex[i][0], f->vertex[i][1]) *
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
