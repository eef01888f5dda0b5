/* Divides the world into cells of an octree, and finds the cells of the result of a Boolean
 * expression. In-cells are entirely inside the result. Mixed cells are cells of the finest level
 * that may have points inside and outside. The other cells are entirely outside (out-cells).
 *
 * The search goes level by level. The children of all mixed cells are classified on all processor
 * cores, and mixed children continue to the next level. Cells are kept in the order of octcodes
 * (the path from the root, three bits for each level), so the result does not depend on the number
 * of threads. The cells' volumes bound the volume of the result. The surface around the in-cells,
 * with or without the mixed cells, is a mesh of squares. */
#include "core/strict_fp.h"

#include <inttypes.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "core/alloc.h"
#include "core/error.h"
#include "core/fp_env.h"
#include "core/parallel.h"
#include "extras/boolean/world_cell.h"
#include "extras/collide/collider.h"
#include "geometry/cells.h"

/* A run of in-cells: `count` consecutive octcodes of the finest level, beginning with `first`. */
typedef struct in_run {
    ebpo_octcode first;
    uint64_t count;
} in_run;

struct ebpo_boolean_cells {
    ebpo_world world;
    in_run *in; /* in ascending order */
    uint64_t in_count, in_capacity;
    ebpo_octcode *mixed; /* mixed cells of the finest level, in ascending order */
    uint64_t mixed_count, mixed_capacity;
    uint64_t stages[EBPO_CUBE_STAGES]; /* numbers of decisions by each test (world_cell.h) */
};

enum {
    PARENTS = 1 << 14, /* number of parents whose children are classified together */
    GRAIN = 64         /* number of candidates in one task of a thread */
};

/* A cell to classify. */
typedef struct candidate {
    ebpo_world_cell cell;
    unsigned may; /* possible states of the result in the cell (world_cell.h) */
    uint8_t stages[EBPO_CUBE_STAGES];
} candidate;

typedef struct walk {
    const ebpo_boolean *boolean;
    ebpo_boolean_cells *cells;
    ebpo_cells_options options;
    candidate *candidates;    /* [8 * PARENTS] cells of `level` */
    ebpo_world_cell *parents; /* mixed cells of the level above */
    ebpo_world_cell *next;    /* mixed cells of `level`, found so far */
    uint64_t parent_count, parent_capacity, next_count, next_capacity;
    int level;
} walk;

static ebpo_status query_some(void *context, uint64_t begin, uint64_t end, unsigned worker,
                              ebpo_error *error)
{
    walk *w = context;
    ebpo_status status = EBPO_OK;
    for (uint64_t i = begin; i < end && status == EBPO_OK; i++) {
        candidate *c = &w->candidates[i];
        status = ebpo_world_cell_query(w->boolean, worker, &w->cells->world, &c->cell, &c->may,
                                       c->stages, error);
    }
    return status;
}

static ebpo_status keep_in(ebpo_boolean_cells *cells, ebpo_cell cell, ebpo_error *error)
{
    int up = cells->world.level -
             cell.level; /* number of levels between the cell's level and the finest level */
    if (!ebpo_grow(&cells->in, &cells->in_capacity, cells->in_count + 1, sizeof *cells->in))
        return ebpo_fail_memory(error, (cells->in_count + 1) * sizeof *cells->in);
    cells->in[cells->in_count++] =
        (in_run){ ebpo_octcode_of_cell(cell) << 3 * up, UINT64_C(1) << 3 * up };
    return EBPO_OK;
}

static ebpo_status keep_mixed(walk *w, const ebpo_world_cell *c, ebpo_error *error)
{
    ebpo_boolean_cells *cells = w->cells;
    uint64_t max_cells = w->options.most ? w->options.most : UINT64_C(1) << 25;
    if (w->next_count + cells->mixed_count >= max_cells)
        return ebpo_fail(error, EBPO_E_LIMIT,
                         "more than %" PRIu64 " cells of level %d are mixed; give a lower level",
                         max_cells, w->level);
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

static ebpo_status query_and_keep(walk *w, uint64_t count, ebpo_error *error)
{
    ebpo_status status = ebpo_parallel_for(count <= GRAIN ? 1 : w->boolean->threads, NULL, count,
                                           GRAIN, query_some, w, NULL, "cells", error);
    for (uint64_t i = 0; i < count && status == EBPO_OK; i++) {
        const candidate *c = &w->candidates[i];
        for (int k = 0; k < EBPO_CUBE_STAGES; k++)
            w->cells->stages[k] += c->stages[k];
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
    /* progress in 65,536ths of a level */
    uint64_t total = (uint64_t)w->cells->world.level << 16;
    for (uint64_t at = 0; at < w->parent_count && status == EBPO_OK; at += PARENTS) {
        uint64_t count = w->parent_count - at < PARENTS ? w->parent_count - at : PARENTS;
        uint64_t done = ((uint64_t)w->level - 1) << 16 | (at << 16) / w->parent_count;
        if (!ebpo_progress_step(&w->options.progress, "cells", done, total, error))
            return EBPO_E_CANCELLED;
        for (uint64_t i = 0; i < 8 * count; i++)
            w->candidates[i] =
                (candidate){ .cell = ebpo_world_child(&w->parents[at + i / 8], (unsigned)(i % 8)) };
        status = query_and_keep(w, 8 * count, error);
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
    const in_run *x = a, *y = b;
    return (x->first > y->first) - (x->first < y->first);
}

static ebpo_status walk_levels(walk *w, ebpo_error *error)
{
    w->candidates = ebpo_alloc(8 * PARENTS, sizeof *w->candidates);
    if (!w->candidates)
        return ebpo_fail_memory(error, 8 * PARENTS * sizeof *w->candidates);
    w->candidates[0] = (candidate){ .cell = { { 0, { 0, 0, 0 } }, 0, 0 } };
    ebpo_status status = query_and_keep(w, 1, error);
    for (w->level = 1; w->level <= w->cells->world.level && status == EBPO_OK; w->level++) {
        swap_lists(w);
        status = next_level(w, error);
    }
    if (w->cells->in_count)
        qsort(w->cells->in, w->cells->in_count, sizeof *w->cells->in, by_first);
    free(w->candidates);
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
        return ebpo_fail(error, EBPO_E_ARGUMENT, "level %d of cells is out of range; give 0 to %d",
                         w.options.level, EBPO_BOOLEAN_LEVEL_MAX);
    w.cells = ebpo_alloc_zero(1, sizeof *w.cells);
    if (!w.cells)
        return ebpo_fail_memory(error, sizeof *w.cells);
    status = ebpo_world_make(&w.cells->world, boolean, w.options.level, error);
    if (status == EBPO_OK && w.cells->world.edge > 0)
        status = walk_levels(&w, error);
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

/* Returns the volume of `count` cells of the finest level, rounded up or down. */
static double cells_volume(const ebpo_boolean_cells *c, uint64_t count, bool up)
{
    double cells = (double)count, edge = ebpo_world_edge(&c->world, c->world.level);
    if (count >> 53)
        cells = nextafter(cells, up ? INFINITY : 0);
    return cells * (edge * edge * edge); /* exact: the edge is a power of two, and its cube is in
                                          * the range of doubles */
}

ebpo_status ebpo_boolean_cells_volume(const ebpo_boolean_cells *cells, ebpo_boolean_volume *out)
{
    EBPO_DEFAULT_FP;
    uint64_t in = 0;
    for (uint64_t i = 0; i < cells->in_count; i++)
        in += cells->in[i].count;
    const ebpo_world *w = &cells->world;
    ebpo_boolean_volume v = { .lo = cells_volume(cells, in, false),
                              .hi = cells_volume(cells, in + cells->mixed_count, true),
                              .origin = { w->origin[0], w->origin[1], w->origin[2] },
                              .edge = w->edge,
                              .in_cells = cells->in_count,
                              .mixed_cells = cells->mixed_count,
                              .by_box = cells->stages[EBPO_CUBE_BY_BOX],
                              .by_nodes = cells->stages[EBPO_CUBE_BY_NODES],
                              .by_faces = cells->stages[EBPO_CUBE_BY_FACES] };
    v.kind = ebpo_value_bounds_of(v.lo, v.hi).kind;
    return EBPO_GIVE(ebpo_boolean_volume, out, &v);
}

/* --- the mesh ---
 *
 * Between an in-cell and an out-cell there is always a mixed cell. So each square is a side of a
 * mixed cell. */

/* A corner of cells of the finest level: its coordinates in units of a cell's edge, with 21 bits
 * for each. The lowest bits are x. */
typedef uint64_t corner;

typedef struct squares {
    const ebpo_boolean_cells *cells;
    corner (*list)[4]; /* corners in counter-clockwise order, seen from outside */
    uint64_t count, capacity;
    corner *vertex; /* in ascending order */
    uint64_t vertex_count;
} squares;

static int by_number(const void *a, const void *b)
{
    uint64_t x = *(const uint64_t *)a, y = *(const uint64_t *)b;
    return (x > y) - (x < y);
}

static bool is_mixed(const ebpo_boolean_cells *c, ebpo_octcode code)
{
    return bsearch(&code, c->mixed, c->mixed_count, sizeof code, by_number) != NULL;
}

static bool is_in(const ebpo_boolean_cells *c, ebpo_octcode code)
{
    uint64_t low = 0, high = c->in_count; /* invariant: all runs before number `low` begin at or
                                           * before `code` */
    while (low < high) {
        uint64_t middle = low + (high - low) / 2;
        if (c->in[middle].first <= code)
            low = middle + 1;
        else
            high = middle;
    }
    return low > 0 && code - c->in[low - 1].first < c->in[low - 1].count;
}

static corner corner_at(const uint32_t at[3])
{
    return (uint64_t)at[2] << 42 | (uint64_t)at[1] << 21 | at[0];
}

/* Adds a side of a cell as a square. from_outside: true: the square's normal points out of the
 * cell; false: into the cell. */
static ebpo_status add_square(squares *s, ebpo_cell cell, int axis, bool upper, bool from_outside,
                              ebpo_error *error)
{
    if (!ebpo_grow(&s->list, &s->capacity, s->count + 1, sizeof *s->list))
        return ebpo_fail_memory(error, (s->count + 1) * sizeof *s->list);
    corner *out = s->list[s->count++];
    int u = axis == 2 ? 0 : axis + 1, v = axis == 0 ? 2 : axis - 1;
    for (unsigned i = 0; i < 4; i++) { /* corners in counter-clockwise order, seen from the upper
                                        * side of the axis */
        uint32_t at[3] = { cell.at[0], cell.at[1], cell.at[2] };
        at[axis] += upper;
        at[u] += i == 1 || i == 2;
        at[v] += i >= 2;
        out[upper == from_outside ? i : 3 - i] = corner_at(at);
    }
    return EBPO_OK;
}

/* Adds the sides of a mixed cell that are on the requested surface. EBPO_BOOLEAN_INNER requests the
 * sides next to in-cells, EBPO_BOOLEAN_OUTER the sides next to out-cells. */
static ebpo_status add_sides(squares *s, ebpo_octcode code, ebpo_boolean_side side,
                             ebpo_error *error)
{
    const ebpo_boolean_cells *c = s->cells;
    ebpo_cell cell = ebpo_cell_of_octcode(code), neighbour;
    ebpo_status status = EBPO_OK;
    for (int i = 0; i < 6 && status == EBPO_OK; i++) {
        int step[3] = { 0, 0, 0 };
        step[i / 2] = i % 2 ? 1 : -1;
        bool within = ebpo_cell_neighbour(cell, step, &neighbour);
        ebpo_octcode other = within ? ebpo_octcode_of_cell(neighbour) : 0;
        bool in = within && is_in(c, other);
        bool wanted = side == EBPO_BOOLEAN_INNER ? in : !in && !(within && is_mixed(c, other));
        if (wanted)
            status = add_square(s, cell, i / 2, i % 2, side == EBPO_BOOLEAN_OUTER, error);
    }
    return status;
}

static ebpo_status sort_vertices(squares *s, ebpo_error *error)
{
    s->vertex = ebpo_alloc(4 * s->count, sizeof *s->vertex);
    if (!s->vertex)
        return ebpo_fail_memory(error, 4 * s->count * sizeof *s->vertex);
    if (s->count)
        memcpy(s->vertex, s->list, s->count * sizeof *s->list);
    qsort(s->vertex, 4 * s->count, sizeof *s->vertex, by_number);
    for (uint64_t i = 0; i < 4 * s->count; i++)
        if (i == 0 || s->vertex[i] != s->vertex[s->vertex_count - 1])
            s->vertex[s->vertex_count++] = s->vertex[i];
    return EBPO_OK;
}

static uint32_t number_of(const squares *s, corner c)
{
    const corner *found = bsearch(&c, s->vertex, s->vertex_count, sizeof c, by_number);
    return (uint32_t)(found - s->vertex);
}

static ebpo_status fill_mesh(const squares *s, ebpo_mesh *out, ebpo_error *error)
{
    const ebpo_world *w = &s->cells->world;
    const uint64_t mask = (UINT64_C(1) << 21) - 1;
    if (s->count > (UINT32_MAX - 1) / 2)
        return ebpo_fail(error, EBPO_E_LIMIT,
                         "the cells' surface has %" PRIu64 " squares; give a lower level",
                         s->count);
    out->xyz64 = ebpo_alloc(s->vertex_count, sizeof(double[3]));
    out->faces = ebpo_alloc(2 * s->count, sizeof(uint32_t[3]));
    if (!out->xyz64 || !out->faces)
        return ebpo_fail_memory(error, 24 * (s->vertex_count + s->count));
    out->vertex_count = s->vertex_count;
    out->face_count = 2 * s->count;
    for (uint64_t i = 0; i < s->vertex_count; i++)
        for (int k = 0; k < 3; k++)
            out->xyz64[3 * i + (unsigned)k] =
                ebpo_world_cell_face(w, k, w->level, (uint32_t)(s->vertex[i] >> 21 * k & mask));
    for (uint64_t i = 0; i < s->count; i++) {
        uint32_t n[4];
        for (int c = 0; c < 4; c++)
            n[c] = number_of(s, s->list[i][c]);
        const uint32_t two[6] = { n[0], n[1], n[2], n[0], n[2], n[3] };
        memcpy(out->faces + 6 * i, two, sizeof two);
    }
    return EBPO_OK;
}

ebpo_status ebpo_boolean_cells_mesh(const ebpo_boolean_cells *cells, ebpo_boolean_side side,
                                    ebpo_mesh *out, ebpo_error *error)
{
    EBPO_DEFAULT_FP;
    squares s = { .cells = cells };
    memset(out, 0, sizeof *out);
    if (side != EBPO_BOOLEAN_OUTER && side != EBPO_BOOLEAN_INNER)
        return ebpo_fail(error, EBPO_E_ARGUMENT, "unknown side %d of the surface of cells",
                         (int)side);
    ebpo_status status = EBPO_OK;
    for (uint64_t i = 0; i < cells->mixed_count && status == EBPO_OK; i++)
        status = add_sides(&s, cells->mixed[i], side, error);
    if (status == EBPO_OK)
        status = sort_vertices(&s, error);
    if (status == EBPO_OK)
        status = fill_mesh(&s, out, error);
    free(s.list);
    free(s.vertex);
    if (status != EBPO_OK)
        ebpo_mesh_free(out);
    return status;
}
