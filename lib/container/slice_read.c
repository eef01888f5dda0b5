/* Subtrees as one piece: a subtree is a contiguous range of every level's nodes.
 * format-spec/README.md, sections 4 and 5. */
#include "container/slice.h"

#include <stdlib.h>
#include <string.h>

#include "base/alloc.h"
#include "base/error.h"
#include "base/arrays.h"
#include "container/chunks.h"
#include "container/file_nodes.h"
#include "container/ranks.h"
#include "container/slice_faces.h"
#include "geom/plane_code.h"
#include "octree/node_types.h"
#include "octree/rule.h"

void ebpo_slice_free(ebpo_slice *slice)
{
    if (!slice)
        return;
    for (int i = 0; i < EBPO_LEVELS_MAX; i++)
        ebpo_level_free(&slice->level[i]);
    free(slice->outer);
    ebpo_mesh_free(&slice->mesh);
    ebpo_array_free(NULL, slice->face_source);
    memset(slice, 0, sizeof *slice);
}

/* A subtree's nodes in one level of the file: ranks by type. */
typedef struct range {
    int level;
    uint64_t rank[4], count[4];
} range;

static ebpo_status root_range(const ebpo_chunks *chunks, const ebpo_node *root, range *out,
                              ebpo_error *error)
{
    if (root->type != EBPO_GRAY && root->type != EBPO_LEAF)
        return ebpo_fail_file(error, EBPO_E_ARGUMENT, chunks->file->in.shown,
                              "the subtree of a white or black node is asked for; it has none");
    *out = (range){ .level = root->cell.level };
    out->rank[root->type] = root->rank;
    out->count[root->type] = 1;
    return ebpo_chunks_check_node(chunks, root, error);
}

/* Whether the range has a next level: the gray nodes of the last one are pruned. */
static bool goes_on(const ebpo_chunks *chunks, const range *r)
{
    return r->count[EBPO_GRAY] && r->level + 1 < chunks->file->info.level_count;
}

/* The next level's range. */
static ebpo_status next_range(ebpo_chunks *chunks, range *r, uint16_t **types, ebpo_error *error)
{
    uint64_t group = r->rank[EBPO_GRAY], groups = r->count[EBPO_GRAY];
    r->level++;
    ebpo_status status = ebpo_ranks_before(chunks, r->level, group, r->rank, error);
    if (status == EBPO_OK && types)
        status = ebpo_chunks_take(chunks, EBPO_A_TYPES, r->level, group, groups, sizeof **types,
                                  types, error);
    if (status == EBPO_OK && types)
        ebpo_groups_count(*types, groups, r->count);
    else if (status == EBPO_OK)
        status = ebpo_ranks_count_file(chunks, r->level, group, groups, r->count, error);
    return status == EBPO_OK ? ebpo_ranks_check(chunks, r->level, r->rank, r->count, error)
                             : status;
}

static ebpo_status read_planes(ebpo_chunks *chunks, const range *r, ebpo_level *out,
                               ebpo_error *error)
{
    uint64_t first, sum = 0;
    if (!(chunks->file->info.parts & EBPO_PART_PLANES) || out->gray_count == 0)
        return EBPO_OK;
    ebpo_status status = ebpo_ranks_planes(chunks, r->level, r->rank[EBPO_GRAY], &first, error);
    if (status == EBPO_OK)
        status = ebpo_chunks_take(chunks, EBPO_A_PLANE_COUNTS, r->level, r->rank[EBPO_GRAY],
                                  out->gray_count, 1, &out->plane_counts, error);
    if (status != EBPO_OK)
        return status;
    for (uint64_t i = 0; i < out->gray_count; i++)
        sum += out->plane_counts[i];
    if (sum > chunks->file->info.level[r->level].plane_count - first)
        return ebpo_chunks_fail(chunks, r->level, EBPO_A_PLANE_COUNTS,
                                "the counts do not add up to the number of planes", error);
    out->plane_count = sum;
    status = ebpo_chunks_take(chunks, EBPO_A_PLANES, r->level, first, sum, sizeof *out->planes,
                              &out->planes, error);
    for (uint64_t i = 0; i < sum && status == EBPO_OK; i++) {
        int32_t n[3], d;
        if (!ebpo_plane_code_decode(out->planes[i], n, &d))
            status = ebpo_chunks_fail(chunks, r->level, EBPO_A_PLANES, "a code stands for no plane",
                                      error);
    }
    return status;
}

static ebpo_status read_winding(ebpo_chunks *chunks, const range *r, ebpo_array_id id,
                                ebpo_node_type type, int32_t **out, ebpo_error *error)
{
    const ebpo_info *info = &chunks->file->info;
    if (!info->solid || !ebpo_reader_array(chunks->file, id, r->level)->present)
        return EBPO_OK;
    ebpo_status status = ebpo_chunks_take(chunks, id, r->level, r->rank[type], r->count[type],
                                          sizeof **out, out, error);
    for (uint64_t i = 0; i < r->count[type] && status == EBPO_OK && type != EBPO_LEAF; i++)
        if (ebpo_rule_inside(info->rule, (*out)[i]) != (type == EBPO_BLACK))
            status = ebpo_chunks_fail(chunks, r->level, id,
                                      "a node's winding number contradicts its type", error);
    return status;
}

/* Skips to first faces, from the end of the leaf before. */
static ebpo_status add_up_skips(ebpo_chunks *chunks, int number, uint64_t end, ebpo_level *out,
                                ebpo_error *error)
{
    uint64_t faces = chunks->file->info.face_count;
    for (uint64_t i = 0; i < out->leaf_count; i++) {
        uint64_t skip = out->leaf_first[i];
        if (skip > faces - end || out->leaf_new[i] > faces - end - skip)
            return ebpo_chunks_fail(chunks, number, EBPO_A_LEAF_SKIP,
                                    "a leaf's new faces lie beyond the last face", error);
        out->leaf_first[i] = end + skip;
        end += skip + out->leaf_new[i];
        out->new_count += out->leaf_new[i];
        out->ref_count += out->leaf_ref_count[i];
    }
    return EBPO_OK;
}

static ebpo_status read_refs(ebpo_chunks *chunks, int number, uint64_t first, ebpo_level *out,
                             ebpo_error *error)
{
    uint64_t at = 0;
    if (out->ref_count > chunks->file->info.level[number].ref_count - first)
        return ebpo_chunks_fail(chunks, number, EBPO_A_LEAF_REF_COUNT,
                                "the counts do not add up to the number of references", error);
    ebpo_status status = ebpo_chunks_take(chunks, EBPO_A_LEAF_REFS, number, first, out->ref_count,
                                          sizeof *out->leaf_refs, &out->leaf_refs, error);
    for (uint64_t i = 0; i < out->leaf_count && status == EBPO_OK; at += out->leaf_ref_count[i++])
        if (out->leaf_ref_count[i] &&
            !ebpo_refs_decode(out->leaf_refs + at, out->leaf_ref_count[i], out->leaf_first[i]))
            status = ebpo_chunks_fail(chunks, number, EBPO_A_LEAF_REFS,
                                      "a reference does not lead to a face before the leaf's own",
                                      error);
    return status;
}

static ebpo_status read_leaves(ebpo_chunks *chunks, const range *r, ebpo_level *out,
                               ebpo_error *error)
{
    uint64_t first = r->rank[EBPO_LEAF], count = out->leaf_count, end = 0, refs = 0;
    if (count == 0)
        return EBPO_OK;
    ebpo_status status = ebpo_ranks_leaf(chunks, r->level, first, &end, &refs, error);
    if (status == EBPO_OK)
        status = ebpo_chunks_take(chunks, EBPO_A_LEAF_SKIP, r->level, first, count,
                                  sizeof *out->leaf_first, &out->leaf_first, error);
    if (status == EBPO_OK)
        status = ebpo_chunks_take(chunks, EBPO_A_LEAF_NEW, r->level, first, count,
                                  sizeof *out->leaf_new, &out->leaf_new, error);
    if (status == EBPO_OK)
        status = ebpo_chunks_take(chunks, EBPO_A_LEAF_REF_COUNT, r->level, first, count,
                                  sizeof *out->leaf_ref_count, &out->leaf_ref_count, error);
    if (status == EBPO_OK)
        status = add_up_skips(chunks, r->level, end, out, error);
    return status == EBPO_OK ? read_refs(chunks, r->level, refs, out, error) : status;
}

/* What reading a level's nodes begins with, and the next level's types; only files far away care.
 */
static void expect_nodes(ebpo_chunks *chunks, const range *r)
{
    static const ebpo_array_id of_leaves[] = { EBPO_A_LEAF_SKIP, EBPO_A_LEAF_NEW,
                                               EBPO_A_LEAF_REF_COUNT };
    ebpo_expected e = EBPO_EXPECTED_INIT(chunks->file);
    uint64_t gray = r->rank[EBPO_GRAY], leaf = r->rank[EBPO_LEAF],
             gray_index = gray / EBPO_INDEX_ROWS, leaf_index = leaf / EBPO_INDEX_ROWS;
    uint64_t grays = r->count[EBPO_GRAY], leaves = r->count[EBPO_LEAF],
             counted = gray_index * EBPO_INDEX_ROWS;
    if (grays) {
        ebpo_chunks_expect(chunks, &e, EBPO_A_GRAY_INDEX, r->level, gray_index, 1);
        ebpo_chunks_expect(chunks, &e, EBPO_A_PLANE_COUNTS, r->level, counted,
                           gray + grays - counted);
    }
    if (goes_on(chunks, r)) {
        ebpo_chunks_expect(chunks, &e, EBPO_A_TYPES_INDEX, r->level + 1, gray_index, 1);
        ebpo_chunks_expect(chunks, &e, EBPO_A_TYPES, r->level + 1, counted, gray + grays - counted);
    }
    if (leaves) {
        counted = leaf_index * EBPO_INDEX_ROWS;
        ebpo_chunks_expect(chunks, &e, EBPO_A_LEAF_INDEX, r->level, leaf_index, 1);
        ebpo_chunks_expect(chunks, &e, EBPO_A_LEAF_WINDING, r->level, leaf, leaves);
        for (size_t i = 0; i < sizeof of_leaves / sizeof *of_leaves; i++)
            ebpo_chunks_expect(chunks, &e, of_leaves[i], r->level, counted,
                               leaf + leaves - counted);
    }
    ebpo_chunks_expect(chunks, &e, EBPO_A_BLACK_WINDING, r->level, r->rank[EBPO_BLACK],
                       r->count[EBPO_BLACK]);
    ebpo_chunks_expect(chunks, &e, EBPO_A_WHITE_WINDING, r->level, r->rank[EBPO_WHITE],
                       r->count[EBPO_WHITE]);
    ebpo_expect_all(&e);
}

/* Everything of one level but its types. */
static ebpo_status read_nodes(ebpo_chunks *chunks, const range *r, ebpo_level *out,
                              ebpo_error *error)
{
    expect_nodes(chunks, r);
    out->gray_count = r->count[EBPO_GRAY];
    out->leaf_count = r->count[EBPO_LEAF];
    out->white_count = r->count[EBPO_WHITE];
    out->black_count = r->count[EBPO_BLACK];
    ebpo_status status = read_planes(chunks, r, out, error);
    if (status == EBPO_OK)
        status = read_winding(chunks, r, EBPO_A_LEAF_WINDING, EBPO_LEAF, &out->leaf_winding, error);
    if (status == EBPO_OK)
        status =
            read_winding(chunks, r, EBPO_A_BLACK_WINDING, EBPO_BLACK, &out->black_winding, error);
    if (status == EBPO_OK)
        status =
            read_winding(chunks, r, EBPO_A_WHITE_WINDING, EBPO_WHITE, &out->white_winding, error);
    return status == EBPO_OK ? read_leaves(chunks, r, out, error) : status;
}

static ebpo_status read_levels(ebpo_slice *slice, ebpo_chunks *chunks, const ebpo_node *root,
                               ebpo_error *error)
{
    range r;
    ebpo_status status = root_range(chunks, root, &r, error);
    if (status != EBPO_OK)
        return status;
    slice->level[0].group_count = 1;
    slice->level[0].types = ebpo_alloc(1, sizeof(uint16_t));
    if (!slice->level[0].types)
        return ebpo_fail_memory(error, sizeof(uint16_t));
    slice->level[0].types[0] = (uint16_t)root->type;
    status = read_nodes(chunks, &r, &slice->level[0], error);
    for (slice->level_count = 1; status == EBPO_OK && goes_on(chunks, &r); slice->level_count++) {
        ebpo_level *out = &slice->level[slice->level_count];
        out->group_count = r.count[EBPO_GRAY];
        status = next_range(chunks, &r, &out->types, error);
        if (status == EBPO_OK)
            status = read_nodes(chunks, &r, out, error);
    }
    return status;
}

typedef struct walk {
    ebpo_chunks *chunks;
    ebpo_slice *slice;
    uint64_t group[EBPO_LEVELS_MAX], leaf[EBPO_LEVELS_MAX]; /* next of each level */
    bool begun;
} walk;

/* Leaves in depth-first order have the subtree's own faces as their new ones, without gaps: the
 * first leaf tells where they begin. */
static ebpo_status walk_group(walk *w, int level, ebpo_error *error)
{
    const ebpo_level *arrays = &w->slice->level[level];
    uint16_t types = arrays->types[w->group[level]++];
    for (unsigned octant = 0; octant < ebpo_group_octants(level); octant++) {
        ebpo_node_type type = ebpo_group_type(types, octant);
        if (type == EBPO_GRAY && level + 1 < w->slice->level_count) {
            ebpo_status status = walk_group(w, level + 1, error);
            if (status != EBPO_OK)
                return status;
        } else if (type == EBPO_LEAF) {
            uint64_t i = w->leaf[level]++;
            if (!w->begun)
                w->slice->first_face = arrays->leaf_first[i];
            w->begun = true;
            if (arrays->leaf_first[i] != w->slice->first_face + w->slice->face_count)
                return ebpo_chunks_fail(w->chunks, w->slice->root.cell.level + level,
                                        EBPO_A_LEAF_SKIP,
                                        "the leaves' new faces are not in depth-first order",
                                        error);
            w->slice->face_count += arrays->leaf_new[i];
        }
    }
    return EBPO_OK;
}

ebpo_status ebpo_slice_read(ebpo_slice *out, ebpo_chunks *chunks, const ebpo_node *root,
                            ebpo_error *error)
{
    memset(out, 0, sizeof *out);
    out->root = *root;
    out->pruned = chunks->file->info.pruned;
    if (!(chunks->file->info.parts & EBPO_PART_MESH))
        return ebpo_fail_file(error, EBPO_E_ABSENT, chunks->file->in.shown,
                              "the file was written without its mesh; build it again with it");
    walk w = { .chunks = chunks, .slice = out };
    ebpo_status status = read_levels(out, chunks, root, error);
    if (status == EBPO_OK)
        status = walk_group(&w, 0, error);
    if (status == EBPO_OK)
        status = ebpo_slice_take_faces(out, chunks, error);
    if (status != EBPO_OK)
        ebpo_slice_free(out);
    return status;
}

static ebpo_status measure_leaves(ebpo_chunks *chunks, const range *r, ebpo_slice_size *out,
                                  ebpo_error *error)
{
    uint64_t refs = 0, fresh = 0, first = r->rank[EBPO_LEAF], count = r->count[EBPO_LEAF];
    const ebpo_level_summary *s = &chunks->file->info.level[r->level];
    out->leaves += count;
    if (count == 0 || !(chunks->file->info.parts & EBPO_PART_MESH))
        return EBPO_OK;
    ebpo_status status =
        ebpo_chunks_sum(chunks, EBPO_A_LEAF_REF_COUNT, r->level, first, count, &refs, error);
    if (status == EBPO_OK)
        status = ebpo_chunks_sum(chunks, EBPO_A_LEAF_NEW, r->level, first, count, &fresh, error);
    if (status == EBPO_OK && (refs > s->ref_count || fresh > s->new_count))
        status = ebpo_chunks_fail(chunks, r->level, EBPO_A_LEAF_NEW,
                                  "the leaves' counts do not add up to those in the head", error);
    out->refs += refs;
    out->new_faces += fresh;
    return status;
}

ebpo_status ebpo_slice_measure(ebpo_chunks *chunks, const ebpo_node *root, ebpo_slice_size *out,
                               ebpo_error *error)
{
    range r;
    *out = (ebpo_slice_size){ .groups = 1 };
    ebpo_status status = root_range(chunks, root, &r, error);
    if (status == EBPO_OK)
        status = measure_leaves(chunks, &r, out, error);
    while (status == EBPO_OK && goes_on(chunks, &r)) {
        out->groups += r.count[EBPO_GRAY];
        status = next_range(chunks, &r, NULL, error);
        if (status == EBPO_OK)
            status = measure_leaves(chunks, &r, out, error);
    }
    out->outer = root->cell.level == 0 ? 0 : out->refs;
    return status;
}
