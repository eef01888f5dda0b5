/* Makes blocks and the hierarchy over the blocks (accel.h). A block has at most eight faces and the
 * vertices of these faces.
 *
 * First, the layout decides which faces are in one block, and builds the hierarchy; the layout uses
 * no coordinates. The new faces of a node (faces that no leaf before the node lists) have
 * consecutive local indices. So neighbouring children with few new faces can share a block. The
 * hierarchy follows the octree: the blocks below an octree node are passed up to the node's parent.
 * If a parent receives more than eight blocks or nodes of the hierarchy, some of these are joined
 * in new nodes of the hierarchy. Then the blocks are measured, numbered and filled in parallel;
 * block_bounds.c computes their bounds. */
#include "core/strict_fp.h"

#include <stdlib.h>
#include <string.h>

#include "core/alloc.h"
#include "core/error.h"
#include "core/os.h"
#include "core/parallel.h"
#include "geometry/level_nodes.h"
#include "query/accel_parts.h"

/* The result of the walk below a node of the octree. A bundle has either at most eight faces that
 * have no block yet, or at most eight members: blocks or nodes of the hierarchy that contain the
 * octree node's faces. */
typedef struct bundle {
    uint32_t begin, end; /* range of faces, as local indices */
    int members;         /* number of members; 0: the faces have no block yet */
    uint32_t member[8];  /* as in ebpo_bound.child */
} bundle;

typedef struct walk {
    ebpo_layout *out;
    const ebpo_slice *slice;
    /* number of visited gray nodes, and of visited leaves, of each level */
    uint64_t gray[EBPO_LEVELS_MAX], leaf[EBPO_LEVELS_MAX];
    uint64_t blocks_max;
    bool failed; /* too many blocks, or out of memory */
} walk;

/* Adds a block of the faces begin .. end - 1. Returns the block as a member of a bundle. */
static uint32_t add_block(walk *w, uint32_t begin, uint32_t end)
{
    ebpo_layout *o = w->out;
    if (o->block_count >= w->blocks_max ||
        !ebpo_grow(&o->block_begin, &o->block_capacity, o->block_count + 1,
                   sizeof *o->block_begin) ||
        !ebpo_grow(&o->block_end, &o->block_capacity2, o->block_count + 1, sizeof *o->block_end)) {
        w->failed = true;
        return EBPO_NO_CHILD;
    }
    o->block_begin[o->block_count] = begin;
    o->block_end[o->block_count] = end;
    return (uint32_t)o->block_count++ | EBPO_IS_BLOCK;
}

/* Adds a node of the hierarchy with the members of a bundle. Returns the node as a member. Until
 * renumber_blocks is called, the node's first_block and last_block are the range of the node's
 * faces. */
static uint32_t add_bound(walk *w, const bundle *b)
{
    ebpo_layout *o = w->out;
    uint64_t n = o->bound_count;
    if (w->failed || !ebpo_grow(&o->child, &o->bound_capacity, n + 1, sizeof *o->child) ||
        !ebpo_grow(&o->first_block, &o->bound_capacity2, n + 1, sizeof *o->first_block) ||
        !ebpo_grow(&o->last_block, &o->bound_capacity3, n + 1, sizeof *o->last_block)) {
        w->failed = true;
        return EBPO_NO_CHILD;
    }
    for (int i = 0; i < 8; i++)
        o->child[n][i] = i < b->members ? b->member[i] : EBPO_NO_CHILD;
    o->first_block[n] = b->begin;
    o->last_block[n] = b->end;
    return (uint32_t)o->bound_count++;
}

/* Makes a block of the bundle's faces, if they have no block yet. */
static void close_bundle(walk *w, bundle *b)
{
    if (b->members == 0 && b->end > b->begin) {
        b->member[0] = add_block(w, b->begin, b->end);
        b->members = 1;
    }
}

/* The consecutive bundles begin .. end - 1 of an array, and the number of their members. */
typedef struct run {
    int begin, end, members;
} run;

/* Chooses the bundles that join_parts wraps in a node next: consecutive bundles that are not
 * wrapped yet and have as many members as possible, but at most eight. With emptier nodes, the
 * hierarchy would become deeper. */
static run choose_run(const bundle *part, int parts, const bool wrapped[8])
{
    run best = { 0, 0, 0 };
    for (int begin = 0; begin < parts; begin++) {
        int members = 0;
        for (int end = begin;
             end < parts && !wrapped[end] && members + part[end].members <= EBPO_BLOCK; end++) {
            members += part[end].members;
            if (members > best.members)
                best = (run){ begin, end + 1, members };
        }
    }
    return best;
}

/* Returns a bundle with the members of all parts. */
static bundle gather_parts(const bundle *part, int parts)
{
    bundle out = { part[0].begin, part[parts - 1].end, 0, { 0 } };
    for (int i = 0; i < parts; i++)
        for (int k = 0; k < part[i].members; k++)
            out.member[out.members++] = part[i].member[k];
    return out;
}

/* Joins consecutive bundles to one bundle of at most eight members. If the bundles together have
 * more members, wraps some of the bundles in nodes of the hierarchy. Changes `part`. */
static bundle join_parts(walk *w, bundle *part, int parts)
{
    bool wrapped[8] = { false };
    int total = 0;
    for (int i = 0; i < parts; i++) {
        close_bundle(w, &part[i]);
        total += part[i].members;
    }
    while (total > EBPO_BLOCK && !w->failed) {
        run r = choose_run(part, parts, wrapped);
        bundle all = gather_parts(part + r.begin, r.end - r.begin);
        total -= all.members - 1;
        all.member[0] = add_bound(w, &all);
        all.members = 1;
        part[r.begin] = all;
        wrapped[r.begin] = true;
        memmove(part + r.begin + 1, part + r.end, (size_t)(parts - r.end) * sizeof *part);
        memmove(wrapped + r.begin + 1, wrapped + r.end, (size_t)(parts - r.end));
        parts -= r.end - r.begin - 1;
    }
    return w->failed ? (bundle){ part[0].begin, part[parts - 1].end, 0, { 0 } }
                     : gather_parts(part, parts);
}

/* Splits a range of faces into consecutive blocks of about equal size, with at most eight blocks or
 * nodes below each node of the hierarchy. */
static bundle split_range(walk *w, uint32_t begin, uint32_t end)
{
    uint64_t count = end - begin;
    if (count <= EBPO_BLOCK)
        return (bundle){ begin, end, 0, { 0 } };
    uint64_t span = EBPO_BLOCK;
    while (count > span * 8)
        span *= 8;
    uint64_t parts = (count + span - 1) / span;
    bundle part[8];
    for (uint64_t i = 0; i < parts; i++)
        part[i] = split_range(w, begin + (uint32_t)(count * i / parts),
                              begin + (uint32_t)(count * (i + 1) / parts));
    return join_parts(w, part, (int)parts);
}

static bundle walk_node(walk *w, int depth, ebpo_node_type type, uint32_t begin);

/* Walks the children of the next gray node of the level. The node's faces begin at `begin`. */
static bundle walk_gray(walk *w, int depth, uint32_t begin)
{
    const ebpo_level *level = &w->slice->level[depth + 1];
    uint16_t types = level->types[w->gray[depth]++];
    bundle part[8];
    int parts = 0;
    uint32_t at = begin;
    for (unsigned octant = 0; octant < 8 && !w->failed; octant++) {
        bundle b = walk_node(w, depth + 1, ebpo_group_type(types, octant), at);
        at = b.end;
        if (b.end == b.begin)
            continue;
        bundle *last = parts ? &part[parts - 1] : NULL;
        if (last && last->members == 0 && b.members == 0 && b.end - last->begin <= EBPO_BLOCK)
            last->end = b.end;
        else
            part[parts++] = b;
    }
    if (parts == 0)
        return (bundle){ begin, at, 0, { 0 } };
    return parts == 1 ? part[0] : join_parts(w, part, parts);
}

/* Walks the next node of this type in its level. A gray node whose next level is not in the slice
 * is pruned, so it has no faces. */
static bundle walk_node(walk *w, int depth, ebpo_node_type type, uint32_t begin)
{
    if (type == EBPO_GRAY && depth + 1 < w->slice->level_count)
        return walk_gray(w, depth, begin);
    if (type == EBPO_LEAF)
        return split_range(w, begin, begin + w->slice->level[depth].leaf_new[w->leaf[depth]++]);
    return (bundle){ begin, begin, 0, { 0 } };
}

/* Sorts blocks in the order of their faces, so that the blocks below a node of the hierarchy are
 * one range. Before the call, the blocks are in the order in which the walk made them. Returns
 * false when out of memory. */
static bool renumber_blocks(ebpo_layout *o, uint64_t faces)
{
    uint32_t *at_face = ebpo_alloc(faces + 1, sizeof *at_face), /* block that begins at this face */
        *end = ebpo_alloc(o->block_count, sizeof *end);         /* new block_end */
    if (!at_face || !end) {
        free(at_face);
        free(end);
        return false;
    }
    for (uint64_t b = 0; b < o->block_count; b++)
        at_face[o->block_begin[b]] = (uint32_t)b;
    uint32_t number = 0;
    for (uint64_t face = 0; face < faces; number++) {
        uint32_t old = at_face[face];
        end[number] = o->block_end[old];
        o->block_end[old] = number; /* from now on, block_end[old] is the block's new index */
        at_face[face] = number;
        face = end[number];
    }
    at_face[faces] = number;
    for (uint64_t n = 0; n < o->bound_count; n++) {
        for (int i = 0; i < 8; i++)
            if (o->child[n][i] != EBPO_NO_CHILD && o->child[n][i] & EBPO_IS_BLOCK)
                o->child[n][i] = o->block_end[o->child[n][i] & ~EBPO_IS_BLOCK] | EBPO_IS_BLOCK;
        o->first_block[n] = at_face[o->first_block[n]];
        o->last_block[n] = at_face[o->last_block[n]];
    }
    for (uint32_t b = 0; b < number; b++)
        o->block_begin[b] = b ? end[b - 1] : 0;
    free(o->block_end);
    free(at_face);
    o->block_end = end;
    return true;
}

ebpo_status ebpo_layout_make(ebpo_layout *out, const ebpo_slice *slice, uint64_t blocks_max,
                             ebpo_error *error)
{
    memset(out, 0, sizeof *out);
    walk w = { .out = out, .slice = slice, .blocks_max = blocks_max };
    bundle part[2];
    int parts = 0;
    if (slice->shared_count)
        part[parts++] = split_range(&w, 0, slice->shared_count);
    part[parts] =
        walk_node(&w, 0, ebpo_group_type(slice->level[0].types[0], 0), slice->shared_count);
    if (part[parts].end > part[parts].begin)
        parts++;
    if (parts) {
        bundle all = join_parts(&w, part, parts);
        if (!w.failed)
            out->top = add_bound(&w, &all);
        w.failed = w.failed || !renumber_blocks(out, part[parts - 1].end);
    }
    if (!w.failed)
        return EBPO_OK;
    bool full = out->block_count >= blocks_max;
    ebpo_layout_free(out);
    return full ? ebpo_fail(error, EBPO_E_LIMIT,
                            "the model has too many faces to be held in memory at once; give a "
                            "memory budget")
                : ebpo_fail_memory(error, slice->mesh.face_count * 8);
}

void ebpo_layout_free(ebpo_layout *layout)
{
    free(layout->block_begin);
    free(layout->block_end);
    free(layout->block_number);
    free(layout->corners);
    free(layout->child);
    free(layout->first_block);
    free(layout->last_block);
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
    *count = 3 * (j->layout->block_end[block] - begin);
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
