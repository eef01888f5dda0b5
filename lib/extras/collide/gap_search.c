#include "core/strict_fp.h"

#include "extras/collide/gap_search.h"

#include <math.h>
#include <stdlib.h>

#include "core/alloc.h"

void ebpo_gap_begin(ebpo_gap_search *g, const ebpo_accel *const accel[2],
                    const ebpo_posing posing[2], double reach)
{
    for (int s = 0; s < 2; s++) {
        g->accel[s] = accel[s];
        ebpo_block_posing_make(&g->posing[s], &posing[s], reach);
        for (int i = 0; i < EBPO_GAP_NODES; i++)
            g->node[s][i].node = EBPO_NO_CHILD;
    }
    ebpo_posed_faces_forget(g->faces);
    ebpo_two_frames_make(&g->frames, accel, g->posing);
    g->count = g->waits = 0;
    g->node_pairs = g->block_pairs = 0;
    g->ended = g->no_memory = g->is_heap = false;
    g->limit = g->square = g->best = INFINITY;
    g->tolerance = 0;
    g->way_number = 0;
    for (int k = 0; k < 3; k++) /* what centres show is better than nothing */
        g->way[k] = k == 0;
    ebpo_gap_set_way(g, g->way);
    double centre[2][3];
    float way[3];
    for (int s = 0; s < 2; s++)
        ebpo_posing_apply(&posing[s], accel[s]->centre, centre[s]);
    for (int k = 0; k < 3; k++)
        way[k] = (float)((centre[1][k] - centre[0][k]) * g->posing[0].unit);
    ebpo_gap_set_way(g, way);
}

ebpo_gap_search *ebpo_gap_new(void) { return ebpo_alloc_lines(1, sizeof(ebpo_gap_search)); }

void ebpo_gap_free(ebpo_gap_search *g)
{
    if (g)
        free(g->stack);
    free(g);
}

void ebpo_gap_set_limit(ebpo_gap_search *g, float limit)
{
    if (!(limit < g->limit))
        return;
    g->limit = limit;
    g->square = limit < 0 ? -INFINITY : limit * limit * (1 + 0x1p-18f) + 0x1p-120f;
}

void ebpo_gap_set_best(ebpo_gap_search *g, float best, uint32_t slot_a, uint32_t slot_b)
{
    if (!(best < g->best))
        return;
    g->best = best;
    g->best_slot[0] = slot_a;
    g->best_slot[1] = slot_b;
    ebpo_gap_set_limit(g, best - g->tolerance);
}

static float gap_search_dot(const float a[3], const float b[3])
{
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

/* Shorter than 1: gaps along it are not too great. */
void ebpo_gap_set_way(ebpo_gap_search *g, const float way[3])
{
    float length = sqrtf(gap_search_dot(way, way));
    if (!(length > 0x1p-50f && length < 0x1p60f))
        return;
    for (int k = 0; k < 3; k++)
        g->way[k] = way[k] * ((1 - 0x1p-19f) / length);
    g->way_number++;
    for (int s = 0; s < 2; s++)
        for (int k = 0; k < 3; k++) {
            float sum = 0;
            for (int i = 0; i < 3; i++)
                sum += g->frames.frame[s].in_world[i][k] * g->way[i];
            g->along[s][k] = s ? -sum : sum;
        }
    g->along_shift = gap_search_dot(g->frames.frame[1].shift, g->along[0]);
}

bool ebpo_gap_room(ebpo_gap_search *g)
{
    if (ebpo_grow(&g->stack, &g->capacity, g->count + 64, sizeof *g->stack))
        return true;
    g->no_memory = g->ended = true;
    return false;
}

bool ebpo_gap_wait_room(ebpo_gap_search *g)
{
    unsigned kept = 0;
    if (g->waits + 64 <= EBPO_GAP_CANDIDATES)
        return true;
    for (unsigned i = 0; i < g->waits; i++)
        if (!(g->waiting[i].low > g->limit))
            g->waiting[kept++] = g->waiting[i];
    g->waits = kept;
    return g->waits + 64 <= EBPO_GAP_CANDIDATES || g->judge(g);
}
