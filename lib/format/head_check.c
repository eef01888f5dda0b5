/* Whether the facts in a file's head can be true together: before anything is sized by them. */
#include <inttypes.h>
#include <math.h>

#include "core/error.h"
#include "format/head_facts.h"
#include "format/schema.h"
#include "geometry/cell.h"

static const uint64_t MESH_MAX = UINT32_MAX - 1, NODES_MAX = UINT64_C(1) << 40;

static const char *check_mesh_counts(const ebpo_info *info)
{
    if (info->face_count == 0 || info->face_count > MESH_MAX || info->vertex_count == 0 ||
        info->vertex_count > MESH_MAX)
        return "face_count or vertex_count is 0 or beyond 2^32 - 2";
    if (info->source_vertex_count > MESH_MAX || info->source_face_count > MESH_MAX ||
        info->mend.added_faces > MESH_MAX)
        return "a count of the source is beyond 2^32 - 2";
    if (info->mend.dropped_faces > info->source_face_count)
        return "more faces were dropped than the source has";
    if (info->vertex_count > info->source_vertex_count ||
        info->face_count >
            info->source_face_count + info->mend.added_faces - info->mend.dropped_faces)
        return "the mesh has more vertices or faces than its source and the mending account for";
    if (info->parts & EBPO_PART_MAPS && !(info->parts & EBPO_PART_MESH))
        return "there are maps but no mesh";
    if (info->parts & EBPO_PART_ATTRIBUTES && !(info->parts & EBPO_PART_MESH))
        return "there are attributes but no mesh";
    if (info->gates && !(info->parts & EBPO_PART_MESH))
        return "there is a coding of faces but no mesh";
    return NULL;
}

static const char *check_weld(const ebpo_mend_record *m)
{
    return m->weld_distance > 0 && !(m->weld && isfinite(m->weld_distance) && m->weld_moved >= 0 &&
                                     isfinite(m->weld_moved))
               ? "the record of welding within a distance has values that cannot be"
               : NULL;
}

static const char *check_box(const ebpo_info *info)
{
    ebpo_box box = { .grid_level = info->grid_level };
    for (int k = 0; k < 3; k++) {
        box.origin[k] = info->box_origin[k];
        box.size[k] = info->box_size[k];
    }
    if (info->grid_level > EBPO_MAX_LEVEL || info->max_level > info->grid_level ||
        info->level_count < 1 || info->level_count > info->max_level + 1)
        return "grid_level, max_level and level_count contradict each other";
    if (!ebpo_box_valid(&box))
        return "box_origin and box_size are not on a grid of exact doubles";
    if (!(info->epsilon >= 0 && isfinite(info->epsilon)))
        return "epsilon is negative or not a number";
    if (!(info->percent >= 0 && info->percent <= 100) ||
        !(info->k_root >= 0 && isfinite(info->k_root)))
        return "selection_percent or selection_k_root is out of range";
    return NULL;
}

static const char *check_level_counts(const ebpo_info *info, int level)
{
    const ebpo_level_summary *s = &info->level[level];
    uint64_t nodes = level ? 8 * ebpo_schema_groups(info, level) : 1;
    if (s->gray_count > NODES_MAX || s->leaf_count > NODES_MAX || s->white_count > NODES_MAX ||
        s->black_count > NODES_MAX)
        return "a level has too many nodes";
    if (s->gray_count + s->leaf_count + s->white_count + s->black_count != nodes)
        return "a level does not have eight nodes for each gray one above";
    bool last = level == info->level_count - 1;
    if (last ? s->gray_count && !info->pruned : s->gray_count == 0)
        return "the gray nodes do not end at the deepest level";
    if (info->pruned ? s->pruned_count > s->gray_count || (s->pruned_count == s->gray_count) < last
                     : s->pruned_count != 0)
        return "a level's pruned nodes are not some of its gray ones, or not all of them at the "
               "deepest level";
    if (!last && info->pruned &&
        (s->pruned_count == s->gray_count ||
         info->level[level + 1].white_count / 8 < s->pruned_count))
        return "a level has nothing but the places of pruned nodes' children, or not all of these";
    if (s->plane_count > (info->parts & EBPO_PART_PLANES ? 255 * s->gray_count : 0) ||
        s->leaf_plane_count > (info->parts & EBPO_PART_LEAF_PLANES ? 255 * s->leaf_count : 0))
        return "a level has more planes than its nodes can";
    if (!(info->parts & EBPO_PART_MESH) && (s->new_count || s->ref_count))
        return "a level counts faces, and there is no mesh";
    if (s->leaf_count == 0 && (s->new_count || s->ref_count))
        return "a level has faces but no leaf";
    if (s->black_count && !info->solid)
        return "a surface has black nodes";
    if (s->leaf_count && s->ref_count / s->leaf_count > info->face_count)
        return "a level refers to more faces than there are";
    return NULL;
}

ebpo_status ebpo_facts_check(const ebpo_info *info, const char *shown, ebpo_status as,
                             ebpo_error *error)
{
    const char *wrong = check_mesh_counts(info);
    if (!wrong)
        wrong = check_weld(&info->mend);
    if (!wrong)
        wrong = check_box(info);
    uint64_t faces = 0;
    int level = -1;
    while (!wrong && ++level < info->level_count) {
        wrong = check_level_counts(info, level);
        if (info->level[level].new_count > info->face_count - faces)
            wrong = "the levels have more new faces than there are";
        else
            faces += info->level[level].new_count;
    }
    if (!wrong && info->parts & EBPO_PART_MESH && faces != info->face_count)
        wrong = "the levels' new faces do not add up to face_count";
    if (!wrong)
        return EBPO_OK;
    return ebpo_fail_at(error, as, shown, level >= 0 ? "/levels" : "/", -1, "%s; %s", wrong,
                        as == EBPO_E_FORMAT ? "get a fresh copy of the file"
                                            : "the tree was not written");
}
