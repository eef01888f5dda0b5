/* Child tables and leaf records. */
#include <stdlib.h>
#include <string.h>

#include "core/alloc.h"
#include "core/error.h"
#include "core/os.h"
#include "geometry/node_types.h"
#include "query/accel_parts.h"

typedef struct walk {
    ebpo_accel *s;
    const ebpo_slice *slice;
    const uint32_t *slot_of;           /* [local face] */
    uint64_t rank[EBPO_LEVELS_MAX][4]; /* nodes of each type of each level, seen so far */
    uint64_t refs[EBPO_LEVELS_MAX];
    uint64_t group_begin[EBPO_LEVELS_MAX]; /* number of the first group of each level */
    uint64_t leaf_begin[EBPO_LEVELS_MAX];
    uint64_t list_capacity;
    ebpo_status status;
    ebpo_error *error;
} walk;

/* For a leaf's entries, at most. What all leaves need was made at once, and is given back at the
 * end. */
static bool make_list_room(walk *w, uint64_t more)
{
    ebpo_accel *s = w->s;
    if (!ebpo_grow(&s->list, &w->list_capacity, s->list_count + more, sizeof *s->list))
        w->status = ebpo_fail_memory(w->error, (s->list_count + more) * sizeof *s->list);
    else if (s->list_count + more > UINT32_MAX)
        w->status =
            ebpo_fail(w->error, EBPO_E_LIMIT,
                      "the leaves list too many faces to be held at once; give a memory budget");
    return w->status == EBPO_OK;
}

/* A leaf's entries so far. */
typedef struct listing {
    ebpo_listed_block *list;
    uint32_t count, block; /* that the last entry is of; none: no block's number */
    uint64_t last;
} listing;

/* Faces come in ascending order, and so do blocks: those of one block become one entry. Whether a
 * face begins one is a toss: without a branch. */
static inline void list_face(const walk *w, uint64_t face, listing *l)
{
    uint32_t slot = w->slot_of[face], block = slot / EBPO_BLOCK;
    uint64_t lane = UINT64_C(1) << (slot % EBPO_BLOCK + EBPO_LISTED_LANES);
    bool begins = block != l->block;
    l->last = (begins ? block : l->last) | lane;
    l->count += begins;
    l->block = block;
    ebpo_list(&l->list[l->count - 1], l->last);
}

/* References, which lie before the leaf's own faces, then these. */
static void fill_leaf(walk *w, const ebpo_level *level, int depth, uint64_t rank, uint32_t number)
{
    ebpo_accel_leaf *leaf = &w->s->leaf[number];
    uint64_t refs = level->leaf_ref_count[rank], fresh = level->leaf_new[rank];
    if (!make_list_room(w, refs + (fresh > EBPO_BLOCK ? 2 * fresh / 9 : 1)))
        return;
    listing l = { .list = w->s->list + w->s->list_count, .block = UINT32_MAX };
    const uint32_t *ref = refs ? level->leaf_refs + w->refs[depth] : NULL;
    for (uint64_t i = 0; i < refs; i++)
        list_face(w, ref[i], &l);
    for (uint64_t i = level->leaf_first[rank], end = i + fresh; i < end; i++)
        list_face(w, i, &l);
    if (!l.count) /* a leaf without faces: block 0 without lanes */
        l.count = 1;
    ebpo_list(&l.list[l.count - 1], l.last | EBPO_LISTED_LAST);
    if (w->s->list_longest < l.count)
        w->s->list_longest = l.count;
    leaf->list = (uint32_t)w->s->list_count;
    w->s->list_count += l.count;
    w->refs[depth] += refs;
    leaf->kind = w->s->solid ? EBPO_LEAF_UNKNOWN : EBPO_LEAF_GENERAL;
    leaf->winding = level->leaf_winding ? level->leaf_winding[rank] : 0;
}

static uint32_t uniform(walk *w, const int32_t *windings, uint64_t rank, int32_t usual)
{
    uint32_t entry = 0;
    if (!ebpo_entry_uniform(windings ? windings[rank] : usual, &entry))
        w->status =
            ebpo_fail(w->error, EBPO_E_LIMIT,
                      "a node's winding number is beyond 2^29: the solid has too many shells");
    return entry;
}

static uint32_t walk_node(walk *w, int depth, ebpo_node_type type)
{
    const ebpo_level *level = &w->slice->level[depth];
    uint64_t rank = w->rank[depth][type]++;
    if (w->status != EBPO_OK)
        return 0;
    if (type == EBPO_WHITE)
        return uniform(w, level->white_winding, rank, 0);
    if (type == EBPO_BLACK)
        return uniform(w, level->black_winding, rank, 1);
    if (type == EBPO_LEAF) {
        uint32_t number = (uint32_t)(w->leaf_begin[depth] + rank);
        fill_leaf(w, level, depth, rank, number);
        return ebpo_entry(EBPO_ENTRY_LEAF, number);
    }
    uint64_t group = w->group_begin[depth + 1] + rank;
    if (w->slice->pruned &&
        (depth + 1 == w->slice->level_count || w->slice->level[depth + 1].types[rank] == 0)) {
        if (depth + 1 < w->slice->level_count) {
            w->rank[depth + 1][EBPO_WHITE] += 8; /* where its children would be */
            memset(w->s->nodes.group[group], 0xff, sizeof w->s->nodes.group[group]);
        }
        return ebpo_entry(EBPO_ENTRY_BELOW, (uint32_t)group);
    }
    uint16_t types = w->slice->level[depth + 1].types[rank];
    for (unsigned octant = 0; octant < 8; octant++)
        w->s->nodes.group[group][octant] = walk_node(w, depth + 1, ebpo_group_type(types, octant));
    return ebpo_entry(EBPO_ENTRY_GRAY, (uint32_t)group);
}

static ebpo_status make_room(walk *w, const ebpo_layout *layout, uint32_t **slot_of)
{
    const ebpo_slice *slice = w->slice;
    ebpo_accel *s = w->s;
    uint64_t groups = 0, leaves = 0, refs = 0;
    for (int depth = 0; depth < slice->level_count; depth++) {
        w->group_begin[depth] = depth ? groups : 0;
        w->leaf_begin[depth] = leaves;
        groups += depth ? slice->level[depth].group_count : 0;
        leaves += slice->level[depth].leaf_count;
        refs += slice->level[depth].ref_count;
    }
    if (slice->level_count < EBPO_LEVELS_MAX)
        /* gray nodes are numbered on where they have no groups */
        w->group_begin[slice->level_count] = groups;
    if (groups >= EBPO_ENTRY_ZERO || leaves >= EBPO_ENTRY_ZERO)
        return ebpo_fail(w->error, EBPO_E_LIMIT,
                         "the tree has too many nodes to be held at once; give a memory budget");
    s->nodes.group = ebpo_alloc(groups, sizeof *s->nodes.group);
    s->nodes.group_count = (uint32_t)groups;
    s->leaf = ebpo_alloc_zero(leaves, sizeof *s->leaf);
    s->leaf_count = (uint32_t)leaves;
    uint64_t faces = layout->block_count ? layout->block_end[layout->block_count - 1] : 0;
    uint32_t *map = *slot_of = ebpo_alloc(faces, sizeof *map);
    bool list = ebpo_grow(&s->list, &w->list_capacity,
                          ebpo_list_most(refs, leaves, slice->face_count), sizeof *s->list);
    if (!s->nodes.group || !s->leaf || !map || !list)
        return ebpo_fail_memory(w->error, groups * 32 + leaves * sizeof *s->leaf + faces * 4);
    ebpo_prefer_huge_pages(s->nodes.group, groups * sizeof *s->nodes.group);
    ebpo_prefer_huge_pages(s->leaf, leaves * sizeof *s->leaf);
    ebpo_prefer_huge_pages(map, faces * sizeof *map);
    for (uint64_t b = 0; b < layout->block_count; b++)
        for (uint32_t face = layout->block_begin[b]; face < layout->block_end[b]; face++)
            map[face] = layout->block_number[b] * EBPO_BLOCK + face - layout->block_begin[b];
    return EBPO_OK;
}

/* What has been counted is what is held. */
static void trim_list(ebpo_accel *s)
{
    ebpo_listed_block *less = ebpo_realloc(s->list, s->list_count, sizeof *s->list);
    s->list = less ? less : s->list;
}

ebpo_status ebpo_accel_fill_nodes(ebpo_accel *s, const ebpo_slice *slice, const ebpo_layout *layout,
                                  ebpo_error *error)
{
    walk w = { .s = s, .slice = slice, .status = EBPO_OK, .error = error };
    uint32_t *slot_of = NULL;
    ebpo_status status = make_room(&w, layout, &slot_of);
    if (status == EBPO_OK) {
        w.slot_of = slot_of;
        s->nodes.root_level = slice->root.cell.level;
        s->nodes.root = walk_node(&w, 0, ebpo_group_type(slice->level[0].types[0], 0));
        status = w.status;
    }
    free(slot_of);
    if (status == EBPO_OK)
        trim_list(s);
    return status;
}
