#include "core/strict_fp.h"

#include "extras/collide/nearest_pair.h"

#include <math.h>

#include "core/os.h"
#include "core/error.h"
#include "core/parallel.h"
#include "geometry/triangle_pair.h"

typedef const double (*corners)[3];
#define CORNERS(face, side) ((corners)(face)->corner[side])

/* --- one pair --- */

static void nearest_pair_pose(const ebpo_posing *const posing[2], ebpo_face_two *out)
{
    for (int i = 0; i < 6; i++)
        ebpo_posing_apply(posing[i / 3], out->own[i / 3][i % 3], out->corner[i / 3][i % 3]);
    ebpo_triangles_distance_bounds(CORNERS(out, 0), CORNERS(out, 1), &out->bounds);
}

static void nearest_pair_look(const ebpo_gap_search *g, const uint32_t slot[2], ebpo_face_two *out)
{
    const ebpo_posing *posing[2] = { &g->posing[0].posing, &g->posing[1].posing };
    for (int s = 0; s < 2; s++) {
        uint32_t local = ebpo_accel_slot_face(g->accel[s], slot[s]);
        out->file[s] = ebpo_accel_file_face(g->accel[s], local);
        out->source[s] = ebpo_accel_source_face(g->accel[s], local);
        ebpo_accel_triangle(g->accel[s], slot[s], out->own[s]);
    }
    nearest_pair_pose(posing, out);
}

/* Of equal distances the first in the order of the files. */
static bool nearest_pair_earlier(const ebpo_face_two *f, const ebpo_face_two *than)
{
    return f->file[0] != than->file[0] ? f->file[0] < than->file[0] : f->file[1] < than->file[1];
}

static bool nearest_pair_nearer(const ebpo_face_two *f, const ebpo_face_two *than)
{
    if (f->bounds.hi < than->bounds.lo)
        return true;
    if (f->bounds.lo > than->bounds.hi)
        return false;
    int order = 0;
    if (!ebpo_same_distance(CORNERS(f, 0), CORNERS(f, 1), &f->bounds, CORNERS(than, 0),
                            CORNERS(than, 1), &than->bounds))
        order = ebpo_triangles_distance_compare(CORNERS(f, 0), CORNERS(f, 1), CORNERS(than, 0),
                                                CORNERS(than, 1));
    return order < 0 || (order == 0 && nearest_pair_earlier(f, than));
}

/* --- all that wait --- */

/* Rounded up, in the search's unit. */
static float to_unit(const ebpo_gap_search *g, double distance)
{
    return (float)(distance * g->posing[0].unit * (1 + 0x1p-22)) + 0x1p-100f;
}

/* Of a pair that is apart; false: that is enough. */
static bool compare_to_asked(ebpo_nearest_pair *n, const ebpo_face_two *f)
{
    if (!(f->bounds.lo < n->at_least) ||
        (!(f->bounds.hi < n->at_least) &&
         ebpo_triangles_distance_compare_to(CORNERS(f, 0), CORNERS(f, 1), n->at_least) >= 0))
        return true;
    n->is_at_least = 0;
    n->best = *f;
    n->found = true;
    return false;
}

/* A tolerance asks for bounds only: the least of each. They are too wide for a gap that is tiny
 * beside its faces, whose direction doubles hardly know: then for the exact distance, rounded. */
static void take_within_tolerance(ebpo_nearest_pair *n, const ebpo_face_two *given)
{
    ebpo_face_two f = *given;
    double hi = n->found ? fmin(f.bounds.hi, n->best.bounds.hi) : f.bounds.hi;
    if (f.bounds.lo < hi - n->tolerance) {
        double exact = ebpo_triangles_distance(CORNERS(&f, 0), CORNERS(&f, 1));
        f.bounds.lo = nextafter(exact, 0);
        f.bounds.hi = nextafter(exact, INFINITY);
    }
    n->lo = fmin(n->lo, f.bounds.lo);
    if (!n->found || f.bounds.hi < n->best.bounds.hi)
        n->best = f;
    n->found = true;
}

/* False: enough. */
static bool nearest_pair_consider(ebpo_nearest_pair *n, const ebpo_face_two *f)
{
    if (!(f->bounds.lo > 0) &&
        ebpo_triangle_pair(CORNERS(f, 0), CORNERS(f, 1)) != EBPO_PAIR_APART) {
        n->best = *f;
        n->found = n->meets = true;
        return false;
    }
    if (!isnan(n->at_least))
        return compare_to_asked(n, f);
    if (n->tolerance > 0)
        take_within_tolerance(n, f);
    else if (!n->found || nearest_pair_nearer(f, &n->best)) {
        n->best = *f;
        n->found = true;
    }
    return true;
}

static bool nearest_pair_take(ebpo_gap_search *g, ebpo_nearest_pair *n, const uint32_t slot[2])
{
    ebpo_face_two f;
    nearest_pair_look(g, slot, &f);
    ebpo_gap_set_best(g, to_unit(g, f.bounds.hi), slot[0], slot[1]);
    return nearest_pair_consider(n, &f);
}

static bool go_on(ebpo_gap_search *g)
{
    ebpo_nearest_pair *n = g->user;
    if (!ebpo_progress_step(n->progress, "distance", 0, 0, n->error))
        n->status = EBPO_E_CANCELLED;
    g->ended = n->status != EBPO_OK || (n->late != UINT64_MAX && ebpo_clock() >= n->late);
    return !g->ended;
}

/* Of those that nobody will look at. Not by fmin: gcc 12 for ARM fails to compile such loops. */
static double least_waiting(const ebpo_gap_search *g, unsigned first)
{
    double least = INFINITY;
    for (unsigned i = first; i < g->waits; i++)
        if ((double)g->waiting[i].low < least)
            least = (double)g->waiting[i].low;
    return fmax(least / g->posing[0].unit * (1 - 0x1p-20), 0);
}

/* Many may be at nearly the same distance, where models have flat parts. */
static bool nearest_pair_judge(ebpo_gap_search *g)
{
    ebpo_nearest_pair *n = g->user;
    bool more = true;
    unsigned judged = 0, i = 0;
    for (; i < g->waits && more; i++)
        if (!(g->waiting[i].low > g->limit))
            more = nearest_pair_take(g, n, g->waiting[i].slot) && (++judged % 16 || go_on(g));
    if (!more)
        n->lo = fmin(n->lo, least_waiting(g, i));
    g->waits = 0;
    return more;
}

/* --- the answer --- */

/* Of what has not been seen. */
static double left_over(const ebpo_gap_search *g)
{
    double least = INFINITY;
    for (uint64_t i = 0; i < g->count; i++)
        if ((double)g->stack[i].key < least)
            least = (double)g->stack[i].key;
    return sqrt(fmax(least, 0)) / g->posing[0].unit * (1 - 0x1p-18);
}

static void end_exact(ebpo_nearest_pair *n)
{
    n->lo = n->hi = ebpo_triangles_distance(CORNERS(&n->best, 0), CORNERS(&n->best, 1));
}

static void end_open(ebpo_nearest_pair *n)
{
    n->hi = n->found ? n->best.bounds.hi : INFINITY;
    n->lo = fmin(fmin(n->lo, n->hi), n->left);
    if (n->tolerance > 0)
        n->lo = fmin(n->lo, n->hi - n->tolerance);
    else if (n->found)
        n->lo = fmin(n->lo, n->best.bounds.lo);
    n->lo = fmax(n->lo, 0);
}

void ebpo_nearest_pair_end(ebpo_nearest_pair *n)
{
    bool asked = !isnan(n->at_least);
    if (n->meets) {
        n->lo = n->hi = 0;
        n->is_at_least = asked ? n->at_least <= 0 : -1;
    } else if (asked) {
        if (n->is_at_least < 0 && !n->ended)
            n->is_at_least = 1;
        n->lo = n->is_at_least == 1 ? n->at_least : fmin(n->lo, n->at_least);
        if (n->is_at_least == 1)
            n->hi = INFINITY;
        else
            end_open(n);
    } else if (!n->ended && n->tolerance == 0 && n->found)
        end_exact(n);
    else
        end_open(n);
}

void ebpo_nearest_pair_leave(ebpo_nearest_pair *n, double left)
{
    n->ended = true;
    n->left = fmin(n->left, left);
}

/* --- the search --- */

void ebpo_nearest_pair_begin(ebpo_nearest_pair *n)
{
    n->lo = n->left = INFINITY;
    n->found = n->meets = n->ended = false;
    n->status = EBPO_OK;
    n->is_at_least = -1;
}

void ebpo_nearest_pair_start(ebpo_nearest_pair *n, const ebpo_posing posing[2],
                             const ebpo_face_two *pair)
{
    const ebpo_posing *const two[2] = { &posing[0], &posing[1] };
    ebpo_face_two f = *pair;
    nearest_pair_pose(two, &f);
    (void)nearest_pair_consider(n, &f);
}

void ebpo_nearest_pair_met(ebpo_nearest_pair *n, const ebpo_gap_search *g, const uint32_t slot[2])
{
    nearest_pair_look(g, slot, &n->best);
    n->found = n->meets = true;
}

double ebpo_nearest_pair_limit(const ebpo_nearest_pair *n)
{
    if (!isnan(n->at_least))
        return n->at_least;
    return n->found ? n->best.bounds.hi - n->tolerance : INFINITY;
}

bool ebpo_nearest_pair_is_done(const ebpo_nearest_pair *n)
{
    return n->meets || n->is_at_least >= 0 || n->ended || n->status != EBPO_OK;
}

/* What is known limits the search. */
static void begin_search(const ebpo_nearest_pair *n, ebpo_gap_search *g)
{
    g->tolerance = (float)(n->tolerance * g->posing[0].unit * (1 - 0x1p-20));
    if (!isnan(n->at_least)) {
        ebpo_gap_set_limit(g, to_unit(g, n->at_least));
    } else if (n->found) {
        g->best = to_unit(g, n->best.bounds.hi);
        ebpo_gap_set_limit(g, g->best - g->tolerance);
    }
}

/* What waits, and the pair that is less than `before` and that nobody has judged yet. */
static void judge_rest(ebpo_gap_search *g, ebpo_nearest_pair *n, float before)
{
    if (ebpo_nearest_pair_is_done(n) || !nearest_pair_judge(g) || n->meets || !isnan(n->at_least))
        return;
    if (n->tolerance > 0 && g->best < before)
        nearest_pair_take(g, n, g->best_slot);
}

ebpo_status ebpo_nearest_pair_search(ebpo_nearest_pair *n, ebpo_gap_search *g, ebpo_error *error)
{
    g->user = n;
    g->judge = nearest_pair_judge;
    g->go_on = go_on;
    n->error = error;
    begin_search(n, g);
    float before = g->best;
    ebpo_gap_kernels_best()->walk(g);
    if (g->no_memory)
        return ebpo_fail_memory(error, g->capacity * sizeof *g->stack);
    judge_rest(g, n, before);
    if (g->ended)
        ebpo_nearest_pair_leave(n, left_over(g));
    return n->status;
}
