/* Vertices and faces along the Morton curve: then every cell's vertices are one run, and neighbours in space are neighbours in memory. */
#include "geom/strict_fp.h"

#include <stdlib.h>
#include <string.h>

#include "base/alloc.h"
#include "base/error.h"
#include "base/parallel.h"
#include "build/builder.h"
#include "morton/octcode.h"

enum { GRAIN = 1 << 14 };

typedef struct keyed {
    uint64_t key;
    uint32_t item;
} keyed;

/* Least significant digit first, so equal keys keep their order; digits that are the same everywhere are skipped. */
static void radix_sort(keyed *items, keyed *scratch, uint64_t count)
{
    uint64_t all = ~UINT64_C(0), any = 0;
    for (uint64_t i = 0; i < count; i++) {
        all &= items[i].key;
        any |= items[i].key;
    }
    uint64_t differ = all ^ any;
    keyed *from = items, *to = scratch;
    for (int shift = 0; shift < 64; shift += 11) {
        if (!(differ >> shift & 2047))
            continue;
        uint64_t start[2048] = { 0 };
        for (uint64_t i = 0; i < count; i++)
            start[from[i].key >> shift & 2047]++;
        uint64_t sum = 0;
        for (int d = 0; d < 2048; d++) {
            uint64_t n = start[d];
            start[d] = sum;
            sum += n;
        }
        for (uint64_t i = 0; i < count; i++)
            to[start[from[i].key >> shift & 2047]++] = from[i];
        keyed *swap = from;
        from = to;
        to = swap;
    }
    if (from != items)
        memcpy(items, from, (size_t)count * sizeof *items);
}

static void load(const ebpo_mesh *mesh, uint64_t i, double out[3])
{
    for (int k = 0; k < 3; k++)
        out[k] = mesh->xyz64 ? mesh->xyz64[3 * i + (uint64_t)k] : (double)mesh->xyz32[3 * i + (uint64_t)k];
}

/* The wall numbers around a coordinate; division may round to the wrong side of a wall, comparing with the exact wall does not. */
static uint32_t slot(const ebpo_box *box, int axis, int level, double x)
{
    double cells = (double)(1u << level), at = (x - box->origin[axis]) / (box->size[axis] / cells);
    uint32_t k = at <= 0 ? 0 : at >= cells ? (1u << level) - 1 : (uint32_t)at;
    while (k > 0 && x < ebpo_wall(box, axis, level, k))
        k--;
    while (k + 1 < 1u << level && x >= ebpo_wall(box, axis, level, k + 1))
        k++;
    return k;
}

typedef struct key_job {
    const ebpo_builder *b;
    const ebpo_mesh *mesh;
    keyed *items;
} key_job;

static ebpo_status make_keys(void *context, uint64_t begin, uint64_t end, unsigned worker, ebpo_error *error)
{
    key_job *job = context;
    const ebpo_builder *b = job->b;
    (void)worker, (void)error;
    for (uint64_t i = begin; i < end; i++) {
        double p[3];
        load(job->mesh, job->items[i].item, p);
        ebpo_cell cell = { b->max_level, { 0, 0, 0 } };
        for (int k = 0; k < 3; k++)
            cell.at[k] = slot(&b->box, k, b->max_level, p[k]);
        job->items[i].key = ebpo_octcode_of_cell(cell);
    }
    return EBPO_OK;
}

/* Numbers referenced vertices only; the others lie outside the tree. */
static uint64_t collect_referenced(const ebpo_mesh *mesh, uint32_t *rank, keyed *items)
{
    memset(rank, 0, (size_t)mesh->vertex_count * sizeof *rank);
    for (uint64_t i = 0; i < 3 * mesh->face_count; i++)
        rank[mesh->faces[i]] = 1;
    uint64_t count = 0;
    for (uint64_t i = 0; i < mesh->vertex_count; i++)
        if (rank[i])
            items[count++].item = (uint32_t)i;
    return count;
}

static ebpo_status order_vertices(ebpo_builder *b, const ebpo_mesh *mesh, uint32_t *rank, ebpo_error *error)
{
    uint64_t n = mesh->vertex_count;
    keyed *items = ebpo_alloc(n, sizeof *items), *scratch = ebpo_alloc(n, sizeof *scratch);
    b->position = ebpo_alloc(n, sizeof *b->position);
    b->key = ebpo_alloc(n, sizeof *b->key);
    b->vertex_source = ebpo_alloc(n, sizeof *b->vertex_source);
    ebpo_status status = EBPO_OK;
    if (!items || !scratch || !b->position || !b->key || !b->vertex_source) {
        status = ebpo_fail_memory(error, n * 68);
        goto done;
    }
    b->vertex_count = collect_referenced(mesh, rank, items);
    key_job job = { b, mesh, items };
    status = ebpo_parallel_for(b->threads, b->vertex_count, GRAIN, make_keys, &job, &b->options->progress, "ordering", error);
    if (status != EBPO_OK)
        goto done;
    radix_sort(items, scratch, b->vertex_count);
    for (uint64_t i = 0; i < b->vertex_count; i++) {
        b->key[i] = items[i].key;
        b->vertex_source[i] = items[i].item;
        rank[items[i].item] = (uint32_t)i;
        load(mesh, items[i].item, b->position[i]);
    }
done:
    free(items);
    free(scratch);
    return status;
}

static ebpo_status order_faces(ebpo_builder *b, const ebpo_mesh *mesh, const uint32_t *rank, ebpo_error *error)
{
    uint64_t n = mesh->face_count;
    b->face_count = n;
    keyed *items = ebpo_alloc(n, sizeof *items), *scratch = ebpo_alloc(n, sizeof *scratch);
    b->face = ebpo_alloc(n, sizeof *b->face);
    b->face_source = ebpo_alloc(n, sizeof *b->face_source);
    b->normal = ebpo_alloc(n, sizeof *b->normal);
    ebpo_status status = EBPO_OK;
    if (!items || !scratch || !b->face || !b->face_source || !b->normal) {
        status = ebpo_fail_memory(error, n * 52);
        goto done;
    }
    for (uint64_t i = 0; i < n; i++) {
        const uint32_t *f = mesh->faces + 3 * i;
        uint32_t least = rank[f[0]] < rank[f[1]] ? rank[f[0]] : rank[f[1]];
        items[i].item = (uint32_t)i;
        items[i].key = least < rank[f[2]] ? least : rank[f[2]];
    }
    radix_sort(items, scratch, n);
    for (uint64_t i = 0; i < n; i++) {
        b->face_source[i] = items[i].item;
        for (int k = 0; k < 3; k++)
            b->face[i][k] = rank[mesh->faces[3 * (uint64_t)items[i].item + (uint64_t)k]];
    }
done:
    free(items);
    free(scratch);
    return status;
}

static ebpo_status make_normals(void *context, uint64_t begin, uint64_t end, unsigned worker, ebpo_error *error)
{
    ebpo_builder *b = context;
    (void)worker, (void)error;
    for (uint64_t i = begin; i < end; i++) {
        ebpo_triangle face;
        ebpo_build_triangle(b, (uint32_t)i, &face);
        if (!ebpo_face_normal_code(&b->box, &face, &b->normal[i]))
            b->normal[i] = EBPO_NO_NORMAL;
    }
    return EBPO_OK;
}

ebpo_status ebpo_build_order(ebpo_builder *b, const ebpo_mesh *mesh, ebpo_error *error)
{
    uint32_t *rank = ebpo_alloc(mesh->vertex_count, sizeof *rank);
    if (!rank)
        return ebpo_fail_memory(error, mesh->vertex_count * sizeof *rank);
    ebpo_status status = order_vertices(b, mesh, rank, error);
    if (status == EBPO_OK)
        status = order_faces(b, mesh, rank, error);
    free(rank);
    if (status == EBPO_OK)
        status = ebpo_parallel_for(b->threads, b->face_count, GRAIN, make_normals, b, &b->options->progress, "normals", error);
    if (status == EBPO_OK)
        status = ebpo_bounds_make(&b->bounds, b->position, b->vertex_count, error);
    return status;
}

static uint64_t lower_bound(const uint64_t *key, uint64_t count, uint64_t wanted)
{
    uint64_t low = 0;
    while (count) {
        uint64_t half = count / 2;
        if (key[low + half] < wanted) {
            low += half + 1;
            count -= half + 1;
        } else
            count = half;
    }
    return low;
}

void ebpo_build_vertex_range(const ebpo_builder *b, ebpo_cell cell, uint64_t *begin, uint64_t *end)
{
    ebpo_octcode code = ebpo_octcode_of_cell(cell);
    int below = 3 * (b->max_level - cell.level);
    *begin = lower_bound(b->key, b->vertex_count, code << below);
    *end = *begin + lower_bound(b->key + *begin, b->vertex_count - *begin, (code + 1) << below);
}
