/* The squares between cells that are taken and cells that are not. In-cells and out-cells have no
 * wall in common, so each such square is a side of a mixed cell. */
#include "core/strict_fp.h"

#include <inttypes.h>
#include <stdlib.h>
#include <string.h>

#include "core/alloc.h"
#include "core/error.h"
#include "core/fp_env.h"
#include "extras/boolean/boolean_cells.h"

/* A corner of finest cells: x, y and z, 21 bits each. */
typedef uint64_t corner;

typedef struct squares {
    const ebpo_boolean_cells *cells;
    corner (*list)[4]; /* counter-clockwise seen from outside */
    uint64_t count, capacity;
    corner *vertex; /* ascending */
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
    uint64_t low = 0, high = c->in_count; /* of the runs below `low`, all begin at or before code */
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

/* A side of a cell, seen from outside the cell, or else from within. */
static ebpo_status add_square(squares *s, ebpo_cell cell, int axis, bool upper, bool from_outside,
                              ebpo_error *error)
{
    if (!ebpo_grow(&s->list, &s->capacity, s->count + 1, sizeof *s->list))
        return ebpo_fail_memory(error, (s->count + 1) * sizeof *s->list);
    corner *out = s->list[s->count++];
    int u = axis == 2 ? 0 : axis + 1, v = axis == 0 ? 2 : axis - 1;
    for (unsigned i = 0; i < 4; i++) { /* counter-clockwise seen from above */
        uint32_t at[3] = { cell.at[0], cell.at[1], cell.at[2] };
        at[axis] += upper;
        at[u] += i == 1 || i == 2;
        at[v] += i >= 2;
        out[upper == from_outside ? i : 3 - i] = corner_at(at);
    }
    return EBPO_OK;
}

static ebpo_status add_sides(squares *s, ebpo_octcode code, ebpo_boolean_side side,
                             ebpo_error *error)
{
    const ebpo_boolean_cells *c = s->cells;
    ebpo_cell cell = ebpo_cell_of_octcode(code), beside;
    ebpo_status status = EBPO_OK;
    for (int i = 0; i < 6 && status == EBPO_OK; i++) {
        int step[3] = { 0, 0, 0 };
        step[i / 2] = i % 2 ? 1 : -1;
        bool within = ebpo_cell_neighbour(cell, step, &beside);
        ebpo_octcode other = within ? ebpo_octcode_of_cell(beside) : 0;
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
                ebpo_world_wall(w, k, w->level, (uint32_t)(s->vertex[i] >> 21 * k & mask));
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
        return ebpo_fail(error, EBPO_E_ARGUMENT, "a surface of cells has no side %d", (int)side);
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
