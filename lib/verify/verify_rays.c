#include "core/strict_fp.h"

#include "verify/verify_rays.h"

#include <stdlib.h>
#include <string.h>

#include "core/alloc.h"
#include "core/error.h"
#include "core/parallel.h"
#include "core/workspace.h"
#include "verify/winding.h"

enum { SIDE_MAX = 2048, FACE_GRAIN = 1 << 14 };

/* A grid of columns seen along x: cell (y, z). */
typedef struct columns {
    const ebpo_mesh *mesh;
    double low[2], scale[2];
    uint64_t side;
    uint64_t *first;       /* [side * side + 1] of the column's points */
    ebpo_ray_point *point; /* column after column */
} columns;

bool ebpo_rays_add(ebpo_ray_points *points, const ebpo_ray_point *point)
{
    if (!ebpo_array_grow(points->workspace, &points->point, &points->capacity, points->count + 1,
                         sizeof *points->point))
        return false;
    points->point[points->count++] = *point;
    return true;
}

static columns grid_for(const ebpo_mesh *mesh, const ebpo_box *box, uint64_t count)
{
    columns c = { .mesh = mesh, .side = 1 };
    while (c.side < SIDE_MAX && c.side * c.side * 2 < count)
        c.side *= 2;
    for (int i = 0; i < 2; i++) {
        c.low[i] = box->origin[i + 1];
        c.scale[i] = 1 / box->size[i + 1];
    }
    return c;
}

/* Monotone, so that a point in a face's range of coordinates falls into its range of columns. */
static uint64_t column_of(const columns *c, int i, double x)
{
    double at = (x - c->low[i]) * c->scale[i] * (double)c->side;
    return at >= (double)c->side ? c->side - 1 : at > 0 ? (uint64_t)at : 0;
}

static uint64_t column_of_point(const columns *c, const ebpo_ray_point *p)
{
    return column_of(c, 1, p->at[2]) * c->side + column_of(c, 0, p->at[1]);
}

typedef struct column_range {
    uint64_t from[2], to[2];
} column_range;

static column_range columns_of_face(const columns *c, const ebpo_corners *face)
{
    column_range range;
    for (int i = 0; i < 2; i++) {
        double low = face->at[0][i + 1], high = low;
        for (int j = 1; j < 3; j++) {
            double x = face->at[j][i + 1];
            low = x < low ? x : low;
            high = x > high ? x : high;
        }
        range.from[i] = column_of(c, i, low);
        range.to[i] = column_of(c, i, high);
    }
    return range;
}

/* Sorts the points by column; those of a column keep their order, which nothing depends on. */
static ebpo_status sort_points(columns *c, ebpo_ray_points *points, ebpo_error *error)
{
    uint64_t cells = c->side * c->side;
    ebpo_ray_point *sorted = ebpo_array_alloc(points->workspace, points->count, sizeof *sorted);
    c->first = ebpo_alloc_zero(cells + 1, sizeof *c->first);
    if (!sorted || !c->first) {
        ebpo_array_free(points->workspace, sorted);
        return ebpo_workspace_fail(points->workspace, points->count * sizeof *sorted, error);
    }
    EBPO_FOR_ITEMS(points->workspace, i, 0, points->count)
        c->first[column_of_point(c, &points->point[i])]++;
    for (uint64_t i = 0, sum = 0; i <= cells; i++) {
        uint64_t own = c->first[i];
        c->first[i] = sum;
        sum += own;
    }
    EBPO_FOR_ITEMS_SCATTERED(points->workspace, i, 0, points->count)
        sorted[c->first[column_of_point(c, &points->point[i])]++] = points->point[i];
    /* each had moved on to the next one's beginning */
    memmove(c->first + 1, c->first, cells * sizeof *c->first);
    c->first[0] = 0;
    ebpo_array_free(points->workspace, points->point);
    points->point = c->point = sorted;
    points->capacity = points->count;
    return EBPO_OK;
}

/* Several threads may meet at one point. */
static void look(const columns *c, const ebpo_corners *face, uint64_t begin, uint64_t end)
{
    for (uint64_t i = begin; i < end; i++) {
        int hit = ebpo_ray_hit(c->point[i].at, 0, face);
        if (hit)
            __atomic_fetch_add(&c->point[i].found, hit, __ATOMIC_RELAXED);
    }
}

static ebpo_status follow(void *context, uint64_t begin, uint64_t end, unsigned worker,
                          ebpo_error *error)
{
    const columns *c = context;
    (void)worker;
    (void)error;
    uint64_t rows = 0; /* jumps */
    for (uint64_t f = begin; f < end; f++) {
        ebpo_corners face;
        ebpo_face_corners(c->mesh, f, &face);
        column_range r = columns_of_face(c, &face);
        /* the columns of a row stand side by side */
        for (uint64_t z = r.from[1]; z <= r.to[1]; z++) {
            look(c, &face, c->first[z * c->side + r.from[0]], c->first[z * c->side + r.to[0] + 1]);
            if (++rows % EBPO_ITEMS_SCATTERED == 0)
                ebpo_release_pages(c->mesh->workspace);
        }
    }
    return EBPO_OK;
}

ebpo_status ebpo_rays_follow(ebpo_ray_points *points, const ebpo_mesh *mesh, const ebpo_box *box,
                             unsigned threads, const ebpo_progress *progress, ebpo_error *error)
{
    columns c = grid_for(mesh, box, points->count);
    ebpo_status status = sort_points(&c, points, error);
    EBPO_FOR_ITEMS(points->workspace, i, 0, status == EBPO_OK ? points->count : 0)
        c.point[i].found = 0;
    if (status == EBPO_OK)
        status = ebpo_parallel_for(threads, mesh->workspace, mesh->face_count, FACE_GRAIN, follow,
                                   &c, progress, "following rays", error);
    free(c.first);
    return status;
}

double ebpo_rays_work(const ebpo_mesh *mesh, const ebpo_box *box, uint64_t count)
{
    columns c = grid_for(mesh, box, count);
    uint64_t covered = 0; /* columns, over all faces */
    EBPO_FOR_ITEMS(mesh->workspace, f, 0, mesh->face_count) {
        ebpo_corners face;
        ebpo_face_corners(mesh, f, &face);
        column_range r = columns_of_face(&c, &face);
        covered += (r.to[0] - r.from[0] + 1) * (r.to[1] - r.from[1] + 1);
    }
    return (double)covered * (double)count / (double)(c.side * c.side);
}
