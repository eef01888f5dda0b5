/* Which faces share a block, and how the blocks hang together. The octree is the hierarchy's
 * skeleton: a node's new faces are one range of numbers, so neighbouring children with few faces
 * share a block, and nodes with few blocks are passed up until eight come together. */
#include <stdlib.h>
#include <string.h>

#include "core/alloc.h"
#include "core/error.h"
#include "geometry/node_types.h"
#include "query/accel_parts.h"

/* What a walk brings up from a node: either up to eight faces that are no block yet, or up to eight
 * members of the hierarchy. */
typedef struct bundle {
    uint32_t begin, end; /* faces */
    int members;         /* 0: no block yet */
    uint32_t member[8];
} bundle;

typedef struct walk {
    ebpo_layout *out;
    const ebpo_slice *slice;
    uint64_t gray[EBPO_LEVELS_MAX], leaf[EBPO_LEVELS_MAX]; /* of each level, seen so far */
    uint64_t most;                                         /* blocks */
    bool failed;
} walk;

static uint32_t add_block(walk *w, uint32_t begin, uint32_t end)
{
    ebpo_layout *o = w->out;
    if (o->block_count >= w->most ||
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

/* first_block and last_block hold faces until all blocks are known. */
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

static void close_bundle(walk *w, bundle *b)
{
    if (b->members == 0 && b->end > b->begin) {
        b->member[0] = add_block(w, b->begin, b->end);
        b->members = 1;
    }
}

/* Neighbours that together fill a node best; of those not wrapped yet, or the hierarchy would get
 * deep. */
typedef struct run {
    int begin, end, members;
} run;

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

static bundle gather(const bundle *part, int parts)
{
    bundle out = { part[0].begin, part[parts - 1].end, 0, { 0 } };
    for (int i = 0; i < parts; i++)
        for (int k = 0; k < part[i].members; k++)
            out.member[out.members++] = part[i].member[k];
    return out;
}

/* Wraps neighbours in nodes, as full ones as there are, until all members together are at most
 * eight. */
static bundle join(walk *w, bundle *part, int parts)
{
    bool wrapped[8] = { false };
    int total = 0;
    for (int i = 0; i < parts; i++) {
        close_bundle(w, &part[i]);
        total += part[i].members;
    }
    while (total > EBPO_BLOCK && !w->failed) {
        run r = choose_run(part, parts, wrapped);
        bundle all = gather(part + r.begin, r.end - r.begin);
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
                     : gather(part, parts);
}

/* A range in its own order: blocks of equal size, eight by eight under nodes. */
static bundle split_range(walk *w, uint32_t begin, uint32_t end)
{
    uint64_t count = end - begin;
    if (count <= EBPO_BLOCK)
        return (bundle){ begin, end, 0, { 0 } };
    uint64_t span = EBPO_BLOCK;
    while (count > span * 8)
        span *= 8;
    uint64_t pieces = (count + span - 1) / span;
    bundle part[8];
    for (uint64_t i = 0; i < pieces; i++)
        part[i] = split_range(w, begin + (uint32_t)(count * i / pieces),
                              begin + (uint32_t)(count * (i + 1) / pieces));
    return join(w, part, (int)pieces);
}

static bundle walk_node(walk *w, int depth, ebpo_node_type type, uint32_t begin);

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
    return parts == 1 ? part[0] : join(w, part, parts);
}

static bundle walk_node(walk *w, int depth, ebpo_node_type type, uint32_t begin)
{
    if (type == EBPO_GRAY && depth + 1 < w->slice->level_count) /* pruned otherwise */
        return walk_gray(w, depth, begin);
    if (type == EBPO_LEAF)
        return split_range(w, begin, begin + w->slice->level[depth].leaf_new[w->leaf[depth]++]);
    return (bundle){ begin, begin, 0, { 0 } };
}

/* Blocks are found in the order in which they are filled; numbers them by their faces instead, so
 * that what lies below a node is one range of blocks. */
static bool renumber_blocks(ebpo_layout *o, uint64_t faces)
{
    uint32_t *at_face = ebpo_alloc(faces + 1, sizeof *at_face),
             *end = ebpo_alloc(o->block_count, sizeof *end);
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
        o->block_end[old] = number; /* from now on: the new number of an old one */
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

ebpo_status ebpo_layout_make(ebpo_layout *out, const ebpo_slice *slice, uint64_t most,
                             ebpo_error *error)
{
    memset(out, 0, sizeof *out);
    walk w = { .out = out, .slice = slice, .most = most };
    bundle part[2];
    int parts = 0;
    if (slice->outer_count)
        part[parts++] = split_range(&w, 0, slice->outer_count);
    part[parts] =
        walk_node(&w, 0, ebpo_group_type(slice->level[0].types[0], 0), slice->outer_count);
    if (part[parts].end > part[parts].begin)
        parts++;
    if (parts) {
        bundle all = join(&w, part, parts);
        if (!w.failed)
            out->top = add_bound(&w, &all);
        w.failed = w.failed || !renumber_blocks(out, part[parts - 1].end);
    }
    if (!w.failed)
        return EBPO_OK;
    bool full = out->block_count >= most;
    ebpo_layout_free(out);
    return full ? ebpo_fail(error, EBPO_E_LIMIT,
                            "the model has too many faces to be held at once; give a memory budget")
                : ebpo_fail_memory(error, slice->mesh.face_count * 8);
}

void ebpo_layout_free(ebpo_layout *layout)
{
    free(layout->block_begin);
    free(layout->block_end);
    free(layout->block_number);
    free(layout->child);
    free(layout->first_block);
    free(layout->last_block);
    memset(layout, 0, sizeof *layout);
}
