/* Faces, up to eight together, with the vertices that they share. */
#include "core/strict_fp.h"

#include <stdlib.h>
#include <string.h>

#include "core/alloc.h"
#include "core/error.h"
#include "core/os.h"
#include "core/parallel.h"
#include "query/accel_parts.h"

/* Which of a block's vertices, in the order in which its faces have them: [face][corner]. */
typedef struct found {
    uint8_t at[EBPO_MESHLET_VERTICES], count;
} found;

typedef struct job {
    ebpo_accel *s;
    const ebpo_mesh *mesh;
    ebpo_layout *layout;
    found *found; /* of each block */
} job;

/* A block's vertices. */
typedef struct shared {
    uint32_t vertex[EBPO_MESHLET_VERTICES];
    const uint8_t *at; /* [face][corner]: which of them */
    unsigned faces, count;
} shared;

/* Open addressing: one more than the number of a vertex among the block's, 0: free. */
enum { TABLE_BITS = 6, TABLE = 1 << TABLE_BITS };

static const uint32_t *corners_of(const job *j, uint64_t block, unsigned *count)
{
    uint32_t begin = j->layout->block_begin[block];
    *count = 3 * (j->layout->block_end[block] - begin);
    return j->mesh->faces + 3 * (uint64_t)begin;
}

static void find_shared(const job *j, uint64_t block)
{
    unsigned corners, count = 0;
    const uint32_t *corner = corners_of(j, block, &corners);
    uint32_t vertex[EBPO_MESHLET_VERTICES + 1]; /* and one that is looked for */
    uint8_t table[TABLE] = { 0 };
    for (unsigned i = 0; i < corners; i++) {
        unsigned slot = corner[i] * UINT32_C(0x9e3779b1) >> (32 - TABLE_BITS), at;
        /* whether a corner is new is a toss: without a branch; vertices at one slot are rare */
        vertex[count] = corner[i];
        for (;; slot = (slot + 1) % TABLE) {
            at = table[slot] ? table[slot] - 1u : count;
            if (vertex[at] == corner[i])
                break;
        }
        table[slot] = (uint8_t)(at + 1);
        j->found[block].at[i] = (uint8_t)at;
        count += at == count;
    }
    j->found[block].count = (uint8_t)count;
}

static void take_shared(const job *j, uint64_t block, shared *out)
{
    unsigned corners;
    const uint32_t *corner = corners_of(j, block, &corners);
    out->at = j->found[block].at;
    out->faces = corners / 3;
    out->count = j->found[block].count;
    for (unsigned i = 0; i < corners; i++)
        out->vertex[out->at[i]] = corner[i];
}

/* Of the record, in units. */
static uint32_t size_of(const ebpo_accel *s, unsigned vertices)
{
    if (vertices > EBPO_MESHLET_SHARED)
        vertices = EBPO_MESHLET_VERTICES;
    size_t bytes = s->wide ? EBPO_MESHLET_WIDE + 3 * vertices * sizeof(double)
                           : sizeof(ebpo_meshlet) + 3 * vertices * sizeof(float);
    return (uint32_t)((bytes + EBPO_MESHLET_UNIT - 1) / EBPO_MESHLET_UNIT);
}

static ebpo_status measure(void *context, uint64_t begin, uint64_t end, unsigned worker,
                           ebpo_error *error)
{
    (void)worker;
    (void)error;
    job *j = context;
    for (uint64_t b = begin; b < end; b++) {
        find_shared(j, b);
        j->layout->block_number[b] = size_of(j->s, j->found[b].count);
    }
    return EBPO_OK;
}

/* From sizes to numbers. False: too many. */
static bool number_blocks(ebpo_accel *s, ebpo_layout *layout)
{
    for (uint64_t b = 0; b < layout->block_count; b++) {
        uint32_t size = layout->block_number[b];
        layout->block_number[b] = (uint32_t)s->units;
        s->units += size;
    }
    return s->units <= EBPO_BLOCKS_MOST;
}

/* --- filling --- */

/* What is not shared enough: each corner of each lane is a vertex of its own. */
static void spread(shared *v)
{
    uint32_t corner[EBPO_MESHLET_VERTICES];
    for (unsigned lane = 0; lane < EBPO_BLOCK; lane++)
        for (unsigned i = 0; i < 3; i++)
            corner[EBPO_BLOCK * i + lane] = v->vertex[v->at[3 * (lane < v->faces ? lane : 0) + i]];
    memcpy(v->vertex, corner, sizeof corner);
    v->count = EBPO_MESHLET_VERTICES;
}

static void set_corners(const shared *v, ebpo_meshlet *m)
{
    for (unsigned i = 0; i < 3; i++)
        for (unsigned lane = 0; lane < EBPO_BLOCK; lane++)
            m->corner[i] |= (uint32_t)v->at[3 * (lane < v->faces ? lane : 0) + i] << 4 * lane;
}

static void set_coordinates(const job *j, const shared *v, ebpo_meshlet *m)
{
    const ebpo_mesh *mesh = j->mesh;
    float *x32 = (void *)(m + 1);
    double *x64 = (void *)((char *)m + EBPO_MESHLET_WIDE);
    for (unsigned i = 0; i < v->count; i++)
        for (unsigned k = 0; k < 3; k++) {
            uint64_t from = 3 * (uint64_t)v->vertex[i] + k;
            unsigned to = k * v->count + i;
            if (!j->s->wide)
                x32[to] = mesh->xyz32[from];
            else
                x64[to] = mesh->xyz64 ? mesh->xyz64[from] : (double)mesh->xyz32[from];
        }
}

static ebpo_status fill(void *context, uint64_t begin, uint64_t end, unsigned worker,
                        ebpo_error *error)
{
    (void)worker;
    (void)error;
    job *j = context;
    shared v;
    for (uint64_t b = begin; b < end; b++) {
        take_shared(j, b, &v);
        char *at = j->s->meshlets + (uint64_t)j->layout->block_number[b] * EBPO_MESHLET_UNIT;
        memset(at, 0, (size_t)size_of(j->s, v.count) * EBPO_MESHLET_UNIT);
        ebpo_meshlet *m = (void *)at;
        if (v.count > EBPO_MESHLET_SHARED)
            spread(&v);
        else
            set_corners(&v, m);
        m->face = j->layout->block_begin[b];
        m->faces = (uint8_t)v.faces;
        m->vertices = (uint8_t)v.count;
        set_coordinates(j, &v, m);
    }
    return EBPO_OK;
}

/* Kernels read a table of 16 where it begins: what lies behind the last record is theirs too. */
static ebpo_status make_room(ebpo_accel *s, ebpo_error *error)
{
    uint64_t bytes = s->units * EBPO_MESHLET_UNIT;
    if (bytes > PTRDIFF_MAX - EBPO_MESHLET_UNIT)
        return ebpo_fail_memory(error, bytes);
    s->meshlets = aligned_alloc(EBPO_MESHLET_UNIT, (size_t)bytes + EBPO_MESHLET_UNIT);
    if (!s->meshlets)
        return ebpo_fail_memory(error, bytes);
    ebpo_prefer_huge_pages(s->meshlets, (size_t)bytes);
    memset(s->meshlets + bytes, 0, EBPO_MESHLET_UNIT);
    return EBPO_OK;
}

ebpo_status ebpo_accel_fill_blocks(ebpo_accel *s, const ebpo_accel_plan *plan, ebpo_room *room,
                                   unsigned threads, ebpo_error *error)
{
    ebpo_layout *layout = plan->layout;
    job j = { s, &plan->slice->mesh, layout, NULL };
    layout->block_number = ebpo_alloc(layout->block_count, sizeof *layout->block_number);
    j.found = ebpo_alloc(layout->block_count, sizeof *j.found);
    ebpo_status status = layout->block_number && j.found
                             ? EBPO_OK
                             : ebpo_fail_memory(error, layout->block_count * sizeof *j.found);
    if (status == EBPO_OK)
        status = ebpo_parallel_for(threads, NULL, layout->block_count, 1024, measure, &j, NULL,
                                   "open", error);
    if (status == EBPO_OK && !number_blocks(s, layout))
        status = ebpo_fail(error, EBPO_E_LIMIT,
                           "the model has too many faces to be held at once; give a memory budget");
    if (status == EBPO_OK)
        status = ebpo_accel_fits(room, plan, s->units, error);
    if (status == EBPO_OK)
        status = make_room(s, error);
    if (status == EBPO_OK)
        status = ebpo_parallel_for(threads, NULL, layout->block_count, 1024, fill, &j, NULL, "open",
                                   error);
    free(j.found);
    return status;
}
