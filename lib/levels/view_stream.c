/* Delivers a view: one group of siblings after the other, in the order of the view's priority,
 * until the view's limits are reached.
 *
 * The cut of the view is the set of the delivered nodes without delivered children. To refine a
 * node is to replace it by its children. The frontier is the set of gray nodes of the cut, in the
 * order in which they are refined (view_cut.h). Each step takes the first node of the frontier and
 * reads the group of its children. If faces are requested, it also reads the faces of the leaves
 * among them. Then it returns these siblings one by one. After the last sibling, the siblings
 * replace their parent in the cut. When the observer changes, the frontier is sorted again;
 * delivered nodes stay.
 *
 * For remote files, the chunks that a group needs are requested in one batch. If the memory for
 * chunks is sufficient, the batch also has the chunks of the groups that follow. */
#include "core/strict_fp.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include <ebpo/view.h>

#include "core/alloc.h"
#include "core/error.h"
#include "core/fp_env.h"
#include "format/file_nodes.h"
#include "format/slice.h"
#include "format/subtree_index.h"
#include "geometry/cells.h"
#include "levels/view_cut.h"

/* Faces of the leaves among the current siblings, and flags of delivered faces. */
typedef struct view_leaves {
    const ebpo_info *info;
    ebpo_slice slice[8]; /* faces of the leaves among the siblings, by octant */
    uint8_t *delivered;  /* bit f: face f was delivered */
    /* Faces of the last returned leaf, valid until the next node is returned. */
    double (*corners)[3][3];
    uint32_t *file_faces; /* indices of the faces in the file */
    uint8_t *repeated;    /* 1: the face was delivered before */
    /* number of faces for which corners, file_faces and repeated have space */
    uint64_t capacity[3];
    ebpo_view_faces current; /* its pointers refer to these three arrays */
} view_leaves;

/* A group of siblings; `parent` is an octcode (locational code), 0 for the root's group. */
typedef struct view_group {
    ebpo_group_number number;
    uint64_t parent;
} view_group;

/* A function with its argument. For the node with this octcode, it returns the first level at which
 * the view will refine no descendant of the node soon (depth_of_view). */
typedef struct view_depth {
    int (*level)(const void *user, uint64_t octcode);
    const void *user;
} view_depth;

struct ebpo_view_stream {
    const ebpo_file *file;
    const ebpo_info *info;
    ebpo_box box;
    ebpo_view_options options; /* options.observer is NULL or &observer */
    ebpo_observer observer;
    ebpo_viewpoint viewpoint; /* prepared from `observer` */
    ebpo_chunks *chunks;
    ebpo_partial partial;
    /* gray nodes of the cut that have children in the file, except `parent` */
    ebpo_frontier frontier;
    bool delivering; /* true while the last group of `partial` is being delivered */
    /* parent of the group being delivered; not used while the root is delivered */
    ebpo_waiting parent;
    unsigned step, octant_mask; /* the next sibling to deliver has the octant step ^ octant_mask */
    uint64_t delivered, cut[4]; /* number of delivered nodes; nodes of each type in the cut */
    ebpo_group read;            /* the group being delivered, as read from the file */
    ebpo_envelope_stack *envelopes; /* NULL if no polygons are requested */
    ebpo_node_buffers buffers;      /* arrays of the last returned node */
    view_leaves *leaves;            /* NULL if no faces are requested */
    /* nodes deeper than soon_level, or smaller than soon_pixels pixels, are not prefetched yet */
    int soon_level;
    double soon_pixels;
    ebpo_patch_table patches; /* read by ebpo_view_stream_surface */
};

static ebpo_status view_leaves_new(view_leaves **out, const ebpo_file *file, ebpo_error *error)
{
    const ebpo_info *info = ebpo_file_info(file);
    *out = NULL;
    if (!(info->parts & EBPO_PART_MESH))
        return ebpo_fail(error, EBPO_E_ABSENT,
                         "view options: faces are requested, but the file was written without "
                         "its mesh; build it again with the mesh");
    view_leaves *l = ebpo_alloc_zero(1, sizeof *l);
    if (l)
        l->delivered = ebpo_alloc_zero(info->face_count / 8 + 1, 1);
    if (!l || !l->delivered) {
        free(l);
        return ebpo_fail_memory(error, sizeof *l + info->face_count / 8 + 1);
    }
    l->info = info;
    *out = l;
    return EBPO_OK;
}

static void drop_slices(view_leaves *l)
{
    for (unsigned octant = 0; octant < 8; octant++)
        ebpo_slice_free(&l->slice[octant]);
}

static void view_leaves_free(view_leaves *l)
{
    if (!l)
        return;
    drop_slices(l);
    free(l->delivered);
    free(l->corners);
    free(l->file_faces);
    free(l->repeated);
    free(l);
}

/* If the node of this octant is a leaf, writes the node to *out and returns true. `read`: the data
 * of `group`. */
static bool leaf_of_group(const view_group *group, const ebpo_group *read, unsigned octant,
                          ebpo_node *out)
{
    if (ebpo_group_type(read->types, octant) != EBPO_LEAF ||
        octant >= ebpo_group_octants(group->number.level))
        return false;
    uint64_t octcode = group->parent ? ebpo_octcode_child(group->parent, octant) : 1;
    *out = (ebpo_node){ .cell = ebpo_cell_of_octcode(octcode),
                        .type = EBPO_LEAF,
                        .rank = read->rank[EBPO_LEAF] +
                                ebpo_group_count(read->types, EBPO_LEAF, octant) };
    return true;
}

/* --- faces of leaves: reading --- */

static ebpo_status reserve_space(view_leaves *l, uint64_t faces, ebpo_error *error)
{
    bool grown = ebpo_grow(&l->corners, &l->capacity[0], faces, sizeof *l->corners) &&
                 ebpo_grow(&l->file_faces, &l->capacity[1], faces, sizeof *l->file_faces) &&
                 ebpo_grow(&l->repeated, &l->capacity[2], faces, sizeof *l->repeated);
    return grown
               ? EBPO_OK
               : ebpo_fail_memory(error, faces * (sizeof *l->corners + sizeof *l->file_faces + 1));
}

/* Reads the faces of all leaves of a group. After a failure, no leaf has faces. */
static ebpo_status view_leaves_read(view_leaves *l, ebpo_chunks *chunks, const view_group *group,
                                    const ebpo_group *read, ebpo_error *error)
{
    ebpo_status status = EBPO_OK;
    ebpo_node leaf;
    drop_slices(l);
    for (unsigned octant = 0; octant < 8 && status == EBPO_OK; octant++)
        if (leaf_of_group(group, read, octant, &leaf)) {
            status = ebpo_slice_read_parts(&l->slice[octant], chunks, &leaf, 0, error);
            if (status == EBPO_OK)
                status = reserve_space(l, l->slice[octant].mesh.face_count, error);
        }
    if (status != EBPO_OK)
        drop_slices(l);
    return status;
}

/* --- faces of leaves: returning them --- */

/* Clears `current`, for a node without faces. */
static void clear_faces(view_leaves *l) { l->current = (ebpo_view_faces)EBPO_VIEW_FACES_INIT; }

/* Copies a face of the slice to the arrays of the returned leaf, and marks it as delivered. */
static void take_face(view_leaves *l, const ebpo_slice *slice, uint32_t face)
{
    const ebpo_mesh *mesh = &slice->mesh;
    uint64_t number = ebpo_slice_file_face(slice, face);
    for (uint64_t i = 0; i < 9; i++) {
        uint64_t at = 3 * (uint64_t)mesh->faces[3 * (uint64_t)face + i / 3] + i % 3;
        l->corners[face][i / 3][i % 3] = mesh->xyz32 ? (double)mesh->xyz32[at] : mesh->xyz64[at];
    }
    l->file_faces[face] = (uint32_t)number;
    l->repeated[face] = l->delivered[number / 8] >> number % 8 & 1;
    l->delivered[number / 8] |= (uint8_t)(1u << number % 8);
    l->current.new_count += !l->repeated[face];
}

/* Sets `current` to the faces of the node at this octant. A node that is not a leaf has no faces.
 */
static void set_faces(view_leaves *l, unsigned octant)
{
    const ebpo_slice *slice = &l->slice[octant];
    clear_faces(l);
    l->current.face_count = slice->mesh.face_count;
    l->current.corners = (const double(*)[3][3])l->corners;
    l->current.file_faces = l->file_faces;
    l->current.repeated = l->repeated;
    for (uint32_t face = 0; face < slice->mesh.face_count; face++)
        take_face(l, slice, face);
}

/* --- fetching: requests --- */

/* Arguments of fetch_group, for the functions of the sections "fetching". */
typedef struct fetching {
    ebpo_chunks *chunks;
    const ebpo_partial *partial;
    const ebpo_frontier *frontier;
    /* data that are needed for each group: EBPO_GROUP_PLANES, EBPO_GROUP_WINDINGS */
    unsigned wanted;
    bool faces; /* true: the faces of leaves are also needed */
    const view_depth *depth;
} fetching;

/* Returns the group of children of a node of the frontier. */
static view_group children_of(const ebpo_waiting *w)
{
    return (view_group){ { ebpo_octcode_level(w->octcode) + 1, w->child_group }, w->octcode };
}

/* Lists the group to deliver next (`first`), and groups that will be delivered soon. Lists only one
 * group of each block; a block consists of `span` neighbouring groups of a level. Returns the
 * number of listed groups. */
static unsigned coming_groups(const fetching *f, const view_group *first, unsigned span,
                              view_group groups[EBPO_FRONTIER_BLOCKS])
{
    uint64_t best[EBPO_FRONTIER_BLOCKS];
    unsigned count = ebpo_frontier_blocks(f->frontier, span, best);
    if (count == 0)
        groups[0] = *first;              /* the root's group; the frontier is empty */
    for (unsigned i = 0; i < count; i++) /* groups[0] is `first` */
        groups[i] = children_of(&f->frontier->at[best[i]]);
    return count ? count : 1;
}

/* Reads a group from the chunks in memory, and drops the result. The purpose is to record which
 * chunks are missing (ebpo_chunks_collect). */
static void try_group(const fetching *f, const view_group *group)
{
    ebpo_group read;
    ebpo_node leaf;
    ebpo_status status = ebpo_group_read(f->chunks, group->number.level, group->number.group,
                                         f->wanted, &read, NULL);
    for (unsigned octant = 0; octant < 8 && f->faces && status == EBPO_OK; octant++) {
        ebpo_slice slice;
        if (leaf_of_group(group, &read, octant, &leaf) &&
            ebpo_slice_read_parts(&slice, f->chunks, &leaf, 0, NULL) == EBPO_OK)
            ebpo_slice_free(&slice);
    }
}

/* --- fetching: subtrees --- */

/* Returns true if the group is in a subtree that the file's table of subtrees lists. */
static bool is_in_subtree(const fetching *f, const view_group *group)
{
    return group->parent && ebpo_subtree_table_has(f->chunks->file, group->number.level);
}

/* Returns the index of the subtree that contains the group: the rank of the subtree's root among
 * the gray nodes of its level. */
static uint64_t subtree_of(const fetching *f, const view_group *group)
{
    int last = ebpo_octcode_level(group->parent), level = f->chunks->file->info.subtree_level;
    ebpo_partial_node node = { 0, 0 };
    for (int depth = 1; depth <= level; depth++)
        node = (ebpo_partial_node){ f->partial->group[node.group].child[node.octant],
                                    (uint8_t)(group->parent >> 3 * (last - depth) & 7) };
    return ebpo_partial_children(f->partial, node);
}

/* SUBTREES_MAX: maximum length of a list of subtrees. SUBTREES_WITH_FACES: if faces are requested
 * and the view will refine nodes in more subtrees than this number, try_subtrees collects nothing.
 */
enum { SUBTREES_MAX = 4096, SUBTREES_WITH_FACES = 64 };

/* A subtree in which the view refines nodes: its index, and the octcode of its root. */
typedef struct view_subtree {
    uint64_t index, octcode;
} view_subtree;

typedef struct subtree_list {
    unsigned count;
    view_subtree list[SUBTREES_MAX];
} subtree_list;

/* Lists the subtrees that contain these groups, each subtree once. If no faces are requested, skips
 * the groups directly below a subtree's root, because list_frontier_subtrees lists their subtrees.
 */
static void list_group_subtrees(const fetching *f, const view_group *groups, unsigned count,
                                subtree_list *e)
{
    int level = f->chunks->file->info.subtree_level;
    for (unsigned i = 0; i < count; i++) {
        if (!is_in_subtree(f, &groups[i]) || (!f->faces && groups[i].number.level == level + 1))
            continue;
        uint64_t root = groups[i].parent >> 3 * (ebpo_octcode_level(groups[i].parent) - level);
        unsigned k = 0;
        while (k < e->count && e->list[k].octcode != root)
            k++;
        if (k == e->count)
            e->list[e->count++] = (view_subtree){ subtree_of(f, &groups[i]), root };
    }
}

/* Lists the subtrees below a node in which the view will refine nodes. `children`: the group of the
 * node's children, whose level is at most the level of the subtrees' roots. If node types of a
 * level in between are not in memory, their chunks are recorded as missing. */
static void list_descendant_subtrees(const fetching *f, const view_group *children, subtree_list *e)
{
    int level = children->number.level;
    ebpo_group read;
    if (ebpo_group_read(f->chunks, level, children->number.group, 0, &read, NULL) != EBPO_OK)
        return;
    for (unsigned octant = 0; octant < 8 && e->count < SUBTREES_MAX; octant++) {
        uint64_t octcode = ebpo_octcode_child(children->parent, octant),
                 rank = read.rank[EBPO_GRAY] + ebpo_group_count(read.types, EBPO_GRAY, octant);
        if (ebpo_group_type(read.types, octant) != EBPO_GRAY ||
            f->depth->level(f->depth->user, octcode) <= level)
            continue;
        if (level == f->chunks->file->info.subtree_level)
            e->list[e->count++] = (view_subtree){ rank, octcode };
        else
            list_descendant_subtrees(f, &(view_group){ { level + 1, rank }, octcode }, e);
    }
}

/* Lists the subtrees in which the view will refine nodes, and whose root is a visible node of the
 * frontier or below such a node. */
static void list_frontier_subtrees(const fetching *f, subtree_list *e)
{
    int level = f->chunks->file->info.subtree_level;
    for (uint64_t i = 0; i < f->frontier->count && e->count < SUBTREES_MAX; i++) {
        const ebpo_waiting *w = &f->frontier->at[i];
        view_group children = children_of(w);
        if (w->turn == EBPO_TURN_SEEN && children.number.level <= level)
            list_descendant_subtrees(f, &children, e);
        else if (w->turn == EBPO_TURN_SEEN && children.number.level == level + 1)
            e->list[e->count++] = (view_subtree){ w->child_group, w->octcode };
    }
}

/* Collects all chunks that the view needs from the subtrees of these groups, up to `byte_limit`
 * bytes. Returns false in two cases: the groups are in no subtree; or faces are requested, and
 * there are so many subtrees that none will be completed soon. Then the caller collects only the
 * chunks of the next groups. */
static bool try_subtrees(const fetching *f, const view_group *groups, unsigned count,
                         const ebpo_chunk_keys *keys, uint64_t byte_limit)
{
    subtree_list e;
    bool planes = f->wanted & EBPO_GROUP_PLANES, windings = f->wanted & EBPO_GROUP_WINDINGS;
    uint32_t needs = EBPO_NEEDS_ALWAYS | (f->faces ? EBPO_NEEDS_MESH : 0) |
                     (windings ? EBPO_NEEDS_SOLID : 0) |
                     (planes ? EBPO_NEEDS_PLANES | EBPO_NEEDS_LEAF_PLANES : 0);
    e.count = 0;
    list_group_subtrees(f, groups, count, &e);
    if (!f->faces)
        list_frontier_subtrees(f, &e);
    if (f->faces && e.count > SUBTREES_WITH_FACES)
        return false;
    for (unsigned i = 0; i < e.count && keys->bytes < byte_limit; i++) {
        ebpo_hints none = EBPO_HINTS_INIT(f->chunks->file);
        ebpo_subtrees_hint(f->chunks, &none, e.list[i].index, 1, needs,
                           f->depth->level(f->depth->user, e.list[i].octcode), f->faces);
    }
    return e.count > 0;
}

/* --- fetching --- */

/* Collects in `keys` the missing chunks of the group, and returns their number. If all of these
 * chunks were prefetched with an earlier batch, collects nothing else, so that the view uses the
 * chunks of one batch before it requests the next batch. Otherwise also collects the missing chunks
 * of the groups that follow. */
static unsigned collect_chunks(const fetching *f, const view_group *group, ebpo_chunk_keys *keys)
{
    /* FACES_BLOCK: if faces are requested, only one of this number of neighbouring groups is
     * listed. TRIED: maximum number of calls of try_group, which takes time. */
    enum { FACES_BLOCK = 64, TRIED = 64 };
    view_group groups[EBPO_FRONTIER_BLOCKS];
    ebpo_chunk_keys_begin(keys);
    ebpo_chunks_collect(f->chunks, keys);
    try_group(f, group);
    unsigned missing = keys->count;
    uint64_t byte_limit = keys->bytes + ebpo_chunks_capacity(f->chunks);
    if (missing && !ebpo_chunks_hinted(f->chunks, keys)) {
        unsigned count = coming_groups(f, group, f->faces ? FACES_BLOCK : 1, groups);
        bool collected = try_subtrees(f, groups, count, keys, byte_limit);
        for (unsigned i = 1; i < count && i < TRIED && !collected && keys->bytes < byte_limit; i++)
            try_group(f, &groups[i]);
    }
    ebpo_chunks_collect(f->chunks, NULL);
    return missing;
}

/* Fetches the chunks of the group in passes. The chunks of one pass show which chunks the next pass
 * needs: the face lists of leaves give the faces, and the faces give the vertices. Chunks that are
 * missing after the last pass are read one by one later. */
static ebpo_status fetch_tried(const fetching *f, const view_group *group, ebpo_error *error)
{
    enum { PASSES = 12 };
    ebpo_chunk_keys keys;
    ebpo_status status = EBPO_OK;
    unsigned missing = 1;
    for (int pass = 0; pass < PASSES && missing && status == EBPO_OK; pass++) {
        missing = collect_chunks(f, group, &keys);
        if (missing)
            status = ebpo_chunks_fetch(f->chunks, &keys, missing, error);
    }
    return status;
}

/* Fetches nodes only, in levels above the subtrees or in files without subtrees. */
static ebpo_status fetch_nodes(const fetching *f, const view_group *group, ebpo_error *error)
{
    view_group groups[EBPO_FRONTIER_BLOCKS];
    ebpo_group_number numbers[EBPO_FRONTIER_BLOCKS];
    if (!ebpo_group_is_far(f->chunks, &group->number, f->wanted))
        return EBPO_OK;
    if (f->chunks->limit == UINT64_MAX)
        /* requests the levels above the subtrees together with the first data of the subtrees */
        ebpo_hint_top(f->chunks->file);
    unsigned count = coming_groups(f, group, EBPO_GROUP_BLOCK, groups);
    for (unsigned i = 0; i < count; i++)
        numbers[i] = groups[i].number;
    return ebpo_group_fetch(f->chunks, numbers, count, f->wanted, error);
}

/* Fetches missing chunks of a remote file: the chunks of the group's `wanted` data (EBPO_GROUP_...)
 * and, if `faces` is true, of the faces of the group's leaves. Also prefetches chunks of the groups
 * that follow. If the file has a table of subtrees, prefetches all needed chunks of the subtrees
 * that contain these groups. Returns EBPO_E_LIMIT when the view's limit of bytes is exceeded. */
static ebpo_status fetch_group(ebpo_chunks *chunks, const ebpo_partial *partial,
                               const ebpo_frontier *frontier, const view_group *group,
                               unsigned wanted, bool faces, const view_depth *depth,
                               ebpo_error *error)
{
    fetching f = { chunks, partial, frontier, wanted, faces, depth };
    ebpo_status status = EBPO_OK;
    if (!is_in_subtree(&f, group))
        status = fetch_nodes(&f, group, error);
    return status == EBPO_OK && (faces || is_in_subtree(&f, group)) ? fetch_tried(&f, group, error)
                                                                    : status;
}

/* Least memory of a view, in bytes. If the chunks of one group did not fit into the memory, every
 * group would read all chunks again. */
enum { MEMORY_LEAST = 1 << 20 };

/* --- options --- */

static ebpo_status check_options(const ebpo_view_options *o, ebpo_error *error)
{
    if (o->priority < EBPO_PRIORITY_LEVEL || o->priority > EBPO_PRIORITY_FRONT_TO_BACK)
        return ebpo_fail(error, EBPO_E_ARGUMENT, "view options: priority %d does not exist",
                         (int)o->priority);
    if (o->unseen != EBPO_UNSEEN_LAST && o->unseen != EBPO_UNSEEN_NEVER)
        return ebpo_fail(error, EBPO_E_ARGUMENT,
                         "view options: rule %d for unseen nodes does not exist", (int)o->unseen);
    if (!(o->pixels >= 0) || !(o->distance >= 0) || isinf(o->pixels))
        return ebpo_fail(
            error, EBPO_E_ARGUMENT,
            "view options: pixels must be a finite number and distance a number, both at least 0");
    if (o->memory && o->memory < MEMORY_LEAST)
        return ebpo_fail(error, EBPO_E_ARGUMENT,
                         "view options: memory must be at least %d bytes, or 0", MEMORY_LEAST);
    if (!o->observer &&
        (o->priority != EBPO_PRIORITY_LEVEL || o->pixels > 0 || !isinf(o->distance)))
        return ebpo_fail(
            error, EBPO_E_ARGUMENT,
            "view options: pixels, distance and all priorities except by level need an observer");
    return EBPO_OK;
}

/* Checks the options and copies them, with the observer, to the stream. After a failure, the stream
 * is unchanged. */
static ebpo_status take_options(ebpo_view_stream *s, const ebpo_view_options *options,
                                ebpo_error *error)
{
    ebpo_viewpoint viewpoint;
    ebpo_observer observer = EBPO_OBSERVER_INIT;
    ebpo_status status = check_options(options, error);
    if (status == EBPO_OK)
        status = EBPO_TAKE(ebpo_observer, &observer, options->observer, error);
    if (status == EBPO_OK)
        status =
            ebpo_viewpoint_make(&viewpoint, &s->box, options->observer ? &observer : NULL, error);
    if (status != EBPO_OK)
        return status;
    s->observer = observer;
    s->viewpoint = viewpoint;
    s->options = *options;
    s->options.observer = options->observer ? &s->observer : NULL;
    return EBPO_OK;
}

ebpo_status ebpo_view_stream_new(const ebpo_file *file, const ebpo_view_options *options,
                                 ebpo_view_stream **out, ebpo_error *error)
{
    EBPO_DEFAULT_FP;
    ebpo_view_options wanted = EBPO_VIEW_OPTIONS_INIT;
    *out = NULL;
    ebpo_status status = EBPO_TAKE(ebpo_view_options, &wanted, options, error);
    if (status != EBPO_OK)
        return status;
    ebpo_view_stream *s = ebpo_alloc_zero(1, sizeof *s);
    if (!s)
        return ebpo_fail_memory(error, sizeof *s);
    s->file = file;
    s->info = ebpo_file_info(file);
    s->box = ebpo_root_box(s->info);
    status = take_options(s, &wanted, error);
    if (status == EBPO_OK)
        status = ebpo_chunks_make_counted(&s->chunks, file, s->options.memory, error);
    s->partial.windings = s->options.windings;
    if (status == EBPO_OK && s->options.faces)
        status = view_leaves_new(&s->leaves, file, error);
    if (status == EBPO_OK && s->options.polygons &&
        !(s->envelopes = ebpo_alloc_zero(1, sizeof *s->envelopes)))
        status = ebpo_fail_memory(error, sizeof *s->envelopes);
    if (status == EBPO_OK)
        *out = s;
    else
        ebpo_view_stream_free(s);
    return status;
}

void ebpo_view_stream_free(ebpo_view_stream *s)
{
    if (!s)
        return;
    ebpo_chunks_free(s->chunks);
    ebpo_partial_free(&s->partial);
    ebpo_frontier_free(&s->frontier);
    view_leaves_free(s->leaves);
    ebpo_patch_table_free(&s->patches);
    free(s->envelopes);
    free(s);
}

/* --- the next group --- */

/* Returns the class, in the order of refinement, of a node of this level. `sight`: result of
 * ebpo_viewpoint_see for the node. */
static ebpo_turn turn_of(const ebpo_view_stream *s, int level, ebpo_seen sight)
{
    const ebpo_view_options *o = &s->options;
    if ((o->level >= 0 && level >= o->level) ||
        (o->pixels > 0 &&
         ebpo_viewpoint_pixels(&s->viewpoint, level, sight.distance2) <= o->pixels) ||
        (!isinf(o->distance) &&
         ebpo_viewpoint_distance(&s->viewpoint, sight.distance2) > o->distance))
        return EBPO_TURN_NEVER;
    if (sight.seen)
        return EBPO_TURN_SEEN;
    return o->unseen == EBPO_UNSEEN_NEVER ? EBPO_TURN_NEVER : EBPO_TURN_UNSEEN;
}

/* Sets the key and the turn of a node of the frontier. */
static void rank_waiting(const ebpo_view_stream *s, ebpo_waiting *w)
{
    ebpo_seen sight = ebpo_viewpoint_see(&s->viewpoint, &s->box, ebpo_cell_of_octcode(w->octcode));
    w->key = ebpo_viewpoint_key(&s->viewpoint, &s->box, s->options.priority, w->octcode,
                                sight.distance2);
    w->turn = w->child_group == EBPO_PRUNED_GROUP
                  ? EBPO_TURN_NEVER
                  : (uint8_t)turn_of(s, ebpo_octcode_level(w->octcode), sight);
}

ebpo_status ebpo_view_stream_change(ebpo_view_stream *s, const ebpo_view_options *options,
                                    ebpo_error *error)
{
    EBPO_DEFAULT_FP;
    const ebpo_view_options *now = &s->options;
    ebpo_view_options wanted = EBPO_VIEW_OPTIONS_INIT;
    ebpo_status status = EBPO_TAKE(ebpo_view_options, &wanted, options, error);
    if (status != EBPO_OK)
        return status;
    if (wanted.planes != now->planes || wanted.polygons != now->polygons ||
        wanted.windings != now->windings || wanted.memory != now->memory ||
        wanted.faces != now->faces)
        return ebpo_fail(error, EBPO_E_ARGUMENT,
                         "view options: planes, polygons, windings, memory and faces cannot be "
                         "changed; create another stream");
    status = take_options(s, &wanted, error);
    if (status != EBPO_OK)
        return status;
    for (uint64_t i = 0; i < s->frontier.count; i++)
        rank_waiting(s, &s->frontier.at[i]);
    ebpo_frontier_restore(&s->frontier);
    return EBPO_OK;
}

/* Reads a group into s->read, and the faces of its leaves into s->leaves if faces are requested.
 * Missing chunks are read one by one. */
static ebpo_status read_now(ebpo_view_stream *s, const view_group *group, unsigned wanted,
                            ebpo_error *error)
{
    ebpo_status status = ebpo_group_read(s->chunks, group->number.level, group->number.group,
                                         wanted, &s->read, error);
    return status == EBPO_OK && s->leaves
               ? view_leaves_read(s->leaves, s->chunks, group, &s->read, error)
               : status;
}

/* Does the same as read_now for a remote file, but only with chunks in memory. Returns false if
 * chunks are missing. */
static bool read_at_once(ebpo_view_stream *s, const view_group *group, unsigned wanted)
{
    ebpo_chunk_keys missing;
    ebpo_chunk_keys_begin(&missing);
    ebpo_chunks_collect(s->chunks, &missing);
    ebpo_status status = read_now(s, group, wanted, NULL);
    ebpo_chunks_collect(s->chunks, NULL);
    return status == EBPO_OK && missing.count == 0;
}

/* If a view ends at a number of bytes or nodes, the level at which it will end is unknown. Then
 * nodes that are refined much later are not prefetched. In the order of levels, these are nodes
 * more than SOON_LEVELS levels deeper than the next node. In the order of pixels, these are nodes
 * smaller than the next node by a factor of more than 2^SOON_LEVELS. */
enum { SOON_LEVELS = 2 };

/* Sets soon_level and soon_pixels. `next`: octcode of the next node to refine. */
static void set_soon(ebpo_view_stream *s, uint64_t next)
{
    int level = ebpo_octcode_level(next);
    ebpo_seen sight = ebpo_viewpoint_see(&s->viewpoint, &s->box, ebpo_cell_of_octcode(next));
    bool ends = s->options.bytes || s->options.nodes;
    s->soon_level =
        ends && s->options.priority == EBPO_PRIORITY_LEVEL ? level + SOON_LEVELS : EBPO_LEVELS_MAX;
    s->soon_pixels =
        ends && s->options.priority == EBPO_PRIORITY_PIXELS
            ? ldexp(ebpo_viewpoint_pixels(&s->viewpoint, level, sight.distance2), -SOON_LEVELS)
            : 0;
}

/* Returns true if a node is beyond the limits of set_soon. */
static bool is_distant(const ebpo_view_stream *s, int level, ebpo_seen sight)
{
    return level > s->soon_level ||
           (s->soon_pixels > 0 &&
            ebpo_viewpoint_pixels(&s->viewpoint, level, sight.distance2) < s->soon_pixels);
}

/* Returns the first level at which no descendant of the node will be refined soon, even if the
 * descendant is as near to the eye as the node. */
static int depth_of_view(const void *user, uint64_t octcode)
{
    const ebpo_view_stream *s = user;
    ebpo_seen sight = ebpo_viewpoint_see(&s->viewpoint, &s->box, ebpo_cell_of_octcode(octcode));
    int level = ebpo_octcode_level(octcode);
    while (level < s->info->level_count && turn_of(s, level, sight) != EBPO_TURN_NEVER &&
           !is_distant(s, level, sight))
        level++;
    return level;
}

/* Reads a group into s->read; if faces are requested, also reads the faces of its leaves. */
static ebpo_status read_group(ebpo_view_stream *s, const view_group *group, ebpo_error *error)
{
    unsigned wanted = (s->options.planes || s->options.polygons ? EBPO_GROUP_PLANES : 0u) |
                      (s->options.windings ? EBPO_GROUP_WINDINGS : 0u);
    ebpo_status status = EBPO_OK;
    ebpo_chunks_limit(s->chunks, s->options.bytes ? s->options.bytes : UINT64_MAX);
    view_depth depth = { depth_of_view, s };
    if (ebpo_input_prefetches(&s->chunks->file->in)) {
        if (read_at_once(s, group, wanted))
            return EBPO_OK;
        set_soon(s, group->parent ? group->parent : 1);
        status = fetch_group(s->chunks, &s->partial, &s->frontier, group, wanted, s->leaves != NULL,
                             &depth, error);
    }
    return status == EBPO_OK ? read_now(s, group, wanted, error) : status;
}

/* Begins to deliver the root, or the children of the frontier's first node. If the view ends here,
 * sets *end to the reason. If the first node is pruned (its children are not in the file), only
 * marks it as a node that is not refined, and the caller calls this function again. */
static ebpo_status begin_group(ebpo_view_stream *s, ebpo_view_end *end, ebpo_error *error)
{
    bool root = s->partial.group_count == 0;
    view_group group = { { 0, 0 }, 0 };
    if (!root && (s->frontier.count == 0 || s->frontier.at[0].turn == EBPO_TURN_NEVER)) {
        *end = EBPO_VIEW_DONE;
        return EBPO_OK;
    }
    /* The view ends if the group would exceed the limit of nodes. */
    if (s->options.nodes &&
        (root ? 1 : 8) > s->options.nodes -
                             (s->delivered < s->options.nodes ? s->delivered : s->options.nodes)) {
        *end = EBPO_VIEW_NODES;
        return EBPO_OK;
    }
    if (!root)
        group = children_of(&s->frontier.at[0]);
    ebpo_error failure = EBPO_ERROR_INIT;
    ebpo_status status = read_group(s, &group, &failure);
    if (status == EBPO_E_LIMIT && ebpo_chunks_refused(s->chunks)) {
        *end = EBPO_VIEW_BYTES;
        return EBPO_OK;
    }
    if (status == EBPO_OK && !root && s->info->pruned && s->read.types == 0) {
        ebpo_waiting pruned = ebpo_frontier_pop(&s->frontier);
        pruned.child_group = EBPO_PRUNED_GROUP;
        pruned.turn = EBPO_TURN_NEVER;
        ebpo_frontier_push(&s->frontier, pruned); /* in the space of the removed node */
        return EBPO_OK;
    }
    if (status == EBPO_OK)
        status = ebpo_frontier_reserve(&s->frontier, 8, &failure);
    if (status == EBPO_OK)
        status = ebpo_partial_add(&s->partial, s->info, root ? 0 : s->frontier.at[0].octcode,
                                  &s->read, &failure);
    if (status != EBPO_OK) {
        if (error)
            *error = failure;
        return status;
    }
    s->octant_mask = 0;
    if (!root) {
        s->parent = ebpo_frontier_pop(&s->frontier);
        if (s->options.priority == EBPO_PRIORITY_FRONT_TO_BACK)
            s->octant_mask = ebpo_viewpoint_octant(&s->viewpoint, &s->box,
                                                   ebpo_cell_of_octcode(s->parent.octcode));
    }
    s->step = 0;
    s->delivering = true;
    return EBPO_OK;
}

/* Replaces the parent in the cut by its children, after all of them have been delivered. */
static void end_group(ebpo_view_stream *s)
{
    uint32_t group = (uint32_t)(s->partial.group_count - 1);
    if (group) {
        s->partial.group[s->parent.group].child[s->parent.octant] = group;
        s->cut[EBPO_GRAY]--;
    }
    for (unsigned octant = 0; octant < (group ? 8u : 1u); octant++) {
        ebpo_partial_node node = { group, (uint8_t)octant };
        ebpo_node_type type = ebpo_partial_type(&s->partial, node);
        s->cut[type]++;
        if (type == EBPO_GRAY) {
            uint64_t octcode = ebpo_partial_octcode(&s->partial, node);
            bool pruned = ebpo_octcode_level(octcode) + 1 == s->info->level_count;
            ebpo_waiting w = { .octcode = octcode,
                               .child_group = pruned ? EBPO_PRUNED_GROUP
                                                     : ebpo_partial_children(&s->partial, node),
                               .group = group,
                               .octant = (uint8_t)octant };
            rank_waiting(s, &w);
            ebpo_frontier_push(&s->frontier, w);
        }
    }
    s->delivering = false;
}

/* --- nodes --- */

/* Fills in *out for a delivered node; the caller sets out->complete. */
static void fill_node(ebpo_view_stream *s, ebpo_partial_node node, ebpo_view_node *out)
{
    ebpo_node_type type = ebpo_partial_type(&s->partial, node);
    memset(out, 0, sizeof *out);
    ebpo_node_begin(&out->node, &s->box, ebpo_partial_octcode(&s->partial, node), type);
    ebpo_cell cell = ebpo_cell_of_octcode(out->node.octcode);
    ebpo_seen sight = ebpo_viewpoint_see(&s->viewpoint, &s->box, cell);
    out->level = cell.level;
    out->seen = sight.seen;
    out->distance = ebpo_viewpoint_distance(&s->viewpoint, sight.distance2);
    out->pixels = ebpo_viewpoint_pixels(&s->viewpoint, cell.level, sight.distance2);
    if (s->partial.windings)
        out->node.winding = s->partial.winding[node.group][node.octant];
    if (s->options.planes || s->options.polygons) {
        unsigned count;
        const uint32_t *codes = ebpo_partial_codes(&s->partial, node, &count);
        ebpo_node_add_planes(&out->node, &s->box, codes, count, &s->buffers);
    }
    if (s->options.polygons && type != EBPO_WHITE)
        ebpo_node_add_polygons(&out->node, &s->box,
                               ebpo_partial_envelope(&s->partial, node, s->envelopes), &s->buffers);
}

ebpo_status ebpo_view_stream_next(ebpo_view_stream *s, ebpo_view_node *out, ebpo_view_end *end,
                                  ebpo_error *error)
{
    EBPO_DEFAULT_FP;
    *end = EBPO_VIEW_NODE;
    if (s->leaves)
        clear_faces(s->leaves);
    while (!s->delivering) {
        ebpo_status status = begin_group(s, end, error);
        if (status != EBPO_OK || *end != EBPO_VIEW_NODE)
            return status;
    }
    uint32_t group = (uint32_t)(s->partial.group_count - 1);
    unsigned octant = s->step++ ^ s->octant_mask;
    fill_node(s, (ebpo_partial_node){ group, (uint8_t)octant }, out);
    if (s->leaves)
        set_faces(s->leaves, octant);
    s->delivered++;
    out->complete = s->step == (group ? 8 : 1);
    if (out->complete)
        end_group(s);
    return EBPO_OK;
}

/* --- delivered data: the cut, statistics, faces --- */

typedef struct visitor {
    ebpo_view_stream *stream;
    ebpo_view_visit_fn visit; /* called with `user` and a node */
    void *user;
    ebpo_view_node node; /* filled in for the call of `visit` */
} visitor;

/* Visits the node if it is in the cut. Otherwise visits the nodes of the cut below it, from front
 * to back. Returns false if `visit` returned false; then no further node is visited. */
static bool visit_node(visitor *v, ebpo_partial_node node)
{
    const ebpo_partial *partial = &v->stream->partial;
    uint32_t children = partial->group[node.group].child[node.octant];
    if (children == 0) {
        fill_node(v->stream, node, &v->node);
        v->node.complete = true;
        return v->visit(v->user, &v->node);
    }
    unsigned octant_mask =
        ebpo_viewpoint_octant(&v->stream->viewpoint, &v->stream->box,
                              ebpo_cell_of_octcode(ebpo_partial_octcode(partial, node)));
    for (unsigned step = 0; step < 8; step++)
        if (!visit_node(v, (ebpo_partial_node){ children, (uint8_t)(step ^ octant_mask) }))
            return false;
    return true;
}

void ebpo_view_stream_cut(ebpo_view_stream *s, ebpo_view_visit_fn visit, void *user)
{
    EBPO_DEFAULT_FP;
    visitor v = { .stream = s, .visit = visit, .user = user };
    if (s->delivered)
        (void)visit_node(&v, (ebpo_partial_node){ 0, 0 });
}

/* Updates out->pixels and out->waiting for a gray node of the cut. */
static void count_node(const ebpo_view_stream *s, const ebpo_waiting *w, ebpo_view_stats *out)
{
    ebpo_cell cell = ebpo_cell_of_octcode(w->octcode);
    ebpo_seen sight = ebpo_viewpoint_see(&s->viewpoint, &s->box, cell);
    if (sight.seen)
        out->pixels =
            fmax(out->pixels, ebpo_viewpoint_pixels(&s->viewpoint, cell.level, sight.distance2));
    out->waiting += w->turn != EBPO_TURN_NEVER;
}

ebpo_status ebpo_view_stream_get_stats(const ebpo_view_stream *s, ebpo_view_stats *out)
{
    ebpo_file_stats file = EBPO_FILE_STATS_INIT;
    ebpo_view_stats stats = EBPO_VIEW_STATS_INIT;
    stats.nodes = s->delivered;
    stats.pixels = s->viewpoint.has_observer ? 0 : NAN;
    ebpo_file_get_stats(s->file, &file);
    stats.bytes_read = file.bytes_read;
    for (int i = 0; i < 4; i++)
        stats.cut[i] = s->cut[i];
    for (uint64_t i = 0; i < s->frontier.count; i++)
        count_node(s, &s->frontier.at[i], &stats);
    if (s->delivering && s->partial.group_count > 1)
        count_node(s, &s->parent, &stats);
    return EBPO_GIVE(ebpo_view_stats, out, &stats);
}

ebpo_status ebpo_view_stream_get_faces(const ebpo_view_stream *stream, ebpo_view_faces *out)
{
    static const ebpo_view_faces none = EBPO_VIEW_FACES_INIT;
    return EBPO_GIVE(ebpo_view_faces, out, stream->leaves ? &stream->leaves->current : &none);
}

ebpo_status ebpo_view_stream_surface(ebpo_view_stream *stream, ebpo_surface_mesh *out,
                                     ebpo_error *error)
{
    EBPO_DEFAULT_FP;
    return ebpo_view_surface(&stream->patches, stream->chunks, &stream->viewpoint, &stream->options,
                             out, error);
}
