/* Selects the planes of an envelope from candidates. There is one function for each ebpo_selection;
 * the table at the end lists them. Names and settings of selections are in format/head_facts.c;
 * CONTRIBUTING.md describes how to add a selection.
 *
 * - greedy (EBPO_SELECT_INHERIT): the plane that removes the most volume is chosen first. The
 *   volume that a plane removes is its gain. When other planes cut the envelope, the gain of a
 *   candidate can only become smaller. So a gain that was computed earlier is an upper bound, and
 *   most candidates are evaluated only once (lazy evaluation). A choice by volume alone would leave
 *   needles: long, thin portions of the envelope with little volume. So planes that cut off needles
 *   are added at the end.
 * - random, offset, k-medoids: the selections of the theses (EBP 2017, 3.3.4.3; BP 2008, 3.4.2).
 *   They choose a given number of candidates, and do not compute gains.
 *
 * A selection clips the given envelope and returns the codes of its planes. Results depend on the
 * arguments alone; random choices use the seed of the node. */
#include "core/strict_fp.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "construct/planes.h"
#include "core/alloc.h"
#include "core/hash.h"
#include "geometry/polytope.h"
#include "geometry/vec3.h"

/* --- greedy --- */

/* A candidate's half-space n . x <= d, in cell coordinates. */
typedef struct ranked {
    double gain; /* upper bound of the volume that the plane removes */
    double n[3], d;
    uint32_t code;
    /* number of planes that were taken when the gain was last computed exactly; -1: not yet */
    int round;
} ranked;

/* Candidates that may still be chosen. */
typedef struct ranking {
    ranked by_gain[EBPO_PLANES_CANDIDATES]; /* heap; the greatest gain is the first element */
    ranked needle[EBPO_PLANES_CANDIDATES];  /* planes beyond which the envelope extends far */
    int gains, needles;                     /* numbers of elements of by_gain and of needle */
} ranking;

/* Sets `code`, `n` and `offset` to the plane of a candidate, with the least offset that a plane
 * code can store and that is at least the candidate's support. Returns false if there is no such
 * offset. */
static bool candidate_plane(const ebpo_candidate *candidate, uint32_t *code, double n[3],
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

/* Computes the least and the greatest n . x over the points x of the envelope. */
static void envelope_extent(const ebpo_polytope *p, const double n[3], double *least,
                            double *greatest)
{
    double low = 1e300, high = -1e300;
    for (int i = 0; i < p->vertex_count; i++) {
        double e = ebpo_vec3_dot(n, p->vertex[i]);
        high = e > high ? e : high;
        low = e < low ? e : low;
    }
    *least = low;
    *greatest = high;
}

/* Makes the lists by_gain and needle of `c`. `volume`: volume of the envelope. `epsilon`,
 * `needle_length`: as in ebpo_choice. */
static void rank_candidates(const ebpo_polytope *envelope, double volume,
                            const ebpo_candidate *candidates, int count, double epsilon,
                            double needle_length, ranking *c)
{
    c->gains = c->needles = 0;
    for (int i = 0; i < count && i < EBPO_PLANES_CANDIDATES; i++) {
        ranked r = { .round = -1 };
        double least, greatest;
        if (!candidate_plane(&candidates[i], &r.code, r.n, &r.d))
            continue;
        envelope_extent(envelope, r.n, &least, &greatest);
        r.gain = ebpo_polytope_cap_bound(volume, greatest - least, greatest - r.d);
        if (r.gain >= epsilon && r.gain > 0)
            c->by_gain[c->gains++] = r;
        /* cuts by other planes only reduce how far the envelope extends beyond this plane, so no
         * candidate has to be added to `needle` later */
        if (needle_length > 0 && greatest - r.d > needle_length * ebpo_vec3_length(r.n))
            c->needle[c->needles++] = r;
    }
}

/* Returns true if `a` is nearer to the top of the heap than `b`. */
static bool ranks_before(const ranked *a, const ranked *b)
{
    return a->gain > b->gain || (a->gain == b->gain && a->code < b->code);
}

/* Restores the order of the heap below element i. */
static void sift_down(ranked *heap, int count, int i)
{
    ranked item = heap[i];
    for (int child = 2 * i + 1; child < count; child = 2 * i + 1) {
        if (child + 1 < count && ranks_before(&heap[child + 1], &heap[child]))
            child++;
        if (!ranks_before(&heap[child], &item))
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

/* Cuts off needles (long, thin portions of the envelope), the longest first. `taken`: number of
 * codes so far. Returns the new number of codes. */
static int cut_needles(ebpo_polytope *envelope, ranking *c, double needle_length, int codes_max,
                       int taken, uint32_t *codes)
{
    while (taken < codes_max && c->needles > 0) {
        double deepest = needle_length;
        int which = -1, kept = 0;
        for (int i = 0; i < c->needles; i++) {
            double low, high;
            envelope_extent(envelope, c->needle[i].n, &low, &high);
            double depth = (high - c->needle[i].d) / ebpo_vec3_length(c->needle[i].n);
            if (!(depth > needle_length))
                continue;
            c->needle[kept] = c->needle[i];
            if (depth > deepest)
                deepest = depth, which = kept;
            kept++;
        }
        c->needles = kept;
        if (which < 0)
            break;
        ranked r = c->needle[which];
        memmove(&c->needle[which], &c->needle[which + 1],
                (size_t)(--c->needles - which) * sizeof r);
        if (ebpo_polytope_clip(envelope, r.n, r.d, taken) == EBPO_CLIP_CUT)
            codes[taken++] = r.code;
    }
    return taken;
}

int ebpo_select_greedy(ebpo_polytope *envelope, const ebpo_choice *choice, uint32_t *codes)
{
    ranking c;
    double epsilon = choice->epsilon, volume = ebpo_polytope_volume(envelope);
    int taken = 0;
    rank_candidates(envelope, volume, choice->candidates, choice->count, epsilon,
                    choice->needle_length, &c);
    make_heap(c.by_gain, c.gains);
    while (c.gains > 0 && taken < choice->codes_max && volume - choice->hull_volume >= epsilon) {
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
    return cut_needles(envelope, &c, choice->needle_length, choice->codes_max, taken, codes);
}

/* Least volume, in cells, that a plane must remove in ebpo_select_all. Readers use this function to
 * derive planes; for less volume, a plane is not worth the time of a clip. */
static const double least_gain = 3e-4;

int ebpo_select_all(ebpo_polytope *envelope, const ebpo_candidate *candidates, int count,
                    int codes_max, uint32_t *codes)
{
    ranking c;
    int taken = 0;
    rank_candidates(envelope, ebpo_polytope_volume(envelope), candidates, count, least_gain,
                    ebpo_needle, &c);
    make_heap(c.by_gain, c.gains);
    for (; c.gains > 0 && taken < codes_max; drop_first(c.by_gain, &c.gains))
        if (ebpo_polytope_clip(envelope, c.by_gain[0].n, c.by_gain[0].d, taken) == EBPO_CLIP_CUT)
            codes[taken++] = c.by_gain[0].code;
    return cut_needles(envelope, &c, ebpo_needle, codes_max, taken, codes);
}

/* --- the selections of the theses --- */

/* Clips the envelope by the chosen candidates, in ascending order of their indices. Omits
 * candidates that cut off nothing. Returns the number of codes. ebpo_selection_wanted ensures that
 * at most choice->codes_max candidates are chosen, so the loop never ends before the last chosen
 * candidate. (Candidates are sorted by direction. If the loop could end earlier, the omitted planes
 * would all have similar directions.) */
static int clip_by_chosen(ebpo_polytope *envelope, const ebpo_choice *choice, const bool *chosen,
                          uint32_t *codes)
{
    int taken = 0;
    for (int i = 0; i < choice->count && taken < choice->codes_max; i++) {
        double n[3], offset;
        uint32_t code;
        if (!chosen[i] || !candidate_plane(&choice->candidates[i], &code, n, &offset))
            continue;
        if (ebpo_polytope_clip(envelope, n, offset, taken) == EBPO_CLIP_CUT)
            codes[taken++] = code;
    }
    return taken;
}

/* --- random --- */

/* Chooses consecutive candidates in the order of the node's faces or children, beginning with a
 * random candidate (EBP 2017, 3.3.4.3). (The array of candidates is sorted by direction, so
 * consecutive elements of the array would all face to one side.) */
static bool choose_random(const ebpo_choice *choice, bool *chosen)
{
    uint64_t state = choice->seed, first = ebpo_random_next(&state) % (uint64_t)choice->count;
    for (int i = 0; i < choice->wanted && i < choice->count; i++) {
        uint64_t at = (first + (uint64_t)i) % (uint64_t)choice->count;
        chosen[choice->order ? choice->order[at] : (int)at] = true;
    }
    return true;
}

/* --- least offset --- */

typedef struct moved {
    double by;
    int which;
} moved;

static int by_offset(const void *a, const void *b)
{
    const moved *x = a, *y = b;
    if (x->by != y->by)
        return x->by < y->by ? -1 : 1;
    return x->which - y->which;
}

static bool choose_offset(const ebpo_choice *choice, bool *chosen)
{
    moved *order = ebpo_alloc((uint64_t)choice->count, sizeof *order);
    if (!order)
        return false;
    for (int i = 0; i < choice->count; i++)
        order[i] = (moved){ choice->candidates[i].moved, i };
    qsort(order, (size_t)choice->count, sizeof *order, by_offset);
    for (int i = 0; i < choice->wanted && i < choice->count; i++)
        chosen[order[i].which] = true;
    free(order);
    return true;
}

/* --- k-medoids: the algorithm PAM, which the theses cite from Ng and Han 1994. It chooses k
 * candidates (medoids) so that the cost is small: the sum of the squared distances of all
 * candidates from their nearest medoids. In each step, a candidate replaces a medoid (a swap); the
 * algorithm ends when no swap lowers the cost. One pass over the candidates finds the best medoid
 * that a given candidate can replace, and the swap is made at once if it lowers the cost (Schubert
 * and Rousseeuw 2021). PAM evaluates all candidates before each swap; with thousands of medoids
 * that takes hours, and ends at the same kind of minimum. --- */

typedef struct clustering {
    int count, wanted;
    double (*at)[3]; /* [count] normals as points (place_normal) */
    float *distance; /* [count][count] squared distances; NULL: `row` is used */
    float *row;      /* [count] squared distances of one candidate from all candidates */
    int *medoid;     /* [wanted] index of the candidate that is this medoid */
    bool *chosen;    /* [count] the candidate is a medoid; the caller's array */
    /* [count] the nearest and the second nearest medoid: indices in `medoid` */
    int *nearest, *runner_up;
    /* [count] squared distances from the nearest and the second nearest medoid */
    float *first, *second;
    double *removal; /* [wanted] increase of the cost if the medoid is removed */
    /* [wanted] change of the cost if candidate `h` of best_swap_for replaces the medoid, without a
     * term that is equal for all medoids */
    double *change;
} clustering;

/* Returns the angle of the vector (x, y) from the x axis, -pi .. pi, with an error of about 1e-15.
 * Does not use libm: its implementations round differently, and all machines must choose the same
 * planes. */
static double angle_of(double y, double x)
{
    double least = fmin(fabs(x), fabs(y)), most = fmax(fabs(x), fabs(y));
    if (!(most > 0))
        return 0;
    /* the loop halves the angle atan t twice: atan t = 2 atan (t / (1 + sqrt (1 + t^2))) */
    double t = least / most;
    for (int i = 0; i < 2; i++)
        t /= 1 + sqrt(1 + t * t);
    double square = t * t, sum = 0;
    for (int power = 21; power > 0; power -= 2)
        sum = 1.0 / power - square * sum;
    double angle = 4 * t * sum;
    if (fabs(y) > fabs(x))
        angle = 0x1.921fb54442d18p0 - angle;
    if (x < 0)
        angle = 0x1.921fb54442d18p1 - angle;
    return y < 0 ? -angle : angle;
}

/* Converts a normal in cell coordinates to a point. The distance between two such points is the
 * distance of their normals. For EBPO_NORMALS_ANGLE, the point is the unit normal in the model's
 * coordinates. Otherwise its coordinates are the two angles of the theses. */
static void place_normal(const ebpo_choice *choice, uint32_t normal, double out[3])
{
    int32_t n[3], d;
    double square = 0, greatest = 0;
    ebpo_plane_code_decode(ebpo_plane_code_make(normal, 0), n, &d);
    for (int k = 0; k < 3; k++) {
        out[k] = n[k] / choice->cell_size[k];
        greatest = fmax(greatest, fabs(out[k]));
    }
    for (int k = 0; k < 3; k++) {
        out[k] /= greatest;
        square += out[k] * out[k];
    }
    for (int k = 0; k < 3; k++)
        out[k] /= sqrt(square);
    if (choice->normals == EBPO_NORMALS_ANGLE)
        return;
    double azimuth = angle_of(out[1], out[0]),
           polar = angle_of(sqrt(out[0] * out[0] + out[1] * out[1]), out[2]);
    out[0] = azimuth, out[1] = polar, out[2] = 0;
}

/* Maximum number of candidates for which the distances of all pairs are stored. */
enum { DISTANCES_KEPT = 4096 };

/* Returns the squared distance of the candidates i and j. */
static float distance_between(const clustering *c, int i, int j)
{
    double x = c->at[i][0] - c->at[j][0], y = c->at[i][1] - c->at[j][1],
           z = c->at[i][2] - c->at[j][2];
    return (float)(x * x + y * y + z * z);
}

/* Sets row[j] to the squared distance of the candidates i and j. */
static void compute_row(const clustering *c, int i, float *row)
{
    for (int j = 0; j < c->count; j++)
        row[j] = distance_between(c, i, j);
}

/* Returns the squared distances of candidate i from all candidates, valid until the next call. */
static const float *distances_of(clustering *c, int i)
{
    if (c->distance)
        return c->distance + (size_t)i * (size_t)c->count;
    compute_row(c, i, c->row);
    return c->row;
}

/* Allocates the arrays, and computes points and distances. Returns false when out of memory. */
static bool clustering_make(clustering *c, const ebpo_choice *choice, bool *chosen)
{
    uint64_t n = (uint64_t)choice->count, k = (uint64_t)choice->wanted;
    bool kept = n <= DISTANCES_KEPT;
    *c = (clustering){ .count = choice->count,
                       .wanted = choice->wanted,
                       .at = ebpo_alloc(n, sizeof *c->at),
                       .distance = kept ? ebpo_alloc(n * n, sizeof *c->distance) : NULL,
                       .row = ebpo_alloc(n, sizeof *c->row),
                       .medoid = ebpo_alloc(k, sizeof *c->medoid),
                       .chosen = chosen,
                       .nearest = ebpo_alloc(n, sizeof *c->nearest),
                       .runner_up = ebpo_alloc(n, sizeof *c->runner_up),
                       .first = ebpo_alloc(n, sizeof *c->first),
                       .second = ebpo_alloc(n, sizeof *c->second),
                       .removal = ebpo_alloc(k, sizeof *c->removal),
                       .change = ebpo_alloc(k, sizeof *c->change) };
    bool good = c->at && (c->distance || !kept) && c->row && c->medoid && c->nearest &&
                c->runner_up && c->first && c->second && c->removal && c->change;
    for (uint64_t i = 0; i < n && good; i++)
        place_normal(choice, choice->candidates[i].normal, c->at[i]);
    for (uint64_t i = 0; i < n && good && kept; i++)
        compute_row(c, (int)i, c->distance + i * n);
    return good;
}

static void clustering_free(clustering *c)
{
    free(c->at);
    free(c->distance);
    free(c->row);
    free(c->medoid);
    free(c->nearest);
    free(c->runner_up);
    free(c->first);
    free(c->second);
    free(c->removal);
    free(c->change);
}

/* Chooses the first medoids. */
static void choose_at_random(clustering *c, uint64_t seed)
{
    for (int i = 0; i < c->wanted; i++) {
        int at = (int)(ebpo_random_next(&seed) % (uint64_t)c->count);
        while (c->chosen[at])
            at = at + 1 < c->count ? at + 1 : 0;
        c->chosen[at] = true;
        c->medoid[i] = at;
    }
}

/* Makes medoid m, at the squared distance d, one of the two nearest medoids of candidate i if it is
 * nearer than one of them. */
static void compare_medoid(clustering *c, int i, int m, float d)
{
    if (d < c->first[i]) {
        c->second[i] = c->first[i];
        c->runner_up[i] = c->nearest[i];
        c->first[i] = d;
        c->nearest[i] = m;
    } else if (d < c->second[i]) {
        c->second[i] = d;
        c->runner_up[i] = m;
    }
}

/* Finds the two nearest medoids of candidate i. */
static void assign_medoids(clustering *c, int i)
{
    c->first[i] = c->second[i] = INFINITY;
    c->nearest[i] = c->runner_up[i] = 0;
    for (int m = 0; m < c->wanted; m++)
        compare_medoid(c, i, m, distance_between(c, i, c->medoid[m]));
}

/* Computes the change of the cost by the removal of each medoid. */
static void sum_removals(clustering *c)
{
    memset(c->removal, 0, (size_t)c->wanted * sizeof *c->removal);
    for (int i = 0; i < c->count; i++)
        c->removal[c->nearest[i]] += (double)c->second[i] - (double)c->first[i];
}

/* Returns the least change of the cost if candidate `h` replaces a medoid, and sets *which to the
 * index of this medoid. */
static double best_swap_for(clustering *c, int h, int *which)
{
    const float *row = distances_of(c, h);
    double shared = 0;
    memcpy(c->change, c->removal, (size_t)c->wanted * sizeof *c->change);
    for (int i = 0; i < c->count; i++) {
        float d = row[i];
        if (d < c->first[i]) {
            shared += (double)d - (double)c->first[i];
            c->change[c->nearest[i]] += (double)c->first[i] - (double)c->second[i];
        } else if (d < c->second[i])
            c->change[c->nearest[i]] += (double)d - (double)c->second[i];
    }
    *which = 0;
    for (int m = 1; m < c->wanted; m++)
        if (c->change[m] < c->change[*which])
            *which = m;
    return c->change[*which] + shared;
}

/* Replaces medoid m by candidate h. */
static void swap_medoid(clustering *c, int m, int h)
{
    const float *row = distances_of(c, h);
    c->chosen[c->medoid[m]] = false;
    c->chosen[h] = true;
    c->medoid[m] = h;
    for (int i = 0; i < c->count; i++)
        if (c->nearest[i] == m || c->runner_up[i] == m)
            assign_medoids(c, i);
        else
            compare_medoid(c, i, m, row[i]);
    sum_removals(c);
}

/* Swaps until no candidate can replace a medoid at a lower cost. */
static void improve_medoids(clustering *c)
{
    /* each swap lowers the cost; the limit prevents an endless loop caused by rounding errors */
    enum { SWAPS_MAX = 10000000 };
    for (int i = 0; i < c->count; i++)
        assign_medoids(c, i);
    sum_removals(c);
    int swaps = 0, unchanged = 0; /* unchanged: number of candidates since the last swap */
    for (int h = 0; unchanged < c->count && swaps < SWAPS_MAX; h = h + 1 < c->count ? h + 1 : 0) {
        int m;
        unchanged++;
        /* a change nearer to 0 than 1e-9 is a rounding error */
        if (c->chosen[h] || !(best_swap_for(c, h, &m) < -1e-9))
            continue;
        swap_medoid(c, m, h);
        swaps++;
        unchanged = 0;
    }
}

/* Finds the best medoid if only one is wanted. (A swap needs a second nearest medoid.) */
static void single_medoid(clustering *c)
{
    double best = INFINITY;
    memset(c->chosen, 0, (size_t)c->count * sizeof *c->chosen);
    int at = 0;
    for (int h = 0; h < c->count; h++) {
        const float *row = distances_of(c, h);
        double sum = 0;
        for (int i = 0; i < c->count; i++)
            sum += (double)row[i];
        if (sum < best)
            best = sum, at = h;
    }
    c->chosen[at] = true;
}

/* Chooses by k-medoids, from random first medoids. Returns false when out of memory. */
static bool choose_kmedoids(const ebpo_choice *choice, bool *chosen)
{
    ebpo_choice all = *choice;
    if (choice->wanted < 1)
        return true;
    all.wanted = choice->wanted < choice->count ? choice->wanted : choice->count;
    clustering c;
    bool good = clustering_make(&c, &all, chosen);
    if (good) {
        choose_at_random(&c, choice->seed);
        if (all.wanted == 1)
            single_medoid(&c);
        else if (all.wanted < all.count)
            improve_medoids(&c);
    }
    clustering_free(&c);
    return good;
}

/* --- the table --- */

/* Chooses candidates for a selection of the theses. There must be at least one candidate. Returns
 * false when out of memory. */
typedef bool (*choose_fn)(const ebpo_choice *choice, bool *chosen);

static const choose_fn choosers[EBPO_SELECTION_COUNT] = {
    [EBPO_SELECT_KMEDOIDS] = choose_kmedoids,
    [EBPO_SELECT_OFFSET] = choose_offset,
    [EBPO_SELECT_RANDOM] = choose_random,
};

bool ebpo_choose_candidates(ebpo_selection selection, const ebpo_choice *choice, bool *chosen)
{
    memset(chosen, 0, (size_t)choice->count * sizeof *chosen);
    return !choice->count || choosers[selection](choice, chosen);
}

/* Does the work of the selections of the theses (ebpo_select_fn). */
static int select_as_theses(ebpo_selection selection, ebpo_polytope *envelope,
                            const ebpo_choice *choice, uint32_t *codes)
{
    bool *chosen = ebpo_alloc((uint64_t)choice->count + 1, sizeof *chosen);
    int taken = -1;
    if (chosen && ebpo_choose_candidates(selection, choice, chosen))
        taken = clip_by_chosen(envelope, choice, chosen, codes);
    free(chosen);
    return taken;
}

static int select_kmedoids(ebpo_polytope *envelope, const ebpo_choice *choice, uint32_t *codes)
{
    return select_as_theses(EBPO_SELECT_KMEDOIDS, envelope, choice, codes);
}

static int select_offset(ebpo_polytope *envelope, const ebpo_choice *choice, uint32_t *codes)
{
    return select_as_theses(EBPO_SELECT_OFFSET, envelope, choice, codes);
}

static int select_random(ebpo_polytope *envelope, const ebpo_choice *choice, uint32_t *codes)
{
    return select_as_theses(EBPO_SELECT_RANDOM, envelope, choice, codes);
}

static const ebpo_select_fn selection_functions[] = {
    [EBPO_SELECT_INHERIT] = ebpo_select_greedy,
    [EBPO_SELECT_KMEDOIDS] = select_kmedoids,
    [EBPO_SELECT_OFFSET] = select_offset,
    [EBPO_SELECT_RANDOM] = select_random,
};
_Static_assert(sizeof selection_functions / sizeof *selection_functions == EBPO_SELECTION_COUNT,
               "each selection of ebpo/build.h needs a line in this table");

ebpo_select_fn ebpo_selection_function(ebpo_selection selection)
{
    return (unsigned)selection < EBPO_SELECTION_COUNT ? selection_functions[selection] : NULL;
}

int ebpo_selection_requested(int count, int level, double percent, double k_root)
{
    if (!(k_root > 0))
        return (int)ceil(count * percent / 100);
    double k = ldexp(k_root, -level);
    if (k < 1)
        return count;
    while (k >= count && k >= 2)
        k /= 2;
    return k > count ? count : (int)k;
}

int ebpo_selection_wanted(int count, int level, double percent, double k_root)
{
    int wanted = ebpo_selection_requested(count, level, percent, k_root);
    return wanted < EBPO_PLANES_STORED ? wanted : EBPO_PLANES_STORED;
}
