/* Subtrees as one piece: a subtree is a contiguous range of every level's nodes.
 * format-spec/README.md, sections 4 and 5. */
#include "format/slice.h"

#include <stdlib.h>
#include <string.h>

#include "core/alloc.h"
#include "core/error.h"
#include "core/arrays.h"
#include "format/chunks.h"
#include "format/file_nodes.h"
#include "format/pick_rows.h"
#include "format/subtree_index.h"
#include "format/slice_faces.h"
#include "geometry/node_types.h"

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

/* A subtree's nodes in one level of the file. */
typedef struct range {
    int level;
    ebpo_run run;
} range;

static ebpo_status root_range(const ebpo_chunks *chunks, const ebpo_node *root, range *out,
                              ebpo_error *error)
{
    if (root->type != EBPO_GRAY && root->type != EBPO_LEAF)
        return ebpo_fail_file(error, EBPO_E_ARGUMENT, chunks->file->in.shown,
                              "the subtree of a white or black node is asked for; it has none");
    *out = (range){ .level = root->cell.level };
    out->run.rank[root->type] = root->rank;
    out->run.count[root->type] = 1;
    return ebpo_chunks_check_node(chunks, root, error);
}

/* Which of a subtree's nodes, and what of them (EBPO_NEEDS_...). */
typedef struct extent {
    uint32_t needs;
    int end;         /* one past the deepest level */
    bool faces;      /* that the leaves list will be read as well */
    ebpo_room *room; /* NULL: no limit */
} extent;

/* `levels` below the root's, or all. */
static extent extent_of(const ebpo_chunks *chunks, const ebpo_node *root, uint32_t needs,
                        int levels)
{
    int count = chunks->file->info.level_count, below = count - 1 - root->cell.level;
    return (extent){ needs & ebpo_schema_has(&chunks->file->info),
                     levels >= 0 && levels < below ? root->cell.level + levels + 1 : count, false,
                     NULL };
}

/* Whether the range has a next level: the gray nodes of the file's last one are pruned. */
static bool goes_on(const extent *e, const range *r)
{
    return r->run.count[EBPO_GRAY] && r->level + 1 < e->end;
}

/* The next level's range. */
static ebpo_status next_range(ebpo_chunks *chunks, range *r, uint16_t **types, ebpo_error *error)
{
    uint64_t group = r->run.rank[EBPO_GRAY], groups = r->run.count[EBPO_GRAY];
    r->level++;
    ebpo_status status = ebpo_ranks_before(chunks, r->level, group, r->run.rank, error);
    if (status == EBPO_OK && types)
        status = ebpo_chunks_take(chunks, EBPO_A_TYPES, r->level, group, groups, sizeof **types,
                                  types, error);
    if (status == EBPO_OK && types)
        ebpo_groups_count(*types, groups, r->run.count);
    else if (status == EBPO_OK)
        status = ebpo_ranks_count_file(chunks, r->level, group, groups, r->run.count, error);
    return status == EBPO_OK ? ebpo_ranks_check(chunks, r->level, r->run.rank, r->run.count, error)
                             : status;
}

/* What reading a level's nodes begins with, and the next level's types; only files far away care.
 */
static void expect_nodes(ebpo_chunks *chunks, const extent *x, const range *r)
{
    ebpo_expected e = EBPO_EXPECTED_INIT(chunks->file);
    uint64_t gray = r->run.rank[EBPO_GRAY], index = gray / EBPO_INDEX_ROWS,
             counted = index * EBPO_INDEX_ROWS;
    ebpo_runs_expect(chunks, &e, r->level, &r->run, 1, x->needs);
    if (goes_on(x, r) && ebpo_subtree_table_has(chunks->file, r->level + 1)) {
        ebpo_chunks_expect(chunks, &e, EBPO_A_TYPES, r->level + 1, gray, r->run.count[EBPO_GRAY]);
    } else if (goes_on(x, r)) {
        ebpo_chunks_expect(chunks, &e, EBPO_A_TYPES_INDEX, r->level + 1, index, 1);
        ebpo_chunks_expect(chunks, &e, EBPO_A_TYPES, r->level + 1, counted,
                           gray + r->run.count[EBPO_GRAY] - counted);
    }
    ebpo_expect_all(&e);
}

/* From the level of subtrees' roots on, all that is below is known. */
static void expect_below(ebpo_chunks *chunks, const extent *x, const range *r)
{
    uint64_t first = r->run.rank[EBPO_GRAY], count = r->run.count[EBPO_GRAY];
    ebpo_expected e = EBPO_EXPECTED_INIT(chunks->file);
    e.near = true;
    if (!ebpo_subtree_table_has(chunks->file, r->level + 1) || !goes_on(x, r) ||
        r->level != chunks->file->info.subtree_level || !ebpo_expected_wanted(&e))
        return;
    ebpo_subtree_table_expect_run(chunks, first, count);
    ebpo_subtrees_expect(chunks, &e, first, count, x->needs, x->end - 1, x->faces);
    ebpo_expect_all(&e);
}

/* Everything of one level but its types. */
static ebpo_status read_nodes(ebpo_chunks *chunks, const extent *x, const range *r, ebpo_level *out,
                              ebpo_error *error)
{
    expect_below(chunks, x, r);
    expect_nodes(chunks, x, r);
    return ebpo_runs_read(chunks, r->level, &r->run, 1, x->needs, x->room, out, error);
}

static ebpo_status read_levels(ebpo_slice *slice, ebpo_chunks *chunks, const extent *x,
                               ebpo_error *error)
{
    const ebpo_node *root = &slice->root;
    range r;
    ebpo_status status = root_range(chunks, root, &r, error);
    if (status != EBPO_OK)
        return status;
    slice->level[0].group_count = 1;
    slice->level[0].types = ebpo_alloc(1, sizeof(uint16_t));
    if (!slice->level[0].types)
        return ebpo_fail_memory(error, sizeof(uint16_t));
    slice->level[0].types[0] = (uint16_t)root->type;
    status = read_nodes(chunks, x, &r, &slice->level[0], error);
    for (slice->level_count = 1; status == EBPO_OK && goes_on(x, &r); slice->level_count++) {
        ebpo_level *out = &slice->level[slice->level_count];
        out->group_count = r.run.count[EBPO_GRAY];
        status = ebpo_room_take(x->room, out->group_count * sizeof *out->types, error);
        if (status == EBPO_OK)
            status = next_range(chunks, &r, &out->types, error);
        if (status == EBPO_OK)
            status = read_nodes(chunks, x, &r, out, error);
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

static bool is_subtree(const ebpo_chunks *chunks, const extent *x, const ebpo_node *root)
{
    const ebpo_info *info = &chunks->file->info;
    /* of fewer levels the table does not tell the faces */
    return info->subtree_level && root->cell.level == info->subtree_level &&
           root->type == EBPO_GRAY && x->end == info->level_count;
}

/* The leaves' faces are those that the table gives the subtree. */
static ebpo_status check_own_faces(const ebpo_slice *slice, ebpo_chunks *chunks, const extent *x,
                                   ebpo_error *error)
{
    ebpo_subtree_row row;
    if (!is_subtree(chunks, x, &slice->root))
        return EBPO_OK;
    ebpo_status status = ebpo_subtree_table_row(chunks, slice->root.rank, &row, error);
    if (status != EBPO_OK)
        return status;
    uint64_t has = row.after[EBPO_S_FACES] - row.before[EBPO_S_FACES];
    return has == slice->face_count && (has == 0 || row.face == slice->first_face)
               ? EBPO_OK
               : ebpo_chunks_fail(chunks, -1, EBPO_A_SUBTREE_COUNTS,
                                  "a row contradicts the faces of its subtree", error);
}

static ebpo_status read_extent(ebpo_slice *out, ebpo_chunks *chunks, const ebpo_node *root,
                               const extent *x, ebpo_error *error)
{
    memset(out, 0, sizeof *out);
    out->root = *root;
    out->pruned = chunks->file->info.pruned;
    ebpo_status status = read_levels(out, chunks, x, error);
    if (status != EBPO_OK)
        ebpo_slice_free(out);
    return status;
}

ebpo_status ebpo_slice_read_nodes(ebpo_slice *out, ebpo_chunks *chunks, const ebpo_node *root,
                                  uint32_t needs, int levels, ebpo_error *error)
{
    extent x = extent_of(chunks, root, needs, levels);
    return read_extent(out, chunks, root, &x, error);
}

ebpo_status ebpo_slice_read_parts(ebpo_slice *out, ebpo_chunks *chunks, const ebpo_node *root,
                                  uint32_t needs, ebpo_error *error)
{
    return ebpo_slice_read_within(out, chunks, root, needs, NULL, error);
}

ebpo_status ebpo_slice_read_within(ebpo_slice *out, ebpo_chunks *chunks, const ebpo_node *root,
                                   uint32_t needs, ebpo_room *room, ebpo_error *error)
{
    enum { ALWAYS = EBPO_NEEDS_ALWAYS | EBPO_NEEDS_MESH };
    extent x = extent_of(chunks, root, needs | ALWAYS, EBPO_SLICE_ALL);
    memset(out, 0, sizeof *out);
    if (!(chunks->file->info.parts & EBPO_PART_MESH))
        return ebpo_fail_file(error, EBPO_E_ABSENT, chunks->file->in.shown,
                              "the file was written without its mesh; build it again with it");
    walk w = { .chunks = chunks, .slice = out };
    x.faces = true;
    x.room = room;
    ebpo_status status = read_extent(out, chunks, root, &x, error);
    if (status == EBPO_OK)
        status = walk_group(&w, 0, error);
    if (status == EBPO_OK)
        status = check_own_faces(out, chunks, &x, error);
    if (status == EBPO_OK)
        status = ebpo_slice_take_faces(out, chunks, needs & EBPO_NEEDS_MAPS, room, error);
    if (status != EBPO_OK)
        ebpo_slice_free(out);
    return status;
}

ebpo_status ebpo_slice_read(ebpo_slice *out, ebpo_chunks *chunks, const ebpo_node *root,
                            ebpo_error *error)
{
    return ebpo_slice_read_parts(out, chunks, root, ~(uint32_t)EBPO_NEEDS_LEAF_PLANES, error);
}

static ebpo_status measure_faces(ebpo_chunks *chunks, const range *r, ebpo_slice_size *out,
                                 ebpo_error *error)
{
    uint64_t refs = 0, fresh = 0, first = r->run.rank[EBPO_LEAF], count = r->run.count[EBPO_LEAF];
    const ebpo_level_summary *s = &chunks->file->info.level[r->level];
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

static ebpo_status measure_planes(ebpo_chunks *chunks, const range *r, ebpo_node_type type,
                                  ebpo_slice_size *out, ebpo_error *error)
{
    ebpo_array_id id = type == EBPO_LEAF ? EBPO_A_LEAF_PLANE_COUNTS : EBPO_A_PLANE_COUNTS;
    uint64_t sum = 0, count = r->run.count[type];
    ebpo_status status =
        count ? ebpo_chunks_sum(chunks, id, r->level, r->run.rank[type], count, &sum, error)
              : EBPO_OK;
    out->planes += sum;
    return status;
}

static ebpo_status measure_nodes(ebpo_chunks *chunks, const extent *x, const range *r,
                                 ebpo_slice_size *out, ebpo_error *error)
{
    ebpo_status status = EBPO_OK;
    out->leaves += r->run.count[EBPO_LEAF];
    if (x->needs & EBPO_NEEDS_MESH && r->run.count[EBPO_LEAF])
        status = measure_faces(chunks, r, out, error);
    if (status == EBPO_OK && x->needs & EBPO_NEEDS_PLANES)
        status = measure_planes(chunks, r, EBPO_GRAY, out, error);
    if (status == EBPO_OK && x->needs & EBPO_NEEDS_LEAF_PLANES)
        status = measure_planes(chunks, r, EBPO_LEAF, out, error);
    return status;
}

/* What the table says of a subtree, but for its root. */
static ebpo_status measure_subtree(ebpo_chunks *chunks, const extent *x, uint64_t subtree,
                                   ebpo_slice_size *out, ebpo_error *error)
{
    const ebpo_info *info = &chunks->file->info;
    ebpo_subtree_row row;
    /* what reading it will want to know of the table comes with the same request */
    ebpo_subtree_table_expect_run(chunks, subtree, 1);
    ebpo_status status = ebpo_subtree_table_row(chunks, subtree, &row, error);
    for (int level = info->subtree_level + 1; level < x->end && status == EBPO_OK; level++) {
        uint64_t has[EBPO_SUBTREE_LEVEL_COLS];
        for (unsigned k = 0; k < EBPO_SUBTREE_LEVEL_COLS; k++)
            has[k] = row.after[ebpo_subtree_column(info, level, k)] -
                     row.before[ebpo_subtree_column(info, level, k)];
        out->groups += ebpo_subtree_groups(info, &row, level, true) -
                       ebpo_subtree_groups(info, &row, level, false);
        out->leaves += has[EBPO_S_LEAF];
        out->refs += x->needs & EBPO_NEEDS_MESH ? has[EBPO_S_REFS] : 0;
        out->planes += (x->needs & EBPO_NEEDS_PLANES ? has[EBPO_S_PLANES] : 0) +
                       (x->needs & EBPO_NEEDS_LEAF_PLANES ? has[EBPO_S_LEAF_PLANES] : 0);
    }
    if (status == EBPO_OK && x->needs & EBPO_NEEDS_MESH)
        out->new_faces += row.after[EBPO_S_FACES] - row.before[EBPO_S_FACES];
    return status;
}

ebpo_status ebpo_slice_measure_nodes(ebpo_chunks *chunks, const ebpo_node *root, uint32_t needs,
                                     int levels, ebpo_slice_size *out, ebpo_error *error)
{
    range r;
    extent x = extent_of(chunks, root, needs, levels);
    *out = (ebpo_slice_size){ .groups = 1 };
    ebpo_status status = root_range(chunks, root, &r, error);
    if (status == EBPO_OK)
        status = measure_nodes(chunks, &x, &r, out, error);
    if (status == EBPO_OK && is_subtree(chunks, &x, root)) {
        status = measure_subtree(chunks, &x, root->rank, out, error);
        out->outer = out->refs;
        return status;
    }
    while (status == EBPO_OK && goes_on(&x, &r)) {
        out->groups += r.run.count[EBPO_GRAY];
        status = next_range(chunks, &r, NULL, error);
        if (status == EBPO_OK)
            status = measure_nodes(chunks, &x, &r, out, error);
    }
    out->outer = root->cell.level == 0 ? 0 : out->refs;
    return status;
}

ebpo_status ebpo_slice_measure(ebpo_chunks *chunks, const ebpo_node *root, ebpo_slice_size *out,
                               ebpo_error *error)
{
    return ebpo_slice_measure_nodes(chunks, root, EBPO_NEEDS_MESH, EBPO_SLICE_ALL, out, error);
}
