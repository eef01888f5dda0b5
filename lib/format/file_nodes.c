/* Reads single nodes of a file through a cache of chunks: the children of a gray node, and the
 * planes and the winding number of a node. Also reads groups (the eight children of a gray node)
 * with their planes and winding numbers, for streams that do not follow the file's order. Each
 * function reads only the chunks with the node's data, and the chunks with the sums that locate
 * these data. It checks the values against the header and the index arrays. For remote files,
 * several groups are fetched together. */
#include <inttypes.h>
#include <stdlib.h>
#include <string.h>

#include "core/error.h"
#include "format/chunks.h"
#include "format/file_nodes.h"
#include "format/subtree_index.h"
#include "geometry/level_nodes.h"
#include "geometry/polytope.h"

ebpo_status ebpo_chunks_check_node(const ebpo_chunks *chunks, const ebpo_node *node,
                                   ebpo_error *error)
{
    const ebpo_info *info = &chunks->file->info;
    const char *shown = chunks->file->in.shown;
    if (node->cell.level < 0 || node->cell.level >= info->level_count ||
        (unsigned)node->type > EBPO_GRAY)
        return ebpo_fail_file(error, EBPO_E_ARGUMENT, shown,
                              "there is no level %d; the file has levels 0 to %d", node->cell.level,
                              info->level_count - 1);
    const ebpo_level_summary *s = &info->level[node->cell.level];
    const uint64_t counts[4] = { s->white_count, s->black_count, s->leaf_count, s->gray_count };
    if (node->rank >= counts[node->type])
        return ebpo_fail_file(error, EBPO_E_ARGUMENT, shown,
                              "level %d has %" PRIu64
                              " nodes of type %d (ebpo_node_type), but node "
                              "number %" PRIu64 " was requested",
                              node->cell.level, counts[node->type], (int)node->type, node->rank);
    return EBPO_OK;
}

/* Fails with EBPO_E_ARGUMENT if the node is not of `type`, or if the level has no node of this
 * rank. `what`: name of the requested data for messages, in the plural. */
static ebpo_status check_type(const ebpo_chunks *chunks, const ebpo_node *node, ebpo_node_type type,
                              const char *what, ebpo_error *error)
{
    if (node->type != type)
        return ebpo_fail_file(error, EBPO_E_ARGUMENT, chunks->file->in.shown,
                              "%s of a node of type %d (ebpo_node_type) were requested, but such "
                              "nodes have no %s",
                              what, (int)node->type, what);
    return ebpo_chunks_check_node(chunks, node, error);
}

ebpo_status ebpo_chunks_children(ebpo_chunks *chunks, const ebpo_node *gray, uint16_t *types,
                                 uint64_t ranks[4], ebpo_error *error)
{
    uint64_t counts[4];
    ebpo_status status = check_type(chunks, gray, EBPO_GRAY, "children", error);
    if (status == EBPO_OK && gray->cell.level + 1 == chunks->file->info.level_count) {
        /* the node is pruned: ebpo_facts_check rejects files with other gray nodes on the last
         * level */
        *types = 0;
        memset(ranks, 0, 4 * sizeof *ranks);
        return EBPO_OK;
    }
    if (status == EBPO_OK)
        status = ebpo_ranks_before(chunks, gray->cell.level + 1, gray->rank, ranks, error);
    if (status == EBPO_OK)
        status = ebpo_chunks_integers(chunks, EBPO_A_TYPES, gray->cell.level + 1, gray->rank, 1,
                                      types, sizeof *types, error);
    if (status != EBPO_OK)
        return status;
    ebpo_groups_count(types, 1, counts);
    return ebpo_ranks_check(chunks, gray->cell.level + 1, ranks, counts, error);
}

/* The arrays of a level that have the planes of gray nodes or of leaves. */
typedef struct plane_list {
    ebpo_array_id counts, codes;
    uint32_t part;
    uint64_t all; /* number of planes in the level */
} plane_list;

static plane_list planes_of(const ebpo_chunks *chunks, const ebpo_node *node)
{
    const ebpo_level_summary *s = &chunks->file->info.level[node->cell.level];
    return node->type == EBPO_LEAF ? (plane_list){ EBPO_A_LEAF_PLANE_COUNTS, EBPO_A_LEAF_PLANES,
                                                   EBPO_PART_LEAF_PLANES, s->leaf_plane_count }
                                   : (plane_list){ EBPO_A_PLANE_COUNTS, EBPO_A_PLANES,
                                                   EBPO_PART_PLANES, s->plane_count };
}

/* Reads and checks the plane codes of one node. `first`: rank of its first plane in the level. */
static ebpo_status read_codes(ebpo_chunks *chunks, const plane_list *list, int level,
                              uint64_t first, unsigned count, uint32_t *codes, ebpo_error *error)
{
    if (count > list->all - first)
        return ebpo_chunks_fail(chunks, level, list->counts,
                                "the counts do not add up to the number of planes", error);
    ebpo_status status =
        ebpo_chunks_integers(chunks, list->codes, level, first, count, codes, sizeof *codes, error);
    for (unsigned i = 0; i < count && status == EBPO_OK; i++) {
        int32_t n[3], d;
        if (!ebpo_plane_code_decode(codes[i], n, &d))
            status = ebpo_chunks_fail(chunks, level, list->codes, "invalid plane code", error);
    }
    return status;
}

ebpo_status ebpo_chunks_planes(ebpo_chunks *chunks, const ebpo_node *node,
                               uint32_t codes[EBPO_NODE_PLANES], unsigned *count, ebpo_error *error)
{
    uint64_t first = 0;
    uint8_t plane_count = 0;
    *count = 0;
    ebpo_status status = node->type == EBPO_LEAF
                             ? ebpo_chunks_check_node(chunks, node, error)
                             : check_type(chunks, node, EBPO_GRAY, "planes", error);
    if (status != EBPO_OK)
        return status;
    int level = node->cell.level;
    plane_list list = planes_of(chunks, node);
    if (!(chunks->file->info.parts & list.part))
        return EBPO_OK;
    status = node->type == EBPO_LEAF
                 ? ebpo_ranks_leaf_planes(chunks, level, node->rank, &first, error)
                 : ebpo_ranks_planes(chunks, level, node->rank, &first, error);
    if (status == EBPO_OK)
        status = ebpo_chunks_integers(chunks, list.counts, level, node->rank, 1, &plane_count,
                                      sizeof plane_count, error);
    if (status == EBPO_OK && plane_count)
        status = read_codes(chunks, &list, level, first, plane_count, codes, error);
    *count = status == EBPO_OK ? plane_count : 0;
    return status;
}

ebpo_status ebpo_chunks_winding(ebpo_chunks *chunks, const ebpo_node *node, int32_t *winding,
                                ebpo_error *error)
{
    static const ebpo_array_id arrays[] = { EBPO_A_WHITE_WINDING, EBPO_A_BLACK_WINDING,
                                            EBPO_A_LEAF_WINDING };
    const ebpo_info *info = &chunks->file->info;
    *winding = node->type == EBPO_BLACK;
    ebpo_status status = ebpo_chunks_check_node(chunks, node, error);
    if (status != EBPO_OK)
        return status;
    if (!info->solid && !(info->parts & EBPO_PART_BORDER))
        return ebpo_fail_file(error, EBPO_E_NOT_SOLID, chunks->file->in.shown,
                              "the model is a surface and has no winding numbers; repair the "
                              "mesh and build again");
    if (node->type == EBPO_GRAY)
        return ebpo_fail_file(error, EBPO_E_ARGUMENT, chunks->file->in.shown,
                              "a gray node has no winding number; query its children");
    ebpo_array_id id = arrays[node->type];
    if (!ebpo_reader_array(chunks->file, id, node->cell.level)->present)
        return EBPO_OK; /* the array is absent: every number has the default value */
    status = ebpo_chunks_integers(chunks, id, node->cell.level, node->rank, 1, winding,
                                  sizeof *winding, error);
    if (status == EBPO_OK && info->solid && node->type != EBPO_LEAF &&
        ebpo_rule_inside(info->rule, *winding) != (node->type == EBPO_BLACK))
        status = ebpo_chunks_fail(chunks, node->cell.level, id,
                                  "a node's winding number contradicts its type", error);
    if (status == EBPO_OK && (*winding <= -EBPO_ENTRY_ZERO || *winding >= EBPO_ENTRY_ZERO))
        status = ebpo_fail_file(error, EBPO_E_LIMIT, chunks->file->in.shown,
                                "the winding number of a node is beyond 2^29: the solid has too "
                                "many shells");
    return status;
}

ebpo_status ebpo_chunks_leaf_empty(ebpo_chunks *chunks, const ebpo_node *leaf, bool *empty,
                                   ebpo_error *error)
{
    static const ebpo_array_id arrays[] = { EBPO_A_LEAF_NEW, EBPO_A_LEAF_REF_COUNT };
    const ebpo_info *info = &chunks->file->info;
    ebpo_status status = ebpo_chunks_check_node(chunks, leaf, error);
    *empty = info->border_inside && info->parts & EBPO_PART_MESH;
    for (int i = 0; i < 2 && status == EBPO_OK && *empty; i++) {
        uint32_t count = 0;
        status = ebpo_chunks_integers(chunks, arrays[i], leaf->cell.level, leaf->rank, 1, &count,
                                      sizeof count, error);
        *empty = count == 0;
    }
    return status;
}

ebpo_status ebpo_chunks_root(ebpo_chunks *chunks, ebpo_node *root, ebpo_error *error)
{
    uint16_t types = 0;
    ebpo_status status =
        ebpo_chunks_integers(chunks, EBPO_A_TYPES, 0, 0, 1, &types, sizeof types, error);
    *root = (ebpo_node){ .type = ebpo_group_type(types, 0) };
    return status;
}

static ebpo_status source_children(void *holder, ebpo_node *gray, ebpo_node child[8],
                                   ebpo_error *error)
{
    ebpo_chunks *chunks = holder;
    uint16_t types;
    uint64_t ranks[4];
    ebpo_status status = ebpo_chunks_children(chunks, gray, &types, ranks, error);
    if (status != EBPO_OK)
        return status;
    gray->pruned = chunks->file->info.pruned && types == 0;
    for (unsigned octant = 0; octant < 8; octant++)
        child[octant] = ebpo_node_child(gray, octant, types, ranks);
    return EBPO_OK;
}

static ebpo_status source_planes(void *holder, const ebpo_node *node,
                                 uint32_t codes[EBPO_NODE_PLANES], unsigned *count,
                                 ebpo_error *error)
{
    *count = 0;
    return ebpo_node_is_uniform(node) ? EBPO_OK
                                      : ebpo_chunks_planes(holder, node, codes, count, error);
}

static ebpo_status source_winding(void *holder, const ebpo_node *uniform, int32_t *out,
                                  ebpo_error *error)
{
    return ebpo_chunks_winding(holder, uniform, out, error);
}

const ebpo_node_source ebpo_chunks_source = { source_children, source_planes, source_winding };

/* Returns the index of the first item of the block that contains `item`. A block is EBPO_INDEX_ROWS
 * consecutive items. An index array has one row of sums for each block. */
static uint64_t block_of(uint64_t item) { return item / EBPO_INDEX_ROWS * EBPO_INDEX_ROWS; }

/* Reads the types and ranks of a group, and counts its nodes by type. */
static ebpo_status read_types(ebpo_chunks *chunks, int level, uint64_t group, ebpo_group *out,
                              uint64_t counts[4], ebpo_error *error)
{
    ebpo_status status = ebpo_ranks_before(chunks, level, group, out->rank, error);
    if (status == EBPO_OK)
        status = ebpo_chunks_integers(chunks, EBPO_A_TYPES, level, group, 1, &out->types,
                                      sizeof out->types, error);
    if (status != EBPO_OK)
        return status;
    if (level && !ebpo_group_lists_faces(out->types) && (out->types || !chunks->file->info.pruned))
        return ebpo_chunks_fail(chunks, level, EBPO_A_TYPES,
                                "a gray node has no child that is gray or a leaf", error);
    ebpo_groups_count(&out->types, 1, counts);
    if (level == 0)
        counts[EBPO_WHITE] =
            ebpo_group_type(out->types, 0) == EBPO_WHITE; /* level 0 has no octants 1 to 7 */
    return ebpo_ranks_check(chunks, level, out->rank, counts, error);
}

/* --- planes --- */

/* Appends the plane codes of the group's nodes of one type to out->codes. `first`: position of the
 * first of these codes in the level. `all`: number of planes in the level. `counts`: [nodes] number
 * of planes of each of these nodes. */
static ebpo_status read_group_codes(ebpo_chunks *chunks, ebpo_array_id id, int level,
                                    uint64_t first, uint64_t all, const uint8_t *counts,
                                    uint64_t nodes, ebpo_group *out, ebpo_node_type type,
                                    ebpo_error *error)
{
    uint32_t codes[EBPO_GROUP_CODES];
    uint64_t sum = 0;
    for (uint64_t i = 0; i < nodes; i++)
        sum += counts[i];
    if (first > all || sum > all - first)
        return ebpo_chunks_fail(chunks, level, id,
                                "the counts do not add up to the number of planes", error);
    ebpo_status status =
        sum ? ebpo_chunks_integers(chunks, id, level, first, sum, codes, sizeof *codes, error)
            : EBPO_OK;
    for (uint64_t i = 0; i < sum && status == EBPO_OK; i++) {
        int32_t n[3], d;
        if (!ebpo_plane_code_decode(codes[i], n, &d))
            status = ebpo_chunks_fail(chunks, level, id, "invalid plane code", error);
    }
    for (unsigned octant = 0, i = 0; octant < 8 && status == EBPO_OK; octant++)
        if (ebpo_group_type(out->types, octant) == type && (level || octant == 0))
            out->plane_count[octant] = counts[i++];
    if (status == EBPO_OK)
        memcpy(out->codes + out->code_count, codes, sum * sizeof *codes);
    out->code_count += status == EBPO_OK ? (unsigned)sum : 0;
    return status;
}

/* Reads the planes of the group's gray nodes. `count`: number of these nodes. */
static ebpo_status read_gray_planes(ebpo_chunks *chunks, int level, uint64_t count, ebpo_group *out,
                                    ebpo_error *error)
{
    uint64_t first, rank = out->rank[EBPO_GRAY];
    uint8_t counts[8];
    if (!(chunks->file->info.parts & EBPO_PART_PLANES) || count == 0)
        return EBPO_OK;
    ebpo_status status = ebpo_ranks_planes(chunks, level, rank, &first, error);
    if (status == EBPO_OK)
        status = ebpo_chunks_integers(chunks, EBPO_A_PLANE_COUNTS, level, rank, count, counts,
                                      sizeof *counts, error);
    if (status != EBPO_OK)
        return status;
    return read_group_codes(chunks, EBPO_A_PLANES, level, first,
                            chunks->file->info.level[level].plane_count, counts, count, out,
                            EBPO_GRAY, error);
}

/* Reads the stored planes of the group's leaves. `count`: number of these leaves. */
static ebpo_status read_leaf_planes(ebpo_chunks *chunks, int level, uint64_t count, ebpo_group *out,
                                    ebpo_error *error)
{
    uint64_t first, rank = out->rank[EBPO_LEAF];
    uint8_t counts[8];
    if (!(chunks->file->info.parts & EBPO_PART_LEAF_PLANES) || count == 0)
        return EBPO_OK;
    ebpo_status status = ebpo_ranks_leaf_planes(chunks, level, rank, &first, error);
    if (status == EBPO_OK)
        status = ebpo_chunks_integers(chunks, EBPO_A_LEAF_PLANE_COUNTS, level, rank, count, counts,
                                      sizeof *counts, error);
    if (status != EBPO_OK)
        return status;
    return read_group_codes(chunks, EBPO_A_LEAF_PLANES, level, first,
                            chunks->file->info.level[level].leaf_plane_count, counts, count, out,
                            EBPO_LEAF, error);
}

/* Sorts the plane codes by octant. In the input, the codes of gray nodes (`gray_codes` codes)
 * precede the codes of leaves. */
static void sort_codes(ebpo_group *group, unsigned gray_codes)
{
    uint32_t sorted[EBPO_GROUP_CODES];
    unsigned at = 0, next[4] = { [EBPO_GRAY] = 0, [EBPO_LEAF] = gray_codes };
    for (unsigned octant = 0; octant < 8; octant++) {
        unsigned count = group->plane_count[octant],
                 *from = &next[ebpo_group_type(group->types, octant)];
        memcpy(sorted + at, group->codes + *from, count * sizeof *sorted);
        *from += count;
        at += count;
    }
    memcpy(group->codes, sorted, at * sizeof *sorted);
}

/* --- winding numbers --- */

static const ebpo_array_id windings[3] = { EBPO_A_WHITE_WINDING, EBPO_A_BLACK_WINDING,
                                           EBPO_A_LEAF_WINDING };

static ebpo_status read_windings(ebpo_chunks *chunks, int level, const uint64_t counts[4],
                                 ebpo_group *out, ebpo_error *error)
{
    const ebpo_info *info = &chunks->file->info;
    int32_t of_type[3][8];
    ebpo_status status = EBPO_OK;
    for (unsigned type = 0; type < 3 && status == EBPO_OK; type++) {
        for (unsigned i = 0; i < 8; i++)
            of_type[type][i] = type == EBPO_BLACK;
        if (counts[type] && info->solid &&
            ebpo_reader_array(chunks->file, windings[type], level)->present)
            status = ebpo_chunks_integers(chunks, windings[type], level, out->rank[type],
                                          counts[type], of_type[type], sizeof **of_type, error);
        for (uint64_t i = 0;
             i < counts[type] && status == EBPO_OK && info->solid && type != EBPO_LEAF; i++)
            if (ebpo_rule_inside(info->rule, of_type[type][i]) != (type == EBPO_BLACK))
                status = ebpo_chunks_fail(chunks, level, windings[type],
                                          "a node's winding number contradicts its type", error);
    }
    unsigned next[3] = { 0, 0, 0 };
    for (unsigned octant = 0; octant < ebpo_group_octants(level) && status == EBPO_OK; octant++) {
        unsigned type = ebpo_group_type(out->types, octant);
        out->winding[octant] = type == EBPO_GRAY ? 0 : of_type[type][next[type]++];
    }
    return status;
}

ebpo_status ebpo_group_read(ebpo_chunks *chunks, int level, uint64_t group, unsigned wanted,
                            ebpo_group *out, ebpo_error *error)
{
    uint64_t counts[4];
    memset(out->plane_count, 0, sizeof out->plane_count);
    memset(out->winding, 0, sizeof out->winding);
    out->code_count = 0;
    ebpo_status status = read_types(chunks, level, group, out, counts, error);
    if (status == EBPO_OK && wanted & EBPO_GROUP_PLANES) {
        status = read_gray_planes(chunks, level, counts[EBPO_GRAY], out, error);
        unsigned gray_codes = out->code_count;
        if (status == EBPO_OK)
            status = read_leaf_planes(chunks, level, counts[EBPO_LEAF], out, error);
        if (status == EBPO_OK && gray_codes && out->code_count > gray_codes)
            sort_codes(out, gray_codes);
    }
    return status == EBPO_OK && wanted & EBPO_GROUP_WINDINGS
               ? read_windings(chunks, level, counts, out, error)
               : status;
}

/* --- chunks of a group that are not in memory --- */

/* The array `counts` has a count for each item of the level, such as the number of planes of each
 * node. Adds to `keys` the missing chunks that are needed to read the counts of the items [item,
 * item + items), and to sum all counts before `item`. The last row of the array `index` (or of the
 * table of subtrees) before `item` has a part of this sum. The counts after this row give the
 * remaining part. Returns true if chunks are missing. */
static bool missing_counted(ebpo_chunks *chunks, ebpo_array_id index, ebpo_array_id counts,
                            int level, uint64_t item, uint64_t items, ebpo_chunk_keys *keys)
{
    uint64_t first;
    if (ebpo_subtree_table_has(chunks->file, level))
        return ebpo_subtree_table_missing(chunks, level, ebpo_schema[counts].per, item, keys,
                                          &first) ||
               ebpo_chunks_missing(chunks, counts, level, first, item - first + items, keys);
    bool missing = item >= EBPO_INDEX_ROWS &&
                   ebpo_chunks_missing(chunks, index, level, item / EBPO_INDEX_ROWS, 1, keys);
    return ebpo_chunks_missing(chunks, counts, level, block_of(item), item - block_of(item) + items,
                               keys) ||
           missing;
}

/* Adds to `keys` the missing chunks of the plane codes of `count` nodes from rank `rank` on.
 * `first`: position of the first code. Returns true if chunks are missing. */
static bool missing_codes(ebpo_chunks *chunks, ebpo_array_id counts, ebpo_array_id codes, int level,
                          uint64_t rank, uint64_t count, uint64_t first, ebpo_chunk_keys *keys)
{
    uint8_t plane_counts[8];
    uint64_t sum = 0;
    if (ebpo_chunks_integers(chunks, counts, level, rank, count, plane_counts, sizeof *plane_counts,
                             NULL) != EBPO_OK)
        return false;
    for (uint64_t i = 0; i < count; i++)
        sum += plane_counts[i];
    return ebpo_chunks_missing(chunks, codes, level, first, sum, keys);
}

/* Returns the number of chunks of an array; 0 if the array is absent. */
static uint64_t chunks_of(const ebpo_array_in *array)
{
    return array->present ? ebpo_shape_chunks(&array->shape) : 0;
}

/* Adds to `keys` the missing chunks of the level's arrays with a single chunk, because every group
 * of the level needs these chunks. Returns their stored bytes. */
static uint64_t add_small(ebpo_chunks *chunks, int level, unsigned wanted, ebpo_chunk_keys *keys)
{
    static const struct {
        ebpo_array_id id;
        unsigned wanted;
    } arrays[] = {
        { EBPO_A_TYPES, ~0u }, /* always */
        { EBPO_A_PLANE_COUNTS, EBPO_GROUP_PLANES },
        { EBPO_A_PLANES, EBPO_GROUP_PLANES },
        { EBPO_A_LEAF_WINDING, EBPO_GROUP_WINDINGS },
        { EBPO_A_BLACK_WINDING, EBPO_GROUP_WINDINGS },
        { EBPO_A_WHITE_WINDING, EBPO_GROUP_WINDINGS },
        { EBPO_A_LEAF_PLANE_COUNTS, EBPO_GROUP_PLANES },
        { EBPO_A_LEAF_PLANES, EBPO_GROUP_PLANES },
    };
    uint64_t bytes = 0;
    for (size_t i = 0; i < sizeof arrays / sizeof *arrays; i++) {
        const ebpo_array_in *array = ebpo_reader_array(chunks->file, arrays[i].id, level);
        if (!(arrays[i].wanted & wanted) && arrays[i].wanted != ~0u)
            continue;
        if (chunks_of(array) == 1 && ebpo_chunks_missing(chunks, arrays[i].id, level, 0, 1, keys))
            bytes += array->chunks[0].bytes;
    }
    return bytes;
}

/* Adds to `keys` the missing chunks that the group needs next; returns false when there are none.
 * Reads only chunks that are in memory, so several calls with reads between them are necessary
 * (STAGES). Ignores errors, which the later read reports. */
static bool group_is_missing(ebpo_chunks *chunks, const ebpo_group_number *number, unsigned wanted,
                             ebpo_chunk_keys *keys)
{
    uint32_t parts = chunks->file->info.parts;
    int level = number->level;
    uint64_t counts[4], first;
    ebpo_group group;
    if (missing_counted(chunks, EBPO_A_TYPES_INDEX, EBPO_A_TYPES, level, number->group, 1, keys)) {
        (void)add_small(chunks, level, wanted, keys);
        return true;
    }
    if (read_types(chunks, level, number->group, &group, counts, NULL) != EBPO_OK)
        return false;
    bool gray = wanted & EBPO_GROUP_PLANES && parts & EBPO_PART_PLANES && counts[EBPO_GRAY];
    bool leaf = wanted & EBPO_GROUP_PLANES && parts & EBPO_PART_LEAF_PLANES && counts[EBPO_LEAF],
         missing = false;
    const uint64_t *rank = group.rank;
    if (gray)
        missing |= missing_counted(chunks, EBPO_A_GRAY_INDEX, EBPO_A_PLANE_COUNTS, level,
                                   rank[EBPO_GRAY], counts[EBPO_GRAY], keys);
    if (leaf)
        missing |= missing_counted(chunks, EBPO_A_LEAF_INDEX, EBPO_A_LEAF_PLANE_COUNTS, level,
                                   rank[EBPO_LEAF], counts[EBPO_LEAF], keys);
    for (unsigned type = 0; type < 3 && wanted & EBPO_GROUP_WINDINGS; type++)
        missing |=
            ebpo_chunks_missing(chunks, windings[type], level, rank[type], counts[type], keys);
    if (missing)
        return true;
    if (gray && ebpo_ranks_planes(chunks, level, rank[EBPO_GRAY], &first, NULL) == EBPO_OK)
        missing |= missing_codes(chunks, EBPO_A_PLANE_COUNTS, EBPO_A_PLANES, level, rank[EBPO_GRAY],
                                 counts[EBPO_GRAY], first, keys);
    if (leaf && ebpo_ranks_leaf_planes(chunks, level, rank[EBPO_LEAF], &first, NULL) == EBPO_OK)
        missing |= missing_codes(chunks, EBPO_A_LEAF_PLANE_COUNTS, EBPO_A_LEAF_PLANES, level,
                                 rank[EBPO_LEAF], counts[EBPO_LEAF], first, keys);
    return missing;
}

bool ebpo_group_is_far(ebpo_chunks *chunks, const ebpo_group_number *number, unsigned wanted)
{
    ebpo_chunk_keys keys;
    ebpo_chunk_keys_begin(&keys);
    return ebpo_input_prefetches(&chunks->file->in) &&
           group_is_missing(chunks, number, wanted, &keys);
}

ebpo_status ebpo_group_fetch(ebpo_chunks *chunks, const ebpo_group_number *groups, unsigned count,
                             unsigned wanted, ebpo_error *error)
{
    enum {
        /* The chunks of a stage locate the chunks of the next stage. The stages are: rows of the
         * table of subtrees; types; counts of planes; planes. */
        STAGES = 4,
        /* Small arrays of the next levels are fetched with level 0, up to about this size. */
        FIRST_BYTES = 32 << 10
    };
    ebpo_status status = EBPO_OK;
    for (int stage = 0; stage < STAGES && status == EBPO_OK; stage++) {
        ebpo_chunk_keys keys;
        ebpo_chunk_keys_begin(&keys);
        if (!group_is_missing(chunks, &groups[0], wanted, &keys))
            break;
        unsigned of_first = keys.count; /* keys of the first group, which are needed now */
        uint64_t small = 0;
        for (int level = 1;
             groups[0].level == 0 && level < chunks->file->info.level_count && small < FIRST_BYTES;
             level++)
            small += add_small(chunks, level, wanted, &keys);
        for (unsigned i = 1; i < count; i++)
            (void)group_is_missing(chunks, &groups[i], wanted, &keys);
        status = ebpo_chunks_fetch(chunks, &keys, of_first, error);
    }
    return status;
}
