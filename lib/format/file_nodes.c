/* Nodes of a file: children, planes, winding number. */
#include <inttypes.h>
#include <string.h>

#include "core/error.h"
#include "format/chunks.h"
#include "format/file_nodes.h"
#include "format/subtree_index.h"
#include "geometry/plane_code.h"
#include "geometry/node_types.h"
#include "geometry/rule.h"

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
    const uint64_t all[4] = { s->white_count, s->black_count, s->leaf_count, s->gray_count };
    if (node->rank >= all[node->type])
        return ebpo_fail_file(error, EBPO_E_ARGUMENT, shown,
                              "level %d has %" PRIu64 " nodes of type %d; number %" PRIu64
                              " was asked for",
                              node->cell.level, all[node->type], (int)node->type, node->rank);
    return EBPO_OK;
}

static ebpo_status check_type(const ebpo_chunks *chunks, const ebpo_node *node, ebpo_node_type type,
                              const char *what, ebpo_error *error)
{
    if (node->type != type)
        return ebpo_fail_file(error, EBPO_E_ARGUMENT, chunks->file->in.shown,
                              "%s of a node of type %d are asked for; only gray nodes have them",
                              what, (int)node->type);
    return ebpo_chunks_check_node(chunks, node, error);
}

ebpo_status ebpo_chunks_children(ebpo_chunks *chunks, const ebpo_node *gray, uint16_t *types,
                                 uint64_t ranks[4], ebpo_error *error)
{
    uint64_t counts[4];
    ebpo_status status = check_type(chunks, gray, EBPO_GRAY, "children", error);
    if (status == EBPO_OK &&
        gray->cell.level + 1 ==
            chunks->file->info.level_count) { /* pruned: the head has been checked */
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

/* Where a node's planes stand: those that a gray node adds, or that are stored for a leaf. */
typedef struct plane_list {
    ebpo_array_id counts, codes;
    uint32_t part;
    uint64_t all; /* of the level */
} plane_list;

static plane_list planes_of(const ebpo_chunks *chunks, const ebpo_node *node)
{
    const ebpo_level_summary *s = &chunks->file->info.level[node->cell.level];
    return node->type == EBPO_LEAF ? (plane_list){ EBPO_A_LEAF_PLANE_COUNTS, EBPO_A_LEAF_PLANES,
                                                   EBPO_PART_LEAF_PLANES, s->leaf_plane_count }
                                   : (plane_list){ EBPO_A_PLANE_COUNTS, EBPO_A_PLANES,
                                                   EBPO_PART_PLANES, s->plane_count };
}

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
            status =
                ebpo_chunks_fail(chunks, level, list->codes, "a code stands for no plane", error);
    }
    return status;
}

ebpo_status ebpo_chunks_planes(ebpo_chunks *chunks, const ebpo_node *node,
                               uint32_t codes[EBPO_NODE_PLANES], unsigned *count, ebpo_error *error)
{
    uint64_t first = 0;
    uint8_t own = 0;
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
        status = ebpo_chunks_integers(chunks, list.counts, level, node->rank, 1, &own, sizeof own,
                                      error);
    if (status == EBPO_OK && own)
        status = read_codes(chunks, &list, level, first, own, codes, error);
    *count = status == EBPO_OK ? own : 0;
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
    if (!info->solid)
        return ebpo_fail_file(error, EBPO_E_NOT_SOLID, chunks->file->in.shown,
                              "winding numbers are asked for, and the model is a surface; mend the "
                              "mesh and build again");
    if (node->type == EBPO_GRAY)
        return ebpo_fail_file(error, EBPO_E_ARGUMENT, chunks->file->in.shown,
                              "the winding number of a gray node is asked for; ask its children");
    ebpo_array_id id = arrays[node->type];
    if (!ebpo_reader_array(chunks->file, id, node->cell.level)->present)
        return EBPO_OK; /* the usual one; leaves always have the array */
    status = ebpo_chunks_integers(chunks, id, node->cell.level, node->rank, 1, winding,
                                  sizeof *winding, error);
    if (status == EBPO_OK && node->type != EBPO_LEAF &&
        ebpo_rule_inside(info->rule, *winding) != (node->type == EBPO_BLACK))
        status = ebpo_chunks_fail(chunks, node->cell.level, id,
                                  "a node's winding number contradicts its type", error);
    return status;
}

/* --- for cursors --- */

ebpo_status ebpo_chunks_root(ebpo_chunks *chunks, ebpo_node *root, ebpo_error *error)
{
    uint16_t types = 0;
    ebpo_status status =
        ebpo_chunks_integers(chunks, EBPO_A_TYPES, 0, 0, 1, &types, sizeof types, error);
    *root = (ebpo_node){ .type = ebpo_group_type(types, 0) };
    return status;
}

static ebpo_status source_children(void *holder, ebpo_node *gray, ebpo_node child[8], ebpo_error *error)
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

static ebpo_status source_planes(void *holder, const ebpo_node *node, uint32_t codes[EBPO_NODE_PLANES],
                          unsigned *count, ebpo_error *error)
{
    *count = 0;
    return ebpo_node_is_uniform(node) ? EBPO_OK
                                      : ebpo_chunks_planes(holder, node, codes, count, error);
}

static ebpo_status source_winding(void *holder, const ebpo_node *uniform, int32_t *out, ebpo_error *error)
{
    return ebpo_chunks_winding(holder, uniform, out, error);
}

const ebpo_node_source ebpo_chunks_source = { source_children, source_planes, source_winding };
