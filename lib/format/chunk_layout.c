/* Computes the layout of a file's chunks, for the writer: the number of rows in the chunks of each
 * array, the order of chunks, and the chunks that each subtree needs. A subtree begins at a gray
 * node (a node with children) of a fixed level. Levels near the root are stored whole. Deep levels
 * are stored subtree by subtree, so that a reader finds the data of a subtree in few ranges of the
 * file. A subtree also uses chunks of faces and vertices that belong to earlier subtrees; these
 * shared chunks are listed in /subtrees/shared_chunks. /subtrees/counts contains the numbers of
 * items of each subtree. All computations use integers, so that the bytes of a file are the same on
 * every machine. Source: format-spec/subtrees.md. */
#include <stdlib.h>
#include <string.h>

#include <ebpo/file.h>

#include "core/alloc.h"
#include "core/workspace.h"
#include "core/error.h"
#include "core/wide.h"
#include "format/chunk_layout.h"
#include "format/schema.h"
#include "geometry/level_nodes.h"
#include "hdf5_read/chunk.h"

/* --- chunks of the mesh that a subtree shares with earlier subtrees --- */

/* A subtree's owned items: the faces [face, face_end), which no leaf before the subtree lists, and
 * the vertices from `vertex` on, which these faces use first. */
typedef struct owned_range {
    uint64_t face, face_end, vertex;
} owned_range;

/* State of listing the shared chunks of each subtree in turn. A block is a chunk of /mesh/faces or
 * /mesh/vertices. A round is the work on one subtree. */
typedef struct shared_blocks {
    uint32_t *face_round, *vertex_round; /* [blocks] last round in which a block was listed */
    uint32_t round;                      /* number of the current subtree, from 1 */
    uint32_t *face_block, *vertex_block; /* [blocks] blocks listed in this round */
    uint64_t face_blocks, vertex_blocks; /* numbers of listed blocks */
} shared_blocks;

enum {
    FIRST_LEVELS = 5,    /* levels 0 to 5 are always stored whole */
    LEAVES_OF_DEEP = 64, /* a deep level has at least one leaf for each 64 faces of the mesh */
    CHUNK_FACES = 16384, /* a chunk of a level has the nodes for about this number of faces */
    CHUNK_LEAST = 256,   /* minimum size of a chunk of a level, in bytes */
    CHUNK_MAX = 32768,   /* maximum size of a chunk of a level, in bytes */
    /* rows of a chunk of other arrays */
    MAP_ROWS = 2048,      /* /maps/vertex_source */
    SHARED_ROWS = 4096,   /* /subtrees/shared_chunks */
    ATTRIBUTE_ROWS = 2048 /* arrays of /attributes */
};

/* Returns the last level that is stored whole in a file with subtrees. */
static int last_whole_level(const ebpo_info *info)
{
    return info->subtree_level > FIRST_LEVELS ? info->subtree_level : FIRST_LEVELS;
}

/* Returns the first deep level. The chunks of all deep levels are sorted together, by subtree. The
 * chunks of the levels between the last whole level and the first deep level are sorted by level,
 * and within a level by subtree. */
static int first_deep_level(const ebpo_info *info)
{
    int level = last_whole_level(info) + 1;
    while (level < info->level_count &&
           info->level[level].leaf_count < info->face_count / LEAVES_OF_DEEP)
        level++;
    return level;
}

/* Let x be the average number of rows for CHUNK_FACES faces. Returns the power of two that is
 * nearest to x in ratio, which is the least power of two that is at least x / sqrt(2). Compares
 * squares of integers instead of roots, because the bytes of a file depend on the result. There are
 * at most 2^40 rows, so both sides are below 2^64 before squaring. */
static uint64_t rows_for_faces(const ebpo_info *info, uint64_t rows)
{
    uint64_t wanted = rows * CHUNK_FACES, power = 1;
    for (;; power *= 2) {
        uint64_t product = power * info->face_count;
        if (!ebpo_wide_less(ebpo_wide_left(ebpo_wide_product(product, product), 1),
                            ebpo_wide_product(wanted, wanted)))
            return power;
    }
}

/* Returns the number of rows in a chunk of an array in a file with subtrees. UINT64_MAX: as many
 * rows as a chunk can have. */
static uint64_t wanted_rows(const ebpo_info *info, ebpo_array_id id, int level, uint64_t rows,
                            uint32_t row_bytes)
{
    switch (id) {
    case EBPO_A_FACE_SOURCE:
    case EBPO_A_FACES: return EBPO_FACE_BLOCK;
    case EBPO_A_VERTICES: return EBPO_VERTEX_BLOCK;
    case EBPO_A_VERTEX_SOURCE: return MAP_ROWS;
    case EBPO_A_SUBTREE_COUNTS: return ebpo_subtree_rows(info);
    case EBPO_A_SUBTREE_SHARED: return SHARED_ROWS;
    case EBPO_A_ATTRIBUTE: return ATTRIBUTE_ROWS;
    default: break;
    }
    if (id >= EBPO_LEVEL_ARRAYS || level <= last_whole_level(info) || ebpo_schema_is_index(id))
        return UINT64_MAX;
    uint64_t chunk_rows = rows_for_faces(info, rows);
    while (chunk_rows * row_bytes < CHUNK_LEAST)
        chunk_rows *= 2;
    while (chunk_rows * row_bytes > CHUNK_MAX)
        chunk_rows /= 2;
    return chunk_rows;
}

uint32_t ebpo_rows_of_chunk(const ebpo_info *info, ebpo_array_id id, int level, uint64_t rows,
                            uint32_t cols, uint32_t element_size)
{
    uint32_t max_rows = ebpo_full_chunk_rows(rows, cols, element_size);
    if (!info->subtree_level)
        return max_rows;
    uint64_t wanted = wanted_rows(info, id, level, rows, element_size * (cols ? cols : 1));
    return wanted < max_rows ? (uint32_t)wanted : max_rows;
}

uint32_t ebpo_rows_of_foreign_chunk(const char *path, const ebpo_shape *stored, bool subtrees,
                                    bool kept)
{
    static const struct {
        const char *path; /* path of an array, or of a group (ends with "/") */
        uint32_t rows;
        bool fixed; /* the format fixes the number of rows */
    } known[] = {
        { "/mesh/faces", EBPO_FACE_BLOCK, true },
        { "/mesh/vertices", EBPO_VERTEX_BLOCK, true },
        { "/subtrees/counts", EBPO_SUBTREE_ROWS, true },
        { "/maps/vertex_source", MAP_ROWS, false },
        { "/maps/face_source", EBPO_FACE_BLOCK, false },
        { "/attributes/", ATTRIBUTE_ROWS, false },
    };
    uint32_t full = ebpo_full_chunk_rows(stored->rows, stored->cols, stored->element_size),
             rows = stored->chunk_rows;
    if (!subtrees)
        return full;
    if (rows == 0 || rows & (rows - 1) || rows > full)
        rows = full;
    for (size_t i = 0; i < sizeof known / sizeof known[0]; i++)
        if ((known[i].fixed || !kept) && strncmp(path, known[i].path, strlen(known[i].path)) == 0 &&
            (path[strlen(known[i].path)] == 0 || path[strlen(known[i].path) - 1] == '/'))
            rows = known[i].rows < full ? known[i].rows : full;
    return rows;
}

static ebpo_status shared_blocks_make(shared_blocks *out, const ebpo_info *info, ebpo_error *error)
{
    uint64_t faces = info->face_count / EBPO_FACE_BLOCK + 1,
             vertices = info->vertex_count / EBPO_VERTEX_BLOCK + 1;
    *out = (shared_blocks){ .round = 1 };
    out->face_round = ebpo_alloc_zero(faces, sizeof *out->face_round);
    out->vertex_round = ebpo_alloc_zero(vertices, sizeof *out->vertex_round);
    out->face_block = ebpo_alloc(faces, sizeof *out->face_block);
    out->vertex_block = ebpo_alloc(vertices, sizeof *out->vertex_block);
    if (!out->face_round || !out->vertex_round || !out->face_block || !out->vertex_block)
        return ebpo_fail_memory(error, (faces + vertices) * 8);
    return EBPO_OK;
}

static void shared_blocks_free(shared_blocks *blocks)
{
    free(blocks->face_round);
    free(blocks->vertex_round);
    free(blocks->face_block);
    free(blocks->vertex_block);
}

/* Lists a block in `blocks`. Does nothing if the block is already listed in this round. */
static void list_block(uint32_t *rounds, uint32_t round, uint64_t block, uint32_t *blocks,
                       uint64_t *count)
{
    if (rounds[block] == round)
        return;
    rounds[block] = round;
    blocks[(*count)++] = (uint32_t)block;
}

/* Lists the blocks of a face's shared vertices (vertices that earlier faces use first). */
static void use_face(shared_blocks *b, const ebpo_mesh *mesh, const owned_range *own, uint64_t face)
{
    for (int k = 0; k < 3; k++) {
        uint32_t vertex = mesh->faces[3 * face + (uint64_t)k];
        if (vertex < own->vertex)
            list_block(b->vertex_round, b->round, vertex / EBPO_VERTEX_BLOCK, b->vertex_block,
                       &b->vertex_blocks);
    }
}

/* References are faces that an earlier leaf lists. Lists the blocks of the shared faces among
 * `refs`, and the blocks of the shared vertices of these faces. */
static void shared_blocks_refer(shared_blocks *b, const ebpo_mesh *mesh, const owned_range *own,
                                const uint32_t *refs, uint64_t count)
{
    for (uint64_t i = 0; i < count; i++)
        if (refs[i] < own->face) {
            list_block(b->face_round, b->round, refs[i] / EBPO_FACE_BLOCK, b->face_block,
                       &b->face_blocks);
            use_face(b, mesh, own, refs[i]);
        }
}

/* Lists the blocks of the shared vertices of all owned faces. */
static void shared_blocks_use(shared_blocks *b, const ebpo_mesh *mesh, const owned_range *own)
{
    for (uint64_t face = own->face; face < own->face_end; face++)
        use_face(b, mesh, own, face);
}

static int compare_descending(const void *a, const void *b)
{
    uint32_t x = *(const uint32_t *)a, y = *(const uint32_t *)b;
    return (x < y) - (x > y);
}

/* Sorts the blocks in descending order. Writes the difference `from` - block for each block to
 * `out`. Omits blocks after `from`, which the subtree owns. Returns the number of values in `out`.
 */
static uint64_t sort_blocks(uint32_t *blocks, uint64_t count, uint64_t from, uint32_t *out)
{
    uint64_t written = 0;
    if (count)
        qsort(blocks, count, sizeof *blocks, compare_descending);
    for (uint64_t i = 0; i < count; i++)
        if (blocks[i] <= from)
            out[written++] = (uint32_t)(from - blocks[i]);
    return written;
}

/* Writes the listed blocks to `out`, blocks of faces first. A block is written as its distance, in
 * blocks, from the block of the subtree's first owned face or vertex. Sets the sums `after` the
 * subtree: the sums `before` the subtree plus the numbers of written blocks. Clears the lists. */
static void shared_blocks_take(shared_blocks *b, const owned_range *own, uint32_t *out,
                               const uint64_t *before, uint64_t *after)
{
    uint64_t faces = sort_blocks(b->face_block, b->face_blocks, own->face / EBPO_FACE_BLOCK, out);
    uint64_t vertices = sort_blocks(b->vertex_block, b->vertex_blocks,
                                    own->vertex / EBPO_VERTEX_BLOCK, out + faces);
    after[EBPO_S_SHARED_FACES] = before[EBPO_S_SHARED_FACES] + faces;
    after[EBPO_S_SHARED_VERTICES] = before[EBPO_S_SHARED_VERTICES] + vertices;
    b->face_blocks = b->vertex_blocks = 0;
    b->round++;
}

enum {
    DEFAULT_FACES = 512, /* default number of faces in a subtree */
    LEAST_FACES =
        131072, /* a file has subtrees by default if its mesh has at least this number of faces */
    /* pages of the workspace are released after this number of subtrees; the rows of one subtree in
     * all arrays take tens of kilobytes */
    SUBTREES_A_TIME = 128
};

int ebpo_subtree_level_for(const ebpo_info *info, uint64_t subtree_faces)
{
    uint64_t faces = subtree_faces ? subtree_faces : DEFAULT_FACES;
    if (subtree_faces == EBPO_NO_SUBTREES || (!subtree_faces && info->face_count < LEAST_FACES))
        return 0;
    /* level 1 if the caller requested subtrees and no level has enough faces per subtree */
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
    free(sums->shared);
    memset(sums, 0, sizeof *sums);
}

/* Context of the functions that count the items of subtrees. */
typedef struct counting {
    ebpo_subtree_sums *sums;
    const ebpo_tree *tree;
    const ebpo_info *info;
} counting;

/* Returns the sums of all columns over the subtrees before a subtree. */
static uint64_t *row_of(const counting *c, uint64_t subtree)
{
    return c->sums->before + subtree * c->sums->cols;
}

/* Returns the sum of one column of a level over the subtrees before a subtree. `kind`: EBPO_S_GRAY
 * and so on. */
static uint64_t level_sum(const counting *c, uint64_t subtree, int level, unsigned kind)
{
    return row_of(c, subtree)[ebpo_subtree_column(c->info, level, kind)];
}

/* Returns the first group (eight siblings) of a level that belongs to a subtree. */
static uint64_t first_group(const counting *c, uint64_t subtree, int level)
{
    return level == c->info->subtree_level + 1 ? subtree
                                               : level_sum(c, subtree, level - 1, EBPO_S_GRAY);
}

/* Adds the items of a subtree's leaves to `sum`, the columns of the level. [leaf, end): ranks of
 * these leaves. */
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

/* Computes the columns of level `number` for all subtrees, from the columns of the previous level.
 */
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

/* Finds the subtree's owned faces, [*first, *end). The new faces of its leaves (faces that no
 * earlier leaf lists) form one range without gaps. */
static void owned_faces(const counting *c, uint64_t subtree, uint64_t *first, uint64_t *end)
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

/* Counts the owned faces of each subtree, and the faces between the previous subtree's owned faces
 * and these faces, which no subtree owns. */
static void count_faces(const counting *c)
{
    uint64_t at = 0, first, end;
    for (uint64_t i = 0; i < c->sums->subtrees; i++) {
        uint64_t *from = row_of(c, i), *to = row_of(c, i + 1);
        owned_faces(c, i, &first, &end);
        /* `at` if the subtree has no owned faces */
        first = end < at || first == UINT64_MAX ? at : first;
        end = end < first ? first : end;
        to[EBPO_S_FACES_BEFORE] = from[EBPO_S_FACES_BEFORE] + first - at;
        to[EBPO_S_FACES] = from[EBPO_S_FACES] + end - first;
        at = end;
    }
}

/* Adds to *used the number of vertices that the faces [*face, end) use first, and moves *face to
 * `end`. On entry, *used is the number of vertices that the faces before *face use. */
static void count_first_uses(const ebpo_mesh *mesh, uint64_t *face, uint64_t end, uint64_t *used)
{
    EBPO_FOR_ITEMS(mesh->workspace, i, *face * 3, end * 3)
        *used += mesh->faces[i] == *used;
    *face = end;
}

/* Counts the vertices that the faces of count_faces use first. */
static void count_vertices(const counting *c)
{
    uint64_t face = 0, used = 0;
    for (uint64_t i = 0; i < c->sums->subtrees; i++) {
        uint64_t *from = row_of(c, i), *to = row_of(c, i + 1), begin = used;
        count_first_uses(&c->tree->mesh, &face, to[EBPO_S_FACES_BEFORE] + from[EBPO_S_FACES],
                         &used);
        to[EBPO_S_VERTICES_BEFORE] = from[EBPO_S_VERTICES_BEFORE] + used - begin;
        begin = used;
        count_first_uses(&c->tree->mesh, &face, to[EBPO_S_FACES_BEFORE] + to[EBPO_S_FACES], &used);
        to[EBPO_S_VERTICES] = from[EBPO_S_VERTICES] + used - begin;
    }
}

/* Lists the shared chunks of all subtrees. */
static ebpo_status list_shared(const counting *c, ebpo_error *error)
{
    shared_blocks blocks;
    ebpo_status status = shared_blocks_make(&blocks, c->info, error);
    EBPO_FOR_ITEMS_EVERY(c->tree->mesh.workspace, SUBTREES_A_TIME, i, 0, c->sums->subtrees) {
        uint64_t *from = row_of(c, i), *to = row_of(c, i + 1);
        owned_range own = {
            .face = to[EBPO_S_FACES_BEFORE] + from[EBPO_S_FACES],
            .face_end = to[EBPO_S_FACES_BEFORE] + to[EBPO_S_FACES],
            .vertex = to[EBPO_S_VERTICES_BEFORE] + from[EBPO_S_VERTICES],
        };
        if (status != EBPO_OK)
            break;
        for (int l = c->info->subtree_level + 1; l < c->info->level_count; l++) {
            uint64_t first = level_sum(c, i, l, EBPO_S_REFS),
                     end = level_sum(c, i + 1, l, EBPO_S_REFS);
            if (end > first) /* an empty level has no array */
                shared_blocks_refer(&blocks, &c->tree->mesh, &own,
                                    c->tree->level[l].leaf_refs + first, end - first);
        }
        shared_blocks_use(&blocks, &c->tree->mesh, &own);
        if (!ebpo_grow(&c->sums->shared, &c->sums->shared_capacity,
                       c->sums->shared_count + blocks.face_blocks + blocks.vertex_blocks +
                           1, /* so that `shared` is never NULL */
                       sizeof *c->sums->shared))
            status = ebpo_fail_memory(error, c->sums->shared_count * sizeof *c->sums->shared);
        else
            shared_blocks_take(&blocks, &own, c->sums->shared + c->sums->shared_count, from, to);
        c->sums->shared_count = to[EBPO_S_SHARED_FACES] + to[EBPO_S_SHARED_VERTICES];
    }
    shared_blocks_free(&blocks);
    return status;
}

/* Computes /subtrees/counts (the differences of the sums) and the sums before each chunk of counts.
 * Returns false if a count exceeds 32 bits. */
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
        status = list_shared(&c, error);
    }
    if (status == EBPO_OK && !split_sums(&c))
        status = ebpo_fail(error, EBPO_E_LIMIT,
                           "a subtree has more than 4,294,967,295 nodes, planes or references in a "
                           "level; write the file without subtrees");
    return status;
}

/* --- the order of chunks --- */

/* Returns the number of rows of an array before subtree i. */
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

/* Returns the subtree to which a row belongs. `id`: an array of the mesh, of source indices, or of
 * a level below the subtrees' roots. Rows before the first subtree count as rows of the first
 * subtree. */
static uint64_t subtree_of_row(const ebpo_subtree_sums *sums, const ebpo_info *info,
                               ebpo_array_id id, int level, uint64_t row)
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

/* State of ordering the chunks. */
typedef struct ordering {
    const ebpo_plan *plan;
    ebpo_chunk_order *out;
} ordering;

/* Appends all chunks of an array to the order. */
static void add_array(ordering *o, unsigned array)
{
    const ebpo_array_out *a = &o->plan->array[array];
    uint64_t chunks = ebpo_shape_chunks(&a->shape);
    for (uint64_t k = 0; k < chunks; k++)
        o->out->chunk[o->out->count++] = (ebpo_ordered_chunk){ array, (uint32_t)k, 0 };
}

/* Compares chunks by subtree, then by array, then by number. */
static int by_subtree(const void *a, const void *b)
{
    const ebpo_ordered_chunk *x = a, *y = b;
    if (x->subtree != y->subtree)
        return x->subtree < y->subtree ? -1 : 1;
    return x->array != y->array ? (x->array > y->array) - (x->array < y->array)
                                : (x->chunk > y->chunk) - (x->chunk < y->chunk);
}

/* Selects the arrays whose chunks come next in the file. */
typedef struct choice {
    int first_level, last_level; /* range of levels, for arrays of levels */
    enum {
        WHOLE,           /* all arrays of the levels */
        TOP_INDEXES,     /* index arrays of the levels, and other arrays that locate subtrees */
        SURFACE,         /* arrays of /surface */
        NODES,           /* arrays of the levels that describe nodes */
        LISTS,           /* arrays of the levels that describe face lists */
        MESH,            /* vertices, faces, and source indices of faces */
        MAPS,            /* source indices of vertices */
        TABLE,           /* /subtrees/counts and /subtrees/shared_chunks */
        OF_MESH,         /* attributes of vertices and faces */
        OTHER_ATTRIBUTES /* attributes of other elements */
    } kind;
} choice;

/* Returns true for arrays of a level that describe face lists; the other arrays of a level describe
 * nodes. */
static bool is_of_faces(ebpo_array_id id)
{
    return id == EBPO_A_LEAF_SKIP || id == EBPO_A_LEAF_NEW || id == EBPO_A_LEAF_REF_COUNT ||
           id == EBPO_A_LEAF_REFS;
}

static bool is_chosen(const choice *c, const ebpo_array_out *a)
{
    bool of_level = a->id < EBPO_LEVEL_ARRAYS,
         in_range = of_level && a->level >= c->first_level && a->level <= c->last_level,
         index = of_level && ebpo_schema_is_index(a->id);
    switch (c->kind) {
    case WHOLE: return in_range;
    case TOP_INDEXES:
        return (in_range && index) || a->id == EBPO_A_SUBTREE_INDEX ||
               a->id == EBPO_A_FACES_INDEX || a->id == EBPO_A_BORDER_LOOPS ||
               a->id == EBPO_A_BORDER_POINTS;
    case SURFACE: return a->id >= EBPO_A_SURFACE_PATCHES && a->id <= EBPO_A_SURFACE_COLOURS;
    case NODES: return in_range && !index && !is_of_faces(a->id);
    case LISTS: return in_range && is_of_faces(a->id);
    /* query results contain source face indices, which are requested together with the faces */
    case MESH:
        return a->id == EBPO_A_VERTICES || a->id == EBPO_A_FACES || a->id == EBPO_A_FACE_SOURCE;
    case MAPS: return a->id == EBPO_A_VERTEX_SOURCE;
    case OF_MESH: return a->id == EBPO_A_ATTRIBUTE && a->rows_of != EBPO_A_ATTRIBUTE;
    case OTHER_ATTRIBUTES: return a->id == EBPO_A_ATTRIBUTE && a->rows_of == EBPO_A_ATTRIBUTE;
    case TABLE: return a->id == EBPO_A_SUBTREE_COUNTS || a->id == EBPO_A_SUBTREE_SHARED;
    }
    return false;
}

static void add_chosen_chunks(ordering *o, const choice *c)
{
    for (unsigned i = 0; i < o->plan->count; i++)
        if (is_chosen(c, &o->plan->array[i]))
            add_array(o, i);
}

/* Adds the chosen chunks, sorted by subtree. */
static void add_by_subtree(ordering *o, const choice *c)
{
    uint64_t begin = o->out->count;
    add_chosen_chunks(o, c);
    for (uint64_t i = begin; i < o->out->count; i++) {
        ebpo_ordered_chunk *chunk = &o->out->chunk[i];
        const ebpo_array_out *a = &o->plan->array[chunk->array];
        uint64_t row = (uint64_t)chunk->chunk * a->shape.chunk_rows;
        chunk->subtree =
            a->id == EBPO_A_ATTRIBUTE
                ? subtree_of_row(&o->plan->subtrees, &o->plan->info, a->rows_of, 0, row)
                : subtree_of_row(&o->plan->subtrees, &o->plan->info, a->id, a->level, row);
    }
    if (o->out->count > begin)
        qsort(o->out->chunk + begin, o->out->count - begin, sizeof *o->out->chunk, by_subtree);
}

/* Orders the chunks of a file with subtrees: first the chunks that locate subtrees, then nodes from
 * coarse to deep levels, then the mesh, source indices and attributes. */
static void order_subtrees(ordering *o)
{
    const ebpo_info *info = &o->plan->info;
    int whole_level = last_whole_level(info), deep_level = first_deep_level(info),
        last = info->level_count - 1;
    add_chosen_chunks(o, &(choice){ 0, whole_level, WHOLE });
    add_chosen_chunks(o, &(choice){ whole_level + 1, last, TOP_INDEXES });
    o->out->top = o->out->count;
    add_chosen_chunks(o, &(choice){ 0, 0, SURFACE });
    add_chosen_chunks(o, &(choice){ 0, 0, TABLE });
    for (int level = whole_level + 1; level < deep_level; level++)
        add_by_subtree(o, &(choice){ level, level, NODES });
    add_by_subtree(o, &(choice){ whole_level + 1, deep_level - 1, LISTS });
    add_by_subtree(o, &(choice){ deep_level, last, NODES });
    add_by_subtree(o, &(choice){ deep_level, last, LISTS });
    add_by_subtree(o, &(choice){ 0, 0, MESH });
    add_by_subtree(o, &(choice){ 0, 0, MAPS });
    add_by_subtree(o, &(choice){ 0, 0, OF_MESH });
    add_chosen_chunks(o, &(choice){ 0, 0, OTHER_ATTRIBUTES });
}

ebpo_status ebpo_chunk_order_make(ebpo_chunk_order *out, const ebpo_plan *plan, ebpo_error *error)
{
    ordering o = { plan, out };
    uint64_t chunks = 0;
    *out = (ebpo_chunk_order){ NULL, 0, 0 };
    for (unsigned i = 0; i < plan->count; i++)
        chunks += ebpo_shape_chunks(&plan->array[i].shape);
    out->chunk = ebpo_alloc(chunks, sizeof *out->chunk);
    if (!out->chunk)
        return ebpo_fail_memory(error, chunks * sizeof *out->chunk);
    if (plan->info.subtree_level)
        order_subtrees(&o);
    else
        for (unsigned i = 0; i < plan->count; i++)
            add_array(&o, i);
    return EBPO_OK;
}

void ebpo_chunk_order_free(ebpo_chunk_order *order)
{
    free(order->chunk);
    *order = (ebpo_chunk_order){ NULL, 0, 0 };
}
