/* Level by level: the children of all mixed cells are asked about, on all cores, and those that are
 * mixed go to the next level. Everything is kept in the order of octcodes. */
#include "core/strict_fp.h"

#include "extras/boolean/boolean_cells.h"

#include <inttypes.h>
#include <math.h>
#include <stdlib.h>

#include "core/alloc.h"
#include "core/error.h"
#include "core/fp_env.h"
#include "core/parallel.h"
#include "extras/collide/collider.h"

enum { PARENTS = 1 << 14, GRAIN = 64 };

/* A cell that is asked about. */
typedef struct candidate {
    ebpo_world_cell cell;
    unsigned may;
    uint8_t ways[EBPO_CUBE_WAYS];
} candidate;

typedef struct walk {
    const ebpo_boolean *boolean;
    ebpo_boolean_cells *cells;
    ebpo_cells_options options;
    candidate *asked; /* [8 * PARENTS] */
    ebpo_world_cell *parents, *next;
    uint64_t parent_count, parent_capacity, next_count, next_capacity;
    int level; /* of what is asked about */
} walk;

static ebpo_status ask_some(void *context, uint64_t begin, uint64_t end, unsigned worker,
                            ebpo_error *error)
{
    walk *w = context;
    ebpo_status status = EBPO_OK;
    for (uint64_t i = begin; i < end && status == EBPO_OK; i++) {
        candidate *c = &w->asked[i];
        status = ebpo_world_cell_ask(w->boolean, worker, &w->cells->world, &c->cell, &c->may,
                                     c->ways, error);
    }
    return status;
}

static ebpo_status keep_in(ebpo_boolean_cells *cells, ebpo_cell cell, ebpo_error *error)
{
    int up = cells->world.level - cell.level;
    if (!ebpo_grow(&cells->in, &cells->in_capacity, cells->in_count + 1, sizeof *cells->in))
        return ebpo_fail_memory(error, (cells->in_count + 1) * sizeof *cells->in);
    cells->in[cells->in_count++] =
        (ebpo_in_run){ ebpo_octcode_of_cell(cell) << 3 * up, UINT64_C(1) << 3 * up };
    return EBPO_OK;
}

static ebpo_status keep_mixed(walk *w, const ebpo_world_cell *c, ebpo_error *error)
{
    ebpo_boolean_cells *cells = w->cells;
    uint64_t most = w->options.most ? w->options.most : UINT64_C(1) << 25;
    if (w->next_count + cells->mixed_count >= most)
        return ebpo_fail(error, EBPO_E_LIMIT,
                         "more than %" PRIu64
                         " cells of level %d are mixed; give a lower level, or allow more",
                         most, w->level);
    if (w->level == cells->world.level) {
        if (!ebpo_grow(&cells->mixed, &cells->mixed_capacity, cells->mixed_count + 1,
                       sizeof *cells->mixed))
            return ebpo_fail_memory(error, (cells->mixed_count + 1) * sizeof *cells->mixed);
        cells->mixed[cells->mixed_count++] = ebpo_octcode_of_cell(c->cell);
        return EBPO_OK;
    }
    if (!ebpo_grow(&w->next, &w->next_capacity, w->next_count + 1, sizeof *w->next))
        return ebpo_fail_memory(error, (w->next_count + 1) * sizeof *w->next);
    w->next[w->next_count++] = *c;
    return EBPO_OK;
}

static ebpo_status ask_and_keep(walk *w, uint64_t count, ebpo_error *error)
{
    ebpo_status status = ebpo_parallel_for(count <= GRAIN ? 1 : w->boolean->threads, NULL, count,
                                           GRAIN, ask_some, w, NULL, "cells", error);
    for (uint64_t i = 0; i < count && status == EBPO_OK; i++) {
        const candidate *c = &w->asked[i];
        for (int k = 0; k < EBPO_CUBE_WAYS; k++)
            w->cells->ways[k] += c->ways[k];
        if (c->may == EBPO_MAY_IN)
            status = keep_in(w->cells, c->cell.cell, error);
        else if (c->may != EBPO_MAY_OUT)
            status = keep_mixed(w, &c->cell, error);
    }
    return status;
}

static ebpo_status next_level(walk *w, ebpo_error *error)
{
    ebpo_status status = EBPO_OK;
    uint64_t total = (uint64_t)w->cells->world.level << 16;
    for (uint64_t at = 0; at < w->parent_count && status == EBPO_OK; at += PARENTS) {
        uint64_t count = w->parent_count - at < PARENTS ? w->parent_count - at : PARENTS;
        uint64_t done = ((uint64_t)w->level - 1) << 16 | (at << 16) / w->parent_count;
        if (!ebpo_progress_step(&w->options.progress, "cells", done, total, error))
            return EBPO_E_CANCELLED;
        for (uint64_t i = 0; i < 8 * count; i++)
            w->asked[i] =
                (candidate){ .cell = ebpo_world_child(&w->parents[at + i / 8], (unsigned)(i % 8)) };
        status = ask_and_keep(w, 8 * count, error);
    }
    return status;
}

static void swap_lists(walk *w)
{
    ebpo_world_cell *list = w->parents;
    uint64_t capacity = w->parent_capacity;
    w->parents = w->next;
    w->parent_count = w->next_count;
    w->parent_capacity = w->next_capacity;
    w->next = list;
    w->next_count = 0;
    w->next_capacity = capacity;
}

static int by_first(const void *a, const void *b)
{
    const ebpo_in_run *x = a, *y = b;
    return (x->first > y->first) - (x->first < y->first);
}

static ebpo_status run(walk *w, ebpo_error *error)
{
    w->asked = ebpo_alloc(8 * PARENTS, sizeof *w->asked);
    if (!w->asked)
        return ebpo_fail_memory(error, 8 * PARENTS * sizeof *w->asked);
    w->asked[0] = (candidate){ .cell = { { 0, { 0, 0, 0 } }, 0, 0 } };
    ebpo_status status = ask_and_keep(w, 1, error);
    for (w->level = 1; w->level <= w->cells->world.level && status == EBPO_OK; w->level++) {
        swap_lists(w);
        status = next_level(w, error);
    }
    if (w->cells->in_count)
        qsort(w->cells->in, w->cells->in_count, sizeof *w->cells->in, by_first);
    free(w->asked);
    free(w->parents);
    free(w->next);
    return status;
}

ebpo_status ebpo_boolean_cells_new(ebpo_boolean *boolean, const ebpo_cells_options *options,
                                   ebpo_boolean_cells **out, ebpo_error *error)
{
    EBPO_DEFAULT_FP;
    walk w = { .boolean = boolean, .options = EBPO_CELLS_OPTIONS_INIT };
    *out = NULL;
    ebpo_status status = EBPO_TAKE(ebpo_cells_options, &w.options, options, error);
    if (status != EBPO_OK)
        return status;
    if (w.options.level < 0 || w.options.level > EBPO_BOOLEAN_LEVEL_MAX)
        return ebpo_fail(error, EBPO_E_ARGUMENT, "level %d of cells; give 0 to %d", w.options.level,
                         EBPO_BOOLEAN_LEVEL_MAX);
    w.cells = ebpo_alloc_zero(1, sizeof *w.cells);
    if (!w.cells)
        return ebpo_fail_memory(error, sizeof *w.cells);
    status = ebpo_world_make(&w.cells->world, boolean, w.options.level, error);
    if (status == EBPO_OK && w.cells->world.edge > 0)
        status = run(&w, error);
    if (status == EBPO_OK)
        *out = w.cells;
    else
        ebpo_boolean_cells_free(w.cells);
    return status;
}

void ebpo_boolean_cells_free(ebpo_boolean_cells *cells)
{
    if (!cells)
        return;
    free(cells->in);
    free(cells->mixed);
    free(cells);
}

/* So many finest cells, rounded down or up. */
static double volume(const ebpo_boolean_cells *c, uint64_t count, bool up)
{
    double cells = (double)count, edge = ebpo_world_edge(&c->world, c->world.level);
    if (count >> 53)
        cells = nextafter(cells, up ? INFINITY : 0);
    return cells * (edge * edge * edge); /* a power of two, within the range */
}

ebpo_status ebpo_boolean_cells_volume(const ebpo_boolean_cells *cells, ebpo_boolean_volume *out)
{
    EBPO_DEFAULT_FP;
    uint64_t in = 0;
    for (uint64_t i = 0; i < cells->in_count; i++)
        in += cells->in[i].count;
    const ebpo_world *w = &cells->world;
    ebpo_boolean_volume v = { .lo = volume(cells, in, false),
                              .hi = volume(cells, in + cells->mixed_count, true),
                              .origin = { w->origin[0], w->origin[1], w->origin[2] },
                              .edge = w->edge,
                              .in_cells = cells->in_count,
                              .mixed_cells = cells->mixed_count,
                              .by_box = cells->ways[EBPO_CUBE_BY_BOX],
                              .by_nodes = cells->ways[EBPO_CUBE_BY_NODES],
                              .by_faces = cells->ways[EBPO_CUBE_BY_FACES] };
    v.figure = ebpo_certain_of(v.lo, v.hi).figure;
    return EBPO_GIVE(ebpo_boolean_volume, out, &v);
}
