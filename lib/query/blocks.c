/* Makes blocks (accel.h). A block has at most eight faces and the vertices of these faces.
 *
 * First, the layout decides which faces are in one block, without coordinates. The new faces of a
 * node (faces that no leaf before the node lists) have consecutive local indices. So neighbouring
 * children with few new faces can share a block. Then the blocks are measured, numbered and filled
 * in parallel. block_tree.c and block_bounds.c make the hierarchy over the blocks. */
#include "core/strict_fp.h"

#include <stdlib.h>
#include <string.h>

#include "core/alloc.h"
#include "core/error.h"
#include "core/os.h"
#include "core/parallel.h"
#include "geometry/level_nodes.h"
#include "query/accel_parts.h"

/* The faces of a node of the octree, as local indices. */
typedef struct range {
    uint32_t begin, end;
    bool open; /* the faces have no block yet; there are at most eight */
} range;

typedef struct walk {
    const ebpo_slice *slice;
    uint64_t *begins; /* has a bit for each face, and one more: a block begins with this face */
    uint64_t count;   /* number of blocks */
    /* number of visited gray nodes, and of visited leaves, of each level */
    uint64_t gray[EBPO_LEVELS_MAX], leaf[EBPO_LEVELS_MAX];
} walk;

/* Makes a block of the faces of a range, if they have no block yet. */
static void close_range(walk *w, range *r)
{
    if (r->open && r->end > r->begin) {
        w->begins[r->begin / 64] |= UINT64_C(1) << r->begin % 64;
        w->count++;
    }
    r->open = false;
}

/* Splits a range of more than eight faces into consecutive blocks of about equal size. */
static range split_range(walk *w, uint32_t begin, uint32_t end)
{
    uint64_t count = end - begin;
    if (count <= EBPO_BLOCK)
        return (range){ begin, end, true };
    uint64_t span = EBPO_BLOCK;
    while (count > span * 8)
        span *= 8;
    uint64_t parts = (count + span - 1) / span;
    for (uint64_t i = 0; i < parts; i++) {
        range part = split_range(w, begin + (uint32_t)(count * i / parts),
                                 begin + (uint32_t)(count * (i + 1) / parts));
        close_range(w, &part);
    }
    return (range){ begin, end, false };
}

static range walk_node(walk *w, int depth, ebpo_node_type type, uint32_t begin);

/* Walks the children of the next gray node of the level. The node's faces begin at `begin`. */
static range walk_gray(walk *w, int depth, uint32_t begin)
{
    const ebpo_level *level = &w->slice->level[depth + 1];
    uint16_t types = level->types[w->gray[depth]++];
    range part[8];
    int parts = 0;
    uint32_t at = begin;
    for (unsigned octant = 0; octant < 8; octant++) {
        range r = walk_node(w, depth + 1, ebpo_group_type(types, octant), at);
        at = r.end;
        if (r.end == r.begin)
            continue;
        range *last = parts ? &part[parts - 1] : NULL;
        if (last && last->open && r.open && r.end - last->begin <= EBPO_BLOCK)
            last->end = r.end;
        else
            part[parts++] = r;
    }
    if (parts == 1)
        return part[0];
    for (int i = 0; i < parts; i++)
        close_range(w, &part[i]);
    return (range){ begin, at, false };
}

/* Walks the next node of this type in its level. A gray node whose next level is not in the slice
 * is pruned, so it has no faces. */
static range walk_node(walk *w, int depth, ebpo_node_type type, uint32_t begin)
{
    if (type == EBPO_GRAY && depth + 1 < w->slice->level_count)
        return walk_gray(w, depth, begin);
    if (type == EBPO_LEAF)
        return split_range(w, begin, begin + w->slice->level[depth].leaf_new[w->leaf[depth]++]);
    return (range){ begin, begin, false };
}

/* Lists the blocks' first faces. Returns false when out of memory. */
static bool list_blocks(const walk *w, uint64_t faces, ebpo_layout *out)
{
    uint32_t *begin = out->block_begin = ebpo_alloc(w->count + 1, sizeof *begin);
    if (!begin)
        return false;
    for (uint64_t i = 0; i <= faces / 64; i++)
        for (uint64_t left = w->begins[i]; left; left &= left - 1)
            begin[out->block_count++] = (uint32_t)(64 * i) + (uint32_t)__builtin_ctzll(left);
    begin[out->block_count] = (uint32_t)faces;
    return true;
}

ebpo_status ebpo_layout_make(ebpo_layout *out, const ebpo_slice *slice, uint64_t blocks_max,
                             ebpo_error *error)
{
    memset(out, 0, sizeof *out);
    uint64_t faces = slice->mesh.face_count;
    walk w = { .slice = slice, .begins = ebpo_alloc_zero(faces / 64 + 1, sizeof *w.begins) };
    if (!w.begins)
        return ebpo_fail_memory(error, faces / 8);
    range shared = split_range(&w, 0, slice->shared_count);
    close_range(&w, &shared);
    out->shared_blocks = w.count;
    range owned = walk_node(&w, 0, ebpo_group_type(slice->level[0].types[0], 0), shared.end);
    close_range(&w, &owned);
    bool fits = w.count <= blocks_max, listed = fits && list_blocks(&w, owned.end, out);
    free(w.begins);
    return listed  ? EBPO_OK
           : !fits ? ebpo_fail(error, EBPO_E_LIMIT,
                               "the model has too many faces to be held in memory at once; give a "
                               "memory budget")
                   : ebpo_fail_memory(error, w.count * sizeof *out->block_begin);
}

void ebpo_layout_free(ebpo_layout *layout)
{
    free(layout->block_begin);
    free(layout->block_number);
    free(layout->corners);
    free(layout->ordered_number);
    free(layout->node);
    memset(layout, 0, sizeof *layout);
}

/* --- blocks --- */

/* The vertices of a block's corners. A block's vertices are in the order in which its faces first
 * use them. */
struct ebpo_block_corners {
    uint8_t at[EBPO_MESHLET_VERTICES]; /* [face][corner] index of the vertex in the block */
    uint8_t count;                     /* number of different vertices */
};

typedef struct job {
    ebpo_accel *s;
    const ebpo_mesh *mesh;
    ebpo_layout *layout;
} job;

/* A block's vertices, each once. */
typedef struct block_vertices {
    uint32_t vertex[EBPO_MESHLET_VERTICES]; /* [count] indices in the slice's mesh */
    const uint8_t *at;                      /* [face][corner]: index in `vertex` */
    unsigned faces, count;
} block_vertices;

/* A hash table of vertices. An entry is the index of a vertex in the block plus one; 0: free. */
enum { TABLE_BITS = 6, TABLE = 1 << TABLE_BITS };

/* Returns the vertex of each corner of the block's faces, as indices in the slice's mesh, and the
 * number of corners. */
static const uint32_t *corners_of(const job *j, uint64_t block, unsigned *count)
{
    uint32_t begin = j->layout->block_begin[block];
    *count = 3 * (j->layout->block_begin[block + 1] - begin);
    return j->mesh->faces + 3 * (uint64_t)begin;
}

/* Finds the different vertices of a block, and sets layout->corners[block]. */
static void find_vertices(const job *j, uint64_t block)
{
    unsigned corners, count = 0;
    const uint32_t *corner = corners_of(j, block, &corners);
    uint32_t vertex[EBPO_MESHLET_VERTICES + 1]; /* [entry]; element 0 is the searched vertex */
    uint8_t table[TABLE] = { 0 };
    for (unsigned i = 0; i < corners; i++) {
        unsigned slot = corner[i] * UINT32_C(0x9e3779b1) >> (32 - TABLE_BITS);
        /* A free slot compares as equal, and masks choose the entry: a branch on new vertices would
         * be unpredictable. Collisions are rare. */
        vertex[0] = corner[i];
        while (vertex[table[slot]] != corner[i])
            slot = (slot + 1) % TABLE;
        unsigned entry = table[slot], is_new = entry == 0;
        count += is_new;
        entry |= count & (0 - is_new);
        vertex[entry] = corner[i];
        table[slot] = (uint8_t)entry;
        j->layout->corners[block].at[i] = (uint8_t)(entry - 1);
    }
    j->layout->corners[block].count = (uint8_t)count;
}

static void copy_block(const job *j, uint64_t block, block_vertices *out)
{
    unsigned corners;
    const uint32_t *corner = corners_of(j, block, &corners);
    out->at = j->layout->corners[block].at;
    out->faces = corners / 3;
    out->count = j->layout->corners[block].count;
    for (unsigned i = 0; i < corners; i++)
        out->vertex[out->at[i]] = corner[i];
}

/* Returns the size of a block's record in units (EBPO_MESHLET_UNIT). */
static uint32_t size_of(const ebpo_accel *s, unsigned vertices)
{
    if (vertices > EBPO_MESHLET_SHARED)
        vertices = EBPO_MESHLET_VERTICES;
    size_t bytes = s->wide ? EBPO_MESHLET_WIDE + 3 * vertices * sizeof(double)
                           : sizeof(ebpo_meshlet) + 3 * vertices * sizeof(float);
    return (uint32_t)((bytes + EBPO_MESHLET_UNIT - 1) / EBPO_MESHLET_UNIT);
}

/* Finds the vertices of blocks, and stores the size of each block in layout->block_number. */
static ebpo_status measure_blocks(void *context, uint64_t begin, uint64_t end, unsigned worker,
                                  ebpo_error *error)
{
    (void)worker;
    (void)error;
    job *j = context;
    for (uint64_t b = begin; b < end; b++) {
        find_vertices(j, b);
        j->layout->block_number[b] = size_of(j->s, j->layout->corners[b].count);
    }
    return EBPO_OK;
}

/* Replaces the size of each block by its number, which is the sum of the sizes of the blocks before
 * it. Returns false if there are too many units. */
static bool number_blocks(ebpo_accel *s, ebpo_layout *layout)
{
    for (uint64_t b = 0; b < layout->block_count; b++) {
        uint32_t size = layout->block_number[b];
        layout->block_number[b] = (uint32_t)s->units;
        s->units += size;
    }
    return s->units <= EBPO_BLOCKS_MAX;
}

/* --- filling --- */

/* Gives each corner of each lane a separate vertex, as in a record with more than
 * EBPO_MESHLET_SHARED vertices. */
static void spread_corners(block_vertices *v)
{
    uint32_t corner[EBPO_MESHLET_VERTICES];
    for (unsigned lane = 0; lane < EBPO_BLOCK; lane++)
        for (unsigned i = 0; i < 3; i++)
            corner[EBPO_BLOCK * i + lane] = v->vertex[v->at[3 * (lane < v->faces ? lane : 0) + i]];
    memcpy(v->vertex, corner, sizeof corner);
    v->count = EBPO_MESHLET_VERTICES;
}

static void set_corners(const block_vertices *v, ebpo_meshlet *m)
{
    for (unsigned i = 0; i < 3; i++)
        for (unsigned lane = 0; lane < EBPO_BLOCK; lane++)
            m->corner[i] |= (uint32_t)v->at[3 * (lane < v->faces ? lane : 0) + i] << 4 * lane;
}

static void set_coordinates(const job *j, const block_vertices *v, ebpo_meshlet *m)
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

static ebpo_status fill_blocks(void *context, uint64_t begin, uint64_t end, unsigned worker,
                               ebpo_error *error)
{
    (void)worker;
    (void)error;
    job *j = context;
    block_vertices v;
    for (uint64_t b = begin; b < end; b++) {
        copy_block(j, b, &v);
        char *at = j->s->meshlets + (uint64_t)j->layout->block_number[b] * EBPO_MESHLET_UNIT;
        memset(at, 0, (size_t)size_of(j->s, v.count) * EBPO_MESHLET_UNIT);
        ebpo_meshlet *m = (void *)at;
        if (v.count > EBPO_MESHLET_SHARED)
            spread_corners(&v);
        else
            set_corners(&v, m);
        m->face = j->layout->block_begin[b];
        m->faces = (uint8_t)v.faces;
        m->vertices = (uint8_t)v.count;
        set_coordinates(j, &v, m);
    }
    return EBPO_OK;
}

/* Allocates the records. Kernels always read 16 vertices, which may be beyond a record's end, so
 * one more unit is allocated after the last record. */
static ebpo_status reserve_space(ebpo_accel *s, ebpo_error *error)
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

ebpo_status ebpo_accel_number_blocks(ebpo_accel *s, const ebpo_accel_plan *plan, unsigned threads,
                                     ebpo_error *error)
{
    ebpo_layout *layout = plan->layout;
    job j = { s, &plan->slice->mesh, layout };
    layout->block_number = ebpo_alloc(layout->block_count, sizeof *layout->block_number);
    layout->corners = ebpo_alloc(layout->block_count, sizeof *layout->corners);
    if (!layout->block_number || !layout->corners)
        return ebpo_fail_memory(error, layout->block_count * sizeof *layout->corners);
    ebpo_status status = ebpo_parallel_for(threads, NULL, layout->block_count, 1024, measure_blocks,
                                           &j, NULL, "open", error);
    if (status == EBPO_OK && !number_blocks(s, layout))
        status = ebpo_fail(error, EBPO_E_LIMIT,
                           "the model has too many faces to be held in memory at once; give a "
                           "memory budget");
    return status;
}

ebpo_status ebpo_accel_fill_blocks(ebpo_accel *s, const ebpo_accel_plan *plan, unsigned threads,
                                   ebpo_error *error)
{
    ebpo_layout *layout = plan->layout;
    job j = { s, &plan->slice->mesh, layout };
    ebpo_status status = reserve_space(s, error);
    if (status == EBPO_OK)
        status = ebpo_parallel_for(threads, NULL, layout->block_count, 1024, fill_blocks, &j, NULL,
                                   "open", error);
    free(layout->corners);
    layout->corners = NULL;
    return status;
}
