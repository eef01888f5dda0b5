#include "core/strict_fp.h"

#include "extras/boolean/boundary_search.h"

#include <math.h>
#include <stdlib.h>

#include "core/alloc.h"
#include "core/error.h"
#include "core/sort.h"

typedef struct waiting {
    double near; /* no point of the cell is nearer */
    ebpo_world_cell cell;
} waiting;

typedef struct queue {
    waiting *list; /* a heap, the nearest first */
    uint64_t count, capacity;
} queue;

static bool is_nearer(const waiting *a, const waiting *b) { return a->near < b->near; }

EBPO_HEAP(heap, waiting, is_nearer)

static ebpo_status push(queue *q, waiting w, ebpo_error *error)
{
    if (!ebpo_grow(&q->list, &q->capacity, q->count + 1, sizeof *q->list))
        return ebpo_fail_memory(error, (q->count + 1) * sizeof *q->list);
    heap_add(q->list, q->count++, &w);
    return EBPO_OK;
}

/* From the point to the nearest one of the closed cell, right to some ulp. */
static double distance_to(const ebpo_boundary_search *s, const ebpo_world *w, ebpo_cell cell)
{
    double d[3];
    for (int k = 0; k < 3; k++)
        d[k] = fmax(fmax(ebpo_world_wall(w, k, cell.level, cell.at[k]) - s->point[k],
                         s->point[k] - ebpo_world_wall(w, k, cell.level, cell.at[k] + 1)),
                    0);
    return ebpo_length(d);
}

static ebpo_status push_cell(const ebpo_boundary_search *s, const ebpo_world *w, queue *q,
                             const ebpo_world_cell *c, ebpo_error *error)
{
    double near = distance_to(s, w, c->cell) * (1 - 0x1p-46);
    return near < s->hi ? push(q, (waiting){ near, *c }, error) : EBPO_OK;
}

/* Beyond the root all is out. */
static void look_beyond_root(ebpo_boundary_search *s, const ebpo_world *w)
{
    for (int k = 0; k < 3 && s->side == EBPO_MAY_IN; k++)
        s->hi = fmin(s->hi, fmin(fabs(s->point[k] - w->origin[k]),
                                 fabs(w->origin[k] + w->edge - s->point[k])) *
                                (1 + 0x1p-46));
}

/* The cell at hand; *unclear: the least distance at which cells of the finest level are mixed. */
static ebpo_status settle(ebpo_boundary_search *s, const ebpo_world *w, queue *q, waiting *at,
                          double *unclear, ebpo_error *error)
{
    unsigned may;
    uint8_t ways[EBPO_CUBE_WAYS] = { 0 };
    ebpo_status status = ebpo_world_cell_ask(s->boolean, 0, w, &at->cell, &may, ways, error);
    if (status != EBPO_OK || may == s->side)
        return status;
    if (may != EBPO_MAY_BOTH) {
        s->hi = fmin(s->hi, distance_to(s, w, at->cell.cell) * (1 + 0x1p-46));
        return EBPO_OK;
    }
    if (at->cell.cell.level == w->level)
        *unclear = fmin(*unclear, at->near);
    for (unsigned octant = 0; octant < 8 && status == EBPO_OK && at->cell.cell.level < w->level;
         octant++) {
        ebpo_world_cell child = ebpo_world_child(&at->cell, octant);
        status = push_cell(s, w, q, &child, error);
    }
    return status;
}

static ebpo_status search(ebpo_boundary_search *s, const ebpo_world *w, queue *q, ebpo_error *error)
{
    const ebpo_world_cell root = { { 0, { 0, 0, 0 } }, 0, 0 };
    double unclear = INFINITY;
    look_beyond_root(s, w);
    ebpo_status status = push_cell(s, w, q, &root, error);
    uint64_t begun = s->cells;
    while (status == EBPO_OK && q->count) {
        double least = fmin(q->list[0].near, unclear);
        bool enough = s->hi < INFINITY && s->hi - least <= s->tolerance * s->hi;
        if (q->list[0].near >= s->hi || enough || s->cells - begun >= s->most)
            break;
        waiting at = heap_take(q->list, q->count--);
        s->cells++;
        status = settle(s, w, q, &at, &unclear, error);
    }
    s->lo = fmin(fmin(q->count ? q->list[0].near : INFINITY, unclear), s->hi);
    return status;
}

/* As fine as doubles allow. */
static ebpo_status make_world(ebpo_world *w, const ebpo_boolean *b, ebpo_error *error)
{
    int level = EBPO_BOOLEAN_LEVEL_MAX - 1; /* centres are one level finer */
    while (level > 0 && ebpo_world_make(w, b, level, NULL) != EBPO_OK)
        level--;
    return ebpo_world_make(w, b, level, error);
}

ebpo_status ebpo_boundary_search_run(ebpo_boundary_search *s, ebpo_error *error)
{
    ebpo_world w;
    queue q = { NULL, 0, 0 };
    ebpo_status status = make_world(&w, s->boolean, error);
    s->lo = INFINITY;
    if (status == EBPO_OK && w.edge > 0)
        status = search(s, &w, &q, error);
    free(q.list);
    return status;
}
