/* Greedy selection: the plane that removes most volume first. Gains only shrink while the envelope does, so a gain computed
 * earlier bounds today's and most candidates are never looked at again (lazy evaluation). */
#include "geom/strict_fp.h"

#include <math.h>

#include "geom/plane_code.h"
#include "planes/planes.h"

typedef struct ranked {
    double gain; /* an upper bound; exact for the envelope of `round` */
    double n[3], d;
    uint32_t code;
    int round; /* -1: never evaluated */
} ranked;

/* Upper bound of the volume beyond a plane, much cheaper than the volume itself: among convex bodies of volume V and width H the cap of height h is largest for the cone with its base on the far side,
 * V (1 - (1 - h/H)^3). */
static double cap_bound(const ebpo_polytope *p, double volume, const double n[3], double d)
{
    double most = -1e300, least = 1e300;
    for (int i = 0; i < p->vertex_count; i++) {
        double e = n[0] * p->vertex[i][0] + n[1] * p->vertex[i][1] + n[2] * p->vertex[i][2];
        most = e > most ? e : most;
        least = e < least ? e : least;
    }
    double h = most - d, width = most - least;
    if (!(h > 1e-9) || !(width > 0))
        return 0;
    double left = h < width ? 1 - h / width : 0;
    return volume * (1 - left * left * left);
}

bool ebpo_candidate_plane(const ebpo_candidate *candidate, uint32_t *code, double n[3], double *offset)
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

static int rank_candidates(const ebpo_polytope *envelope, const ebpo_candidate *candidates, int count, double epsilon, ranked *out)
{
    double volume = ebpo_polytope_volume(envelope);
    int kept = 0;
    for (int i = 0; i < count && i < EBPO_PLANES_CANDIDATES; i++) {
        ranked r = { .round = -1 };
        if (!ebpo_candidate_plane(&candidates[i], &r.code, r.n, &r.d))
            continue;
        r.gain = cap_bound(envelope, volume, r.n, r.d);
        if (r.gain >= epsilon && r.gain > 0)
            out[kept++] = r;
    }
    return kept;
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

static double depth_of(const ebpo_polytope *p, const double n[3], double d)
{
    double most = -1e300;
    for (int i = 0; i < p->vertex_count; i++) {
        double e = n[0] * p->vertex[i][0] + n[1] * p->vertex[i][1] + n[2] * p->vertex[i][2];
        most = e > most ? e : most;
    }
    return (most - d) / sqrt(n[0] * n[0] + n[1] * n[1] + n[2] * n[2]);
}

/* Volume alone leaves needles, which have next to none: cuts off what reaches far, farthest first. A plane that clipping refuses is left out, and the next one tried. */
static int cut_needles(ebpo_polytope *envelope, const ebpo_choice *choice, int taken, uint32_t *codes)
{
    bool refused[EBPO_PLANES_CANDIDATES] = { false };
    while (taken < choice->most) {
        double deepest = choice->reach, best[3] = { 0, 0, 0 }, at = 0;
        uint32_t code = 0;
        int which = -1;
        for (int i = 0; i < choice->count; i++) {
            double n[3], offset;
            uint32_t c;
            if (refused[i] || !ebpo_candidate_plane(&choice->candidates[i], &c, n, &offset))
                continue;
            double depth = depth_of(envelope, n, offset);
            if (depth > deepest) {
                deepest = depth, at = offset, code = c, which = i;
                best[0] = n[0], best[1] = n[1], best[2] = n[2];
            }
        }
        if (which < 0)
            break;
        if (ebpo_polytope_clip(envelope, best, at, taken) == EBPO_CLIP_CUT)
            codes[taken++] = code;
        else
            refused[which] = true;
    }
    return taken;
}

int ebpo_select_greedy(ebpo_polytope *envelope, const ebpo_choice *choice, uint32_t *codes)
{
    ranked heap[EBPO_PLANES_CANDIDATES];
    double epsilon = choice->epsilon;
    int left = rank_candidates(envelope, choice->candidates, choice->count, epsilon, heap), taken = 0, most = choice->most;
    make_heap(heap, left);
    while (left > 0 && taken < most) {
        ranked *r = &heap[0];
        if (r->round != taken) {
            r->gain = ebpo_polytope_removed(envelope, r->n, r->d);
            r->round = taken;
            if (r->gain >= epsilon && r->gain > 0)
                sift_down(heap, left, 0);
            else
                drop_first(heap, &left);
            continue;
        }
        if (ebpo_polytope_clip(envelope, r->n, r->d, taken) == EBPO_CLIP_CUT)
            codes[taken++] = r->code;
        drop_first(heap, &left);
    }
    return choice->reach > 0 ? cut_needles(envelope, choice, taken, codes) : taken;
}

/* Share of the cell below which a derived plane is not worth the time of a clip. */
static const double hardly_anything = 3e-4;

int ebpo_select_all(ebpo_polytope *envelope, const ebpo_candidate *candidates, int count, int most, uint32_t *codes)
{
    ranked heap[EBPO_PLANES_CANDIDATES];
    int left = rank_candidates(envelope, candidates, count, hardly_anything, heap), taken = 0;
    make_heap(heap, left);
    for (; left > 0 && taken < most; drop_first(heap, &left))
        if (ebpo_polytope_clip(envelope, heap[0].n, heap[0].d, taken) == EBPO_CLIP_CUT)
            codes[taken++] = heap[0].code;
    return cut_needles(envelope, &(ebpo_choice){ .candidates = candidates, .count = count, .most = most, .reach = ebpo_needle }, taken, codes);
}

void ebpo_planes_cut(ebpo_polytope *envelope, const uint32_t *codes, uint64_t count)
{
    for (uint64_t i = 0; i < count; i++) {
        int32_t v[3], d;
        double n[3];
        if (!ebpo_plane_code_decode(codes[i], v, &d))
            continue;
        double offset = ebpo_plane_as_double(v, d, n);
        (void)ebpo_polytope_clip(envelope, n, offset, (int32_t)i);
    }
}
