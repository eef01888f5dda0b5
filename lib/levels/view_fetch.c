#include "levels/view_fetch.h"

#include "format/subtree_index.h"
#include "geometry/octcode.h"

typedef struct fetching {
    ebpo_chunks *chunks;
    const ebpo_partial *partial;
    const ebpo_frontier *frontier;
    unsigned wanted;
    bool faces;
    const ebpo_view_depth *depth;
} fetching;

ebpo_view_group ebpo_view_children(const ebpo_waiting *w)
{
    return (ebpo_view_group){ { ebpo_octcode_level(w->octcode) + 1, w->below }, w->octcode };
}

/* What comes next, and after it what comes soon; returns how many groups. Of those that stand
 * together in blocks of so many, one. */
static unsigned coming(const fetching *f, const ebpo_view_group *first, unsigned block,
                       ebpo_view_group groups[EBPO_FRONTIER_BLOCKS])
{
    uint64_t best[EBPO_FRONTIER_BLOCKS];
    unsigned count = ebpo_frontier_blocks(f->frontier, block, best);
    groups[0] = *first;
    for (unsigned i = 0; i < count; i++) /* the first is the one at hand */
        groups[i] = ebpo_view_children(&f->frontier->at[best[i]]);
    return count ? count : 1;
}

/* Reads all that a group takes, for nothing but to find out what is missing. */
static void try_group(const fetching *f, const ebpo_view_group *group)
{
    ebpo_group read;
    ebpo_node leaf;
    ebpo_status status = ebpo_group_read(f->chunks, group->number.level, group->number.group,
                                         f->wanted, &read, NULL);
    for (unsigned octant = 0; octant < 8 && f->faces && status == EBPO_OK; octant++) {
        ebpo_slice slice;
        if (ebpo_view_leaf_of(group, &read, octant, &leaf) &&
            ebpo_slice_read_parts(&slice, f->chunks, &leaf, 0, NULL) == EBPO_OK)
            ebpo_slice_free(&slice);
    }
}

/* --- subtrees --- */

static bool below_subtrees(const fetching *f, const ebpo_view_group *group)
{
    return group->parent && ebpo_subtree_table_has(f->chunks->file, group->number.level);
}

/* The number of the subtree that a group stands in: its root's rank among gray nodes. */
static uint64_t subtree_of(const fetching *f, const ebpo_view_group *group)
{
    int last = ebpo_octcode_level(group->parent), level = f->chunks->file->info.subtree_level;
    ebpo_partial_node node = { 0, 0 };
    for (int depth = 1; depth <= level; depth++)
        node = (ebpo_partial_node){ f->partial->group[node.group].child[node.octant],
                                    (uint8_t)(group->parent >> 3 * (last - depth) & 7) };
    return ebpo_partial_children(f->partial, node);
}

enum { SUBTREES_MOST = 4096, WITH_FACES = 64 };

/* A subtree that the view goes into, by its number and its root. */
typedef struct entered {
    uint64_t number, octcode;
} entered;

typedef struct entering {
    unsigned count;
    entered list[SUBTREES_MOST];
} entering;

/* In which subtrees these groups stand, each once; not what waits at a root. */
static void enter_groups(const fetching *f, const ebpo_view_group *groups, unsigned count,
                         entering *e)
{
    int level = f->chunks->file->info.subtree_level;
    for (unsigned i = 0; i < count; i++) {
        if (!below_subtrees(f, &groups[i]) || (!f->faces && groups[i].number.level == level + 1))
            continue;
        uint64_t root = groups[i].parent >> 3 * (ebpo_octcode_level(groups[i].parent) - level);
        unsigned k = 0;
        while (k < e->count && e->list[k].octcode != root)
            k++;
        if (k == e->count)
            e->list[e->count++] = (entered){ subtree_of(f, &groups[i]), root };
    }
}

/* The subtrees that the view will come to from a node above them: the types of the levels in
 * between are in memory, or else are noted as missing. */
static void enter_below(const fetching *f, const ebpo_view_group *children, entering *e)
{
    int level = children->number.level;
    ebpo_group read;
    if (ebpo_group_read(f->chunks, level, children->number.group, 0, &read, NULL) != EBPO_OK)
        return;
    for (unsigned octant = 0; octant < 8 && e->count < SUBTREES_MOST; octant++) {
        uint64_t octcode = ebpo_octcode_child(children->parent, octant),
                 rank = read.rank[EBPO_GRAY] + ebpo_group_count(read.types, EBPO_GRAY, octant);
        if (ebpo_group_type(read.types, octant) != EBPO_GRAY ||
            f->depth->level(f->depth->user, octcode) <= level)
            continue;
        if (level == f->chunks->file->info.subtree_level)
            e->list[e->count++] = (entered){ rank, octcode };
        else
            enter_below(f, &(ebpo_view_group){ { level + 1, rank }, octcode }, e);
    }
}

/* What waits at the subtrees' roots and above. */
static void enter_frontier(const fetching *f, entering *e)
{
    int level = f->chunks->file->info.subtree_level;
    for (uint64_t i = 0; i < f->frontier->count && e->count < SUBTREES_MOST; i++) {
        const ebpo_waiting *w = &f->frontier->at[i];
        ebpo_view_group children = ebpo_view_children(w);
        if (w->turn == EBPO_TURN_SEEN && children.number.level <= level)
            enter_below(f, &children, e);
        else if (w->turn == EBPO_TURN_SEEN && children.number.level == level + 1)
            e->list[e->count++] = (entered){ w->below, w->octcode };
    }
}

/* Of the subtrees of these groups, all that the view will come to, as far as `most` bytes go.
 * Faces: not where it goes through so many that it comes to the end of none soon; then what the
 * next groups take is enough. */
static bool try_subtrees(const fetching *f, const ebpo_view_group *groups, unsigned count,
                         const ebpo_chunk_keys *keys, uint64_t most)
{
    entering e;
    bool planes = f->wanted & EBPO_GROUP_PLANES, windings = f->wanted & EBPO_GROUP_WINDINGS;
    uint32_t needs = EBPO_NEEDS_ALWAYS | (f->faces ? EBPO_NEEDS_MESH : 0) |
                     (windings ? EBPO_NEEDS_SOLID : 0) |
                     (planes ? EBPO_NEEDS_PLANES | EBPO_NEEDS_LEAF_PLANES : 0);
    e.count = 0;
    enter_groups(f, groups, count, &e);
    if (!f->faces)
        enter_frontier(f, &e);
    if (f->faces && e.count > WITH_FACES)
        return false;
    for (unsigned i = 0; i < e.count && keys->bytes < most; i++) {
        ebpo_expected none = EBPO_EXPECTED_INIT(f->chunks->file);
        ebpo_subtrees_expect(f->chunks, &none, e.list[i].number, 1, needs,
                             f->depth->level(f->depth->user, e.list[i].octcode), f->faces);
    }
    return e.count > 0;
}

/* --- fetching --- */

/* The chunks that the group waits for next, and, unless they have been announced before, behind
 * these what the next groups take: so one batch is used up before the next one is told. How many
 * are its own. */
static unsigned collect(const fetching *f, const ebpo_view_group *group, ebpo_chunk_keys *keys)
{
    enum { FACES_BLOCK = 64, TRIED = 64 }; /* trying is work */
    ebpo_view_group groups[EBPO_FRONTIER_BLOCKS];
    ebpo_chunk_keys_begin(keys);
    ebpo_chunks_collect(f->chunks, keys);
    try_group(f, group);
    unsigned own = keys->count;
    uint64_t most = keys->bytes + ebpo_chunks_room(f->chunks);
    if (own && !ebpo_chunks_announced(f->chunks, keys)) {
        unsigned count = coming(f, group, f->faces ? FACES_BLOCK : 1, groups);
        bool told = try_subtrees(f, groups, count, keys, most);
        for (unsigned i = 1; i < count && i < TRIED && !told && keys->bytes < most; i++)
            try_group(f, &groups[i]);
    }
    ebpo_chunks_collect(f->chunks, NULL);
    return own;
}

/* Pass by pass: lists, references, faces, vertices, with what ranks take in between. Beyond that,
 * reading goes on without having been announced. */
static ebpo_status fetch_tried(const fetching *f, const ebpo_view_group *group, ebpo_error *error)
{
    enum { PASSES = 12 };
    ebpo_chunk_keys keys;
    ebpo_status status = EBPO_OK;
    unsigned own = 1;
    for (int pass = 0; pass < PASSES && own && status == EBPO_OK; pass++) {
        own = collect(f, group, &keys);
        if (own)
            status = ebpo_chunks_fetch(f->chunks, &keys, own, error);
    }
    return status;
}

/* Nodes alone, of levels above the subtrees or of files without. */
static ebpo_status fetch_nodes(const fetching *f, const ebpo_view_group *group, ebpo_error *error)
{
    ebpo_view_group groups[EBPO_FRONTIER_BLOCKS];
    ebpo_group_number numbers[EBPO_FRONTIER_BLOCKS];
    if (!ebpo_group_is_far(f->chunks, &group->number, f->wanted))
        return EBPO_OK;
    if (f->chunks->limit == UINT64_MAX)
        ebpo_expect_top(f->chunks->file); /* with it what the subtrees ask for first */
    unsigned count = coming(f, group, EBPO_GROUP_BLOCK, groups);
    for (unsigned i = 0; i < count; i++)
        numbers[i] = groups[i].number;
    return ebpo_group_fetch(f->chunks, numbers, count, f->wanted, error);
}

ebpo_status ebpo_view_fetch(ebpo_chunks *chunks, const ebpo_partial *partial,
                            const ebpo_frontier *frontier, const ebpo_view_group *group,
                            unsigned wanted, bool faces, const ebpo_view_depth *depth,
                            ebpo_error *error)
{
    fetching f = { chunks, partial, frontier, wanted, faces, depth };
    ebpo_status status = EBPO_OK;
    if (!below_subtrees(&f, group))
        status = fetch_nodes(&f, group, error);
    return status == EBPO_OK && (faces || below_subtrees(&f, group)) ? fetch_tried(&f, group, error)
                                                                     : status;
}
