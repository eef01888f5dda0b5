/* Nodes of a file: children, planes, winding number. */
#include <inttypes.h>
#include <string.h>

#include "base/error.h"
#include "container/slice_parts.h"
#include "geom/plane_code.h"
#include "octree/node_types.h"
#include "octree/rule.h"

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

ebpo_status ebpo_chunks_planes(ebpo_chunks *chunks, const ebpo_node *gray, uint32_t codes[255],
                               uint32_t *count, ebpo_error *error)
{
    uint64_t first, planes;
    uint8_t own;
    *count = 0;
    ebpo_status status = check_type(chunks, gray, EBPO_GRAY, "planes", error);
    if (status != EBPO_OK || !(chunks->file->info.parts & EBPO_PART_PLANES))
        return status;
    status = ebpo_ranks_planes(chunks, gray->cell.level, gray->rank, &first, error);
    if (status == EBPO_OK)
        status = ebpo_chunks_integers(chunks, EBPO_A_PLANE_COUNTS, gray->cell.level, gray->rank, 1,
                                      &own, sizeof own, error);
    if (status != EBPO_OK || own == 0)
        return status;
    planes = chunks->file->info.level[gray->cell.level].plane_count;
    if (own > planes - first)
        return ebpo_chunks_fail(chunks, gray->cell.level, EBPO_A_PLANE_COUNTS,
                                "the counts do not add up to the number of planes", error);
    status = ebpo_chunks_integers(chunks, EBPO_A_PLANES, gray->cell.level, first, own, codes,
                                  sizeof *codes, error);
    for (unsigned i = 0; i < own && status == EBPO_OK; i++) {
        int32_t n[3], d;
        if (!ebpo_plane_code_decode(codes[i], n, &d))
            status = ebpo_chunks_fail(chunks, gray->cell.level, EBPO_A_PLANES,
                                      "a code stands for no plane", error);
    }
    if (status == EBPO_OK)
        *count = own;
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
