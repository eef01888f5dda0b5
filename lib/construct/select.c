/* Greedy selection: the plane that removes most volume first. Gains only shrink while the envelope
 * does, so a gain computed earlier bounds the present one, and most candidates are never evaluated
 * again (lazy evaluation). */
#include "core/strict_fp.h"

#include <math.h>
#include <string.h>

#include "geometry/plane_clip.h"
#include "geometry/plane_code.h"
#include "construct/planes.h"

typedef struct ranked {
    double gain; /* an upper bound; exact for the envelope of `round` */
    double n[3], d;
    uint32_t code;
    int round; /* -1: never evaluated */
} ranked;

/* Candidates that may still be worth a plane: by the volume that they remove (a heap), and by how
 * far the envelope reaches beyond them. */
typedef struct contest {
    ranked by_gain[EBPO_PLANES_CANDIDATES], by_reach[EBPO_PLANES_CANDIDATES];
    int gains, reaches;
} contest;

bool ebpo_candidate_plane(const ebpo_candidate *candidate, uint32_t *code, double n[3],
                          double *offset)
{
    int32_t v[3], d;
    if (!ebpo_plane_code_decode(ebpo_plane_code_make(candidate->normal, 0), v, &d))
        return false;
    int q = ebpo_plane_code_offset(v, candidate->support);
    if (q < 0)
        return false;
    *code = ebpo_plane_code_make(candidate->normal, q);
    ebpo_plane_code_decode(*code, v, &d);
    *offset = ebpo_plane_as_double(v, d, n);
    return true;
}

/* How far the envelope reaches along n. */
static void extent(const ebpo_polytope *p, const double n[3], double *least, double *most)
{
    double low = 1e300, high = -1e300;
    for (int i = 0; i < p->vertex_count; i++) {
        double e = n[0] * p->vertex[i][0] + n[1] * p->vertex[i][1] + n[2] * p->vertex[i][2];
        high = e > high ? e : high;
        low = e < low ? e : low;
    }
    *least = low;
    *most = high;
}

static double length_of(const double n[3]) { return sqrt(n[0] * n[0] + n[1] * n[1] + n[2] * n[2]); }

static void rank_candidates(const ebpo_polytope *envelope, double volume,
                            const ebpo_candidate *candidates, int count, double epsilon,
                            double reach, contest *c)
{
    c->gains = c->reaches = 0;
    for (int i = 0; i < count && i < EBPO_PLANES_CANDIDATES; i++) {
        ranked r = { .round = -1 };
        double least, most;
        if (!ebpo_candidate_plane(&candidates[i], &r.code, r.n, &r.d))
            continue;
        extent(envelope, r.n, &least, &most);
        r.gain = ebpo_polytope_cap_bound(volume, most - least, most - r.d);
        if (r.gain >= epsilon && r.gain > 0)
            c->by_gain[c->gains++] = r;
        if (reach > 0 && most - r.d > reach * length_of(r.n)) /* cutting only shortens it */
            c->by_reach[c->reaches++] = r;
    }
}

static bool before(const ranked *a, const ranked *b)
{
    return a->gain > b->gain || (a->gain == b->gain && a->code < b->code);
}

/* Restores the heap (greatest gain first) below item i. */
static void sift_down(ranked *heap, int count, int i)
{
    ranked item = heap[i];
    for (int child = 2 * i + 1; child < count; child = 2 * i + 1) {
        if (child + 1 < count && before(&heap[child + 1], &heap[child]))
            child++;
        if (!before(&heap[child], &item))
            break;
        heap[i] = heap[child];
        i = child;
    }
    heap[i] = item;
}

static void make_heap(ranked *heap, int count)
{
    for (int i = count / 2 - 1; i >= 0; i--)
        sift_down(heap, count, i);
}

static void drop_first(ranked *heap, int *count)
{
    heap[0] = heap[--*count];
    if (*count)
        sift_down(heap, *count, 0);
}

/* Volume alone leaves needles, which have next to none: cuts off what reaches far, farthest first.
 * A plane that clipping refuses is left out, and the next one tried. */
static int cut_needles(ebpo_polytope *envelope, contest *c, double reach, int most, int taken,
                       uint32_t *codes)
{
    while (taken < most && c->reaches > 0) {
        double deepest = reach;
        int which = -1, left = 0;
        for (int i = 0; i < c->reaches; i++) {
            double low, high;
            extent(envelope, c->by_reach[i].n, &low, &high);
            double depth = (high - c->by_reach[i].d) / length_of(c->by_reach[i].n);
            if (!(depth > reach))
                continue;
            c->by_reach[left] = c->by_reach[i];
            if (depth > deepest)
                deepest = depth, which = left;
            left++;
        }
        c->reaches = left;
        if (which < 0)
            break;
        ranked r = c->by_reach[which];
        memmove(&c->by_reach[which], &c->by_reach[which + 1],
                (size_t)(--c->reaches - which) * sizeof r);
        if (ebpo_polytope_clip(envelope, r.n, r.d, taken) == EBPO_CLIP_CUT)
            codes[taken++] = r.code;
    }
    return taken;
}

int ebpo_select_greedy(ebpo_polytope *envelope, const ebpo_choice *choice, uint32_t *codes)
{
    contest c;
    double epsilon = choice->epsilon, volume = ebpo_polytope_volume(envelope);
    int taken = 0, most = choice->most;
    rank_candidates(envelope, volume, choice->candidates, choice->count, epsilon, choice->reach,
                    &c);
    make_heap(c.by_gain, c.gains);
    while (c.gains > 0 && taken < most && volume - choice->core >= epsilon) {
        ranked *r = &c.by_gain[0];
        if (r->round != taken) {
            r->gain = ebpo_polytope_removed(envelope, r->n, r->d, volume, epsilon);
            r->round = taken;
            if (r->gain >= epsilon && r->gain > 0)
                sift_down(c.by_gain, c.gains, 0);
            else
                drop_first(c.by_gain, &c.gains);
            continue;
        }
        if (ebpo_polytope_clip(envelope, r->n, r->d, taken) == EBPO_CLIP_CUT) {
            codes[taken++] = r->code;
            volume -= r->gain;
        }
        drop_first(c.by_gain, &c.gains);
    }
    return cut_needles(envelope, &c, choice->reach, most, taken, codes);
}

/* Share of the cell below which a derived plane is not worth the time of a clip. */
static const double hardly_anything = 3e-4;

int ebpo_select_all(ebpo_polytope *envelope, const ebpo_candidate *candidates, int count, int most,
                    uint32_t *codes)
{
    contest c;
    int taken = 0;
    rank_candidates(envelope, ebpo_polytope_volume(envelope), candidates, count, hardly_anything,
                    ebpo_needle, &c);
    make_heap(c.by_gain, c.gains);
    for (; c.gains > 0 && taken < most; drop_first(c.by_gain, &c.gains))
        if (ebpo_polytope_clip(envelope, c.by_gain[0].n, c.by_gain[0].d, taken) == EBPO_CLIP_CUT)
            codes[taken++] = c.by_gain[0].code;
    return cut_needles(envelope, &c, ebpo_needle, most, taken, codes);
}
