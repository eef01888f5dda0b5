/* Measures the painted area, by stroke, by colour, by layer and in total.
 *
 * Faces are halved repeatedly at their longest edge, until it is certain to which stroke a part
 * belongs, or the part is small. In each layer the newest stroke decides: if one of its balls
 * contains the part, the part belongs to this stroke. If a ball only intersects the part, the
 * part's area outside the ball may belong to older strokes. So lower bounds and upper bounds of
 * areas are summed.
 *
 * Faces are distributed to a fixed number of work items. The sums of the items are added in order,
 * so results do not depend on the number of threads.
 *
 * See format-spec/paint.md, section 6. */
#include "core/strict_fp.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include <ebpo/paint.h>

#include "core/alloc.h"
#include "core/error.h"
#include "core/fp_env.h"
#include "core/parallel.h"
#include "extras/haptic/face_box.h"
#include "extras/paint/paint_parts.h"
#include "extras/paint/paint_reach.h"

/* A ball of a point whose reach contains a face. */
typedef struct area_ball {
    double centre[3], radius;
    uint32_t layer, stroke;
} area_ball;

/* The keys of the sums in area_cut.area. There is a sum for each stroke, then for each colour, then
 * for each layer, then the total. */
typedef struct area_keys {
    const ebpo_paint *p;
    uint32_t *colour; /* [strokes] index of a stroke's colour */
    uint64_t colours; /* number of colours */
} area_keys;

static inline uint64_t area_key_count(const area_keys *k)
{
    return k->p->stroke_count + k->colours + k->p->layer_count + 1;
}

/* Data of one thread. */
typedef struct area_cut {
    const area_keys *keys;
    double fineness;       /* a part is small if its longest edge is at most radius / fineness */
    ebpo_paint_area *area; /* [keys] sums of areas */
    area_ball *ball;       /* a stack: for each part the balls that may intersect it */
    uint64_t ball_capacity;
    uint64_t *last_visit; /* [colours] value of `visit` when an area was last added to the colour */
    uint64_t visit;       /* counts the calls of add_layer, so that a call adds to a colour once */
} area_cut;

/* Greatest number of halvings of a face. */
enum { DEEPEST = 900 };

/* A face or a part of a face. */
typedef struct triangle {
    double p[3][3], area;
} triangle;

/* Allocates the data of a thread; the caller owns `area`. Returns false without memory. */
static bool area_cut_begin(area_cut *c, const area_keys *keys, double fineness)
{
    *c = (area_cut){ .keys = keys, .fineness = fineness };
    c->last_visit = ebpo_alloc_zero(keys->colours, sizeof *c->last_visit);
    return c->last_visit != NULL;
}

static void area_cut_end(area_cut *c)
{
    free(c->last_visit);
    free(c->ball);
}

static double square_of_edge(const double a[3], const double b[3])
{
    double x = b[0] - a[0], y = b[1] - a[1], z = b[2] - a[2];
    return (x * x + y * y) + z * z;
}

static double area_of(const double p[3][3])
{
    double e[3], f[3], n[3];
    for (int i = 0; i < 3; i++) {
        e[i] = p[1][i] - p[0][i];
        f[i] = p[2][i] - p[0][i];
    }
    for (int i = 0; i < 3; i++)
        n[i] = e[(i + 1) % 3] * f[(i + 2) % 3] - e[(i + 2) % 3] * f[(i + 1) % 3];
    return sqrt((n[0] * n[0] + n[1] * n[1]) + n[2] * n[2]) / 2;
}

static bool area_cut_holds(const area_ball *ball, const triangle *t)
{
    double square = ball->radius * ball->radius;
    return ebpo_ball_holds(ball->centre, square, t->p[0]) &&
           ebpo_ball_holds(ball->centre, square, t->p[1]) &&
           ebpo_ball_holds(ball->centre, square, t->p[2]);
}

static bool area_cut_intersects(const area_ball *ball, const triangle *t)
{
    ebpo_face_near near;
    ebpo_face_nearest(ball->centre, t->p, &near);
    return near.distance <= ball->radius;
}

/* --- balls that intersect a part --- */

/* Copies the balls of a layer that matter for a triangle. The balls [from, end) are ordered from
 * the newest stroke to the oldest. Copies the balls that intersect the triangle to position `to`.
 * Stops at the first ball that contains the triangle; keeps only this ball of its stroke. Returns
 * the number of copied balls. *sure is true if no ball intersects the triangle. It is also true if
 * the newest stroke that intersects the triangle has a ball that contains the triangle. */
static uint64_t sift_layer(area_cut *c, const triangle *t, uint64_t from, uint64_t end, uint64_t to,
                           bool *sure)
{
    uint64_t kept = 0, first = 0; /* first: position of the first ball of the current stroke */
    *sure = false;
    for (uint64_t i = from; i < end; i++) {
        const area_ball *b = &c->ball[i];
        if (i > from && b->stroke != c->ball[i - 1].stroke)
            first = kept;
        if (area_cut_holds(b, t)) {
            c->ball[to + first] = *b;
            *sure = first == 0;
            return first + 1;
        }
        if (area_cut_intersects(b, t))
            c->ball[to + kept++] = *b;
    }
    *sure = kept == 0;
    return kept;
}

/* Calls sift_layer for each layer of the balls [from, from + count). The copied balls are on the
 * stack after these balls. Returns the number of copied balls. *sure is true if sift_layer sets it
 * to true for all layers. */
static uint64_t sift_layers(area_cut *c, const triangle *t, uint64_t from, uint64_t count,
                            bool *sure)
{
    uint64_t kept = 0;
    *sure = true;
    for (uint64_t i = from, end; i < from + count; i = end) {
        bool layer_sure;
        for (end = i; end < from + count && c->ball[end].layer == c->ball[i].layer; end++)
            continue;
        kept += sift_layer(c, t, i, end, from + count + kept, &layer_sure);
        *sure = *sure && layer_sure;
    }
    return kept;
}

static double least_radius(const area_cut *c, uint64_t from, uint64_t count)
{
    double least = INFINITY;
    for (uint64_t i = from; i < from + count; i++)
        least = fmin(least, c->ball[i].radius);
    return least;
}

/* --- sums --- */

/* Adds the area of a part that may be painted. certain: the whole part is painted; at_centre: the
 * centre of the part is painted. */
static void area_cut_add(ebpo_paint_area *to, double area, bool certain, bool at_centre)
{
    to->lo += certain ? area : 0;
    to->value += at_centre ? area : 0;
    to->hi += area;
}

/* The result of a layer for a triangle that is not divided further. */
typedef struct layer_result {
    bool painted;       /* a point of the triangle may be painted */
    bool unpainted;     /* a point of the triangle may be unpainted */
    uint32_t at_centre; /* stroke at the centre; UINT32_MAX: none */
    uint32_t colour;    /* if `painted`: the colour of the newest stroke that may paint */
    bool one_colour;    /* no other colour is possible */
} layer_result;

/* Returns true if the stroke paints, false if it erases. */
static bool area_cut_paints(const area_cut *c, uint32_t stroke)
{
    return c->keys->p->stroke[stroke].kind == EBPO_PAINT_PAINTS;
}

/* Evaluates a layer's balls [from, end), from the newest stroke to the oldest. */
static layer_result evaluate_layer(const area_cut *c, const triangle *t, const double centre[3],
                                   uint64_t from, uint64_t end)
{
    layer_result v = { .at_centre = UINT32_MAX, .one_colour = true, .unpainted = true };
    bool first = true;
    for (uint64_t i = from; i < end; i++) {
        const area_ball *b = &c->ball[i];
        uint32_t colour = c->keys->colour[b->stroke];
        if (v.at_centre == UINT32_MAX && ebpo_ball_holds(b->centre, b->radius * b->radius, centre))
            v.at_centre = b->stroke;
        if (area_cut_paints(c, b->stroke)) {
            v.one_colour = v.one_colour && (first || v.colour == colour);
            v.colour = first ? colour : v.colour;
            v.painted = true;
            first = false;
        }
    }
    /* if the oldest of these balls contains the whole triangle, a point can be unpainted only if
     * a stroke erases it */
    if (end > from && area_cut_holds(&c->ball[end - 1], t)) {
        v.unpainted = false;
        for (uint64_t i = from; i < end; i++)
            v.unpainted = v.unpainted || !area_cut_paints(c, c->ball[i].stroke);
    }
    return v;
}

/* Adds the result of a layer for a part to the sums of strokes, colours and layers. */
static void add_layer(area_cut *c, const triangle *t, const layer_result *v, uint64_t from,
                      uint64_t end)
{
    ebpo_paint_area *strokes = c->area, *colours = strokes + c->keys->p->stroke_count,
                    *layers = colours + c->keys->colours;
    bool certain = v->painted && !v->unpainted,
         at_centre = v->at_centre != UINT32_MAX && area_cut_paints(c, v->at_centre);
    if (!v->painted)
        return;
    area_cut_add(&layers[c->ball[from].layer], t->area, certain, at_centre);
    c->visit++;
    for (uint64_t i = from; i < end; i++) {
        uint32_t stroke = c->ball[i].stroke, colour = c->keys->colour[stroke];
        bool again = i > from && c->ball[i - 1].stroke == stroke;
        if (again || !area_cut_paints(c, stroke))
            continue;
        area_cut_add(&strokes[stroke], t->area,
                     certain && c->ball[from].stroke == stroke && c->ball[end - 1].stroke == stroke,
                     v->at_centre == stroke);
        if (c->last_visit[colour] == c->visit)
            continue;
        c->last_visit[colour] = c->visit;
        area_cut_add(&colours[colour], t->area, certain && v->one_colour,
                     at_centre && c->keys->colour[v->at_centre] == colour);
    }
}

/* Adds a part to the sums. The balls of the part are at [from, from + count). */
static void area_cut_account(area_cut *c, const triangle *t, uint64_t from, uint64_t count)
{
    double centre[3];
    bool may = false, certain = false, at_centre = false;
    for (int i = 0; i < 3; i++)
        centre[i] = (t->p[0][i] + t->p[1][i] + t->p[2][i]) / 3;
    for (uint64_t i = from, end; i < from + count; i = end) {
        for (end = i; end < from + count && c->ball[end].layer == c->ball[i].layer; end++)
            continue;
        layer_result v = evaluate_layer(c, t, (const double *)centre, i, end);
        may = may || v.painted;
        certain = certain || (v.painted && !v.unpainted);
        at_centre = at_centre || (v.at_centre != UINT32_MAX && area_cut_paints(c, v.at_centre));
        add_layer(c, t, &v, i, end);
    }
    if (may)
        area_cut_add(&c->area[area_key_count(c->keys) - 1], t->area, certain, at_centre);
}

/* --- cutting --- */

static double longest_edge(const triangle *t, int *which)
{
    double longest = -1;
    for (int k = 0; k < 3; k++) {
        double square = square_of_edge(t->p[k], t->p[(k + 1) % 3]);
        if (square > longest) {
            longest = square;
            *which = k;
        }
    }
    return sqrt(longest);
}

/* Computes the middle of an edge. Returns false if it is equal to an end, because of rounding. */
static bool find_middle(const double a[3], const double b[3], double middle[3])
{
    for (int i = 0; i < 3; i++)
        middle[i] = a[i] + (b[i] - a[i]) / 2;
    return memcmp(middle, a, 3 * sizeof *a) != 0 && memcmp(middle, b, 3 * sizeof *b) != 0;
}

/* Divides a triangle and adds its parts to the sums. The balls of the triangle are at [from, from +
 * count); the stack after these balls is used for the balls of the parts. Returns false without
 * memory. */
static bool divide_triangle(area_cut *c, const triangle *t, uint64_t from, uint64_t count,
                            int depth)
{
    bool sure;
    int edge = 0;
    if (!ebpo_grow(&c->ball, &c->ball_capacity, from + 2 * count, sizeof *c->ball))
        return false;
    uint64_t kept = sift_layers(c, t, from, count, &sure), at = from + count;
    if (kept == 0)
        return true;
    double longest = longest_edge(t, &edge), middle[3];
    const double *a = t->p[edge], *b = t->p[(edge + 1) % 3];
    if (sure || depth == DEEPEST || longest * c->fineness <= least_radius(c, at, kept) ||
        !find_middle(a, b, middle)) {
        area_cut_account(c, t, at, kept);
        return true;
    }
    triangle half = *t;
    half.area = t->area / 2;
    memcpy(half.p[edge], middle, sizeof middle);
    if (!divide_triangle(c, &half, at, kept, depth + 1))
        return false;
    memcpy(half.p[edge], a, sizeof middle);
    memcpy(half.p[(edge + 1) % 3], middle, sizeof middle);
    return divide_triangle(c, &half, at, kept, depth + 1);
}

/* Adds a face. Its balls are c->ball[0] to c->ball[count - 1], ordered by layer, and in each layer
 * from the newest stroke to the oldest. Returns false without memory. */
static bool area_cut_face(area_cut *c, const double corner[3][3], uint64_t count)
{
    triangle t;
    memcpy(t.p, corner, sizeof t.p);
    t.area = area_of(corner);
    return t.area > 0 ? divide_triangle(c, &t, 0, count, 0) : true;
}

/* --- the model --- */

/* Limits. PIECES_MAX: greatest number of work items. SUMS_MAX: greatest number of sums, one for
 * each item and key. FINENESS_MAX: greatest value of the option `fineness`. */
enum { PIECES_MAX = 64, SUMS_MAX = 1 << 22, FINENESS_MAX = 1 << 16 };

/* A pair of a point and a face in its reach. */
typedef struct hit {
    uint32_t face; /* index in measure.found_faces */
    uint32_t layer, stroke;
    uint32_t point; /* index in ebpo_paint.point */
} hit;

typedef struct measure {
    const ebpo_paint *p;
    const ebpo_paint_options *options;
    ebpo_found_faces found_faces;
    hit *hit;
    uint64_t hit_count, hit_capacity;
    uint64_t
        points_outside_subset; /* number of points whose reach is not completely in this file */
    uint64_t *first;           /* [found_faces.count + 1] first hit of each face */
    area_keys keys;
    ebpo_paint_colour_area *colour; /* [keys.colours] */
    uint64_t pieces;                /* number of work items */
    ebpo_paint_area *sum;           /* [pieces][keys] */
} measure;

/* --- faces in the reaches --- */

static ebpo_status add_point(measure *m, ebpo_reach_search *reach, uint32_t stroke, uint32_t point,
                             ebpo_error *error)
{
    if (!ebpo_grow(&m->hit, &m->hit_capacity, m->hit_count + reach->count, sizeof *m->hit))
        return ebpo_fail_memory(error, (m->hit_count + reach->count) * sizeof *m->hit);
    for (uint64_t i = 0; i < reach->count; i++) {
        hit *h = &m->hit[m->hit_count];
        ebpo_status status =
            ebpo_found_faces_add(&m->found_faces, &reach->face[i], &h->face, error);
        if (status != EBPO_OK)
            return status;
        h->layer = m->p->stroke[stroke].layer;
        h->stroke = stroke;
        h->point = point;
        m->hit_count++;
    }
    return EBPO_OK;
}

static ebpo_status find_hits(measure *m, ebpo_context *context, ebpo_error *error)
{
    const ebpo_paint *p = m->p;
    ebpo_reach_search reach;
    ebpo_status status = EBPO_OK;
    ebpo_reach_begin(&reach, context);
    for (uint32_t s = 0; s < p->stroke_count && status == EBPO_OK; s++)
        for (uint32_t i = 0; i < p->stroke[s].count && status == EBPO_OK; i++) {
            bool complete;
            uint64_t point = p->stroke[s].first + i;
            if (point % 256 == 0 &&
                !ebpo_progress_step(&m->options->progress, "reach", point, p->point_count, error))
                status = EBPO_E_CANCELLED;
            if (status == EBPO_OK)
                status = ebpo_paint_reach(&reach, p, s, i, &complete, error);
            if (status == EBPO_OK && complete)
                status = add_point(m, &reach, s, (uint32_t)point, error);
            m->points_outside_subset += status == EBPO_OK && !complete;
        }
    ebpo_reach_end(&reach);
    return status;
}

/* Orders hits by face, then by layer, then from the newest stroke to the oldest. */
static int by_face(const void *a, const void *b)
{
    const hit *x = a, *y = b;
    if (x->face != y->face)
        return x->face < y->face ? -1 : 1;
    if (x->layer != y->layer)
        return x->layer < y->layer ? -1 : 1;
    if (x->stroke != y->stroke)
        return x->stroke > y->stroke ? -1 : 1;
    return (x->point > y->point) - (x->point < y->point);
}

static ebpo_status sort_hits(measure *m, ebpo_error *error)
{
    m->first = ebpo_alloc_zero(m->found_faces.count + 1, sizeof *m->first);
    if (!m->first)
        return ebpo_fail_memory(error, m->found_faces.count * sizeof *m->first);
    if (m->hit_count)
        qsort(m->hit, m->hit_count, sizeof *m->hit, by_face);
    for (uint64_t i = 0; i < m->hit_count; i++)
        m->first[m->hit[i].face + 1] = i + 1;
    return EBPO_OK;
}

/* --- colours --- */

static int by_colour(const void *a, const void *b)
{
    const ebpo_paint_colour_area *x = a, *y = b;
    if (x->layer != y->layer)
        return x->layer < y->layer ? -1 : 1;
    return (x->colour > y->colour) - (x->colour < y->colour);
}

static ebpo_paint_colour_area colour_of(const ebpo_stroke_data *s)
{
    return (ebpo_paint_colour_area){ .layer = s->layer, .colour = ebpo_paint_pack(s->rgba) };
}

/* Finds the colours of all strokes that paint (not of strokes that erase). A colour in two layers
 * counts as two colours. */
static ebpo_status find_colours(measure *m, ebpo_error *error)
{
    const ebpo_paint *p = m->p;
    uint64_t count = 0, kept = 0;
    m->colour = ebpo_alloc_zero(p->stroke_count, sizeof *m->colour);
    m->keys.colour = ebpo_alloc_zero(p->stroke_count, sizeof *m->keys.colour);
    if (!m->colour || !m->keys.colour)
        return ebpo_fail_memory(error, p->stroke_count * sizeof *m->colour);
    for (uint64_t i = 0; i < p->stroke_count; i++)
        if (p->stroke[i].kind == EBPO_PAINT_PAINTS)
            m->colour[count++] = colour_of(&p->stroke[i]);
    qsort(m->colour, count, sizeof *m->colour, by_colour);
    for (uint64_t i = 0; i < count; i++)
        if (kept == 0 || by_colour(&m->colour[kept - 1], &m->colour[i]) != 0)
            m->colour[kept++] = m->colour[i];
    m->keys.colours = kept;
    for (uint64_t i = 0; i < p->stroke_count; i++) {
        ebpo_paint_colour_area key = colour_of(&p->stroke[i]);
        const ebpo_paint_colour_area *found = bsearch(&key, m->colour, kept, sizeof key, by_colour);
        m->keys.colour[i] = found ? (uint32_t)(found - m->colour) : 0;
    }
    return EBPO_OK;
}

/* --- areas --- */

static bool measure_face(measure *m, area_cut *cut, uint64_t face)
{
    const ebpo_paint *p = m->p;
    uint64_t begin = m->first[face], count = m->first[face + 1] - begin;
    if (!ebpo_grow(&cut->ball, &cut->ball_capacity, count, sizeof *cut->ball))
        return false;
    for (uint64_t i = 0; i < count; i++) {
        const hit *h = &m->hit[begin + i];
        const ebpo_paint_point *q = &p->point[h->point];
        cut->ball[i] = (area_ball){ { q->place[0], q->place[1], q->place[2] },
                                    ebpo_paint_radius(&p->stroke[h->stroke], q),
                                    h->layer,
                                    h->stroke };
    }
    return area_cut_face(cut, (const double(*)[3])m->found_faces.face[face].corner, count);
}

static ebpo_status measure_pieces(void *context, uint64_t begin, uint64_t end, unsigned worker,
                                  ebpo_error *error)
{
    measure *m = context;
    area_cut cut;
    uint64_t faces = m->found_faces.count, keys = area_key_count(&m->keys);
    (void)worker;
    bool ok = area_cut_begin(&cut, &m->keys, m->options->fineness);
    for (uint64_t piece = begin; piece < end && ok; piece++) {
        cut.area = m->sum + piece * keys;
        for (uint64_t f = faces * piece / m->pieces; f < faces * (piece + 1) / m->pieces && ok; f++)
            ok = measure_face(m, &cut, f);
    }
    area_cut_end(&cut);
    return ok ? EBPO_OK : ebpo_fail_memory(error, cut.ball_capacity * sizeof *cut.ball);
}

static ebpo_status measure_all(measure *m, ebpo_error *error)
{
    uint64_t keys = area_key_count(&m->keys);
    m->pieces = SUMS_MAX / keys;
    m->pieces = m->pieces < 1 ? 1 : m->pieces > PIECES_MAX ? PIECES_MAX : m->pieces;
    m->sum = ebpo_alloc_zero(m->pieces * keys, sizeof *m->sum);
    if (!m->sum)
        return ebpo_fail_memory(error, m->pieces * keys * sizeof *m->sum);
    ebpo_status status =
        ebpo_parallel_for(ebpo_thread_count(m->options->threads), NULL, m->pieces, 1,
                          measure_pieces, m, &m->options->progress, "measure", error);
    for (uint64_t piece = 1; piece < m->pieces && status == EBPO_OK; piece++)
        for (uint64_t k = 0; k < keys; k++) {
            const ebpo_paint_area *more = &m->sum[piece * keys + k];
            m->sum[k].lo += more->lo;
            m->sum[k].value += more->value;
            m->sum[k].hi += more->hi;
        }
    return status;
}

/* --- results --- */

static ebpo_paint_area *copy_areas(const ebpo_paint_area *from, uint64_t count)
{
    ebpo_paint_area *to = ebpo_alloc(count, sizeof *to);
    if (to)
        memcpy(to, from, count * sizeof *to);
    return to;
}

static ebpo_status pass_areas(measure *m, ebpo_paint_areas *out, ebpo_error *error)
{
    const ebpo_paint_area *strokes = m->sum, *colours = strokes + m->p->stroke_count,
                          *layers = colours + m->keys.colours;
    ebpo_paint_areas areas = EBPO_PAINT_AREAS_INIT;
    areas.all = layers[m->p->layer_count];
    areas.strokes = copy_areas(strokes, m->p->stroke_count);
    areas.layers = copy_areas(layers, m->p->layer_count);
    areas.faces = m->found_faces.count;
    areas.points_outside_subset = m->points_outside_subset;
    if (!areas.strokes || !areas.layers) {
        ebpo_paint_areas_free(&areas);
        return ebpo_fail_memory(error, m->p->stroke_count * sizeof *areas.strokes);
    }
    for (uint64_t i = 0; i < m->keys.colours; i++)
        m->colour[i].area = colours[i];
    areas.colour_count = m->keys.colours;
    areas.colours = m->colour;
    m->colour = NULL;
    EBPO_GIVE(ebpo_paint_areas, out, &areas);
    return EBPO_OK;
}

void ebpo_paint_areas_free(ebpo_paint_areas *areas)
{
    if (!areas)
        return;
    free(areas->layers);
    free(areas->strokes);
    free(areas->colours);
    size_t size = areas->struct_size;
    memset(areas, 0, sizeof *areas);
    areas->struct_size = size;
}

ebpo_status ebpo_paint_measure(const ebpo_paint *p, ebpo_context *context,
                               const ebpo_paint_options *options, ebpo_paint_areas *out,
                               ebpo_error *error)
{
    EBPO_DEFAULT_FP;
    ebpo_paint_options wanted = EBPO_PAINT_OPTIONS_INIT;
    measure m = { .p = p, .options = &wanted, .keys = { .p = p } };
    ebpo_status status = EBPO_TAKE(ebpo_paint_options, &wanted, options, error);
    if (status == EBPO_OK)
        status = EBPO_CHECK_SIZED(ebpo_paint_areas, out, error);
    if (status == EBPO_OK && (wanted.fineness < 1 || wanted.fineness > FINENESS_MAX))
        status = ebpo_fail(error, EBPO_E_ARGUMENT, "expected a fineness of areas from 1 to %d",
                           FINENESS_MAX);
    if (status == EBPO_OK)
        status = ebpo_paint_check_context(p, context, error);
    if (status == EBPO_OK)
        status = find_hits(&m, context, error);
    if (status == EBPO_OK)
        status = sort_hits(&m, error);
    if (status == EBPO_OK)
        status = find_colours(&m, error);
    if (status == EBPO_OK)
        status = measure_all(&m, error);
    if (status == EBPO_OK)
        status = pass_areas(&m, out, error);
    ebpo_found_faces_free(&m.found_faces);
    free(m.hit);
    free(m.first);
    free(m.keys.colour);
    free(m.colour);
    free(m.sum);
    return status;
}
