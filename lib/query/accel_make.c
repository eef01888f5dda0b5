/* Makes an accel, the acceleration structure of a subtree (accel.h), from the subtree's slice of
 * the file, and estimates its memory.
 *
 * The stages are: grouping of faces into blocks (blocks.c), a hierarchy over the blocks
 * (block_tree.c), bounds (block_bounds.c), child tables and leaf records (here). Leaf kinds are
 * found later (leaf_kinds.c).
 *
 * Memory is estimated from counts, before anything is read. Three estimates are upper bounds for
 * ordinary models only: the estimates of blocks, of the hierarchy over blocks, and of the faces
 * that a subtree shares with other subtrees. ebpo_accel_make_within and ebpo_slice_read_within
 * refuse models that exceed these estimates. */
#include "core/strict_fp.h"

#include <inttypes.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "core/alloc.h"
#include "core/error.h"
#include "core/hash.h"
#include "core/os.h"
#include "format/slice.h"
#include "geometry/level_nodes.h"
#include "query/accel.h"
#include "query/accel_parts.h"

/* --- memory --- */

/* Returns the maximum number of entries of all leaves' lists. Each reference (a listed face that an
 * earlier leaf lists, too) takes at most one entry. The n new faces of a leaf (all other listed
 * faces) are in one block if n <= 8, otherwise in at most 2 n / 9 blocks. */
static inline uint64_t list_max(uint64_t refs, uint64_t leaves, uint64_t faces)
{
    return refs + leaves + faces / 9 * 2 + 2;
}

/* Returns true if blocks need doubles. Single precision suffices for float coordinates whose
 * squares and cubes stay far from overflow and underflow. */
static bool accel_needs_doubles(const ebpo_info *info)
{
    double greatest = 0;
    for (int k = 0; k < 3; k++)
        greatest = fmax(greatest, fmax(fabs(info->box_origin[k]),
                                       fabs(info->box_origin[k] + info->box_size[k])));
    double shortest = fmin(info->box_size[0], fmin(info->box_size[1], info->box_size[2]));
    return info->double_coordinates || !(greatest < 0x1p40) || !(shortest > 0x1p-40);
}

static uint64_t greater_of(uint64_t a, uint64_t b) { return a > b ? a : b; }
static uint64_t lesser_of(uint64_t a, uint64_t b) { return a < b ? a : b; }

/* --- sizes from counts --- */

/* How many groups of siblings, leaves, ... a subtree or the whole model has. */
typedef struct counts {
    uint64_t groups, leaves, refs, uniform; /* refs: references; uniform: white and black nodes */
    uint64_t planes, leaf_planes;           /* of gray nodes, of leaves */
    uint64_t faces, shared, vertices;       /* `faces` includes the shared faces */
    bool is_subtree;                        /* false: the whole model */
    bool keeps_planes;                      /* the accel keeps the planes of gray nodes */
} counts;

/* Sizes in bytes, computed from counts. */
typedef struct sizes {
    uint64_t levels, mesh, maps, shared; /* sizes of the parts of the slice */
    uint64_t only_read;                  /* memory that is needed only while the slice is read */
    uint64_t nodes;                      /* child tables and leaf records */
    uint64_t list;                       /* lists of all leaves */
    uint64_t planes;                     /* plane codes of gray nodes */
    uint64_t rows;                       /* planes of leaves (ebpo_kind_row) */
    uint64_t slots;                      /* slot of each face, while nodes are filled */
    uint64_t reserve;                    /* for threads and small allocations */
} sizes;

static bool has_windings(const ebpo_info *info)
{
    return info->solid || info->parts & EBPO_PART_BORDER;
}

/* Returns the bytes of the grid with which searches in a whole model start several levels below the
 * root. Each grid cell takes 5 bytes. */
static uint64_t grid_bytes(uint64_t groups)
{
    int bits = ebpo_node_grid_bits(groups);
    return bits ? (UINT64_C(1) << 3 * bits) * 5 : 0;
}

/* Returns the bytes of the table of older vertices, that is, vertices that a face before the
 * subtree uses (slice.c). In ordinary models there are at most six for each shared face. */
static uint64_t older_vertices_bytes(const counts *c) { return ebpo_compact_bytes(6 * c->shared); }

static sizes sizes_of(const counts *c, const ebpo_info *info)
{
    uint64_t coordinate = info->double_coordinates ? sizeof(double) : sizeof(float),
             maps = info->parts & EBPO_PART_MAPS ? 4 : 0;
    return (sizes){
        .levels = 3 * c->groups + 20 * c->leaves + 4 * (c->uniform + c->refs + c->planes),
        .mesh = 12 * c->faces + 3 * coordinate * c->vertices,
        .maps = c->is_subtree ? 0 : maps * c->faces,
        .shared = 4 * c->shared,
        .only_read = c->is_subtree ? older_vertices_bytes(c)
                                   : maps * c->vertices + c->leaves + 4 * c->leaf_planes,
        .nodes = c->groups * 32 + (c->is_subtree ? 0 : grid_bytes(c->groups)) +
                 c->leaves * sizeof(ebpo_accel_leaf),
        .list = list_max(c->refs, c->leaves, c->faces) * sizeof(ebpo_listed_block),
        .planes = c->keeps_planes ? 4 * (c->groups + 1 + c->planes) : 0,
        .rows = c->is_subtree && has_windings(info) ? c->leaves * sizeof(ebpo_kind_row) : 0,
        .slots = 4 * c->faces,
        .reserve = c->is_subtree ? 1 << 14 : 3 << 16,
    };
}

static counts counts_of_all(const ebpo_info *info)
{
    counts c = {
        .groups = 1, .faces = info->face_count, .vertices = info->vertex_count, .keeps_planes = true
    };
    for (int i = 0; i < info->level_count; i++) {
        const ebpo_level_summary *level = &info->level[i];
        c.groups += level->gray_count;
        c.leaves += level->leaf_count;
        c.refs += level->ref_count;
        c.uniform += level->white_count + level->black_count;
        c.planes += level->plane_count;
        c.leaf_planes += level->leaf_plane_count;
    }
    return c;
}

static counts counts_of_slice(const ebpo_slice *slice, ebpo_accel_content content)
{
    counts c = { .faces = slice->mesh.face_count,
                 .shared = slice->shared_count,
                 .vertices = slice->mesh.vertex_count,
                 .is_subtree = slice->root.cell.level > 0,
                 .keeps_planes = content >= EBPO_ACCEL_PLANES };
    for (int i = 0; i < slice->level_count; i++) {
        const ebpo_level *level = &slice->level[i];
        c.groups += level->group_count;
        c.leaves += level->leaf_count;
        c.refs += level->ref_count;
        c.uniform += level->white_count + level->black_count;
        c.planes += level->plane_count;
    }
    return c;
}

/* Estimates the counts of a subtree. In ordinary models, the number of shared faces is about three
 * times the square root of the number of owned faces. The estimate is `roots` times this square
 * root plus `more`, and at most the number of references. */
static counts counts_of_size(const ebpo_slice_size *size, const ebpo_info *info, double roots,
                             uint64_t more)
{
    uint64_t owned = size->new_faces, nodes = 8 * size->groups,
             shared = lesser_of(size->refs, (uint64_t)(roots * sqrt((double)owned)) + more),
             faces = owned + shared, vertices = faces / 4 * 3 + 64;
    double vertices_per_face =
        info->face_count ? (double)info->vertex_count / (double)info->face_count : 0;
    return (counts){ .groups = size->groups,
                     .leaves = size->leaves,
                     .refs = size->refs,
                     .uniform = nodes > size->leaves ? nodes - size->leaves : 0,
                     .planes = size->planes,
                     .faces = faces,
                     .shared = shared,
                     .vertices =
                         greater_of(vertices, (uint64_t)(1.25 * vertices_per_face * (double)faces)),
                     .is_subtree = true,
                     .keeps_planes = size->planes > 0 };
}

/* --- sizes that are known after blocks are made --- */

typedef struct block_sizes {
    uint64_t blocks, bounds, units; /* numbers of blocks, nodes of the hierarchy, and units */
} block_sizes;

/* Returns upper bounds that are valid for ordinary models. */
static block_sizes ordinary_sizes(const counts *c, const ebpo_info *info)
{
    uint64_t bytes = c->faces * (accel_needs_doubles(info) ? 56 : 32);
    return (block_sizes){ .blocks = c->faces / 4 + 16,
                          .bounds = c->faces / 16 + 16,
                          .units = bytes / EBPO_MESHLET_UNIT + 64 };
}

/* Returns the memory that an accel keeps. */
static uint64_t kept_bytes(const sizes *size, const block_sizes *count)
{
    return sizeof(ebpo_accel) + sizeof(ebpo_leaf_kinds) + size->maps + size->shared + size->nodes +
           size->list + size->planes + size->rows + (count->units + 1) * EBPO_MESHLET_UNIT +
           (count->bounds + 1) * (sizeof(ebpo_bound) + sizeof(ebpo_bound_cylinder));
}

/* Returns the most memory that exists at a time while an accel is made. In addition to the memory
 * that is kept, memory is needed first for the mesh and the corners of blocks (`early`), then for
 * extents and the boxes from which the hierarchy is made, then for the nodes (`late`). In all of
 * these stages, memory is needed for the layout (ebpo_layout), whose nodes may have more space than
 * they use, because they grow by half of their size.
 *
 * If a model is refused after its layout was made, this layout also fits into the returned maximum:
 * the layout takes at most 4 bytes for each face and a bit, less than the 56 bytes a face that
 * ordinary records, bounds and layouts take. */
static uint64_t peak_bytes(const sizes *size, const block_sizes *count)
{
    /* bytes of each */
    enum { LAYOUT_BLOCK = 12, LAYOUT_BOUND = 60, CORNERS = 25, EXTENT = 72, BOX = 36 };
    uint64_t layout = count->blocks * LAYOUT_BLOCK + count->bounds * LAYOUT_BOUND,
             early = size->mesh + count->blocks * CORNERS,
             extents = (count->blocks + count->bounds) * EXTENT + count->blocks * BOX,
             late = size->nodes + size->list,
             after = size->nodes + size->list + size->planes + size->rows,
             kept = kept_bytes(size, count) - after,
             read = size->levels + size->mesh + size->shared + size->maps + size->only_read;
    uint64_t made =
        size->levels + kept + greater_of(greater_of(early, extents), late + size->slots) + layout;
    return greater_of(greater_of(read, made), size->levels + kept + after) + size->reserve;
}

/* --- estimates --- */

void ebpo_accel_estimate_whole(const ebpo_info *info, uint64_t *keep, uint64_t *peak)
{
    counts c = counts_of_all(info);
    sizes size = sizes_of(&c, info);
    block_sizes count = ordinary_sizes(&c, info);
    *keep = kept_bytes(&size, &count);
    *peak = peak_bytes(&size, &count);
}

void ebpo_accel_estimate_subtree(const ebpo_slice_size *slice_size, const ebpo_info *info,
                                 uint64_t *keep, uint64_t *peak)
{
    counts c = counts_of_size(slice_size, info, 8, 64);
    sizes size = sizes_of(&c, info);
    block_sizes count = ordinary_sizes(&c, info);
    *keep = kept_bytes(&size, &count);
    *peak = peak_bytes(&size, &count);
}

/* Uses measured averages. On average, blocks and nodes of the hierarchy are fuller than the proven
 * minimum, and an entry of a leaf's list has several faces. */
uint64_t ebpo_accel_mean_bytes(const ebpo_slice_size *all, const ebpo_info *info, uint64_t subtrees)
{
    uint64_t n = subtrees ? subtrees : 1;
    ebpo_slice_size mean = { .groups = all->groups / n + 1,
                             .leaves = all->leaves / n + 1,
                             .refs = all->refs / n + 1,
                             .new_faces = all->new_faces / n + 1,
                             .planes = all->planes / n + 1 };
    counts c = counts_of_size(&mean, info, 3.5, 2);
    sizes size = sizes_of(&c, info);
    uint64_t bytes = c.faces * (accel_needs_doubles(info) ? 48 : 27);
    block_sizes count = { .units = bytes / EBPO_MESHLET_UNIT + 4, .bounds = c.faces / 24 + 1 };
    size.list = ((c.refs + c.leaves) / 2 + c.faces / 16 + 4) * sizeof(ebpo_listed_block);
    return kept_bytes(&size, &count);
}

/* The bounds follow from these facts. Blocks are at least half full, with one exception: a leaf
 * with few faces has a separate block if neighbouring leaves fill their blocks. The 64 bytes for
 * each leaf cover the additional size of such blocks, and the planes of leaves in a subtree
 * (ebpo_leaf_kinds). Lists have at most one entry for each listed face. A record has at most three
 * vertices a face, or four if it has 24 vertices. */
void ebpo_accel_estimate(const ebpo_slice_size *size, const ebpo_info *info, uint64_t *keep,
                         uint64_t *peak)
{
    uint64_t wide = accel_needs_doubles(info) ? 2 : 1, faces = size->new_faces + size->shared;
    uint64_t blocks = faces / 4 + 2, bounds = blocks / 3 + 2;
    *keep = sizeof(ebpo_accel) + sizeof(ebpo_leaf_kinds) + size->groups * 64 +
            size->leaves * (sizeof(ebpo_accel_leaf) + 64) +
            (size->refs + size->new_faces) * sizeof(ebpo_listed_block) +
            blocks * (EBPO_MESHLET_WIDE + EBPO_MESHLET_UNIT) + faces * 48 * wide +
            bounds * (sizeof(ebpo_bound) + sizeof(ebpo_bound_cylinder)) + faces * 8;
    *peak = *keep + size->groups * 128 + size->leaves * 64 + faces * (12 + 36 * wide + 24) +
            (blocks + bounds) * 72 + 65536;
}

/* --- limits --- */

/* Returns EBPO_E_LIMIT if making the accel takes more memory, including the slice, than the quota
 * `space` (NULL: no limit). units: number of units of the blocks. Before the layout is made, the
 * numbers of blocks and units are those of an ordinary model. */
static ebpo_status accel_fits(ebpo_quota *space, const ebpo_accel_plan *plan, uint64_t units,
                              ebpo_error *error)
{
    if (!space)
        return EBPO_OK;
    const ebpo_layout *layout = plan->layout;
    counts c = counts_of_slice(plan->slice, plan->content);
    sizes size = sizes_of(&c, plan->info);
    size.only_read = 0; /* the slice has been read */
    block_sizes count = layout ? (block_sizes){ layout->block_count,
                                                ebpo_layout_nodes_max(layout->block_count), units }
                               : ordinary_sizes(&c, plan->info);
    uint64_t peak = peak_bytes(&size, &count);
    ebpo_quota all = { .most = space->most };
    ebpo_status status = ebpo_quota_check(&all, peak, error);
    space->needed = all.needed;
    return status;
}

/* --- child tables and leaf records --- */

typedef struct walk {
    ebpo_accel *s;
    const ebpo_slice *slice;
    const uint32_t *slot_of;           /* [local face] */
    uint64_t rank[EBPO_LEVELS_MAX][4]; /* number of visited nodes of each level and type */
    uint64_t refs[EBPO_LEVELS_MAX];    /* number of visited references of each level's leaves */
    /* index in the accel of the first group, and of the first leaf, of each level */
    uint64_t group_begin[EBPO_LEVELS_MAX];
    uint64_t leaf_begin[EBPO_LEVELS_MAX];
    uint64_t list_capacity;
    ebpo_status status;
    ebpo_error *error;
} walk;

/* Reserves `more` list entries, an upper bound for one leaf. (reserve_space has already reserved
 * the entries that ordinary leaves need; trim_list frees the excess.) Returns false after an error.
 */
static bool reserve_list(walk *w, uint64_t more)
{
    ebpo_accel *s = w->s;
    if (!ebpo_grow(&s->list, &w->list_capacity, s->list_count + more, sizeof *s->list))
        w->status = ebpo_fail_memory(w->error, (s->list_count + more) * sizeof *s->list);
    else if (s->list_count + more > UINT32_MAX)
        w->status = ebpo_fail(w->error, EBPO_E_LIMIT,
                              "the leaves list too many faces to be held in memory at once; give a "
                              "memory budget");
    return w->status == EBPO_OK;
}

/* A leaf's entries so far. */
typedef struct listing {
    ebpo_listed_block *list;
    uint32_t count; /* number of entries */
    uint32_t block; /* block of the last entry; UINT32_MAX: there is no entry */
    uint64_t last;  /* the last entry */
} listing;

/* Adds a face to the leaf's list. Faces are added in ascending order, so consecutive faces of one
 * block become one entry. A mask, and not a branch, starts new entries, because the processor could
 * not predict the branch. */
static inline void list_face(const walk *w, uint64_t face, listing *l)
{
    uint32_t slot = w->slot_of[face], block = slot / EBPO_BLOCK;
    uint64_t lane = UINT64_C(1) << (slot % EBPO_BLOCK + EBPO_LISTED_LANES);
    uint64_t is_new = block != l->block;
    l->last = (l->last & (is_new - 1)) | block | lane;
    l->count += (uint32_t)is_new;
    l->block = block;
    ebpo_list(&l->list[l->count - 1], l->last);
}

/* Fills in leaf `index` of the accel. `rank`: position of the leaf among the leaves of its level.
 * The leaf's list has first the references, then the new faces, whose indices are greater. */
static void fill_leaf(walk *w, const ebpo_level *level, int depth, uint64_t rank, uint32_t index)
{
    ebpo_accel_leaf *leaf = &w->s->leaf[index];
    uint64_t refs = level->leaf_ref_count[rank], new_count = level->leaf_new[rank];
    if (!reserve_list(w, refs + (new_count > EBPO_BLOCK ? 2 * new_count / 9 : 1)))
        return;
    listing l = { .list = w->s->list + w->s->list_count, .block = UINT32_MAX };
    const uint32_t *ref = refs ? level->leaf_refs + w->refs[depth] : NULL;
    for (uint64_t i = 0; i < refs; i++)
        list_face(w, ref[i], &l);
    for (uint64_t i = level->leaf_first[rank], end = i + new_count; i < end; i++)
        list_face(w, i, &l);
    if (!l.count) /* a leaf without faces gets block 0 without lanes */
        l.count = 1;
    ebpo_list(&l.list[l.count - 1], l.last | EBPO_LISTED_LAST);
    if (w->s->list_longest < l.count)
        w->s->list_longest = l.count;
    leaf->list = (uint32_t)w->s->list_count;
    w->s->list_count += l.count;
    w->refs[depth] += refs;
    leaf->kind = w->s->has_windings ? EBPO_LEAF_UNKNOWN : EBPO_LEAF_GENERAL;
    leaf->winding = level->leaf_winding ? level->leaf_winding[rank] : 0;
}

/* Returns the table entry of a white or black node. `windings`: [rank], or NULL. */
static uint32_t uniform_entry(walk *w, const int32_t *windings, uint64_t rank,
                              int32_t default_winding)
{
    uint32_t entry = 0;
    if (!ebpo_entry_uniform(windings ? windings[rank] : default_winding, &entry))
        w->status =
            ebpo_fail(w->error, EBPO_E_LIMIT,
                      "the winding number of a node is beyond 2^29: the solid has too many shells");
    return entry;
}

/* Fills the tables below the next node of this level (`depth`) and type. Returns the node's entry.
 */
static uint32_t walk_node(walk *w, int depth, ebpo_node_type type)
{
    const ebpo_level *level = &w->slice->level[depth];
    uint64_t rank = w->rank[depth][type]++;
    if (w->status != EBPO_OK)
        return 0;
    if (type == EBPO_WHITE)
        return uniform_entry(w, level->white_winding, rank, 0);
    if (type == EBPO_BLACK)
        return uniform_entry(w, level->black_winding, rank, 1);
    if (type == EBPO_LEAF) {
        uint32_t index = (uint32_t)(w->leaf_begin[depth] + rank);
        uint32_t uniform = uniform_entry(w, level->leaf_winding, rank, 0); /* checks the number */
        fill_leaf(w, level, depth, rank, index);
        /* a leaf without faces, in a surface with holes, is like a white node */
        if (depth > 0 && level->leaf_new[rank] == 0 && level->leaf_ref_count[rank] == 0)
            return uniform;
        return ebpo_entry(EBPO_ENTRY_LEAF, index);
    }
    uint64_t group = w->group_begin[depth + 1] + rank;
    if (w->slice->pruned &&
        (depth + 1 == w->slice->level_count || w->slice->level[depth + 1].types[rank] == 0)) {
        if (depth + 1 < w->slice->level_count) {
            /* the file stores eight white nodes in place of the pruned node's children */
            w->rank[depth + 1][EBPO_WHITE] += 8;
            memset(w->s->nodes.group[group], 0xff, sizeof w->s->nodes.group[group]);
        }
        return ebpo_entry(EBPO_ENTRY_SUBTREE_ROOT, (uint32_t)group);
    }
    uint16_t types = w->slice->level[depth + 1].types[rank];
    for (unsigned octant = 0; octant < 8; octant++)
        w->s->nodes.group[group][octant] = walk_node(w, depth + 1, ebpo_group_type(types, octant));
    return ebpo_entry(EBPO_ENTRY_GRAY, (uint32_t)group);
}

/* Allocates the tables, and makes *slot_of: the slot (8 * block number + lane) of each local face.
 */
static ebpo_status reserve_space(walk *w, const ebpo_layout *layout, uint32_t **slot_of)
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
        /* gray nodes of the last level are pruned: these nodes have group numbers, but no groups */
        w->group_begin[slice->level_count] = groups;
    if (groups >= EBPO_ENTRY_ZERO || leaves >= EBPO_ENTRY_ZERO)
        return ebpo_fail(w->error, EBPO_E_LIMIT,
                         "the tree has too many nodes to be held in memory at once; give a "
                         "memory budget");
    s->nodes.group = ebpo_alloc(groups, sizeof *s->nodes.group);
    s->nodes.group_count = (uint32_t)groups;
    s->leaf = ebpo_alloc_zero(leaves, sizeof *s->leaf);
    s->leaf_count = (uint32_t)leaves;
    uint64_t faces = layout->block_begin[layout->block_count];
    uint32_t *map = *slot_of = ebpo_alloc(faces, sizeof *map);
    bool list = ebpo_grow(&s->list, &w->list_capacity, list_max(refs, leaves, slice->face_count),
                          sizeof *s->list);
    if (!s->nodes.group || !s->leaf || !map || !list)
        return ebpo_fail_memory(w->error, groups * 32 + leaves * sizeof *s->leaf + faces * 4);
    ebpo_prefer_huge_pages(s->nodes.group, groups * sizeof *s->nodes.group);
    ebpo_prefer_huge_pages(s->leaf, leaves * sizeof *s->leaf);
    ebpo_prefer_huge_pages(map, faces * sizeof *map);
    for (uint64_t b = 0; b < layout->block_count; b++)
        for (uint32_t face = layout->block_begin[b]; face < layout->block_begin[b + 1]; face++)
            map[face] = layout->block_number[b] * EBPO_BLOCK + face - layout->block_begin[b];
    return EBPO_OK;
}

/* Trims the list to its used entries. */
static void trim_list(ebpo_accel *s)
{
    ebpo_listed_block *trimmed = ebpo_realloc(s->list, s->list_count, sizeof *s->list);
    s->list = trimmed ? trimmed : s->list;
}

/* Fills child tables and leaf records with their lists of blocks, in one walk through the tree. */
static ebpo_status accel_fill_nodes(ebpo_accel *s, const ebpo_slice *slice,
                                    const ebpo_layout *layout, ebpo_error *error)
{
    walk w = { .s = s, .slice = slice, .status = EBPO_OK, .error = error };
    uint32_t *slot_of = NULL;
    ebpo_status status = reserve_space(&w, layout, &slot_of);
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

/* --- the stages --- */

/* Returns the constant part of the error bound of a cross product of differences of coordinates,
 * computed in floats (see "turn" in query/inside_kernels.c). */
static double turn_error_constant(const ebpo_box *box)
{
    double coordinate = 0, size = 0; /* the greatest of each */
    for (int k = 0; k < 3; k++) {
        coordinate =
            fmax(coordinate, fmax(fabs(box->origin[k]), fabs(box->origin[k] + box->size[k])));
        size = fmax(size, box->size[k]);
    }
    return 0x1p-43 * coordinate * size;
}

/* Sets the frame, the coordinates of the subtree (accel.h): the centre of the subtree's cell, and a
 * power of two that scales the cell's longest side to 1 .. 2. */
static void make_frame(ebpo_accel *s)
{
    double longest = 0, low[3], high[3];
    ebpo_cell_bounds(&s->box, s->root.cell, low, high);
    for (int k = 0; k < 3; k++) {
        s->centre[k] = low[k] / 2 + high[k] / 2;
        longest = fmax(longest, high[k] - low[k]);
    }
    int exponent;
    frexp(longest, &exponent);
    s->turn_error_constant = (float)turn_error_constant(&s->box);
    s->scale = ldexp(1, exponent < -1000 ? 1000 : exponent > 1000 ? -1000 : 1 - exponent);
}

/* Copies the planes of gray nodes from the slice. */
static ebpo_status copy_planes(ebpo_accel *s, const ebpo_slice *slice, ebpo_error *error)
{
    uint64_t grays = 0, planes = 0, at = 0;
    for (int i = 0; i < slice->level_count; i++) {
        grays += slice->level[i].gray_count;
        planes += slice->level[i].plane_count;
    }
    if (planes > UINT32_MAX) /* larger numbers do not fit into gray_first */
        return ebpo_fail(error, EBPO_E_LIMIT,
                         "the tree has too many planes to be held in memory at once; give a "
                         "memory budget");
    s->gray_planes = ebpo_alloc(planes, sizeof *s->gray_planes);
    s->gray_first = ebpo_alloc(grays + 1, sizeof *s->gray_first);
    if (!s->gray_planes || !s->gray_first)
        return ebpo_fail_memory(error, (grays + planes) * 4);
    uint64_t gray = 0;
    for (int i = 0; i < slice->level_count; i++) {
        const ebpo_level *level = &slice->level[i];
        uint64_t first = at;
        for (uint64_t k = 0; k < level->gray_count; k++) {
            s->gray_first[gray++] = (uint32_t)at;
            at += level->plane_counts ? level->plane_counts[k] : 0;
        }
        if (level->plane_count)
            memcpy(s->gray_planes + first, level->planes,
                   level->plane_count * sizeof *s->gray_planes);
    }
    s->gray_first[gray] = (uint32_t)at;
    s->gray_count = gray;
    return EBPO_OK;
}

/* Returns the maximum number of rows of leaf planes (ebpo_kind_row). For a subtree the maximum is
 * small, because few of its leaves are queried often, and count_bytes counts all these rows as used
 * from the beginning. */
static uint64_t rows_max(const ebpo_accel *s)
{
    return s->root.cell.level ? s->leaf_count : 5 * (uint64_t)s->leaf_count;
}

/* Returns the value of ebpo_accel.bytes. */
static uint64_t count_bytes(const ebpo_accel *s)
{
    uint64_t cells = s->nodes.grid_bits ? UINT64_C(1) << 3 * s->nodes.grid_bits : 0;
    return sizeof *s + s->nodes.group_count * sizeof *s->nodes.group + cells * 5 +
           s->leaf_count * sizeof *s->leaf + s->list_count * sizeof *s->list +
           (s->kinds ? sizeof *s->kinds : 0) +
           (s->kinds && s->root.cell.level ? rows_max(s) * sizeof(ebpo_kind_row) : 0) +
           (s->units + 1) * EBPO_MESHLET_UNIT +
           s->bound_count * (sizeof *s->bound + sizeof *s->cylinder) +
           (uint64_t)s->shared_count * 4 + (s->face_source ? (uint64_t)s->face_count * 4 : 0) +
           (s->gray_first ? (s->gray_count + s->gray_first[s->gray_count]) * 4 : 0);
}

/* Makes all parts of the accel, in stages. Checks the quota again whenever more is known about the
 * size. */
static ebpo_status make_stages(ebpo_accel *s, ebpo_slice *slice, const ebpo_info *info,
                               ebpo_quota *space, unsigned threads, ebpo_error *error)
{
    ebpo_layout layout;
    ebpo_accel_plan plan = { info, slice, s->content, NULL };
    ebpo_status status = accel_fits(space, &plan, 0, error);
    if (status == EBPO_OK)
        status = ebpo_layout_make(&layout, slice, EBPO_BLOCKS_MAX, error);
    if (status != EBPO_OK)
        return status;
    plan.layout = &layout;
    status = accel_fits(space, &plan, layout.block_count, error);
    if (status == EBPO_OK)
        status = ebpo_accel_number_blocks(s, &plan, threads, error);
    if (status == EBPO_OK)
        status = accel_fits(space, &plan, s->units, error);
    if (status == EBPO_OK)
        status = ebpo_accel_fill_blocks(s, &plan, threads, error);
    ebpo_mesh_free(&slice->mesh);
    if (status == EBPO_OK)
        status = ebpo_accel_fill_bounds(s, &layout, threads, error);
    if (status == EBPO_OK && s->content >= EBPO_ACCEL_NODES)
        status = accel_fill_nodes(s, slice, &layout, error);
    ebpo_layout_free(&layout);
    if (status == EBPO_OK && s->has_windings && s->content >= EBPO_ACCEL_NODES) {
        s->kinds = ebpo_leaf_kinds_make(rows_max(s));
        status = s->kinds ? EBPO_OK : ebpo_fail_memory(error, sizeof *s->kinds);
    }
    if (status == EBPO_OK && s->content >= EBPO_ACCEL_PLANES)
        status = copy_planes(s, slice, error);
    return status;
}

/* Copies an array to *to, frees the array, and moves *to behind the copy. Returns the copy. */
static void *move_array(char **to, void *array, uint64_t bytes)
{
    void *copy = *to;
    if (!array)
        return NULL;
    memcpy(copy, array, bytes);
    free(array);
    *to += bytes;
    return copy;
}

/* Moves the arrays of a subtree to one allocation. A cache of subtrees frees and allocates all the
 * time. With an allocation for each array, the free memory is soon in many small pieces, and the
 * allocator takes up to a third of the time of a load to find pieces that fit. Does nothing without
 * a quota, for a subtree that is not kept; if the quota is too small for the subtree and copies of
 * its arrays; or if memory is short. */
static void join_arrays(ebpo_accel *s, const ebpo_quota *space)
{
    uint64_t meshlets = (s->units + 1) * EBPO_MESHLET_UNIT,
             bounds = s->bound_count * (uint64_t)sizeof *s->bound,
             cylinders = s->bound_count * (uint64_t)sizeof *s->cylinder,
             list = s->list_count * sizeof *s->list, leaves = s->leaf_count * sizeof *s->leaf,
             shared = (uint64_t)s->shared_count * sizeof *s->shared,
             first = s->gray_first ? (s->gray_count + 1) * sizeof *s->gray_first : 0,
             planes = s->gray_first
                          ? s->gray_first[s->gray_count] * (uint64_t)sizeof *s->gray_planes
                          : 0,
             all = meshlets + bounds + cylinders + list + leaves + shared + first + planes;
    all = (all + EBPO_MESHLET_UNIT - 1) / EBPO_MESHLET_UNIT * EBPO_MESHLET_UNIT;
    s->arrays =
        !space || s->bytes + all > space->most ? NULL : aligned_alloc(EBPO_MESHLET_UNIT, all);
    if (!s->arrays)
        return;
    /* in the order of the alignments, so that there is no space between the arrays */
    char *to = s->arrays;
    s->meshlets = move_array(&to, s->meshlets, meshlets);
    s->bound = move_array(&to, s->bound, bounds);
    s->cylinder = move_array(&to, s->cylinder, cylinders);
    s->list = move_array(&to, (void *)s->list, list);
    s->leaf = move_array(&to, s->leaf, leaves);
    s->shared = move_array(&to, s->shared, shared);
    s->gray_first = move_array(&to, s->gray_first, first);
    s->gray_planes = move_array(&to, s->gray_planes, planes);
}

ebpo_status ebpo_accel_make(ebpo_accel **out, ebpo_slice *slice, const ebpo_info *info,
                            ebpo_accel_content content, unsigned threads, ebpo_error *error)
{
    return ebpo_accel_make_within(out, slice, info, NULL, content, threads, error);
}

ebpo_status ebpo_accel_make_within(ebpo_accel **out, ebpo_slice *slice, const ebpo_info *info,
                                   ebpo_quota *space, ebpo_accel_content content, unsigned threads,
                                   ebpo_error *error)
{
    *out = NULL;
    ebpo_accel *s = ebpo_alloc_zero(1, sizeof *s);
    if (!s) {
        ebpo_slice_free(slice);
        return ebpo_fail_memory(error, sizeof *s);
    }
    s->box = ebpo_root_box(info);
    s->root = slice->root;
    s->deepest = slice->root.cell.level + slice->level_count - 1;
    s->has_windings = has_windings(info);
    s->rule = (uint8_t)info->rule;
    s->content = (uint8_t)content;
    s->wide = accel_needs_doubles(info);
    s->face_count = (uint32_t)slice->mesh.face_count;
    s->shared_count = slice->shared_count;
    s->first_face = slice->first_face;
    make_frame(s);
    ebpo_status status =
        slice->mesh.face_count >= EBPO_IS_BLOCK
            ? ebpo_fail(error, EBPO_E_LIMIT,
                        "the model has too many faces to be held in memory at once; give a "
                        "memory budget")
            : make_stages(s, slice, info, space, threads, error);
    s->shared = slice->shared;
    s->face_source = slice->face_source;
    slice->shared = slice->face_source = NULL;
    ebpo_slice_free(slice);
    if (status != EBPO_OK) {
        ebpo_accel_free(s);
        return status;
    }
    if (s->root.cell.level == 0)
        ebpo_node_table_make_grid(&s->nodes);
    s->bytes = count_bytes(s);
    if (s->root.cell.level > 0)
        join_arrays(s, space);
    *out = s;
    return EBPO_OK;
}

void ebpo_accel_free(ebpo_accel *s)
{
    if (!s)
        return;
    ebpo_node_table_free(&s->nodes);
    ebpo_leaf_kinds_free(s->kinds);
    if (!s->arrays) {
        free(s->leaf);
        free(s->list);
        free(s->meshlets);
        free(s->bound);
        free(s->cylinder);
        free(s->shared);
        free(s->gray_planes);
        free(s->gray_first);
    }
    free(s->face_source);
    free(s->arrays);
    free(s);
}
