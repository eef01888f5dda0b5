/* Makes the levels of a subset: the nodes that remain. Here the "source" is the
 * file from which the subset is made, and the "result" is the subset. Gray nodes have children, and
 * leaves list faces.
 *
 * Levels are made from the root downwards. Each level determines the groups (the eight children of
 * a gray node) of the next level that are needed, so only these groups are read. A gray node whose
 * children are omitted becomes a pruned node. A leaf that is omitted also becomes a pruned node.
 * All arrays of a level (ebpo_schema) are copied node by node for the remaining nodes. Faces keep
 * their indices in the source until subset_faces.c gives them new indices. With max_error, all
 * envelopes of a level are tested together (error_bound.h). */
#include "core/strict_fp.h"

#include <stdlib.h>
#include <string.h>

#include "core/alloc.h"
#include "core/error.h"
#include "core/parallel.h"
#include "derive/subset_parts.h"
#include "format/schema.h"
#include "format/subtree_index.h"
#include "geometry/cells.h"
#include "geometry/level_nodes.h"
#include "levels/lod.h"

/* --- copying the arrays of remaining nodes --- */

/* An array with one value for each node of a type. */
typedef struct kept_column {
    const uint8_t *from;  /* array of the source */
    uint8_t *to;          /* array of the result */
    uint8_t size;         /* size of a value in bytes */
    int8_t default_value; /* value for nodes that are not in the source */
} kept_column;

/* For each node of a type, the number of its items (planes or faces), as u8 or u32. */
typedef struct kept_counts {
    ebpo_per per;          /* kind of the items */
    const uint8_t *counts; /* NULL: all counts are 0 */
    uint8_t size;          /* size of a count in bytes: 1 or 4 */
} kept_counts;

/* An array with the items of all nodes of a type. Several arrays may have the same counts. */
typedef struct kept_list {
    unsigned counts;     /* index of the list's counts in kept_nodes.of_type[type].count */
    const uint8_t *from; /* array of the source */
    uint8_t *to;         /* array of the result */
    uint8_t size;        /* size of an item in bytes */
} kept_list;

/* The copying of the nodes of one level from the source to the result. */
typedef struct kept_nodes {
    const ebpo_level *from; /* the level of the source: the groups that were read */
    ebpo_level *to;         /* the level of the result */
    struct {
        kept_column column[EBPO_LEVEL_ARRAYS];
        kept_counts count[EBPO_LEVEL_ARRAYS];
        kept_list list[EBPO_LEVEL_ARRAYS];
        unsigned columns, counts, lists; /* lengths of the three arrays */
    } of_type[4];
    uint64_t next[4]; /* for each type: rank in `from` of the next node to copy or omit */
    /* for each kind of items: index of the first item of the next node */
    uint64_t read[EBPO_COUNTS];
} kept_nodes;

/* Returns the kind of arrays with one value for each node of a type. */
static ebpo_per per_of(ebpo_node_type type)
{
    static const ebpo_per per[] = { [EBPO_WHITE] = EBPO_PER_WHITE,
                                    [EBPO_BLACK] = EBPO_PER_BLACK,
                                    [EBPO_LEAF] = EBPO_PER_LEAF,
                                    [EBPO_GRAY] = EBPO_PER_GRAY };
    return per[type];
}

/* Returns the number of values for which an array of the result's level needs space; see
 * kept_begin. */
static uint64_t capacity_of(const ebpo_level *from, ebpo_per per, const uint64_t more[4])
{
    int type = ebpo_schema_node_type(per);
    uint64_t leaf_planes = per == EBPO_PER_PLANE ? from->leaf_plane_count : 0;
    return ebpo_level_count(from, per) + leaf_planes + (type >= 0 ? more[type] : 0);
}

static void record_column(kept_nodes *kept, int id, int type)
{
    kept->of_type[type].column[kept->of_type[type].columns++] =
        (kept_column){ .from = ebpo_level_array(kept->from, id),
                       .to = ebpo_level_array(kept->to, id),
                       .size = ebpo_schema[id].held_size,
                       .default_value = ebpo_schema[id].default_value };
}

/* Returns the index in kept->of_type[type].count of a list's counts. Adds the counts if they are
 * not in this array. */
static unsigned record_counts(kept_nodes *kept, ebpo_per per, const ebpo_list_spec *list)
{
    int type = ebpo_schema_node_type(list->of);
    unsigned i = 0, known = kept->of_type[type].counts;
    while (i < known && kept->of_type[type].count[i].per != per)
        i++;
    if (i == known)
        kept->of_type[type].count[kept->of_type[type].counts++] =
            (kept_counts){ .per = per,
                           .counts = ebpo_level_array(kept->from, list->counts),
                           .size = ebpo_schema[list->counts].held_size };
    return i;
}

static void record_list(kept_nodes *kept, int id, const ebpo_list_spec *list)
{
    int type = ebpo_schema_node_type(list->of);
    kept->of_type[type].list[kept->of_type[type].lists++] =
        (kept_list){ .counts = record_counts(kept, ebpo_schema[id].per, list),
                     .from = ebpo_level_array(kept->from, id),
                     .to = ebpo_level_array(kept->to, id),
                     .size = ebpo_schema[id].held_size };
}

/* Begins to copy nodes. Makes the arrays of `to` that at least one bit of `needs` (EBPO_NEEDS_...)
 * requires. Each array has space for all entries of `from`, and for more[type] new nodes of each
 * type. Leaves may become gray nodes, so the arrays of planes also have space for the planes of
 * leaves. Returns false when out of memory. */
static bool kept_begin(kept_nodes *kept, const ebpo_level *from, ebpo_level *to, uint32_t needs,
                       const uint64_t more[4])
{
    *kept = (kept_nodes){ .from = from, .to = to };
    for (int id = 0; id < EBPO_LEVEL_ARRAYS; id++) {
        const ebpo_array_spec *spec = &ebpo_schema[id];
        const ebpo_list_spec *list = ebpo_schema_list(spec->per);
        if (spec->per == EBPO_PER_GROUP || !ebpo_schema_is_held(id) || !(spec->needs & needs) ||
            (spec->if_needed && !ebpo_level_array(from, id)))
            continue;
        void *array = ebpo_alloc(capacity_of(from, spec->per, more), spec->held_size);
        if (!array)
            return false;
        ebpo_level_set_array(to, id, array);
        if (list)
            record_list(kept, id, list);
        else
            record_column(kept, id, ebpo_schema_node_type(spec->per));
    }
    return true;
}

static void copy_row(const kept_column *c, uint64_t from, uint64_t to)
{
    switch (c->size) {
    case 1: c->to[to] = c->from[from]; break;
    case 4: memcpy(c->to + 4 * to, c->from + 4 * from, 4); break;
    default: memcpy(c->to + c->size * to, c->from + c->size * from, c->size);
    }
}

static void put_default(const kept_column *c, uint64_t to)
{
    int64_t value = c->default_value;
    switch (c->size) {
    case 1: memcpy(c->to + to, &(int8_t){ c->default_value }, 1); break;
    case 2: memcpy(c->to + 2 * to, &(int16_t){ c->default_value }, 2); break;
    case 4: memcpy(c->to + 4 * to, &(int32_t){ c->default_value }, 4); break;
    default: memcpy(c->to + 8 * to, &value, 8);
    }
}

static uint64_t kept_items(const kept_counts *c, uint64_t rank)
{
    uint32_t count;
    if (!c->counts || c->size == 1)
        return c->counts ? c->counts[rank] : 0;
    memcpy(&count, c->counts + 4 * rank, 4);
    return count;
}

/* Adds one to the level's number of nodes of a type. Returns the rank of the added node. */
static uint64_t grow_level(ebpo_level *level, ebpo_node_type type)
{
    uint64_t index = ebpo_level_count(level, per_of(type));
    ebpo_level_set_count(level, per_of(type), index + 1);
    return index;
}

/* Appends the `count` items that the next node of `from` has in this list. */
static void copy_items(const kept_nodes *kept, const kept_list *list, const kept_counts *c,
                       uint64_t count)
{
    uint64_t end = ebpo_level_count(kept->to, c->per);
    memcpy(list->to + end * list->size, list->from + kept->read[c->per] * list->size,
           count * list->size);
}

/* Omits the next node of a type in `from`. */
static void kept_skip(kept_nodes *kept, ebpo_node_type type)
{
    uint64_t rank = kept->next[type]++;
    for (unsigned i = 0; i < kept->of_type[type].counts; i++) {
        const kept_counts *c = &kept->of_type[type].count[i];
        kept->read[c->per] += kept_items(c, rank);
    }
}

/* Copies the next node of a type in `from`. */
static void kept_take(kept_nodes *kept, ebpo_node_type type)
{
    uint64_t index = grow_level(kept->to, type), rank = kept->next[type];
    for (unsigned i = 0; i < kept->of_type[type].columns; i++)
        copy_row(&kept->of_type[type].column[i], rank, index);
    for (unsigned i = 0; i < kept->of_type[type].lists; i++) {
        const kept_list *list = &kept->of_type[type].list[i];
        const kept_counts *c = &kept->of_type[type].count[list->counts];
        uint64_t count = kept_items(c, rank);
        if (count)
            copy_items(kept, list, c, count);
    }
    for (unsigned i = 0; i < kept->of_type[type].counts; i++) {
        const kept_counts *c = &kept->of_type[type].count[i];
        ebpo_level_set_count(kept->to, c->per,
                             ebpo_level_count(kept->to, c->per) + kept_items(c, rank));
    }
    kept_skip(kept, type);
}

/* Appends a node that is not in `from`, with default values and empty lists. */
static void kept_add(kept_nodes *kept, ebpo_node_type type)
{
    uint64_t index = grow_level(kept->to, type);
    for (unsigned i = 0; i < kept->of_type[type].columns; i++)
        put_default(&kept->of_type[type].column[i], index);
}

/* --- cutting levels --- */

static const uint64_t NO_GROUP = UINT64_MAX;

/* A gray node of the result. */
typedef struct gray {
    /* group of the node's children in the source; NO_GROUP: the children are omitted */
    uint64_t group;
    ebpo_cell cell;
} gray;

/* The work on all levels from the root downwards; `level` is the current level. */
typedef struct descent {
    ebpo_cutting *c;
    int level;
    ebpo_level from, *to; /* the needed groups of the source's level; the level of the result */
    kept_nodes kept;      /* copies nodes from `from` to `to` */
    gray *parent, *child; /* gray nodes of the result: of the level above, and of this level */
    uint64_t parent_count, child_count;
    /* gray nodes and leaves of `from` in stored order; NULL: no max_error */
    ebpo_tolerance_node *tolerance_nodes;
    uint64_t next_tolerance_node; /* index in tolerance_nodes of the next gray node or leaf */
    uint64_t group; /* current group of the result, which is the index of its parent in `parent` */
    uint64_t nonempty_groups; /* number of groups of this level of the result that have nodes */
    bool has_next_level;      /* true: some gray node of this level has children in the result */
} descent;

static bool intersects_box(const ebpo_cutting *c, ebpo_cell cell)
{
    return !c->options->boxed ||
           ebpo_cell_intersects(&c->box, cell, c->options->min, c->options->max);
}

/* Returns true if gray nodes of this level may have children in the result. */
static bool may_have_children(const ebpo_cutting *c, int level)
{
    return level < c->last_level && level + 1 < c->from->level_count;
}

/* --- runs of needed groups --- */

/* Sends prefetch hints for subtrees; d->parent has the roots of subtrees. The hints cover all nodes
 * below the roots, and the leaves' lists of faces. (The lists show which faces to read.) */
static void hint_subtrees(const descent *d)
{
    const ebpo_cutting *c = d->c;
    ebpo_hints e = EBPO_HINTS_INIT(c->file);
    uint64_t count = 0, *roots = ebpo_alloc(d->parent_count, sizeof *roots);
    uint32_t needs = c->parts | EBPO_NEEDS_ALWAYS | EBPO_NEEDS_SOLID;
    for (uint64_t i = 0; roots && i < d->parent_count; i++)
        if (d->parent[i].group != NO_GROUP)
            roots[count++] = d->parent[i].group;
    if (count)
        ebpo_subtree_table_hint(c->chunks, roots, count);
    for (uint64_t i = 0; i < count; i++)
        ebpo_subtrees_hint(c->chunks, &e, roots[i], 1, needs, c->last_level, false);
    ebpo_hint_all(&e);
    free(roots);
}

/* Reads the needed groups of the level into d->from. For each gray node read, stores the index of
 * its children's group. Needed groups that are neighbours in the source are read as one run. */
static ebpo_status pick_level(descent *d)
{
    uint64_t count = 0;
    if (d->c->from->subtree_level && d->level == d->c->from->subtree_level + 1 &&
        ebpo_input_prefetches(&d->c->file->in))
        hint_subtrees(d);
    ebpo_run *runs = ebpo_alloc(d->parent_count, sizeof *runs);
    if (!runs)
        return ebpo_fail_memory(d->c->error, d->parent_count * sizeof *runs);
    for (uint64_t i = 0; i < d->parent_count; i++) {
        uint64_t group = d->parent[i].group;
        if (group == NO_GROUP)
            continue;
        if (count && runs[count - 1].group + runs[count - 1].groups == group)
            runs[count - 1].groups++;
        else
            runs[count++] = (ebpo_run){ .group = group, .groups = 1 };
    }
    ebpo_status status =
        ebpo_pick_level(d->c->chunks, d->level, runs, count,
                        d->c->parts | EBPO_NEEDS_SOLID | EBPO_NEEDS_ALWAYS, &d->from, d->c->error);
    uint64_t next = 0;
    if (status == EBPO_OK) {
        d->child = ebpo_alloc(d->from.gray_count + d->from.leaf_count, sizeof *d->child);
        if (!d->child)
            status = ebpo_fail_memory(d->c->error,
                                      (d->from.gray_count + d->from.leaf_count) * sizeof *d->child);
    }
    /* The index of the children's group is the gray node's rank in the source, which the runs give.
     * The index for gray node r of d->from is stored in entry leaf_count + r of d->child. The front
     * of the array is filled later, with gray nodes and with leaves that become pruned nodes. Each
     * gray node or leaf fills one entry at the front. Before entry leaf_count + r is read, at most
     * r gray nodes and leaf_count leaves have done this, so the entry is not overwritten. */
    for (uint64_t i = 0; i < count && status == EBPO_OK; i++)
        for (uint64_t k = 0; k < runs[i].count[EBPO_GRAY]; k++)
            d->child[d->from.leaf_count + next++].group = runs[i].rank[EBPO_GRAY] + k;
    free(runs);
    return status;
}

/* Makes the arrays of the result's level. */
static ebpo_status reserve_space(descent *d)
{
    const ebpo_level *f = &d->from;
    uint64_t whites = 8 * d->parent_count,
             more[4] = { [EBPO_WHITE] = whites, [EBPO_GRAY] = f->leaf_count };
    uint32_t needs = d->c->parts | (d->c->from->solid ? EBPO_NEEDS_SOLID : 0) | EBPO_NEEDS_ALWAYS;
    d->to->types = ebpo_alloc_zero(d->parent_count, sizeof *d->to->types);
    return d->to->types && kept_begin(&d->kept, f, d->to, needs, more)
               ? EBPO_OK
               : ebpo_fail_memory(d->c->error,
                                  f->leaf_count * 28 + (f->gray_count + f->ref_count + whites) * 4);
}

/* --- nodes --- */

/* Adds a gray node of the result; `group` is the group of its children in the source, or NO_GROUP.
 */
static void add_child(descent *d, ebpo_cell cell, uint64_t group)
{
    d->child[d->child_count++] = (gray){ group, cell };
    d->has_next_level = d->has_next_level || group != NO_GROUP;
}

/* Returns true if the envelope of the next gray node or leaf is within max_error of the model. Must
 * be called exactly once for each gray node and leaf, in stored order. */
static bool is_close_enough(descent *d)
{
    return d->tolerance_nodes && d->tolerance_nodes[d->next_tolerance_node++].enough;
}

/* Copies the next gray node. The copy has no children if the children are not needed. */
static void copy_gray(descent *d, ebpo_cell cell)
{
    uint64_t rank = d->kept.next[EBPO_GRAY], group = d->child[d->from.leaf_count + rank].group;
    bool close_enough = is_close_enough(d);
    if (close_enough || !may_have_children(d->c, d->level) || !intersects_box(d->c, cell))
        group = NO_GROUP;
    kept_take(&d->kept, EBPO_GRAY);
    add_child(d, cell, group);
}

/* Adds the stored planes of the next leaf to the gray node that replaces the leaf: the last gray
 * node of the result. */
static void add_leaf_planes(descent *d)
{
    const ebpo_level *f = &d->from;
    ebpo_level *t = d->to;
    uint64_t count =
        f->leaf_plane_counts && t->plane_counts ? f->leaf_plane_counts[d->kept.next[EBPO_LEAF]] : 0;
    if (count == 0)
        return;
    t->plane_counts[t->gray_count - 1] = (uint8_t)count;
    memcpy(t->planes + t->plane_count, f->leaf_planes + d->kept.read[EBPO_PER_LEAF_PLANE],
           count * sizeof *t->planes);
    t->plane_count += count;
}

/* Sets the colour of the last gray node of the result, which is a leaf in the source, to the colour
 * of its parent. */
static void add_colour(descent *d)
{
    ebpo_level *t = d->to;
    if (t->gray_colours)
        t->gray_colours[t->gray_count - 1] =
            d->level ? t[-1].gray_colours[d->group] : EBPO_COLOUR_OF_NOTHING;
}

/* Returns true if the next leaf has no faces, as leaves of a surface with holes may have. Such a
 * leaf stays a leaf, because a pruned node has faces. */
static bool next_leaf_is_empty(const descent *d)
{
    uint64_t rank = d->kept.next[EBPO_LEAF];
    return d->from.leaf_new && d->from.leaf_new[rank] == 0 && d->from.leaf_ref_count[rank] == 0;
}

/* Copies the next leaf. If the part of the parent's envelope in the leaf's cell is within max_error
 * of the model, the leaf becomes a pruned node without planes. Otherwise, if the leaf is outside
 * the box, it becomes a pruned node with the leaf's planes. Returns the type of the copy. */
static ebpo_node_type copy_leaf(descent *d, ebpo_cell cell)
{
    bool close_enough = is_close_enough(d);
    if (next_leaf_is_empty(d) || (!close_enough && intersects_box(d->c, cell))) {
        kept_take(&d->kept, EBPO_LEAF);
        return EBPO_LEAF;
    }
    kept_add(&d->kept, EBPO_GRAY);
    if (!close_enough)
        add_leaf_planes(d);
    add_colour(d);
    kept_skip(&d->kept, EBPO_LEAF);
    add_child(d, cell, NO_GROUP);
    return EBPO_GRAY;
}

/* Copies the next node of this type; returns the type of the copy. */
static ebpo_node_type copy_node(descent *d, ebpo_node_type type, ebpo_cell cell)
{
    if (type == EBPO_LEAF)
        return copy_leaf(d, cell);
    if (type == EBPO_GRAY)
        copy_gray(d, cell);
    else
        kept_take(&d->kept, type);
    return type;
}

/* Returns the cell of an octant of a group of the result. `group` is also the index of the parent.
 */
static ebpo_cell child_cell(const descent *d, uint64_t group, unsigned octant)
{
    return d->level ? ebpo_cell_child(d->parent[group].cell, octant)
                    : (ebpo_cell){ 0, { 0, 0, 0 } };
}

/* Copies the nodes of a group of the result; `types` are their types in the source. */
static void copy_group(descent *d, uint64_t group, uint16_t types)
{
    d->group = group;
    for (unsigned octant = 0; octant < ebpo_group_octants(d->level); octant++) {
        ebpo_node_type type =
            copy_node(d, ebpo_group_type(types, octant), child_cell(d, group, octant));
        d->to->types[group] |= ebpo_group_of(type, octant);
    }
}

/* --- deciding which envelopes of a level are close enough --- */

/* With max_error, tests the envelopes of those gray nodes and leaves of the level that would
 * otherwise keep their children or stay leaves. */
static ebpo_status judge_level(descent *d)
{
    uint64_t next = 0, count = 0;
    d->next_tolerance_node = 0;
    if (!d->c->tolerance)
        return EBPO_OK;
    if (!(d->tolerance_nodes =
              ebpo_alloc_zero(d->from.gray_count + d->from.leaf_count, sizeof *d->tolerance_nodes)))
        return ebpo_fail_memory(d->c->error, (d->from.gray_count + d->from.leaf_count) *
                                                 sizeof *d->tolerance_nodes);
    for (uint64_t i = 0; i < d->parent_count; i++) {
        if (d->parent[i].group == NO_GROUP)
            continue;
        uint16_t types = d->from.types[next++];
        for (unsigned octant = 0; octant < ebpo_group_octants(d->level); octant++) {
            ebpo_node_type type = ebpo_group_type(types, octant);
            if (type != EBPO_GRAY && type != EBPO_LEAF)
                continue;
            ebpo_tolerance_node *node = &d->tolerance_nodes[count++];
            node->cell = child_cell(d, i, octant);
            node->required = intersects_box(d->c, node->cell) &&
                             (type == EBPO_LEAF || may_have_children(d->c, d->level));
        }
    }
    return ebpo_tolerance_judge(d->c->tolerance, d->tolerance_nodes, count,
                                d->c->options->max_error, d->c->error);
}

/* Makes a level of the result; its gray nodes become the parents of the next level. */
static ebpo_status cut_level(descent *d)
{
    ebpo_status status = pick_level(d);
    if (status == EBPO_OK)
        status = reserve_space(d);
    if (status == EBPO_OK)
        status = judge_level(d);
    uint64_t next = 0;
    d->to->group_count = d->parent_count;
    for (uint64_t i = 0; i < d->parent_count && status == EBPO_OK; i++) {
        if (d->parent[i].group == NO_GROUP)
            /* The group of a pruned node is stored as eight white nodes, with the types word 0. So
             * it also has values in the arrays of white nodes. */
            for (int k = 0; k < 8; k++)
                kept_add(&d->kept, EBPO_WHITE);
        else
            copy_group(d, i, d->from.types[next++]);
        d->nonempty_groups += d->to->types[i] != 0;
    }
    ebpo_level_free(&d->from);
    free(d->tolerance_nodes);
    d->tolerance_nodes = NULL;
    free(d->parent);
    d->parent = d->child;
    d->parent_count = d->child_count;
    d->child = NULL;
    d->child_count = 0;
    return status;
}

ebpo_status ebpo_cut_levels(ebpo_cutting *c)
{
    ebpo_info *info = &c->out->info;
    descent d = { .c = c,
                  .has_next_level = true,
                  .parent_count = 1,
                  .parent = ebpo_alloc_zero(1, sizeof *d.parent) };
    ebpo_status status = d.parent ? EBPO_OK : ebpo_fail_memory(c->error, sizeof *d.parent);
    info->level_count = 0;
    for (; d.has_next_level && status == EBPO_OK; d.level++) {
        if (!ebpo_progress_step(&c->options->progress, "reading levels", (uint64_t)d.level,
                                (uint64_t)c->last_level + 1, c->error)) {
            status = EBPO_E_CANCELLED;
            break;
        }
        d.to = &c->out->level[d.level];
        d.nonempty_groups = 0;
        d.has_next_level = false;
        status = cut_level(&d);
        if (status == EBPO_OK && d.level && d.nonempty_groups == 0) {
            /* No gray node of the level above has children. This happens in a subset of a subset,
             * if no node of this level is in both subsets. */
            ebpo_level_free(d.to);
            break;
        }
        if (d.level)
            d.to[-1].pruned_count = d.to->group_count - d.nonempty_groups;
        d.to->pruned_count = d.to->gray_count;
        d.to->gray_volume = c->from->level[d.level].gray_volume;
        d.to->leaf_volume = c->from->level[d.level].leaf_volume;
        info->level_count = d.level + 1;
    }
    free(d.parent);
    if (status != EBPO_OK)
        return status;
    /* cut: nodes of the source are missing; empty: some gray node has no children in the result */
    bool cut = false, empty = false;
    for (int i = 0; i < info->level_count; i++) {
        empty = empty || c->out->level[i].pruned_count;
        cut = cut || c->out->level[i].gray_count != c->from->level[i].gray_count ||
              c->out->level[i].leaf_count != c->from->level[i].leaf_count;
    }
    cut = cut || info->level_count < c->from->level_count || c->from->pruned;
    info->pruned = cut && empty;
    for (int i = 0; i < info->level_count && !info->pruned; i++)
        c->out->level[i].pruned_count = 0;
    return EBPO_OK;
}
