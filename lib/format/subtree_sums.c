#include "format/subtree_sums.h"

#include <stdlib.h>
#include <string.h>

#include "core/alloc.h"
#include "core/arrays.h"
#include "core/error.h"
#include "format/outer_blocks.h"
#include "geometry/node_types.h"

enum { USUAL_FACES = 1024, LEAST_FACES = 131072 };
/* A subtree's rows in all arrays are some tens of kilobytes. */
enum { SUBTREES_A_TIME = 128 };

int ebpo_subtree_level_for(const ebpo_info *info, uint64_t subtree_faces)
{
    uint64_t faces = subtree_faces ? subtree_faces : USUAL_FACES;
    if (subtree_faces == EBPO_NO_SUBTREES || (!subtree_faces && info->face_count < LEAST_FACES))
        return 0;
    /* at least these, where it was asked for */
    int found = subtree_faces && info->level_count > 2;
    for (int level = 1; level <= info->level_count - 2; level++) {
        uint64_t grays = info->level[level].gray_count;
        if (grays && info->face_count / grays >= faces)
            found = level;
    }
    return found;
}

void ebpo_subtree_sums_free(ebpo_subtree_sums *sums)
{
    free(sums->before);
    free(sums->counts);
    free(sums->index);
    free(sums->outer);
    memset(sums, 0, sizeof *sums);
}

typedef struct counting {
    ebpo_subtree_sums *sums;
    const ebpo_tree *tree;
    const ebpo_info *info;
} counting;

static uint64_t *row_of(const counting *c, uint64_t subtree)
{
    return c->sums->before + subtree * c->sums->cols;
}

static uint64_t level_sum(const counting *c, uint64_t subtree, int level, unsigned what)
{
    return row_of(c, subtree)[ebpo_subtree_column(c->info, level, what)];
}

static uint64_t first_group(const counting *c, uint64_t subtree, int level)
{
    return level == c->info->subtree_level + 1 ? subtree
                                               : level_sum(c, subtree, level - 1, EBPO_S_GRAY);
}

/* What the subtree's leaves of one level have, from rank `leaf` to `end`. */
static void count_leaves(const counting *c, const ebpo_level *level, uint64_t leaf, uint64_t end,
                         uint64_t *sum)
{
    if (c->info->parts & EBPO_PART_LEAF_PLANES)
        for (uint64_t i = leaf; i < end; i++)
            sum[EBPO_S_LEAF_PLANES] += level->leaf_plane_counts[i];
    if (!(c->info->parts & EBPO_PART_MESH) || leaf == end)
        return;
    for (uint64_t i = leaf; i < end; i++)
        sum[EBPO_S_REFS] += level->leaf_ref_count[i];
    sum[EBPO_S_ENDS] = level->leaf_first[end - 1] + level->leaf_new[end - 1];
}

/* The columns of one level, from those of the level before. */
static void count_level(const counting *c, int number)
{
    const ebpo_level *level = &c->tree->level[number];
    unsigned column = ebpo_subtree_column(c->info, number, 0);
    EBPO_FOR_ITEMS_EVERY(level->workspace, SUBTREES_A_TIME, i, 0, c->sums->subtrees) {
        const uint64_t *from = row_of(c, i) + column;
        uint64_t *sum = row_of(c, i + 1) + column, group = first_group(c, i, number), types[4];
        memcpy(sum, from, EBPO_SUBTREE_LEVEL_COLS * sizeof *sum);
        ebpo_groups_count(level->types + group, first_group(c, i + 1, number) - group, types);
        sum[EBPO_S_GRAY] += types[EBPO_GRAY];
        sum[EBPO_S_LEAF] += types[EBPO_LEAF];
        sum[EBPO_S_BLACK] += types[EBPO_BLACK];
        if (c->info->parts & EBPO_PART_PLANES)
            for (uint64_t k = from[EBPO_S_GRAY]; k < sum[EBPO_S_GRAY]; k++)
                sum[EBPO_S_PLANES] += level->plane_counts[k];
        count_leaves(c, level, from[EBPO_S_LEAF], sum[EBPO_S_LEAF], sum);
    }
}

/* New faces of the subtree, in [*first, *end): the leaves' are without gaps. */
static void own_faces(const counting *c, uint64_t subtree, uint64_t *first, uint64_t *end)
{
    *first = UINT64_MAX;
    *end = 0;
    for (int l = c->info->subtree_level + 1; l < c->info->level_count; l++) {
        uint64_t from = level_sum(c, subtree, l, EBPO_S_LEAF),
                 to = level_sum(c, subtree + 1, l, EBPO_S_LEAF);
        const ebpo_level *level = &c->tree->level[l];
        if (from == to)
            continue;
        uint64_t last = level->leaf_first[to - 1] + level->leaf_new[to - 1];
        *first = level->leaf_first[from] < *first ? level->leaf_first[from] : *first;
        *end = last > *end ? last : *end;
    }
}

static void count_faces(const counting *c)
{
    uint64_t at = 0, first, end;
    for (uint64_t i = 0; i < c->sums->subtrees; i++) {
        uint64_t *from = row_of(c, i), *to = row_of(c, i + 1);
        own_faces(c, i, &first, &end);
        first = end < at || first == UINT64_MAX ? at : first; /* without leaves */
        end = end < first ? first : end;
        to[EBPO_S_FACES_BEFORE] = from[EBPO_S_FACES_BEFORE] + first - at;
        to[EBPO_S_FACES] = from[EBPO_S_FACES] + end - first;
        at = end;
    }
}

/* First uses of vertices by faces [*face, end): *seen have been used before. */
static void see_vertices(const ebpo_mesh *mesh, uint64_t *face, uint64_t end, uint64_t *seen)
{
    EBPO_FOR_ITEMS(mesh->workspace, i, *face * 3, end * 3)
        *seen += mesh->faces[i] == *seen;
    *face = end;
}

static void count_vertices(const counting *c)
{
    uint64_t face = 0, seen = 0;
    for (uint64_t i = 0; i < c->sums->subtrees; i++) {
        uint64_t *from = row_of(c, i), *to = row_of(c, i + 1), begin = seen;
        see_vertices(&c->tree->mesh, &face, to[EBPO_S_FACES_BEFORE] + from[EBPO_S_FACES], &seen);
        to[EBPO_S_VERTICES_BEFORE] = from[EBPO_S_VERTICES_BEFORE] + seen - begin;
        begin = seen;
        see_vertices(&c->tree->mesh, &face, to[EBPO_S_FACES_BEFORE] + to[EBPO_S_FACES], &seen);
        to[EBPO_S_VERTICES] = from[EBPO_S_VERTICES] + seen - begin;
    }
}

static ebpo_status list_outer(const counting *c, ebpo_error *error)
{
    ebpo_outer_blocks blocks;
    ebpo_status status = ebpo_outer_blocks_make(&blocks, c->info, error);
    EBPO_FOR_ITEMS_EVERY(c->tree->mesh.workspace, SUBTREES_A_TIME, i, 0, c->sums->subtrees) {
        uint64_t *from = row_of(c, i), *to = row_of(c, i + 1);
        ebpo_outer_range own = {
            .face = to[EBPO_S_FACES_BEFORE] + from[EBPO_S_FACES],
            .face_end = to[EBPO_S_FACES_BEFORE] + to[EBPO_S_FACES],
            .vertex = to[EBPO_S_VERTICES_BEFORE] + from[EBPO_S_VERTICES],
        };
        if (status != EBPO_OK)
            break;
        for (int l = c->info->subtree_level + 1; l < c->info->level_count; l++) {
            uint64_t first = level_sum(c, i, l, EBPO_S_REFS),
                     end = level_sum(c, i + 1, l, EBPO_S_REFS);
            if (end > first) /* a level without any has no array */
                ebpo_outer_blocks_refer(&blocks, &c->tree->mesh, &own,
                                        c->tree->level[l].leaf_refs + first, end - first);
        }
        ebpo_outer_blocks_use(&blocks, &c->tree->mesh, &own);
        if (!ebpo_grow(&c->sums->outer, &c->sums->outer_capacity,
                       c->sums->outer_count + blocks.face_blocks + blocks.vertex_blocks +
                           1, /* never NULL */
                       sizeof *c->sums->outer))
            status = ebpo_fail_memory(error, c->sums->outer_count * sizeof *c->sums->outer);
        else
            ebpo_outer_blocks_take(&blocks, &own, c->sums->outer + c->sums->outer_count, from, to);
        c->sums->outer_count = to[EBPO_S_OUTER_FACES] + to[EBPO_S_OUTER_VERTICES];
    }
    ebpo_outer_blocks_free(&blocks);
    return status;
}

/* Differences, and every so many-th sum. False: a subtree has more than a count holds. */
static bool split_sums(const counting *c)
{
    ebpo_subtree_sums *s = c->sums;
    uint32_t rows = ebpo_subtree_rows(c->info);
    bool fits = true;
    for (uint64_t i = 0; i < s->subtrees; i++) {
        const uint64_t *from = row_of(c, i), *to = row_of(c, i + 1);
        if (i % rows == 0)
            memcpy(s->index + i / rows * s->cols, from, s->cols * sizeof *from);
        for (uint32_t k = 0; k < s->cols; k++) {
            fits &= to[k] - from[k] <= UINT32_MAX;
            s->counts[i * s->cols + k] = (uint32_t)(to[k] - from[k]);
        }
    }
    return fits;
}

ebpo_status ebpo_subtree_sums_make(ebpo_subtree_sums *out, const ebpo_tree *tree,
                                   const ebpo_info *info, ebpo_error *error)
{
    counting c = { out, tree, info };
    ebpo_status status = EBPO_OK;
    *out = (ebpo_subtree_sums){ .subtrees = info->level[info->subtree_level].gray_count,
                                .cols = ebpo_schema_cols(info, EBPO_A_SUBTREE_COUNTS) };
    out->before = ebpo_alloc_zero((out->subtrees + 1) * out->cols, sizeof *out->before);
    out->counts = ebpo_alloc(out->subtrees * out->cols, sizeof *out->counts);
    out->index =
        ebpo_alloc(ebpo_schema_rows(info, EBPO_A_SUBTREE_INDEX, 0) * out->cols, sizeof *out->index);
    if (!out->before || !out->counts || !out->index)
        return ebpo_fail_memory(error, out->subtrees * out->cols * 12);
    for (int level = info->subtree_level + 1; level < info->level_count; level++)
        count_level(&c, level);
    if (info->parts & EBPO_PART_MESH) {
        count_faces(&c);
        count_vertices(&c);
        status = list_outer(&c, error);
    }
    if (status == EBPO_OK && !split_sums(&c))
        status = ebpo_fail(error, EBPO_E_LIMIT,
                           "a subtree has more than 4,294,967,295 items of a kind; write the file "
                           "without subtrees");
    return status;
}

/* --- which subtree --- */

/* Rows of the array before subtree i. */
static uint64_t rows_before(const counting *c, ebpo_array_id id, int level, uint64_t i)
{
    const uint64_t *row = row_of(c, i), *next = i < c->sums->subtrees ? row_of(c, i + 1) : row;
    switch (ebpo_schema[id].per) {
    case EBPO_PER_GROUP: return first_group(c, i, level);
    case EBPO_PER_GRAY: return level_sum(c, i, level, EBPO_S_GRAY);
    case EBPO_PER_LEAF: return level_sum(c, i, level, EBPO_S_LEAF);
    case EBPO_PER_BLACK: return level_sum(c, i, level, EBPO_S_BLACK);
    case EBPO_PER_WHITE:
        return 8 * first_group(c, i, level) - level_sum(c, i, level, EBPO_S_GRAY) -
               level_sum(c, i, level, EBPO_S_LEAF) - level_sum(c, i, level, EBPO_S_BLACK);
    case EBPO_PER_PLANE: return level_sum(c, i, level, EBPO_S_PLANES);
    case EBPO_PER_LEAF_PLANE: return level_sum(c, i, level, EBPO_S_LEAF_PLANES);
    case EBPO_PER_REF: return level_sum(c, i, level, EBPO_S_REFS);
    case EBPO_PER_FACE: return next[EBPO_S_FACES_BEFORE] + row[EBPO_S_FACES];
    default: return next[EBPO_S_VERTICES_BEFORE] + row[EBPO_S_VERTICES];
    }
}

uint64_t ebpo_subtree_of_row(const ebpo_subtree_sums *sums, const ebpo_info *info, ebpo_array_id id,
                             int level, uint64_t row)
{
    counting c = { (ebpo_subtree_sums *)sums, NULL, info };
    uint64_t low = 0, high = sums->subtrees - 1;
    while (low < high) {
        uint64_t middle = low + (high - low + 1) / 2;
        if (rows_before(&c, id, level, middle) <= row)
            low = middle;
        else
            high = middle - 1;
    }
    return low;
}
