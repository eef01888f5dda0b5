/* Reads the top of a tree: levels 0 to the cut level without faces, and the roots of the subtrees
 * below.
 *
 * A model that is loaded in parts always has the top in memory; queries go down through the top to
 * the subtrees. The same struct, read with envelopes only, serves as deep bounds, which have some
 * levels below the cut level (nearest.h). A top does not change after it was read; any thread may
 * use it. */
#include "query/holes.h"
#include "query/model_parts.h"

#include <stdlib.h>
#include <string.h>

#include "core/alloc.h"
#include "core/error.h"
#include "core/workspace.h"
#include "format/reader.h"
#include "geometry/level_nodes.h"

/* State of reading level by level. */
typedef struct reading {
    ebpo_top *top;
    const ebpo_info *info;
    uint64_t group, plane, below; /* next free index in groups, planes and `below` of the top */
    ebpo_cell *gray;              /* cells of the previous level's gray nodes */
    /* types of the next level's nodes, which show which nodes are pruned (their children are not in
     * the file); NULL: not needed */
    uint16_t *next_types;
    uint64_t group_capacity, gray_capacity, plane_capacity, below_capacity, below_planes_capacity;
    bool envelopes; /* true: for ebpo_top_read_envelopes, without `below` */
    ebpo_error *error;
} reading;

static ebpo_status no_memory(const reading *r)
{
    return ebpo_fail_memory(r->error, ebpo_top_estimate(r->info, r->top->cut_level));
}

/* Adds the planes of a node: the next `count` planes of the level. *plane_at: index of the node's
 * first plane; on return, index of the next node's first plane. */
static ebpo_status add_planes(reading *r, const ebpo_level *level, uint32_t count,
                              uint64_t *plane_at, ebpo_top_planes *out)
{
    if (!ebpo_grow(&r->top->planes, &r->plane_capacity, r->plane + count + 1,
                   sizeof *r->top->planes))
        return no_memory(r);
    if (r->plane + count > UINT32_MAX)
        return ebpo_fail(r->error, EBPO_E_LIMIT,
                         "too many planes down to cut level %d; give a lower cut level",
                         r->top->cut_level);
    if (count)
        memcpy(r->top->planes + r->plane, level->planes + *plane_at,
               count * sizeof *r->top->planes);
    *out = (ebpo_top_planes){ (uint32_t)r->plane, count };
    *plane_at += count;
    r->plane += count;
    return EBPO_OK;
}

/* How many nodes of each type, and how many planes, of a level were added so far. */
typedef struct level_counts {
    uint64_t of[4], planes;
} level_counts;

/* Sets the entry of a white or black node. `windings`: [rank], or NULL. */
static ebpo_status uniform_entry(const reading *r, const int32_t *windings, uint64_t rank,
                                 int32_t default_winding, uint32_t *entry)
{
    return ebpo_entry_uniform(windings ? windings[rank] : default_winding, entry)
               ? EBPO_OK
               : ebpo_fail(r->error, EBPO_E_LIMIT,
                           "the winding number of a node is beyond 2^29: the solid has too many "
                           "shells");
}

/* Adds a root of a subtree. */
static ebpo_status add_below(reading *r, const ebpo_level *level, const ebpo_node *node,
                             uint64_t *plane_at, uint32_t *entry)
{
    ebpo_top *t = r->top;
    if ((!r->envelopes &&
         !ebpo_grow(&t->below, &r->below_capacity, r->below + 1, sizeof *t->below)) ||
        !ebpo_grow(&t->below_planes, &r->below_planes_capacity, r->below + 1,
                   sizeof *t->below_planes))
        return no_memory(r);
    if (r->below >= EBPO_ENTRY_ZERO)
        return ebpo_fail(r->error, EBPO_E_LIMIT,
                         "too many nodes at cut level %d; give a lower cut level", t->cut_level);
    if (!r->envelopes)
        t->below[r->below] = *node;
    *entry = ebpo_entry(EBPO_ENTRY_SUBTREE_ROOT, (uint32_t)r->below);
    uint32_t count =
        node->type == EBPO_GRAY && level->plane_counts ? level->plane_counts[node->rank] : 0;
    return add_planes(r, level, count, plane_at, &t->below_planes[r->below++]);
}

/* Adds a gray node above the cut level. */
static ebpo_status add_gray(reading *r, const ebpo_level *level, uint64_t rank, uint64_t *plane_at,
                            uint32_t *entry)
{
    ebpo_top *t = r->top;
    uint64_t group = r->group++;
    if (!ebpo_grow(&t->nodes.group, &r->group_capacity, r->group, sizeof *t->nodes.group) ||
        !ebpo_grow(&t->gray, &r->gray_capacity, r->group, sizeof *t->gray))
        return no_memory(r);
    if (r->group >= EBPO_ENTRY_ZERO)
        return ebpo_fail(r->error, EBPO_E_LIMIT,
                         "too many nodes above cut level %d; give a lower cut level", t->cut_level);
    *entry = ebpo_entry(EBPO_ENTRY_GRAY, (uint32_t)group);
    return add_planes(r, level, level->plane_counts ? level->plane_counts[rank] : 0, plane_at,
                      &t->gray[group]);
}

/* Returns true if the gray node with this rank in level `number` is pruned. */
static bool is_pruned(const reading *r, int number, uint64_t rank)
{
    return r->info->pruned &&
           (number + 1 == r->info->level_count || (r->next_types && r->next_types[rank] == 0));
}

/* Adds a pruned node as a root of a subtree. If the node is above the cut level, the file has an
 * empty group for it in the next level. So the node also gets a group, like a gray node. */
static ebpo_status add_pruned(reading *r, const ebpo_level *level, const ebpo_node *node,
                              uint64_t *plane_at, uint32_t *entry)
{
    if (node->cell.level < r->top->cut_level && node->cell.level + 1 < r->info->level_count) {
        ebpo_level none = { .gray_count = 0 };
        ebpo_status status = add_gray(r, &none, 0, &(uint64_t){ 0 }, entry);
        if (status != EBPO_OK)
            return status;
    }
    return add_below(r, level, node, plane_at, entry);
}

/* Adds the next node of its type, and sets its entry. */
static ebpo_status add_node(reading *r, const ebpo_level *level, ebpo_node_type type,
                            ebpo_cell cell, level_counts *next, uint32_t *entry)
{
    uint64_t rank = next->of[type]++;
    if (type == EBPO_WHITE)
        return uniform_entry(r, level->white_winding, rank, 0, entry);
    if (type == EBPO_BLACK)
        return uniform_entry(r, level->black_winding, rank, 1, entry);
    /* a leaf without faces, in a surface with holes, is like a white node */
    if (type == EBPO_LEAF && level->leaf_new && level->leaf_new[rank] == 0 &&
        level->leaf_ref_count[rank] == 0)
        return uniform_entry(r, level->leaf_winding, rank, 0, entry);
    ebpo_node node = { .cell = cell,
                       .type = type,
                       .pruned = type == EBPO_GRAY && is_pruned(r, cell.level, rank),
                       .rank = rank };
    if (node.pruned)
        return add_pruned(r, level, &node, &next->planes, entry);
    if (type == EBPO_GRAY && cell.level < r->top->cut_level)
        return add_gray(r, level, rank, &next->planes, entry);
    return add_below(r, level, &node, &next->planes, entry);
}

/* Adds the nodes of level `number`. `first_group`: index in the top of the level's first group. */
static ebpo_status add_level(reading *r, int number, const ebpo_level *level, uint64_t first_group)
{
    uint64_t grays = 0;
    ebpo_cell *gray = ebpo_alloc(level->gray_count, sizeof *gray);
    if (!gray)
        return no_memory(r);
    level_counts next = { { 0 }, 0 };
    ebpo_status status = EBPO_OK;
    for (uint64_t g = 0; g < level->group_count && status == EBPO_OK; g++)
        for (unsigned octant = 0; octant < ebpo_group_octants(number) && status == EBPO_OK;
             octant++) {
            ebpo_node_type type = ebpo_group_type(level->types[g], octant);
            ebpo_cell cell =
                number ? ebpo_cell_child(r->gray[g], octant) : (ebpo_cell){ 0, { 0, 0, 0 } };
            uint32_t entry = 0;
            if (type == EBPO_GRAY)
                gray[grays++] = cell;
            status = add_node(r, level, type, cell, &next, &entry);
            if (number)
                r->top->nodes.group[first_group + g][octant] = entry;
            else
                r->top->nodes.root = entry;
        }
    free(r->gray);
    r->gray = gray;
    return status;
}

/* Shrinks an array to `count` items. When out of memory, does not change the array. */
static void shrink_array(void *array, uint64_t *capacity, uint64_t count, size_t size)
{
    void **at = array, *shrunk = *at ? realloc(*at, (count ? count : 1) * size) : NULL;
    if (shrunk) {
        *at = shrunk;
        *capacity = count;
    }
}

static void shrink_all(reading *r)
{
    ebpo_top *t = r->top;
    shrink_array(&t->nodes.group, &r->group_capacity, r->group, sizeof *t->nodes.group);
    shrink_array(&t->gray, &r->gray_capacity, r->group, sizeof *t->gray);
    shrink_array(&t->planes, &r->plane_capacity, r->plane, sizeof *t->planes);
    shrink_array(&t->below_planes, &r->below_planes_capacity, r->below, sizeof *t->below_planes);
}

/* Sets the counts and the bytes of a completely read top. */
static void end_top(reading *r)
{
    ebpo_top *t = r->top;
    if (r->envelopes)
        shrink_all(r);
    t->nodes.group_count = (uint32_t)r->group;
    t->below_count = r->below;
    t->bytes = sizeof *t + r->group_capacity * sizeof *t->nodes.group +
               r->gray_capacity * sizeof *t->gray + r->plane_capacity * 4 +
               r->below_capacity * sizeof *t->below +
               r->below_planes_capacity * sizeof *t->below_planes;
}

/* Sends prefetch hints for levels 0 to `last`, without the arrays of omitted parts. */
static void hint_levels(const ebpo_file *file, int last, uint32_t omitted_parts)
{
    ebpo_hints hints = EBPO_HINTS_INIT(file);
    for (int level = 0; level <= last; level++)
        ebpo_hint_level(&hints, level, omitted_parts);
    ebpo_hint_all(&hints);
}

static ebpo_status read_top(ebpo_top **out, const ebpo_file *file, int cut_level, unsigned threads,
                            bool envelopes, ebpo_error *error)
{
    *out = NULL;
    ebpo_top *top = ebpo_alloc_zero(1, sizeof *top);
    if (!top)
        return ebpo_fail_memory(error, sizeof *top);
    top->cut_level = cut_level;
    reading r = {
        .top = top, .info = ebpo_file_info(file), .envelopes = envelopes, .error = error
    };
    ebpo_status status = EBPO_OK;
    ebpo_read_options read = ebpo_read_threads(threads);
    read.omitted_parts = envelopes ? r.info->parts & EBPO_PART_MESH : 0;
    ebpo_hint_top(file);
    hint_levels(file, cut_level, (uint32_t)read.omitted_parts);
    for (int number = 0; number <= cut_level && status == EBPO_OK; number++) {
        ebpo_level level;
        status = ebpo_file_read_level(file, number, &read, &level, error);
        if (status != EBPO_OK)
            break;
        if (r.info->level[number].pruned_count && number + 1 < r.info->level_count)
            status = ebpo_reader_make(file, EBPO_A_TYPES, number + 1, &read, sizeof *r.next_types,
                                      &r.next_types, error);
        if (status == EBPO_OK)
            status = add_level(&r, number, &level, r.group - (number ? level.group_count : 0));
        ebpo_array_free(read.workspace, r.next_types);
        r.next_types = NULL;
        ebpo_level_free(&level);
    }
    free(r.gray);
    if (status != EBPO_OK) {
        ebpo_top_free(top);
        return status;
    }
    end_top(&r);
    *out = top;
    return EBPO_OK;
}

ebpo_status ebpo_top_read(ebpo_top **out, const ebpo_file *file, int cut_level, unsigned threads,
                          ebpo_error *error)
{
    return read_top(out, file, cut_level, threads, false, error);
}

ebpo_status ebpo_top_read_envelopes(ebpo_top **out, const ebpo_file *file, int cut_level,
                                    unsigned threads, ebpo_error *error)
{
    return read_top(out, file, cut_level, threads, true, error);
}

ebpo_status ebpo_top_read_subtree(ebpo_top **out, ebpo_chunks *chunks, const ebpo_node *root,
                                  ebpo_error *error)
{
    ebpo_slice slice;
    *out = NULL;
    ebpo_status status =
        ebpo_slice_read_nodes(&slice, chunks, root, EBPO_TOP_ENVELOPES, EBPO_DEEP_LEVELS, error);
    if (status != EBPO_OK)
        return status;
    ebpo_top *top = ebpo_alloc_zero(1, sizeof *top);
    reading r = {
        .top = top, .info = ebpo_file_info(chunks->file), .envelopes = true, .error = error
    };
    if (!top)
        status = ebpo_fail_memory(error, sizeof *top);
    else
        top->cut_level = slice.level_count - 1;
    for (int i = 0; i < slice.level_count && status == EBPO_OK; i++)
        status = add_level(&r, i, &slice.level[i], r.group - (i ? slice.level[i].group_count : 0));
    free(r.gray);
    ebpo_slice_free(&slice);
    if (status != EBPO_OK) {
        ebpo_top_free(top);
        return status;
    }
    end_top(&r);
    *out = top;
    return EBPO_OK;
}

void ebpo_top_free(ebpo_top *top)
{
    if (!top)
        return;
    ebpo_node_table_free(&top->nodes);
    free(top->gray);
    free(top->planes);
    free(top->below);
    free(top->below_planes);
    free(top);
}

/* Bytes for the first allocations of growing arrays, which have space for several items. */
enum { GROWN_LEAST = 4096 };

/* Returns an upper bound of the bytes of a top. `root_bytes`: bytes of each root in `below`. */
static uint64_t estimate_levels(const ebpo_info *info, int cut_level, size_t root_bytes)
{
    uint64_t bytes = sizeof(ebpo_top) + GROWN_LEAST, largest = 0;
    for (int i = 0; i <= cut_level && i < info->level_count; i++) {
        const ebpo_level_summary *s = &info->level[i];
        uint64_t below = s->leaf_count + (i == cut_level ? s->gray_count : 0);
        /* The data that are kept; growing arrays have up to half of their size as reserve. */
        bytes += (s->gray_count * (sizeof(uint32_t[8]) + sizeof(ebpo_top_planes)) +
                  s->plane_count * 4 + below * (root_bytes + sizeof(ebpo_top_planes))) *
                 3 / 2;
        /* The arrays of the level while it is read. */
        uint64_t arrays = s->gray_count * 27 + s->plane_count * 4 + s->leaf_count * 28 +
                          s->ref_count * 4 + (s->white_count + s->black_count) * 4;
        largest = arrays > largest ? arrays : largest;
    }
    return bytes + largest;
}

uint64_t ebpo_top_estimate(const ebpo_info *info, int cut_level)
{
    return estimate_levels(info, cut_level, sizeof(ebpo_node)) + ebpo_holes_estimate(info);
}

uint64_t ebpo_top_envelopes_estimate(const ebpo_info *info, int cut_level)
{
    return estimate_levels(info, cut_level, 0);
}
