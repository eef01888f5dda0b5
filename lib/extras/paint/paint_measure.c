/* How much of the surface is painted. Faces are shared out to a fixed number of pieces of work,
 * whose sums are added in order: the result does not depend on threads. */
#include "core/strict_fp.h"

#include <ebpo/paint.h>

#include <stdlib.h>
#include <string.h>

#include "core/alloc.h"
#include "core/error.h"
#include "core/fp_env.h"
#include "core/parallel.h"
#include "extras/paint/area_cut.h"
#include "extras/paint/met_faces.h"
#include "extras/paint/paint_reach.h"

enum { PIECES_MOST = 64, SUMS_MOST = 1 << 22, FINENESS_MOST = 1 << 16 };

/* A point's reach has a face. */
typedef struct hit {
    uint32_t face, layer, stroke, point; /* face: among those met; point: of all */
} hit;

typedef struct measure {
    const ebpo_paint *p;
    const ebpo_paint_options *options;
    ebpo_met_faces met;
    hit *hit;
    uint64_t hit_count, hit_capacity, elsewhere;
    uint64_t *first; /* [met.count + 1] of a face's hits */
    ebpo_area_keys keys;
    ebpo_paint_colour_area *colour; /* [keys.colours] */
    uint64_t pieces;
    ebpo_paint_area *sum; /* [pieces][keys] */
} measure;

/* --- who reaches what --- */

static ebpo_status add_point(measure *m, ebpo_reach *reach, uint32_t stroke, uint32_t point,
                             ebpo_error *error)
{
    if (!ebpo_grow(&m->hit, &m->hit_capacity, m->hit_count + reach->count, sizeof *m->hit))
        return ebpo_fail_memory(error, (m->hit_count + reach->count) * sizeof *m->hit);
    for (uint64_t i = 0; i < reach->count; i++) {
        hit *h = &m->hit[m->hit_count];
        ebpo_status status = ebpo_met_faces_add(&m->met, &reach->face[i], &h->face, error);
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
    ebpo_reach reach;
    ebpo_status status = EBPO_OK;
    ebpo_reach_begin(&reach, context);
    for (uint32_t s = 0; s < p->stroke_count && status == EBPO_OK; s++)
        for (uint32_t i = 0; i < p->stroke[s].count && status == EBPO_OK; i++) {
            bool here;
            uint64_t point = p->stroke[s].first + i;
            if (point % 256 == 0 &&
                !ebpo_progress_step(&m->options->progress, "reach", point, p->point_count, error))
                status = EBPO_E_CANCELLED;
            if (status == EBPO_OK)
                status = ebpo_paint_reach(&reach, p, s, i, &here, error);
            if (status == EBPO_OK && here)
                status = add_point(m, &reach, s, (uint32_t)point, error);
            m->elsewhere += status == EBPO_OK && !here;
        }
    ebpo_reach_end(&reach);
    return status;
}

/* By face, then layer, the last stroke first. */
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
    m->first = ebpo_alloc_zero(m->met.count + 1, sizeof *m->first);
    if (!m->first)
        return ebpo_fail_memory(error, m->met.count * sizeof *m->first);
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

static ebpo_paint_colour_area colour_of(const ebpo_stroke_held *s)
{
    return (ebpo_paint_colour_area){ .layer = s->layer, .colour = ebpo_paint_pack(s->rgba) };
}

/* Those of strokes that paint, each once in its layer. */
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

static bool measure_face(measure *m, ebpo_area_cut *cut, uint64_t face)
{
    const ebpo_paint *p = m->p;
    uint64_t begin = m->first[face], count = m->first[face + 1] - begin;
    if (!ebpo_grow(&cut->ball, &cut->ball_capacity, count, sizeof *cut->ball))
        return false;
    for (uint64_t i = 0; i < count; i++) {
        const hit *h = &m->hit[begin + i];
        const ebpo_paint_point *q = &p->point[h->point];
        cut->ball[i] = (ebpo_area_ball){ { q->place[0], q->place[1], q->place[2] },
                                         ebpo_paint_radius(&p->stroke[h->stroke], q),
                                         h->layer,
                                         h->stroke };
    }
    return ebpo_area_cut_face(cut, (const double(*)[3])m->met.face[face].corner, count);
}

static ebpo_status measure_pieces(void *context, uint64_t begin, uint64_t end, unsigned worker,
                                  ebpo_error *error)
{
    measure *m = context;
    ebpo_area_cut cut;
    uint64_t faces = m->met.count, keys = ebpo_area_key_count(&m->keys);
    (void)worker;
    bool fine = ebpo_area_cut_begin(&cut, &m->keys, m->options->fineness);
    for (uint64_t piece = begin; piece < end && fine; piece++) {
        cut.area = m->sum + piece * keys;
        for (uint64_t f = faces * piece / m->pieces; f < faces * (piece + 1) / m->pieces && fine;
             f++)
            fine = measure_face(m, &cut, f);
    }
    ebpo_area_cut_end(&cut);
    return fine ? EBPO_OK : ebpo_fail_memory(error, cut.ball_capacity * sizeof *cut.ball);
}

static ebpo_status measure_all(measure *m, ebpo_error *error)
{
    uint64_t keys = ebpo_area_key_count(&m->keys);
    m->pieces = SUMS_MOST / keys;
    m->pieces = m->pieces < 1 ? 1 : m->pieces > PIECES_MOST ? PIECES_MOST : m->pieces;
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

/* --- what is given --- */

static ebpo_paint_area *copy_areas(const ebpo_paint_area *from, uint64_t count)
{
    ebpo_paint_area *to = ebpo_alloc(count, sizeof *to);
    if (to)
        memcpy(to, from, count * sizeof *to);
    return to;
}

static ebpo_status give(measure *m, ebpo_paint_areas *out, ebpo_error *error)
{
    const ebpo_paint_area *strokes = m->sum, *colours = strokes + m->p->stroke_count,
                          *layers = colours + m->keys.colours;
    ebpo_paint_areas own = EBPO_PAINT_AREAS_INIT;
    own.all = layers[m->p->layer_count];
    own.strokes = copy_areas(strokes, m->p->stroke_count);
    own.layers = copy_areas(layers, m->p->layer_count);
    own.faces = m->met.count;
    own.elsewhere = m->elsewhere;
    if (!own.strokes || !own.layers) {
        ebpo_paint_areas_free(&own);
        return ebpo_fail_memory(error, m->p->stroke_count * sizeof *own.strokes);
    }
    for (uint64_t i = 0; i < m->keys.colours; i++)
        m->colour[i].area = colours[i];
    own.colour_count = m->keys.colours;
    own.colours = m->colour;
    m->colour = NULL;
    EBPO_GIVE(ebpo_paint_areas, out, &own);
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
    if (status == EBPO_OK && (wanted.fineness < 1 || wanted.fineness > FINENESS_MOST))
        status =
            ebpo_fail(error, EBPO_E_ARGUMENT, "the fineness of areas is 1 to %d", FINENESS_MOST);
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
        status = give(&m, out, error);
    ebpo_met_faces_free(&m.met);
    free(m.hit);
    free(m.first);
    free(m.keys.colour);
    free(m.colour);
    free(m.sum);
    return status;
}
